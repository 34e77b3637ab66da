"""`wingwatch estimate --repeats`: the scatter of a manoeuvre's repeats beside the standard errors that they state."""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import MODEL_DERIVATIVES, load_aircraft
from wingwatch.cli.flight_watch import watch
from wingwatch.cli.joined_flights import joined
from wingwatch.cli.many_flights import flight_files
from wingwatch.cli.unusable import refuse_unusable
from wingwatch.diagnosis.repeats import FlownWindow, RepeatedDerivative, RepeatedManoeuvre, repeats
from wingwatch.monitor import Report, VehicleMonitor
from wingwatch.monitor.vehicle.manoeuvre_watch import FlownManoeuvre
from wingwatch.operations.faults import CommandError
from wingwatch.operations.plausible import checked, for_json, show_doubts
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.telemetry import load_flight

__all__ = ["check_repeats", "run_repeats"]

DEFAULT_ESTIMATOR = "output-error"
"""Of the estimators of a whole flight the one with the smallest errors on a manoeuvre alone."""

_CONDITION = ("airspeed_true_m_s", "altitude_m", "air_density_kg_m3", "angle_of_attack_rad")


def check_repeats(arguments: argparse.Namespace) -> None:
    """Options that say nothing of repeats are refused.

    Raises:
        CommandError: one of them is given.
    """
    for option, given in (
        ("--history", arguments.history), ("--validate", arguments.validate), ("--plot", arguments.plot),
        ("--save", arguments.save),
    ):  # fmt: skip
        if given is not None:
            raise CommandError(
                f"{option} {given} is of one estimate, and --repeats makes many; leave one of them out"
            )
    if arguments.forgetting is not None:
        raise CommandError(
            "--forgetting is of fourier and ekf, and --repeats takes each manoeuvre alone; leave it out"
        )
    if arguments.estimator in ("fourier", "ekf"):
        raise CommandError(
            f"--estimator {arguments.estimator} remembers earlier manoeuvres, and --repeats takes each alone; "
            f"take one of the whole flight, or leave it out ({DEFAULT_ESTIMATOR})"
        )
    if arguments.convention != "concise":
        raise CommandError(
            f"--convention {arguments.convention}: repeats are compared in concise derivatives, the ratio is the same "
            "in all; leave it out"
        )


@dataclass(slots=True)
class _Found:
    """Collects the manoeuvres of a flight; a listener of ``flight_watch.watch``."""

    windows: list[FlownWindow] = field(default_factory=list)

    def __call__(self, monitor: VehicleMonitor, report: Report) -> None:
        for flown in report.manoeuvres:
            self.add(flown)

    def add(self, flown: FlownManoeuvre) -> None:
        number = len(self.windows) + 1
        self.windows.append(FlownWindow(number, flown.surfaces, flown.begin_s, flown.end_s))


def run_repeats(arguments: argparse.Namespace) -> int:
    """Find the manoeuvres of one flight or of several, estimate each alone, and say what their repeats come to."""
    aircraft = load_aircraft(arguments.aircraft)
    paths = flight_files(arguments.flights)
    flight = joined([load_flight(path, arguments.map, surface_travel(aircraft)) for path in paths])
    findings = checked(flight, aircraft, arguments.accept_implausible)
    found = _Found()
    watched = watch(flight, aircraft, Progress(getattr(arguments, "progress", True)), listener=found)
    refuse_unusable(watched)
    if (last := watched.monitor.end_manoeuvre()) is not None:
        found.add(last)
    estimator = arguments.estimator or DEFAULT_ESTIMATOR
    fresh = VehicleMonitor(aircraft, "default", "repeats", flight.block.present, flight.kinds, new_id=str)
    groups, notes = repeats(
        flight, fresh.prepared(flight.block), aircraft, found.windows, estimator,
        structures=arguments.structure, form=arguments.form or "accelerometer",
    )  # fmt: skip
    if not groups:
        why = "; ".join(notes) or "no surface moved beyond its usual way"
        raise CommandError(f"{flight.source}: no manoeuvre is repeated ({why})")
    if arguments.json:
        write_json(
            {
                "flights": [str(path) for path in paths],
                "aircraft": aircraft.name,
                "estimator": estimator,
                "repeats": [_object(one) for one in groups],
                "notes": list(notes),
                "plausibility": for_json(findings),
            }
        )
        return 0
    console = page()
    console.print(
        f"[bold]{escape(flight.source)}[/]  aircraft {aircraft.name}, each manoeuvre alone by {estimator}"
    )
    for one in groups:
        _show(console, one)
    for note in notes:
        console.print(f"{note[:1].upper()}{note[1:]}.", style="dim")
    show_doubts(console, findings)
    return 0


