"""Recursive Fourier least squares: an exact bank of one-pole filters, blocks, and their information added up.

Thesis chapter 9 transforms samples recursively and solves least squares twice a second. Here the transform is
exact for a signal that is linear between samples, trim and drift are regressors, both equations are weighted
jointly with the noise in the regressors accounted for, and the noise variances come from the residual.
The derivation, with what each step gains, is in ``docs/estimators.md``.

A block is the rectangular window of ``block_s``; when it ends, its information is added to what is known, which
fades with ``memory_s`` where new data replace it.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.estimate import BlockEvidence, Estimate
from wingwatch.estimators.fourier.air import air_channels
from wingwatch.estimators.fourier.bank import bank_channels
from wingwatch.estimators.fourier.blocks import advance, block_room
from wingwatch.estimators.fourier.dispersion import dispersion_of
from wingwatch.estimators.fourier.marks import MARKS
from wingwatch.estimators.fourier.noise import AIR_LEVELS
from wingwatch.estimators.reference import Posterior, offsets, referred_scale, standing
from wingwatch.estimators.signals import SignalLayout

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
        memory_s: time constant of forgetting where new data come; what they do not replace is kept.
        first_solution_s: time of data before the first solution (thesis 9.2: 2 s).
        stale_s: without excitation for this long a derivative is not observable.
        held: for each input, whether it is held between samples (a command) rather than moving (a position).
        servo_s: for each input that is not, time constant of the servo that moves it, its command held between
            samples; 0 where that is not known: it then moves evenly.
        force_from_accelerometer: force equation from the accelerometer; else from the velocity's rate.
        imu_position_m: (x, y, z) of the accelerometer from the c.g.
        input_noise_std: of each measured input, rad; not more than the input's own roughness is believed.
        smallest_share: share of signal in the regressors' power below which a direction counts as unseen (more
            where the bins are so few that noise alone may look like it).
        span_m: over which the air's turning and rolling is smoothed; 0: the air is not known to do either.
        vane_ahead_m: distance of the vane ahead of the c.g.: it meets a gust so much earlier.
        velocity_measured: whether a vane measures the velocity; a reconstructed one satisfies the kinematic row by
            itself.
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
    servo_s: tuple[float, ...] = ()
    force_from_accelerometer: bool = True
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    input_noise_std: tuple[float, ...] = ()
    smallest_share: float = 0.5
    span_m: float = 0.0
    vane_ahead_m: float = 0.0
    velocity_measured: bool = True
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

    @property
    def equation_rows(self) -> int:
        """Force equation, moment equations and, where vane and accelerometer are there, the kinematic row."""
        kinematic = self.force_from_accelerometer and self.velocity_measured
        return len(self.structure.states) + (1 if kinematic else 0)


@dataclass(slots=True)
class FourierState:
    """Everything the estimator remembers, one row a vehicle (shapes after the leading vehicle axis).

    Attributes:
        bank: (channels, 2, frequencies) transforms of the block, real and imaginary part.
        coefficients, step: one-pole coefficients (8, frequencies) and the time step they are for.
        rows: (3, columns) signal rows at the block's start, the last and the one before.
        sums: airspeed, density, altitude, angle of attack over the block, count; squared second differences of the
            inputs and their count.
        roughness: roots of the magnitudes of second differences of states and accelerometer over the block, and count.
        theta, noise: current referred derivatives (k,) and noise variances.
        noise_known: (variances..., their weight in blocks) gathered from closed blocks.
        sensitivity, information, vector, driven: what closed blocks said, (k, k), (k, k), (k,), (k,).
        reserve: the part of these four, side by side (k, 2 k + 2), that has faded and that nothing new has replaced.
        covariance: of theta, (k, k).
        informed_s: last time each derivative's regressor carried signal, (k,).
        evidence_matrix, evidence_vector, evidence_bias, evidence_span: of the last closed block, for the monitor.
        condition: airspeed, altitude, density, angle of attack that theta is reported at.
        counts: solutions so far, blocks closed.
        scatter: of each equation (``dispersion``): faded chi-square of the closed blocks, its
            degrees of freedom, and the dispersion before the last block, (equations, 3).
        mark_bank, mark_rows, mark_sums, mark_known: copies of the running block and of what it says, at the last
            seconds' marks (``marks``).
        changed_s: last time the memory of each derivative was set free because it contradicted the data, (k,).
        follows: whether changes are looked for; not where the caller knows that the model leaves out what acts.
    """

    bank: Array
    coefficients: Array
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
    reserve: Array
    covariance: Array
    informed_s: Array
    evidence_matrix: Array
    evidence_vector: Array
    evidence_bias: Array
    evidence_span: Array
    condition: Array
    counts: NDArray[np.int64]
    scatter: Array
    mark_bank: Array
    mark_rows: Array
    mark_sums: Array
    mark_known: Array
    changed_s: Array
    follows: NDArray[np.bool_]


class FourierEstimator:
    """The estimator: ``init``, ``update``, ``solve``, ``estimate``; a batch of vehicles at a time."""

    name = "fourier"

    def __init__(self, config: FourierConfig) -> None:
        self.config = config
        self.layout = SignalLayout(len(config.structure.states), len(config.structure.inputs))
        self._fixed = _fixed(config, self.layout)
        self._room = block_room(
            self.layout.states, self.layout.inputs, config.omega_rad_s.size, self.layout.columns,
            config.equation_rows,
        )  # fmt: skip

    def init(self, vehicles: int) -> FourierState:
        """State before the first sample."""
        c, n = self.config, vehicles
        ns, nu, k = self.layout.states, self.layout.inputs, len(c.structure.derivatives)
        nf = c.omega_rad_s.size
        channels = (bank_channels(ns, nu) + air_channels(ns, nu), 2, nf)
        noise = np.ones((n, 2 * ns + 1 + nu + AIR_LEVELS))
        noise[:, 2 * ns + 1 :] = 0.0
        return FourierState(
            bank=np.zeros((n, *channels)),
            coefficients=np.zeros((n, 8, nf)),
            step=np.full((n, 1), -1.0),
            rows=np.full((n, 3, self.layout.columns), np.nan),
            sums=np.zeros((n, 6 + nu)),
            roughness=np.zeros((n, ns + 2)),
            theta=np.tile(c.prior_value, (n, 1)),
            noise=noise,
            noise_known=np.zeros((n, 2 * ns + 2 + nu + AIR_LEVELS)),
            sensitivity=np.zeros((n, k, k)),
            information=np.zeros((n, k, k)),
            vector=np.zeros((n, k)),
            driven=np.zeros((n, k)),
            reserve=np.zeros((n, k, 2 * k + 2)),
            covariance=np.tile(np.diag(c.prior_std**2), (n, 1, 1)),
            informed_s=np.full((n, k), -np.inf),
            evidence_matrix=np.zeros((n, k, k)),
            evidence_vector=np.zeros((n, k)),
            evidence_bias=np.zeros((n, k)),
            evidence_span=np.full((n, 6), np.nan),
            condition=np.full((n, 4), np.nan),
            counts=np.zeros((n, 2), dtype=np.int64),
            scatter=np.zeros((n, ns, 3)),
            mark_bank=np.zeros((n, MARKS, *channels)),
            mark_rows=np.full((n, MARKS, self.layout.columns), np.nan),
            mark_sums=np.zeros((n, MARKS, 6 + nu + ns + 2)),
            mark_known=np.zeros((n, MARKS, k, 2 * k + 2)),
            changed_s=np.full((n, k), -np.inf),
            follows=np.ones(n, dtype=np.bool_),
        )

    def update(self, state: FourierState, signals: Array) -> None:
        """Take in samples; blocks that become full are closed.

        Args:
            state: advanced in place.
            signals: shape (vehicles, samples, columns) from ``Signals``; rows with a missing value are passed over.

        Raises:
            ValueError: signals of another structure.
        """
        advance(self.layout.checked(signals), False, *self._arguments(state))

    def solve(self, state: FourierState) -> None:
        """Bring ``theta`` and its covariance up to the last sample (the thesis does it at 2 Hz)."""
        advance(np.empty((len(state.theta), 0, self.layout.columns)), True, *self._arguments(state))

    def resume(self, state: FourierState, information: Array, vector: Array, vehicle: int = 0) -> None:
        """Put a memory in the place of what closed blocks said; the running block stays.

        Args:
            information, vector: a quadratic log-likelihood of the referred derivatives, (k, k) and (k,), the blocks
                closed so far included where they are to count.
        """
        state.sensitivity[vehicle] = information
        state.information[vehicle] = information
        state.vector[vehicle] = vector
        state.driven[vehicle] = 0.0
        state.reserve[vehicle] = 0.0

    def changed(self, state: FourierState, vehicle: int = 0) -> NDArray[np.bool_]:
        """Which derivatives the last solution found to have changed, shape (k,): their memory is free since then."""
        return np.asarray(state.changed_s[vehicle] == state.rows[vehicle, 1, 0])

    def sees(self, state: FourierState) -> NDArray[np.int64]:
        """What the running blocks carried at the last solution: 1 signal of any regressor, 0 noise, -1 not known, for
        they have only begun; shape (vehicles,)."""
        now, start = state.rows[:, 1, 0], state.rows[:, 0, 0]
        solved = now - start >= self.config.first_solution_s - 1e-9
        return np.where(solved, np.where(state.informed_s.max(axis=1) == now, 1, 0), -1)

    def unseen(self, state: FourierState, vehicle: int = 0) -> NDArray[np.bool_]:
        """Which derivatives' regressors have carried nothing but noise for ``stale_s``, shape (k,)."""
        return np.asarray(state.rows[vehicle, 1, 0] - state.informed_s[vehicle] > self.config.stale_s)

    def estimate(self, state: FourierState, vehicle: int = 0) -> Estimate:
        """Concise derivatives of one vehicle as of the last solution, at its present flight condition."""
        c = self.config
        condition = state.condition[vehicle]
        scale = referred_scale(c.structure, condition[0], condition[2], c.reference)
        value = state.theta[vehicle] * scale + offsets(c.structure, condition[0], condition[3])
        value += self._by_airspeed(value, condition[0], condition[3])
        wider = np.repeat(
            np.sqrt(self.dispersion_of(state, vehicle)), self.layout.states + self.layout.inputs
        )
        covariance = state.covariance[vehicle] * np.outer(scale * wider, scale * wider)
        time_s = float(state.rows[vehicle, 1, 0])
        return standing(
            self.name, c.structure, time_s, Posterior(value, covariance, c.prior_std * scale),
            state.informed_s[vehicle], c.stale_s, bool(state.counts[vehicle, 0]), condition,
        )  # fmt: skip

    def dispersion_of(self, state: FourierState, vehicle: int = 0) -> Array:
        """How many times the variances are larger than the blocks themselves say, by equation, shape (equations,)."""
        return np.array([dispersion_of(row) for row in state.scatter[vehicle]])

    def _by_airspeed(self, value: Array, airspeed_m_s: float, alpha: float) -> Array:
        """What w changes through the airspeed, the forward speed being constant: dV/dw = sin(alpha).

        Forces are those at the measured airspeed: constants go with V^2, what acts by w with V. In steady flight they
        are -g cos(alpha) together and the moments nothing, so at constant forward speed the slope by w is
        z_w cos(alpha)^2 - 2 g sin(alpha) cos(alpha) / V, and m_w cos(alpha)^2.
        """
        c, ns = self.config, self.layout.states
        more = np.zeros((ns, value.size // ns))
        if c.structure.states[0] == "w" and np.isfinite(alpha) and airspeed_m_s > 1.0:
            more[:, 0] = -value.reshape(more.shape)[:, 0] * np.sin(alpha) ** 2
            more[0, 0] -= GRAVITY_M_S2 * np.sin(2.0 * alpha) / airspeed_m_s
        return more.ravel()

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
        return (
            *self._fixed, s.bank, s.coefficients, s.step, s.rows, s.sums, s.roughness, s.theta, s.noise,
            s.noise_known, s.sensitivity, s.information, s.vector, s.driven, s.reserve, s.covariance, s.informed_s,
            s.evidence_matrix, s.evidence_vector, s.evidence_bias, s.evidence_span, s.condition, s.counts, s.scatter,
            s.mark_bank, s.mark_rows, s.mark_sums, s.mark_known, s.changed_s, s.follows, self._room,
        )  # fmt: skip


def _fixed(c: FourierConfig, layout: SignalLayout):  # type: ignore[no-untyped-def]
    """What the kernels take from the configuration: the first of their arguments, in their order."""
    longitudinal, roll = c.structure.equations[0] == "z", layout.states == 3
    lever = np.zeros(layout.states)
    x, _, z = c.imu_position_m
    if longitudinal:
        lever[1] = x
    else:
        lever[-1] = -x
        if roll:
            lever[1] = z
    exponents = np.array([1.0] * layout.states + [2.0] * layout.inputs)
    servo_s = np.array(c.servo_s or (0.0,) * layout.inputs)
    servo_s = np.where(c.held, 0.0, np.where(servo_s > 0.0, servo_s, np.inf))
    settings = np.array(
        [c.block_s, c.first_solution_s, c.memory_s, c.smallest_share, *c.reference, c.stale_s,
         *np.square(c.input_noise_std), *servo_s]
    )  # fmt: skip
    # Roll and pitch of the air are smoothed over 4 b / pi, yaw over 3 b / pi (MIL-F-8785C 3.7.5).
    span_m = c.span_m if c.velocity_measured else 0.0
    smoothed = np.array([4.0, 4.0 if longitudinal else 3.0]) * span_m / np.pi
    gusts = np.array([*smoothed, c.vane_ahead_m])
    return (
        c.omega_rad_s, lever, gusts, c.force_from_accelerometer, exponents, settings, c.prior_value, c.prior_std,
        longitudinal, roll,
    )  # fmt: skip
