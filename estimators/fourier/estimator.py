"""Recursive Fourier least squares: an exact bank of one-pole filters, blocks, and their information added up.

Thesis chapter 9 transforms samples recursively and solves least squares twice a second. Here the transform is
exact for a signal that is linear between samples, trim and drift are regressors, both equations are weighted
jointly with the noise in the regressors accounted for, and the noise variances come from the residual.
The derivation is in ``docs/methods/fourier.md``.

A block is the rectangular window of ``block_s``; when it ends, its information is added to what is known, which
is forgotten with ``memory_s`` where new data replace it.
"""

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.estimate import BlockEvidence, Estimate
from wingwatch.estimators.fourier.air import air_channels
from wingwatch.estimators.fourier.bank import bank_channels
from wingwatch.estimators.fourier.blocks import advance, block_workspace, fill
from wingwatch.estimators.fourier.checkpoints import CHECKPOINTS
from wingwatch.estimators.fourier.state import (
    AIR_VARIANCES,
    CLOSED,
    COURSES,
    LAST,
    SOLUTIONS,
    START,
    TIME,
    Block,
    Checkpoints,
    Evidence,
    Filters,
    Memory,
    Model,
    Posterior,
    Prior,
    Progress,
    State,
)
from wingwatch.estimators.kernels.apart import room_around
from wingwatch.estimators.kernels.intersample import servos_of
from wingwatch.estimators.kernels.reading_noise import READING_MEMORY
from wingwatch.estimators.lanes import Lanes, all_lanes
from wingwatch.estimators.reference import offsets, referred_scale
from wingwatch.estimators.signals import SignalLayout
from wingwatch.estimators.standing import ConcisePosterior, Validities, assess
from wingwatch.kernels.by_address import ByAddress

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
        servo_rate_rad_s: what each such servo moves by at most; 0 where that is not known.
        force_from_accelerometer: force equation from the accelerometer; else from the velocity's rate.
        imu_position_m: (x, y, z) of the accelerometer from the c.g.
        input_noise_std: of each measured input, rad, as the aircraft file states it; what its readings show counts
            beside it. 0: exact.
        smallest_share: fraction of signal in the regressors' power below which a direction counts as unseen (more
            where the bins are so few that noise alone may look like it).
        span_m: over which gust-induced pitch (yaw) and roll rates are smoothed; 0: the air is not known to cause any.
        vane_ahead_m: how far ahead of the centre of gravity the vane is whose readings the signals have as those of one
            at it (``SignalConfig.vane_leads``); it decides what vane and accelerometer have in common between samples.
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
    servo_rate_rad_s: tuple[float, ...] = ()
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
    """Everything the estimator remembers, one row a vehicle; shapes and units are those of the groups in ``state``.

    Attributes:
        coefficients, step, readings: ``Filters``.
        bank, rows, sums, roughness: the running ``Block``.
        theta, covariance, noise, noise_known, informed_s, changed: ``Posterior``.
        counts, condition, evidence_span, scatter, coherence, dispersion: ``Progress``.
        sensitivity, information, vector, bias: the ``Memory`` of closed blocks; ``discounted_``: the part of it that is
            discounted and not replaced yet.
        evidence_matrix, evidence_vector, evidence_bias: ``Evidence`` of the last closed block, for the monitor.
        checkpoint_bank and so on: ``Checkpoints`` of the running block.
        follows: whether changes are looked for, (vehicles,).
    """

    coefficients: Array
    step: Array
    readings: Array
    bank: Array
    rows: Array
    sums: Array
    roughness: Array
    theta: Array
    covariance: Array
    noise: Array
    noise_known: Array
    informed_s: Array
    changed: Array
    counts: NDArray[np.int64]
    condition: Array
    evidence_span: Array
    scatter: Array
    coherence: Array
    dispersion: Array
    sensitivity: Array
    information: Array
    vector: Array
    bias: Array
    discounted_sensitivity: Array
    discounted_information: Array
    discounted_vector: Array
    discounted_bias: Array
    evidence_matrix: Array
    evidence_vector: Array
    evidence_bias: Array
    checkpoint_bank: Array
    checkpoint_rows: Array
    checkpoint_sums: Array
    checkpoint_roughness: Array
    checkpoint_sensitivity: Array
    checkpoint_information: Array
    checkpoint_vector: Array
    checkpoint_bias: Array
    follows: NDArray[np.bool_]