def _object(one: RepeatedManoeuvre) -> dict[str, Any]:
    """One repeated manoeuvre as JSON; numbers of ``values`` are in the order of ``manoeuvres``."""
    return {
        "structure": one.structure.name,
        "surfaces": list(one.surfaces),
        "manoeuvres": [{"number": w.number, "begin_s": w.begin_s, "end_s": w.end_s} for w in one.windows],
        "condition": dict(zip(_CONDITION, one.condition, strict=True)),
        "airspeed_m_s": list(one.airspeed_m_s),
        "derivatives": {
            symbol: {
                "unit": MODEL_DERIVATIVES[symbol].unit,
                "manoeuvres": list(row.numbers),
                "values": row.values.tolist(),
                "standard_errors": row.standard_errors.tolist(),
                "mean": row.mean,
                "scatter": row.scatter,
                "standard_error": row.stated,
                "ratio": row.ratio,
                "ratio_interval_95": list(row.ratio_interval),
                "chance": row.chance,
                "contradicts": row.contradicts,
                "changed_after": None if row.changed_after is None else row.changed_after[0],
            }
            for symbol, row in one.derivatives.items()
        },
        "not_estimated": {str(number): why for number, why in one.not_estimated.items()},
        "text": list(_sentences(one)),
    }


def _show(console: Console, one: RepeatedManoeuvre) -> None:
    """Mean, scatter and stated error of each derivative, the values below each other, and what contradicts."""
    surfaces = " and ".join(column.removesuffix("_rad") for column in one.surfaces)
    low, high = one.airspeed_m_s
    console.print(
        f"[bold]{one.structure.name}[/], {surfaces} moved: {len(one.windows)} manoeuvres, "
        f"{low:.2f} to {high:.2f} m/s, values at {one.condition[0]:.2f} m/s"
    )
    if not one.derivatives:
        console.print("No derivative is observable in two of them.")
    else:
        console.print(_table(one))
    for number, why in one.not_estimated.items():
        console.print(f"Manoeuvre {number} is not estimated: {escape(why)}.", style="dim")
    for sentence in _sentences(one):
        console.print(sentence, soft_wrap=True)


def _table(one: RepeatedManoeuvre) -> Table:
    table = Table()
    for column in ("derivative", "unit"):
        table.add_column(column)
    for column in ("repeats", "mean", "scatter", "stated error", "ratio", "95 % interval"):
        table.add_column(column, justify="right")
    table.add_column("values")
    for symbol, row in one.derivatives.items():
        values = "  ".join(
            f"{value:.4g} ± {error:.2g}" for value, error in zip(row.values, row.standard_errors, strict=True)
        )
        table.add_row(
            symbol, MODEL_DERIVATIVES[symbol].unit, str(row.values.size), f"{row.mean:.4g}", f"{row.scatter:.2g}",
            f"{row.stated:.2g}", f"{row.ratio:.2f}{' !' if row.contradicts else ''}",
            f"{row.ratio_interval[0]:.2f} to {row.ratio_interval[1]:.2f}", values,
        )  # fmt: skip
    return table


def _sentences(one: RepeatedManoeuvre) -> Iterator[str]:
    """Of each derivative whose scatter contradicts its stated errors; one sentence where none does."""
    contradicting = {symbol: row for symbol, row in one.derivatives.items() if row.contradicts}
    if not contradicting and one.derivatives:
        yield "The scatter of no derivative contradicts the stated errors."
    for symbol, row in contradicting.items():
        yield _sentence(symbol, row)


def _sentence(symbol: str, row: RepeatedDerivative) -> str:
    low, high = row.ratio_interval
    said = f"{symbol} scatters {row.ratio:.2g} ({low:.2g} to {high:.2g}) times its stated errors"
    if row.ratio < 1.0:
        return f"{said}: the errors are too large, or cover what all repeats have in common and so does not scatter."
    if row.changed_after is None:
        return f"{said}: the errors are too small, or the derivative is not the same in all repeats."
    after, before, then = row.changed_after
    unit = MODEL_DERIVATIVES[symbol].unit
    return (
        f"{said}: a change after manoeuvre {after}, from {before:.4g} to {then:.4g} {unit}, would explain it; "
        "without one the errors are too small."
    )
