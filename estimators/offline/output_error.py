"""Output error: maximum likelihood with white sensor noise of unknown strength, on files (thesis 5.3).

The model's response to the measured inputs is laid onto the measured outputs (states that were measured, and the
accelerometer): filter error's likelihood without process noise. Unknown are the derivatives, common to all manoeuvres,
and of each manoeuvre its trim forces, initial state and accelerometer bias; the noise variances are those of the
residuals (5.17).

Noise of measured inputs drives the model as well. What it is expected to add to the gradient is taken out of it. What
it makes of the residuals is in the covariance for coloured residuals of all channels together, which is no smaller than
what sensors and inputs are expected to make of the gradient.
There is no other process noise: in turbulence use the equation error (force by accelerometer) or filter error.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.estimators.estimate import Estimate
from wingwatch.estimators.offline.fit import (
    Fit,
    coloured_covariance,
    is_white,
    no_less_than,
)
from wingwatch.estimators.offline.likelihood import (
    Evaluation,
    Prior,
    Problem,
    channel_fits,
    evaluate,
    information_inverse,
)
from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.parameters import Model
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
    shared_config,
    signal_share,
)
from wingwatch.estimators.offline.scoring import Search, Slope, Solution, climb, slope_at
from wingwatch.estimators.offline.window import window
from wingwatch.estimators.plant.motion import Plant

__all__ = ["OutputErrorConfig", "output_error", "response"]

Array = NDArray[np.float64]

NAME = "output-error"

_CORRECTIONS = 8
"""Most steps towards the gradient that the inputs' noise makes."""

_COARSE = 0.3
"""Share of their errors within which parameters are first brought, where the steps towards that gradient follow."""

_CHANCE = 1e-3
"""That noise alone gains as much likelihood by all unknowns: below that nothing has moved."""

_STEP = 1e-5
"""Of a derivative's natural size, by which it is moved for its sensitivity."""


@dataclass(frozen=True, slots=True)
class OutputErrorConfig:
    """How the likelihood is climbed.

    Attributes:
        method: ``levenberg-marquardt`` (damped where a step fails) or ``gauss-newton`` (halved where a step fails).
        drift: whether each trim force may move on a line over its manoeuvre.
        covariance: ``white`` for the Cramer-Rao bound, ``coloured`` for (5.53), ``auto`` for the second where the
            residuals are not white.
        iterations: most steps.
        tolerance: ends when a step would move no combination of parameters by more than this share of its error.
    """

    method: Literal["levenberg-marquardt", "gauss-newton"] = "levenberg-marquardt"
    drift: bool = False
    covariance: Literal["auto", "white", "coloured"] = "auto"
    iterations: int = 60
    tolerance: float = 1e-4


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
        ValueError: no manoeuvre, manoeuvres of different configs, or a model that runs away at the start.
    """
    settings = config or OutputErrorConfig()
    first = plain_start(parts) if start is None else np.asarray(start, dtype=np.float64)
    sensors = sensor_noise(parts, common_forces(parts))
    problem, quiet = _problems(parts, first, sensors, settings.drift)
    noisy = any(w.input_noise.any() for w in problem.windows)
    tolerance = max(settings.tolerance, _COARSE) if noisy else settings.tolerance
    search = Search(settings.iterations, math.inf, tolerance, settings.method == "levenberg-marquardt")
    solution = climb(quiet, quiet.prior.start, search)
    if solution is None:
        raise ValueError("the model runs away from the flight where the search starts; give another start")
    point, slope = solution.point, solution.slope
    if noisy:
        point, slope = _without_input_noise(problem, point, settings.tolerance)
    return _report(parts, problem, replace(solution, point=point, slope=slope), settings, natural, sensors)


def response(part: Manoeuvre, derivatives: Array) -> Mapping[str, tuple[Array, Array]]:
    """Readings of a manoeuvre beside those of the model, whose trims and start follow them best.

    Args:
        part: on stamps of one step, or brought to them.
        derivatives: referred aerodynamic ones, concise, (k,).

    Returns:
        by channel (the states that were measured, ``a_z`` and so on) readings and model, SI units, (n,) each; the model
        is NaN where it runs away, or a derivative is not known.
    """
    known = bool(np.isfinite(derivatives).all())
    sensors = np.zeros(len(noise_names(part.config)))
    _, problem = _problems([part], np.where(np.isfinite(derivatives), derivatives, 0.0), sensors, False)
    point = evaluate(problem, problem.prior.start) if known else None
    (data,) = problem.windows
    left = np.full_like(data.readings, np.nan) if point is None else point.traces[0].innovations
    names = problem.model.plant.channel_names
    return {
        name: (data.readings[:, c], data.readings[:, c] - left[:, c])
        for c, name in enumerate(names)
        if data.used[:, c].all()
    }


def _problems(
    parts: Sequence[Manoeuvre], first: Array, sensors: Array, drift: bool
) -> tuple[Problem, Problem]:
    """The problem with noise of the inputs (the last of ``sensor_noise``) and without it; parameters start at
    ``first``, (k,)."""
    shared = shared_config(parts)
    forces = np.flatnonzero(common_forces(parts))
    plant = Plant(shared.structure, forces, shared.lever_m)
    noise = sensors[-len(shared.structure.inputs) :]
    windows = [window(p, forces, noise, deviations=False, drift=drift) for p in parts]
    natural = _natural(parts, first)
    model = Model(plant, False, natural, math.inf)
    start, none = first / natural, np.full(first.size, math.inf)
    prior = Prior(start, none, start, np.full(first.size, _STEP))
    problem = Problem(windows, model, prior, np.ones(first.size, dtype=np.bool_))
    quiet = [replace(w, input_noise=np.zeros_like(w.input_noise)) for w in windows]
    return problem, replace(problem, windows=quiet)


def _natural(parts: Sequence[Manoeuvre], theta: Array) -> Array:
    """Size at which each derivative alone makes its equation's acceleration as large as all of them do, (k,)."""
    moved = np.sqrt(np.mean([p.regressors.var(axis=0) for p in parts], axis=0))
    rows = theta.reshape(-1, moved.size)
    whole = np.sqrt(np.sum((rows * moved) ** 2, axis=1, keepdims=True))
    sizes = np.where(moved > 0.0, whole / np.where(moved > 0.0, moved, 1.0), np.abs(rows))
    return np.asarray(np.where(sizes > 0.0, sizes, 1.0).reshape(-1))


