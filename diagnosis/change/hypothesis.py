"""One explanation of a change, fitted to the time since the onset beside what the time before taught.

Errors u of all coefficients and sensors since the onset are those before it, b, and a change of little size: u is
normal about the posterior mean of b with covariance P_b + tau^2 diag(least^2). A cause theta stands beside them. Both
are fitted by Gauss-Newton on innovations as in ``fit``; the log-likelihood is divided by the inflation f that the time
before has shown.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.change.gaussian import Belief, Meeting, Quadratic, met
from wingwatch.diagnosis.evaluation import Reduced, evaluate, reduce
from wingwatch.diagnosis.linear_model import Noise
from wingwatch.diagnosis.noise import fit_noise
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError

__all__ = ["ANY_CHANGE_ODDS", "Fitted", "Reference", "fitted", "limits", "likelihood"]

Array = NDArray[np.float64]

_LEVELS = (1.0 / 3.0, 1.0)
"""Of tau: what the simulation gets wrong otherwise in another motion, 1 % of a derivative or 3 %. Constants of steady
flight and of sensors have the first: another motion is one by the derivatives."""
ANY_CHANGE_ODDS = 0.05
"""Of a change that no cause describes, beside one cause or beside none."""
_ENOUGH = 0.5
"""Of log-likelihood, promised by a step, below which it is not worth another pass."""
_FIRST_PASSES, _PASSES, _NOISE_PASSES, _ROUNDS = 4, 2, 4, 2
"""Of Gauss-Newton by the noise to begin with; after the noise was fitted; of noise; and how often noise is fitted,
each time from that of the time before: beside a cause that is not at its best yet it takes part of the misfit."""


@dataclass(frozen=True, slots=True)
class Reference:
    """What the time before the onset says.

    Attributes:
        errors: ``reference_errors``; belief: of their values.
        least: of each, the size that just matters; wide: its standard deviation in a change of any kind.
        constant: which are no derivatives.
        inflation: of scores before the onset.
    """

    errors: tuple[Candidate, ...]
    belief: Belief
    least: Array
    wide: Array
    constant: NDArray[np.bool_]
    inflation: float

    @property
    def after_any_change(self) -> Belief:
        """Of the errors since the onset where everything may have changed by any size."""
        return self.belief.widened(self.wide**2)

    def since(self) -> list[Belief]:
        """Of the errors since the onset where they have changed by little, at each level of tau."""
        levels = [np.where(self.constant, _LEVELS[0], tau) for tau in _LEVELS]
        return [self.belief.widened((tau * self.least) ** 2) for tau in levels]


@dataclass(frozen=True, slots=True)
class Fitted:
    """An explanation at its best.

    Attributes:
        cause: None where it has none.
        point: the model since the onset: errors, then the cause.
        meeting: mode, covariance and evidence at the best tau, or beside a change of any kind.
        too_small: log of the evidence of a cause that is there with a size which does not matter; none without a cause.
    """

    cause: Candidate | None
    point: Point
    meeting: Meeting
    too_small: float

    @property
    def values(self) -> Array:
        """Of the cause's parameters."""
        return self.meeting.mode[self._first :]

    @property
    def errors(self) -> Array:
        """Standard errors of them."""
        return np.asarray(np.sqrt(np.diagonal(self.meeting.belief.covariance)[self._first :]))

    @property
    def _first(self) -> int:
        return len(self.meeting.mode) - (0 if self.cause is None else len(self.cause.parameters))


def limits(causes: Sequence[Candidate]) -> tuple[Array, Array]:
    """Lowest and highest values of the parameters of causes."""
    low = [p.low for c in causes for p in c.parameters]
    return np.array(low), np.array([p.high for c in causes for p in c.parameters])


def likelihood(reduced: Reduced, at: Array, inflation: float) -> Quadratic:
    """Of a part of a flight about a point."""
    return Quadratic(at, reduced.cost / inflation, reduced.score / inflation, reduced.information / inflation)


