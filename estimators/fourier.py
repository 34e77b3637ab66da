"""Recursive Fourier least squares: an exact bank of one-pole filters, blocks, and their information added up.

Thesis chapter 9 transforms samples recursively and solves least squares twice a second. Here the transform is
exact for a signal that is linear between samples, trim and drift are regressors, both equations are weighted
jointly with the noise in the regressors accounted for, and the noise variances come from the residual.
The derivation, with what each step gains, is in ``docs/estimators.md``.

A block is the rectangular window of ``block_s``; when it ends, its information is added to what is known, which
is forgotten with ``memory_s`` unless all has been quiet for ``stale_s``.
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.estimate import BlockEvidence, Estimate
from wingwatch.estimators.fourier_kernel import (
    LOWEST_NOISE,
    advance_bank,
    block_equations,
    noise_edge,
    noise_update,
    reduce_information,
)
from wingwatch.estimators.reference import offsets, referred_scale, standing
from wingwatch.estimators.signals import MAX_GAP_S, SignalLayout

__all__ = ["FourierConfig", "FourierEstimator", "FourierState"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FourierConfig:
    """How the Fourier estimator works on one structure.

    Attributes:
        structure: which mode.
        band_hz: lowest and highest frequency used.
        prior_value: shape (k,), aerodynamic derivatives (no forward speed inside) to start from, at the
            reference condition.
        prior_std: shape (k,), so wide that it only keeps the solution finite where the data say nothing.
        reference: (airspeed_true_m_s, air_density_kg_m3) to which derivatives are referred.
        block_s: length of a block; bins are spaced by its inverse.
        memory_s: time constant of forgetting while something is excited; long quiet forgets nothing.
        first_solution_s: time of data before the first solution (thesis 9.2: 2 s).
        stale_s: without excitation for this long a derivative is not observable.
        held: for each input, whether it is held between samples (a command) rather than linear (a position).
        force_from_accelerometer: force equation from the accelerometer; else from the velocity's rate.
        imu_position_m: (x, y, z) of the accelerometer from the c.g.
        input_noise_std: of each measured input, rad; not more than the input's own roughness is believed.
        smallest_share: share of signal in the regressors' power below which a direction counts as unseen (more
            where the bins are so few that noise alone may look like it).
    """

    structure: ModeStructure
    band_hz: tuple[float, float]
    prior_value: Array
    prior_std: Array
    reference: tuple[float, float]
    block_s: float = 10.0
    memory_s: float = 40.0
    first_solution_s: float = 2.0
    stale_s: float = 30.0
    held: tuple[bool, ...] = ()
    force_from_accelerometer: bool = True
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    input_noise_std: tuple[float, ...] = ()
    smallest_share: float = 0.5
    omega_rad_s: Array = field(init=False)

    def __post_init__(self) -> None:
        low, high = self.band_hz
        if not 0.0 < low < high:
            raise ValueError(f"band_hz is {self.band_hz}; it must be 0 < low < high")
        first = max(1, round(low * self.block_s))
        last = round(high * self.block_s)
        bins = 2.0 * np.pi * np.arange(first, last + 1) / self.block_s
        object.__setattr__(self, "omega_rad_s", bins)
        if not self.held:
            object.__setattr__(self, "held", (False,) * len(self.structure.inputs))
        if not self.input_noise_std:
            object.__setattr__(self, "input_noise_std", (0.0,) * len(self.structure.inputs))


@dataclass(slots=True)
class FourierState:
    """Everything the estimator remembers, one row a vehicle (shapes after the leading vehicle axis).

    Attributes:
        bank: (frequencies, channels) transforms of the block; decay: (frequencies,) its phase.
        coefficients, step: one-pole coefficients (4, frequencies) and the time step they are for.
        rows: (3, columns) signal rows at the block's start, the last and the one before.
        sums: airspeed, density, altitude, angle of attack over the block, count; squared second differences of the
            inputs and their count.
        roughness: squared second differences of states and accelerometer over the block, and their count.
        theta, noise: current referred derivatives (k,) and noise variances.
        noise_known: (variances..., weight) gathered from closed blocks.
        sensitivity, information, vector, driven: what closed blocks said, (k, k), (k, k), (k,), (k,).
        covariance: of theta, (k, k).
        informed_s: last time each derivative's regressor carried signal, (k,).
        evidence_matrix, evidence_vector, evidence_bias, evidence_span: of the last closed block, for the monitor.
        condition: airspeed, altitude, density, angle of attack that theta is reported at.
        counts: solutions so far, blocks closed.
    """

    bank: NDArray[np.complex128]
    decay: NDArray[np.complex128]
    coefficients: NDArray[np.complex128]
    step: Array
    rows: Array
    sums: Array
    roughness: Array
    theta: Array
    noise: Array
    noise_known: Array
    sensitivity: Array
    information: Array
    vector: Array
    driven: Array
    covariance: Array
    informed_s: Array
    evidence_matrix: Array
    evidence_vector: Array
    evidence_bias: Array
    evidence_span: Array
    condition: Array
    counts: NDArray[np.int64]


class FourierEstimator:
    """The estimator: ``init``, ``update``, ``solve``, ``estimate``; a batch of vehicles at a time."""

    name = "fourier"

    def __init__(self, config: FourierConfig) -> None:
        self.config = config
        self.layout = SignalLayout(len(config.structure.states), len(config.structure.inputs))

    def init(self, vehicles: int) -> FourierState:
        """State before the first sample."""
        c, n = self.config, vehicles
        ns, nu, k = self.layout.states, self.layout.inputs, len(c.structure.derivatives)
        nf = c.omega_rad_s.size
        noise = np.ones((n, 2 * ns + 1 + nu))
        noise[:, 2 * ns + 1 :] = 0.0
        return FourierState(
            bank=np.zeros((n, nf, ns + nu + 4), dtype=np.complex128),
            decay=np.ones((n, nf), dtype=np.complex128),
            coefficients=np.zeros((n, 4, nf), dtype=np.complex128),
            step=np.full((n, 1), -1.0),
            rows=np.full((n, 3, self.layout.columns), np.nan),
            sums=np.zeros((n, 6 + nu)),
            roughness=np.zeros((n, ns + 2)),
            theta=np.tile(c.prior_value, (n, 1)),
            noise=noise,
            noise_known=np.zeros((n, 2 * ns + 2 + nu)),
            sensitivity=np.zeros((n, k, k)),
            information=np.zeros((n, k, k)),
            vector=np.zeros((n, k)),
            driven=np.zeros((n, k)),
            covariance=np.tile(np.diag(c.prior_std**2), (n, 1, 1)),
            informed_s=np.full((n, k), -np.inf),
            evidence_matrix=np.zeros((n, k, k)),
            evidence_vector=np.zeros((n, k)),
            evidence_bias=np.zeros((n, k)),
            evidence_span=np.full((n, 6), np.nan),
            condition=np.full((n, 4), np.nan),
            counts=np.zeros((n, 2), dtype=np.int64),
        )

    def update(self, state: FourierState, signals: Array) -> None:
        """Take in samples; blocks that become full are closed.

        Args:
            state: advanced in place.
            signals: shape (vehicles, samples, columns) from ``Signals``; rows with a missing value are passed over.
        """
        _update(np.ascontiguousarray(signals), *self._arguments(state))

    def solve(self, state: FourierState) -> None:
        """Bring ``theta`` and its covariance up to the last sample (the thesis does it at 2 Hz)."""
        _solve_all(*self._arguments(state))

    def estimate(self, state: FourierState, vehicle: int = 0) -> Estimate:
        """Concise derivatives of one vehicle as of the last solution, at its present flight condition."""
        c = self.config
        condition = state.condition[vehicle]
        scale = referred_scale(c.structure, condition[0], condition[2], c.reference)
        value = state.theta[vehicle] * scale + offsets(c.structure, condition[0], condition[3])
        covariance = state.covariance[vehicle] * np.outer(scale, scale)
        time_s = float(state.rows[vehicle, 1, 0])
        return standing(
            self.name, c.structure, time_s, value, covariance, state.informed_s[vehicle], c.stale_s,
            c.prior_std * scale, bool(state.counts[vehicle, 0]), condition,
        )  # fmt: skip

    def evidence(self, state: FourierState, vehicle: int = 0) -> BlockEvidence:
        """What the last closed block said, for the monitor's sequential test."""
        span = state.evidence_span[vehicle]
        return BlockEvidence(
            blocks=int(state.counts[vehicle, 1]),
            start_s=float(span[0]),
            end_s=float(span[1]),
            information=state.evidence_matrix[vehicle].copy(),
            vector=state.evidence_vector[vehicle].copy(),
            bias=state.evidence_bias[vehicle].copy(),
            condition=(float(span[2]), float(span[3]), float(span[4]), float(span[5])),
        )

    def _arguments(self, s: FourierState):  # type: ignore[no-untyped-def]
        c = self.config
        lever = np.zeros(self.layout.states)
        x, _, z = c.imu_position_m
        if c.structure.equations[0] == "z":
            lever[1] = x
        else:
            lever[-1] = -x
            if self.layout.states == 3:
                lever[1] = z
        exponents = np.array([1.0] * self.layout.states + [2.0] * self.layout.inputs)
        settings = np.array(
            [c.block_s, c.first_solution_s, c.memory_s, c.smallest_share, *c.reference, c.stale_s,
             *np.square(c.input_noise_std)]
        )  # fmt: skip
        roll = self.layout.states == 3
        return (
            c.omega_rad_s, np.array(c.held), lever, c.force_from_accelerometer, exponents, settings, c.prior_value,
            c.prior_std, c.structure.equations[0] == "z", roll, s.bank, s.decay, s.coefficients, s.step, s.rows,
            s.sums, s.roughness, s.theta, s.noise, s.noise_known, s.sensitivity, s.information, s.vector,
            s.driven, s.covariance, s.informed_s, s.evidence_matrix, s.evidence_vector, s.evidence_bias,
            s.evidence_span, s.condition, s.counts,
        )  # fmt: skip


