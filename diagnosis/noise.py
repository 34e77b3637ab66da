"""How strong noise of the sensors, gusts and unmodelled moments are: parameters of the same likelihood.

With innovations e of standard deviation s at logarithms eta of the standard deviations,

    cost = sum (e^2 / 2 s^2 + ln s),   d(e)/d(eta) and d(ln s)/d(eta) by differences,                           (3)

and Fisher's scoring goes downhill. A broad prior keeps what the data do not know where it was.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.evaluation import own_prior
from wingwatch.diagnosis.innovations import Gains, LinearModel, Noise, settled_gains, whiten
from wingwatch.diagnosis.measured import MeasuredFlight
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, RunsAwayError, lead_of, linear_at, model_at
from wingwatch.diagnosis.replay import Model, without_delays
from wingwatch.diagnosis.windows import own_columns, residual_of, simulate

__all__ = ["first_noise", "fit_noise"]

Array = NDArray[np.float64]

_Columns = tuple[LinearModel, Array]

_STEP = 1e-3
_SPREAD = 3.0
"""Of the logarithms, beforehand."""
_LONGEST = 1.0
_MOST_PASSES = 12
_ENOUGH = 0.1
_GUSTS = 6
_LEAST_OF_STATED = 0.2
"""Sensors are not believed to be better than this part of what is stated or of their own roughness."""


def first_noise(flight: MeasuredFlight) -> Noise:
    """Stated sensor noise, next to no gusts."""
    speed = flight.airspeed_m_s
    sensors = np.where(np.isfinite(flight.noise_std), flight.noise_std, 1.0)
    return Noise(sensors, np.array([2e-3 * speed] * 3 + [1e-3, 0.02, 0.02]))


def _noise_at(eta: Array, used: tuple[int, ...], noise: Noise) -> Noise:
    sensors = noise.sensors.copy()
    sensors[list(used)] = np.exp(eta[: len(used)])
    return Noise(sensors, np.exp(eta[len(used) :]))


def fit_noise(problem: Problem, point: Point) -> Point:
    """The point with the most likely noise for its residuals, what belongs to a window at its best."""
    used = problem.used
    prior = np.log(
        np.concatenate([first_noise(problem.subject.flight).sensors[list(used)], point.noise.gusts])
    )
    prior[len(used) :] = np.log(first_noise(problem.subject.flight).gusts)
    least = prior + np.log(_LEAST_OF_STATED)
    least[len(used) :] = prior[len(used) :] - 6.0
    eta = np.log(np.concatenate([point.noise.sensors[list(used)], point.noise.gusts]))
    model = model_at(problem, point)
    measured = without_delays(problem.subject.flight, model)
    columns = [_residual_and_own(problem, point, w, model, measured) for w in range(len(problem.inputs))]
    cost, score, information = _sums(problem, columns, eta, prior, point.noise)
    damping = 0.0
    for _ in range(_MOST_PASSES):
        step = np.linalg.solve(information + damping * np.diag(np.diagonal(information)), score)
        step = np.clip(step, -_LONGEST, _LONGEST)
        tried = np.maximum(eta + step, least)
        there = _sums(problem, columns, tried, prior, point.noise)
        if there[0] < cost:
            gained, damping = cost - there[0], damping / 4.0
            eta, (cost, score, information) = tried, there
            if gained < _ENOUGH:
                break
        else:
            damping = max(4.0 * damping, 0.1)
            if damping > 100.0:
                break
    return replace(point, noise=_noise_at(eta, used, point.noise))


@np.errstate(all="ignore")
def _residual_and_own(
    problem: Problem, point: Point, w: int, model: Model, measured: Array
) -> tuple[LinearModel, Array]:
    linear = linear_at(problem, point, problem.groups[w], model)
    read = simulate(problem, point, w, [model], linear)[0]
    own = own_columns(problem, point, w, model, linear, read)
    if not (np.isfinite(read).all() and np.isfinite(own).all()):
        raise RunsAwayError("the simulation runs away from the flight")
    residual = residual_of(problem, point, w, measured, read, linear)
    return linear, np.concatenate([residual[..., None], own], axis=-1)


def _sums(
    problem: Problem, columns: list[_Columns], eta: Array, prior: Array, noise: Noise
) -> tuple[float, Array, Array]:
    """Cost, gradient downwards, information; what belongs to a window at its best."""
    at = [eta, *(eta + _STEP * row for row in np.eye(len(eta)))]
    noises = [_noise_at(one, problem.used, noise) for one in at]
    groups = tuple(dict.fromkeys(problem.groups))
    longest = max(w.stop - w.start for w in problem.windows)

    def gains_of(group: int) -> list[Gains]:
        linear, lead = columns[group][0], lead_of(problem, group)
        return [settled_gains(linear, one, problem.used, lead, longest) for one in noises]

    @np.errstate(all="ignore")
    def of_window(w: int) -> tuple[float, Array, Array]:
        gains = found[problem.groups[w]]
        residual, white, s = _at_its_best(problem, columns[w], w, noises[0], gains[0])
        psi, sigma = np.empty((len(eta), s.size)), np.empty((len(eta), s.size))
        for i in range(len(eta)):
            e, spread = whiten(
                columns[w][0], noises[1 + i], residual, problem.used, lead_of(problem, w), gains[1 + i]
            )
            psi[i], sigma[i] = (e.ravel() / s - white) / _STEP, np.log(spread.ravel() / s) / _STEP
        cost = 0.5 * float(white @ white) + float(np.log(s).sum())
        return cost, sigma @ (white**2 - (white != 0.0)) - psi @ white, psi @ psi.T + 2.0 * sigma @ sigma.T

    with ThreadPoolExecutor(WORKERS) as pool:
        found = dict(zip(groups, pool.map(gains_of, groups), strict=True))
        parts = list(pool.map(of_window, range(len(columns))))
    off = eta - prior
    cost = sum(p[0] for p in parts) + 0.5 * float(off @ off) / _SPREAD**2
    information = sum((p[2] for p in parts), np.diag(np.full(len(eta), _SPREAD**-2.0)))
    return cost, sum((p[1] for p in parts), -off / _SPREAD**2), information


def _at_its_best(
    problem: Problem, columns: _Columns, w: int, noise: Noise, gains: Gains
) -> tuple[Array, Array, Array]:
    """Residual (samples, outputs, 1) less what the window's own explains, whitened, and standard deviations."""
    linear, rows = columns
    innovations, spread = whiten(linear, noise, rows, problem.used, lead_of(problem, w), gains)
    s = spread.ravel()
    white = innovations.reshape(s.size, -1) / s[:, None]
    own = white[:, 1:]
    move = np.linalg.solve(own.T @ own + np.diag(own_prior(problem)), own.T @ white[:, 0])
    return rows[..., :1] - rows[..., 1:] @ move[:, None], white[:, 0] - own @ move, s
