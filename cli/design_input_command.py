"""`wingwatch design-input`: an excitation, what it contains, and the standard errors that it promises."""

import argparse
import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import (
    MODEL_DERIVATIVES,
    MODEL_STRUCTURES,
    SURFACE_OF_INPUT,
    Aircraft,
    FlightCondition,
    ModeStructure,
    analysis_band_hz,
    linearised_at,
    load_aircraft,
    trim,
)
from wingwatch.cli.asked_condition import asked_condition
from wingwatch.cli.design_input_modes import check_kind, flown_rad_s, mode_notes, usual_length_s
from wingwatch.input_design import (
    INPUT_KINDS,
    InputDesign,
    Promise,
    SensedPlant,
    SurfaceTarget,
    design_input,
    input_notes,
    promise,
    sensed_plant,
    surface_targets,
)
from wingwatch.operations.convention import check_convention, in_convention
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import PICTURES
from wingwatch.operations.progress import page, write_json

__all__ = ["Designed", "run"]

_ENERGY_REFERENCE = "doublet"

_Rows = dict[str, dict[str, Any]]
"""Derivatives of a mode by symbol: value, standard error, unit, and the name where that is not the symbol."""


@dataclass(frozen=True, slots=True)
class _Task:
    """What is to be excited, where.

    Attributes:
        aircraft: the aircraft.
        condition: with the trim's angle of attack.
        elevator_trim_rad: of the trim, 0 where it is not known.
        plants: one a mode.
        targets: surfaces of all modes, each mode where it is as the aircraft flies.
        own_rad_s: of each target, where its mode is in its own model.
    """

    aircraft: Aircraft
    condition: FlightCondition
    elevator_trim_rad: float
    plants: tuple[SensedPlant, ...]
    targets: tuple[SurfaceTarget, ...]
    own_rad_s: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Designed:
    """An input and what comes of it.

    Attributes:
        design: the input.
        promises: one a mode, concise.
        shown: for each of them its derivatives, values and standard errors in the convention asked for.
        notes: what stands against it.
    """

    design: InputDesign
    promises: tuple[Promise, ...]
    shown: tuple[_Rows, ...]
    notes: tuple[str, ...]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    _check(arguments)
    aircraft = load_aircraft(arguments.aircraft)
    check_convention(aircraft, arguments.convention)
    kinds = tuple(INPUT_KINDS) if arguments.compare else (arguments.kind,)
    try:
        task = _task(arguments, aircraft)
        structures = [plant.structure for plant in task.plants]
        length_s = usual_length_s(task.targets, structures) if arguments.length is None else arguments.length
        made = {kind: _designed(task, kind, length_s, arguments.rate, arguments.convention) for kind in kinds}
    except ValueError as error:  # what cannot be trimmed, designed or promised, each in one sentence
        raise CommandError(" ".join(str(error).split())) from None
    head = _head(task, arguments, length_s)
    if arguments.compare:
        compared = head | {"kinds": {kind: _summary(one) for kind, one in made.items()}}
        write_json(compared) if arguments.json else _show_compared(page(), head, made)
        return 0
    one = made[arguments.kind]
    _write(arguments, one, task)
    if arguments.json:
        write_json(head | {"kind": arguments.kind} | _summary(one) | _series(one))
    else:
        _show(page(), head, one)
    return 0


def _check(arguments: argparse.Namespace) -> None:
    """Refuse before the work what could not be said or written after it."""
    if arguments.compare and (arguments.kind or arguments.out or arguments.plot):
        raise CommandError("--compare prints all kinds; leave out --kind, --out and --plot")
    if not arguments.compare and not arguments.kind:
        raise CommandError(f"--kind is missing: give one of {', '.join(INPUT_KINDS)}, or --compare")
    if not 0.0 < arguments.amplitude < 90.0:
        raise CommandError(f"--amplitude {arguments.amplitude:g}: give more than 0 and less than 90 degrees")
    for option, path, suffixes in (
        ("--out", arguments.out, (".csv",)),
        ("--plot", arguments.plot, PICTURES),
    ):
        if path is None:
            continue
        if path.suffix.lower() not in suffixes:
            raise CommandError(
                f"{option} {path}: it is written as {', '.join(suffixes)}; choose such a suffix"
            )
        if not path.parent.is_dir():
            raise CommandError(f"{option} {path}: there is no folder {path.parent}; create it")
    if arguments.plot is not None:
        from wingwatch.cli import design_input_plot

        design_input_plot.need_matplotlib()