def fitted(
    problem: Problem,
    point: Point,
    reference: Reference,
    cause: Candidate | None,
    begin: Array,
    air: Noise,
    *,
    any_change: bool = False,
) -> Fitted:
    """A cause, or none, fitted to the windows since the onset with noise of its own.

    Args:
        problem: those windows.
        point: their trims and the noise to begin with.
        reference: what the time before says.
        cause: the explanation.
        begin: values of errors and of the cause to begin with.
        air: noise by which they are fitted first: where it takes part of the misfit, steps are short.
        any_change: whether everything may have changed by any size.

    Raises:
        RunsAwayError: the simulation leaves the flight.
    """
    causes = (*reference.errors, *(() if cause is None else (cause,)))
    own = () if cause is None else (cause,)
    spread = np.array([p.spread for c in own for p in c.parameters])
    errors = [reference.after_any_change] if any_change else reference.since()
    least = np.array([min(p.least, p.spread) for c in own for p in c.parameters])
    priors, small = ([one.beside(sizes) for one in errors] for sizes in (spread, least))
    fit = _Fit(problem, causes, limits(own), reference.inflation, priors)
    at = replace(point, causes=causes, values=_split(begin, causes), noise=air)
    at, _ = fit.improved(at, _FIRST_PASSES)
    for _ in range(_ROUNDS):
        values = _values_of(at, cause)
        at, reduced = fit.improved(fit_noise(problem, replace(at, noise=point.noise), _NOISE_PASSES), _PASSES)
        too_small = -math.inf if cause is None else fit.best(reduced, at, small).log_evidence
        meeting = fit.best(reduced, at, priors)
        if cause is not None:
            beside = fit.best(reduced, at, [reference.after_any_change.beside(spread)])
            beside = replace(beside, log_evidence=beside.log_evidence + math.log(ANY_CHANGE_ODDS))
            meeting = max(meeting, beside, key=lambda m: m.log_evidence)
        found = Fitted(cause, at, meeting, too_small)
        if (np.abs(_values_of(at, cause) - values) < found.errors).all():
            break
    return found


@dataclass(frozen=True, slots=True)
class _Fit:
    problem: Problem
    causes: tuple[Candidate, ...]
    limits: tuple[Array, Array]
    inflation: float
    priors: list[Belief]

    def best(self, reduced: Reduced, point: Point, priors: Sequence[Belief]) -> Meeting:
        """At the best tau."""
        quadratic = likelihood(reduced, point.theta, self.inflation)
        found = [met(quadratic, prior, *self.limits) for prior in priors]
        return max(found, key=lambda m: m.log_evidence)

    def improved(self, point: Point, passes: int) -> tuple[Point, Reduced]:
        """A point after some passes, and the sums there."""
        reduced = reduce(self.problem, point, evaluate(self.problem, point))
        if not np.isfinite(reduced.cost):
            raise RunsAwayError("the simulation diverges from the flight")
        for _ in range(passes):
            here = self._cost(reduced, point)
            quadratic = likelihood(reduced, point.theta, self.inflation)
            step = met(quadratic, self.priors[0], *self.limits).mode - point.theta
            if self._promised(reduced, point, step) < _ENOUGH:
                break
            part, better = 1.0, False
            while part > 0.1 and not better:
                there = self._moved(point, reduced, part * step)
                tried = reduce(self.problem, there, evaluate(self.problem, there))
                better = bool(self._cost(tried, there) < here)
                part *= 0.4
            if not better:
                break
            point, reduced = there, tried
        return point, reduced

    def _cost(self, reduced: Reduced, point: Point) -> float:
        off = point.theta - self.priors[0].mean
        return reduced.cost / self.inflation + 0.5 * float(off @ self.priors[0].precision @ off)

    def _promised(self, reduced: Reduced, point: Point, step: Array) -> float:
        prior = self.priors[0]
        gradient = reduced.score / self.inflation - prior.precision @ (point.theta - prior.mean)
        whole = reduced.information / self.inflation + prior.precision
        return float(gradient @ step - 0.5 * step @ whole @ step)

    def _moved(self, point: Point, reduced: Reduced, taken: Array) -> Point:
        trims = point.trims.copy()
        for w, (alone, by_theta) in enumerate(reduced.own):
            trims[w, list(self.problem.free_trims)] += alone - by_theta @ taken
        return replace(point, values=_split(point.theta + taken, self.causes), trims=trims)


def _values_of(point: Point, cause: Candidate | None) -> Array:
    """Of the cause's parameters, which come last."""
    return np.zeros(0) if cause is None else point.values[-1]


def _split(theta: Array, causes: Sequence[Candidate]) -> tuple[Array, ...]:
    cuts = np.cumsum([len(c.parameters) for c in causes])[:-1]
    return tuple(np.split(theta, cuts))
