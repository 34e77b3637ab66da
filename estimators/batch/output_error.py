"""Output error: maximum likelihood with white sensor noise of unknown strength, on files (thesis 5.3).

The model's response to the measured inputs is laid onto the measured outputs (states that were measured, and the
accelerometer). Unknown are the derivatives, common to all manoeuvres, and of each manoeuvre its trim constants, initial
state and accelerometer bias. The noise variances are those of the residuals (5.17), renewed after every step of
Gauss-Newton or Levenberg-Marquardt on the concentrated likelihood sum of N/2 ln R.

Noise of measured inputs drives the model as well. What it is expected to add to the gradient is taken out of it
(``_driven``), and what it makes of the residuals is in the covariance for coloured residuals of all channels together.
There is no other process noise: in turbulence use the equation error (force by accelerometer) or the filter.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.batch.fit import (
    ChannelFit,
    Fit,
    autocovariance,
    channel_fit,
    coloured_sum,
    is_white,
)
from wingwatch.estimators.batch.manoeuvre import Manoeuvre
from wingwatch.estimators.batch.output_kernel import respond
from wingwatch.estimators.batch.regression import (
    common_forces,
    corrected_step,
    finished,
    left_over,
    noise_names,
    plain_start,
    sensor_noise,
    shared_config,
    signal_share,
)
from wingwatch.estimators.estimate import Estimate

__all__ = ["OutputErrorConfig", "output_error"]

Array = NDArray[np.float64]

NAME = "output-error"

_ROUNDING = 1e-5
"""Residuals below this share of a channel's own spread weigh no more: without noise one channel would outweigh all."""

_CORRECTIONS = 8
"""Most steps towards the gradient that the inputs' noise makes."""

_MEMORY_S = 6.0
"""Time after which the response to one sample's noise counts no more."""


@dataclass(frozen=True, slots=True)
class OutputErrorConfig:
    """How the likelihood is climbed.

    Attributes:
        method: ``levenberg-marquardt`` (damped where a step fails) or ``gauss-newton`` (halved where a step fails).
        drift: whether each trim constant may move on a line over its manoeuvre.
        covariance: ``white`` for the Cramer-Rao bound, ``coloured`` for (5.53), ``auto`` for the second where the
            residuals are not white.
        iterations: most steps.
        tolerance: ends when a step would move no combination of parameters by more than this share of its error.
    """

    method: Literal["levenberg-marquardt", "gauss-newton"] = "levenberg-marquardt"
    drift: bool = False
    covariance: Literal["auto", "white", "coloured"] = "auto"
    iterations: int = 60
    tolerance: float = 1e-3


@dataclass(slots=True)
class _Problem:
    """Data of all manoeuvres, where each one's own parameters stand, the least noise variance of each channel, and the
    noise variance of each input."""

    parts: Sequence[Manoeuvre]
    readings: list[Array]
    used: list[NDArray[np.bool_]]
    drift: bool
    forces: NDArray[np.int64]
    common: int
    own: int
    floor: Array
    input_noise: Array

    @property
    def size(self) -> int:
        return self.common + self.own * len(self.parts)

    def place(self, m: int) -> slice:
        """Own parameters of manoeuvre ``m``."""
        return slice(self.common + m * self.own, self.common + (m + 1) * self.own)


@dataclass(slots=True)
class _Point:
    """A point of the climb: parameters, residuals, sensitivities, noise variances and cost."""

    parameters: Array
    outputs: list[Array]
    residuals: list[Array]
    sensitivities: list[Array]
    noise: Array
    cost: float


