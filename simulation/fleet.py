"""A fleet of simulated aircraft, stepped together: integration, autopilot, turbulence, sensors.

Everything is integrated at no less than 200 Hz, whatever the sample rate; the autopilot, the actuators and the gust
filter run with the integration. Effects are brought up to date once a sample. Each vehicle is computed by the same
scalar code from its own rows, so a flight is the same to the last bit alone and in any company.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.simulation.actuators import actuator_position
from wingwatch.simulation.autopilot import (
    AIRSPEED_DEMAND,
    ALTITUDE_DEMAND,
    INTEGRATORS,
    autopilot,
    autopilot_row,
)
from wingwatch.simulation.dynamics import (
    air_density,
    air_relative,
    derivatives,
    euler_angles,
    runge_kutta_step,
)
from wingwatch.simulation.effects import factor_row
from wingwatch.simulation.layout import (
    BANDWIDTH,
    COEFFICIENTS,
    IMU_X,
    POSITION_LIMIT,
    RATE_LIMIT,
    SPAN,
    STATE,
    VANE_X,
    coefficient_row,
    vehicle_row,
)
from wingwatch.simulation.manoeuvres import PULSE_COLUMNS, excitation, pulse_rows
from wingwatch.simulation.scenario import Scenario
from wingwatch.simulation.sensors import NormalStreams, Sensors
from wingwatch.simulation.trim import TrimPoint, trim
from wingwatch.simulation.turbulence import STATES, step_gust, turbulence_filter
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, SampleBlock

__all__ = ["FleetSimulation", "simulate"]

LEAST_INTEGRATION_HZ = 200.0

_TIME, _AIRSPEED, _RATES = (CHANNEL_INDEX[c] for c in ("time_s", "airspeed_true_m_s", "roll_rate_rad_s"))
_FORCES, _ROLL = CHANNEL_INDEX["specific_force_x_m_s2"], CHANNEL_INDEX["roll_rad"]
_SURFACES, _COMMANDS = CHANNEL_INDEX["elevator_rad"], CHANNEL_INDEX["elevator_command_rad"]
_ALPHA, _BETA = CHANNEL_INDEX["angle_of_attack_rad"], CHANNEL_INDEX["sideslip_rad"]
_THROTTLE, _ALTITUDE, _DENSITY = (CHANNEL_INDEX[c] for c in ("throttle", "altitude_m", "air_density_kg_m3"))
_DEMANDS = CHANNEL_INDEX["roll_demand_rad"]
"""First of each group; the members follow one another in the flight table."""


class Fleet(NamedTuple):
    """What does not change in a flight; the first axis is the vehicle."""

    vehicle: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    effects: NDArray[np.float64]
    """(vehicles, effects, 3): size, onset, ramp."""
    factors: NDArray[np.float64]
    """(vehicles, effects, coefficients)."""
    pulses: NDArray[np.float64]
    pulse_count: NDArray[np.int64]
    gains: NDArray[np.float64]
    wind: NDArray[np.float64]
    turbulent: NDArray[np.bool_]
    transition: NDArray[np.float64]
    input_gain: NDArray[np.float64]
    gust_output: NDArray[np.float64]
    stationary: NDArray[np.float64]


class FleetState(NamedTuple):
    """What changes; the first axis is the vehicle."""

    rigid: NDArray[np.float64]
    surfaces: NDArray[np.float64]
    integrals: NDArray[np.float64]
    gust_filter: NDArray[np.float64]
    gust: NDArray[np.float64]


class _Vehicle(NamedTuple):
    """Rows of one vehicle, from ``Fleet`` and ``FleetState``."""

    vehicle: NDArray[np.float64]
    pulses: NDArray[np.float64]
    pulse_count: int
    gains: NDArray[np.float64]
    wind: NDArray[np.float64]
    turbulent: bool
    transition: NDArray[np.float64]
    input_gain: NDArray[np.float64]
    gust_output: NDArray[np.float64]
    rigid: NDArray[np.float64]
    surfaces: NDArray[np.float64]
    integrals: NDArray[np.float64]
    gust_filter: NDArray[np.float64]
    gust: NDArray[np.float64]


class Work(NamedTuple):
    """Work space of one vehicle at a time."""

    coefficients: NDArray[np.float64]
    air: NDArray[np.float64]
    load: NDArray[np.float64]
    rates: NDArray[np.float64]
    orders: NDArray[np.float64]
    command: NDArray[np.float64]
    positions: NDArray[np.float64]
    gusts: NDArray[np.float64]
    stages: NDArray[np.float64]


def _work() -> Work:
    shapes = (len(COEFFICIENTS), 6, 8, len(STATE), 6, 3, (3, 3), (2, 6), (5, len(STATE)))
    return Work(*(np.zeros(shape) for shape in shapes))


@njit(cache=True, error_model="numpy")
def _coefficients_now(clean, effects, factors, time_s, out):  # type: ignore[no-untyped-def]
    """Coefficients under all effects at a time; the severity is that of ``Effect.severity``."""
    for j in range(clean.size):
        out[j] = clean[j]
    for e in range(effects.shape[0]):
        size, since, ramp = effects[e, 0], time_s - effects[e, 1], effects[e, 2]
        if size == 0.0 or since < 0.0:
            continue
        severity = size if since >= ramp else size * since / ramp
        for j in range(clean.size):
            out[j] *= 1.0 + severity * factors[e, j]


@njit(cache=True, error_model="numpy")
def _report(row, time_s, state, surfaces, gains, vehicle, w):  # type: ignore[no-untyped-def]
    """True values of every simulated column; ``w`` holds the derivatives, forces and commands of this instant."""
    p, q, r = state[10], state[11], state[12]
    pd, qd, rd = w.rates[10], w.rates[11], w.rates[12]
    x, y, z = vehicle[IMU_X], vehicle[IMU_X + 1], vehicle[IMU_X + 2]
    row[_TIME] = time_s
    air = w.air
    row[_AIRSPEED] = math.sqrt(air[0] * air[0] + air[1] * air[1] + air[2] * air[2])
    row[_RATES], row[_RATES + 1], row[_RATES + 2] = p, q, r
    row[_FORCES] = w.load[0] - (q * q + r * r) * x + (p * q - rd) * y + (p * r + qd) * z
    row[_FORCES + 1] = w.load[1] + (p * q + rd) * x - (p * p + r * r) * y + (q * r - pd) * z
    row[_FORCES + 2] = w.load[2] + (p * r - qd) * x + (q * r + pd) * y - (p * p + q * q) * z
    row[_ROLL], row[_ROLL + 1], row[_ROLL + 2] = euler_angles(state)
    for j in range(3):
        row[_SURFACES + j] = surfaces[j]
        row[_COMMANDS + j] = w.command[j]
    x, y, z = vehicle[VANE_X], vehicle[VANE_X + 1], vehicle[VANE_X + 2]
    u, v, w_vane = air[0] + q * z - r * y, air[1] + r * x - p * z, air[2] + p * y - q * x
    row[_ALPHA] = math.atan2(w_vane, u)
    row[_BETA] = math.atan2(v, math.sqrt(u * u + w_vane * w_vane))
    row[_THROTTLE] = w.orders[3]
    row[_ALTITUDE] = -state[2]
    row[_DENSITY] = air_density(-state[2])
    row[_DEMANDS], row[_DEMANDS + 1] = w.orders[4], w.orders[5]
    row[_DEMANDS + 2], row[_DEMANDS + 3] = gains[AIRSPEED_DEMAND], gains[ALTITUDE_DEMAND]


@njit(cache=True, error_model="numpy")
def _substep(time_s, dt, one, normals, w, row):  # type: ignore[no-untyped-def]
    """Advance one vehicle by ``dt``; a row that is not empty gets the values at the start of it."""
    vehicle, rigid, gusts, positions = one.vehicle, one.rigid, w.gusts, w.positions
    for j in range(6):
        gusts[0, j] = one.gust[j]
        gusts[1, j] = one.gust[j]
    air_relative(rigid, one.wind, gusts[0], w.air)
    airspeed = math.sqrt(w.air[0] * w.air[0] + w.air[1] * w.air[1] + w.air[2] * w.air[2])
    autopilot(rigid, airspeed, one.gains, one.integrals, dt, w.orders)
    excitation(one.pulses, one.pulse_count, time_s, w.command)
    for j in range(3):
        w.command[j] += w.orders[j]
        for stage in range(3):
            positions[stage, j] = actuator_position(
                one.surfaces[j], w.command[j], vehicle[BANDWIDTH + j], vehicle[RATE_LIMIT + j],
                vehicle[POSITION_LIMIT + j], 0.5 * stage * dt,
            )  # fmt: skip
    throttle = w.orders[3]
    derivatives(
        rigid, positions[0], throttle, one.wind, gusts[0], vehicle, w.coefficients, w.air, w.load, w.rates
    )
    if row.size > 0:
        _report(row, time_s, rigid, positions[0], one.gains, vehicle, w)
    if one.turbulent:
        step_gust(one.transition, one.input_gain, one.gust_output, one.gust_filter, normals, gusts[1])
        for j in range(6):
            one.gust[j] = gusts[1, j]
    runge_kutta_step(
        rigid, w.rates, dt, positions, throttle, one.wind, gusts, vehicle, w.coefficients, w.stages
    )
    for j in range(3):
        one.surfaces[j] = positions[2, j]


@njit(cache=True, error_model="numpy")
def _fly(fleet, state, first_sample, rate_hz, substeps, normals, w, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (vehicles, samples, channels) with true values, advancing the state by as many samples."""
    dt = 1.0 / (rate_hz * substeps)
    nothing = np.empty(0)
    for i in range(out.shape[0]):
        one = _Vehicle(
            fleet.vehicle[i], fleet.pulses[i], fleet.pulse_count[i], fleet.gains[i], fleet.wind[i], fleet.turbulent[i],
            fleet.transition[i], fleet.input_gain[i], fleet.gust_output[i], state.rigid[i], state.surfaces[i],
            state.integrals[i], state.gust_filter[i], state.gust[i],
        )  # fmt: skip
        clean, effects, factors = fleet.coefficients[i], fleet.effects[i], fleet.factors[i]
        for k in range(out.shape[1]):
            start = (first_sample + k) / rate_hz
            _coefficients_now(clean, effects, factors, start, w.coefficients)
            for s in range(substeps):
                row = out[i, k] if s == 0 else nothing
                numbers = normals[i, k, s * STATES : (s + 1) * STATES] if one.turbulent else nothing
                _substep(start + s * dt, dt, one, numbers, w, row)


