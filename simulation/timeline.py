"""What an aircraft's parameters are at every time of a flight, from the effects that befall it.

Between two times the parameters change linearly; a step is two rows at one time, of which the later holds at that
time. A ramp starts as one piece and is halved while the middle of a piece deviates from the straight line
by more than ``_DEVIATION`` of the change, at most ``_HALVINGS`` times: an effect may be non-linear in its severity, and
two that overlap multiply. An effect that is linear alone costs two rows. What is flown is this table, so truth,
trim and linearisation read it too and no error of the pieces stands between truth and flight.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, FlightCondition
from wingwatch.aircraft import trim as level_trim
from wingwatch.simulation.effects import Effect, parameters_under
from wingwatch.simulation.layout import ALPHA_REFERENCE, GUST_GAIN, GUST_SIGMA, parameter_row

__all__ = ["Timeline", "base_row", "timeline"]

_DEVIATION = 1e-3
_HALVINGS = 5
_ROUNDING = 1e-12
"""A change that is less is no step."""


@dataclass(frozen=True, slots=True)
class Timeline:
    """Parameters over time.

    Attributes:
        row: parameters at the first time and before, shape (len(PARAMETERS),).
        columns: those that change, ascending, shape (c,).
        times_s: ascending, two alike for a step, shape (n,); empty where nothing changes.
        values: of those columns at those times, shape (n, c).
    """

    row: NDArray[np.float64]
    columns: NDArray[np.int64]
    times_s: NDArray[np.float64]
    values: NDArray[np.float64]

    def at(self, time_s: float) -> NDArray[np.float64]:
        """Parameters at a time, shape (len(PARAMETERS),)."""
        row = self.row.copy()
        if self.times_s.size == 0 or time_s < self.times_s[0]:
            return row
        k = int(np.searchsorted(self.times_s, time_s, side="right")) - 1
        if k + 1 == self.times_s.size:
            row[self.columns] = self.values[k]
            return row
        share = (time_s - self.times_s[k]) / (self.times_s[k + 1] - self.times_s[k])
        row[self.columns] = _between(self.values[k], self.values[k + 1], share)
        return row


def _between(before: NDArray[np.float64], after: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Linear; what is infinite or not a number at an end takes the later row's value once it has begun."""
    finite = np.isfinite(before) & np.isfinite(after)
    straight = (
        np.where(finite, before, 0.0)
        + share * np.where(finite, after, 0.0)
        - share * np.where(finite, before, 0.0)
    )
    return np.where(finite, straight, after if share > 0.0 else before)


def base_row(
    aircraft: Aircraft, condition: FlightCondition, gust_gain: float = 0.0, gust_sigma_m_s: float = 0.0
) -> NDArray[np.float64]:
    """Parameters without effects: the file's, angles of attack counted from the clean level trim.

    Args:
        aircraft: the type.
        condition: where it flies.
        gust_gain: 1 in turbulence from the start, else 0.
        gust_sigma_m_s: root mean square of the gust filter's vertical gust at gain 1.

    Raises:
        AircraftDataError, TrimError: as ``aircraft.trim``.
    """
    row = parameter_row(aircraft)
    level = level_trim(aircraft, FlightCondition(condition.airspeed_true_m_s, condition.altitude_m))
    row[ALPHA_REFERENCE] = level.angle_of_attack_rad
    row[GUST_GAIN], row[GUST_SIGMA] = gust_gain, gust_sigma_m_s
    return row


def timeline(
    aircraft: Aircraft, condition: FlightCondition, effects: Sequence[Effect], clean: NDArray[np.float64]
) -> Timeline:
    """The parameters of an aircraft under effects, from those without (``base_row``)."""

    def under(time_s: float) -> NDArray[np.float64]:
        return parameters_under(aircraft, condition, effects, time_s, clean)

    breaks = sorted({e.onset_s for e in effects} | {e.onset_s + e.ramp_s for e in effects})
    times, rows = [-math.inf], [under(-1.0)]
    for i, at in enumerate(breaks):
        now = under(at)
        before = under(math.nextafter(at, -math.inf)) if at > 0.0 else rows[-1]
        if np.allclose(before, now, rtol=_ROUNDING, atol=0.0, equal_nan=True):
            before = now
        if i > 0:
            for between in _pieces(under, breaks[i - 1], rows[-1], at, before, _HALVINGS):
                times.append(between)
                rows.append(under(between))
        times += [at, at]
        rows += [before, now]
    return _compressed(np.array(times), np.array(rows))


def _pieces(
    under: Callable[[float], NDArray[np.float64]],
    start: float,
    first: NDArray[np.float64],
    end: float,
    last: NDArray[np.float64],
    halvings: int,
) -> list[float]:
    """Times inside a piece at which a straight line is not enough."""
    middle = 0.5 * (start + end)
    row = under(middle)
    with np.errstate(invalid="ignore"):
        deviates = np.abs(row - 0.5 * (first + last)) > _DEVIATION * np.abs(last - first)
    deviates |= np.isinf(first) != np.isinf(last)
    if halvings == 0 or not deviates.any():
        return []
    left = _pieces(under, start, first, middle, row, halvings - 1)
    return [*left, middle, *_pieces(under, middle, row, end, last, halvings - 1)]


def _compressed(times: NDArray[np.float64], rows: NDArray[np.float64]) -> Timeline:
    """Only the columns that change, and no row that says what its neighbours say."""
    same = (rows == rows[0]) | (np.isnan(rows) & np.isnan(rows[0]))
    columns = np.flatnonzero(~same.all(axis=0))
    row, values = rows[0], rows[:, columns]
    keep = np.ones(len(times), dtype=bool)
    keep[0] = False
    for k in range(1, len(times)):
        if times[k] == times[k - 1] and np.array_equal(values[k], values[k - 1], equal_nan=True):
            keep[k] = False
    return Timeline(row, columns, times[keep], values[keep])
