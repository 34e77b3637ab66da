"""What the estimators that work on files share: equations as regressions, their correction for noise, the report.

Every equation is linear in its derivatives,

    y = d(state)/dt - known kinematics   or   y = accelerometer + levers times angular accelerations,
    y = R theta + constant * pressure,

and both sides are measured with noise n of variance D, so that the residual is e = L n. Least squares takes the noise
in R for signal; what it is expected to add is taken away again (docs/methods/offline.md, section 2).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.estimate import Estimate, Outcome
from wingwatch.estimators.offline.fit import ChannelFit, Fit, confidence_interval, correlation
from wingwatch.estimators.offline.manoeuvre import Manoeuvre, ManoeuvreConfig
from wingwatch.estimators.offline.smoothing import white_noise_std
from wingwatch.estimators.reference import offsets, referred_scale
from wingwatch.estimators.standing import ConcisePosterior, assess

__all__ = [
    "Equations",
    "LeftOver",
    "ReferredEstimate",
    "Solution",
    "SolverReport",
    "common_forces",
    "corrected_step",
    "equation_names",
    "equations",
    "finished",
    "left_over",
    "NoiseModel",
    "noise_model",
    "noise_names",
    "plain_start",
    "sensor_noise",
    "shared_config",
    "signal_share",
    "stated_noise",
]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_STILL = 1e-18
"""Of the largest power: a regressor with less has not moved but for rounding."""

_FLAT = 1e-9
"""Of the largest eigenvalue of the regressors' correlation: what is less is one column given by others."""

_LEAST_SHARE = 0.2
"""A direction in which less than this share of the regressors' power is signal is dropped."""


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Noise of both sides of the equations from that of states, accelerometers and inputs, by frequency.

    Attributes:
        of_regressors: (bins, states + inputs, noises): a sensor's own each, but a reconstructed velocity's is the
            integral of that of the accelerometer and of the measured rates in its kinematics (7.2). (What the ends of
            the integral add is a drift.)
        plain: how y answers to errors of the states, (bins, equations, states).
        left: of y, (bins, equations, noises).
    """

    of_regressors: Complex
    plain: Complex
    left: Complex

    def residual(self, scaled: Array) -> Complex:
        """L of e = L n for concise derivatives times the regressors' scale, (equations, regressors)."""
        return np.asarray(self.left - scaled @ self.of_regressors)


_LARGE, _TELLING = 0.1, 1.5
"""See ``left_over``."""


@dataclass(frozen=True, slots=True)
class LeftOver:
    """A channel of which too much is neither the model's nor the sensors'.

    Attributes:
        name: of the channel; share: of its variance.
        concerns: derivatives that cannot be trusted for it.
    """

    name: str
    share: float
    concerns: slice


@dataclass(frozen=True, slots=True)
class Solution:
    """A step of the corrected least squares.

    Attributes:
        step: (k,).
        inverse: of M - N, dropped directions as if they had the least share, for covariances, (k, k).
        hidden: derivatives whose error would be mostly that of dropped directions, (k,).
    """

    step: Array
    inverse: Array
    hidden: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ReferredEstimate:
    """Referred derivatives as an estimator found them.

    Attributes:
        value: (k,).
        white: covariance for white sensor noise, (k, k); coloured: for the residuals as they are, (k, k).
        use_coloured: whether the second counts.
        hidden: derivatives that the data do not determine, (k,).
    """

    value: Array
    white: Array
    coloured: Array
    use_coloured: bool
    hidden: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class SolverReport:
    """How the solution was reached.

    Attributes:
        samples: rows used.
        parameters: unknowns in all, trims and initial states included.
        iterations: of the solution; converged: whether it came to rest.
        freedom: degrees of freedom that are left.
    """

    samples: int
    parameters: int
    iterations: int
    converged: bool
    freedom: float


@dataclass(frozen=True, slots=True)
class Equations:
    """The equations of one manoeuvre before any smoothing or transform.

    Attributes:
        direct: part of y that needs no derivative, (n, equations).
        rates: y's coefficients of the states' derivatives, (equations, states).
        regressors: R, the same for every equation, (n, states + inputs).
        trims: columns with a coefficient of their own in this manoeuvre, (n, trims).
        forces: which equations rest on an accelerometer, (equations,).
        gain: L's part that multiplies the states, less the aerodynamics: minus the mean known kinematics,
            (equations, states).
    """

    direct: Array
    rates: Array
    regressors: Array
    trims: Array
    forces: NDArray[np.bool_]
    gain: Array