class FleetSimulation:
    """Flights of several scenarios, stepped together.

    Args:
        scenarios: one a vehicle.
        rate_hz: samples a second.

    Raises:
        ValueError: no scenario, or a rate outside 1 to 1000 Hz.
        AircraftDataError, TrimError: an aircraft that cannot be simulated, or not be trimmed as asked.
    """

    def __init__(self, scenarios: Sequence[Scenario], rate_hz: float = 50.0) -> None:
        if not scenarios:
            raise ValueError("a fleet without a scenario cannot fly; give at least one")
        if not 1.0 <= rate_hz <= 1000.0:
            raise ValueError(f"rate_hz is {rate_hz}; give 1 to 1000 samples a second")
        self.scenarios = tuple(scenarios)
        self.rate_hz = float(rate_hz)
        self._substeps = max(1, math.ceil(LEAST_INTEGRATION_HZ / rate_hz - 1e-9))
        streams = [
            [np.random.default_rng(c) for c in np.random.SeedSequence(s.seed).spawn(2)] for s in scenarios
        ]
        points = [trim(s.aircraft, s.condition, effects=s.effects) for s in scenarios]
        self._fleet = _fleet(self.scenarios, points, 1.0 / (rate_hz * self._substeps))
        self._state = _initial_state(self.scenarios, points, self._fleet, [air for air, _ in streams])
        widths = [self._substeps * STATES if s.turbulence != "none" else 0 for s in scenarios]
        self._air_normals = NormalStreams([air for air, _ in streams], widths)
        self._sensors = Sensors(scenarios, [sensors for _, sensors in streams], rate_hz)
        self._samples = 0
        self._work = _work()

    @property
    def time_s(self) -> float:
        """Time stamp of the next sample."""
        return self._samples / self.rate_hz

    def step(self, n_samples: int) -> NDArray[np.float64]:
        """The next samples of every vehicle.

        Returns:
            Shape (vehicles, n_samples, channels) in the order of ``CHANNELS``, NaN in columns that are not simulated.
            The first sample of a flight, at time 0, is the trimmed aircraft.

        Raises:
            ValueError: a negative number of samples.
        """
        if n_samples < 0:
            raise ValueError(f"n_samples is {n_samples}; give a number of samples from 0")
        out = np.full((len(self.scenarios), n_samples, len(CHANNELS)), np.nan)
        normals = np.ascontiguousarray(self._air_normals.take(n_samples))
        _fly(self._fleet, self._state, self._samples, self.rate_hz, self._substeps, normals, self._work, out)
        self._samples += n_samples
        self._sensors.read(out)
        return out


