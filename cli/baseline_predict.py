"""`wingwatch baseline predict`: the empirical tables' derivatives from an aircraft's dimensions (thesis B.1, B.2).

What is predicted is blind to the aircraft's own coefficients: of its file geometry, mass and moments of inertia count.
"""

import argparse
import math
import time
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import (
    DERIVATIVES,
    STRUCTURES,
    Aircraft,
    Dimensions,
    FlightCondition,
    ModeStructure,
    empirical_aircraft,
    load_aircraft,
    trimmed,
)
from wingwatch.aircraft.empirical import has_tail
from wingwatch.baselines import (
    BaselineContent,
    BaselineLedger,
    ChangeRecord,
    Envelope,
    Expectation,
    ExpectationRecord,
    OutOfEnvelope,
    apriori_envelope,
    open_database,
)
from wingwatch.operations.baseline_revert import Done, who
from wingwatch.operations.convention import check_convention, in_convention
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import page

__all__ = ["predict", "predicted_aircraft"]

_SOURCE = "empirical tables (thesis B.1, B.2) from dimensions"


def predict(arguments: argparse.Namespace) -> Done:
    """Predict, set beside the aircraft file's own numbers, and store where asked."""
    aircraft = load_aircraft(arguments.aircraft)
    check_convention(aircraft, arguments.convention)
    if arguments.static_margin is not None and not -1.0 < arguments.static_margin < 1.0:
        raise CommandError(
            f"--static-margin {arguments.static_margin:g}: give the neutral point behind the centre of gravity over "
            "the mean chord, such as 0.2"
        )
    at = _condition(aircraft, arguments.at)
    made = predicted_aircraft(aircraft, at, arguments.static_margin)
    predicted = {name: apriori_envelope(made, s) for name, s in STRUCTURES.items()}
    own = {name: apriori_envelope(aircraft, s) for name, s in STRUCTURES.items()}
    condition = trimmed(made, at)
    structures = {
        name: _rows(
            predicted[name].lookup(condition), _known(own[name], condition), aircraft, arguments.convention
        )
        for name in STRUCTURES
    }
    result: dict[str, Any] = {
        "aircraft": aircraft.name,
        "convention": arguments.convention,
        "condition": asdict(condition),
        "tail": "as stated"
        if has_tail(made.need_geometry("a prediction"))
        else "of a typical aircraft, where not stated",
        "structures": structures,
        "stored": None,
    }
    if arguments.save:
        result["stored"] = _store(arguments, aircraft, predicted, own)
    return result, lambda: _show(page(), result, arguments.database)


def predicted_aircraft(
    aircraft: Aircraft, at: FlightCondition, static_margin: float | None = None
) -> Aircraft:
    """The aircraft as the empirical tables have it, of its dimensions and mass alone.

    Args:
        aircraft: states [geometry] and [mass].
        at: level flight whose lift coefficient the tables take.
        static_margin: neutral point behind the centre of gravity over the mean chord; typical if None.

    Raises:
        AircraftDataError: it states neither, or dimensions of no level flight.
    """
    geometry, mass = aircraft.need_geometry("a prediction"), aircraft.need_mass("a prediction")
    inertias = mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2
    known = Dimensions(aircraft.name, geometry, mass.mass_kg, inertias, at.airspeed_true_m_s, at.altitude_m)
    return empirical_aircraft(known, static_margin)


def _condition(aircraft: Aircraft, asked: tuple[float, float] | None) -> FlightCondition:
    nominal = aircraft.nominal_condition
    if asked is not None:
        try:
            return FlightCondition(*asked)
        except ValueError as error:
            raise CommandError(f"--at: {error}") from None
    if nominal is None:
        raise CommandError(
            f"aircraft {aircraft.name} states neither [envelope] nor [[conditions]]; give --at AIRSPEED,ALTITUDE"
        )
    return FlightCondition(nominal.airspeed_true_m_s, nominal.altitude_m)


def _known(own: Envelope, condition: FlightCondition) -> Expectation | None:
    found = own.lookup(condition)
    return None if isinstance(found, OutOfEnvelope) else found


