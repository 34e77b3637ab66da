"""Alembic's entry: runs the revisions on the connection that the caller hands in, inside its transaction."""

from alembic import context

from wingwatch.baselines.tables import Base

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=Base.metadata,
    version_table=context.config.attributes["version_table"],
    render_as_batch=True,  # SQLite alters tables by copying them
    transactional_ddl=True,  # the connection begins transactions itself, so a half-done upgrade rolls back
)
with context.begin_transaction():
    context.run_migrations()
