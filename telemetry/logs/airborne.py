"""When an aircraft flew, by its speed, its height and what its accelerometers felt; no flag of the autopilot counts."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["AirborneLimits", "Interval", "airborne_intervals"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AirborneLimits:
    """What counts as flight.

    Attributes:
        speed_m_s: slower is on the ground, whatever the aircraft.
        speed_fraction: of the speed usual in this log, below which it is on the ground, too.
        height_m: that an interval must reach above the ground, where the log has some time on the ground.
        clear_m: above the ground from where it is off the ground; an interval begins and ends there.
        margin_s: cut off at take-off and landing, which are no free flight; not where a log begins or ends in flight.
        shortest_s: a shorter interval is none.
        bridged_s: a shorter time below the speed ends no interval.
        impact_m_s2: a specific force beyond this in the last seconds of an interval ends it.
        before_end_s: those seconds.
    """

    speed_m_s: float = 6.0
    speed_fraction: float = 0.5
    height_m: float = 5.0
    clear_m: float = 2.0
    margin_s: float = 1.0
    shortest_s: float = 5.0
    bridged_s: float = 2.0
    impact_m_s2: float = 100.0
    before_end_s: float = 10.0


@dataclass(frozen=True, slots=True)
class Interval:
    """A time in the air, both ends included, s on the table's clock."""

    from_s: float
    to_s: float

    @property
    def duration_s(self) -> float:
        """How long it is."""
        return self.to_s - self.from_s


def airborne_intervals(
    time_s: Array,
    speed_m_s: Array,
    altitude_m: Array,
    force_m_s2: Array,
    limits: AirborneLimits | None = None,
) -> tuple[Interval, ...]:
    """Times in the air, in their order.

    Args:
        time_s: rising stamps, shape (rows,).
        speed_m_s: airspeed, or speed over the ground; NaN where unknown, which continues what was.
        altitude_m: above any level; all NaN where unknown, and then height is not asked for.
        force_m_s2: magnitude of the specific force; NaN where unknown.
        limits: of what counts as flight.
    """
    limits = limits or AirborneLimits()
    speed = _smooth(time_s, _filled(speed_m_s))
    if not np.isfinite(speed).any():
        return ()
    moving = speed[speed > limits.speed_m_s]
    if moving.size == 0:
        return ()
    least = max(limits.speed_m_s, limits.speed_fraction * float(np.percentile(moving, 75)))
    fast = speed >= least
    altitude = _smooth(time_s, _filled(altitude_m))
    ground = altitude[~fast & np.isfinite(altitude)]
    above = altitude - (float(np.percentile(ground, 5)) if ground.size else np.nan)
    found = []
    for first, last in _runs(time_s, fast, limits.bridged_s):
        last = _before_impact(time_s, force_m_s2, first, last, limits)
        if np.isfinite(above[first : last + 1]).any():  # else nothing says where the ground is
            if np.max(above[first : last + 1]) < limits.height_m:
                continue
            clear = first + np.flatnonzero(above[first : last + 1] >= limits.clear_m)
            first, last = int(clear[0]), int(clear[-1])
        low = time_s[first] + (limits.margin_s if first > 0 else 0.0)
        high = time_s[last] - (limits.margin_s if last < time_s.size - 1 else 0.0)
        if high - low >= limits.shortest_s:
            found.append(Interval(float(low), float(high)))
    return tuple(found)


def _filled(values: Array) -> Array:
    """Each gap with the value before it; a gap at the start with the first value."""
    known = np.isfinite(values)
    if not known.any():
        return values
    rows = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return values[np.where(rows < 0, int(np.argmax(known)), rows)]


def _smooth(time_s: Array, values: Array) -> Array:
    """The median over a second, which a single wrong reading does not move."""
    if time_s.size < 3:
        return values
    width = min(1 + 2 * int(0.5 / max(float(np.median(np.diff(time_s))), 1e-3)), 1 + 2 * (time_s.size // 2))
    smooth: Array = scipy.ndimage.median_filter(values, size=max(width, 1), mode="nearest")
    return smooth


def _runs(time_s: Array, fast: NDArray[np.bool_], bridged_s: float) -> list[tuple[int, int]]:
    """First and last rows of each run, short pauses bridged."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], fast, [False])).astype(np.int8)))
    runs = [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]
    joined: list[tuple[int, int]] = []
    for first, last in runs:
        if joined and time_s[first] - time_s[joined[-1][1]] < bridged_s:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined


def _before_impact(time_s: Array, force_m_s2: Array, first: int, last: int, limits: AirborneLimits) -> int:
    """The last row before the first spike near the end; the given one where there is none, or nothing follows."""
    late = time_s[first : last + 1] >= time_s[last] - limits.before_end_s
    with np.errstate(invalid="ignore"):
        hard = np.flatnonzero(late & (force_m_s2[first : last + 1] > limits.impact_m_s2))
    return first + max(int(hard[0]) - 1, 0) if hard.size else last
