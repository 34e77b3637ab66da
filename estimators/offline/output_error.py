"""Output error: maximum likelihood with white sensor noise of unknown strength, on files (thesis 5.3).

The model's response to the measured inputs is laid onto the measured outputs (states that were measured, and the
accelerometer). Unknown are the derivatives, common to all manoeuvres, and of each manoeuvre its trim constants, initial
state and accelerometer bias. The noise variances are those of the residuals (5.17), renewed after every step of
Gauss-Newton or Levenberg-Marquardt on the concentrated likelihood sum of N/2 ln R.

Noise of measured inputs drives the model as well. What it is expected to add to the gradient is taken out of it
(``input_noise_effect``), and what it makes of the residuals is in the covariance for coloured residuals of all
channels together.
There is no other process noise: in turbulence use the equation error (force by accelerometer) or the filter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.offline.fit import ChannelFit, Fit, channel_fit, is_white
from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.output_error_covariance import (
    coloured_covariance,
    freedom_taken,
    may_be_off_by,
    rescaled,
)
from wingwatch.estimators.offline.output_error_problem import (
    Point,
    Problem,
    channel_names,
    evaluate,
    input_noise_effect,
    normal_equations,
    problem_of,
    start_at,
)
from wingwatch.estimators.offline.regression import (
    ReferredEstimate,
    SolverReport,
    common_forces,
    corrected_step,
    finished,
    left_over,
    noise_names,
    plain_start,
    sensor_noise,
    signal_share,
)
from wingwatch.estimators.estimate import Estimate

__all__ = ["OutputErrorConfig", "output_error"]

Array = NDArray[np.float64]

NAME = "output-error"

_CORRECTIONS = 8
"""Most steps towards the gradient that the inputs' noise makes."""


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
        natural: natural size of each concise derivative, (k,), for its outcome.

    Returns:
        Estimate at the mean condition of the manoeuvres, with the Cramer-Rao covariance or the one for coloured
        residuals (Morelli and Klein 1997), and the statistics of the fit.

    Raises:
        ValueError: no manoeuvre, or manoeuvres of different configs.
    """
    settings = config or OutputErrorConfig()
    problem = problem_of(parts, settings.drift)
    first = plain_start(parts) if start is None else np.asarray(start, dtype=np.float64)
    point, iterations, settled = _climb(problem, start_at(problem, first), settings)
    point = _without_input_noise(problem, point, settings.tolerance)
    return _report(problem, point, iterations, settled, settings, natural)


def _climb(problem: Problem, parameters: Array, settings: OutputErrorConfig) -> tuple[Point, int, bool]:
    """To the maximum of the likelihood; the noise is renewed after each accepted step."""
    point = evaluate(problem, parameters)
    marquardt = settings.method == "levenberg-marquardt"
    damping = 1e-3 if marquardt else 0.0
    for iteration in range(1, settings.iterations + 1):
        matrix, vector = normal_equations(problem, point)
        scale = np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
        whitened, wanted = matrix / np.outer(scale, scale), vector / scale
        full = _solve(whitened, wanted)
        if float(full @ wanted) <= settings.tolerance**2:
            return point, iteration, True
        share, accepted = 1.0, False
        for _ in range(24):
            step = _solve(whitened + damping * np.eye(scale.size), wanted) if damping else full
            trial = evaluate(problem, point.parameters + share * step / scale)
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


def _without_input_noise(problem: Problem, point: Point, tolerance: float) -> Point:
    """From the maximum of the likelihood to where the gradient is what the inputs' noise makes of it."""
    if not problem.input_noise.any():
        return point
    for _ in range(_CORRECTIONS):
        matrix, vector = normal_equations(problem, point)
        noise, gradient = input_noise_effect(problem, point)
        solution = corrected_step(matrix, noise, vector + gradient, signal_share(1, math.inf))
        trial = evaluate(problem, point.parameters + solution.step)
        if not math.isfinite(trial.cost):
            return point
        point = trial
        if float(solution.step @ matrix @ solution.step) <= tolerance**2:
            return point
    return point


def _solve(matrix: Array, vector: Array) -> Array:
    """Least-norm solution: directions that the data do not see stay where they are."""
    return np.asarray(np.linalg.lstsq(matrix, vector, rcond=1e-13)[0])


def _report(
    problem: Problem,
    point: Point,
    iterations: int,
    settled: bool,
    settings: OutputErrorConfig,
    natural: Array | None,
) -> tuple[Estimate, Fit]:
    matrix, _ = normal_equations(problem, point)
    scale = np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-13, hermitian=True) / np.outer(
        scale, scale
    )
    hidden = _unseen(matrix / np.outer(scale, scale), problem.common)
    if problem.input_noise.any():
        solution = corrected_step(
            matrix, input_noise_effect(problem, point)[0], np.zeros(problem.size), signal_share(1, math.inf)
        )
        inverse, hidden = solution.inverse, hidden | solution.hidden[: problem.common]
    counts = np.sum([u.sum(axis=0) for u in problem.used], axis=0)
    taken = freedom_taken(problem, point, inverse)
    left = np.maximum(counts - taken, 1.0)
    white = rescaled(problem, point, inverse, counts / left)
    coloured = coloured_covariance(problem, point, inverse, counts / left)
    k = problem.common
    channels, windows = _channels(problem, point, taken)
    chosen = settings.covariance == "coloured" or (settings.covariance == "auto" and not is_white(windows))
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
    coloured = coloured + may_be_off_by(problem, point, inverse, unexplained)
    referred = ReferredEstimate(point.parameters[:k], white[:k, :k], coloured[:k, :k], chosen, hidden)
    solver = SolverReport(
        sum(map(len, problem.parts)), problem.size, iterations, settled, float(counts.sum() - problem.size)
    )
    return finished(NAME, problem.parts, referred, channels, noise, solver, natural, doubts)


def _channels(
    problem: Problem, point: Point, taken: Array
) -> tuple[tuple[ChannelFit, ...], list[list[Array]]]:
    """Statistics of every channel that was used, and its residuals by window."""
    channels, windows = [], []
    for c, name in enumerate(channel_names(problem)):
        mask = [u[:, c] for u in problem.used]
        if not any(m.any() for m in mask):
            continue
        z = [r[:, c][m] for r, m in zip(problem.readings, mask, strict=True) if m.any()]
        y = [o[:, c][m] for o, m in zip(point.outputs, mask, strict=True) if m.any()]
        channels.append(channel_fit(name, z, y, float(taken[c])))
        windows.append([a - b for a, b in zip(z, y, strict=True)])
    return tuple(channels), windows


def _unseen(whitened: Array, k: int) -> NDArray[np.bool_]:
    """Derivatives that have a share in a direction without information, (k,)."""
    values, vectors = np.linalg.eigh(whitened)
    flat = vectors[:, values < 1e-10]
    return np.asarray(np.sum(flat[:k] ** 2, axis=1) > 1e-3)
