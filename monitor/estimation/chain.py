"""One aircraft's estimation chain: clean samples in, solutions of every mode out; the same live and offline.

Solutions fall on a grid of half seconds of the samples' own time stamps, so how samples were cut into messages
changes nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    SURFACE_OF_INPUT,
    Aircraft,
    FlightCondition,
    ModeStructure,
    analysis_band_hz,
)
from wingwatch.baselines import Envelope, Expectation, OutOfEnvelope, apriori_envelope
from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    FourierConfig,
    FourierEstimator,
    SignalConfig,
    Signals,
    inertia_coupling,
    offsets,
    padded,
)
from wingwatch.monitor.estimation.air_watch import AirState, AirWatch, PendingAir
from wingwatch.monitor.estimation.lacking_surfaces import (
    derivatives_by,
    disturbed_by,
    lacking_surfaces,
    missing_beside,
    why_lacking,
)
from wingwatch.monitor.estimation.mode_solution import ModeSolution, Pair
from wingwatch.monitor.estimation.solution_times import find_due
from wingwatch.monitor.estimation.supervision import Lane, PairState, Supervisor
from wingwatch.monitor.state_codec import detached
from wingwatch.telemetry import CHANNEL_INDEX, INPUT_CHANNELS, SampleBlock
from wingwatch.telemetry.conditioning import AirQuality

__all__ = [
    "Chain",
    "ChainState",
    "SavedChain",
    "Solution",
    "STRUCTURES_WATCHED",
    "NO_CONDITION",
    "condition_of",
    "nominal_condition",
]

Array = NDArray[np.float64]

STRUCTURES_WATCHED: tuple[ModeStructure, ...] = (SHORT_PERIOD, LATERAL, DUTCH_ROLL)
"""The Dutch roll stands in for the lateral structure, which holds it, where that cannot be estimated."""

NO_CONDITION = (
    "airspeed, altitude and accelerometers contradict each other, so the last block is not compared"
)

_VANE = {"w": "angle_of_attack_rad", "v": "sideslip_rad"}
_FORCE_COLUMN = {"w": "specific_force_z_m_s2", "v": "specific_force_y_m_s2"}
_RATE_COLUMN = {"p": "roll_rate_rad_s", "q": "pitch_rate_rad_s", "r": "yaw_rate_rad_s"}


@dataclass(frozen=True, slots=True)
class Solution:
    """All modes at one instant of the vehicle's clock."""

    time_s: float
    modes: Mapping[str, ModeSolution]


@dataclass(slots=True)
class ChainState:
    """What a chain remembers of one vehicle, and the lane with what its estimators do."""

    lane: Lane
    air: AirState = field(default_factory=AirState)
    next_solution_s: float = float("nan")
    last_s: float = float("nan")
    rows: int = 0
    """Samples since the last solution or the last step too long for one."""


@dataclass(frozen=True, slots=True)
class SavedChain:
    """A ``ChainState`` with what is in its lane, one state a structure, each a batch of one."""

    estimators: Mapping[str, PairState]
    air: AirState
    next_solution_s: float
    last_s: float
    rows: int


def nominal_condition(aircraft: Aircraft) -> FlightCondition | None:
    """The condition that an aircraft's derivatives are referred to (``Aircraft.nominal_condition``)."""
    return aircraft.nominal_condition


def condition_of(found: tuple[float, float, float, float], configuration: str) -> FlightCondition | None:
    """Airspeed m/s, altitude m, density kg/m3 and angle of attack rad as a flight condition; None if impossible.

    A filter that has started anew has no condition, and an airspeed that is carried on by accelerometers at their
    limits may become negative.
    """
    airspeed_m_s, altitude_m, density_kg_m3, alpha_rad = found
    alpha_rad = alpha_rad if np.isfinite(alpha_rad) else 0.0
    try:
        return FlightCondition(airspeed_m_s, altitude_m, density_kg_m3, configuration, alpha_rad)
    except ValueError:
        return None


