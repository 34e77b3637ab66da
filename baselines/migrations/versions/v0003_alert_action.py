"""What people did to alerts, by request key: alert_action."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the table."""
    op.create_table(
        "alert_action",
        sa.Column("key", sa.String(200), nullable=False),
        sa.Column("alert_id", sa.String(200), nullable=False),
        sa.Column("action", sa.String(20), nullable=False),
        sa.Column("who", sa.Text, nullable=False),
        sa.Column("note", sa.Text, nullable=False),
        sa.Column("at_s", sa.Double, nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_alert_action"),
    )
    op.create_index("ix_alert_action_at_s", "alert_action", ["at_s"])


def downgrade() -> None:
    """Drop it, with all it holds."""
    op.drop_table("alert_action")