def _task(arguments: argparse.Namespace, aircraft: Aircraft) -> _Task:
    structures = [MODEL_STRUCTURES[name] for name in dict.fromkeys(arguments.mode)]
    check_kind(arguments.kind, structures)
    used = [SURFACE_OF_INPUT[u] for s in structures for u in s.inputs]
    shared = sorted({name for name in used if used.count(name) > 1})
    if shared:
        raise CommandError(
            f"--mode {' and '.join(s.name for s in structures)}: both move the {', '.join(shared)}; give one of them"
        )
    condition, elevator, derivatives = _expected(arguments, aircraft, structures)
    amplitude = math.radians(arguments.amplitude)
    plants = tuple(sensed_plant(aircraft, s, condition, derivatives[s.name]) for s in structures)
    targets, own = [], []
    for s in structures:
        flown = flown_rad_s(aircraft, condition, s)
        for target in surface_targets(s, derivatives[s.name], analysis_band_hz(aircraft, s), amplitude):
            own.append(target.natural_frequency_rad_s)
            targets.append(target if flown is None else replace(target, natural_frequency_rad_s=flown))
    return _Task(aircraft, condition, elevator, plants, tuple(targets), tuple(own))


def _expected(
    arguments: argparse.Namespace, aircraft: Aircraft, structures: Sequence[ModeStructure]
) -> tuple[FlightCondition, float, Mapping[str, Mapping[str, float]]]:
    """Condition with its angle of attack, the trim's elevator, and the derivatives of each mode there."""
    if aircraft.coefficients is None and aircraft.conditions:
        return _stated(arguments, aircraft, structures)
    condition = asked_condition(arguments, aircraft)
    at = trim(aircraft, condition)
    derivatives = {s.name: linearised_at(aircraft, condition, s, at) for s in structures}
    return replace(condition, angle_of_attack_rad=at.angle_of_attack_rad), at.elevator_rad, derivatives


def _stated(
    arguments: argparse.Namespace, aircraft: Aircraft, structures: Sequence[ModeStructure]
) -> tuple[FlightCondition, float, Mapping[str, Mapping[str, float]]]:
    """The point of the aircraft's [[conditions]] that was asked for, the first where nothing was."""
    known = [c for c in aircraft.conditions if all(c.covers(s) for s in structures)]
    if not known:
        raise CommandError(
            f"aircraft {aircraft.name} states no derivatives of {', '.join(s.name for s in structures)} and no "
            "[coefficients] to derive them from; add one of them to its file"
        )
    for entry in known:
        airspeed_fits = arguments.airspeed is None or math.isclose(
            arguments.airspeed, entry.airspeed_true_m_s
        )
        altitude_fits = arguments.altitude is None or math.isclose(arguments.altitude, entry.altitude_m)
        if airspeed_fits and altitude_fits:
            values = {name: d.value for name, d in entry.derivatives.items()}
            return entry.condition, 0.0, {s.name: values for s in structures}
    points = ", ".join(f"{c.airspeed_true_m_s:g} m/s at {c.altitude_m:g} m" for c in known)
    raise CommandError(f"aircraft {aircraft.name} states derivatives only for {points}; choose one of these")


def _designed(task: _Task, kind: str, length_s: float, rate_hz: float, convention: str) -> Designed:
    design = design_input(kind, task.targets, length_s, rate_hz)
    column = {name: i for i, name in enumerate(design.surfaces)}
    promises = tuple(
        promise(
            plant,
            design.inputs_rad[:, [column[SURFACE_OF_INPUT[u]] for u in plant.structure.inputs]],
            rate_hz,
        )
        for plant in task.plants
    )
    shown = tuple(_rows(task, promised, convention) for promised in promises)
    notes = (
        *mode_notes(design, promises, task.own_rad_s),
        *input_notes(task.aircraft, design, promises, task.elevator_trim_rad),
    )
    return Designed(design, promises, shown, notes)


