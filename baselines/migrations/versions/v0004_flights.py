"""History of estimates by flight: flight and estimate_history take the place of estimate_record.

What was kept goes over. Earlier rows have no wall clock: theirs stays empty, and their flights count as ended now.
"""

import json
import math
import struct
from collections.abc import Iterator
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

_KEY = sa.BigInteger().with_variant(sa.Integer, "sqlite")
_AT_ONCE = 5000
_NOW = {
    "sqlite": "SELECT (julianday('now') - 2440587.5) * 86400.0",
    "postgresql": "SELECT extract(epoch FROM now())",
}
_NUMBERS = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


def upgrade() -> None:
    """Create the tables and move what is kept."""
    op.create_table(
        "flight",
        sa.Column("id", _KEY, autoincrement=True, nullable=False),
        sa.Column("fleet", sa.String(63), nullable=False),
        sa.Column("vehicle", sa.String(63), nullable=False),
        sa.Column("aircraft", sa.String(200), nullable=False),
        sa.Column("configuration", sa.String(100), nullable=False),
        sa.Column("began_at_s", sa.Double, nullable=True),
        sa.Column("last_at_s", sa.Double, nullable=False),
        sa.Column("first_time_s", sa.Double, nullable=False),
        sa.Column("last_time_s", sa.Double, nullable=False),
        sa.Column("rows", _KEY, nullable=False),
        sa.Column("thinned_time_s", sa.Double, nullable=True),
        sa.Column("thinned_at_s", sa.Double, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_flight"),
    )
    op.create_index("ix_flight_vehicle", "flight", ["fleet", "vehicle", "id"])
    op.create_index("ix_flight_last_at_s", "flight", ["last_at_s"])
    op.create_table(
        "estimate_history",
        sa.Column("flight_id", _KEY, nullable=False),
        sa.Column("time_s", sa.Double, nullable=False),
        sa.Column("estimator", sa.String(50), nullable=False),
        sa.Column("structure", sa.String(50), nullable=False),
        sa.Column("at_s", sa.Double, nullable=True),
        sa.Column("outcome", sa.String(20), nullable=False),
        sa.Column("numbers", sa.LargeBinary, nullable=False),
        sa.PrimaryKeyConstraint("flight_id", "time_s", "estimator", "structure", name="pk_estimate_history"),
        sa.ForeignKeyConstraint(["flight_id"], ["flight.id"], name="fk_estimate_history_flight_id"),
        sqlite_with_rowid=False,
    )
    _move(op.get_bind())
    op.drop_table("estimate_record")


def downgrade() -> None:
    """Refused: the older form cannot hold what the newer one does, and wingwatch never goes back by itself.

    Raises:
        RuntimeError: always.
    """
    raise RuntimeError("history by flight has no older form: restore a copy made before the update")


def _move(connection: sa.Connection) -> None:
    now_s = float(connection.execute(sa.text(_NOW[connection.dialect.name])).scalar_one())
    owners = connection.execute(sa.text("SELECT DISTINCT fleet, vehicle FROM estimate_record")).all()
    for fleet, vehicle in owners:
        flight: dict[str, Any] | None = None
        waiting: dict[tuple[float, str, str], dict[str, Any]] = {}
        for row in _rows(connection, fleet, vehicle):
            if flight is None or row["time_s"] < flight["last_time_s"]:
                _write(connection, flight, waiting)
                flight = _new_flight(connection, fleet, vehicle, row["time_s"], now_s)
            flight["last_time_s"] = row["time_s"]
            waiting[row["time_s"], row["estimator"], row["structure"]] = row
            if len(waiting) >= _AT_ONCE:
                _write(connection, flight, waiting)
        _write(connection, flight, waiting)


def _rows(connection: sa.Connection, fleet: str, vehicle: str) -> Iterator[dict[str, Any]]:
    after = -1
    query = sa.text(
        "SELECT id, time_s, estimator, structure, outcome, value, standard_error, condition FROM estimate_record "
        "WHERE fleet = :fleet AND vehicle = :vehicle AND id > :after ORDER BY id LIMIT :most"
    )
    while True:
        given = {"fleet": fleet, "vehicle": vehicle, "after": after, "most": _AT_ONCE}
        found = connection.execute(query, given).mappings().all()
        if not found:
            return
        after = found[-1]["id"]
        yield from map(dict, found)


def _new_flight(
    connection: sa.Connection, fleet: str, vehicle: str, time_s: float, now_s: float
) -> dict[str, Any]:
    values = {"fleet": fleet, "vehicle": vehicle, "time_s": time_s, "now_s": now_s}
    insert = sa.text(
        "INSERT INTO flight (fleet, vehicle, aircraft, configuration, began_at_s, last_at_s, "
        "first_time_s, last_time_s, rows, thinned_time_s, thinned_at_s) VALUES "
        "(:fleet, :vehicle, '', '', NULL, :now_s, :time_s, :time_s, 0, NULL, :now_s - 1.0) RETURNING id"
    )
    return {"id": connection.execute(insert, values).scalar_one(), "last_time_s": time_s}


def _write(
    connection: sa.Connection,
    flight: dict[str, Any] | None,
    waiting: dict[tuple[float, str, str], dict[str, Any]],
) -> None:
    if flight is None or not waiting:
        return
    insert = sa.text(
        "INSERT INTO estimate_history (flight_id, time_s, estimator, structure, at_s, outcome, numbers) VALUES "
        "(:flight_id, :time_s, :estimator, :structure, NULL, :outcome, :numbers) ON CONFLICT DO NOTHING"
    )
    names = ("time_s", "estimator", "structure", "outcome")
    connection.execute(
        insert,
        [
            {**{n: row[n] for n in names}, "flight_id": flight["id"], "numbers": _packed(row)}
            for row in waiting.values()
        ],
    )
    update = sa.text("UPDATE flight SET last_time_s = :last_time_s, rows = rows + :more WHERE id = :id")
    connection.execute(update, flight | {"more": len(waiting)})
    waiting.clear()


def _packed(row: dict[str, Any]) -> bytes:
    value, error, condition = (_floats(row[name]) for name in ("value", "standard_error", "condition"))
    numbers = [*value, *error, *condition]
    return struct.pack(f"<B{len(numbers)}d", len(value), *numbers)


def _floats(stored: Any) -> list[float]:
    """Of SQLite's text or PostgreSQL's JSON."""
    listed = json.loads(stored) if isinstance(stored, str) else stored
    return [_NUMBERS[x] if isinstance(x, str) else float(x) for x in listed]
