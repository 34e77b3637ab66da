"""Repeats of a manoeuvre: each estimated alone, and their scatter beside the standard errors that each states.

With n repeats of values x_i and stated standard errors s_i, thesis (5.28) and (5.29) give the scatter and the mean, and

    ratio^2 = sum_i (x_i - mean)^2 / (n - 1) / (sum_i s_i^2 / n)

is the scatter in stated errors. Where the errors hold its mean is one, whether they are equal or not; where they are
equal, (n - 1) ratio^2 is chi-square with n - 1 degrees of freedom, from which the interval of the ratio follows. Values
are not weighed by their own s_i: those of a short manoeuvre are known to some tens of percent, and the smallest of
them would decide. What is common to all repeats (a bias, a wrong calibration) does not scatter, and no repeat tells of
it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.aircraft import MODEL_STRUCTURES, STRUCTURES, SURFACE_OF_INPUT, Aircraft, ModeStructure
from wingwatch.diagnosis.offline_estimates import Solve, structure_solver
from wingwatch.estimators import (
    Estimate,
    Form,
    Manoeuvre,
    Outcome,
    flight_manoeuvres,
    in_form,
    missing_channels,
)
from wingwatch.telemetry import FlightTable, SampleBlock

__all__ = ["FlownWindow", "RepeatedDerivative", "RepeatedManoeuvre", "repeated_derivative", "repeats"]

Array = NDArray[np.float64]

_LEAD_S = 1.0
"""Of steady flight before the first movement, which tells the trim."""
_CONFIDENCE = 0.95
_KNOWN = (Outcome.CONVERGED, Outcome.SETTLING)


@dataclass(frozen=True, slots=True)
class FlownWindow:
    """A manoeuvre as it was found: its number in the flight, the surfaces that moved, and the time of the movement."""

    number: int
    surfaces: tuple[str, ...]
    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class RepeatedDerivative:
    """One derivative by the repeats of a manoeuvre.

    Attributes:
        numbers: of the manoeuvres that determine it.
        values, standard_errors: as each states them, concise units.
        mean, scatter: arithmetic mean and sample standard deviation (5.28, 5.29).
        stated: root mean square of ``standard_errors``.
        ratio: scatter in stated errors; ratio_interval: its 95 % interval by chi-square.
        chance: of a ratio as far from one, on either side, where the stated errors hold.
        contradicts: whether that is less than 5 % for all derivatives of the call together (Bonferroni).
        changed_after: number of the manoeuvre after which the derivative is another one, where a single change
            explains the scatter; with the mean before and after.
    """

    numbers: tuple[int, ...]
    values: Array
    standard_errors: Array
    mean: float
    scatter: float
    stated: float
    ratio: float
    ratio_interval: tuple[float, float]
    chance: float
    contradicts: bool = False
    changed_after: tuple[int, float, float] | None = None


@dataclass(frozen=True, slots=True)
class RepeatedManoeuvre:
    """Manoeuvres of one structure that moved the same surfaces.

    Attributes:
        structure, surfaces: which; surfaces are columns of the flight table.
        windows: the repeats, in the order of the flight.
        condition: airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad, the mean of the repeats; all
            values hold there.
        airspeed_m_s: lowest and highest mean of a repeat.
        derivatives: those that two repeats or more tell.
        not_estimated: reason by number of a repeat that could not be estimated.
    """

    structure: ModeStructure
    surfaces: tuple[str, ...]
    windows: tuple[FlownWindow, ...]
    condition: tuple[float, float, float, float]
    airspeed_m_s: tuple[float, float]
    derivatives: Mapping[str, RepeatedDerivative]
    not_estimated: Mapping[int, str]


def repeats(
    flight: FlightTable,
    clean: SampleBlock,
    aircraft: Aircraft,
    windows: Sequence[FlownWindow],
    estimator: str,
    *,
    structures: Sequence[str] = (),
    form: Form = "accelerometer",
) -> tuple[tuple[RepeatedManoeuvre, ...], tuple[str, ...]]:
    """The repeats of every manoeuvre of a flight, and what could not be compared, one clause each.

    Args:
        flight: as loaded; clean: its samples, cleaned and completed.
        windows: its manoeuvres, in order.
        estimator: one of ``OFFLINE_ESTIMATORS``.
        structures: names in ``MODEL_STRUCTURES``; those that are watched live where empty.
        form: of the force equations.
    """
    found: list[RepeatedManoeuvre] = []
    notes: list[str] = []
    for structure in (MODEL_STRUCTURES[name] for name in structures or STRUCTURES):
        missing = missing_channels(structure, flight.block.present, form)
        if missing:
            notes.append(f"{structure.name}: missing {', '.join(missing)}")
            continue
        shape, solve = structure_solver(flight, aircraft, structure, estimator, form)
        for moved, group in _groups(structure, windows).items():
            if len(group) < 2:
                names = " and ".join(column.removesuffix("_rad") for column in moved)
                notes.append(f"{structure.name}: {names} moved in one manoeuvre, which has no repeat")
                continue
            parts = {
                w.number: flight_manoeuvres(structure, shape, [_samples(clean, w, windows, shape.window_s)])
                for w in group
            }
            found.append(_repeated(structure, solve, moved, group, parts))
    return _judged(found), tuple(notes)


def _groups(
    structure: ModeStructure, windows: Sequence[FlownWindow]
) -> dict[tuple[str, ...], list[FlownWindow]]:
    """Manoeuvres by those surfaces of a structure that they moved."""
    own = [f"{SURFACE_OF_INPUT[u]}_rad" for u in structure.inputs if u in SURFACE_OF_INPUT]
    groups: dict[tuple[str, ...], list[FlownWindow]] = {}
    for window in windows:
        if moved := tuple(column for column in own if column in window.surfaces):
            groups.setdefault(moved, []).append(window)
    return groups


def _samples(
    clean: SampleBlock, window: FlownWindow, windows: Sequence[FlownWindow], longest_s: float
) -> SampleBlock:
    """From steady flight before a manoeuvre to the next one, or as far as an estimator's window goes."""
    before = max((w.end_s for w in windows if w.number < window.number), default=-math.inf)
    after = min((w.begin_s for w in windows if w.number > window.number), default=math.inf)
    begin = max(window.begin_s - _LEAD_S, before)
    end = min(after, max(window.end_s + _LEAD_S, begin + longest_s))
    return SampleBlock(clean.values[(clean.time_s >= begin) & (clean.time_s <= end)])