def simulate(scenario: Scenario, seconds: float, rate_hz: float = 50.0) -> SampleBlock:
    """One flight from time 0; as many samples as fit into ``seconds``, at least one.

    Raises:
        ValueError: a length that is not positive; else as ``FleetSimulation``.
    """
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise ValueError(f"seconds is {seconds}; give a positive length of flight")
    return SampleBlock(FleetSimulation([scenario], rate_hz).step(max(1, round(seconds * rate_hz)))[0])


def _fleet(scenarios: Sequence[Scenario], points: Sequence[TrimPoint], dt_s: float) -> Fleet:
    effects = [[(e.size, e.onset_s, e.ramp_s) for e in s.effects] for s in scenarios]
    factors = [[factor_row(e) for e in s.effects] for s in scenarios]
    pulses = [pulse_rows(s.manoeuvres) for s in scenarios]
    vehicle = np.array([vehicle_row(s.aircraft) for s in scenarios])
    filters = [
        turbulence_filter(s.turbulence, s.altitude_m, s.airspeed_true_m_s, float(row[SPAN]), dt_s)
        for s, row in zip(scenarios, vehicle, strict=True)
    ]
    return Fleet(
        vehicle=vehicle,
        coefficients=np.array([coefficient_row(s.aircraft) for s in scenarios]),
        effects=_padded(effects, 3),
        factors=_padded(factors, len(COEFFICIENTS)),
        pulses=_padded([list(rows) for rows in pulses], PULSE_COLUMNS),
        pulse_count=np.array([len(rows) for rows in pulses], dtype=np.int64),
        gains=np.array(
            [
                autopilot_row(s.aircraft, s.condition, point)
                for s, point in zip(scenarios, points, strict=True)
            ]
        ),
        wind=np.array([s.wind_m_s for s in scenarios], dtype=np.float64),
        turbulent=np.array([s.turbulence != "none" for s in scenarios]),
        transition=np.array([f.transition for f in filters]),
        input_gain=np.array([f.input_gain for f in filters]),
        gust_output=np.array([f.output for f in filters]),
        stationary=np.array([f.stationary for f in filters]),
    )


