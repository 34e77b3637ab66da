"""The first schema: expectation, reference, alert, estimate_record."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

_KEY = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """Create the tables."""
    _expectation()
    _reference()
    _alert()
    _estimate_record()


def downgrade() -> None:
    """Drop them, with all they hold."""
    for table in ("estimate_record", "alert", "reference", "expectation"):
        op.drop_table(table)


def _expectation() -> None:
    op.create_table(
        "expectation",
        sa.Column("id", _KEY, autoincrement=True, nullable=False),
        sa.Column("aircraft", sa.String(200), nullable=False),
        sa.Column("configuration", sa.String(100), nullable=False),
        sa.Column("structure", sa.String(50), nullable=False),
        sa.Column("airspeed_true_m_s", sa.Double, nullable=False),
        sa.Column("altitude_m", sa.Double, nullable=False),
        sa.Column("air_density_kg_m3", sa.Double, nullable=False),
        sa.Column("angle_of_attack_rad", sa.Double, nullable=False),
        sa.Column("value", sa.JSON, nullable=False),
        sa.Column("covariance", sa.JSON, nullable=False),
        sa.Column("provenance", sa.String(20), nullable=False),
        sa.Column("source", sa.Text, nullable=False),
        sa.Column("created_at_s", sa.Double, nullable=False),
        sa.Column("superseded_by", _KEY, nullable=True),
        sa.PrimaryKeyConstraint("id", name="pk_expectation"),
        sa.ForeignKeyConstraint(["superseded_by"], ["expectation.id"], name="fk_expectation_superseded_by"),
    )
    current = sa.text("superseded_by IS NULL")
    op.create_index(
        "uq_expectation_current",
        "expectation",
        ["aircraft", "configuration", "structure", "airspeed_true_m_s", "altitude_m"],
        unique=True,
        sqlite_where=current,
        postgresql_where=current,
    )


def _reference() -> None:
    op.create_table(
        "reference",
        sa.Column("id", _KEY, autoincrement=True, nullable=False),
        sa.Column("fleet", sa.String(63), nullable=False),
        sa.Column("vehicle", sa.String(63), nullable=False),
        sa.Column("aircraft", sa.String(200), nullable=False),
        sa.Column("configuration", sa.String(100), nullable=False),
        sa.Column("structure", sa.String(50), nullable=False),
        sa.Column("information", sa.JSON, nullable=False),
        sa.Column("vector", sa.JSON, nullable=False),
        sa.Column("blocks", sa.Integer, nullable=False),
        sa.Column("seconds", sa.Double, nullable=False),
        sa.Column("updated_at_s", sa.Double, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_reference"),
    )
    op.create_index(
        "ix_reference_key",
        "reference",
        ["fleet", "vehicle", "aircraft", "configuration", "structure", "id"],
    )


def _alert() -> None:
    op.create_table(
        "alert",
        sa.Column("serial", _KEY, autoincrement=True, nullable=False),
        sa.Column("id", sa.String(200), nullable=False),
        sa.Column("fleet", sa.String(63), nullable=False),
        sa.Column("vehicle", sa.String(63), nullable=False),
        sa.Column("kind", sa.String(50), nullable=False),
        sa.Column("cause", sa.String(100), nullable=False),
        sa.Column("level", sa.String(20), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("raised_s", sa.Double, nullable=False),
        sa.Column("cleared_s", sa.Double, nullable=True),
        sa.Column("size", sa.Double, nullable=True),
        sa.Column("size_standard_error", sa.Double, nullable=True),
        sa.Column("probability", sa.Double, nullable=True),
        sa.Column("basis", sa.String(50), nullable=False),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("evidence", sa.JSON, nullable=False),
        sa.Column("note", sa.JSON, nullable=False),
        sa.Column("created_at_s", sa.Double, nullable=False),
        sa.Column("updated_at_s", sa.Double, nullable=False),
        sa.PrimaryKeyConstraint("serial", name="pk_alert"),
        sa.UniqueConstraint("id", name="uq_alert_id"),
    )
    op.create_index("ix_alert_fleet_vehicle", "alert", ["fleet", "vehicle"])
    op.create_index("ix_alert_state", "alert", ["state"])


def _estimate_record() -> None:
    op.create_table(
        "estimate_record",
        sa.Column("id", _KEY, autoincrement=True, nullable=False),
        sa.Column("fleet", sa.String(63), nullable=False),
        sa.Column("vehicle", sa.String(63), nullable=False),
        sa.Column("time_s", sa.Double, nullable=False),
        sa.Column("structure", sa.String(50), nullable=False),
        sa.Column("estimator", sa.String(50), nullable=False),
        sa.Column("value", sa.JSON, nullable=False),
        sa.Column("standard_error", sa.JSON, nullable=False),
        sa.Column("outcome", sa.String(20), nullable=False),
        sa.Column("condition", sa.JSON, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_estimate_record"),
    )
    op.create_index("ix_estimate_record_time", "estimate_record", ["fleet", "vehicle", "time_s"])
    op.create_index("ix_estimate_record_age", "estimate_record", ["fleet", "vehicle", "id"])
