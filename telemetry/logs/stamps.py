"""Stamps of a topic put right: repeats and single readings off the clock dropped, runs cut where the clock jumps back.

Nothing is sorted: where the clock goes back, what comes after is another run.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["ClockRuns", "clock_runs"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

_SAME_S = 1e-6
_OFF_S = 1.0  # a step this long, or five usual ones, may belong to a reading off the clock
_USUAL_STEPS = 5.0
_FEW = 3  # readings that stand alone between two jumps are off the clock
_SLIGHTLY_BACK_S = 1.0
_OTHER_CLOCK_S = 3600.0


@dataclass(frozen=True, slots=True)
class ClockRuns:
    """What became of a topic's stamps.

    Attributes:
        runs: rows of each run, in the order of the file; stamps rise within each.
        repeated: rows dropped because they carry the stamp of the row before.
        late: rows dropped because they are up to a second older than the row before.
        off_clock: rows dropped because their stamps are far from both neighbours'.
        jumps: places where the clock jumped, one fewer than there are runs.
    """

    runs: tuple[Rows, ...]
    repeated: int
    late: int
    off_clock: int

    @property
    def jumps(self) -> int:
        """How often the clock jumped and stayed."""
        return max(len(self.runs) - 1, 0)


def clock_runs(time_s: Array) -> ClockRuns:
    """Runs of rising stamps.

    Args:
        time_s: in the order of the file, s, shape (rows,).

    Returns:
        The runs; rows whose stamp is not finite are in none and count as off the clock.
    """
    rows = np.flatnonzero(np.isfinite(time_s))
    off = int(time_s.size - rows.size)
    steps = np.diff(time_s[rows])
    again = np.concatenate(([False], np.abs(steps) <= _SAME_S)) if rows.size else np.zeros(0, dtype=np.bool_)
    rows, repeated = rows[~again], int(again.sum())
    if rows.size == 0:
        return ClockRuns((), repeated, 0, off)
    pieces, dropped = _without_few(time_s, _pieces(time_s, rows))
    runs, late = _joined(time_s, pieces)
    whole = [run for run in runs if run.size > _FEW] or runs
    dropped += sum(run.size for run in runs) - sum(run.size for run in whole)
    return ClockRuns(tuple(whole), repeated, late, off + dropped)


def _pieces(time_s: Array, rows: Rows) -> list[Rows]:
    """Rows cut at every step back and every long step."""
    steps = np.diff(time_s[rows])
    forward = steps[steps > 0.0]
    long_s = max(_OFF_S, _USUAL_STEPS * float(np.median(forward))) if forward.size else _OFF_S
    return list(np.split(rows, np.flatnonzero((steps <= 0.0) | (steps > long_s)) + 1))


def _without_few(time_s: Array, pieces: list[Rows]) -> tuple[list[Rows], int]:
    """Pieces without those of a few readings that do not lie between their neighbours; and how many that leaves out."""
    long = [i for i, piece in enumerate(pieces) if piece.size > _FEW]
    if not long:
        return pieces, 0
    kept = []
    for i, piece in enumerate(pieces):
        before = max((j for j in long if j < i), default=None)
        after = min((j for j in long if j > i), default=None)
        if piece.size > _FEW or (
            (before is None or time_s[pieces[before][-1]] < time_s[piece[0]])
            and (after is None or time_s[piece[-1]] < time_s[pieces[after][0]])
        ):
            kept.append(piece)
    return kept, sum(p.size for p in pieces) - sum(p.size for p in kept)


def _joined(time_s: Array, pieces: Sequence[Rows]) -> tuple[list[Rows], int]:
    """Pieces put together again where the later one goes on, on the clock of the one before."""
    runs: list[list[Rows]] = []
    late = 0
    for piece in pieces:
        step = time_s[piece[0]] - time_s[runs[-1][-1][-1]] if runs else np.inf
        if runs and -_SLIGHTLY_BACK_S < step <= 0.0:
            newer = piece[time_s[piece] > time_s[runs[-1][-1][-1]] + _SAME_S]
            late += piece.size - newer.size
            if newer.size:
                runs[-1].append(newer)
        elif 0.0 < step < _OTHER_CLOCK_S:
            runs[-1].append(piece)
        else:
            runs.append([piece])
    return [np.concatenate(run) for run in runs], late
