"""Filter error: maximum likelihood with sensor noise, moving air and unmeasured moments, on files.

Output error with a Kalman filter between model and data (Jategaonkar 2006, chapter 5): the innovations' full
likelihood, with gains and innovation variances as functions of the parameters. Derivation, priors and guards:
docs/methods/filter_error.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.estimate import Estimate, Outcome
from wingwatch.estimators.offline.fit import Fit
from wingwatch.estimators.offline.guards import guarded
from wingwatch.estimators.offline.likelihood import Prior, Problem, channel_fits
from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.parameters import Model
from wingwatch.estimators.offline.regression import (
    ReferredEstimate,
    SolverReport,
    common_forces,
    finished,
    plain_start,
    sensor_noise,
    shared_config,
)
from wingwatch.estimators.offline.scoring import Solution, solve
from wingwatch.estimators.offline.window import Window, window
from wingwatch.estimators.plant.motion import Plant

__all__ = ["FilterErrorConfig", "filter_error", "problem_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FilterErrorConfig:
    """What the filter is given besides the data.

    Attributes:
        span_m: of the wing; makes the time constants of gusts' gradients, 4 b / (pi V) for pitch and roll, 3 b / (pi V)
            for yaw (MIL-F-8785C).
        vane_ahead_m: how far the vane is ahead of the centre of gravity.
        input_noise_std: of each measured input, rad; from the readings' third differences where empty. Surfaces that an
            autopilot makes jitter look noisier than their sensors are: say it where it is known.
        prior_ratio: standard deviation of the derivatives' prior, in natural sizes.
    """

    span_m: float = 2.9
    vane_ahead_m: float = 0.0
    input_noise_std: tuple[float, ...] = ()
    prior_ratio: float = 3.0


NAME = "filter-error"

_GUST_SCALE_M = 100.0
"""Expected scale length of gusts; estimated, known to a factor of e."""

_FASTEST_GROWTH = 1.0
"""Motion that grows faster than this, 1/s, is none of an aircraft that is flown."""

_INTENSITY = 3.0
"""Standard deviation of the ln of unknown intensities: they are known to a factor of twenty."""

_CONTRADICTED = 3.0
"""Root of the chi-square per degree of freedom of what surfaces drive, from which on nothing is converged: the two
sources of information contradict each other by so much that no widened error covers it."""


def filter_error(
    parts: Sequence[Manoeuvre],
    config: FilterErrorConfig | None = None,
    *,
    expected: Array | None = None,
    natural: Array | None = None,
) -> tuple[Estimate, Fit]:
    """Derivatives by filter error.

    Args:
        parts: manoeuvres of one config, of short period, Dutch roll or lateral.
        config: see there.
        expected: referred aerodynamic derivatives as expected beforehand, (k,): mean of the prior; equation error
            (5.12) where None.
        natural: natural size of each concise derivative, (k,), for prior and outcome; that of ``expected`` where None.

    Returns:
        Estimate at the mean condition of the manoeuvres with its guarded covariance, and the statistics of the fit:
        ``covariance_white`` is that of the likelihood, ``covariance_coloured`` the guarded one. What the data do not
        inform keeps prior value and error, and is not observable.

    Raises:
        ValueError: no manoeuvre, manoeuvres of different configs, another structure, or no likelihood at the start.
    """
    problem = problem_of(parts, config or FilterErrorConfig(), expected, natural)
    solution = solve(problem)
    if solution is None:
        raise ValueError(
            "the filter diverges from the flight when it starts at the file's derivatives; check units and signs of "
            "the channels, and the aircraft file"
        )
    return _report(parts, problem, solution)


def _report(parts: Sequence[Manoeuvre], problem: Problem, solution: Solution) -> tuple[Estimate, Fit]:
    at, guards = problem.model.layout, guarded(problem, solution)
    k, size = at.theta.stop, problem.model.natural
    p = solution.point.parameters
    plain = solution.covariance[:k, :k] * np.outer(size, size)
    # what is known beforehand stays known, whatever the data
    most = np.sqrt(np.maximum(problem.prior.std[:k] ** 2 / np.diagonal(solution.covariance)[:k], 1.0))
    factors = np.minimum(guards.factors, most)
    channels, _ = channel_fits(problem, solution.point, np.zeros(problem.model.plant.channels))
    used = int(sum(np.count_nonzero(w.used) for w in problem.windows))
    unknowns = int(np.count_nonzero(problem.free)) + sum(own.size for own in solution.point.own)
    noise = np.sqrt(problem.model.noise(p) + np.mean([w.floor for w in problem.windows], axis=0))
    referred = ReferredEstimate(
        p[at.theta] * size, plain, plain * np.outer(factors, factors), True, np.zeros(k, dtype=np.bool_)
    )
    solver = SolverReport(
        sum(map(len, problem.windows)),
        unknowns,
        solution.iterations,
        solution.converged,
        float(used - unknowns),
    )
    noise_std = dict(zip(problem.model.plant.channel_names, noise.tolist(), strict=True))
    estimate, fit = finished(NAME, parts, referred, channels, noise_std, solver, size, ())
    if not solution.converged:
        return _unsettled(estimate, "the search for the most likely derivatives did not come to rest"), fit
    if guards.driven > _CONTRADICTED:
        return _unsettled(estimate, "what the surfaces did contradicts what rough air and the rest say"), fit
    if solution.gusts and problem.model.plant.rolling_air:
        first = len(problem.model.plant.structure.regressors)
        return _unsettled(estimate, "moments of rolling air are not modelled well enough", first), fit
    return estimate, fit


def problem_of(
    parts: Sequence[Manoeuvre], config: FilterErrorConfig, expected: Array | None, natural: Array | None
) -> Problem:
    """Windows, model and prior of a call.

    ``expected``, ``natural``: referred derivatives and their natural sizes, (k,), concise; None: by least squares.

    Raises:
        ValueError: a structure that is none of short period, Dutch roll and lateral.
    """
    shared = shared_config(parts)
    s = shared.structure
    if s.states not in (("w", "q"), ("v", "r"), ("v", "p", "r")):
        raise ValueError(
            f"filter error estimates short_period, dutch_roll and lateral; {s.name} has other states"
        )
    forces = np.flatnonzero(common_forces(parts))
    input_noise = _input_noise(parts, config)
    windows = [window(p, forces, input_noise, deviations=True) for p in parts]
    mean = plain_start(parts) if expected is None else np.asarray(expected, dtype=np.float64)
    size = np.abs(mean) if natural is None else np.asarray(natural, dtype=np.float64)
    size = np.maximum(size, 1e-6)
    airspeed = float(np.mean([w.airspeed_m_s for w in windows]))
    plant = Plant(s, forces, shared.lever_m, config.vane_ahead_m, 4.0 * config.span_m / (math.pi * airspeed))
    model = Model(plant, True, size, _FASTEST_GROWTH)
    free = np.ones(model.parameters, dtype=np.bool_)
    return Problem(windows, model, _prior(model, windows, mean, config), free)


def _input_noise(parts: Sequence[Manoeuvre], config: FilterErrorConfig) -> Array:
    """Noise variance of each measured input, (inputs,): as the sensors' data say, else from third differences.

    Raises:
        ValueError: another number of entries.
    """
    shared = parts[0].config
    inputs = len(shared.structure.inputs)
    if not config.input_noise_std:
        return sensor_noise(parts, common_forces(parts))[-inputs:]
    if len(config.input_noise_std) != inputs:
        raise ValueError(
            f"input_noise_std has {len(config.input_noise_std)} entries; {shared.structure.name} has {inputs} inputs"
        )
    return np.where(shared.held, 0.0, np.square(config.input_noise_std))


def _prior(model: Model, windows: Sequence[Window], mean: Array, config: FilterErrorConfig) -> Prior:
    at, size = model.layout, model.parameters
    ns = model.plant.states
    airspeed = float(np.mean([w.airspeed_m_s for w in windows]))
    centre, std, step = np.zeros(size), np.ones(size), np.full(size, 1e-3)
    centre[at.theta], std[at.theta], step[at.theta] = mean / model.natural, config.prior_ratio, 1e-4
    copied = centre[at.theta].reshape(ns, -1)[:, :ns].ravel()
    centre[at.copy], std[at.copy], step[at.copy] = copied, 1.0, 1e-4
    centre[at.log_noise], std[at.log_noise] = np.log(_roughness(windows)), 3.0
    centre[at.gust], std[at.gust] = math.log(0.02 * airspeed), _INTENSITY
    centre[at.gust_rate_gain], step[at.gust_rate_gain] = 1.0, 1e-4
    shape = 4.0 if model.plant.structure.states[0] == "w" else 3.0
    times = shape * config.span_m / (math.pi * airspeed), _GUST_SCALE_M / airspeed, 0.5
    centre[at.log_times], std[at.log_times.start] = np.log(times), 0.7
    centre[at.disturbance] = np.log(_disturbances(model, 0.02 * airspeed, config))
    std[at.disturbance] = _INTENSITY
    return Prior(centre, std, centre.copy(), step)


def _disturbances(model: Model, gust: float, config: FilterErrorConfig) -> Array:
    """Expected intensities: moments as of a fifth of a degree of the strongest surface, rolling air as gusts make it
    (MIL-F-8785C)."""
    ns = model.plant.states
    surfaces = model.natural.reshape(ns, -1)[1:, ns:].max(axis=1) * math.radians(0.2)
    if not model.plant.rolling_air:
        return np.asarray(surfaces)
    return np.append(surfaces, 1.9 * gust / math.sqrt(_GUST_SCALE_M * config.span_m))


def _roughness(windows: Sequence[Window]) -> Array:
    """Noise variance of each channel by the median square of its second differences, (channels,)."""
    channels = windows[0].readings.shape[1]
    floor = np.max([w.floor for w in windows], axis=0)
    rough = np.zeros(channels)
    for c in range(channels):
        squares = [np.diff(w.readings[w.used[:, c], c], 2) ** 2 for w in windows]
        every = np.concatenate(squares)
        # a normal variable's squares have a median of 0.455 of their mean; second differences six times the variance
        rough[c] = np.median(every) / (0.455 * 6.0) if every.size else 1.0
    return np.asarray(np.maximum(rough, np.maximum(floor, 1e-12)))


def _unsettled(estimate: Estimate, reason: str, first: int = 0) -> Estimate:
    """The same, but none of the derivatives from ``first`` on converged; ``reason`` says why."""
    outcomes = tuple(
        Outcome.SETTLING if o is Outcome.CONVERGED and k >= first else o
        for k, o in enumerate(estimate.outcomes)
    )
    outcome = Outcome.SETTLING if estimate.outcome is Outcome.CONVERGED else estimate.outcome
    reasons = f"{reason}; {estimate.reason}" if estimate.reason else reason
    return replace(estimate, outcomes=outcomes, outcome=outcome, reason=reasons)
