"""When a change began and what may explain it, by one step along every cause for every onset.

All windows from some time before the asked onset are flown once by the model that the time before taught. In sums by
blocks of two seconds each onset is a choice of the blocks in which causes count. docs/methods/diagnosis.md, section 10.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.change.gaussian import Meeting, Quadratic, met
from wingwatch.diagnosis.change.hypothesis import LEVELS, Reference, limits
from wingwatch.diagnosis.evaluation import Reduced, block_cuts, evaluate, reduce
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError

__all__ = ["Promise", "Screened", "screen"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Promise:
    """What one step along a cause promises.

    Attributes:
        cause: which.
        values: of its parameters after the step.
        log_evidence: equation (10).
    """

    cause: Candidate
    values: Array
    log_evidence: float


@dataclass(frozen=True, slots=True)
class Screened:
    """The likeliest onset, and by it what each cause promises, most first, and what none does."""

    onset_s: float
    promises: tuple[Promise, ...]
    nothing: float


def screen(
    problem: Problem,
    point: Point,
    reference: Reference,
    causes: Sequence[Candidate],
    onsets_s: tuple[float, float],
) -> Screened:
    """Screen causes and onsets.

    Args:
        problem: windows from before the first onset to the end.
        point: their trims, and the noise of the time before.
        reference: what the time before says.
        causes: that compete.
        onsets_s: the first and the last onset that is tried.

    Raises:
        RunsAwayError: the simulation leaves the flight.
    """
    at = replace(
        point, causes=reference.errors, values=tuple(np.atleast_1d(v) for v in reference.belief.mean)
    )
    reduced = reduce(problem, at, evaluate(problem, at, causes))
    if not np.isfinite(reduced.cost):
        raise RunsAwayError("the simulation runs away from the flight")
    starts_s = _block_starts(problem)
    tried = [s for s in starts_s if onsets_s[0] <= s <= onsets_s[1]] or [float(starts_s[0])]
    found = [_from(s, starts_s, reduced, reference, causes) for s in tried]
    return max(found, key=lambda one: max((p.log_evidence for p in one.promises), default=-np.inf))


def _block_starts(problem: Problem) -> Array:
    """Time stamps of the first samples of all blocks."""
    flight = problem.subject.flight
    starts = [
        flight.time_s[window.start + block_cuts(window.stop - window.start, flight.dt_s)[:-1]]
        for window in problem.windows
    ]
    return np.concatenate(starts)


def _from(
    onset_s: float, starts_s: Array, reduced: Reduced, reference: Reference, causes: Sequence[Candidate]
) -> Screened:
    """Everything by one onset."""
    n, f = len(reference.belief.mean), reference.inflation
    early = starts_s < onset_s - 1e-6

    def sums(blocks: NDArray[np.bool_]) -> tuple[Array, Array]:
        return reduced.block_scores[blocks].sum(axis=0) / f, reduced.block_information[blocks].sum(axis=0) / f

    (g0, h0), (g, h) = sums(early), sums(~early)
    before = met(Quadratic(reference.belief.mean, 0.0, g0[:n], h0[:n, :n]), reference.belief)
    belief = before.belief
    none = np.zeros(0)
    wide = [belief.widened((tau * reference.least) ** 2) for tau in LEVELS]

    def at_best(rows: NDArray[np.int64], cause: Candidate | None) -> Meeting:
        own = () if cause is None else (cause,)
        spread = np.array([p.spread for c in own for p in c.parameters]) if own else none
        at = np.concatenate([reference.belief.mean, np.zeros(len(spread))])
        likelihood = Quadratic(at, 0.0, g[rows], h[np.ix_(rows, rows)])
        return max(
            (met(likelihood, w.beside(spread), *limits(own)) for w in wide), key=lambda m: m.log_evidence
        )

    promises, first, own = [], n, np.arange(n)
    for cause in causes:
        last = first + len(cause.parameters)
        meeting = at_best(np.concatenate([own, np.arange(first, last)]), cause)
        promises.append(Promise(cause, meeting.mode[n:], before.log_evidence + meeting.log_evidence))
        first = last
    promises.sort(key=lambda p: -p.log_evidence)
    return Screened(onset_s, tuple(promises), before.log_evidence + at_best(own, None).log_evidence)
