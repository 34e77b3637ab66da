"""Which cause explains the misfit: screening, fits, forward selection.

A candidate is screened by what one Gauss-Newton step promises, by three noises: as fitted to the present model, quiet,
and in still air (noise fitted to a wrong model explains part of the error as noise). The best are fitted by that noise,
and the best of these with noise of their own. With the gain of log-likelihood g, k parameters, n blocks
of two seconds and an inflation f of the scores' variance,

    evidence = g / f - k / 2 ln n - 1/2 sum (theta / spread)^2 + ln odds,                                      (6)

where g counts what small errors of all coefficients would explain with the cause and without it (``small_errors``),
and the best cause is taken if its evidence is beyond the threshold and it pays on windows left out.
docs/methods/diagnosis.md, section 4.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.evaluation import Evaluation, evaluate, own_count, reduce
from wingwatch.diagnosis.evidence import ALIKE, BEYOND_DOUBT, MATTERS, SIMULATION_ERROR
from wingwatch.diagnosis.fit import Solution, fit, inflation, own_fitted
from wingwatch.diagnosis.linear_model import Noise
from wingwatch.diagnosis.misfit import replayed
from wingwatch.diagnosis.noise import first_noise, fit_noise, likeliest_level
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError
from wingwatch.diagnosis.small_errors import small_errors

__all__ = ["Found", "Search", "Tried", "held_out_gain", "search", "settled"]

Array = NDArray[np.float64]

Progress = Callable[[str, float], None]

MOST_CAUSES = 4
_MOST_ROUNDS_OF_SEARCH = 8
_SHORT_LIST = 4
_MOST_ROUNDS, _GAIN_OF_A_ROUND = 3, 1.0
"""Of fits of parameters and noise in turn, and the gain of log-likelihood that another one is worth."""
_WORTH_A_FIT = 0.1
"""Part of the best one's promised gain below which a candidate is not fitted."""
_WORTH_ITS_NOISE = 0.3
"""Part of the best one's gain by the same noise below which a candidate does not get noise of its own."""
_FEW_PASSES, _MOST_ANEW = 2, 3
"""Of a candidate's noise at first; and candidates that are settled anew in a round."""
_LEAST_GAIN = 2.0
"""Of log-likelihood, of a candidate that is fitted."""
_FOLDS = 4
_SURE = 3.0
"""Standard errors that a parameter must be away from none."""
_SHOWN_S = 2.0
"""Of flight in which a cause must change an output by more than the noise of its sensor."""


@dataclass(frozen=True, slots=True)
class Tried:
    """A candidate fitted beside the causes found before it.

    Attributes:
        candidate: which.
        solution: the fit; the candidate's parameters come last.
        evidence: equation (6), over the model without it; gain, inflated: g, without small errors, and f there; cost:
            what is taken off.
        value, error: its parameters, beside small errors.
        anew: ``settled_anew`` from the fit, where that is known and no better.
    """

    candidate: Candidate
    solution: Solution
    evidence: float
    gain: float
    inflated: float
    cost: float
    value: Array
    error: Array
    anew: Solution | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """A cause that was taken.

    Attributes:
        best: it; alike: what it cannot be distinguished from; tried: all that were tried beside it.
        held_out: ``held_out_gain``.
        matters: whether it changes what is measured by a part that matters; else it is known and no cause of anything.
    """

    best: Tried
    alike: tuple[Tried, ...]
    tried: tuple[Tried, ...]
    held_out: float
    matters: bool


@dataclass(frozen=True, slots=True)
class Search:
    """What was found.

    Attributes:
        stated: the model as stated, with trims and noise fitted.
        found: causes in the order they were taken.
        last: the model with all of them.
        rest: the candidates of the last round, that were not taken.
    """

    stated: Solution
    found: tuple[Found, ...]
    last: Solution
    rest: tuple[Tried, ...]