def _without_input_noise(problem: Problem, point: Evaluation, tolerance: float) -> tuple[Evaluation, Slope]:
    """From the maximum of the likelihood to where the gradient is what the inputs' noise makes of it."""
    slope = None
    found = evaluate(problem, point.parameters)
    for _ in range(_CORRECTIONS):
        if found is None:
            break
        point, slope = found, slope_at(problem, found)
        share = signal_share(1, math.inf)
        step = corrected_step(slope.information, slope.surface_noise, slope.score, share).step
        if float(step @ slope.information @ step) <= tolerance**2:
            break
        found = evaluate(problem, point.parameters + step)
    return point, slope or slope_at(problem, point)


@dataclass(frozen=True, slots=True)
class _Residuals:
    """Whitened residuals and sensitivities at a point, by window.

    Attributes:
        left: (n, channels); slopes: without what own constants explain, (n, channels, k).
        own: degrees of freedom that own constants take from each channel, (channels,).
        counts: readings of each channel, (channels,).
    """

    left: list[Array]
    slopes: list[Array]
    own: Array
    counts: Array


def _residuals(problem: Problem, solution: Solution) -> _Residuals:
    channels = problem.model.plant.channels
    found = _Residuals([], [], np.zeros(channels), np.zeros(channels))
    for m, (data, s) in enumerate(zip(problem.windows, solution.slope.windows, strict=True)):
        root = 1.0 / np.sqrt(solution.point.traces[m].variances)
        x = (solution.point.own_columns[m] * root).reshape(data.own, -1)
        hat = np.sum(x * (information_inverse(x @ x.T) @ x), axis=0)
        found.left.append(s.innovations.reshape(data.readings.shape))
        found.slopes.append(s.predicted.T.reshape(*data.readings.shape, -1))
        found.own[...] += hat.reshape(data.readings.shape).sum(axis=0)
        found.counts[...] += data.used.sum(axis=0)
    return found