def output_error(
    parts: Sequence[Manoeuvre],
    config: OutputErrorConfig | None = None,
    *,
    start: Array | None = None,
    natural: Array | None = None,
) -> tuple[Estimate, Fit]:
    """Derivatives by output error.

    Args:
        parts: manoeuvres of one config.
        config: see there.
        start: referred aerodynamic derivatives to start from, (k,); equation error (5.12) where None.
        natural: natural size of each concise derivative, (k,), for its standing.

    Returns:
        Estimate at the mean condition of the manoeuvres, with the Cramer-Rao covariance or the one for coloured
        residuals (Morelli and Klein 1997), and the statistics of the fit.

    Raises:
        ValueError: no manoeuvre, or manoeuvres of different configs.
    """
    settings = config or OutputErrorConfig()
    problem = _problem(parts, settings)
    first = plain_start(parts) if start is None else np.asarray(start, dtype=np.float64)
    point, iterations, settled = _climb(problem, _initial(problem, first), settings)
    point = _without_input_noise(problem, point, settings.tolerance)
    return _report(problem, point, iterations, settled, settings, natural)


def _problem(parts: Sequence[Manoeuvre], settings: OutputErrorConfig) -> _Problem:
    shared = shared_config(parts)
    structure = shared.structure
    ns, ne = len(structure.states), len(structure.equations)
    forces = np.flatnonzero(common_forces(parts))
    readings = [np.column_stack([p.states, p.accelerometer[:, forces]]) for p in parts]
    used = []
    for part, reading in zip(parts, readings, strict=True):
        seen = np.isfinite(reading)
        seen[:, :ns] &= part.measured
        used.append(seen)
        reading[~seen] = 0.0
    own = ne * (2 if settings.drift else 1) + ns + forces.size
    power = np.mean([r.var(axis=0) for r in readings], axis=0)
    floor = np.maximum(_ROUNDING**2 * power, 1e-300)
    input_noise = sensor_noise(parts, common_forces(parts))[ns + ne :]
    return _Problem(
        parts, readings, used, settings.drift, forces, len(structure.derivatives), own, floor, input_noise
    )


def _initial(problem: _Problem, theta: Array) -> Array:
    """Trim constants that hold the mean of each manoeuvre, initial state as first measured."""
    parameters = np.zeros(problem.size)
    parameters[: problem.common] = theta
    for m, part in enumerate(problem.parts):
        own = parameters[problem.place(m)]
        rates = part.regressors @ theta.reshape(-1, part.regressors.shape[1]).T
        ne, ns = rates.shape[1], part.states.shape[1]
        known = np.einsum("nij,nj->ni", part.known, part.states) + part.rest
        change = (part.states[-1] - part.states[0]) / part.duration_s
        own[:ne] = (change[:ne] - rates.mean(axis=0) - known[:, :ne].mean(axis=0)) / part.pressure.mean()
        at = ne * (2 if problem.drift else 1)
        own[at : at + ns] = part.states[:3].mean(axis=0)
        for f, row in enumerate(problem.forces):
            reading = part.accelerometer[:, row] - rates[:, row] - own[row] * part.pressure
            own[at + ns + f] = float(np.mean(reading))
    return parameters


def _evaluate(problem: _Problem, parameters: Array) -> _Point:
    """Outputs, residuals and sensitivities; an infinite cost where the response is not finite."""
    outputs, residuals, sensitivities = [], [], []
    squares = np.zeros(problem.readings[0].shape[1])
    theta = np.ascontiguousarray(parameters[: problem.common])
    for m, part in enumerate(problem.parts):
        shape = problem.readings[m].shape
        out, sensitivity = np.empty(shape), np.empty((*shape, problem.common + problem.own))
        respond(
            theta, np.ascontiguousarray(parameters[problem.place(m)]), problem.drift, problem.forces,
            part.config.lever_m, part.time_s, part.inputs, part.held_steps, part.known, part.rest, part.stability,
            part.control, part.pressure, out, sensitivity,
        )  # fmt: skip
        residual = np.where(problem.used[m], problem.readings[m] - out, 0.0)
        sensitivity[~problem.used[m]] = 0.0
        squares += np.sum(residual**2, axis=0)
        outputs.append(out)
        residuals.append(residual)
        sensitivities.append(sensitivity)
    counts = np.sum([u.sum(axis=0) for u in problem.used], axis=0)
    noise = np.maximum(squares / np.maximum(counts, 1), problem.floor)
    cost = (
        0.5 * float(counts @ np.log(noise) + np.sum(squares / noise))
        if np.isfinite(squares).all()
        else float("inf")
    )
    return _Point(parameters, outputs, residuals, sensitivities, noise, cost)