def _padded(
    rows: Sequence[Sequence[Sequence[float] | NDArray[np.float64]]], columns: int
) -> NDArray[np.float64]:
    """Tables of different length as one array, zeros below the shorter ones."""
    out = np.zeros((len(rows), max(len(r) for r in rows), columns))
    for i, table in enumerate(rows):
        if len(table) > 0:
            out[i, : len(table)] = table
    return out


def _initial_state(
    scenarios: Sequence[Scenario],
    points: Sequence[TrimPoint],
    fleet: Fleet,
    generators: Sequence[np.random.Generator],
) -> FleetState:
    """Trimmed in the air that each vehicle is in: it moves with the wind and with the gust of the first instant."""
    n = len(scenarios)
    gust_filter, gust = np.zeros((n, STATES)), np.zeros((n, 6))
    rigid = np.array([p.state for p in points])
    air = np.zeros(6)
    for i, (s, generator) in enumerate(zip(scenarios, generators, strict=True)):
        if s.turbulence != "none":
            gust_filter[i] = fleet.stationary[i] @ generator.standard_normal(STATES)
            gust[i] = fleet.gust_output[i] @ gust_filter[i]
        air_relative(rigid[i], fleet.wind[i], gust[i], air)
        rigid[i, 3:6] += rigid[i, 3:6] - air[:3]
    surfaces = np.array([p.surfaces_rad for p in points])
    return FleetState(rigid, surfaces, np.zeros((n, INTEGRATORS)), gust_filter, gust)