def shared_config(parts: Sequence[Manoeuvre]) -> ManoeuvreConfig:
    """The config of all manoeuvres.

    Raises:
        ValueError: no manoeuvre, or different structures or references.
    """
    if not parts:
        raise ValueError(
            "there is no manoeuvre to estimate from; give a flight with 2 s of whole samples or more"
        )
    first = parts[0].config
    if any(p.config.structure != first.structure or p.config.reference != first.reference for p in parts):
        raise ValueError("the manoeuvres have different structures or references; make them with one config")
    return first


def common_forces(parts: Sequence[Manoeuvre]) -> NDArray[np.bool_]:
    """Equations that have an accelerometer in every manoeuvre, (equations,)."""
    return np.asarray(np.all([p.forces for p in parts], axis=0))


def equations(part: Manoeuvre, forces: NDArray[np.bool_], drift: bool) -> Equations:
    """The equations of a manoeuvre: those of ``forces`` (equations,) by accelerometer, the others by the state's
    derivative; ``drift``: with a term that grows with time."""
    s = part.config.structure
    ne, ns = len(s.equations), len(s.states)
    rates = np.where(forces[:, None], part.config.lever_m, np.eye(ne, ns))
    kinematic = -(np.einsum("nij,nj->ni", part.known, part.states) + part.rest)[:, :ne]
    direct = np.where(forces, part.accelerometer, kinematic)
    gain = np.where(forces[:, None], 0.0, -part.known.mean(axis=0)[:ne])
    along = np.linspace(-0.5, 0.5, len(part))
    trims = [part.pressure, part.pressure * along] if drift else [part.pressure]
    return Equations(direct, rates, part.regressors, np.column_stack(trims), forces, gain)


def equation_names(config: ManoeuvreConfig, forces: NDArray[np.bool_]) -> list[str]:
    """Name of each equation's left side: ``a_z`` where ``forces`` (equations,) is true, else ``dw/dt`` and so on."""
    s = config.structure
    return [
        f"a_{row}" if by_accelerometer else f"d{state}/dt"
        for row, state, by_accelerometer in zip(s.equations, s.states, forces, strict=True)
    ]


def sensor_noise(parts: Sequence[Manoeuvre], forces: NDArray[np.bool_]) -> Array:
    """Variances of white noise of states, accelerometers and inputs, (states + equations + inputs,), each from
    its third differences, in the squares of the channels' SI units.

    A reconstructed velocity is an integral and has none; an accelerometer that is not used and a held input have 0.
    """
    moving = ~np.array(parts[0].config.held, dtype=bool)
    squares, weights = [], []
    for part in parts:
        even = part.even()
        columns = np.column_stack([even.states, even.accelerometer, even.inputs])
        used = np.concatenate([part.measured, forces, moving])
        squares.append([white_noise_std(columns[:, j]) ** 2 if used[j] else 0.0 for j in range(used.size)])
        weights.append(len(part))
    return np.asarray(np.average(np.array(squares), axis=0, weights=weights))


def stated_noise(parts: Sequence[Manoeuvre], forces: NDArray[np.bool_], noise_std: Sequence[float]) -> Array:
    """Variances as of ``sensor_noise``, (states + equations + inputs,), from ``noise_std`` if that is not empty.

    ``noise_std``: standard deviations in the channels' SI units, in this order.

    Raises:
        ValueError: another number of entries.
    """
    if not noise_std:
        return sensor_noise(parts, forces)
    s = parts[0].config.structure
    wanted = len(s.states) + len(s.equations) + len(s.inputs)
    if len(noise_std) != wanted:
        raise ValueError(
            f"noise_std has {len(noise_std)} entries; give {wanted}: states, accelerometers, inputs"
        )
    return np.square(np.asarray(noise_std, dtype=np.float64))