def settled(problem: Problem, point: Point) -> Solution:
    """Causes, trims and noise fitted in turn, until neither gains."""
    solution = fit(problem, point)
    for _ in range(_MOST_ROUNDS):
        before = solution.cost
        solution = fit(problem, fit_noise(problem, solution.point))
        if not before - solution.cost > _GAIN_OF_A_ROUND:
            break
    return solution


def settled_anew(problem: Problem, point: Point) -> Solution:
    """Settled from the noise of a point and from the likeliest of a few levels, whichever ends better.

    A likelihood of noise can have several maxima.

    Raises:
        RunsAwayError: the simulation leaves the flight from both.
    """
    ends = []
    for anew in (False, True):
        with suppress(RunsAwayError):
            ends.append(settled(problem, likeliest_level(problem, point) if anew else point))
    if not ends:
        raise RunsAwayError("the simulation diverges from the flight")
    return min(ends, key=lambda solution: solution.cost)


def search(problem: Problem, point: Point, candidates: Sequence[Candidate], progress: Progress) -> Search:
    """Causes that explain the misfit, most important first."""
    progress("fitting the simulation as stated", 0.02)
    stated = present = settled(problem, likeliest_level(problem, point))
    found: list[Found] = []
    rest: tuple[Tried, ...] = ()
    for turn in range(_MOST_ROUNDS_OF_SEARCH):
        at = 0.05 + 0.8 * turn / _MOST_ROUNDS_OF_SEARCH
        progress("screening causes", at)
        taken = {c.label for c in present.point.causes}
        listed = _short_list(problem, present, [c for c in candidates if c.label not in taken])
        fits = []
        for i, begun in enumerate(listed):
            progress(f"fitting {begun.causes[-1].label}", at + 0.02 + 0.1 * i / len(listed))
            if (solution := _fitted(problem, present, begun)) is not None:
                fits.append(solution)
        tried = _at_their_best(problem, present, fits)
        rest = tuple(_judged(problem, present, _over_the_best(problem, present, tried)))
        cause = next((one for t in rest if (one := _believed(problem, rest, t)) is not None), None)
        if cause is None:
            break
        found.append(cause)
        present = cause.best.anew or settled_anew(problem, cause.best.solution.point)
        if sum(f.matters for f in found) == MOST_CAUSES:
            break
    found, last = _sure(problem, found, present)
    return Search(stated, tuple(found), last, rest)


def _sure(problem: Problem, found: list[Found], present: Solution) -> tuple[list[Found], Solution]:
    """Causes that are still beyond doubt beside all others and small errors, and the model with these."""
    while True:
        last, at, doubt = _beside_small_errors(problem, present), 0, []
        errors = np.sqrt(np.diagonal(last.covariance))
        for one, values in zip(found, last.point.values, strict=True):
            least = _least(one.best.candidate) * one.matters
            size = np.abs(values) / np.maximum(_SURE * errors[at : at + len(values)], least)
            doubt.append(float(size.max()))
            at += len(values)
        if not doubt or min(doubt) > 1.0:
            return found, last
        out = int(np.argmin(doubt))
        point = present.point
        kept = [i for i in range(len(found)) if i != out]
        found = [found[i] for i in kept]
        less = replace(
            point, causes=tuple(point.causes[i] for i in kept), values=tuple(point.values[i] for i in kept)
        )
        present = settled(problem, less)


def _believed(problem: Problem, tried: Sequence[Tried], one: Tried) -> Found | None:
    """One of those that were tried, if it is to be believed.

    What is only a little wrong is taken too, so that the rest is seen right: passed over, it would leave its misfit to
    the next best.
    """
    if not _counts(one):
        return None
    held_out = held_out_gain(problem, one.solution)
    if not held_out > 0.0:
        return None
    alike = tuple(t for t in tried if t is not one and t.evidence > one.evidence - ALIKE)
    large = bool((np.abs(one.value) > _least(one.candidate)).any())
    return Found(one, alike, tuple(tried), held_out, large and _matters(problem, one.solution))


