"""One aircraft's estimation chain: clean samples in, solutions of every mode out; the same live and offline.

Solutions fall on a grid of half seconds of the samples' own time stamps, so how samples were cut into messages
changes nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    ModeStructure,
    analysis_band_hz,
)
from wingwatch.baselines import Envelope, Expectation, OutOfEnvelope, apriori_envelope
from wingwatch.estimators import (
    ROUGH_SHARE,
    ROUGHNESS,
    BlockEvidence,
    EkfConfig,
    EkfEstimator,
    EkfState,
    Estimate,
    FourierConfig,
    FourierEstimator,
    FourierState,
    Outcome,
    SignalConfig,
    Signals,
    SignalState,
    follow_roughness,
    gather_motion,
    inertia_coupling,
    is_gusty,
    offsets,
    told_apart_text,
)
from wingwatch.monitor.air_watch import AirState, AirWatch
from wingwatch.telemetry import SampleBlock, missing_for
from wingwatch.telemetry.conditioning import AirQuality

__all__ = ["Chain", "ChainState", "ModeSolution", "Solution", "STRUCTURES_WATCHED", "nominal_condition"]

Array = NDArray[np.float64]

STRUCTURES_WATCHED: tuple[ModeStructure, ...] = (SHORT_PERIOD, DUTCH_ROLL, LATERAL)

SOLUTION_INTERVAL_S = 0.5
"""Thesis 9.2: least squares at 2 Hz."""

LEAST_ROWS = 5
"""Samples since the last solution, none of them half a second from the one before, without which there is none: half a
second at 10 Hz. A solution costs a thousand times what a sample does, so a message's cost goes with its samples."""

_SAME_TIME_S = 1e-6
"""Stamps this close count as one: samplers round."""

MOTION_S = 10.0
"""Time over which the motion is measured that the air's part is compared with: a block."""

ROUGH_MEMORY_S = 80.0
"""Twice the estimators' memory: after it they have forgotten six sevenths of what gusts taught them unseen."""

ROUGHNESS_SAMPLES = 250.0
"""Time constant, 5 s at 50 Hz: an autopilot's or doublet's jerk passes, gusts stay."""

NO_VANE = "reconstructed, no vane"

_VANE = {"w": "angle_of_attack_rad", "v": "sideslip_rad"}
_FORCE_COLUMN = {"w": "specific_force_z_m_s2", "v": "specific_force_y_m_s2"}
_RATE_COLUMN = {"p": "roll_rate_rad_s", "q": "pitch_rate_rad_s", "r": "yaw_rate_rad_s"}
_INPUT_COLUMN = {"eta": "elevator_rad", "xi": "aileron_rad", "zeta": "rudder_rad"}
_SURFACE = {"eta": "elevator", "xi": "aileron", "zeta": "rudder"}


@dataclass(frozen=True, slots=True)
class ModeSolution:
    """What both estimators say of one mode, and what the last closed block added."""

    structure: ModeStructure
    fourier: Estimate
    ekf: Estimate
    block: BlockEvidence
    gained: tuple[Array, Array] | None
    rough: bool = False
    """Whether the air makes a tenth or more of the rotation: changes are then not looked for."""
    reconstructed: bool = False
    """Whether the velocity is reconstructed for want of a vane: no gust is seen, and the filter alone has standing."""


@dataclass(frozen=True, slots=True)
class Solution:
    """All modes at one instant of the vehicle's clock."""

    time_s: float
    modes: Mapping[str, ModeSolution]
    air: AirQuality | None = None
    """The gusts of the last half minute; None where they are not known."""


@dataclass(frozen=True, slots=True)
class _Mode:
    """The parts that work on one structure."""

    structure: ModeStructure
    signals: Signals
    fourier: FourierEstimator
    ekf: EkfEstimator
    vane: bool
    force_noise_variance: float


@dataclass(slots=True)
class ChainState:
    """Everything a chain remembers of its vehicle."""

    signals: dict[str, SignalState]
    fourier: dict[str, FourierState]
    ekf: dict[str, EkfState]
    roughness: dict[str, Array]
    motion: dict[str, Array]
    """Running moments of the measured states, laid out as ``estimators.gather_motion`` has them, by structure."""
    blocks: dict[str, int] = field(default_factory=dict)
    rough_s: dict[str, float] = field(default_factory=dict)
    """When the air was last rough, by structure without a vane."""
    air: AirState = field(default_factory=AirState)
    next_solution_s: float = float("nan")
    last_s: float = float("nan")
    rows: int = 0
    """Samples since the last solution or the last step too long for one."""


