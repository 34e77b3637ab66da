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

from wingwatch.monitor.redundancy.layout import COLUMNS, PRIORS, RELATIONS
from wingwatch.monitor.redundancy.samples import Segment

__all__ = ["Changes", "Closed", "Reference", "changes_since", "merged"]

Array = NDArray[np.float64]

_N = len(RELATIONS)
PRIOR_INFORMATION = PRIORS**-2.0
FADING_S = 120.0
"""The constant part of parameters is known from about so long."""
VARIANCE_S = 60.0
"""So long is the memory of a relation's variance."""
VARIANCE_SAMPLES = 10.0
"""What is assumed of a relation's variance counts as so many samples of it, and so does what a change of the air leaves
of what was known."""


LEAST_VARIANCE = 0.5
"""A relation's variance is at least so much of the stated one: no model of readings and their sampling is better."""


@dataclass(frozen=True, slots=True)
class Closed:
    """One segment that is over, or several that follow one another.

    Attributes:
        start_s: stamp at which it starts; seconds: how long it is.
        information, vector, start: as in ``Segment``.
        samples, square, products, decay: (relations,): samples; sum of e2/S; of products of e/S^(1/2)
            with the one before; f at the end.
        excess: (relations,), Q of (4) by what was known before it.
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
    excess: Array

    def forget(self, relation: int) -> None:
        """It says nothing of the relation any more."""
        for part in (
            self.information,
            self.vector,
            self.start,
            self.samples,
            self.square,
            self.products,
            self.excess,
        ):
            part[relation] = 0.0
        self.decay[relation] = 0.0


@dataclass(slots=True)
class Reference:
    """What is known of the relations from before the segments that are remembered; fades.

    Attributes:
        information, vector: of the constant part, in units of e's own variance.
        samples, excess: of the variance.
        scatter: mean square of segments' scores over what (3) states.
    """

    information: Array = field(default_factory=lambda: np.zeros((_N, COLUMNS, COLUMNS)))
    vector: Array = field(default_factory=lambda: np.zeros((_N, COLUMNS)))
    samples: Array = field(default_factory=lambda: np.zeros(_N))
    excess: Array = field(default_factory=lambda: np.zeros(_N))
    scatter: Array = field(default_factory=lambda: np.ones(_N))

    def forget(self, relation: int) -> None:
        """Nothing is known of the relation but its variance and scatter."""
        self.information[relation], self.vector[relation] = 0.0, 0.0

    def absorb(self, segment: Closed, which: NDArray[np.bool_]) -> None:
        """Take in a segment of the relations named, and forget a little of what was before."""
        fading = np.exp(-segment.seconds / FADING_S)
        forgetting = np.exp(-segment.seconds / VARIANCE_S)
        w, v = which[:, None, None], which[:, None]
        self.information = np.where(
            w, fading * self.information + segment.information[:, :COLUMNS, :COLUMNS], self.information
        )
        self.vector = np.where(v, fading * self.vector + segment.vector[:, :COLUMNS], self.vector)
        self.samples = np.where(which, forgetting * self.samples + segment.samples, self.samples)
        self.excess = np.where(which, forgetting * self.excess + segment.excess, self.excess)


class Changes(NamedTuple):
    """(3) and (4) by onset, (m, relations, ...), in units of each relation's variance times its scatter.

    ``information``, ``vector``: K and y; ``square``: Q; ``samples``: as many as count; ``variance``: of e2/S before the
    onset; ``at_rest``: Q/2 in units of the variance before the latest onset, less n/2 times the logarithm of the ratio
    of both: what is compared with noise as it was last has one base, whatever the onset.
    """

    information: Array
    vector: Array
    square: Array
    samples: Array
    variance: Array
    at_rest: Array


def closed(segment: Segment, start_s: float, seconds: float) -> Closed:
    """A segment as it is remembered; both triangles of its information are filled."""
    lower = segment.information
    full = lower + np.swapaxes(np.tril(lower, -1), -1, -2)
    samples, square, products, decay = (segment.scalar[:, k].copy() for k in range(4))
    vector, start = segment.vector.copy(), segment.start.copy()
    return Closed(start_s, seconds, full, vector, start, samples, square, products, decay, square.copy())


def merged(first: Closed, second: Closed) -> Closed:
    """Two segments that follow one another as one."""
    carry = np.ones((_N, COLUMNS + 1))
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
        first.excess + second.excess,
    )


def changes_since(reference: Reference, segments: Sequence[Closed], onsets: Sequence[int]) -> Changes:
    """What the segments since each onset say of a change.

    Args:
        reference: what is known from before all of them.
        segments: in order.
        onsets: index of the first changed segment, ascending; m of them.
    """
    m = len(onsets)
    since: list[Closed] = []
    total: Closed | None = None
    wanted = set(onsets)
    for index in range(len(segments) - 1, -1, -1):
        total = segments[index] if total is None else merged(segments[index], total)
        if index in wanted:
            since.append(total)
    since.reverse()
    before = _before(reference, segments, onsets)
    information = np.stack([s.information for s in since])
    vector = np.stack([s.vector for s in since])
    start = np.stack([s.start for s in since])
    change = np.zeros((m, _N, COLUMNS + 1, COLUMNS))
    change[..., :COLUMNS, :] = np.eye(COLUMNS)
    change[..., COLUMNS, :] = -start
    unit = before.variance * reference.scatter
    scale = 1.0 / unit
    known = PRIOR_INFORMATION[..., None] * np.eye(COLUMNS) + before.information * scale[..., None, None]
    known_vector = before.vector * scale[..., None]
    by_change = np.swapaxes(change, -1, -2) @ information * scale[..., None, None]
    moved = (np.swapaxes(change, -1, -2) @ vector[..., None])[..., 0] * scale[..., None]
    cross = by_change[..., :COLUMNS]
    both = known + information[..., :COLUMNS, :COLUMNS] * scale[..., None, None]
    both_vector = known_vector + vector[..., :COLUMNS] * scale[..., None]
    solved = np.linalg.solve(
        both, np.concatenate([np.swapaxes(cross, -1, -2), both_vector[..., None]], axis=-1)
    )
    weight = by_change @ change - cross @ solved[..., :COLUMNS]
    score = moved - (cross @ solved[..., COLUMNS:])[..., 0]
    earlier = np.linalg.solve(known, known_vector[..., None])[..., 0]
    explained = np.sum(both_vector * solved[..., COLUMNS], axis=-1) - np.sum(known_vector * earlier, axis=-1)
    square = np.stack([s.square for s in since]) * scale - explained
    samples = np.stack([s.samples for s in since]) / reference.scatter
    square, ratio = np.maximum(square, 0.0), before.variance / before.variance[-1]
    at_rest = 0.5 * (square * ratio - samples * np.log(ratio))
    symmetric = 0.5 * (weight + np.swapaxes(weight, -1, -2))
    return Changes(symmetric, score, square, samples, before.variance, at_rest)


class _Known(NamedTuple):
    information: Array
    vector: Array
    variance: Array


def _before(reference: Reference, segments: Sequence[Closed], onsets: Sequence[int]) -> _Known:
    """What is known before each onset: the constant part's sums and the variance."""
    information, vector = reference.information.copy(), reference.vector.copy()
    samples, excess = reference.samples.copy(), reference.excess.copy()
    out: list[tuple[Array, Array, Array]] = []
    done = 0
    for onset in onsets:
        for segment in segments[done:onset]:
            information = information + segment.information[:, :COLUMNS, :COLUMNS]
            vector = vector + segment.vector[:, :COLUMNS]
            samples, excess = samples + segment.samples, excess + segment.excess
        done = onset
        variance = np.maximum((excess + VARIANCE_SAMPLES) / (samples + VARIANCE_SAMPLES), LEAST_VARIANCE)
        out.append((information, vector, variance))
    return _Known(*(np.stack(parts) for parts in zip(*out, strict=True)))


def scored(
    reference: Reference, earlier: Sequence[Closed], segment: Closed, floors: Array
) -> tuple[Closed, Array, Array]:
    """The segment with its excess by what was known before, and its score's mean square over what is stated.

    The latter is NaN where the segment says nothing.
    """
    found = changes_since(reference, [*earlier, segment], [len(earlier)])
    unit = found.variance[0] * reference.scatter
    weight = found.information[0]
    covariance = weight + weight @ (floors[:, :, None] ** 2 * weight)  # of y, where parameters vary
    values, vectors = np.linalg.eigh(covariance)
    most = np.max(np.abs(values), axis=-1, keepdims=True)
    good = values > 1e-9 * most + 1e-300
    along = (np.swapaxes(vectors, -1, -2) @ found.vector[0][..., None])[..., 0]
    squares = np.where(good, along**2 / np.where(good, values, 1.0), 0.0)
    rank = good.sum(axis=-1)
    with np.errstate(invalid="ignore"):
        score = np.where(rank > 0, squares.sum(axis=-1) / rank, np.nan)
    return replace(segment, excess=found.square[0] * unit), score, found.variance[0]
