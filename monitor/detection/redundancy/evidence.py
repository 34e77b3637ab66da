"""What segments of a second say of a change of a relation's parameters, by every possible onset.

A segment brings J and h of (E, f) (``samples.py``). With T = (I, -X)' for X at the onset, the columns of what has been
there all the time are E, and those of a change since the onset (E, f) T. The constant part theta is learned: with the
sums before and since,

    L = P0^-1 + sum of J_EE,   g = sum of h_E
    K = T'J T - (T'J)_E L^-1 (J T)_E,      y = T'h - (T'J)_E L^-1 g                                             (3)
    Q = sum of e^2 - (g'L^-1 g - g_0'L_0^-1 g_0)                                                                (4)

with L_0, g_0 those before the onset. All are in units of the relation's own variance, as the flight has shown it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.monitor.detection.redundancy.layout import (
    COLUMNS,
    FLOW,
    GUSTY,
    PRIOR_INFORMATION,
    RELATIONS,
    ROWS,
)
from wingwatch.monitor.detection.redundancy.likelihood import changes, scores
from wingwatch.monitor.detection.redundancy.samples import Segment

__all__ = ["Changes", "Closed", "Reference", "changes_since", "closed", "merged", "scored"]

Array = NDArray[np.float64]

_N, _ROWS = len(RELATIONS), len(ROWS)
FADING_S = 120.0
"""The constant part of parameters is known from about so long."""
VARIANCE_S = 60.0
"""So long is the memory of a relation's variance."""
VARIANCE_SAMPLES = 10.0
"""What is assumed of a relation's variance counts as so many samples of it, and so does what a change of the air leaves
of what was known."""
OTHER_AIR = float(np.log(4.0))
"""Of log drift, from which half of what is known of coefficients no longer holds: gusts act otherwise than the
aircraft's own motion does, on the span and on the tail, and what a coefficient seems to be is in part theirs."""
LEAST_VARIANCE = 0.5
"""A relation's variance is at least so much of the stated one: no model of readings and their sampling is better."""


@dataclass(frozen=True, slots=True)
class Closed:
    """One segment that is over, or several that follow one another.

    Attributes:
        start_s: stamp at which it starts; seconds: how long it is.
        information, vector, start: as in ``Segment``.
        samples, square, products, decay, log_s: (rows,): samples; sum of e2/S; of products of e/S^(1/2) with the one
            before; f at the end; sum of ln S.
        excess: (rows,), Q of (4) by what was known before it.
    """

    start_s: float
    seconds: float
    information: Array
    vector: Array
    start: Array
    samples: Array
    square: Array
    products: Array
    decay: Array
    log_s: Array
    excess: Array

    def forget(self, row: int) -> None:
        """It says nothing of a row any more."""
        for part in (
            self.information,
            self.vector,
            self.start,
            self.samples,
            self.square,
            self.products,
            self.log_s,
            self.excess,
        ):
            part[row] = 0.0
        self.decay[row] = 0.0


@dataclass(slots=True)
class Reference:
    """What is known of each row from before the segments that are remembered; fades.

    Attributes:
        information, vector: of the constant part, in units of e's own variance.
        samples, excess: of the variance.
        scatter: mean square of segments' scores over what (3) states.
        air_s, air: seconds of it, and the sum of log drift times seconds of the relations that tell how rough the air
            is.
    """

    information: Array = field(default_factory=lambda: np.zeros((_ROWS, COLUMNS, COLUMNS)))
    vector: Array = field(default_factory=lambda: np.zeros((_ROWS, COLUMNS)))
    samples: Array = field(default_factory=lambda: np.zeros(_ROWS))
    excess: Array = field(default_factory=lambda: np.zeros(_ROWS))
    scatter: Array = field(default_factory=lambda: np.ones(_ROWS))
    air_s: float = 0.0
    air: Array = field(default_factory=lambda: np.zeros(len(FLOW)))

    def parameters(self, variance: Array) -> Array:
        """The constant part as it is known, (rows, COLUMNS); ``variance`` of e2/S, a ratio."""
        scale = 1.0 / (variance * self.scatter)
        known = PRIOR_INFORMATION[..., None] * np.eye(COLUMNS) + self.information * scale[:, None, None]
        return np.asarray(np.linalg.solve(known, (self.vector * scale[:, None])[..., None])[..., 0])

    def forget(self, row: int) -> None:
        """Nothing is known of a row but its variance and scatter."""
        self.information[row], self.vector[row] = 0.0, 0.0

    def changed_air(self, drift: Array) -> float:
        """0 to 1, a fraction: how much the air of these drifts, shape (relations,), differs from the known one."""
        if self.air_s == 0.0:
            return 0.0
        apart = float(np.max(np.abs(np.log(drift) - self.air / self.air_s))) ** 2
        return apart / (apart + OTHER_AIR**2)

    def absorb(self, segment: Closed, which: NDArray[np.bool_], drift: Array) -> None:
        """Add a segment of the rows ``which``, shape (rows,), in air of these drifts, and forget a little of what was
        before. A segment states its length in seconds."""
        fading = np.exp(-segment.seconds / FADING_S)
        self.air_s = fading * self.air_s + segment.seconds
        self.air = fading * self.air + segment.seconds * np.log(drift)
        forgetting = np.exp(-segment.seconds / VARIANCE_S)
        w, v = which[:, None, None], which[:, None]
        self.information = np.where(
            w, fading * self.information + segment.information[:, :COLUMNS, :COLUMNS], self.information
        )
        self.vector = np.where(v, fading * self.vector + segment.vector[:, :COLUMNS], self.vector)
        self.samples = np.where(which, forgetting * self.samples + segment.samples, self.samples)
        self.excess = np.where(which, forgetting * self.excess + segment.excess, self.excess)