def _beside_small_errors(problem: Problem, solution: Solution) -> Solution:
    """With the causes where they are most likely beside small errors of all coefficients, and their covariance then."""
    point = solution.point
    if not point.causes:
        return solution
    inflated = inflation(reduce(problem, point, solution.evaluation), slice(None))
    beside, at, values = small_errors(problem, solution).beside(inflated, SIMULATION_ERROR / MATTERS), 0, []
    for cause, v in zip(point.causes, point.values, strict=True):
        low, high = (np.array([getattr(p, side) for p in cause.parameters]) for side in ("low", "high"))
        values.append(np.clip(v + beside.step[at : at + len(v)], low, high))
        at += len(v)
    moved = own_fitted(problem, replace(point, values=tuple(values)))
    return replace(solution, point=moved, covariance=beside.covariance)


def _counts(tried: Tried) -> bool:
    """Whether it is beyond doubt, and of a size that such a cause can have."""
    size = np.abs(tried.value) > _SURE * tried.error
    fitted, parameters = tried.solution.point.values[-1], tried.candidate.parameters
    possible = all(p.low < v < p.high or v == 0.0 for v, p in zip(fitted, parameters, strict=True))
    return bool(tried.evidence > BEYOND_DOUBT and size.any() and possible)


def _least(candidate: Candidate) -> Array:
    return np.array([p.least for p in candidate.parameters])


def quiet(problem: Problem, noise: Noise) -> Noise:
    """Sensors as stated, gusts as fitted, next to nothing unmodelled."""
    first = first_noise(problem.subject)
    gusts = np.concatenate([noise.gusts[:4], np.minimum(noise.gusts[4:], first.gusts[4:])])
    return replace(first, gusts=gusts, gradients=noise.gradients, lag_s=noise.lag_s)


def _short_list(problem: Problem, present: Solution, candidates: Sequence[Candidate]) -> list[Point]:
    """Those that gain most with noise as fitted, quiet, and in still air, as fitted by that noise."""
    chosen: dict[str, Point] = {}
    fitted, still = present.point.noise, first_noise(problem.subject)
    for noise in (fitted, quiet(problem, fitted), still):
        before = fit(problem, replace(present.point, noise=noise), 3)
        screened = evaluate(problem, before.point, candidates, own=before.evaluation.own)
        promised = _promises(problem, before, candidates, screened)
        order = sorted(range(len(candidates)), key=lambda i: -promised[i])[:_SHORT_LIST]
        least = max(_WORTH_A_FIT * promised[order[0]], _LEAST_GAIN)
        begun = [_begun(problem, before, candidates, i, screened) for i in order if promised[i] > least]
        gains = [(before.cost - after.cost, after.point) for after in begun if after is not None]
        least = max(_WORTH_ITS_NOISE * max((gain for gain, _ in gains), default=0.0), _LEAST_GAIN)
        for gain, point in gains:
            if gain > least:
                chosen.setdefault(point.causes[-1].label, point)
    return list(chosen.values())


def _begun(
    problem: Problem, before: Solution, candidates: Sequence[Candidate], i: int, screened: Evaluation
) -> Solution | None:
    """A candidate fitted beside a model by the model's noise; None where the simulation runs away."""
    at, candidate = before.point, candidates[i]
    counts = [len(c.parameters) for c in candidates]
    known = 1 + own_count(problem) + at.theta.size
    first = known + sum(counts[:i])
    columns = [*range(known), *range(first, first + counts[i])]
    begun = replace(at, causes=(*at.causes, candidate), values=(*at.values, np.zeros(counts[i])))
    try:
        return fit(problem, begun, 3, screened.with_columns(columns))
    except RunsAwayError:
        return None


