"""The tables, the same on SQLite and PostgreSQL. A change here needs a migration beside it."""

import math
from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Dialect,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Text,
    TypeDecorator,
    UniqueConstraint,
    text,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

__all__ = [
    "ActionRow",
    "AlertRow",
    "Base",
    "CellRow",
    "ChangeRow",
    "ExpectationRow",
    "FlightRow",
    "HistoryEntry",
    "ReferenceRow",
    "VehicleLeaseRow",
    "WorkerLeaseRow",
]

_NON_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


class Numbers(TypeDecorator[Any]):
    """Nested lists (and dictionaries) of floats as JSON, exact.

    JSON has no NaN and no infinity and PostgreSQL refuses them, so these three are written as text.
    """

    impl = JSON
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> Any:
        """Python to database."""
        return _encode(value)

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        """Database to Python."""
        return _decode(value)


class MaybeNumber(TypeDecorator[float]):
    """A float whose NaN is stored as NULL (SQLite has no NaN), and read back as NaN."""

    impl = Double
    cache_ok = True

    def process_bind_param(self, value: float | None, dialect: Dialect) -> float | None:
        """Python to database."""
        return None if value is None or math.isnan(value) else value

    def process_result_value(self, value: float | None, dialect: Dialect) -> float:
        """Database to Python."""
        return math.nan if value is None else value


