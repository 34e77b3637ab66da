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
from wingwatch.diagnosis.change.hypothesis import Reference, limits
from wingwatch.diagnosis.evaluation import Reduced, block_cuts, evaluate, reduce
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError

__all__ = ["Promise", "Screened", "screen", "screen_again"]

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
    """The likeliest onset of how many, and by it what each cause promises, most first, and what none does."""

    onset_s: float
    onsets: int
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
        raise RunsAwayError("the simulation diverges from the flight")
    starts_s = _block_starts(problem)
    tried = [s for s in starts_s if onsets_s[0] <= s <= onsets_s[1]] or [float(starts_s[0])]
    found = [_from(s, starts_s, reduced, reference, causes) for s in tried]
    best = max(found, key=lambda one: max((p.log_evidence for p in one.promises), default=-np.inf))
    return replace(best, onsets=len(tried))


def screen_again(
    problem: Problem, point: Point, reference: Reference, causes: Sequence[Candidate]
) -> tuple[Promise, ...]:
    """What each cause promises about a model without a cause, by the noise that was fitted to it, most first.

    By the noise of still air a large change is far beyond what one step can say; noise that takes part of the misfit
    makes steps short.

    Args:
        problem: windows since the onset.
        point: the model, its errors being all that it has.
        reference: what the time before says.
        causes: that compete.
    """
    reduced = reduce(problem, point, evaluate(problem, point, causes))
    f = reference.inflation
    sums = _Sums(point.theta, reduced.score / f, reduced.information / f)
    return _promises(sums, reference, causes)


def _block_starts(problem: Problem) -> Array:
    """Time stamps of the first samples of all blocks."""
    flight = problem.subject.flight
    starts = [
        flight.time_s[window.start + block_cuts(window.stop - window.start, flight.dt_s)[:-1]]
        for window in problem.windows
    ]
    return np.concatenate(starts)


@dataclass(frozen=True, slots=True)
class _Sums:
    """Score and information of errors, then of all causes, about values of the errors."""

    at: Array
    score: Array
    information: Array


def _from(
    onset_s: float, starts_s: Array, reduced: Reduced, reference: Reference, causes: Sequence[Candidate]
) -> Screened:
    """Everything by one onset."""
    mean, f = reference.belief.mean, reference.inflation
    early, n = starts_s < onset_s - 1e-6, len(reference.belief.mean)

    def sums(blocks: NDArray[np.bool_]) -> _Sums:
        return _Sums(
            mean,
            reduced.block_scores[blocks].sum(axis=0) / f,
            reduced.block_information[blocks].sum(axis=0) / f,
        )

    first, last = sums(early), sums(~early)
    before = met(Quadratic(mean, 0.0, first.score[:n], first.information[:n, :n]), reference.belief)
    then = replace(reference, belief=before.belief)
    promises = [
        replace(p, log_evidence=p.log_evidence + before.log_evidence) for p in _promises(last, then, causes)
    ]
    nothing = before.log_evidence + _beside(last, then, None, np.arange(n)).log_evidence
    return Screened(onset_s, 1, tuple(promises), nothing)


def _promises(sums: _Sums, reference: Reference, causes: Sequence[Candidate]) -> tuple[Promise, ...]:
    n = len(reference.belief.mean)
    promises, first, own = [], n, np.arange(n)
    for cause in causes:
        last = first + len(cause.parameters)
        meeting = _beside(sums, reference, cause, np.concatenate([own, np.arange(first, last)]))
        promises.append(Promise(cause, meeting.mode[n:], meeting.log_evidence))
        first = last
    return tuple(sorted(promises, key=lambda p: -p.log_evidence))


def _beside(sums: _Sums, reference: Reference, cause: Candidate | None, rows: NDArray[np.int64]) -> Meeting:
    """Errors and a cause, or none, at the best tau; rows: theirs in the sums."""
    own = () if cause is None else (cause,)
    spread = np.array([p.spread for c in own for p in c.parameters])
    at = np.concatenate([sums.at, np.zeros(len(spread))])
    likelihood = Quadratic(at, 0.0, sums.score[rows], sums.information[np.ix_(rows, rows)])
    priors = [one.beside(spread) for one in reference.since()]
    return max((met(likelihood, p, *limits(own)) for p in priors), key=lambda m: m.log_evidence)