def noise_model(part: Manoeuvre, eq: Equations, s: Complex) -> NoiseModel:
    """How the regressors' and the equations' noise follow from the sensors' at s = j omega, rad/s, (bins,)."""
    (ne, ns), width = eq.rates.shape, part.regressor_scale.size
    noises = ns + ne + width - ns
    of_regressors = np.zeros((s.size, width, noises), dtype=np.complex128)
    of_regressors[:, range(width), [*range(ns), *range(ns + ne, noises)]] = 1.0
    for i in np.flatnonzero(~part.measured & np.pad(eq.forces, (0, ns - ne))):
        turn = part.known[:, i].mean(axis=0)
        turn[i] = 0.0
        of_regressors[:, i] = 0.0
        of_regressors[:, i, :ns] = turn / s[:, None]
        of_regressors[:, i, ns + i] = 1.0 / s
    plain = s[:, None, None] * eq.rates + eq.gain
    left = plain @ of_regressors[:, :ns]
    left[:, np.arange(ne), ns + np.arange(ne)] += eq.forces
    return NoiseModel(of_regressors, plain, left)


def noise_names(config: ManoeuvreConfig) -> list[str]:
    """Names of the entries of ``sensor_noise``."""
    s = config.structure
    return [*s.states, *(f"a_{row}" for row in s.equations), *s.inputs]


def plain_start(parts: Sequence[Manoeuvre]) -> Array:
    """Referred derivatives, concise, by plain least squares on central differences, (k,): a start for iterations."""
    config = shared_config(parts)
    ne = len(config.structure.equations)
    forces = common_forces(parts)
    width = len(config.structure.regressors)
    matrix, vector = np.zeros((width, width)), np.zeros((width, ne))
    for part in parts:
        eq = equations(part, forces, drift=False)
        slope = np.gradient(part.states, part.time_s, axis=0)
        y, x = eq.direct + slope @ eq.rates.T, eq.regressors
        q, _ = np.linalg.qr(eq.trims)
        y, x = y - q @ (q.T @ y), x - q @ (q.T @ x)
        matrix += x.T @ x
        vector += x.T @ y
    scale = np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
    solved = np.linalg.lstsq(matrix / np.outer(scale, scale), vector / scale[:, None], rcond=1e-12)[0]
    return np.asarray((solved / scale[:, None]).T.reshape(-1))


def corrected_step(matrix: Array, noise: Array, score: Array, least_share: float) -> Solution:
    """(M - N)^-1 score over the directions that carry signal.

    In coordinates that whiten M the eigenvalues of M - N are the shares of signal in the regressors' power.

    Args:
        matrix: M, information with the noise in it, (k, k).
        noise: N, what noise is expected to contribute to it, (k, k).
        score: (k,).
        least_share: of signal, below which a direction is dropped (``signal_share``).
    """
    diagonal = np.diagonal(matrix)
    scale = np.sqrt(np.where(diagonal > _STILL * diagonal.max(), diagonal, np.inf))
    whole, part = matrix / np.outer(scale, scale), noise / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(whole)
    root = vectors / np.sqrt(np.maximum(values, _FLAT * values[-1]))
    scale = np.where(np.isfinite(scale), scale, math.sqrt(_STILL * diagonal.max()))
    shares, turned = np.linalg.eigh(np.eye(values.size) - root.T @ part @ root)
    basis = root @ turned / scale[:, None]
    sound = np.einsum("kj,kl,lj->j", basis, matrix, basis) > 0.5
    kept = (shares >= least_share) & sound
    own = (basis[:, kept] / shares[kept]) ** 2
    lost = (basis[:, ~kept] / least_share) ** 2
    inverse = (basis[:, kept] / shares[kept]) @ basis[:, kept].T
    wide = inverse + (basis[:, ~kept] / least_share) @ basis[:, ~kept].T
    return Solution(inverse @ score, wide, np.asarray(lost.sum(axis=1) > own.sum(axis=1)))


def signal_share(regressors: int, values: float) -> float:
    """Share of signal that chance alone may show, at least a fifth.

    The largest eigenvalue of p channels of noise over B complex values tends to (1 + sqrt(p / B))^2 (Marchenko and
    Pastur 1967).
    """
    chance = 1.0 - (1.0 + math.sqrt(regressors / max(values, 1.0))) ** -2
    return max(_LEAST_SHARE, chance)


def left_over(channel: ChannelFit, noise_variance: float, concerns: slice) -> LeftOver | None:
    """Whether a channel is explained by the model and the sensors' noise; None where it is.

    The model does not hold where over a tenth of the channel's variance is neither, and chance cannot make it so: the
    residual is over 1.5 times what noise makes it, both of them known to a tenth.
    """
    square = channel.residual_std**2
    if square <= _TELLING * noise_variance:
        return None
    share = (1.0 - channel.r_squared) * (1.0 - noise_variance / square)
    return LeftOver(channel.name, share, concerns) if share > _LARGE else None


