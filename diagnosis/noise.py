"""How strong noise of the sensors, gusts and unmodelled moments are: parameters of the same likelihood.

With innovations e of standard deviation s at logarithms eta of the standard deviations,

    cost = sum (e^2 / 2 s^2 + ln s),   d(e)/d(eta) and d(ln s)/d(eta) by differences,                           (5)

and Fisher's scoring goes downhill. A broad prior keeps what the data do not know where it was.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Subject
from wingwatch.diagnosis.innovations import Filter, Mask, Path, kalman_filter, sensitivities
from wingwatch.diagnosis.linear_model import Noise
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, RunsAwayError, linear_at, model_at
from wingwatch.diagnosis.replay import SURFACE_OUTPUTS, without_delays
from wingwatch.diagnosis.windows import all_seen, fly_filtered, seen_in

__all__ = ["first_noise", "fit_noise", "likeliest_level"]

Array = NDArray[np.float64]

_STEP = 1e-3
_SPREAD, _SPREAD_ALONG = 3.0, 0.35
"""Of the logarithms, beforehand; of the strength of gusts along the path over that of those up and down."""
_LONGEST = 1.0
_MOST_PASSES = 12
_ENOUGH = 0.5
"""Of log-likelihood, gained or promised by a step, below which it is not worth another."""
_GUSTS, _FELT = 6, 3
_LEAST_OF_STATED = 0.2
"""Sensors are not believed to be better than this part of what is stated or of their own roughness."""
_LEAST_OF_GUSTS = 0.01
_LEAST_GRADIENTS, _MOST_GRADIENTS = 0.001, 2.0
_LEAST_LAG, _MOST_LAG = 0.01, 20.0
"""Bounds, as parts of what is thought first."""
_LEAST_ALONG, _MOST_ALONG = 0.05, 2.0
"""Strength of gusts along the path over that of those up and down: 1 high up, up to 2 near the ground (MIL-F-8785C,
3.7.2). An aircraft that is not moved by them, or a flight that has none, says so."""


def first_noise(subject: Subject) -> Noise:
    """Stated sensor noise, next to no gusts."""
    flight, speed = subject.flight, subject.flight.airspeed_m_s
    sensors = np.where(np.isfinite(flight.noise_std), flight.noise_std, 1.0)
    surfaces = np.nan_to_num(flight.surface_noise_std)
    gusts = np.array([2e-3 * speed] * 3 + [1e-3, 0.02, 0.02, 0.05])
    return Noise(sensors, gusts, surfaces, any_force_x=subject.given > 0)


def _eta_of(noise: Noise, used: tuple[int, ...]) -> Array:
    """Logarithms of what is fitted: sensors that count, gusts, those along the path over those up and down, how they
    are felt."""
    felt = [noise.gusts[0] / noise.gusts[2], noise.gradients, noise.lag_s]
    return np.asarray(np.log(np.concatenate([noise.sensors[list(used)], noise.gusts[1:], felt])))


def _noise_at(eta: Array, used: tuple[int, ...], noise: Noise) -> Noise:
    sensors, last = noise.sensors.copy(), len(used) + _GUSTS
    sensors[list(used)] = np.exp(eta[: len(used)])
    gusts = np.exp(eta[len(used) : last])
    along, gradients, lag_s = np.exp(eta[last:])
    gusts = np.concatenate([along * gusts[1:2], gusts])
    return replace(noise, sensors=sensors, gusts=gusts, gradients=float(gradients), lag_s=float(lag_s))


def fit_noise(problem: Problem, point: Point, passes: int = _MOST_PASSES) -> Point:
    """The point with the most likely noise for its residuals.

    What belongs to a window is held: in a Gaussian likelihood the information of means and of spreads is orthogonal.

    Args:
        problem: the flight.
        point: the model, and where to begin.
        passes: at most.
    """
    used = problem.used
    first = first_noise(problem.subject)
    prior, eta = _eta_of(first, used), _eta_of(point.noise, used)
    least = prior + np.log([
        *(_LEAST_OF_STATED if k < SURFACE_OUTPUTS else _LEAST_OF_GUSTS for k in used),
        *([_LEAST_OF_GUSTS] * _GUSTS), _LEAST_ALONG, _LEAST_GRADIENTS, _LEAST_LAG,
    ])  # fmt: skip
    most = np.full(len(eta), np.inf)
    most[-_FELT:] = prior[-_FELT:] + np.log([_MOST_ALONG, _MOST_GRADIENTS, _MOST_LAG])
    at = _Levels(problem, point, eta, prior)
    score, information = at.slopes()
    reach, left = _LONGEST, passes
    while left > 0:
        free = ~((at.eta <= least) & (score < 0.0) | (at.eta >= most) & (score > 0.0))
        tried = np.clip(at.eta + _step(information, score, free, reach), least, most)
        step = tried - at.eta
        if float(score @ step - 0.5 * step @ information @ step) < _ENOUGH:
            break
        there, left = _Levels(problem, point, tried, prior), left - 1
        if there.cost < at.cost:
            gained, reach, at = at.cost - there.cost, min(2.0 * reach, _LONGEST), there
            if gained < _ENOUGH or left == 0:
                break
            score, information = at.slopes()
        else:
            reach /= 4.0
    return replace(point, noise=_noise_at(at.eta, used, point.noise))


_GUST_LEVELS = (0.002, 0.006, 0.02, 0.06)
"""Of gusts that are tried first, as parts of the speed; the air rolls with ``_ROLL_OF_GUSTS`` rad/s of them."""
_ROLL_OF_GUSTS = 2.5
_MOMENT_LEVELS = (0.02, 0.2)
"""Of unmodelled angular accelerations, rad/s2."""
_FORWARD_OF_MOMENTS = 2.0
"""Of the unmodelled specific force along x, m/s2 a rad/s2."""


def likeliest_level(problem: Problem, point: Point) -> Point:
    """The point with the most likely of a few levels of noise, sensors as stated: where a fit begins.

    Raises:
        RunsAwayError: the simulation leaves the flight by all of them.
    """
    first, model = first_noise(problem.subject), model_at(problem, point)
    measured, speed = without_delays(problem.subject.flight, model), problem.subject.flight.airspeed_m_s
    levels = [
        np.array([part * speed] * 3 + [_ROLL_OF_GUSTS * part, moment, moment, _FORWARD_OF_MOMENTS * moment])
        for part in _GUST_LEVELS for moment in _MOMENT_LEVELS
    ]  # fmt: skip

    @np.errstate(all="ignore")
    def cost(gusts: Array) -> float:
        noise, total = replace(first, gusts=gusts), 0.0
        filters = {}
        for w, group in enumerate(problem.groups):
            if group not in filters:
                linear = linear_at(problem, group, model, noise)
                filters[group] = kalman_filter(linear, noise, problem.used, all_seen(problem, group))
            path = fly_filtered(problem, w, model, point.trims[w], filters[group], measured)
            seen = path.seen
            total += float(
                (0.5 * (path.innovations / path.deviation) ** 2 + np.log(path.deviation))[seen].sum()
            )
        return total

    with ThreadPoolExecutor(WORKERS) as pool:
        costs = np.array(list(pool.map(cost, levels)))
    if not np.isfinite(costs).any():
        raise RunsAwayError("the simulation diverges from the flight")
    return replace(point, noise=replace(first, gusts=levels[int(np.nanargmin(costs))]))


def _step(information: Array, score: Array, free: Mask, reach: float) -> Array:
    """The best step uphill that moves nothing by more than its reach: what would go further is held there."""
    step, rest = np.zeros(len(score)), free.copy()
    while rest.any():
        gradient = score[rest] - information[rest][:, ~rest] @ step[~rest]
        step[rest] = np.linalg.solve(information[rest][:, rest], gradient)
        far = rest & (np.abs(step) > reach)
        if not far.any():
            break
        step[far] = np.sign(step[far]) * reach
        rest &= ~far
    return step


class _Levels:
    """Equation (5) at logarithms of the standard deviations, eta.

    Attributes:
        eta: where.
        cost: minus log-likelihood there, less what was known of eta beforehand.
    """

    def __init__(self, problem: Problem, point: Point, eta: Array, prior: Array) -> None:
        self.eta, self._problem, self._point = eta, problem, point
        self._model = model_at(problem, point)
        self._noise = _noise_at(eta, problem.used, point.noise)
        self._known = np.full(len(eta), _SPREAD**-2.0)
        self._known[-_FELT] = _SPREAD_ALONG**-2.0
        self._off = eta - prior
        measured = without_delays(problem.subject.flight, self._model)
        self._seen = [seen_in(problem, w, measured) for w in range(len(problem.windows))]
        with ThreadPoolExecutor(WORKERS) as pool:
            groups = tuple(dict.fromkeys(problem.groups))
            self._filters = dict(zip(groups, pool.map(self._filter_of_group, groups), strict=True))
            self._flown = list(pool.map(lambda w: self._fly(w, measured), range(len(problem.windows))))
        cost = 0.0
        for _, path in self._flown:
            white = (path.innovations / path.deviation)[path.seen]
            cost += 0.5 * float(white @ white) + float(np.log(path.deviation).sum())
        self.cost = cost + 0.5 * float(self._off @ (self._known * self._off))

    def _filter_of_group(self, group: int) -> Filter:
        problem = self._problem
        linear = linear_at(problem, group, self._model, self._noise)
        return kalman_filter(linear, self._noise, problem.used, all_seen(problem, group))

    def _misses(self, w: int) -> bool:
        """Whether a window misses readings that others of its group have."""
        seen = self._seen[w]
        return not np.array_equal(seen, all_seen(self._problem, self._problem.groups[w])[: len(seen)])

    @np.errstate(all="ignore")
    def _fly(self, w: int, measured: Array) -> tuple[Filter, Path]:
        problem = self._problem
        filtering = self._filters[problem.groups[w]]
        if self._misses(w):
            filtering = kalman_filter(filtering.linear, self._noise, problem.used, self._seen[w])
        trims = self._point.trims[w]
        return filtering, fly_filtered(problem, w, self._model, trims, filtering, measured, air_too=True)

    def slopes(self) -> tuple[Array, Array]:
        """Gradient downwards and information."""
        alike: dict[
            tuple[int, int], list[int]
        ] = {}  # windows by their group, those that miss readings one by one
        for w, group in enumerate(self._problem.groups):
            alike.setdefault((group, w if self._misses(w) else -1), []).append(w)
        with ThreadPoolExecutor(WORKERS) as pool:
            parts = [part for found in pool.map(self._slopes_of, alike.values()) for part in found]
        information = sum((p[1] for p in parts), np.diag(self._known))
        return sum((p[0] for p in parts), -self._known * self._off), information

    @np.errstate(all="ignore")
    def _slopes_of(self, windows: Sequence[int]) -> list[tuple[Array, Array]]:
        """Of windows with the same filter, what each adds to gradient and information."""
        problem, eta = self._problem, self.eta
        noises = [_noise_at(one, problem.used, self._point.noise) for one in eta + _STEP * np.eye(len(eta))]
        group, filtering = problem.groups[windows[0]], self._flown[windows[0]][0]
        linear = [filtering.linear] * (len(noises) - 2)
        linear += [linear_at(problem, group, self._model, one) for one in noises[-2:]]  # how gusts are felt
        readings = self._seen[windows[0]] if self._misses(windows[0]) else all_seen(problem, group)
        paths, out = [self._flown[w][1] for w in windows], []
        spreads, changes = sensitivities(
            filtering, readings, list(zip(linear, noises, strict=True)), _STEP, paths
        )
        for path, change in zip(paths, changes, strict=True):
            seen = path.seen
            psi = (change / path.deviation[..., None])[seen]
            sigma = spreads[np.minimum(np.arange(len(seen)), len(spreads) - 1)][seen]
            white = (path.innovations / path.deviation)[seen]
            out.append((sigma.T @ (white**2 - 1.0) - psi.T @ white, psi.T @ psi + 2.0 * sigma.T @ sigma))
        return out