def _normal(problem: _Problem, point: _Point) -> tuple[Array, Array]:
    """Information matrix and gradient of the likelihood at fixed noise."""
    matrix, vector = np.zeros((problem.size, problem.size)), np.zeros(problem.size)
    c = problem.common
    for m in range(len(problem.parts)):
        s = point.sensitivities[m]
        flat = (s / np.sqrt(point.noise)[None, :, None]).reshape(-1, s.shape[2])
        local = flat.T @ flat
        score = flat.T @ (point.residuals[m] / np.sqrt(point.noise)).reshape(-1)
        at = problem.place(m)
        matrix[:c, :c] += local[:c, :c]
        matrix[:c, at] = local[:c, c:]
        matrix[at, :c] = local[c:, :c]
        matrix[at, at] = local[c:, c:]
        vector[:c] += score[:c]
        vector[at] = score[c:]
    return matrix, vector


def _climb(problem: _Problem, parameters: Array, settings: OutputErrorConfig) -> tuple[_Point, int, bool]:
    """To the maximum of the likelihood; the noise is renewed after each accepted step."""
    point = _evaluate(problem, parameters)
    marquardt = settings.method == "levenberg-marquardt"
    damping = 1e-3 if marquardt else 0.0
    for iteration in range(1, settings.iterations + 1):
        matrix, vector = _normal(problem, point)
        scale = np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
        whitened, wanted = matrix / np.outer(scale, scale), vector / scale
        full = _solve(whitened, wanted)
        if float(full @ wanted) <= settings.tolerance**2:
            return point, iteration, True
        share, accepted = 1.0, False
        for _ in range(24):
            step = _solve(whitened + damping * np.eye(scale.size), wanted) if damping else full
            trial = _evaluate(problem, point.parameters + share * step / scale)
            if trial.cost < point.cost:
                accepted = True
                break
            if marquardt:
                damping = max(10.0 * damping, 1e-6)
            else:
                share *= 0.5
        if not accepted:
            return point, iteration, True
        point = trial
        damping = damping / 10.0 if damping > 1e-9 else 0.0
    return point, settings.iterations, False


def _without_input_noise(problem: _Problem, point: _Point, tolerance: float) -> _Point:
    """From the maximum of the likelihood to where the gradient is what the inputs' noise makes of it."""
    if not problem.input_noise.any():
        return point
    for _ in range(_CORRECTIONS):
        matrix, vector = _normal(problem, point)
        noise, gradient = _driven(problem, point)
        solution = corrected_step(matrix, noise, vector + gradient, signal_share(1, math.inf))
        trial = _evaluate(problem, point.parameters + solution.step)
        if not math.isfinite(trial.cost):
            return point
        point = trial
        if float(solution.step @ matrix @ solution.step) <= tolerance**2:
            return point
    return point


def _driven(problem: _Problem, point: _Point) -> tuple[Array, Array]:
    """What white noise of the inputs adds to the information, and takes from the gradient, in the mean.

    With G(l) the outputs l steps after a unit noise of one sample, residuals have -sum G n in them and sensitivities
    sum dG/dp n, so the gradient has -sum over inputs of var (N - l) dG/dp' R^-1 G, and the information likewise.
    """
    size, weight = problem.size, 1.0 / point.noise
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    c, ns = problem.common, problem.parts[0].states.shape[1]
    for part, used in zip(problem.parts, problem.used, strict=True):
        steps = min(len(part), math.ceil(_MEMORY_S / part.dt))
        heard = weight * used.any(axis=0)
        for j in np.flatnonzero(problem.input_noise):
            out, sensitivity = np.empty((steps, weight.size)), np.empty((steps, weight.size, c + problem.own))
            inputs = np.zeros((steps, problem.input_noise.size))
            inputs[1, j] = 1.0
            respond(
                np.ascontiguousarray(point.parameters[:c]), np.zeros(problem.own), problem.drift, problem.forces,
                part.config.lever_m, part.dt * np.arange(steps), inputs, part.held_steps[:steps] & False,
                np.tile(part.known.mean(axis=0), (steps, 1, 1)), np.zeros((steps, ns)),
                np.full(steps, part.stability.mean()), np.full(steps, part.control.mean()), np.zeros(steps), out,
                sensitivity,
            )  # fmt: skip
            often = problem.input_noise[j] * (len(part) - np.arange(steps))
            slopes = sensitivity[:, :, :c]
            vector[:c] += np.einsum("l,lcp,c,lc->p", often, slopes, heard, out, optimize=True)
            matrix[:c, :c] += np.einsum("l,lcp,c,lcq->pq", often, slopes, heard, slopes, optimize=True)
    return matrix, vector


