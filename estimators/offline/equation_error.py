"""Equation error in the time domain: least squares on smoothed and differentiated states, on files (thesis 5.2).

All channels pass the same global Fourier smoothing, and derivatives are those of the smoothed states (6.5.2, 6.6.2),
so that smoothing moves no side of an equation against the other. Then

    theta = (X'X - N)^-1 (X'y - g)

is (5.12) less what the sensors' noise is expected to add to both products (``correct_noise`` False: as it stands in
the thesis). Force equations rest on the accelerometer where there is one: no derivative, and no gust.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.estimators.estimate import Estimate
from wingwatch.estimators.offline.endogeneity import (
    Difference,
    left_unexplained,
    may_be_off,
    surface_response,
)
from wingwatch.estimators.offline.fit import (
    ChannelFit,
    Fit,
    autocovariance,
    channel_fit,
    coloured_sum,
    crosscovariance,
)
from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.regression import (
    ReferredEstimate,
    SolverReport,
    common_forces,
    corrected_step,
    equation_names,
    equations,
    finished,
    left_over,
    noise_names,
    shared_config,
    signal_share,
    stated_noise,
)
from wingwatch.estimators.offline.smoothed_equations import (
    SmoothedManoeuvre,
    busiest_cutoff_hz,
    inner_samples,
    passed,
    smoothed,
)

__all__ = ["EquationErrorConfig", "equation_error"]

Array = NDArray[np.float64]

NAME = "equation-error"

_CHANCE = 0.01
"""Chance that a residual that the sensors' noise explains is called coloured."""

_SINGULAR = 1e10
"""Condition of the instruments' products with the regressors beyond which they tell nothing."""

_PASSES = 4
"""Solutions; each takes the kinks that held inputs make in the states from the one before. As many again at most where
the sensors' noise turns out to be less than third differences say."""


@dataclass(frozen=True, slots=True)
class EquationErrorConfig:
    """How the states are smoothed and the equations solved.

    Attributes:
        cutoff_hz: of the smoothing; where None, where the busiest state's signal falls to its noise, at most a
            fifth of the sample rate.
        drift: whether each equation has a drift of its own in each manoeuvre; always where a velocity is reconstructed.
        force_from_accelerometer: whether force equations rest on accelerometers where there are any.
        correct_noise: whether what noise adds to the products is taken out again.
        noise_std: of states, the equations' accelerometers and inputs, (states + equations + inputs,); from their
            third differences where empty.
        covariance: ``white`` for sensors' noise alone, ``coloured`` for (5.53), ``auto`` for the second where the
            first does not explain the residuals.
    """

    cutoff_hz: float | None = None
    drift: bool = False
    force_from_accelerometer: bool = True
    correct_noise: bool = True
    noise_std: tuple[float, ...] = ()
    covariance: Literal["auto", "white", "coloured"] = "auto"


def equation_error(
    parts: Sequence[Manoeuvre], config: EquationErrorConfig | None = None, *, natural: Array | None = None
) -> tuple[Estimate, Fit]:
    """Derivatives by equation error in the time domain.

    Args:
        parts: manoeuvres of one config.
        config: see there.
        natural: natural size of each concise derivative, (k,), for its outcome.

    Returns:
        Estimate at the mean condition of the manoeuvres, and the statistics of the fit to the smoothed left sides.

    Raises:
        ValueError: no manoeuvre, or manoeuvres of different configs.
    """
    settings = config or EquationErrorConfig()
    shared = shared_config(parts)
    ne = len(shared.structure.equations)
    forces = common_forces(parts) & settings.force_from_accelerometer
    variance = stated_noise(parts, forces, settings.noise_std)
    even = [p.even() for p in parts]
    drift = settings.drift or not all(p.measured.all() for p in parts)
    cutoff = settings.cutoff_hz or busiest_cutoff_hz(even)
    theta = np.zeros((ne, len(shared.structure.regressors)))
    first = theta
    for turn in range(2 * _PASSES):
        smooth = [smoothed(p, forces, drift, cutoff, theta, variance) for p in even]
        matrix, noise, vector = _normal(smooth, theta, settings.correct_noise)
        share = signal_share(theta.shape[1], 0.5 * sum(m.values for m in smooth))
        solution = corrected_step(matrix, noise, vector, share)
        theta = solution.step.reshape(theta.shape)
        if turn + 1 < _PASSES:
            continue
        first = theta if turn + 1 == _PASSES else first
        believed = variance if settings.noise_std else _no_more_than_found(variance, smooth, theta)
        if turn + 1 == 2 * _PASSES or (believed == variance).all():
            break
        variance = believed
    moved = (theta - first).reshape(-1)
    white, coloured, explained, freedom = _covariances(smooth, theta, solution.inverse)
    explained &= not moved.any()
    chosen = settings.covariance == "coloured" or (settings.covariance == "auto" and not explained)
    names = equation_names(shared, forces)
    channels = _channels(names, smooth, theta)
    weights = [len(m.left) for m in smooth]
    due = [np.average([m.noise.residual[i, i, 0] for m in smooth], weights=weights) for i in range(ne)]
    width = theta.shape[1]
    doubts = [left_over(c, float(due[i]), slice(i * width, (i + 1) * width)) for i, c in enumerate(channels)]
    # where third differences were wrong, noise is known no better than by what that changed
    coloured = (
        coloured
        + np.outer(moved, moved)
        + _off(even, smooth, forces, drift, cutoff, theta, solution.inverse, [d is None for d in doubts])
    )
    trims = len(parts) * ne * (2 if drift else 1)
    noise_std = {n: float(np.sqrt(v)) for n, v in zip(noise_names(shared), variance, strict=True) if v > 0.0}
    referred = ReferredEstimate(theta.reshape(-1), white, coloured, chosen, solution.hidden)
    solver = SolverReport(sum(map(len, parts)), theta.size + trims, turn + 1, True, freedom)
    return finished(NAME, parts, referred, channels, noise_std, solver, natural, doubts)


