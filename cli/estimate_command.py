"""`wingwatch estimate`: derivatives of a recorded flight, of several together, or of a folder's, one line each."""

import argparse
from collections.abc import Mapping, Sequence
from math import isfinite, nan
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.cli.design_input_plot import need_matplotlib
from wingwatch.cli.estimate_history import HistoryWriter
from wingwatch.cli.estimate_model import save_model
from wingwatch.cli.estimate_plot import draw_fit
from wingwatch.cli.estimate_repeats import check_repeats, run_repeats
from wingwatch.cli.estimate_validation import Validation, as_json, fitted_of, show_validation, validated
from wingwatch.cli.flight_watch import Watched, watch
from wingwatch.cli.forgetting import forgetting_object
from wingwatch.cli.furthest import furthest
from wingwatch.cli.joined_flights import joined
from wingwatch.cli.many_flights import each_flight, end_of_many, flight_files, is_many, print_line
from wingwatch.cli.unusable import refuse_unusable
from wingwatch.diagnosis.offline_estimates import OFFLINE_ESTIMATORS, OfflineEstimates, estimate_offline
from wingwatch.monitor import MonitorStart, VehicleMonitor
from wingwatch.operations.convention import check_convention, in_convention
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import PICTURES, check_output
from wingwatch.operations.plausible import checked, for_json, show_doubts
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.telemetry import FlightTable, load_flight, load_map

__all__ = ["estimated", "run"]

_DIFFERS = 3.0
"""Standard errors by which a derivative is off what is expected, from which on a line says so."""


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    whole = arguments.estimator in OFFLINE_ESTIMATORS
    if whole and arguments.history is not None:
        raise CommandError(
            f"--history {arguments.history}: {arguments.estimator} solves the whole flight at once and has no history; "
            "leave it out, or take fourier or ekf"
        )
    if arguments.repeats:
        check_repeats(arguments)
        return run_repeats(arguments)
    if whole and arguments.forgetting is not None:
        raise CommandError(
            f"--forgetting is of fourier and ekf, and {arguments.estimator} forgets nothing; leave one of them out"
        )
    if not whole and (arguments.structure or arguments.form):
        option = "--structure" if arguments.structure else "--form"
        raise CommandError(
            f"{option} is for estimators of the whole flight; add --estimator {' or '.join(OFFLINE_ESTIMATORS)}"
        )
    if arguments.engine != "compiled" and arguments.estimator not in (None, "ekf"):
        raise CommandError(
            f"--engine {arguments.engine} is of the Kalman filter, and {arguments.estimator} is none; leave it out, or "
            "take ekf"
        )
    if is_many(arguments.flights):
        return _run_many(arguments)
    check_output("--save", arguments.save, (".toml",))
    check_output("--plot", arguments.plot, PICTURES)
    if arguments.plot is not None:
        need_matplotlib()
    return _run_one(arguments, whole)


def _run_one(arguments: argparse.Namespace, whole: bool) -> int:
    """One flight, or several as one."""
    history = None
    if arguments.history is not None:
        history = HistoryWriter(arguments.history, arguments.estimator, arguments.convention)
    aircraft = load_aircraft(arguments.aircraft)
    check_convention(aircraft, arguments.convention)
    flight = joined(
        [load_flight(path, arguments.map, surface_travel(aircraft)) for path in arguments.flights]
    )
    findings = checked(flight, aircraft, arguments.accept_implausible)
    other = None if arguments.validate is None else _other_flight(arguments, aircraft)
    if whole:
        result, solved, counted = _offline(flight, aircraft, arguments)
        monitor, structures = solved.monitor, list(solved.modes)
        fitted = fitted_of({arguments.estimator: solved.modes})
    else:
        counted = watch(
            flight,
            aircraft,
            _progress(arguments),
            listener=history,
            start=_start(arguments),
        )
        if history is not None:
            history.close()
        refuse_unusable(counted)
        result, monitor = _result(counted, arguments), counted.monitor
        structures = [s.name for s in monitor.chain.structures]
        fitted = fitted_of(_chosen(monitor.derivatives()["estimators"], arguments))
    judged = None if other is None else validated(fitted, other, aircraft)
    if arguments.plot is not None:
        _plot(arguments, judged or validated(fitted, flight, aircraft), flight.source)
    unsaved = () if arguments.save is None else save_model(arguments.save, aircraft, fitted, flight.source)
    if arguments.json:
        more = {} if judged is None else {"validation": as_json(judged, arguments.validate)}
        if arguments.save is not None:
            more["saved"] = {"file": str(arguments.save), "left_out": list(unsaved)}
        write_json(result | {"plausibility": for_json(findings)} | more)
        return 0
    console = page()
    _show(console, result, monitor, flight.source, counted.cleaning_text, structures)
    show_doubts(console, findings)
    if judged is not None:
        show_validation(console, judged, arguments.validate)
    if arguments.plot is not None:
        console.print(f"the picture is in {escape(str(arguments.plot))}", soft_wrap=True)
    if arguments.save is not None:
        console.print(f"derivatives are in {escape(str(arguments.save))}", soft_wrap=True)
        for text in unsaved:
            console.print(f"not saved: {escape(text)}", soft_wrap=True)
    return 0


