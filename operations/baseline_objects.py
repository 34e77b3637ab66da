"""The baseline as objects: what `wingwatch baseline --json` prints and what REST answers, made once for both."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from wingwatch.aircraft import (
    DERIVATIVES,
    STRUCTURES,
    Aircraft,
    AircraftDataError,
    FlightCondition,
    ModeStructure,
    TrimError,
    trimmed,
)
from wingwatch.baselines import (
    BaselineLedger,
    CellRecord,
    Database,
    Envelope,
    Expectation,
    ExpectationRecord,
    OutOfEnvelope,
    ReferenceKey,
    ReferenceRecord,
    apriori_envelope,
)
from wingwatch.operations.baseline import stored_envelopes
from wingwatch.operations.baseline_comparison import Estimated, SideBySide, side_by_side
from wingwatch.operations.convention import in_convention

__all__ = ["Asked", "history_object", "list_object", "show_object"]


@dataclass(frozen=True, slots=True)
class Asked:
    """What of the baseline is asked for.

    Attributes:
        vehicle: whose flights' teaching; None for nobody's.
        at: true airspeed and altitude of the comparison; cruise where None.
    """

    aircraft: Aircraft
    configuration: str = "clean"
    convention: str = "concise"
    fleet: str = "default"
    vehicle: str | None = None
    at: tuple[float, float] | None = None

    def key(self, structure: str) -> ReferenceKey:
        """Of what the vehicle taught."""
        return ReferenceKey(self.fleet, self.vehicle or "", self.aircraft.name, self.configuration, structure)


def list_object(database: Database, aircraft: str | None = None) -> dict[str, Any]:
    """What the database knows something of: aircraft with their entries, and vehicles with what they taught."""
    ledger = BaselineLedger(database)
    kinds: dict[tuple[str, str], dict[str, Any]] = {}
    for one in ledger.series():
        if aircraft in (None, one.aircraft):
            kinds.setdefault((one.aircraft, one.configuration), {})[one.structure] = {
                "entries": dict(one.entries), "superseded": one.superseded, "newest_at_s": one.newest_at_s,
            }  # fmt: skip
    vehicles: dict[tuple[str, str, str, str], dict[str, Any]] = {}
    for taught in ledger.taught(aircraft):
        key = taught.key
        owner = key.fleet, key.vehicle, key.aircraft, key.configuration
        vehicles.setdefault(owner, {})[key.structure] = {
            "blocks": taught.blocks, "seconds": taught.seconds, "cells": taught.cells,
            "updated_at_s": taught.updated_at_s,
        }  # fmt: skip
    owner_names = ("fleet", "vehicle", "aircraft", "configuration")
    return {
        "aircraft": [
            {"aircraft": name, "configuration": configuration, "structures": structures}
            for (name, configuration), structures in kinds.items()
        ],
        "vehicles": [
            {**dict(zip(owner_names, owner, strict=True)), "structures": structures}
            for owner, structures in vehicles.items()
        ],
    }


def show_object(database: Database, asked: Asked, now_at_s: float) -> dict[str, Any]:
    """What counts now: entries, what the vehicle taught, and both side by side at a flight condition.

    Raises:
        ValueError: a condition that no flight has.
    """
    result = _kept(database, asked, past=False)
    side = _sides(database, asked)
    result["at"] = side
    if asked.vehicle is not None:
        result["cells"] = [
            _cell(one, now_at_s)
            for name in STRUCTURES
            for one in BaselineLedger(database).cells(asked.key(name))
        ]
    return result


def history_object(database: Database, asked: Asked) -> dict[str, Any]:
    """Every entry and version there ever was, and the changes that people made."""
    result = _kept(database, asked, past=True)
    mine = (asked.fleet, asked.vehicle)
    changes = BaselineLedger(database).changes(aircraft=asked.aircraft.name)
    result["changes"] = [
        asdict(one)
        for one in changes
        if one.configuration == asked.configuration
        and (one.vehicle is None or (one.fleet, one.vehicle) == mine)
    ]
    return result


def _kept(database: Database, asked: Asked, past: bool) -> dict[str, Any]:
    """Entries by structure, and versions of what a vehicle taught where one is named."""
    look = database.history if past else database.expectations
    result: dict[str, Any] = {
        "aircraft": asked.aircraft.name,
        "configuration": asked.configuration,
        "convention": asked.convention,
        "structures": {
            name: [_entry(record, asked) for record in look(asked.aircraft.name, asked.configuration, name)]
            for name in STRUCTURES
        },
    }
    if asked.vehicle is None:
        return result
    ledger = BaselineLedger(database)
    taught = {}
    for name in STRUCTURES:
        key = asked.key(name)
        newest = ledger.newest_version(key)
        versions = database.reference_history(key) if past else (() if newest is None else (newest,))
        taught[name] = [_version(one) for one in versions]
    return result | {"fleet": asked.fleet, "vehicle": asked.vehicle, "references": taught}


def _entry(record: ExpectationRecord, asked: Asked) -> dict[str, Any]:
    expectation = record.expectation
    symbols, name = expectation.structure.derivatives, expectation.structure.name
    errors = expectation.standard_error.tolist()
    rows = {
        symbol: {"value": value, "standard_error": error, "unit": DERIVATIVES[symbol].unit}
        for symbol, value, error in zip(symbols, record.value, errors, strict=True)
    }
    mode = {"condition": asdict(expectation.condition), "derivatives": rows}
    made = in_convention({"": {name: mode}}, asked.aircraft, asked.convention, record.configuration)[""][name]
    names = ("id", "superseded_by", "provenance", "source", "created_at_s", "change_id")
    return {**made, **{key: getattr(record, key) for key in names}}


def _version(one: ReferenceRecord) -> dict[str, Any]:
    return {
        "id": one.id, "updated_at_s": one.updated_at_s, "blocks": one.reference.blocks,
        "seconds": one.reference.seconds, "source": one.source or "learned live by a service",
        "change_id": one.change_id, "withdrawn_by": one.withdrawn_by,
    }  # fmt: skip


def _cell(one: CellRecord, now_at_s: float) -> dict[str, Any]:
    return {
        "structure": one.key.structure,
        "airspeed_true_m_s": list(one.cell.airspeed_limits_m_s),
        "altitude_m": list(one.cell.altitude_limits_m),
        "blocks": one.reference.blocks,
        "seconds": one.reference.seconds,
        "updated_at_s": one.updated_at_s,
        "age_s": max(0.0, now_at_s - one.updated_at_s),
    }


def _sides(database: Database, asked: Asked) -> dict[str, Any] | None:
    """Both side by side; None where no condition is asked for and the aircraft states none."""
    nominal = asked.aircraft.nominal_condition
    if asked.at is not None:
        point = FlightCondition(*asked.at, configuration=asked.configuration)
    elif nominal is not None:
        point = FlightCondition(
            nominal.airspeed_true_m_s, nominal.altitude_m, configuration=asked.configuration
        )
    else:
        return None
    stored = stored_envelopes(database, asked.aircraft, asked.configuration)
    by_file = {
        name: apriori_envelope(asked.aircraft, s, asked.configuration) for name, s in STRUCTURES.items()
    }
    condition = _steady(asked.aircraft, point, [*stored.values(), *by_file.values()])
    ledger, structures = BaselineLedger(database), {}
    for name in STRUCTURES:
        version = None if asked.vehicle is None else ledger.newest_version(asked.key(name))
        reference = None if version is None else version.reference
        structures[name] = _side(side_by_side(by_file[name], stored.get(name), reference, condition), asked)
    return {"condition": asdict(condition), "structures": structures}


def _steady(aircraft: Aircraft, at: FlightCondition, envelopes: list[Envelope]) -> FlightCondition:
    """The condition with its angle of attack of level flight, as far as that is known."""
    try:
        return trimmed(aircraft, at)
    except (AircraftDataError, TrimError):
        pass
    found = (e.angle_of_attack_rad(at.airspeed_true_m_s, at.altitude_m) for e in envelopes)
    alpha = next((a for a in found if a is not None), 0.0)
    return FlightCondition(
        at.airspeed_true_m_s, at.altitude_m, at.air_density_kg_m3, at.configuration, float(alpha)
    )


def _side(side: SideBySide, asked: Asked) -> dict[str, Any]:
    columns: dict[str, Mapping[str, Any]] = {
        "a_priori": _column(side, _estimated(side.a_priori), asked),
        "stored": _column(side, _estimated(side.stored), asked),
        "flights": _column(side, side.flights, asked),
        "expected": _column(side, side.expected, asked),
    }
    rows: dict[str, Any] = {}
    for i, symbol in enumerate(side.structure.derivatives):
        named = columns["a_priori"][symbol]
        rows[symbol] = {key: named[key] for key in ("name", "unit") if key in named}
        for key, column in columns.items():
            one = {k: column[symbol][k] for k in ("value", "standard_error")}
            rows[symbol][key] = None if one["value"] is None else one
        z = np.nan if side.distance is None else float(side.distance.z[i])
        rows[symbol]["z"] = z if np.isfinite(z) else None
    found = side.distance
    return {
        "derivatives": rows,
        "a_priori": _standing(side.a_priori),
        "stored": None if side.stored is None else _standing(side.stored),
        "distance": None
        if found is None
        else {"squared": found.squared, "freedom": found.freedom, "probability": found.probability},
    }


def _estimated(found: Expectation | OutOfEnvelope | None) -> Estimated | None:
    return Estimated(found.value, found.standard_error) if isinstance(found, Expectation) else None


def _standing(found: Expectation | OutOfEnvelope) -> dict[str, str]:
    """Where an expectation comes from, or why there is none."""
    if isinstance(found, OutOfEnvelope):
        return {"reason": found.reason}
    return {"provenance": str(found.provenance), "source": found.source}


def _column(side: SideBySide, found: Estimated | None, asked: Asked) -> Mapping[str, Any]:
    """Value and standard error of each derivative in the convention; None where not known."""
    structure: ModeStructure = side.structure
    nothing = np.full(len(structure.derivatives), np.nan)
    values, errors = (nothing, nothing) if found is None else (found.value, found.standard_error)
    rows = {
        symbol: {
            "value": float(value) if np.isfinite(value) else None,
            "standard_error": float(error) if np.isfinite(error) else None,
            "unit": DERIVATIVES[symbol].unit,
        }
        for symbol, value, error in zip(structure.derivatives, values, errors, strict=True)
    }
    mode = {"condition": asdict(side.condition), "derivatives": rows}
    made = in_convention({"": {structure.name: mode}}, asked.aircraft, asked.convention, asked.configuration)
    derivatives: Mapping[str, Any] = made[""][structure.name]["derivatives"]
    return derivatives