class FourierEstimator:
    """The estimator: ``init``, ``update``, ``solve``, ``estimate``; a batch of vehicles at a time."""

    name = "fourier"

    def __init__(self, config: FourierConfig) -> None:
        self.config = config
        self.layout = SignalLayout(len(config.structure.states), len(config.structure.inputs))
        self._model = _model(config, self.layout)
        self._workspace = block_workspace(
            self.layout.states, self.layout.inputs, config.omega_rad_s.size, self.layout.columns,
            config.equation_rows,
        )  # fmt: skip
        self._for_kernels = ByAddress(self._model), ByAddress(self._workspace)

    def init(self, vehicles: int) -> FourierState:
        """State before the first sample."""
        c, n = self.config, vehicles
        ns, nu, k = self.layout.states, self.layout.inputs, len(c.structure.derivatives)
        nf, columns = c.omega_rad_s.size, self.layout.columns
        channels = (bank_channels(ns, nu) + air_channels(ns, nu), 2, nf)
        sensors, sums = 2 * ns + 1, COURSES + 2 * self.layout.inputs
        noise = np.ones((n, sensors + nu + AIR_VARIANCES))
        noise[:, sensors:] = 0.0
        state = FourierState(
            coefficients=np.zeros((n, 8, nf)),
            step=np.full((n, 1), -1.0),
            readings=np.zeros((n, nu, READING_MEMORY)),
            bank=np.zeros((n, *channels)),
            rows=np.full((n, 3, columns), np.nan),
            sums=np.zeros((n, sums)),
            roughness=np.zeros((n, ns + 2)),
            theta=np.tile(c.prior_value, (n, 1)),
            covariance=np.tile(np.diag(c.prior_std**2), (n, 1, 1)),
            noise=noise,
            noise_known=np.zeros((n, noise.shape[1] + 1)),
            informed_s=np.full((n, k), -np.inf),
            changed=np.zeros((n, k)),
            counts=np.zeros((n, 3), dtype=np.int64),
            condition=np.full((n, 4), np.nan),
            evidence_span=np.full((n, 6), np.nan),
            scatter=np.zeros((n, ns, 3)),
            coherence=np.zeros((n, ns, 3, nf)),
            dispersion=np.ones((n, ns)),
            sensitivity=np.zeros((n, k, k)),
            information=np.zeros((n, k, k)),
            vector=np.zeros((n, k)),
            bias=np.zeros((n, k)),
            discounted_sensitivity=np.zeros((n, k, k)),
            discounted_information=np.zeros((n, k, k)),
            discounted_vector=np.zeros((n, k)),
            discounted_bias=np.zeros((n, k)),
            evidence_matrix=np.zeros((n, k, k)),
            evidence_vector=np.zeros((n, k)),
            evidence_bias=np.zeros((n, k)),
            checkpoint_bank=np.zeros((n, CHECKPOINTS, *channels)),
            checkpoint_rows=np.full((n, CHECKPOINTS, columns), np.nan),
            checkpoint_sums=np.zeros((n, CHECKPOINTS, sums)),
            checkpoint_roughness=np.zeros((n, CHECKPOINTS, ns + 2)),
            checkpoint_sensitivity=np.zeros((n, CHECKPOINTS, k, k)),
            checkpoint_information=np.zeros((n, CHECKPOINTS, k, k)),
            checkpoint_vector=np.zeros((n, CHECKPOINTS, k)),
            checkpoint_bias=np.zeros((n, CHECKPOINTS, k)),
            follows=np.ones(n, dtype=np.bool_),
        )
        return FourierState(**{f.name: room_around(getattr(state, f.name)) for f in fields(state)})

    def update(self, state: FourierState, signals: Array, lanes: Lanes | None = None) -> None:
        """Take in samples; blocks that become full are closed.

        Args:
            state: advanced in place.
            signals: shape (vehicles, samples, columns) from ``Signals``; rows with a missing value are passed over.
            lanes: whose rows these are; all vehicles of the state and all rows if not given.

        Raises:
            ValueError: signals of another structure.
        """
        signals = self.layout.checked(signals)
        lanes = lanes or all_lanes(*signals.shape[:2])
        ends = np.zeros((len(signals), 2), dtype=np.int64)
        block = Block(state.bank, state.rows, state.sums, state.roughness)
        fill(
            self._for_kernels[0],
            block,
            Filters(state.coefficients, state.step, state.readings),
            signals,
            lanes,
            ends,
        )
        if (ends[:, 0] < lanes.counts).any():
            self._advance(state, signals, lanes, ends, False)

    def solve(self, state: FourierState, places: NDArray[np.int64] | None = None) -> None:
        """Bring ``theta`` and its covariance up to the last sample (the thesis does it at 2 Hz).

        Args:
            state: in place.
            places: the vehicles, each once, shape (m,); all if not given.
        """
        places = np.arange(len(state.theta)) if places is None else places
        lanes = Lanes(places, np.zeros(places.size, dtype=np.int64))
        none = np.empty((places.size, 0, self.layout.columns))
        self._advance(state, none, lanes, np.zeros((places.size, 2), dtype=np.int64), True)

    def _advance(
        self, state: FourierState, signals: Array, lanes: Lanes, ends: NDArray[np.int64], solves: bool
    ) -> None:
        model, workspace = self._for_kernels
        advance(model, ByAddress(_grouped(state)), state.follows, signals, lanes, ends, solves, workspace)

    def resume(self, state: FourierState, information: Array, vector: Array, vehicle: int = 0) -> None:
        """Put a memory in the place of what closed blocks said; the running block stays.

        Args:
            information, vector: a quadratic log-likelihood of the referred derivatives, (k, k) and (k,), the blocks
                closed so far included where they are to count.
        """
        state.sensitivity[vehicle] = information
        state.information[vehicle] = information
        state.vector[vehicle] = vector
        state.bias[vehicle] = 0.0
        for discounted in _grouped(state).discounted:
            discounted[vehicle] = 0.0

    def follow_changes(
        self, state: FourierState, yes: bool | NDArray[np.bool_], places: NDArray[np.int64] | None = None
    ) -> None:
        """Whether changes of the vehicles ``places`` (m,), or of all, are looked for; not where the caller knows of
        something that acts and is not modelled. ``yes``: a scalar or (m,)."""
        state.follows[slice(None) if places is None else places] = yes

    def blocks_closed(self, state: FourierState, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many blocks of some vehicles have been closed, shape (m,)."""
        return np.asarray(state.counts[places, CLOSED])

    def block_start_s(self, state: FourierState, vehicle: int = 0) -> float:
        """When the running block began."""
        return float(state.rows[vehicle, START, TIME])

    def changed(self, state: FourierState, places: NDArray[np.int64]) -> Array:
        """Standard deviation, in natural sizes, of what the last solution saw each derivative of some vehicles to have
        changed by, shape (m, k): 1 of one that was seen to, less of the others, 0 of all where nothing has changed."""
        return np.asarray(state.changed[places])

    def sees(self, state: FourierState, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """What the running blocks of some vehicles carried at the last solution: 1 signal of any regressor, 0 noise, -1
        not known, for they have only begun; shape (m,)."""
        now, start = state.rows[places, LAST, TIME], state.rows[places, START, TIME]
        solved = now - start >= self.config.first_solution_s - 1e-9
        return np.where(solved, np.where(state.informed_s[places].max(axis=1) == now, 1, 0), -1)

    def estimate(self, state: FourierState, vehicle: int = 0) -> Estimate:
        """Concise derivatives of one vehicle as of the last solution, at its present flight condition."""
        return self.validities(state, np.array([vehicle])).of(0).estimate(self.name, self.config.structure)

    def validities(self, state: FourierState, places: NDArray[np.int64]) -> Validities:
        """The same of some vehicles, (m,), in numbers."""
        c, condition = self.config, state.condition[places]
        airspeed_m_s, _, density_kg_m3, alpha = condition.T
        scale = referred_scale(c.structure, airspeed_m_s, density_kg_m3, c.reference)
        value = state.theta[places] * scale + offsets(c.structure, airspeed_m_s, alpha)
        if c.structure.states[0] == "w":
            value += self._by_airspeed(value, airspeed_m_s, alpha)
        columns = self.layout.states + self.layout.inputs
        wider = scale * np.repeat(np.sqrt(state.dispersion[places]), columns, axis=1)
        covariance = state.covariance[places] * wider[:, :, None] * wider[:, None, :]
        return assess(
            c.structure, state.rows[places, LAST, TIME], ConcisePosterior(value, covariance, c.prior_std * scale),
            state.informed_s[places], c.stale_s, state.counts[places, SOLUTIONS] > 0, condition,
        )  # fmt: skip

    def _by_airspeed(self, value: Array, airspeed_m_s: Array, alpha: Array) -> Array:
        """What w changes through the airspeed, the forward speed being constant: dV/dw = sin(alpha); (m, k).

        Forces are those at the measured airspeed: constants go with V^2, what acts by w with V. In steady flight they
        are -g cos(alpha) together and the moments nothing, so at constant forward speed the slope by w is
        z_w cos(alpha)^2 - 2 g sin(alpha) cos(alpha) / V, and m_w cos(alpha)^2.
        """
        more = np.zeros((len(value), self.layout.states, value.shape[1] // self.layout.states))
        known = np.isfinite(alpha) & (airspeed_m_s > 1.0)
        alpha, speed = np.where(known, alpha, 0.0), np.where(known, airspeed_m_s, 1.0)
        more[:, :, 0] = -value.reshape(more.shape)[:, :, 0] * (np.sin(alpha) ** 2)[:, None]
        more[:, 0, 0] -= GRAVITY_M_S2 * np.sin(2.0 * alpha) / speed
        more[~known] = 0.0
        return more.reshape(value.shape)

    def evidence(self, state: FourierState, vehicle: int = 0) -> BlockEvidence:
        """What the last closed block said, for the monitor's sequential test."""
        start_s, end_s, airspeed_m_s, altitude_m, density_kg_m3, alpha = map(
            float, state.evidence_span[vehicle]
        )
        return BlockEvidence(
            blocks=int(state.counts[vehicle, CLOSED]),
            start_s=start_s,
            end_s=end_s,
            information=state.evidence_matrix[vehicle].copy(),
            vector=state.evidence_vector[vehicle].copy(),
            bias=state.evidence_bias[vehicle].copy(),
            condition=(airspeed_m_s, altitude_m, density_kg_m3, alpha),
        )


def _grouped(s: FourierState) -> State:
    """The state as the kernels take it; the same arrays."""
    points = Memory(
        s.checkpoint_sensitivity, s.checkpoint_information, s.checkpoint_vector, s.checkpoint_bias
    )
    return State(
        Filters(s.coefficients, s.step, s.readings),
        Block(s.bank, s.rows, s.sums, s.roughness),
        Posterior(s.theta, s.covariance, s.noise, s.noise_known, s.informed_s, s.changed),
        Progress(s.counts, s.condition, s.evidence_span, s.scatter, s.coherence, s.dispersion),
        Memory(s.sensitivity, s.information, s.vector, s.bias),
        Memory(s.discounted_sensitivity, s.discounted_information, s.discounted_vector, s.discounted_bias),
        Evidence(s.evidence_matrix, s.evidence_vector, s.evidence_bias),
        Checkpoints(s.checkpoint_bank, s.checkpoint_rows, s.checkpoint_sums, s.checkpoint_roughness, points),
    )


def _model(c: FourierConfig, layout: SignalLayout) -> Model:
    """What the kernels take from the configuration."""
    longitudinal, roll = c.structure.equations[0] == "z", layout.states == 3
    lever = np.zeros(layout.states)
    x, _, z = c.imu_position_m
    if longitudinal:
        lever[1] = x
    else:
        lever[-1] = -x
        if roll:
            lever[1] = z
    # Roll and pitch of the air are smoothed over 4 b / pi, yaw over 3 b / pi (MIL-F-8785C 3.7.5).
    span_m = c.span_m if c.velocity_measured else 0.0
    roll_smoothing_m, turn_smoothing_m = np.array([4.0, 4.0 if longitudinal else 3.0]) * span_m / np.pi
    return Model(
        omega=c.omega_rad_s,
        lever=lever,
        exponents=np.array([1.0] * layout.states + [2.0] * layout.inputs),
        servos=servos_of(c.servo_s, c.servo_rate_rad_s, c.held),
        input_variance=np.square(np.array(c.input_noise_std, dtype=np.float64)),
        prior=Prior(np.array(c.prior_value, dtype=np.float64), np.array(c.prior_std, dtype=np.float64)),
        reference_airspeed_m_s=float(c.reference[0]),
        reference_density_kg_m3=float(c.reference[1]),
        block_s=float(c.block_s),
        first_solution_s=float(c.first_solution_s),
        memory_s=float(c.memory_s),
        stale_s=float(c.stale_s),
        smallest_signal=float(c.smallest_share),
        roll_smoothing_m=float(roll_smoothing_m),
        turn_smoothing_m=float(turn_smoothing_m),
        vane_ahead_m=float(c.vane_ahead_m),
        by_accelerometer=bool(c.force_from_accelerometer),
        longitudinal=bool(longitudinal),
        roll=bool(roll),
    )
