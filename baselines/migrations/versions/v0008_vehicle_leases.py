"""Which worker watches which vehicle: worker_lease and vehicle_lease."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the tables. Nobody watches anything yet."""
    op.create_table(
        "worker_lease",
        sa.Column("owner", sa.String(63), nullable=False),
        sa.Column("until_s", sa.Double, nullable=False),
        sa.PrimaryKeyConstraint("owner", name="pk_worker_lease"),
    )
    op.create_table(
        "vehicle_lease",
        sa.Column("fleet", sa.String(63), nullable=False),
        sa.Column("vehicle", sa.String(63), nullable=False),
        sa.Column("owner", sa.String(63), nullable=False),
        sa.Column("number", sa.BigInteger, nullable=False),
        sa.PrimaryKeyConstraint("fleet", "vehicle", name="pk_vehicle_lease"),
    )
    op.create_index("ix_vehicle_lease_owner", "vehicle_lease", ["owner"])


def downgrade() -> None:
    """Drop them."""
    op.drop_table("vehicle_lease")
    op.drop_table("worker_lease")
