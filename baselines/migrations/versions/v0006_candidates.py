"""Which part an alert is about, and which causes are possible: alert.channel and alert.candidates."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the columns. Alerts that are there have no part and no candidates."""
    op.add_column("alert", sa.Column("channel", sa.String(63), nullable=True))
    op.add_column("alert", sa.Column("candidates", sa.JSON, nullable=True))


def downgrade() -> None:
    """Drop them."""
    with op.batch_alter_table("alert") as alert:
        alert.drop_column("candidates")
        alert.drop_column("channel")