def nominal_condition(aircraft: Aircraft) -> FlightCondition | None:
    """The condition that an aircraft's derivatives are referred to: its cruise, else its first stated condition."""
    if aircraft.envelope is not None:
        return aircraft.envelope.cruise
    if aircraft.conditions:
        return aircraft.conditions[0].condition
    return None


class Chain:
    """Estimators of every mode for which the aircraft file gives an expectation and the samples the channels.

    Args:
        aircraft: its file.
        present: names of the channels that the samples carry.
        kinds: ``position`` or ``command`` for the surfaces; what is not named is a position.
        configuration: of the aircraft.
        envelopes: expectations that take the place of the aircraft file's, by structure.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        present: Sequence[str],
        kinds: Mapping[str, str],
        configuration: str = "clean",
        envelopes: Mapping[str, Envelope] | None = None,
    ) -> None:
        self.aircraft = aircraft
        given = envelopes or {}
        self.envelopes: dict[str, Envelope] = {}
        self.absent: dict[str, str] = {}
        self._air = AirWatch(aircraft)
        self._modes: list[_Mode] = []
        for structure in STRUCTURES_WATCHED:
            missing = missing_for(structure, present)
            if missing:
                self.absent[structure.name] = f"missing {', '.join(missing)}"
                continue
            envelope = given.get(structure.name) or apriori_envelope(aircraft, structure, configuration)
            prior = self._prior(envelope)
            if isinstance(prior, str):
                self.absent[structure.name] = prior
                continue
            self.envelopes[structure.name] = envelope
            vane = _VANE[structure.states[0]] in present
            self._modes.append(_mode(aircraft, structure, prior, kinds, vane))

    @property
    def structures(self) -> tuple[ModeStructure, ...]:
        """Structures that are estimated."""
        return tuple(m.structure for m in self._modes)

    @property
    def seen(self) -> tuple[ModeStructure, ...]:
        """Those whose velocity a vane measures: evidence from a reconstructed one called healthy aircraft changed."""
        return tuple(m.structure for m in self._modes if m.vane)

    def _prior(self, envelope: Envelope) -> Expectation | str:
        nominal = nominal_condition(self.aircraft)
        if nominal is None:
            return f"aircraft {self.aircraft.name} states neither [envelope] nor [[conditions]]"
        found = envelope.lookup(nominal)
        return found.reason if isinstance(found, OutOfEnvelope) else found

    def init(self) -> ChainState:
        """State before the first sample."""
        return ChainState(
            {m.structure.name: m.signals.init(1) for m in self._modes},
            {m.structure.name: m.fourier.init(1) for m in self._modes},
            {m.structure.name: m.ekf.init(1) for m in self._modes},
            {m.structure.name: np.zeros(ROUGHNESS) for m in self._modes},
            {m.structure.name: np.full((3, len(m.structure.states)), np.nan) for m in self._modes},
        )

    def advance(self, state: ChainState, block: SampleBlock) -> Iterator[Solution]:
        """Take in clean samples; yields a solution at every half second of their clock.

        Samples slower than 10 Hz have to be ``LEAST_ROWS`` for a solution; at 2 Hz and slower there is none.
        """
        start = 0
        for k, t in enumerate(block.time_s.tolist()):
            step_s, state.last_s = t - state.last_s, t
            state.rows = state.rows + 1 if 0.0 < step_s < SOLUTION_INTERVAL_S - _SAME_TIME_S else 1
            if np.isnan(state.next_solution_s) or not 0.0 < step_s < 10.0 * SOLUTION_INTERVAL_S:
                state.next_solution_s = t + SOLUTION_INTERVAL_S
            elif t >= state.next_solution_s - _SAME_TIME_S and state.rows >= LEAST_ROWS:
                self._take(state, block.values[start : k + 1])
                start = k + 1
                yield self._solve(state, t)
                state.next_solution_s = _next_solution_s(state.next_solution_s, t)
                state.rows = 0
        self._take(state, block.values[start:])

    def current(self, state: ChainState) -> Solution:
        """As of the last sample: the filter to that sample, the Fourier form to its last solution."""
        modes = {m.structure.name: self._read(state, m, None) for m in self._modes}
        return Solution(state.last_s, modes, state.air.found)

    def resume(self, state: ChainState, structure: str, information: Array, vector: Array) -> None:
        """The Fourier form of a structure goes on from a memory instead of from its closed blocks."""
        for m in self._modes:
            if m.structure.name == structure:
                m.fourier.resume(state.fourier[structure], information, vector)

    def _take(self, state: ChainState, values: Array) -> None:
        if not len(values):
            return
        self._air.take(state.air, values)
        for m in self._modes:
            name = m.structure.name
            signals = m.signals.update(state.signals[name], values[None])
            whole = signals if m.vane else m.signals.high_passed(state.signals[name], signals)
            m.fourier.update(state.fourier[name], whole)
            m.ekf.update(state.ekf[name], signals)
            gather_motion(state.motion[name], signals[0], MOTION_S)
            if not m.vane:
                forces = np.ascontiguousarray(signals[0, :, m.signals.config.layout.accelerometer])
                follow_roughness(state.roughness[name], forces, ROUGHNESS_SAMPLES)

    def _solve(self, state: ChainState, time_s: float) -> Solution:
        modes = {}
        for m in self._modes:
            name = m.structure.name
            m.fourier.solve(state.fourier[name])
            m.ekf.solve(state.ekf[name], m.fourier.sees(state.fourier[name]))
            closed = int(state.fourier[name].counts[0, 1])
            gained = None
            if closed != state.blocks.get(name, 0):
                state.blocks[name] = closed
                gained = m.ekf.take_gained(state.ekf[name])
            modes[name] = self._read(state, m, gained)
            # Rough air contradicts what is remembered, too; without a vane all may. Else the filter, which cannot
            # tell a change from the noise of its surfaces, is told.
            trusted = m.vane and not modes[name].rough
            state.fourier[name].follows[:] = trusted
            changed = m.fourier.changed(state.fourier[name])
            if changed.any() and trusted:
                not_yet_s = float(state.fourier[name].rows[0, 0, 0])  # a change begins the running block
                m.ekf.release(state.ekf[name], changed, since_s=not_yet_s)
        return Solution(time_s, modes, self._air.look(state.air, time_s))

    def _gusty(self, state: ChainState) -> bool:
        """Whether an accelerometer feels gusts: a fault is unrest too, but not rough from sample to sample."""
        return any(is_gusty(state.roughness[m.structure.name], m.force_noise_variance) for m in self._modes)

    def _read(self, state: ChainState, mode: _Mode, gained: tuple[Array, Array] | None) -> ModeSolution:
        name = mode.structure.name
        fourier = mode.fourier.estimate(state.fourier[name])
        unseen = mode.fourier.unseen(state.fourier[name])
        ekf = _gated(mode.ekf.estimate(state.ekf[name]), fourier, unseen)
        mean, square, _ = state.motion[name]
        with np.errstate(over="ignore"):  # a filter that diverged: infinitely rough all right
            share = mode.ekf.unrest_of(state.ekf[name], 0) / np.maximum(square - mean**2, 1e-12)
        rough = bool((share[1:] > ROUGH_SHARE).any())
        if not mode.vane:
            rough = _lately(state, name, rough and self._gusty(state))
            fourier, ekf = _without_vane(fourier, rough), _without_vane(ekf, rough)
        evidence = mode.fourier.evidence(state.fourier[name])
        return ModeSolution(mode.structure, fourier, ekf, evidence, gained, rough, not mode.vane)


def _next_solution_s(due_s: float, time_s: float) -> float:
    """The first instant of the grid on which ``due_s`` lies that is later than ``time_s``."""
    passed = np.floor((time_s + _SAME_TIME_S - due_s) / SOLUTION_INTERVAL_S)
    return due_s + SOLUTION_INTERVAL_S * (1.0 + max(0.0, float(passed)))


def _lately(state: ChainState, name: str, rough: bool) -> bool:
    """Whether the air is rough, or was within the time in which the estimators forget what it taught them."""
    if rough:
        state.rough_s[name] = state.last_s
    return 0.0 <= state.last_s - state.rough_s.get(name, -np.inf) < ROUGH_MEMORY_S


def _has_standing(estimate: Estimate) -> bool:
    """Whether any derivative has."""
    return any(o is not Outcome.NOT_OBSERVABLE for o in estimate.outcomes)


def _without_vane(estimate: Estimate, rough: bool) -> Estimate:
    """An estimate from a reconstructed velocity, with the standing that is left to it.

    The reconstruction integrates accelerometer and gyro: its noise goes together with theirs and grows towards low
    frequencies. The filter has that in its model, for it carries the velocity itself; the Fourier form takes a state's
    noise as white and its own, so its standard errors do not hold. Gusts are in neither.
    """
    if not _has_standing(estimate):
        return replace(estimate, reason=f"{NO_VANE}; {estimate.reason}")
    if not rough and estimate.estimator != "fourier":
        return replace(estimate, reason=f"{NO_VANE}; {estimate.reason}" if estimate.reason else NO_VANE)
    why = "rough air is not seen without a vane and passes for the aircraft's own"
    if not rough:
        why = "its errors leave out that the velocity's noise goes with the rates': the Kalman filter alone counts"
    outcomes = tuple(o if o is Outcome.NOT_OBSERVABLE else Outcome.REJECTED for o in estimate.outcomes)
    return replace(estimate, outcomes=outcomes, outcome=Outcome.REJECTED, reason=f"{NO_VANE}; {why}")


def _gated(ekf: Estimate, fourier: Estimate, unseen: NDArray[np.bool_]) -> Estimate:
    """The filter's estimate with the standing that the excitation allows.

    The filter cannot tell a noisy regressor from a moving one; the Fourier form can (its share of signal), so what it
    calls not observable for want of signal is not observable for the filter either.
    """
    apart = {symbol for names in fourier.confounded for symbol in names}
    hidden = [
        o is Outcome.NOT_OBSERVABLE and (bool(u) or symbol in apart)
        for o, u, symbol in zip(fourier.outcomes, unseen, fourier.structure.derivatives, strict=True)
    ]
    if not any(hidden):
        return ekf
    outcomes = tuple(
        Outcome.NOT_OBSERVABLE if h else own for h, own in zip(hidden, ekf.outcomes, strict=True)
    )
    confounded = tuple(dict.fromkeys((*ekf.confounded, *fourier.confounded)))
    if sum(hidden) > len(hidden) / 2 and ekf.outcome is not Outcome.REJECTED:
        return replace(
            ekf,
            outcomes=outcomes,
            outcome=Outcome.NOT_OBSERVABLE,
            reason=fourier.reason,
            confounded=confounded,
        )
    if confounded != ekf.confounded:
        text = told_apart_text(ekf.structure, confounded)
        reason = f"{text}; {ekf.reason}" if ekf.reason and not ekf.confounded else text
        return replace(ekf, outcomes=outcomes, reason=reason, confounded=confounded)
    return replace(ekf, outcomes=outcomes)


def _mode(
    aircraft: Aircraft, structure: ModeStructure, prior: Expectation, kinds: Mapping[str, str], vane: bool
) -> _Mode:
    """Both estimators of a structure, started from the a-priori expectation and free to leave it."""
    condition = prior.condition
    reference = (condition.airspeed_true_m_s, condition.air_density_kg_m3)
    value = prior.value - offsets(structure, condition.airspeed_true_m_s, condition.angle_of_attack_rad)
    error = np.sqrt(np.diagonal(prior.covariance))
    natural = np.maximum(np.abs(value), 2.0 * error)
    told = tuple(kinds.get(_INPUT_COLUMN[u], "position") == "command" for u in structure.inputs)
    sensors = aircraft.sensors
    imu = sensors.imu_position_m
    noise = tuple(
        0.0 if still else aircraft.noise_std(_INPUT_COLUMN[u]) or 0.0
        for u, still in zip(structure.inputs, told, strict=True)
    )
    servo_s = tuple(_servo_s(aircraft, u) for u in structure.inputs)
    # A command whose servo is known becomes the surface that it moves; any other acts as it stands.
    held = tuple(still and not lag_s for still, lag_s in zip(told, servo_s, strict=True))
    force = aircraft.noise_std(_FORCE_COLUMN[structure.states[0]]) or 0.0
    signals = SignalConfig(
        structure,
        sensors.vane_position_m,
        reference_airspeed_m_s=reference[0],
        reference_density_kg_m3=reference[1],
        servo_s=tuple(lag_s if still else 0.0 for still, lag_s in zip(told, servo_s, strict=True)),
        inertia=inertia_coupling(aircraft),
    )
    fourier = FourierConfig(
        structure,
        analysis_band_hz(aircraft, structure),
        value,
        3.0 * natural,
        reference,
        held=held,
        servo_s=servo_s,
        imu_position_m=imu,
        input_noise_std=noise,
        span_m=aircraft.geometry.span_m if aircraft.geometry else 0.0,
        vane_ahead_m=max(sensors.vane_position_m[0], 0.0),
        velocity_measured=vane,
    )
    ekf = EkfConfig(
        structure,
        value,
        natural,
        reference,
        held=held,
        servo_s=servo_s,
        imu_position_m=imu,
        noise_std=(0.0, *(aircraft.noise_std(_RATE_COLUMN[s]) or 0.0 for s in structure.states[1:])),
        input_noise_std=noise,
        span_m=aircraft.geometry.span_m if aircraft.geometry else 0.0,
    )
    return _Mode(structure, Signals(signals), FourierEstimator(fourier), EkfEstimator(ekf), vane, force**2)


def _servo_s(aircraft: Aircraft, symbol: str) -> float:
    """Time constant of a surface's servo, 0 where the aircraft file says nothing of it."""
    servo = getattr(aircraft.actuators, _SURFACE[symbol])
    return 1.0 / (2.0 * np.pi * servo.bandwidth_hz) if servo else 0.0