def _head(task: _Task, arguments: argparse.Namespace, length_s: float) -> dict[str, Any]:
    return {
        "aircraft": task.aircraft.name,
        "modes": [plant.structure.name for plant in task.plants],
        "airspeed_true_m_s": task.condition.airspeed_true_m_s,
        "altitude_m": task.condition.altitude_m,
        "amplitude_rad": math.radians(arguments.amplitude),
        "length_s": round(length_s * arguments.rate) / arguments.rate,
        "rate_hz": arguments.rate,
        "convention": arguments.convention,
    }


def _summary(one: Designed) -> dict[str, Any]:
    """Surfaces, promise, response and notes, for JSON."""
    design = one.design
    shares, peaks = design.share_in_band(), design.relative_peak_factors
    surfaces = {}
    for i, target in enumerate(design.targets):
        harmonics = design.harmonics[i] if design.harmonics else ()
        surfaces[target.surface] = {
            "energy_rad2_s": design.energy_rad2_s[i],
            "relative_peak_factor": peaks[i],
            "rate_rad_s": design.rates_rad_s[i] if not design.widths_s[i] else None,
            "step_s": design.widths_s[i] or None,
            "natural_frequency_rad_s": target.natural_frequency_rad_s,
            "band_hz": list(target.band_hz),
            "power_in_band": shares[i],
            "frequencies_hz": [k / design.length_s for k in harmonics],
        }
    return {
        "surfaces": surfaces,
        "promise": {
            promised.structure.name: rows for promised, rows in zip(one.promises, one.shown, strict=True)
        },
        "response": {
            promised.structure.name: {
                name: {"smallest": float(values.min()), "largest": float(values.max())}
                for name, values in promised.response.quantities.items()
            }
            for promised in one.promises
        },
        "signal_to_noise": {
            promised.structure.name: promised.response.signal_to_noise for promised in one.promises
        },
        "notes": list(one.notes),
    }


def _series(one: Designed) -> dict[str, Any]:
    """Time series and spectra, for JSON."""
    design = one.design
    frequency, density = design.spectrum()
    return {
        "time_s": design.time_s,
        "inputs_rad": {name: _column(design.inputs_rad, i) for i, name in enumerate(design.surfaces)},
        "spectrum": {
            "frequency_hz": frequency,
            "density_rad2_hz": {name: _column(density, i) for i, name in enumerate(design.surfaces)},
        },
    }


def _column(table: NDArray[np.float64], i: int) -> NDArray[np.float64]:
    return np.ascontiguousarray(table[:, i])


def _rows(task: _Task, promised: Promise, convention: str) -> _Rows:
    """Value and standard error of each derivative in a convention, infinite where it cannot be promised."""
    rows = {
        symbol: {
            "value": float(value),
            "standard_error": float(error),
            "unit": MODEL_DERIVATIVES[symbol].unit,
        }
        for symbol, value, error in zip(
            promised.structure.derivatives, promised.derivatives, promised.standard_error, strict=True
        )
    }
    mode = {"condition": asdict(task.condition), "derivatives": rows}
    made = in_convention(
        {"": {promised.structure.name: mode}}, task.aircraft, convention, task.condition.configuration
    )
    shown: _Rows = made[""][promised.structure.name]["derivatives"]
    return {
        symbol: row | {"standard_error": math.inf if row["standard_error"] is None else row["standard_error"]}
        for symbol, row in shown.items()
    }


def _write(arguments: argparse.Namespace, one: Designed, task: _Task) -> None:
    if arguments.out is not None:
        _write_csv(arguments.out, one.design)
    if arguments.plot is not None:
        from wingwatch.cli import design_input_plot

        title = f"{one.design.kind} for {', '.join(p.structure.name for p in task.plants)} of {task.aircraft.name}"
        design_input_plot.draw(arguments.plot, title, one.design, one.promises)


def _write_csv(path: Path, design: InputDesign) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", *(f"{name}_rad" for name in design.surfaces)])
        for now, row in zip(design.time_s.tolist(), design.inputs_rad.tolist(), strict=True):
            writer.writerow([now, *row])