def _promises(
    problem: Problem, present: Solution, candidates: Sequence[Candidate], screened: Evaluation
) -> list[float]:
    """Gain of log-likelihood that one step along each candidate promises, causes in the model free.

    A step that would end beyond a parameter's limits ends at them: a play that would have to be below 0, or a surface
    that is stuck where a third less effect is what the flight asks for, promises what that gains.
    """
    reduced = reduce(problem, present.point, screened)
    first, at = present.point.theta.size, present.point.theta.size
    prior = np.array([p.spread**-2.0 for c in (*present.point.causes, *candidates) for p in c.parameters])
    h, g = reduced.information + np.diag(prior), reduced.score
    if first:
        across = np.linalg.solve(h[:first, :first], h[:first, first:])
        g = np.concatenate([g[:first], g[first:] - across.T @ g[:first]])
        h = h.copy()
        h[first:, first:] -= h[first:, :first] @ across
    gains = []
    for c in candidates:
        part = slice(at, at + len(c.parameters))
        at = part.stop
        low, high = (np.array([getattr(p, side) for p in c.parameters]) for side in ("low", "high"))
        step = np.clip(np.linalg.solve(h[part, part], g[part]), low, high)
        gains.append(float(g[part] @ step - 0.5 * step @ h[part, part] @ step))
    return gains


def _fitted(problem: Problem, present: Solution, begun: Point) -> Solution | None:
    """The last cause of a point fitted with its own noise; None where that ends below the model without it.

    Every candidate contains the present model. A fit that ends below it began at noise that is not this flight's.
    """
    try:
        solution = fit(problem, fit_noise(problem, begun, _FEW_PASSES))
        if present.cost - solution.cost > BEYOND_DOUBT:
            solution = settled(problem, solution.point)
    except RunsAwayError:
        return None
    return None if solution.cost > present.cost else solution


def _at_their_best(problem: Problem, present: Solution, fits: Sequence[Solution]) -> list[Tried]:
    """Fits, those that may be best settled anew: they began at noise of the model without the cause, which can be
    another maximum of the likelihood than the best one beside it."""
    best = sorted(fits, key=lambda s: s.cost)
    least = max(_WORTH_ITS_NOISE * (present.cost - best[0].cost), BEYOND_DOUBT) if best else 0.0
    tried = []
    for i, solution in enumerate(best):
        anew = None
        if i < _MOST_ANEW and present.cost - solution.cost >= least:
            anew = settled_anew(problem, solution.point)
            if anew.cost < solution.cost:
                solution, anew = anew, None
        tried.append(replace(_tried(problem, present, solution), anew=anew))
    return tried


def _tried(problem: Problem, present: Solution, solution: Solution) -> Tried:
    """Without small errors yet."""
    candidate = solution.point.causes[-1]
    count = len(candidate.parameters)
    reduced = reduce(problem, solution.point, solution.evaluation)
    inflated = inflation(reduced, slice(solution.point.theta.size - count, None))
    blocks = sum(len(b) for b in solution.evaluation.blocks)
    cost = 0.5 * count * math.log(max(blocks, 2)) - math.log(candidate.odds)
    cost += 0.5 * float(np.sum((solution.point.values[-1] / [p.spread for p in candidate.parameters]) ** 2))
    gain, error = present.cost - solution.cost, np.sqrt(np.diagonal(solution.covariance)[-count:])
    return Tried(candidate, solution, gain, gain, inflated, cost, solution.point.values[-1], error)


def _over_the_best(problem: Problem, present: Solution, tried: Sequence[Tried]) -> list[Tried]:
    """With gains over the present model at its best: fitted again from the noise at which the best fit ended.

    A likelihood of noise can have more than one maximum; another one is no evidence of a cause.
    """
    best = max(tried, key=lambda t: t.gain, default=None)
    if best is None or best.gain < BEYOND_DOUBT:
        return list(tried)
    at = best.solution.point
    again = replace(at, causes=at.causes[:-1], values=at.values[:-1])
    with suppress(RunsAwayError):
        missed = present.cost - settled(problem, again).cost
        return [replace(t, gain=t.gain - max(missed, 0.0)) for t in tried]
    return list(tried)


_MORE_BESIDE = 0.1
"""Part of the best gain that small errors are taken to explain more beside a cause than without it, at most: what
cannot be best even so is not looked into."""


