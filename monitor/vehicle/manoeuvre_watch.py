"""Manoeuvres in a vehicle's samples: from a surface's first movement until all surfaces rest again.

Looked at once a solution, half a second of samples at a time. A surface moves where its readings span more in half a
second than they usually do: more than ``LEAST_RAD``, than noise of the stated size, and than twice the recent span.
A manoeuvre is over when every surface that moved has been back at its trim for ``REST_S``, has been held elsewhere for
``HELD_S``, or after ``LONGEST_S``. Nothing of this is in a checkpoint: a manoeuvre that a restart cuts is not judged.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.kernels.decorators import compiled
from wingwatch.monitor.detection.surfaces_seen import SURFACES
from wingwatch.monitor.estimation.chain import Solution
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = ["HELD_S", "LEAST_RAD", "LONGEST_S", "REST_S", "FlownManoeuvre", "ManoeuvreWatch"]

Array = NDArray[np.float64]

LEAST_RAD = math.radians(0.5)
"""The least deflection that is proposed to anybody, too."""
REST_S = 1.0
"""A solution comes within half a second, so what is over is known to be within one and a half."""
HELD_S = 10.0
"""The longest step of a 3-2-1-1, 4.8 / omega_n, of modes down to 0.5 rad/s."""
LONGEST_S = 60.0
"""Movement that never ends, as of an autopilot in rough air, is judged by the minute."""
_NOISE_SPAN = 6.0
"""Standard deviations that half a second of white noise spans at most, of some dozens of samples."""
_USUAL = 2.0
"""Times the usual span."""
_FOLLOWED = 0.05
"""Weight of each half second in the usual span: a memory of ten seconds."""
_LONGEST_GAP_S = 2.0
_MOST_ROWS = 4000
"""Samples that wait for a solution; where none comes they are of no use."""
_MOST_KEPT_ROWS = 12_000
"""Of one manoeuvre: a minute at 200 Hz."""

_RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")


@dataclass(frozen=True, slots=True)
class FlownManoeuvre:
    """A manoeuvre that is over.

    Attributes:
        surfaces: columns of those that moved.
        begin_s, end_s: of the movement, by the samples' clock; known_s: when it was known to be over.
        time_s: stamps from just before it until it was known to be over, (n,).
        deflections_rad: of ``surfaces`` from where they stood before, zero where that is no movement, (n, surfaces).
        rates_rad_s: roll, pitch and yaw, (n, 3); NaN where a sensor is missing.
        before, after: solutions; None where there was none before.
        rough: names of structures whose air was rough meanwhile.
    """

    surfaces: tuple[str, ...]
    begin_s: float
    end_s: float
    known_s: float
    time_s: Array
    deflections_rad: Array
    rates_rad_s: Array
    before: Solution | None
    after: Solution
    rough: frozenset[str]


@dataclass(slots=True)
class _Going:
    """A manoeuvre that is being flown.

    Attributes:
        moved_s: when any surface moved last; out_s: when any that had moved was last out of its trim.
        spans: of all surfaces in each half second, rad.
        rough: names of structures whose air was rough.
    """

    before: Solution | None
    pieces: list[Array]
    begun_s: float
    moved_s: float
    out_s: float
    spans: list[Array]
    rough: set[str]
    rows: int

    def note_air(self, solution: Solution) -> None:
        """Which structures' air is rough now."""
        for name, mode in solution.modes.items():
            if mode.rough:
                self.rough.add(name)


_USUAL_SPAN, _TRIM, _KNOWN, _LIMIT, _MOVED, _SPAN = range(6)
"""Rows of what is known of each surface: its usual span, rad; where it stands; whether both are known; and of the
manoeuvre that is being flown, the span from which on it moves, and whether it has moved; its latest span."""


@compiled()
def look_at(rows, time_s, least, going, known):  # type: ignore[no-untyped-def]
    """What surfaces did up to a solution; where no manoeuvre is being flown, usual span and trim are followed.

    Args:
        rows: stamps and surfaces, (n, 1 + surfaces or more).
        time_s: of the solution.
        least: span from which on a surface may move, rad, (surfaces,).
        going: whether a manoeuvre is being flown.
        known: of each surface, (6, surfaces); changed in place.

    Returns:
        row of the solution, whether any surface moves, and whether any that has moved is out of its trim.
    """
    end = len(rows) - 1
    while end > 0 and rows[end, 0] != time_s:
        end -= 1
    if rows[end, 0] != time_s:
        end = len(rows) - 1
    moving = away = False
    means = np.empty(least.size)
    for s in range(least.size):
        low, high, total = math.inf, -math.inf, 0.0
        for k in range(end + 1):
            value = rows[k, 1 + s]
            low, high, total = min(low, value), max(high, value), total + value
        means[s] = total / (end + 1)
        known[_SPAN, s] = high - low if math.isfinite(total) else math.nan
        if not going:
            known[_LIMIT, s] = max(least[s], _USUAL * known[_USUAL_SPAN, s])
            known[_MOVED, s] = 0.0
        if known[_KNOWN, s] > 0.0 and known[_SPAN, s] > known[_LIMIT, s]:
            moving, known[_MOVED, s] = True, 1.0
        if known[_MOVED, s] > 0.0 and abs(means[s] - known[_TRIM, s]) > 0.5 * known[_LIMIT, s]:
            away = True
    for s in range(least.size):
        if going or not math.isfinite(known[_SPAN, s]):
            continue
        if known[_KNOWN, s] == 0.0 and moving:
            known[_TRIM, s], known[_KNOWN, s] = rows[0, 1 + s], 1.0
        elif not moving:
            known[_USUAL_SPAN, s] += _FOLLOWED * (known[_SPAN, s] - known[_USUAL_SPAN, s])
            known[_TRIM, s], known[_KNOWN, s] = means[s], 1.0
    return end, moving, away