@njit(cache=True)
def _noise_start(roughness, noise, ns):  # type: ignore[no-untyped-def]
    """First variances from second differences, whose variance is 6 D for white noise."""
    floor = np.full(ns + 1, 1e-10)
    floor[0] = floor[ns] = 1e-8
    for j in range(ns + 1):
        noise[j] = max(roughness[j] / (6.0 * max(roughness[ns + 1], 1.0)), floor[j])
    for k in range(ns):
        noise[ns + 1 + k] = noise[k]


@njit(cache=True)
def _floor_noise(noise, ns):  # type: ignore[no-untyped-def]
    """Below any sensor's resolution nothing is gained: 1e-4 m/s and m/s2, 1e-5 rad/s."""
    for j in range(2 * ns + 1):
        least = 1e-8 if j in (0, ns, ns + 1) else 1e-10
        noise[j] = max(noise[j], least)


@njit(cache=True)
def _present(sums, settings, exponents, longitudinal, roll, ns):  # type: ignore[no-untyped-def]
    """Scale from referred to present derivatives, and the kinematic part per state, at the block's mean condition."""
    airspeed, density, alpha = sums[0] / sums[4], sums[1] / sums[4], sums[3] / sums[4]
    pressure = density * airspeed / (settings[5] * settings[4])
    columns = exponents.size
    scale = np.empty(ns * columns)
    for k in range(ns):
        for c in range(columns):
            scale[k * columns + c] = pressure if exponents[c] == 1.0 else pressure * airspeed / settings[4]
    forward = np.zeros(ns)
    forward[ns - 1] = airspeed * np.cos(alpha) * (1.0 if longitudinal else -1.0)
    if roll:
        forward[1] = airspeed * np.sin(alpha)
    return scale, forward