def _normal(smooth: Sequence[SmoothedManoeuvre], theta: Array, correct: bool) -> tuple[Array, Array, Array]:
    """X'X and X'y of all equations, and what noise adds to the first; the second has its share taken out."""
    ne, width = theta.shape
    matrix, noise = np.zeros((ne, width, ne, width)), np.zeros((ne, width, ne, width))
    vector = np.zeros((ne, width))
    for m in smooth:
        for i in range(ne):
            matrix[i, :, i] += m.right[i].T @ m.right[i]
            vector[i] += m.right[i].T @ m.clean[:, i]
            if correct:
                noise[i, :, i] += m.noise.right
                vector[i] -= m.noise.left[i]
    k = ne * width
    return matrix.reshape(k, k), noise.reshape(k, k), vector.reshape(k)


def _no_more_than_found(variance: Array, smooth: Sequence[SmoothedManoeuvre], theta: Array) -> Array:
    """Sensors' noise variances that leave no more in an equation than its residual has.

    Third differences count gusts and vibration above the smoothing's cutoff as noise of the sensors. Of what an
    equation has too little each sensor bears as much as it has a share in it (to first order a step of
    expectation-maximisation).
    """
    residuals = _residuals(smooth, theta)
    freedom = sum(m.noise.freedom for m in smooth)
    left = max(freedom - theta.shape[1] - len(smooth), 1.0)
    variance = variance.copy()
    for i in range(theta.shape[0]):
        sources = sum(m.noise.sources[i] * len(r) for m, r in zip(smooth, residuals, strict=True))
        due = float(np.sum(sources))
        ratio = sum(float(np.sum(r[:, i] ** 2)) for r in residuals) / max(due, 1e-300) * freedom / left
        if ratio * left < scipy.stats.chi2.ppf(_CHANCE, left):
            variance *= ratio ** (sources / due)
    return variance


def _residuals(smooth: Sequence[SmoothedManoeuvre], theta: Array) -> list[Array]:
    return [m.clean - np.einsum("eno,eo->ne", m.right, theta) for m in smooth]