def _solve(matrix: Array, vector: Array) -> Array:
    """Least-norm solution: directions that the data do not see stay where they are."""
    return np.asarray(np.linalg.lstsq(matrix, vector, rcond=1e-13)[0])


def _report(
    problem: _Problem,
    point: _Point,
    iterations: int,
    settled: bool,
    settings: OutputErrorConfig,
    natural: Array | None,
) -> tuple[Estimate, Fit]:
    matrix, _ = _normal(problem, point)
    scale = np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-13, hermitian=True) / np.outer(
        scale, scale
    )
    hidden = _unseen(matrix / np.outer(scale, scale), problem.common)
    if problem.input_noise.any():
        solution = corrected_step(
            matrix, _driven(problem, point)[0], np.zeros(problem.size), signal_share(1, math.inf)
        )
        inverse, hidden = solution.inverse, hidden | solution.hidden[: problem.common]
    counts = np.sum([u.sum(axis=0) for u in problem.used], axis=0)
    taken = _freedom_taken(problem, point, inverse)
    left = np.maximum(counts - taken, 1.0)
    white = _rescaled(problem, point, inverse, counts / left)
    coloured = _coloured(problem, point, inverse, counts / left)
    k = problem.common
    channels, stretches = _channels(problem, point, taken)
    chosen = settings.covariance == "coloured" or (settings.covariance == "auto" and not is_white(stretches))
    noise = {c.name: c.residual_std for c in channels}
    sensors = dict(
        zip(
            noise_names(problem.parts[0].config),
            sensor_noise(problem.parts, common_forces(problem.parts)),
            strict=True,
        )
    )
    doubts = [left_over(c, float(sensors[c.name]), slice(None)) for c in channels]
    unexplained = {
        c.name: 1.0 - float(sensors[c.name]) / c.residual_std**2
        for c, doubt in zip(channels, doubts, strict=True)
        if doubt is not None
    }
    coloured = coloured + _off(problem, point, inverse, unexplained)
    return finished(
        NAME, problem.parts, point.parameters[:k], white[:k, :k], coloured[:k, :k], chosen, channels, noise,
        samples=sum(len(p) for p in problem.parts), parameters=problem.size, iterations=iterations,
        converged=settled, freedom=float(counts.sum() - problem.size), natural=natural,
        hidden=hidden,
        left_over=[d for d in doubts if d is not None],
    )  # fmt: skip


def _freedom_taken(problem: _Problem, point: _Point, inverse: Array) -> Array:
    """Degrees of freedom that the parameters take from each channel, (channels,); they add to their number."""
    taken = np.zeros(point.noise.size)
    for m in range(len(problem.parts)):
        index = _indices(problem, m)
        local = inverse[np.ix_(index, index)]
        s = point.sensitivities[m]
        taken += np.einsum("ncp,pq,ncq->c", s, local, s, optimize=True) / point.noise
    return taken


def _indices(problem: _Problem, m: int) -> NDArray[np.int64]:
    at = problem.place(m)
    return np.concatenate([np.arange(problem.common), np.arange(at.start, at.stop)])