@njit(cache=True)
def _believe(noise, fresh, noise_known, share, roughness, by_accelerometer, ns):  # type: ignore[no-untyped-def]
    """Noise variances from this block's residual and from earlier blocks, by the time each rests on."""
    known = noise_known[-1]
    for j in range(2 * ns + 1):
        noise[j] = (known * noise_known[j] + share * fresh[j]) / (known + share)
    noise[ns + 1 if by_accelerometer else ns] = 0.0
    for j in range(ns + 1):
        noise[j] = max(noise[j], LOWEST_NOISE * roughness[j] / (6.0 * max(roughness[ns + 1], 1.0)))
    _floor_noise(noise, ns)


@njit(cache=True)
def _block_step(  # type: ignore[no-untyped-def]
    omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank, decay, rows, sums, theta, noise,
    noise_known, roughness, sensitivity, information, vector, past_driven, prior_value, prior_std, iterations,
):  # fmt: skip
    """Solve with the running block: theta and noise in place; returns what the block adds."""
    ns = theta.size // exponents.size
    nu = exponents.size - ns
    span = rows[1, 0] - rows[0, 0]
    count = sums[4]
    dt = span / max(count - 1.0, 1.0)
    power = span * dt
    scale, forward = _present(sums, settings, exponents, longitudinal, roll, ns)
    share = min(1.0, span / settings[0])
    for j in range(nu):
        rough = sums[6 + j] / (6.0 * max(sums[5], 1.0))
        noise[2 * ns + 1 + j] = min(settings[7 + j], rough)
    n_theta = theta.size
    weight = 1.0 / (prior_std * prior_std)
    suspected = np.ones(ns)
    for _ in range(iterations):
        m, n_noise, score, nuisance, follow, driven = block_equations(
            omega, bank, decay, rows[0], rows[1], theta, scale, noise, power, forward, lever, by_accelerometer, ns, nu
        )  # fmt: skip
        for j in range(ns):
            suspected[j] = max(1.0, roughness[j] / (6.0 * max(roughness[ns + 1], 1.0)) / noise[j])
        mc, kept, score, driven, evidence, evidence_score, gust = reduce_information(
            m, n_noise, suspected, score, driven, max(settings[3], noise_edge(ns + nu, omega.size * share))
        )
        gain = 2.0 * share
        add_vector = gain * (score + mc @ theta)
        total = sensitivity + gain * mc
        for a in range(n_theta):
            total[a, a] += weight[a]
        inverse = np.linalg.inv(total)
        evidence_vector = gain * (evidence @ theta + evidence_score)
        moved = inverse @ (vector + add_vector + weight * prior_value)
        nuisance += (follow @ (moved - theta)).reshape(ns, 3)
        theta[:] = moved
        fresh = noise_update(
            omega, bank, decay, rows[0], rows[1], theta, scale, nuisance, noise, power, forward, lever,
            by_accelerometer, ns, nu,
        )  # fmt: skip
        _believe(noise, fresh, noise_known, share, roughness, by_accelerometer, ns)
    spread = information + gain * kept
    for a in range(n_theta):
        spread[a, a] += weight[a]
    bias = inverse @ (past_driven + gain * driven)
    covariance = inverse @ spread @ inverse + np.outer(bias, bias)
    return (
        gain * mc, gain * kept, add_vector, gain * driven, covariance, gain * evidence, evidence_vector, gain * gust,
        m, fresh,
    )  # fmt: skip


