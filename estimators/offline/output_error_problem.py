"""Output error's model of all manoeuvres: its response to the measured inputs, residuals, sensitivities, likelihood.

Parameters are the derivatives, common to all manoeuvres, then each manoeuvre's own: trim constants (drifts behind them
where there are any), initial state and accelerometer biases.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.output_kernel import Accelerometers, Record, respond
from wingwatch.estimators.offline.regression import common_forces, sensor_noise, shared_config

__all__ = [
    "Point",
    "Problem",
    "channel_names",
    "evaluate",
    "input_noise_effect",
    "normal_equations",
    "problem_of",
    "start_at",
]

Array = NDArray[np.float64]

_ROUNDING = 1e-5
"""Residuals below this share of a channel's own spread weigh no more: without noise one channel would outweigh all."""

_MEMORY_S = 6.0
"""Time after which the response to one sample's noise counts no more."""


@dataclass(slots=True)
class Problem:
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
        """Number of parameters."""
        return self.common + self.own * len(self.parts)

    def place(self, m: int) -> slice:
        """Own parameters of manoeuvre ``m``."""
        return slice(self.common + m * self.own, self.common + (m + 1) * self.own)


@dataclass(slots=True)
class Point:
    """A point of the climb: parameters, residuals, sensitivities, noise variances and cost."""

    parameters: Array
    outputs: list[Array]
    residuals: list[Array]
    sensitivities: list[Array]
    noise: Array
    cost: float


def problem_of(parts: Sequence[Manoeuvre], drift: bool) -> Problem:
    """The problem of all manoeuvres, whose trim constants move on a line where ``drift``.

    Raises:
        ValueError: no manoeuvre, or manoeuvres of different configs.
    """
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
    own = ne * (2 if drift else 1) + ns + forces.size
    power = np.mean([r.var(axis=0) for r in readings], axis=0)
    floor = np.maximum(_ROUNDING**2 * power, 1e-300)
    input_noise = sensor_noise(parts, common_forces(parts))[ns + ne :]
    return Problem(parts, readings, used, drift, forces, len(structure.derivatives), own, floor, input_noise)


def start_at(problem: Problem, theta: Array) -> Array:
    """Parameters (size,) from common derivatives ``theta`` (common,): trim constants that hold the mean of each
    manoeuvre, initial state as first measured."""
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


def evaluate(problem: Problem, parameters: Array) -> Point:
    """Outputs, residuals and sensitivities at ``parameters``, shape (size,); an infinite cost where the response is not
    finite."""
    outputs, residuals, sensitivities = [], [], []
    squares = np.zeros(problem.readings[0].shape[1])
    theta = np.ascontiguousarray(parameters[: problem.common])
    for m, part in enumerate(problem.parts):
        shape = problem.readings[m].shape
        out, sensitivity = np.empty(shape), np.empty((*shape, problem.common + problem.own))
        flown = Record(
            part.time_s, part.inputs, part.held_steps, part.known, part.rest, part.stability, part.control,
            part.pressure,
        )  # fmt: skip
        own = np.ascontiguousarray(parameters[problem.place(m)])
        accelerometers = Accelerometers(problem.forces, part.config.lever_m)
        respond(theta, own, problem.drift, accelerometers, flown, out, sensitivity)
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
    return Point(parameters, outputs, residuals, sensitivities, noise, cost)


def normal_equations(problem: Problem, point: Point) -> tuple[Array, Array]:
    """Information matrix (size, size) and gradient (size,) of the likelihood at fixed noise."""
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


def input_noise_effect(problem: Problem, point: Point) -> tuple[Array, Array]:
    """What white noise of the inputs adds to the information, and takes from the gradient, in the mean.

    With G(l) the outputs l steps after a unit noise of one sample, residuals have -sum G n in them and sensitivities
    sum dG/dp n, so the gradient has -sum over inputs of var (N - l) dG/dp' R^-1 G, and the information likewise.
    Shapes as of ``normal_equations``.
    """
    size, weight = problem.size, 1.0 / point.noise
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    c, ns = problem.common, problem.parts[0].states.shape[1]
    for part, used in zip(problem.parts, problem.used, strict=True):
        steps = min(len(part), math.ceil(_MEMORY_S / part.dt))
        channel_weight = weight * used.any(axis=0)
        for j in np.flatnonzero(problem.input_noise):
            out, sensitivity = np.empty((steps, weight.size)), np.empty((steps, weight.size, c + problem.own))
            inputs = np.zeros((steps, problem.input_noise.size))
            inputs[1, j] = 1.0
            pulse = Record(
                part.dt * np.arange(steps, dtype=np.float64), inputs, part.held_steps[:steps] & False,
                np.tile(part.known.mean(axis=0), (steps, 1, 1)), np.zeros((steps, ns)),
                np.full(steps, part.stability.mean()), np.full(steps, part.control.mean()), np.zeros(steps),
            )  # fmt: skip
            theta, own = np.ascontiguousarray(point.parameters[:c]), np.zeros(problem.own)
            accelerometers = Accelerometers(problem.forces, part.config.lever_m)
            respond(theta, own, problem.drift, accelerometers, pulse, out, sensitivity)
            often = problem.input_noise[j] * (len(part) - np.arange(steps))
            slopes = sensitivity[:, :, :c]
            vector[:c] += np.einsum("l,lcp,c,lc->p", often, slopes, channel_weight, out, optimize=True)
            matrix[:c, :c] += np.einsum(
                "l,lcp,c,lcq->pq", often, slopes, channel_weight, slopes, optimize=True
            )
    return matrix, vector


def channel_names(problem: Problem) -> list[str]:
    """Of all channels: the states, then the accelerometers."""
    structure = problem.parts[0].config.structure
    return [*structure.states, *(f"a_{structure.equations[f]}" for f in problem.forces)]