def _judged(problem: Problem, present: Solution, tried: Sequence[Tried]) -> list[Tried]:
    """With evidence, best first: small errors are fitted beside those that may be best or alike.

    The inflation is that of the fit that gains most, for it is of what this model leaves.
    """
    if not tried:
        return []
    most = max(tried, key=lambda t: t.gain)
    without = small_errors(problem, present).beside(most.inflated).gain
    judged: list[Tried] = []
    for t in sorted(tried, key=lambda t: t.cost - t.gain / most.inflated):
        plain = t.gain / most.inflated - t.cost
        at_most = plain + _MORE_BESIDE * most.gain / most.inflated
        if judged and at_most < max(j.evidence for j in judged) - ALIKE:
            judged.append(replace(t, evidence=plain))
            continue
        beside = small_errors(problem, t.solution).beside(most.inflated)
        count = len(t.candidate.parameters)
        judged.append(
            replace(
                t,
                evidence=plain + beside.gain - without,
                value=t.solution.point.values[-1] + beside.step[-count:],
                error=np.sqrt(np.diagonal(beside.covariance)[-count:]),
            )
        )
    return sorted(judged, key=lambda t: -t.evidence)


def held_out_gain(problem: Problem, solution: Solution) -> float:
    """Part of the whitened misfit beyond noise that the last cause takes away on windows that it was not fitted to.

    Its parameters are fitted to three quarters of the windows and tried on the last quarter, four times.
    """
    windows = range(len(problem.windows))
    folds = min(_FOLDS, len(windows))
    if folds < 2:
        return 1.0
    before = after = 0.0
    for part in range(folds):
        fitted, tried = [w for w in windows if w % folds != part], [w for w in windows if w % folds == part]
        found = fit(problem.part(fitted), solution.point.part(fitted), 4).point
        other, here = problem.part(tried), solution.point.part(tried)
        before += _own_best(other, replace(here, causes=here.causes[:-1], values=found.values[:-1]))
        after += _own_best(other, replace(here, values=found.values))
    beyond = before - 0.5 * solution.evaluation.readings
    return (before - after) / max(beyond, before - after, 1.0) if before > after else -1.0


@np.errstate(all="ignore")  # without the cause the simulation may run away: that matters
def _matters(problem: Problem, solution: Solution) -> bool:
    """Whether the last cause changes any output by a part of its motion that matters (root mean squares), and in the
    two seconds where it changes it most by more than the sensor's noise."""
    point = solution.point
    without = replace(point, causes=point.causes[:-1], values=point.values[:-1])
    one, other = replayed(problem, point), replayed(problem, without)
    for k in problem.compared:
        changed, moved, most = 0.0, 0.0, 0.0
        for w, inputs in enumerate(problem.inputs):
            # a delay changes what was measured when
            off = [it.measured[w][:, k] - it.simulated[w][:, k] for it in (one, other)]
            square, measured = (off[0] - off[1]) ** 2, one.measured[w][:, k]
            changed += float(np.nansum(square))
            moved += float(np.nansum((measured - np.nanmean(measured)) ** 2))
            most = max(
                most, _largest_mean(square[np.isfinite(measured)], max(1, round(_SHOWN_S / inputs.dt)))
            )
        if not (changed < MATTERS**2 * moved or most < point.noise.sensors[k] ** 2):
            return True
    return False


def _largest_mean(square: Array, count: int) -> float:
    """Largest mean of so many consecutive squares, or of all; infinite where the simulation runs away."""
    if not np.isfinite(square).all():
        return math.inf
    total = np.concatenate([[0.0], np.cumsum(square)])
    count = min(count, len(square))
    return float((total[count:] - total[: len(total) - count]).max()) / max(count, 1)


def _own_best(problem: Problem, point: Point) -> float:
    """Half the sum of squared innovations, what belongs to windows at its best, nothing else."""
    evaluation = evaluate(problem, model := own_fitted(problem, point))
    return reduce(problem, model, evaluation).cost - evaluation.log_spread
