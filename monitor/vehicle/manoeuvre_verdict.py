"""Was that a good manoeuvre? What it taught, what was poor in it, and what would teach more.

The standard errors are the estimators' own, of the solutions before the manoeuvre and after it. What is poor:

- too small: the angular rates that its surfaces move stay below ten times their sensors' noise (thesis 4.2.3);
- too slow: of every surface of the mode that moved, more than half of the deflection's energy lies more than an octave
  below the natural frequency of the mode that is expected (a doublet of thesis equation 4.2 has its peak there); an
  autopilot that answers slowly with another surface makes no input slow;
- too fast: likewise more than an octave above it, and above the band that the estimators read;
- correlated inputs: two surfaces of a mode moved so much alike that either's derivatives are known half as well as they
  would be if it had moved alone: the variance is 1 / (1 - r^2) of that, so |r| above sqrt(3)/2;
- rough air: the air makes a tenth or more of the rotation (``supervision``).
"""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import DERIVATIVES, FlightCondition, ModeStructure, analysis_band_hz
from wingwatch.baselines import OutOfEnvelope
from wingwatch.input_design import surface_targets
from wingwatch.monitor.detection.surfaces_seen import surface_name
from wingwatch.monitor.vehicle.manoeuvre_watch import FlownManoeuvre
from wingwatch.monitor.vehicle.proposing import fitting_input, mode_of_surface
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor
from wingwatch.monitor.views import HelpfulInputView, LearnedView, ManoeuvreView, PoorView

__all__ = ["verdict"]

Array = NDArray[np.float64]

SIGNAL_TO_NOISE = 10.0
"""Preferred by thesis 4.2.3."""
CORRELATION = math.sqrt(0.75)
"""Of two inputs, from which on either's standard error is doubled."""
ANSWER = 0.25
"""Of the largest deflection; a surface that moves less is taken for an autopilot's answer."""
OCTAVE = 2.0
_AMPLITUDE_RAD = math.radians(2.0)
_LEAST_LEARNED = 0.9
"""Of a standard error, above which it is not called smaller."""
_BINS_BELOW = 16
"""Frequencies from zero to an octave below the mode's."""
_RATE_COLUMN = {"p": "roll_rate_rad_s", "q": "pitch_rate_rad_s", "r": "yaw_rate_rad_s"}
_RATES = tuple(_RATE_COLUMN.values())


def verdict(monitor: VehicleMonitor, flown: FlownManoeuvre, number: int) -> ManoeuvreView:
    """The verdict on a manoeuvre; it changes nothing of the monitor.

    Args:
        monitor: that watched it, just now.
        flown: the manoeuvre.
        number: of the vehicle's manoeuvres.
    """
    modes = _moved_modes(monitor, flown)
    learned = tuple(row for structure in modes for row in _learned(monitor, structure, flown))
    condition = monitor.condition
    poor: list[PoorView] = []
    inputs: dict[str, HelpfulInputView] = {}
    meant = _meant(flown)
    for structure, moved in modes.items():
        surfaces = [column for column in moved if column in meant]
        if not surfaces:
            continue
        found = list(_poor(monitor, structure, surfaces, flown, condition))
        poor += found
        if condition is not None and any(one.what != "rough_air" for one in found):
            for surface in surfaces:
                small = [one.what for one in found if one.what != "rough_air"] == ["too_small"]
                wanted_rad = _wanted_rad(monitor, structure, surface, flown, small)
                if (one := _helpful(monitor, condition, surface, wanted_rad)) is not None:
                    inputs[surface] = one
    deflections = np.abs(flown.deflections_rad).max(axis=0).tolist()
    return ManoeuvreView(
        number, flown.begin_s, flown.end_s, flown.known_s,
        dict(zip(flown.surfaces, deflections, strict=True)), not poor, learned, tuple(poor),
        tuple(inputs.values()), _text(poor, learned, tuple(inputs.values())),
    )  # fmt: skip


def _moved_modes(monitor: VehicleMonitor, flown: FlownManoeuvre) -> dict[ModeStructure, list[str]]:
    """By mode that is estimated, the columns of its surfaces that moved."""
    found: dict[ModeStructure, list[str]] = {}
    for column in flown.surfaces:
        structure = mode_of_surface(surface_name(column), monitor.chain.structures)
        if structure is not None and structure.name in flown.after.modes:
            found.setdefault(structure, []).append(column)
    return found