def _encode(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_encode(v) for v in value]
    if isinstance(value, dict):
        return {k: _encode(v) for k, v in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else ("Infinity" if value > 0.0 else "-Infinity")
    return value


def _decode(value: Any) -> Any:
    if isinstance(value, list):
        return [_decode(v) for v in value]
    if isinstance(value, dict):
        return {k: _decode(v) for k, v in value.items()}
    return _NON_FINITE.get(value, value) if isinstance(value, str) else value


_Key = BigInteger().with_variant(Integer, "sqlite")  # SQLite counts up only where the type is INTEGER


class Base(DeclarativeBase):
    """Every table, with fixed names of constraints so that migrations can name them."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s",
            "pk": "pk_%(table_name)s",
        }
    )


class ExpectationRow(Base):
    """An entry of the baseline; superseded entries stay as its history."""

    __tablename__ = "expectation"

    id: Mapped[int] = mapped_column(_Key, primary_key=True, autoincrement=True)
    aircraft: Mapped[str] = mapped_column(String(200))
    configuration: Mapped[str] = mapped_column(String(100))
    structure: Mapped[str] = mapped_column(String(50))
    airspeed_true_m_s: Mapped[float] = mapped_column(Double)
    altitude_m: Mapped[float] = mapped_column(Double)
    air_density_kg_m3: Mapped[float] = mapped_column(Double)
    angle_of_attack_rad: Mapped[float] = mapped_column(Double)
    value: Mapped[list[float]] = mapped_column(Numbers)
    covariance: Mapped[list[list[float]]] = mapped_column(Numbers)
    provenance: Mapped[str] = mapped_column(String(20))
    source: Mapped[str] = mapped_column(Text)
    created_at_s: Mapped[float] = mapped_column(Double)
    superseded_by: Mapped[int | None] = mapped_column(_Key, ForeignKey("expectation.id"))
    change_id: Mapped[int | None] = mapped_column(_Key)

    __table_args__ = (
        Index(
            "uq_expectation_current",
            "aircraft",
            "configuration",
            "structure",
            "airspeed_true_m_s",
            "altitude_m",
            unique=True,
            sqlite_where=text("superseded_by IS NULL"),
            postgresql_where=text("superseded_by IS NULL"),
        ),
    )


class ReferenceRow(Base):
    """One saved version of a vehicle's reference; the newest id of a key that is not withdrawn is the current one."""

    __tablename__ = "reference"

    id: Mapped[int] = mapped_column(_Key, primary_key=True, autoincrement=True)
    fleet: Mapped[str] = mapped_column(String(63))
    vehicle: Mapped[str] = mapped_column(String(63))
    aircraft: Mapped[str] = mapped_column(String(200))
    configuration: Mapped[str] = mapped_column(String(100))
    structure: Mapped[str] = mapped_column(String(50))
    information: Mapped[list[list[float]]] = mapped_column(Numbers)
    vector: Mapped[list[float]] = mapped_column(Numbers)
    blocks: Mapped[int] = mapped_column(Integer)
    seconds: Mapped[float] = mapped_column(Double)
    updated_at_s: Mapped[float] = mapped_column(Double)
    source: Mapped[str | None] = mapped_column(Text)
    change_id: Mapped[int | None] = mapped_column(_Key)
    withdrawn_by: Mapped[int | None] = mapped_column(_Key)

    __table_args__ = (
        Index("ix_reference_key", "fleet", "vehicle", "aircraft", "configuration", "structure", "id"),
        Index(
            "ix_reference_source",
            "aircraft",
            "configuration",
            sqlite_where=text("source IS NOT NULL"),
            postgresql_where=text("source IS NOT NULL"),
        ),
    )


class CellRow(Base):
    """What a vehicle's blocks in one cell of the envelope taught; one row a cell, replaced as it grows."""

    __tablename__ = "cell_memory"

    id: Mapped[int] = mapped_column(_Key, primary_key=True, autoincrement=True)
    fleet: Mapped[str] = mapped_column(String(63))
    vehicle: Mapped[str] = mapped_column(String(63))
    aircraft: Mapped[str] = mapped_column(String(200))
    configuration: Mapped[str] = mapped_column(String(100))
    structure: Mapped[str] = mapped_column(String(50))
    airspeed_cell: Mapped[int] = mapped_column(Integer)
    altitude_cell: Mapped[int] = mapped_column(Integer)
    information: Mapped[list[list[float]]] = mapped_column(Numbers)
    vector: Mapped[list[float]] = mapped_column(Numbers)
    blocks: Mapped[int] = mapped_column(Integer)
    seconds: Mapped[float] = mapped_column(Double)
    updated_at_s: Mapped[float] = mapped_column(Double)

    __table_args__ = (
        UniqueConstraint(
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


class ChangeRow(Base):
    """One change that a person made to the baseline; by its id a running service notices it.

    Without a vehicle it is about expectations. ``cells_before`` is what cells of the envelope held before it: so it can
    be taken back.
    """

    __tablename__ = "baseline_change"

    id: Mapped[int] = mapped_column(_Key, primary_key=True, autoincrement=True)
    at_s: Mapped[float] = mapped_column(Double)
    action: Mapped[str] = mapped_column(String(20))
    who: Mapped[str] = mapped_column(Text)
    aircraft: Mapped[str] = mapped_column(String(200))
    configuration: Mapped[str] = mapped_column(String(100))
    fleet: Mapped[str | None] = mapped_column(String(63))
    vehicle: Mapped[str | None] = mapped_column(String(63))
    text: Mapped[str] = mapped_column(Text)
    cells_before: Mapped[list[dict[str, Any]] | None] = mapped_column(Numbers(none_as_null=True))


class AlertRow(Base):
    """An alert; ``serial`` is the order in which alerts came and what a page's cursor points at."""

    __tablename__ = "alert"

    serial: Mapped[int] = mapped_column(_Key, primary_key=True, autoincrement=True)
    id: Mapped[str] = mapped_column(String(200), unique=True)
    fleet: Mapped[str] = mapped_column(String(63))
    vehicle: Mapped[str] = mapped_column(String(63))
    kind: Mapped[str] = mapped_column(String(50))
    cause: Mapped[str] = mapped_column(String(100))
    level: Mapped[str] = mapped_column(String(20))
    state: Mapped[str] = mapped_column(String(20))
    raised_s: Mapped[float] = mapped_column(Double)
    cleared_s: Mapped[float | None] = mapped_column(Double)
    size: Mapped[float] = mapped_column(MaybeNumber, nullable=True)
    size_standard_error: Mapped[float] = mapped_column(MaybeNumber, nullable=True)
    probability: Mapped[float] = mapped_column(MaybeNumber, nullable=True)
    basis: Mapped[str] = mapped_column(String(50))
    text: Mapped[str] = mapped_column(Text)
    evidence: Mapped[list[dict[str, Any]]] = mapped_column(Numbers)
    note: Mapped[list[str]] = mapped_column(JSON)
    created_at_s: Mapped[float] = mapped_column(Double)
    updated_at_s: Mapped[float] = mapped_column(Double)
    shelving: Mapped[dict[str, Any] | None] = mapped_column(Numbers(none_as_null=True))
    channel: Mapped[str | None] = mapped_column(String(63))
    candidates: Mapped[list[dict[str, Any]] | None] = mapped_column(Numbers(none_as_null=True))

    __table_args__ = (
        Index("ix_alert_fleet_vehicle", "fleet", "vehicle"),
        Index("ix_alert_state", "state"),
    )


class ActionRow(Base):
    """What a person did to an alert, under the key of the request: a repeated request is recognised by it."""

    __tablename__ = "alert_action"

    key: Mapped[str] = mapped_column(String(200), primary_key=True)
    alert_id: Mapped[str] = mapped_column(String(200))
    action: Mapped[str] = mapped_column(String(20))
    who: Mapped[str] = mapped_column(Text)
    note: Mapped[str] = mapped_column(Text)
    at_s: Mapped[float] = mapped_column(Double)

    __table_args__ = (Index("ix_alert_action_at_s", "at_s"),)


class FlightRow(Base):
    """One flight of a vehicle, as far as the history of its estimates goes.

    ``at_s`` is wall clock, ``time_s`` the vehicle's; ``rows`` counts its estimates. What is older than ``thinned_at_s``
    is thinned, as far as ``thinned_time_s``.
    """

    __tablename__ = "flight"

    id: Mapped[int] = mapped_column(_Key, primary_key=True, autoincrement=True)
    fleet: Mapped[str] = mapped_column(String(63))
    vehicle: Mapped[str] = mapped_column(String(63))
    aircraft: Mapped[str] = mapped_column(String(200))
    configuration: Mapped[str] = mapped_column(String(100))
    began_at_s: Mapped[float | None] = mapped_column(Double)
    last_at_s: Mapped[float] = mapped_column(Double)
    first_time_s: Mapped[float] = mapped_column(Double)
    last_time_s: Mapped[float] = mapped_column(Double)
    rows: Mapped[int] = mapped_column(_Key)
    thinned_time_s: Mapped[float | None] = mapped_column(Double)
    thinned_at_s: Mapped[float] = mapped_column(Double)

    __table_args__ = (
        Index("ix_flight_vehicle", "fleet", "vehicle", "id"),
        Index("ix_flight_last_at_s", "last_at_s"),
    )


class HistoryEntry(Base):
    """One estimate kept for history; the key is the order in which history is read.

    ``numbers``: a byte k, then as little-endian doubles k values, k standard errors, airspeed, altitude, density, angle
    of attack, and the covariance below its diagonal, row by row, where it is known.
    """

    __tablename__ = "estimate_history"

    flight_id: Mapped[int] = mapped_column(_Key, ForeignKey("flight.id"), primary_key=True)
    time_s: Mapped[float] = mapped_column(Double, primary_key=True)
    estimator: Mapped[str] = mapped_column(String(50), primary_key=True)
    structure: Mapped[str] = mapped_column(String(50), primary_key=True)
    at_s: Mapped[float | None] = mapped_column(Double)
    outcome: Mapped[str] = mapped_column(String(20))
    numbers: Mapped[bytes] = mapped_column(LargeBinary)

    __table_args__ = ({"sqlite_with_rowid": False},)


class WorkerLeaseRow(Base):
    """A worker that may hold vehicles, until ``until_s`` by the database's clock (seconds since 1970)."""

    __tablename__ = "worker_lease"

    owner: Mapped[str] = mapped_column(String(63), primary_key=True)
    until_s: Mapped[float] = mapped_column(Double)


class VehicleLeaseRow(Base):
    """Who watches a vehicle (nobody where ``owner`` is empty); ``number`` grows whenever it changes hands."""

    __tablename__ = "vehicle_lease"

    fleet: Mapped[str] = mapped_column(String(63), primary_key=True)
    vehicle: Mapped[str] = mapped_column(String(63), primary_key=True)
    owner: Mapped[str] = mapped_column(String(63))
    number: Mapped[int] = mapped_column(BigInteger)

    __table_args__ = (Index("ix_vehicle_lease_owner", "owner"),)