class ManoeuvreWatch:
    """Finds the manoeuvres of one vehicle.

    Args:
        aircraft: its noise.
        present: channels that its samples carry.
    """

    def __init__(self, aircraft: Aircraft, present: Sequence[str]) -> None:
        self._surfaces = tuple(name for name in SURFACES if name in present)
        self._columns = np.array([CHANNEL_INDEX[name] for name in ("time_s", *self._surfaces, *_RATES)])
        noise = np.array([aircraft.noise_std(name) or 0.0 for name in self._surfaces])
        self._least = np.maximum(LEAST_RAD, _NOISE_SPAN * noise)
        self._start_anew()

    def _start_anew(self) -> None:
        self._waiting: list[Array] = []
        self._rows = 0
        self._known = np.zeros((6, len(self._surfaces)))
        self._earlier: Array | None = None
        self._last_s = float("nan")
        self._going: _Going | None = None

    def add(self, block: SampleBlock) -> None:
        """Samples that the next solutions rest on."""
        if not len(block) or not self._surfaces:
            return
        if self._rows > _MOST_ROWS:
            self._start_anew()
        self._waiting.append(block.values.take(self._columns, axis=1))
        self._rows += len(block)

    def look(self, before: Solution | None, solution: Solution) -> FlownManoeuvre | None:
        """At a solution: the manoeuvre that is known to be over by now, if one is.

        Args:
            before: the solution before it.
        """
        if not self._waiting:
            return None
        rows = self._waiting[0] if len(self._waiting) == 1 else np.concatenate(self._waiting)
        going, now_s = self._going, solution.time_s
        end, moving, away = look_at(rows, now_s, self._least, going is not None, self._known)
        self._waiting, self._rows = [rows[end:]], len(rows) - end
        step_s, self._last_s = now_s - self._last_s, now_s
        if step_s <= 0.0 or step_s > _LONGEST_GAP_S:
            left = self._waiting, self._rows
            self._start_anew()
            self._waiting, self._rows = left
            self._last_s = now_s
            return None
        piece = rows[: end + 1]
        if going is not None:
            going.moved_s = now_s if moving else going.moved_s
            going.out_s = now_s if moving or away else going.out_s
            return self._go_on(going, solution, piece)
        if moving:
            pieces = [piece] if self._earlier is None else [self._earlier[:-1], piece]
            spans = [self._known[_SPAN].copy()]
            self._going = _Going(before, pieces, float(piece[0, 0]), now_s, now_s, spans, set(), len(piece))
            self._going.note_air(solution)
        else:
            self._earlier = piece
        return None

    def end(self, solution: Solution) -> FlownManoeuvre | None:
        """The samples end with this solution, and the manoeuvre that is being flown with them."""
        going, self._going = self._going, None
        return None if going is None else self._flown(going, solution)

    def _go_on(self, going: _Going, solution: Solution, piece: Array) -> FlownManoeuvre | None:
        now_s = solution.time_s
        going.pieces.append(piece[1:])
        going.rows += len(piece) - 1
        going.spans.append(self._known[_SPAN].copy())
        going.note_air(solution)
        too_long = now_s - going.begun_s >= LONGEST_S or going.rows > _MOST_KEPT_ROWS
        if now_s - going.out_s < REST_S and now_s - going.moved_s < HELD_S and not too_long:
            return None
        flown = self._flown(going, solution)
        if too_long:  # what goes on and on is usual
            self._known[_USUAL_SPAN] = np.nan_to_num(np.median(going.spans, axis=0))
        count = len(self._surfaces)
        self._known[_TRIM] = piece[:, 1 : 1 + count].mean(axis=0)
        self._earlier, self._going = piece, None
        return flown

    def _flown(self, going: _Going, solution: Solution) -> FlownManoeuvre | None:
        rows = np.concatenate(going.pieces)
        count = len(self._surfaces)
        which = np.flatnonzero(self._known[_MOVED])
        away = rows[:, 1 + which] - self._known[_TRIM, which]
        whole = np.isfinite(away).all(axis=1)
        rows, away = rows[whole], away[whole]
        away[np.abs(away) <= 0.5 * self._known[_LIMIT, which]] = 0.0
        out = np.flatnonzero(away.any(axis=1))
        if not out.size:
            return None
        end = min(int(out[-1]) + 1, len(rows) - 1)
        return FlownManoeuvre(
            tuple(self._surfaces[k] for k in which), float(rows[out[0], 0]), float(rows[end, 0]), solution.time_s,
            rows[:, 0].copy(), away, rows[:, 1 + count :].copy(), going.before, solution, frozenset(going.rough),
        )  # fmt: skip