def _meant(flown: FlownManoeuvre) -> list[str]:
    """Surfaces that were flown; what an autopilot answers with another one is no input to be judged."""
    furthest = np.abs(flown.deflections_rad).max(axis=0)
    return [
        name for name, size in zip(flown.surfaces, furthest, strict=True) if size >= ANSWER * furthest.max()
    ]


def _learned(
    monitor: VehicleMonitor, structure: ModeStructure, flown: FlownManoeuvre
) -> Iterator[LearnedView]:
    after = flown.after.modes[structure.name]
    before = None if flown.before is None else flown.before.modes.get(structure.name)
    earlier = {} if before is None else {e.estimator: e for e in before.estimates}
    for estimate in after.estimates:
        if after.reconstructed and estimate is after.fourier:
            continue  # without a vane the filter alone is valid
        name, now = estimate.estimator, estimate.standard_error.tolist()
        then = earlier[name].standard_error.tolist() if name in earlier else [None] * len(now)
        for symbol, old, new in zip(structure.derivatives, then, now, strict=True):
            yield LearnedView(name, structure.name, symbol, old, new)


def _poor(
    monitor: VehicleMonitor,
    structure: ModeStructure,
    surfaces: Sequence[str],
    flown: FlownManoeuvre,
    condition: FlightCondition | None,
) -> Iterator[PoorView]:
    ratios = _signal_to_noise(monitor, structure, flown)
    if ratios and max(ratios.values()) < SIGNAL_TO_NOISE:
        said = ", ".join(f"{column} {ratio:.2g}" for column, ratio in ratios.items())
        yield PoorView(
            "too_small", f"too small: signal-to-noise of {said}, and {SIGNAL_TO_NOISE:g} is wanted"
        )
    frequency = None if condition is None else _mode_rad_s(monitor, structure, condition)
    if frequency is not None:
        yield from _off_mode(flown, surfaces, frequency, analysis_band_hz(monitor.aircraft, structure)[1])
    for first, second in combinations(surfaces, 2):
        r = _correlation(flown, first, second)
        if abs(r) > CORRELATION:
            names = f"{surface_name(first)} and {surface_name(second)}"
            yield PoorView("correlated_inputs", f"correlated inputs: {names} moved alike (r = {r:.2f})")
    if structure.name in flown.rough:
        mode = structure.name.replace("_", " ")
        yield PoorView("rough_air", f"rough air: gusts caused a tenth or more of the rotation ({mode})")


def _off_mode(
    flown: FlownManoeuvre, surfaces: Sequence[str], frequency_rad_s: float, most_hz: float
) -> Iterator[PoorView]:
    """Too slow or too fast, where every surface is.

    Args:
        most_hz: of the mode's band.
    """
    at_hz = frequency_rad_s / (2.0 * math.pi)
    edges_hz = (at_hz / OCTAVE, max(at_hz * OCTAVE, most_hz))
    parts = {column: _beyond(flown, column, edges_hz) for column in surfaces}
    for k, (what, where) in enumerate((("slow", "below"), ("fast", "above"))):
        if all(one[k] > 0.5 for one in parts.values()):
            said = " and ".join(
                f"{100.0 * one[k]:.0f} % of the {surface_name(column)}'s energy"
                for column, one in parts.items()
            )
            yield PoorView(
                f"too_{what}",
                f"too {what}: {said} lies {where} {edges_hz[k]:.2g} Hz, and the mode is at {at_hz:.2g} Hz",
            )


def _signal_to_noise(
    monitor: VehicleMonitor, structure: ModeStructure, flown: FlownManoeuvre
) -> dict[str, float]:
    """By column of the mode's rates whose noise the aircraft file states, rms of the motion over it."""
    found = {}
    for state in structure.states:
        column = _RATE_COLUMN.get(state)
        noise = None if column is None else monitor.aircraft.noise_std(column)
        if column is not None and noise:
            rate = flown.rates_rad_s[:, _RATES.index(column)]
            rate = rate[np.isfinite(rate)]
            if rate.size:
                # of what the sensor shows, its own noise taken off
                found[column] = math.sqrt(max(float(rate.var()) - noise**2, 0.0)) / noise
    return found


