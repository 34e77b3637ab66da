"""Changes that people make to the baseline, and what each entry and version of a reference comes from."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None

_KEY = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """Add the table and the columns. What is there already has no change and no source."""
    op.create_table(
        "baseline_change",
        sa.Column("id", _KEY, autoincrement=True, nullable=False),
        sa.Column("at_s", sa.Double, nullable=False),
        sa.Column("action", sa.String(20), nullable=False),
        sa.Column("who", sa.Text, nullable=False),
        sa.Column("aircraft", sa.String(200), nullable=False),
        sa.Column("configuration", sa.String(100), nullable=False),
        sa.Column("fleet", sa.String(63), nullable=True),
        sa.Column("vehicle", sa.String(63), nullable=True),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("cells_before", sa.JSON, nullable=True),
        sa.PrimaryKeyConstraint("id", name="pk_baseline_change"),
    )
    op.add_column("expectation", sa.Column("change_id", _KEY, nullable=True))
    op.add_column("reference", sa.Column("source", sa.Text, nullable=True))
    op.add_column("reference", sa.Column("change_id", _KEY, nullable=True))
    op.create_index(
        "ix_reference_source",
        "reference",
        ["aircraft", "configuration"],
        sqlite_where=sa.text("source IS NOT NULL"),
        postgresql_where=sa.text("source IS NOT NULL"),
    )
    op.add_column("reference", sa.Column("withdrawn_by", _KEY, nullable=True))


def downgrade() -> None:
    """Drop them."""
    op.drop_index("ix_reference_source", "reference")
    with op.batch_alter_table("reference") as reference:
        for name in ("source", "change_id", "withdrawn_by"):
            reference.drop_column(name)
    with op.batch_alter_table("expectation") as expectation:
        expectation.drop_column("change_id")
    op.drop_table("baseline_change")