@njit(cache=True)
def _mark(informed, kept_diagonal, power_diagonal, time, gain):  # type: ignore[no-untyped-def]
    for a in range(informed.size):
        if power_diagonal[a] > 0.0 and kept_diagonal[a] > 0.5 * gain * power_diagonal[a]:
            informed[a] = time


@njit(cache=True)
def _condition(sums, condition):  # type: ignore[no-untyped-def]
    for j in range(4):
        condition[j] = sums[j] / sums[4]
    condition[1], condition[2] = sums[2] / sums[4], sums[1] / sums[4]


@njit(cache=True)
def _combine(i, theta, covariance, sensitivity, information, vector, driven, prior_value, prior_std):  # type: ignore[no-untyped-def]
    """Theta and its covariance from all closed blocks."""
    ridge = np.diag(1.0 / (prior_std * prior_std))
    inverse = np.linalg.inv(sensitivity[i] + ridge)
    theta[i] = inverse @ (vector[i] + ridge @ prior_value)
    bias = inverse @ driven[i]
    covariance[i] = inverse @ (information[i] + ridge) @ inverse + np.outer(bias, bias)


@njit(cache=True)
def _close(i, common, arrays):  # type: ignore[no-untyped-def]
    """End the block of vehicle i: solved on its own, from what is known, its information joins what is known."""
    omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, prior_value, prior_std = common
    (bank, decay, rows, sums, roughness, theta, noise, noise_known, sensitivity, information, vector, driven,
     covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition,
     counts) = arrays  # fmt: skip
    if counts[i, 0] == 0:
        _noise_start(roughness[i], noise[i], lever.size)
    _combine(i, theta, covariance, sensitivity, information, vector, driven, prior_value, prior_std)
    nothing = np.zeros_like(sensitivity[i])
    anchor, own = theta[i].copy(), theta[i].copy()
    level = noise_known[i, :-1].copy() if noise_known[i, -1] > 0.0 else noise[i].copy()
    _, _, _, _, _, _, _, _, _, fresh = _block_step(
        omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank[i], decay[i], rows[i], sums[i],
        own, level, noise_known[i], roughness[i], nothing, nothing, nothing[0], nothing[0], anchor, prior_std / 3.0, 1,
    )  # fmt: skip
    own[:] = anchor
    mc, kept, add, gust, _, evidence, evidence_v, evidence_b, m, _ = _block_step(
        omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank[i], decay[i], rows[i], sums[i],
        own, level, noise_known[i], roughness[i], nothing, nothing, nothing[0], nothing[0], anchor, prior_std / 3.0, 1,
    )  # fmt: skip
    share = min(1.0, (rows[i, 1, 0] - rows[i, 0, 0]) / settings[0])
    _mark(informed[i], np.diag(kept), np.diag(m), rows[i, 1, 0], 2.0 * share)
    evidence_matrix[i] = evidence
    evidence_vector[i] = evidence_v
    evidence_bias[i] = evidence_b
    evidence_span[i, 0], evidence_span[i, 1] = rows[i, 0, 0], rows[i, 1, 0]
    _condition(sums[i], condition[i])
    evidence_span[i, 2:] = condition[i]
    quiet = rows[i, 1, 0] - np.max(informed[i]) > settings[6]
    keep = 1.0 if quiet else np.exp(-(rows[i, 1, 0] - rows[i, 0, 0]) / settings[2])
    sensitivity[i] = keep * sensitivity[i] + mc
    information[i] = keep * information[i] + kept
    vector[i] = keep * vector[i] + add
    driven[i] = keep * driven[i] + gust
    known = noise_known[i, -1]
    for j in range(noise.shape[1]):
        noise_known[i, j] = (known * noise_known[i, j] + share * fresh[j]) / (known + share)
    noise_known[i, -1] = np.exp(-settings[0] / settings[2]) * (known + share)
    noise[i, : 2 * lever.size + 1] = noise_known[i, : 2 * lever.size + 1]
    _combine(i, theta, covariance, sensitivity, information, vector, driven, prior_value, prior_std)
    counts[i, 0] += 1
    counts[i, 1] += 1


