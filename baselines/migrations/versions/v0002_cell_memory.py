"""Memory of each cell of the envelope: cell_memory."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

_KEY = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """Create the table."""
    op.create_table(
        "cell_memory",
        sa.Column("id", _KEY, autoincrement=True, nullable=False),
        sa.Column("fleet", sa.String(63), nullable=False),
        sa.Column("vehicle", sa.String(63), nullable=False),
        sa.Column("aircraft", sa.String(200), nullable=False),
        sa.Column("configuration", sa.String(100), nullable=False),
        sa.Column("structure", sa.String(50), nullable=False),
        sa.Column("airspeed_cell", sa.Integer, nullable=False),
        sa.Column("altitude_cell", sa.Integer, nullable=False),
        sa.Column("information", sa.JSON, nullable=False),
        sa.Column("vector", sa.JSON, nullable=False),
        sa.Column("blocks", sa.Integer, nullable=False),
        sa.Column("seconds", sa.Double, nullable=False),
        sa.Column("updated_at_s", sa.Double, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_cell_memory"),
        sa.UniqueConstraint(
            "fleet",
            "vehicle",
            "aircraft",
            "configuration",
            "structure",
            "airspeed_cell",
            "altitude_cell",
            name="uq_cell_memory",
        ),
    )


def downgrade() -> None:
    """Drop it, with all it holds."""
    op.drop_table("cell_memory")