def _covariances(
    smooth: Sequence[SmoothedManoeuvre], theta: Array, inverse: Array
) -> tuple[Array, Array, bool, float]:
    """Covariance for sensors' noise, for residuals as they are, whether the first explains them, and freedom."""
    ne, width = theta.shape
    residuals = _residuals(smooth, theta)
    freedom = sum(m.noise.freedom for m in smooth)
    left = max(freedom - width - len(smooth), 1.0)
    lags = max(min(r.shape[0] for r in residuals) // 2, 1)
    middle = np.zeros((2, ne, width, ne, width))
    explained = True
    for i in range(ne):
        own = sum(float(np.sum(r[:, i] ** 2)) for r in residuals)
        due = sum(m.noise.residual[i, i, 0] * len(r) for m, r in zip(smooth, residuals, strict=True))
        ratio = own / max(due, 1e-300) * freedom / left
        explained &= bool(
            scipy.stats.chi2.ppf(_CHANCE, left) <= ratio * left <= scipy.stats.chi2.ppf(1.0 - _CHANCE, left)
        )
        for j in range(ne):
            columns = [[r[:, e] for r in residuals] for e in (i, j)]
            found = crosscovariance(columns[0], columns[1], lags)
            for m in smooth:
                theory = np.stack([m.noise.residual[i, j], m.noise.residual[j, i]])
                middle[0, i, :, j] += coloured_sum(m.right[i], m.right[j], theory, taper=False)
                middle[1, i, :, j] += coloured_sum(m.right[i], m.right[j], found * freedom / left)
    for m in smooth:
        middle += m.noise.crossed
    k = ne * width
    white, coloured = (inverse @ x.reshape(k, k) @ inverse for x in middle)
    return white, coloured, explained, left


def _off(
    parts: Sequence[Manoeuvre],
    smooth: Sequence[SmoothedManoeuvre],
    forces: NDArray[np.bool_],
    drift: bool,
    cutoff_hz: float,
    theta: Array,
    inverse: Array,
    holds: Sequence[bool],
) -> Array:
    """By how much what the sensors do not explain may have put the derivatives off, as a covariance, (k, k)."""
    (ne, width), residuals = theta.shape, _residuals(smooth, theta)
    freedom = sum(m.noise.freedom for m in smooth)
    left = max(freedom - width - len(smooth), 1.0)
    lags = max(min(r.shape[0] for r in residuals) // 2, 1)
    tools: list[Array] = []
    found = []
    for i in range(ne):
        own = sum(float(np.sum(r[:, i] ** 2)) for r in residuals) * freedom / left
        due = sum(m.noise.residual[i, i, 0] * len(r) for m, r in zip(smooth, residuals, strict=True))
        unexplained = left_unexplained(own, due, left)
        if unexplained == 0.0:
            continue
        tools = tools or [_instruments(p, forces, drift, cutoff_hz, theta) for p in parts]
        at = slice(i * width, (i + 1) * width)
        plain = [m.right[i] @ inverse[at, at] for m in smooth]
        crossed = sum(z.T @ m.right[i] for z, m in zip(tools, smooth, strict=True))
        value, covariance = np.full(ne * width, np.nan), np.zeros((ne * width, ne * width))
        bound = np.zeros((ne * width, ne * width))
        bound[at, at] = unexplained * sum(h.T @ h for h in plain)
        if np.isfinite(crossed).all() and np.linalg.cond(crossed) < _SINGULAR:
            step = np.linalg.solve(crossed, sum(z.T @ r[:, i] for z, r in zip(tools, residuals, strict=True)))
            other = [z @ np.linalg.inv(crossed).T - h for z, h in zip(tools, plain, strict=True)]
            colours = autocovariance([r[:, i] for r in residuals], lags) * freedom / left
            value[:], value[at] = 0.0, step
            covariance[at, at] = sum(coloured_sum(h, h, colours) for h in other)
        one = Difference(value, covariance, bound)
        found.append(one if holds[i] else one.by_bound())
    return may_be_off(found) if found else np.zeros((ne * width, ne * width))


def _instruments(
    part: Manoeuvre, forces: NDArray[np.bool_], drift: bool, cutoff_hz: float, theta: Array
) -> Array:
    """What the surfaces alone make of the regressors, smoothed and without trims as these, (n, regressors)."""
    eq = equations(part, forces, drift)
    inner = inner_samples(part, eq, cutoff_hz)
    moved = np.column_stack(
        [surface_response(part, theta) * part.stability[:, None], part.inputs * part.control[:, None]]
    )
    trims, _ = np.linalg.qr(passed(eq.trims, part.dt, cutoff_hz)[inner])
    tools = passed(moved, part.dt, cutoff_hz)[inner]
    return np.asarray(tools - trims @ (trims.T @ tools))


def _channels(
    names: Sequence[str], smooth: Sequence[SmoothedManoeuvre], theta: Array
) -> tuple[ChannelFit, ...]:
    channels = []
    for i, name in enumerate(names):
        measured = [m.left[:, i] for m in smooth]
        predicted = [y - r[:, i] for y, r in zip(measured, _residuals(smooth, theta), strict=True)]
        channels.append(channel_fit(name, measured, predicted, theta.shape[1]))
    return tuple(channels)