class Changes(NamedTuple):
    """(3) and (4) by onset, (m, rows, ...), in units of each row's variance times its scatter.

    ``information``, ``vector``: K and y; ``square``: Q; ``samples``: as many as count; ``variance``: of e2/S before the
    onset; ``at_rest``: log-density of what has Q = 0 in the units of the onset, over that of nothing changed in the air
    as it was last: one base for a relation, whatever the onset and the row.
    """

    information: Array
    vector: Array
    square: Array
    samples: Array
    variance: Array
    at_rest: Array


def closed(segment: Segment, start_s: float, seconds: float) -> Closed:
    """A segment from ``start_s`` on for ``seconds``, as remembered; both triangles of its information are filled."""
    lower = segment.information
    full = lower + np.swapaxes(np.tril(lower, -1), -1, -2)
    samples, square, products, decay, log_s = (segment.scalar[:, k].copy() for k in range(5))
    vector, start = segment.vector.copy(), segment.start.copy()
    return Closed(
        start_s, seconds, full, vector, start, samples, square, products, decay, log_s, square.copy()
    )


def merged(first: Closed, second: Closed) -> Closed:
    """Two segments that follow one another as one."""
    carry = np.ones((_ROWS, COLUMNS + 1))
    carry[:, COLUMNS] = first.decay
    return Closed(
        first.start_s,
        first.seconds + second.seconds,
        first.information + carry[:, :, None] * second.information * carry[:, None, :],
        first.vector + carry * second.vector,
        first.start,
        first.samples + second.samples,
        first.square + second.square,
        first.products + second.products,
        first.decay * second.decay,
        first.log_s + second.log_s,
        first.excess + second.excess,
    )


def changes_since(
    reference: Reference, segments: Sequence[Closed], first: int = 0, last: int | None = None
) -> Changes:
    """What the segments since each onset say of a change.

    Args:
        reference: what is known from before all of them.
        segments: in order.
        first, last: index of the first changed segment, at the earliest and at the latest; all where nothing is said.
    """
    last = len(segments) - 1 if last is None else last
    m = last - first + 1
    known = (reference.information, reference.vector, reference.samples, reference.excess, reference.scatter)
    stacked = tuple(
        np.stack([getattr(s, name) for s in segments])
        for name in ("information", "vector", "start", "samples", "square", "excess", "decay", "log_s")
    )
    information, vector = np.empty((m, _ROWS, COLUMNS, COLUMNS)), np.empty((m, _ROWS, COLUMNS))
    square, samples, variance, log_s = (np.empty((m, _ROWS)) for _ in range(4))
    out = (information, vector, square, samples, variance, log_s)
    changes(PRIOR_INFORMATION, known, stacked, first, last, LEAST_VARIANCE, VARIANCE_SAMPLES, out)
    latest = np.log(variance[-1])
    calm = 0.5 * (square * (variance / variance[-1]) + samples * latest + log_s)
    base = np.concatenate([calm[:, :_N], calm[:, list(GUSTY)]], axis=1)
    base -= 0.5 * (samples * np.log(variance) + log_s)
    return Changes(information, vector, square, samples, variance, base)


def scored(
    reference: Reference, earlier: Sequence[Closed], segment: Closed, floors: Array
) -> tuple[Closed, Array, Array]:
    """The segment with its excess by what was known before, its score's mean square over what is stated, and the
    variance before it, all by row.

    The score is NaN without information. ``floors``: standard deviations of what may come and go, (rows, columns).
    """
    latest = len(earlier)
    found = changes_since(reference, [*earlier, segment], latest, latest)
    unit = found.variance[0] * reference.scatter
    score = scores(found.information[0], found.vector[0], floors)
    return replace(segment, excess=found.square[0] * unit), score, found.variance[0]
