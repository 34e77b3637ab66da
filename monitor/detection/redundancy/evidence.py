"""What segments of a second say of a change of a relation's parameters, by every possible onset.

A segment brings J and h of (E, f) (``samples.py``). With T = (I, -X)' for X at the onset, the columns of what has been
there all the time are E, and those of a change since the onset (E, f) T. The constant part theta is learned: with the
sums before and since,

    L = P0^-1 + sum of J_EE,   g = sum of h_E
    K = T'J T - (T'J)_E L^-1 (J T)_E,      y = T'h - (T'J)_E L^-1 g                                             (3)
    Q = sum of e^2 - (g'L^-1 g - g_0'L_0^-1 g_0)                                                                (4)

with L_0, g_0 those before the onset. All are in units of the relation's own variance, as the flight has shown it.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.monitor.detection.redundancy.layout import (
    COLUMNS,
    FLOW,
    GUSTY,
    PARAMETERS_OF_ROW,
    PRIOR_INFORMATION,
    RELATIONS,
    ROWS,
)
from wingwatch.monitor.detection.redundancy.likelihood import changes, constant_part, scores
from wingwatch.monitor.detection.redundancy.samples import SAMPLES
from wingwatch.monitor.detection.redundancy.segments import EXCESS, KNOWN_PAIRS, Segments

__all__ = ["Changes", "Reference", "changes_since", "scored"]

Array = NDArray[np.float64]

_N, _ROWS = len(RELATIONS), len(ROWS)
_AS_IT_IS = [*range(_N), *GUSTY]
"""Row of each row's relation in the air as it is."""
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


@dataclass(slots=True)
class Reference:
    """What is known of each row from before the segments that are remembered; fades.

    Attributes:
        information, vector: of the constant part, in units of e's own variance, (rows, KNOWN_PAIRS) and (rows,
            COLUMNS).
        samples, excess: of the variance.
        scatter: mean square of segments' scores over what (3) states.
        air_s, air: seconds of it, and the sum of log drift times seconds of the relations that tell how rough the air
            is.
    """

    information: Array = field(default_factory=lambda: np.zeros((_ROWS, KNOWN_PAIRS)))
    vector: Array = field(default_factory=lambda: np.zeros((_ROWS, COLUMNS)))
    samples: Array = field(default_factory=lambda: np.zeros(_ROWS))
    excess: Array = field(default_factory=lambda: np.zeros(_ROWS))
    scatter: Array = field(default_factory=lambda: np.ones(_ROWS))
    air_s: float = 0.0
    air: Array = field(default_factory=lambda: np.zeros(len(FLOW)))

    def parameters(self, variance: Array) -> Array:
        """The constant part as it is known, (rows, COLUMNS); ``variance`` of e2/S, a ratio."""
        scale = 1.0 / (variance * self.scatter)
        found = constant_part(PRIOR_INFORMATION, PARAMETERS_OF_ROW, self.information, self.vector, scale)
        return np.asarray(found)

    def forget(self, row: int) -> None:
        """Nothing is known of a row but its variance and scatter."""
        self.information[row], self.vector[row] = 0.0, 0.0

    def changed_air(self, drift: Array) -> float:
        """0 to 1, a fraction: how much the air of these drifts, shape (relations,), differs from the known one."""
        if self.air_s == 0.0:
            return 0.0
        apart = float(np.max(np.abs(np.log(drift) - self.air / self.air_s))) ** 2
        return apart / (apart + OTHER_AIR**2)

    def absorb(self, segments: Segments, which: NDArray[np.bool_], drift: Array) -> None:
        """Take over the oldest segment, some seconds, of the rows ``which``, shape (rows,), in air of these drifts, and
        forget a little of what was before."""
        seconds = float(segments.seconds[0])
        fading, forgetting = np.exp(-seconds / FADING_S), np.exp(-seconds / VARIANCE_S)
        self.air_s = fading * self.air_s + seconds
        self.air = fading * self.air + seconds * np.log(drift)
        for known, kept, news in (
            (self.information, fading, segments.information[0, :, :KNOWN_PAIRS]),
            (self.vector, fading, segments.vector[0, :, :COLUMNS]),
            (self.samples, forgetting, segments.scalar[0, :, SAMPLES]),
            (self.excess, forgetting, segments.scalar[0, :, EXCESS]),
        ):
            known[which] = kept * known[which] + news[which]
        segments.drop(0)


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


def changes_since(
    reference: Reference,
    segments: Segments,
    first: int = 0,
    last: int | None = None,
    count: int | None = None,
) -> Changes:
    """What the segments since each onset say of a change.

    Args:
        reference: what is known from before all of them.
        first, last: index of the first changed segment, at the earliest and at the latest; all where nothing is said.
        count: how many segments count; those that are remembered where nothing is said.
    """
    count = segments.count if count is None else count
    last = count - 1 if last is None else last
    m = last - first + 1
    known = (
        PRIOR_INFORMATION, PARAMETERS_OF_ROW, reference.information, reference.vector, reference.samples,
        reference.excess, reference.scatter,
    )  # fmt: skip
    arrays = (segments.information, segments.vector, segments.start, segments.scalar)
    information, vector = np.zeros((m, _ROWS, COLUMNS, COLUMNS)), np.zeros((m, _ROWS, COLUMNS))
    square, samples, variance, log_s = np.zeros((4, m, _ROWS))
    out = (information, vector, square, samples, variance, log_s)
    changes(known, arrays, (first, last, count), (LEAST_VARIANCE, VARIANCE_SAMPLES), out)
    latest = np.log(variance[-1])
    calm = 0.5 * (square * (variance / variance[-1]) + samples * latest + log_s)
    base = calm[:, _AS_IT_IS] - 0.5 * (samples * np.log(variance) + log_s)
    return Changes(information, vector, square, samples, variance, base)


def scored(reference: Reference, segments: Segments, floors: Array) -> tuple[Array, Array]:
    """Of the segment that was closed last its score's mean square over what is stated, and the variance before it, by
    row; its excess by what was known before is noted.

    The score is NaN without information. ``floors``: standard deviations of what may come and go, (rows, columns).
    """
    latest = segments.count
    found = changes_since(reference, segments, latest, latest, latest + 1)
    segments.scalar[latest, :, EXCESS] = found.square[0] * found.variance[0] * reference.scatter
    score = scores(found.information[0], found.vector[0], PARAMETERS_OF_ROW, floors)
    return score, found.variance[0]