def _plot(arguments: argparse.Namespace, judged: Validation, source: str) -> None:
    """The manoeuvres of the other flight, or of the flight itself, as a picture."""
    if not judged.manoeuvres:
        raise CommandError(
            f"--plot {arguments.plot}: there is no manoeuvre to draw; {'; '.join(judged.notes)}"
        )
    on = source if arguments.validate is None else f"{source} judged on {arguments.validate}"
    draw_fit(arguments.plot, f"Measured and predicted motion: {on}", judged.manoeuvres)


def _other_flight(arguments: argparse.Namespace, aircraft: Aircraft) -> FlightTable:
    """The flight on which derivatives are judged."""
    flight = load_flight(arguments.validate, arguments.map, surface_travel(aircraft))
    checked(flight, aircraft, arguments.accept_implausible)
    return flight


def _progress(arguments: argparse.Namespace) -> Progress:
    return Progress(getattr(arguments, "progress", True))


def _run_many(arguments: argparse.Namespace) -> int:
    """One line a flight, the one furthest from what is expected first."""
    for option, given in (
        ("--validate", arguments.validate),
        ("--save", arguments.save),
        ("--plot", arguments.plot),
    ):
        if given is not None:
            raise CommandError(f"{option} {given} is for one flight, and a folder is named; leave it out")
    if arguments.history is not None:
        raise CommandError(
            f"--history {arguments.history} is for one flight, and a folder is named; leave it out"
        )
    check_convention(load_aircraft(arguments.aircraft), arguments.convention)
    if arguments.map is not None:
        load_map(arguments.map)
    results = each_flight(estimated, flight_files(arguments.flights), arguments)
    lines = sorted(
        ((furthest(result), result) for result in results), key=lambda one: _order(*one), reverse=True
    )
    if arguments.json:
        write_json([result for _, result in lines])
        return end_of_many(results)
    console = page()
    for (z, text), result in lines:
        state = "not judged" if "error" in result else "differs" if z > _DIFFERS else "as expected"
        print_line(console, state if "error" in result or text else "not observable", result, text)
    return end_of_many(results)