def _mode_rad_s(
    monitor: VehicleMonitor, structure: ModeStructure, condition: FlightCondition
) -> float | None:
    """Natural frequency of the mode that is expected; None where it has none, or nothing is expected there."""
    expected = monitor.expectation(structure, condition)
    if isinstance(expected, OutOfEnvelope):
        return None
    derivatives = dict(zip(structure.derivatives, expected.value.tolist(), strict=True))
    try:
        targets = surface_targets(
            structure, derivatives, analysis_band_hz(monitor.aircraft, structure), _AMPLITUDE_RAD
        )
    except ValueError:  # a mode that does not oscillate
        return None
    return targets[0].natural_frequency_rad_s


def _beyond(flown: FlownManoeuvre, column: str, edges_hz: tuple[float, float]) -> tuple[float, float]:
    """Fractions of a deflection's energy below and above two frequencies."""
    deflection = flown.deflections_rad[:, flown.surfaces.index(column)]
    step_s = float(np.median(np.diff(flown.time_s)))
    least = math.ceil(_BINS_BELOW / (edges_hz[0] * step_s))
    size = 1 << (max(least, 2 * deflection.size) - 1).bit_length()
    power = np.abs(np.fft.rfft(deflection, size)) ** 2
    power[0] *= 0.5  # one-sided
    frequency_hz, total = np.fft.rfftfreq(size, step_s), float(power.sum())
    if total == 0.0:
        return 0.0, 0.0
    below, above = frequency_hz < edges_hz[0], frequency_hz > edges_hz[1]
    return float(power[below].sum()) / total, float(power[above].sum()) / total


def _correlation(flown: FlownManoeuvre, first: str, second: str) -> float:
    pair = flown.deflections_rad[:, [flown.surfaces.index(first), flown.surfaces.index(second)]]
    away = pair - pair.mean(axis=0)
    sizes = np.sqrt((away**2).sum(axis=0))
    return float(away[:, 0] @ away[:, 1] / sizes.prod()) if sizes.all() else 0.0


def _wanted_rad(
    monitor: VehicleMonitor, structure: ModeStructure, column: str, flown: FlownManoeuvre, small: bool
) -> float:
    """The amplitude that was flown; where it was nothing but too small, the one that would have been enough."""
    flown_rad = float(np.abs(flown.deflections_rad[:, flown.surfaces.index(column)]).max())
    if not small:
        return flown_rad
    best = max(_signal_to_noise(monitor, structure, flown).values())
    return flown_rad * SIGNAL_TO_NOISE / max(best, 1.0)


def _helpful(
    monitor: VehicleMonitor, condition: FlightCondition, column: str, wanted_rad: float
) -> HelpfulInputView | None:
    design = fitting_input(monitor, condition, surface_name(column), "doublet", wanted_rad)
    if design is None:
        return None
    return HelpfulInputView(column, design.kind, design.targets[0].amplitude_rad, design.widths_s[0])


def _text(
    poor: Sequence[PoorView], learned: Sequence[LearnedView], inputs: Sequence[HelpfulInputView]
) -> str:
    said = [_taught(learned)]
    if poor:
        said.append(_sentence("; ".join(one.text for one in poor)))
    steps = [
        f"a doublet of the {surface_name(one.surface)}, {math.degrees(one.amplitude_rad):.2g} degrees, "
        f"{one.width_s:.2g} s each way"
        for one in inputs
    ]
    if steps:
        each = ", one after the other" if len(steps) > 1 else ""
        said.append(_sentence(f"{' and '.join(steps)}{each}, would help"))
    elif any(one.what == "rough_air" for one in poor):
        said.append("The same in calmer air would help.")
    return f"{'Good' if not poor else 'Poor'}. {' '.join(said)}"


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _taught(learned: Sequence[LearnedView]) -> str:
    """The derivative by a surface that gained most, and how many gained."""
    gains = [
        (one.after / one.before, one)
        for one in learned
        if one.before is not None and math.isfinite(one.before) and one.before > 0.0
    ]
    if not gains:
        return "Nothing was estimated before it."
    better = [one for one in gains if one[0] < _LEAST_LEARNED]
    if not better:
        return "It added no information to that of before."
    names = {one.derivative for _, one in better}
    ratio, best = min(better, key=lambda one: one[0])
    unit = DERIVATIVES[best.derivative].unit if best.derivative in DERIVATIVES else ""
    return (
        f"{len(names)} of {len({one.derivative for one in learned})} derivatives are known better, {best.derivative} "
        f"most: standard error {best.before:.2g} to {best.after:.2g} {unit}, {1.0 / ratio:.1f} times smaller."
    )