@njit(cache=True)
def _update(  # type: ignore[no-untyped-def]
    signals, omega, held, lever, by_accelerometer, exponents, settings, prior_value, prior_std, longitudinal, roll,
    bank, decay, coefficients, step, rows, sums, roughness, theta, noise, noise_known, sensitivity, information,
    vector, driven, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition,
    counts,
):  # fmt: skip
    ns = lever.size
    nu = held.size
    kinematic = 2 + ns + nu
    force = 1 + ns if by_accelerometer else kinematic
    common = (omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, prior_value, prior_std)
    arrays = (bank, decay, rows, sums, roughness, theta, noise, noise_known, sensitivity, information, vector,
              driven, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition,
              counts)  # fmt: skip
    for i in range(signals.shape[0]):
        for k in range(signals.shape[1]):
            new = signals[i, k]
            complete = True
            for j in range(kinematic + 5):
                complete = complete and np.isfinite(new[j])
            if not complete:
                continue
            dt = new[0] - rows[i, 1, 0]
            if not (0.0 < dt <= MAX_GAP_S):
                if rows[i, 1, 0] - rows[i, 0, 0] >= settings[1]:
                    _close(i, common, arrays)
                rows[i, 0], rows[i, 1], rows[i, 2] = new, new, new
                rows[i, 2, 1:] = np.nan
                _restart(i, bank, decay, sums, roughness)
                _gather(sums[i], new, kinematic)
                continue
            advance_bank(
                omega, bank[i], decay[i], step[i], coefficients[i], rows[i, 1], new, rows[i, 2], held,
                rows[i, 1, 0] - rows[i, 0, 0], ns, nu, force,
            )  # fmt: skip
            if np.isfinite(rows[i, 2, 1]):
                for j in range(ns + 1):
                    bend = new[1 + j] - 2.0 * rows[i, 1, 1 + j] + rows[i, 2, 1 + j]
                    roughness[i, j] += bend * bend
                roughness[i, ns + 1] += 1.0
                for j in range(nu):
                    bend = new[2 + ns + j] - 2.0 * rows[i, 1, 2 + ns + j] + rows[i, 2, 2 + ns + j]
                    sums[i, 6 + j] += bend * bend
                sums[i, 5] += 1.0
            rows[i, 2] = rows[i, 1]
            rows[i, 1] = new
            _gather(sums[i], new, kinematic)
            if new[0] - rows[i, 0, 0] >= settings[0] - 0.5 * dt:
                _close(i, common, arrays)
                rows[i, 0] = new
                _restart(i, bank, decay, sums, roughness)
                _gather(sums[i], new, kinematic)