def _repeated(
    structure: ModeStructure,
    solve: Solve,
    moved: tuple[str, ...],
    group: Sequence[FlownWindow],
    parts: Mapping[int, tuple[Manoeuvre, ...]],
) -> RepeatedManoeuvre:
    """All repeats at their common condition."""
    not_estimated = {
        n: "there are not two seconds of whole samples in a row" for n, cut in parts.items() if not cut
    }
    condition = _mean_condition([part for cut in parts.values() for part in cut])
    estimates: dict[int, Estimate] = {}
    for number, cut in parts.items():
        if not cut:
            continue
        try:
            at_common = [replace(part, condition=condition) for part in cut]
            estimates[number] = in_form(*solve(at_common), structure)[0]
        except ValueError as error:
            not_estimated[number] = str(error)
    speeds = [_mean_condition(cut)[0] for cut in parts.values() if cut]
    return RepeatedManoeuvre(
        structure, moved, tuple(group), condition,
        (min(speeds, default=math.nan), max(speeds, default=math.nan)),
        _by_derivative(structure, estimates), not_estimated,
    )  # fmt: skip


def _mean_condition(parts: Sequence[Manoeuvre]) -> tuple[float, float, float, float]:
    if not parts:
        return math.nan, math.nan, math.nan, math.nan
    mean = np.average([p.condition for p in parts], axis=0, weights=[p.duration_s for p in parts])
    return float(mean[0]), float(mean[1]), float(mean[2]), float(mean[3])


def _by_derivative(
    structure: ModeStructure, estimates: Mapping[int, Estimate]
) -> dict[str, RepeatedDerivative]:
    """Derivatives that two repeats or more tell."""
    found = {}
    for k, symbol in enumerate(structure.derivatives):
        observed = {
            number: (float(one.value[k]), math.sqrt(float(one.covariance[k, k])))
            for number, one in estimates.items()
            if one.outcomes[k] in _KNOWN
            and np.isfinite(one.value[k])
            and 0.0 < one.covariance[k, k] < math.inf
        }
        if len(observed) >= 2:
            found[symbol] = repeated_derivative(
                tuple(observed), *(np.array(c) for c in zip(*observed.values(), strict=True))
            )
    return found


def repeated_derivative(
    numbers: tuple[int, ...], values: Array, standard_errors: Array
) -> RepeatedDerivative:
    """Scatter of two or more values beside their stated standard errors, (n,) each."""
    freedom, stated = values.size - 1, math.sqrt(float(np.mean(standard_errors**2)))
    square = _squares(values) / stated**2
    low, high = (scipy.stats.chi2.ppf(0.5 * (1.0 + side * _CONFIDENCE), freedom) for side in (-1.0, 1.0))
    tails = scipy.stats.chi2.sf(square, freedom), scipy.stats.chi2.cdf(square, freedom)
    return RepeatedDerivative(
        numbers, values, standard_errors, float(values.mean()), float(values.std(ddof=1)),
        stated, math.sqrt(square / freedom),
        (math.sqrt(square / high), math.sqrt(square / low)), min(1.0, 2.0 * float(min(tails))),
    )  # fmt: skip


def _squares(values: Array) -> float:
    return float(((values - values.mean()) ** 2).sum())


def _judged(found: Sequence[RepeatedManoeuvre]) -> tuple[RepeatedManoeuvre, ...]:
    """With the derivatives whose scatter contradicts the stated errors, all tests of the call taken together."""
    count = sum(len(one.derivatives) for one in found)
    limit = (1.0 - _CONFIDENCE) / max(count, 1)
    judged = []
    for one in found:
        rows = {
            symbol: replace(row, contradicts=True, changed_after=_change(row, limit))
            if row.chance < limit
            else row
            for symbol, row in one.derivatives.items()
        }
        judged.append(replace(one, derivatives=rows))
    return tuple(judged)


def _change(row: RepeatedDerivative, limit: float) -> tuple[int, float, float] | None:
    """The manoeuvre after which another value explains the scatter; None where no single change does."""
    if row.ratio < 1.0 or row.values.size < 4:
        return None

    def left(k: int) -> float:
        return (_squares(row.values[:k]) + _squares(row.values[k:])) / row.stated**2

    best = min(range(1, row.values.size), key=left)
    if scipy.stats.chi2.sf(left(best), row.values.size - 2) < limit:
        return None
    return row.numbers[best - 1], float(row.values[:best].mean()), float(row.values[best:].mean())