class Chain:
    """Estimators of every mode for which the aircraft file gives an expectation and the samples the channels.

    Args:
        aircraft: its file.
        present: names of the channels that the samples carry.
        kinds: ``position`` or ``command`` for the surfaces; what is not named is a position.
        configuration: of the aircraft.
        envelopes: expectations that take the place of the aircraft file's, by structure.
        engine: of the filter, ``compiled`` or ``filterpy``.
        memory_s: time constant with which both estimators forget; their own where None.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        present: Sequence[str],
        kinds: Mapping[str, str],
        configuration: str = "clean",
        envelopes: Mapping[str, Envelope] | None = None,
        engine: Literal["compiled", "filterpy"] = "compiled",
        memory_s: float | None = None,
    ) -> None:
        self.aircraft = aircraft
        given = envelopes or {}
        self.envelopes: dict[str, Envelope] = {}
        self.absent: dict[str, str] = {}
        self._zeros = np.empty(0, dtype=np.intp)
        self._air = AirWatch(aircraft)
        pairs: list[Pair] = []
        for structure in STRUCTURES_WATCHED:
            if structure is DUTCH_ROLL and LATERAL.name in self.envelopes:
                self.absent[structure.name] = "part of the lateral structure"
                continue
            missing = missing_beside(aircraft, structure, present)
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
            lacking = lacking_surfaces(aircraft, structure, present)
            if lacking:
                self.absent[", ".join(derivatives_by(structure, lacking))] = why_lacking(lacking)
                self._zeros = np.array([CHANNEL_INDEX[channel] for channel in lacking])
            disturbed = disturbed_by(aircraft, structure, lacking)
            pair = _set(_pair(aircraft, structure, prior, kinds, vane), engine, memory_s)
            pairs.append(replace(pair, lacking=lacking, disturbed=disturbed))
        self.supervisor = Supervisor(pairs)

    @property
    def structures(self) -> tuple[ModeStructure, ...]:
        """Structures that are estimated."""
        return tuple(p.structure for p in self.supervisor.pairs.values())

    def _prior(self, envelope: Envelope) -> Expectation | str:
        nominal = nominal_condition(self.aircraft)
        if nominal is None:
            return f"aircraft {self.aircraft.name} states neither [envelope] nor [[conditions]]"
        found = envelope.lookup(nominal)
        return found.reason if isinstance(found, OutOfEnvelope) else found

    def of_another(self) -> "Chain":
        """The chain of another vehicle of this type and these channels: both share estimators, each in its lane.

        Expectations are each vehicle's own.
        """
        other = copy(self)
        other.envelopes = dict(self.envelopes)
        return other

    def init(self) -> ChainState:
        """State before the first sample."""
        return ChainState(self.supervisor.join())

    def saved(self, state: ChainState) -> SavedChain:
        """A copy of all that is remembered of one vehicle."""
        return SavedChain(
            self.supervisor.saved(state.lane),
            detached(state.air),
            state.next_solution_s,
            state.last_s,
            state.rows,
        )

    def restore(self, state: ChainState, saved: SavedChain) -> None:
        """Go on from what ``saved`` gave, in a state that has seen no sample.

        Raises:
            ValueError: it is of other estimators.
        """
        self.supervisor.restore(state.lane, saved.estimators)
        state.air, state.next_solution_s = saved.air, saved.next_solution_s
        state.last_s, state.rows = saved.last_s, saved.rows

    def advance(self, state: ChainState, block: SampleBlock) -> Iterator[Solution]:
        """Take in clean samples; yields a solution at every half second of their clock.

        Samples slower than 10 Hz have to be ``LEAST_ROWS`` for a solution; at 2 Hz and slower there is none.
        """
        faults: dict[int, Exception] = {}
        for solutions in self.advance_together([state], [block], faults):
            yield from solutions.values()
        if faults:
            raise faults[0]

    def advance_together(
        self, states: Sequence[ChainState], blocks: Sequence[SampleBlock], faults: dict[int, Exception]
    ) -> Iterator[dict[int, Solution]]:
        """Vehicles of this chain's type advance together, each as if it were alone.

        Args:
            states: of different vehicles, of this chain or of those made by ``of_another``.
            blocks: clean samples of each.
            faults: by the vehicle's number in ``states``, what the program failed on; such a vehicle goes no further in
                these samples. The caller may enter faults of its own between one round of solutions and the next.

        Yields:
            by number, the solutions of all vehicles that have come to their next one.
        """
        dues = [_due(state, block.time_s) for state, block in zip(states, blocks, strict=True)]
        starts = [0] * len(states)
        going = list(range(len(states)))
        while going:
            pieces: dict[int, Array] = {}
            due: list[int] = []
            for n in going:
                try:
                    k = next(dues[n], None)
                    end = len(blocks[n]) if k is None else k + 1
                    values = blocks[n].values[starts[n] : end]
                    if self._zeros.size:
                        values = values.copy()
                        values[:, self._zeros] = 0.0
                    if len(values):
                        self._air.take(states[n].air, values)
                    if k is not None:
                        self._air.look(states[n].air, states[n].last_s)
                except Exception as error:  # one vehicle's fault is not the others'
                    faults[n] = error
                    continue
                if k is not None:
                    due.append(n)
                if len(values):
                    pieces[n] = values
                starts[n] = end
            if pieces:
                rows, lanes = padded([states[n].lane.place for n in pieces], list(pieces.values()))
                try:
                    self.supervisor.take(lanes, rows)
                except (
                    Exception
                ) as error:  # none of them can go on from a step half done; those of other types can
                    faults |= dict.fromkeys(pieces, error)
                    due = [n for n in due if n not in pieces]
            if due:
                yield self._solve(states, due, faults)
            going = [n for n in due if n not in faults]

    def _solve(
        self, states: Sequence[ChainState], due: Sequence[int], faults: dict[int, Exception]
    ) -> dict[int, Solution]:
        """Solutions by number; a vehicle that the program failed on has none, but is in ``faults``."""
        at_s = [states[n].last_s for n in due]
        places = np.array([states[n].lane.place for n in due])
        of_places: dict[int, Exception] = {}
        try:
            modes = self.supervisor.solve(places, np.array(at_s), of_places)
        except Exception as error:
            faults |= dict.fromkeys(due, error)
            return {}
        faults |= {n: of_places[states[n].lane.place] for n in due if states[n].lane.place in of_places}
        solved = zip(due, at_s, modes, strict=True)
        return {n: Solution(last_s, found) for n, last_s, found in solved if n not in faults}

    def current(self, state: ChainState) -> Solution:
        """As of the last sample: the filter to that sample, the Fourier estimator to its last solution."""
        return Solution(state.last_s, self.supervisor.read(state.lane, state.last_s))

    def air(self, state: ChainState) -> AirQuality | None:
        """Gusts of the last half minute as of the last solution; None where they are not known."""
        return self._air.quality(state.air)

    def pending_air(self, state: ChainState) -> PendingAir | None:
        """The same before it is worked out; None where nothing is to be."""
        return self._air.pending(state.air)

    def resume(self, state: ChainState, structure: str, information: Array, vector: Array) -> None:
        """The Fourier estimator of a structure continues from a memory instead of from its closed blocks.

        ``information`` (k, k), ``vector`` (k,): J and h of the derivatives at the reference, concise.
        """
        self.supervisor.resume(state.lane, structure, information, vector)


def _due(state: ChainState, time_s: Array) -> Iterator[int]:
    """Rows after which there is a solution, in order; the state's clock stands at each when it is given."""
    if not time_s.size:
        return
    memory = np.array([state.last_s, state.next_solution_s, state.rows])
    found = np.empty(time_s.size, dtype=np.int64)
    number = find_due(np.ascontiguousarray(time_s), memory, found)
    state.next_solution_s, state.rows = float(memory[1]), int(memory[2])
    for k in found[:number].tolist():
        state.last_s = float(time_s[k])
        yield k
    state.last_s = float(time_s[-1])