def estimated(flight: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    """The JSON object of one of many flights."""
    aircraft = load_aircraft(arguments.aircraft)
    table = load_flight(flight, arguments.map, surface_travel(aircraft))
    said = {"plausibility": for_json(checked(table, aircraft, arguments.accept_implausible))}
    if arguments.estimator in OFFLINE_ESTIMATORS:
        return _offline(table, aircraft, arguments)[0] | said
    watched = watch(table, aircraft, _progress(arguments), start=_start(arguments))
    refuse_unusable(watched)
    return _result(watched, arguments) | said


def _order(found: tuple[float, str], result: Mapping[str, Any]) -> tuple[float, float]:
    """Those that differ first, then those that could not be judged, then the rest."""
    if "error" in result:
        return 1.0, 0.0
    return 2.0 if found[0] > _DIFFERS else 0.0, found[0]


def _offline(
    flight: FlightTable, aircraft: Aircraft, arguments: argparse.Namespace
) -> tuple[dict[str, Any], OfflineEstimates, Watched]:
    """By an estimator that takes the flight whole."""
    solved = estimate_offline(
        flight, aircraft, arguments.estimator, _progress(arguments).track,
        structures=arguments.structure, form=arguments.form or "accelerometer",
    )  # fmt: skip
    counted = Watched(solved.monitor, flight, ())
    result = {
        "time_s": solved.last_s,
        "basis": solved.monitor.basis,
        "convention": arguments.convention,
        "estimators": in_convention(
            {arguments.estimator: dict(solved.modes)}, aircraft, arguments.convention
        ),
        "not_estimated": dict(solved.absent),
        "cleaning": counted.cleaning,
    }
    return result, solved, counted


def _start(arguments: argparse.Namespace) -> MonitorStart:
    return MonitorStart(engine=arguments.engine, memory_s=arguments.forgetting)


def _result(watched: Watched, arguments: argparse.Namespace) -> dict[str, Any]:
    """The contract's object, of one estimator or of all."""
    monitor = watched.monitor
    result = {**monitor.derivatives(), "convention": arguments.convention, "cleaning": watched.cleaning}
    if arguments.forgetting is not None:
        result["forgetting"] = forgetting_object(arguments.forgetting, watched.flight)
    result["estimators"] = in_convention(
        _chosen(result["estimators"], arguments),
        monitor.aircraft,
        arguments.convention,
        monitor.configuration,
        monitor.view().condition,
    )
    return result


def _chosen(estimators: Mapping[str, Any], arguments: argparse.Namespace) -> Mapping[str, Any]:
    """Of one estimator, or of all."""
    name = arguments.estimator
    return estimators if name is None else {name: estimators[name]}


def _show(
    console: Console,
    result: Mapping[str, Any],
    monitor: VehicleMonitor,
    source: str,
    cleaning_text: str,
    structures: Sequence[str],
) -> None:
    console.print(f"[bold]{escape(source)}[/]  aircraft {monitor.aircraft.name}")
    console.print(escape(cleaning_text), style="dim")
    if "forgetting" in result:
        console.print(f"{result['forgetting']['text']}", style="dim")
    for structure in structures:
        console.print(_table(structure, result["estimators"]))
        for name, modes in result["estimators"].items():
            console.print(f"  {name}: {escape(_mode_line(modes[structure]))}", style="dim")
            if "fit" in modes[structure]:
                console.print(f"  {escape(_fit_line(modes[structure]['fit']))}", style="dim")
    for name, why in result["not_estimated"].items():
        console.print(f"{name} is not estimated: {escape(why)}")
    console.print(escape(monitor.basis_text))


def _table(structure: str, estimators: Mapping[str, Any]) -> Table:
    """Value ± standard error of each derivative by each estimator, beside what is expected."""
    table = Table(title=structure, title_justify="left", title_style="bold")
    table.add_column("derivative")
    table.add_column("unit")
    for name in estimators:
        table.add_column(name, justify="right")
        table.add_column("outcome")
    modes = [modes[structure]["derivatives"] for modes in estimators.values()]
    whole = all("interval_95" in row for rows in modes for row in rows.values())
    if whole:
        table.add_column("95 % interval", justify="right")
    table.add_column("expected", justify="right")
    for symbol, first in modes[0].items():
        cells = [first.get("name", symbol), first["unit"]]
        for rows in modes:
            row = rows[symbol]
            cells += [_number(row["value"], row["standard_error"]), row["outcome"].replace("_", " ")]
        if whole:
            cells.append(_interval(first["interval_95"]))
        # What is expected hangs on the condition, which both estimators share to within a sample or two.
        cells.append(_number(first.get("expected"), first.get("expected_standard_error")))
        table.add_row(*cells)
    return table


def _number(value: float | None, error: float | None) -> str:
    if value is None or error is None or not (isfinite(value) and isfinite(error)):
        return "-"
    return f"{value:.4g} ± {error:.2g}"


def _interval(ends: Sequence[float]) -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g}" if all(isfinite(e) for e in ends) else "-"


def _mode_line(mode: Mapping[str, Any]) -> str:
    """Outcome, frequency and damping of one mode by one estimator."""
    parts = [mode["outcome"].replace("_", " ")]
    if mode.get("reason"):
        parts.append(mode["reason"])
    if isfinite(mode["natural_frequency_rad_s"] or nan):
        parts.append(
            f"natural frequency {_with_error(mode, 'natural_frequency_rad_s')} rad/s, "
            f"damping ratio {_with_error(mode, 'damping_ratio')}"
        )
    parts += [
        f"{q['mode'].replace('_', ' ')} time constant {_quantity(q)} s"
        for q in mode.get("modes", ())
        if "time_constant" in q["quantity"] and isfinite(q["value"])
    ]
    return "; ".join(parts)


def _with_error(mode: Mapping[str, Any], key: str) -> str:
    """A figure of a mode with its standard error, where it has one."""
    error = mode[f"{key}_standard_error"]
    known = error is not None and isfinite(error)
    return f"{mode[key]:.3g} ± {error:.2g}" if known else f"{mode[key]:.3g}"


def _quantity(quantity: Mapping[str, Any]) -> str:
    value, error = quantity["value"], quantity["standard_error"]
    return f"{value:.3g} ± {error:.2g}" if isfinite(error) else f"{value:.3g}"


def _fit_line(fit: Mapping[str, Any]) -> str:
    """How well the model fits, and which derivatives the data hardly tell apart; Theil's coefficient with its shares
    of bias, variance and covariance (5.39 to 5.43)."""
    parts = [
        f"{name}: R2 {100.0 * c['r_squared']:.1f} %, Theil {c['tic']:.3f} "
        f"({100.0 * c['bias']:.0f}, {100.0 * c['variance']:.0f}, {100.0 * c['covariance']:.0f} %)"
        for name, c in fit["channels"].items()
    ]
    if fit["correlated_pairs"]:
        pairs = (
            f"{' and '.join(p['derivatives'])} ({p['correlation']:+.2f})" for p in fit["correlated_pairs"]
        )
        parts.append(f"hardly distinguished: {', '.join(pairs)}")
    if fit["residuals_coloured"]:
        parts.append("standard errors for coloured residuals")
    return "; ".join(parts)