def _report(
    parts: Sequence[Manoeuvre],
    problem: Problem,
    solution: Solution,
    settings: OutputErrorConfig,
    natural: Array | None,
    sensors: Array,
) -> tuple[Estimate, Fit]:
    found, slope, k = _residuals(problem, solution), solution.slope, problem.free.size
    corrected = corrected_step(slope.information, slope.surface_noise, np.zeros(k), signal_share(1, math.inf))
    inverse = corrected.inverse
    each = sum(s.transpose(1, 2, 0) @ s.transpose(1, 0, 2) for s in found.slopes)  # information by channel
    taken = found.own + np.einsum("pq,cpq->c", inverse, each)
    growth = found.counts / np.maximum(found.counts - taken, 1.0)
    by_inputs = sum(
        np.sum(s.surface_noises.reshape(-1, growth.size) ** 2, axis=0)
        for s in slope.windows
        if s.surface_noises.size
    ) / np.maximum(found.counts, 1)
    alone = growth * np.maximum(1.0 - by_inputs, 0.0)
    exact, noisy = (np.einsum("c,cpq->pq", g, each) for g in (growth, alone))
    noisy += sum(s.surface_noise_scatter() for s in slope.windows)
    channels, windows = channel_fits(problem, solution.point, taken)
    chosen = settings.covariance == "coloured" or (settings.covariance == "auto" and not is_white(windows))
    due = dict(zip(noise_names(parts[0].config), sensors.tolist(), strict=True))
    doubts = [left_over(c, due[c.name], slice(None)) for c in channels]
    names = problem.model.plant.channel_names
    unexplained = [
        (names.index(c.name), 1.0 - due[c.name] / c.residual_std**2)
        for c, doubt in zip(channels, doubts, strict=True)
        if doubt is not None
    ]
    coloured = coloured_covariance(found.slopes, found.left, growth / np.maximum(found.counts, 1))
    coloured += _may_be_off_by(found, unexplained)
    unit = np.outer(problem.model.natural, problem.model.natural)
    white, least, coloured = (unit * (inverse @ m @ inverse) for m in (exact, noisy, coloured))
    coloured = no_less_than(least, coloured)
    value = solution.point.parameters * problem.model.natural
    unknowns = k + sum(w.own for w in problem.windows)
    still = _gain(problem, solution.point) < scipy.stats.chi2.ppf(1.0 - _CHANCE, unknowns)
    referred = ReferredEstimate(value, white, coloured, chosen, corrected.hidden | still)
    settled = solution.converged or solution.iterations < settings.iterations
    solver = SolverReport(
        sum(map(len, parts)), unknowns, solution.iterations, settled, float(found.counts.sum() - unknowns)
    )
    noise = {c.name: c.residual_std for c in channels}
    return finished(NAME, parts, referred, channels, noise, solver, natural, doubts)


def _gain(problem: Problem, point: Evaluation) -> float:
    """Twice the log-likelihood that the model's motion gains over no motion at all, readings being constant."""
    gain = 0.0
    for c in range(problem.model.plant.channels):
        read = [w.readings[w.used[:, c], c] for w in problem.windows]
        left = [t.innovations[w.used[:, c], c] for w, t in zip(problem.windows, point.traces, strict=True)]
        still = sum(float(np.sum((z - z.mean()) ** 2)) for z in read if z.size)
        rest = max(sum(float(e @ e) for e in left), float(np.finfo(float).tiny))
        gain += sum(z.size for z in read) * math.log(still / rest) if still > 0.0 else 0.0
    return gain


def _may_be_off_by(found: _Residuals, unexplained: Sequence[tuple[int, float]]) -> Array:
    """By how much channels that the model does not hold for may have put the parameters off, as a score's variance.

    Gusts are no noise of a sensor, and an autopilot answers them: residuals and sensitivities may go together anyhow.
    With v what the sensors leave of a channel's residual, |sum h v| <= |h| |v| (Cauchy and Schwarz, ``endogeneity``).

    ``unexplained``: channels, and the share of their residuals' power that is no sensor's noise.
    """
    total = np.zeros((found.slopes[0].shape[2],) * 2)
    for c, share in unexplained:
        power = share * sum(float(np.sum(e[:, c] ** 2)) for e in found.left)
        total += power * sum(s[:, c].T @ s[:, c] for s in found.slopes)
    return total