def _rows(
    predicted: Expectation | OutOfEnvelope, own: Expectation | None, aircraft: Aircraft, convention: str
) -> dict[str, Any]:
    """By derivative value and standard error of both, and their difference in joint errors."""
    if isinstance(predicted, OutOfEnvelope):
        return {"reason": predicted.reason}
    symbols = predicted.structure.derivatives
    columns = {
        "predicted": _column(predicted, predicted, aircraft, convention),
        "a_priori": {} if own is None else _column(own, predicted, aircraft, convention),
    }
    rows = {}
    for k, symbol in enumerate(symbols):
        row: dict[str, Any] = {key: columns["predicted"][symbol][key] for key in ("name", "unit")
                               if key in columns["predicted"][symbol]}  # fmt: skip
        for key, column in columns.items():
            row[key] = (
                {part: column[symbol][part] for part in ("value", "standard_error")} if column else None
            )
        row["z"] = None
        if own is not None:
            joint = math.hypot(float(predicted.standard_error[k]), float(own.standard_error[k]))
            row["z"] = float(predicted.value[k] - own.value[k]) / joint if joint > 0.0 else None
        rows[symbol] = row
    inside = [abs(row["z"]) <= 1.96 for row in rows.values() if row["z"] is not None]
    return {"derivatives": rows, "within_95": sum(inside), "compared": len(inside)}


def _column(of: Expectation, at: Expectation, aircraft: Aircraft, convention: str) -> dict[str, Any]:
    structure: ModeStructure = of.structure
    rows = {
        symbol: {"value": float(value), "standard_error": float(error), "unit": DERIVATIVES[symbol].unit}
        for symbol, value, error in zip(structure.derivatives, of.value, of.standard_error, strict=True)
    }
    mode = {"condition": asdict(at.condition), "derivatives": rows}
    made = in_convention({"": {structure.name: mode}}, aircraft, convention, at.condition.configuration)
    found: dict[str, Any] = made[""][structure.name]["derivatives"]
    return found


def _store(
    arguments: argparse.Namespace,
    aircraft: Aircraft,
    predicted: dict[str, Envelope],
    own: dict[str, Envelope],
) -> int:
    """Put the prediction into the database as a-priori entries; how many were new.

    Raises:
        CommandError: no database is named, or the aircraft has numbers of its own and nobody insists.
    """
    if arguments.database is None:
        raise CommandError("--save needs the database: wingwatch baseline predict DB --aircraft A --save")
    stated = [name for name, envelope in own.items() if len(envelope.points)]
    if stated and not arguments.anyway:
        raise CommandError(
            f"aircraft {aircraft.name} states numbers of its own ({', '.join(stated)}), and a prediction from "
            "dimensions would take their place; add --anyway to do it"
        )
    now_s = time.time()
    entries = tuple(
        ExpectationRecord.of(aircraft.name, replace(point, source=_SOURCE), now_s)
        for envelope in predicted.values()
        for point in envelope.points
    )
    text = f"predicted by the {_SOURCE}"
    change = ChangeRecord(now_s, "import", who(), aircraft.name, "clean", text, None, None)
    with open_database(arguments.database) as database:
        return BaselineLedger(database).put([change], BaselineContent(entries))


def _show(console: Console, result: dict[str, Any], database: str | None) -> None:
    at = result["condition"]
    console.print(
        f"[bold]{escape(result['aircraft'])}[/] at {at['airspeed_true_m_s']:.4g} m/s, {at['altitude_m']:.4g} m, from "
        f"dimensions and mass alone; tail and fin {result['tail']}"
    )
    for name, found in result["structures"].items():
        if "reason" in found:
            console.print(f"{name}: {escape(found['reason'])}")
            continue
        console.print(_table(name, found["derivatives"]))
        if found["compared"]:
            console.print(
                f"  {found['within_95']} of {found['compared']} within 1.96 joint errors of the aircraft file",
                style="dim",
            )
    if result["stored"] is not None:
        console.print(escape(f"{result['stored']} entries are in {database}, as a-priori"))


def _table(name: str, rows: dict[str, Any]) -> Table:
    table = Table(title=name, title_justify="left", title_style="bold")
    for column in ("derivative", "unit", "predicted", "in percent", "aircraft file", "joint errors"):
        table.add_column(column, justify="left" if column in ("derivative", "unit") else "right")
    for symbol, row in rows.items():
        one = row["predicted"]
        percent = 100.0 * one["standard_error"] / abs(one["value"]) if one["value"] else np.inf
        table.add_row(
            row.get("name", symbol), row["unit"], _number(one), f"{percent:.0f}" if percent < 1000.0 else "-",
            _number(row["a_priori"]), "-" if row["z"] is None else f"{row['z']:+.1f}",
        )  # fmt: skip
    return table


def _number(row: dict[str, Any] | None) -> str:
    return "-" if row is None else f"{row['value']:.4g} ± {row['standard_error']:.2g}"