@njit(cache=True)
def _restart(i, bank, decay, sums, roughness):  # type: ignore[no-untyped-def]
    bank[i] = 0.0
    decay[i] = 1.0
    sums[i] = 0.0
    roughness[i] = 0.0


@njit(cache=True)
def _gather(sums, row, kinematic):  # type: ignore[no-untyped-def]
    alpha = row[kinematic + 5]
    sums[0] += row[kinematic + 2]
    sums[1] += row[kinematic + 3]
    sums[2] += row[kinematic + 4]
    sums[3] += alpha if np.isfinite(alpha) else 0.0
    sums[4] += 1.0


@njit(cache=True)
def _solve_all(  # type: ignore[no-untyped-def]
    omega, held, lever, by_accelerometer, exponents, settings, prior_value, prior_std, longitudinal, roll,
    bank, decay, coefficients, step, rows, sums, roughness, theta, noise, noise_known, sensitivity, information,
    vector, driven, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition,
    counts,
):  # fmt: skip
    for i in range(theta.shape[0]):
        span = rows[i, 1, 0] - rows[i, 0, 0]
        if not (span >= settings[1] - 1e-9):
            continue
        iterations = 1
        if counts[i, 0] == 0:
            _noise_start(roughness[i], noise[i], lever.size)
            iterations = 3
        _, kept, _, _, cov, _, _, _, m, _ = _block_step(
            omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank[i], decay[i], rows[i],
            sums[i], theta[i], noise[i], noise_known[i], roughness[i], sensitivity[i], information[i], vector[i],
            driven[i], prior_value, prior_std, iterations,
        )  # fmt: skip
        covariance[i] = cov
        _mark(informed[i], np.diag(kept), np.diag(m), rows[i, 1, 0], 2.0 * min(1.0, span / settings[0]))
        _condition(sums[i], condition[i])
        counts[i, 0] += 1