def _show(console: Console, head: Mapping[str, Any], one: Designed) -> None:
    design = one.design
    _show_head(console, head)
    console.print(f"[bold]{design.kind}[/]: {escape(INPUT_KINDS[design.kind])}")
    shares, peaks = design.share_in_band(), design.relative_peak_factors
    for i, target in enumerate(design.targets):
        step = f"steps of {design.widths_s[i]:.3g} s, " if design.widths_s[i] else ""
        low, high = target.band_hz
        console.print(
            f"  {target.surface}: {step}energy {1e3 * design.energy_rad2_s[i]:.3g}e-3 rad2 s, relative peak factor "
            f"{peaks[i]:.2f}, {100.0 * shares[i]:.0f} % of its power in {low:.3g} to {high:.3g} Hz"
        )
    for promised, rows in zip(one.promises, one.shown, strict=True):
        console.print(_promise_table(promised, rows))
        console.print(f"  response: {_response_text(promised)}")
    for note in one.notes:
        console.print(f"note: {escape(note)}", style="yellow")


def _show_head(console: Console, head: Mapping[str, Any]) -> None:
    console.print(
        f"{head['aircraft']} at {head['airspeed_true_m_s']:g} m/s and {head['altitude_m']:g} m: "
        f"{', '.join(head['modes'])}; {math.degrees(head['amplitude_rad']):g} degrees, {head['length_s']:g} s at "
        f"{head['rate_hz']:g} Hz"
    )


def _promise_table(promised: Promise, rows: _Rows) -> Table:
    table = Table(title=f"{promised.structure.name}: promised", title_justify="left", title_style="bold")
    for name in ("derivative", "unit", "value", "standard error", "in percent"):
        table.add_column(name, justify="left" if name in ("derivative", "unit") else "right")
    for symbol, row in rows.items():
        value, error = row["value"], row["standard_error"]
        table.add_row(
            row.get("name", symbol),
            row["unit"],
            f"{value:.4g}",
            f"{error:.2g}" if math.isfinite(error) else "-",
            _percent(error, value),
        )
    return table


def _percent(error: float, value: float) -> str:
    return f"{100.0 * error / abs(value):.2g}" if math.isfinite(error) and value != 0.0 else "-"


def _response_text(promised: Promise) -> str:
    parts = []
    for name, values in promised.response.quantities.items():
        low, high = float(values.min()), float(values.max())
        if name.endswith("_rad_s"):
            text = f"{math.degrees(low):.3g} to {math.degrees(high):.3g} degrees/s"
        elif name.endswith("_rad"):
            text = f"{math.degrees(low):.3g} to {math.degrees(high):.3g} degrees"
        else:
            text = f"{low:.3g} to {high:.3g}"
        parts.append(f"{name.removesuffix('_s').removesuffix('_rad').replace('_', ' ')} {text}")
    return ", ".join(parts)


def _show_compared(console: Console, head: Mapping[str, Any], made: Mapping[str, Designed]) -> None:
    _show_head(console, head)
    energy = {kind: float(one.design.energy_rad2_s.sum()) for kind, one in made.items()}
    console.print(
        _comparison("standard errors in percent, at the same amplitude", made, dict.fromkeys(made, 1.0))
    )
    same = {kind: math.sqrt(energy[_ENERGY_REFERENCE] / e) for kind, e in energy.items()}
    console.print(_comparison(f"the same at the energy of the {_ENERGY_REFERENCE}", made, same))


def _comparison(title: str, made: Mapping[str, Designed], amplitude: Mapping[str, float]) -> Table:
    """Kinds side by side; errors go with the inverse of the amplitude, responses with the amplitude."""
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column("")
    for kind in made:
        table.add_column(kind.replace("-", " "), justify="right")
    designs = {kind: one.design for kind, one in made.items()}
    table.add_row(
        "amplitude, deg",
        *(f"{math.degrees(d.targets[0].amplitude_rad) * amplitude[k]:.2g}" for k, d in designs.items()),
    )
    table.add_row(
        "energy, 1e-3 rad2 s",
        *(f"{1e3 * d.energy_rad2_s.sum() * amplitude[k] ** 2:.3g}" for k, d in designs.items()),
        end_section=True,
    )
    for m, first in enumerate(next(iter(made.values())).promises):
        rows = {kind: one.shown[m] for kind, one in made.items()}
        for symbol in first.structure.derivatives:
            of_kind = {kind: rows[kind][symbol] for kind in made}
            cells = [_percent(r["standard_error"] / amplitude[k], r["value"]) for k, r in of_kind.items()]
            table.add_row(next(iter(of_kind.values())).get("name", symbol), *cells)
    return table