def _pair(
    aircraft: Aircraft, structure: ModeStructure, prior: Expectation, kinds: Mapping[str, str], vane: bool
) -> Pair:
    """Both estimators of a structure, started from the a-priori expectation and free to leave it."""
    condition = prior.condition
    reference = (condition.airspeed_true_m_s, condition.air_density_kg_m3)
    value = prior.value - offsets(structure, condition.airspeed_true_m_s, condition.angle_of_attack_rad)
    error = np.sqrt(np.diagonal(prior.covariance))
    natural = np.maximum(np.abs(value), 2.0 * error)
    natural[natural == 0.0] = 1.0  # of a surface without effect, about which nothing is known either
    commanded = tuple(kinds.get(INPUT_CHANNELS[u], "position") == "command" for u in structure.inputs)
    sensors = aircraft.sensors
    imu = sensors.imu_position_m
    noise = tuple(
        0.0 if still else aircraft.noise_std(INPUT_CHANNELS[u]) or 0.0
        for u, still in zip(structure.inputs, commanded, strict=True)
    )
    servo_s, limits = zip(*(_servo(aircraft, u) for u in structure.inputs), strict=True)
    # A limit that the file states too low would move all of a surface that nobody read, and moves little of one that
    # was read (decision 73).
    servo_rate_rad_s = tuple(0.0 if still else limit for still, limit in zip(commanded, limits, strict=True))
    # A command whose servo is known becomes the surface that it moves; any other acts as it stands.
    held = tuple(still and not lag_s for still, lag_s in zip(commanded, servo_s, strict=True))
    force = aircraft.noise_std(_FORCE_COLUMN[structure.states[0]]) or 0.0
    signals = SignalConfig(
        structure,
        sensors.vane_position_m,
        reference_airspeed_m_s=reference[0],
        reference_density_kg_m3=reference[1],
        servo_s=tuple(lag_s if still else 0.0 for still, lag_s in zip(commanded, servo_s, strict=True)),
        vane_leads=True,
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
        servo_rate_rad_s=servo_rate_rad_s,
        imu_position_m=imu,
        input_noise_std=noise,
        span_m=aircraft.geometry.span_m if aircraft.geometry else 0.0,
        vane_ahead_m=max(aircraft.sensors.vane_position_m[0], 0.0) if vane else 0.0,
        velocity_measured=vane,
    )
    ekf = EkfConfig(
        structure,
        value,
        natural,
        reference,
        held=held,
        servo_s=servo_s,
        servo_rate_rad_s=servo_rate_rad_s,
        imu_position_m=imu,
        noise_std=(0.0, *(aircraft.noise_std(_RATE_COLUMN[s]) or 0.0 for s in structure.states[1:])),
        input_noise_std=noise,
        accelerometer_noise_std=force,
        span_m=aircraft.geometry.span_m if aircraft.geometry else 0.0,
    )
    return Pair(structure, Signals(signals), FourierEstimator(fourier), EkfEstimator(ekf), vane, force**2)


def _set(pair: Pair, engine: Literal["compiled", "filterpy"], memory_s: float | None) -> Pair:
    """Estimators with another engine of the filter and another memory, where these are asked for."""
    fourier, ekf = pair.fourier.config, pair.ekf.config
    memory_s = fourier.memory_s if memory_s is None else memory_s
    if memory_s != fourier.memory_s:
        pair = replace(pair, fourier=FourierEstimator(replace(fourier, memory_s=memory_s)))
    if (engine, memory_s) != (ekf.engine, ekf.memory_s):
        pair = replace(pair, ekf=EkfEstimator(replace(ekf, engine=engine, memory_s=memory_s)))
    return pair


def _servo(aircraft: Aircraft, symbol: str) -> tuple[float, float]:
    """Time constant of a surface's servo, s, and its rate limit, rad/s; 0 where the file says nothing of it."""
    servo = getattr(aircraft.actuators, SURFACE_OF_INPUT[symbol])
    if servo is None:
        return 0.0, 0.0
    return 1.0 / (2.0 * np.pi * servo.bandwidth_hz), servo.rate_limit_rad_s or 0.0