def _rescaled(problem: _Problem, point: _Point, inverse: Array, growth: Array) -> Array:
    """Inverse information with each channel's noise over its degrees of freedom instead of its samples."""
    middle = np.zeros_like(inverse)
    for m in range(len(problem.parts)):
        index = _indices(problem, m)
        s = point.sensitivities[m]
        middle[np.ix_(index, index)] += np.einsum("ncp,c,ncq->pq", s, growth / point.noise, s, optimize=True)
    return np.asarray(inverse @ middle @ inverse)


def _coloured(problem: _Problem, point: _Point, inverse: Array, growth: Array) -> Array:
    """Covariance for residuals of the correlations that they have, of every channel with itself and with every other
    one: (5.53) with sensitivities as regressors."""
    middle = np.zeros_like(inverse)
    lags = max(min(len(p) for p in problem.parts) // 2, 1)
    total = sum(r.shape[0] for r in point.residuals)
    seen = np.maximum(np.sum([u.sum(axis=0) for u in problem.used], axis=0), 1)
    size = np.sqrt(growth * total / seen)
    channels = range(point.noise.size)
    rows = [[r[:, c] for r in point.residuals] for c in channels]
    for c in channels:
        for d in range(c, point.noise.size):
            both = [autocovariance(rows[c], rows[d], lags), autocovariance(rows[d], rows[c], lags)]
            covariance = np.stack(both) * size[c] * size[d]
            for m in range(len(problem.parts)):
                index = np.ix_(_indices(problem, m), _indices(problem, m))
                s = point.sensitivities[m] / point.noise[:, None]
                part = coloured_sum(s[:, c], s[:, d], covariance)
                middle[index] += part if c == d else part + part.T
    return np.asarray(inverse @ middle @ inverse)


def _off(problem: _Problem, point: _Point, inverse: Array, unexplained: Mapping[str, float]) -> Array:
    """By how much channels that the model does not hold for may have put the parameters off, as a covariance.

    Gusts are no noise of a sensor, and an autopilot answers them: residuals and sensitivities may go together anyhow.
    With v what the sensors leave of a channel's residual, |sum h v| <= |h| |v| (Cauchy and Schwarz, ``endogeneity``).

    Args:
        unexplained: by channel, share of its residual's power that is no sensor's noise.
    """
    names = _names(problem)
    middle = np.zeros_like(inverse)
    for name, share in unexplained.items():
        c = names.index(name)
        power = share * sum(float(np.sum(r[:, c] ** 2)) for r in point.residuals) / point.noise[c]
        for m in range(len(problem.parts)):
            index = _indices(problem, m)
            s = point.sensitivities[m][:, c]
            middle[np.ix_(index, index)] += power * (s.T @ s) / point.noise[c]
    return np.asarray(inverse @ middle @ inverse)


def _names(problem: _Problem) -> list[str]:
    """Of all channels: the states, then the accelerometers."""
    structure = problem.parts[0].config.structure
    return [*structure.states, *(f"a_{structure.equations[f]}" for f in problem.forces)]


def _channels(
    problem: _Problem, point: _Point, taken: Array
) -> tuple[tuple[ChannelFit, ...], list[list[Array]]]:
    """Statistics of every channel that was used, and its residuals by stretch."""
    channels, stretches = [], []
    for c, name in enumerate(_names(problem)):
        mask = [u[:, c] for u in problem.used]
        if not any(m.any() for m in mask):
            continue
        z = [r[:, c][m] for r, m in zip(problem.readings, mask, strict=True) if m.any()]
        y = [o[:, c][m] for o, m in zip(point.outputs, mask, strict=True) if m.any()]
        channels.append(channel_fit(name, z, y, float(taken[c])))
        stretches.append([a - b for a, b in zip(z, y, strict=True)])
    return tuple(channels), stretches


def _unseen(whitened: Array, k: int) -> NDArray[np.bool_]:
    """Derivatives that have a share in a direction without information, (k,)."""
    values, vectors = np.linalg.eigh(whitened)
    flat = vectors[:, values < 1e-10]
    return np.asarray(np.sum(flat[:k] ** 2, axis=1) > 1e-3)
