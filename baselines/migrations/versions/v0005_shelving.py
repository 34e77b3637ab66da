"""Until when an alert is shelved, and what it was like then: alert.shelving."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column. Alerts that are shelved stay so, until a person or their growth ends it."""
    op.add_column("alert", sa.Column("shelving", sa.JSON, nullable=True))


def downgrade() -> None:
    """Drop it."""
    with op.batch_alter_table("alert") as alert:
        alert.drop_column("shelving")