def finished(
    name: str,
    parts: Sequence[Manoeuvre],
    referred: ReferredEstimate,
    channels: tuple[ChannelFit, ...],
    noise_std: Mapping[str, float],
    solver: SolverReport,
    natural: Array | None,
    left_over: Sequence[LeftOver | None],
) -> tuple[Estimate, Fit]:
    """Estimate and statistics from referred derivatives and their covariances.

    A derivative is converged, settling or not observable as online (``standing``); ``natural`` (k,) is its
    natural size (its own value where None), and ``left_over`` what rejects derivatives because the model does not
    hold. ``noise_std``: by channel, in SI units.
    """
    config = parts[0].config
    structure = config.structure
    condition = np.average([p.condition for p in parts], axis=0, weights=[p.duration_s for p in parts])
    airspeed, _, density, alpha = condition
    scale = referred_scale(structure, airspeed, density, config.reference)
    value = referred.value * scale + offsets(structure, airspeed, alpha)
    white, coloured, hidden = referred.white, referred.coloured, referred.hidden
    if (np.diagonal(coloured) <= 0.0).any():  # rounding, where the data determine next to nothing
        coloured = white
    plain, wide = white * np.outer(scale, scale), coloured * np.outer(scale, scale)
    covariance = wide if referred.use_coloured else plain
    size = np.abs(value) if natural is None else np.asarray(natural, dtype=np.float64)
    end = float(parts[-1].time_s[-1])
    informed = np.where(hidden, -np.inf, end)
    posterior = ConcisePosterior(value[None], covariance[None], 3.0 * size[None])
    validity = assess(
        structure, np.array([end]), posterior, informed[None], np.inf, np.array([True]), condition[None]
    ).of(0)
    estimate = validity.estimate(name, structure)
    estimate = _named(_rejected(estimate, [found for found in left_over if found is not None]), hidden)
    fit = Fit(
        channels, correlation(estimate.covariance),
        confidence_interval(estimate.value, estimate.covariance, solver.freedom), plain, wide, referred.use_coloured,
        dict(noise_std), solver.samples, len(parts), solver.parameters, solver.iterations,
        solver.converged,
    )  # fmt: skip
    return estimate, fit


def _rejected(estimate: Estimate, left_over: Sequence[LeftOver]) -> Estimate:
    """Derivatives of a model that does not hold are rejected, and why is said."""
    if not left_over:
        return estimate
    outcomes = list(estimate.outcomes)
    for found in left_over:
        outcomes[found.concerns] = [Outcome.REJECTED] * len(outcomes[found.concerns])
    shares = ", ".join(f"{100.0 * f.share:.0f} % of {f.name}" for f in left_over)
    verb = "is" if len(left_over) == 1 else "are"
    reason = (
        f"{shares} {verb} neither the model's nor the sensors' noise (rough air, or motion that is left out)"
    )
    most = 2 * outcomes.count(Outcome.REJECTED) > len(outcomes)
    outcome = Outcome.REJECTED if most else estimate.outcome
    return replace(estimate, outcomes=tuple(outcomes), outcome=outcome, reason=reason)


def _named(estimate: Estimate, hidden: NDArray[np.bool_]) -> Estimate:
    """Derivatives that the data do not determine are named instead of given."""
    if not hidden.any():
        return estimate
    value, covariance = estimate.value.copy(), estimate.covariance.copy()
    value[hidden] = np.nan
    covariance[hidden] = covariance[:, hidden] = 0.0
    covariance[hidden, hidden] = np.inf
    names = [d for d, h in zip(estimate.structure.derivatives, hidden, strict=True) if h]
    outcomes = tuple(
        Outcome.NOT_OBSERVABLE if h else o for h, o in zip(hidden, estimate.outcomes, strict=True)
    )
    outcome = Outcome.NOT_OBSERVABLE if 2 * len(names) > len(outcomes) else estimate.outcome
    why = f"; {estimate.reason}" if Outcome.REJECTED in estimate.outcomes else ""
    reason = f"not distinguished, or not moved: {', '.join(names)}{why}"
    return replace(
        estimate, value=value, covariance=covariance, outcomes=outcomes, outcome=outcome, reason=reason
    )
