"""Records of the thesis's plants: its inputs, its noise, its sensors' delays.

What the thesis states: a 2-degree doublet with the pulses of table 7.1 on the Aerosonde, 50 Hz, signal-to-noise 5 on
velocity, rate and accelerometer; delays of 50 ms (rate) and 60 ms (accelerometer) of the Jetstream's inertial sensors.
What it does not state is chosen here and said in every row that rests on it: where an input begins, how long a record
is, and of the Jetstream's recorded inputs, which are not public, all but their amplitude and kind.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import ModeStructure
from wingwatch.estimators import SignalLayout
from wingwatch.simulation import linear_response, state_rates
from wingwatch.studies.thesis.printed import Plant, printed_pulses

__all__ = [
    "RATE_HZ",
    "SIGNAL_TO_NOISE",
    "Flown",
    "Record",
    "doublet",
    "flown",
    "jetstream_input",
    "measured",
    "repeated_doublets",
]

Array = NDArray[np.float64]

RATE_HZ = 50.0
SIGNAL_TO_NOISE = 5.0
_FINE = 2
"""Steps of the plant to a sample: 50 ms are two and a half samples."""
_START_S = 1.0
_DOUBLET_RAD = math.radians(2.0)
_RATE_DELAY_S, _ACCELEROMETER_DELAY_S = 0.05, 0.06
_IMPULSE_S, _IMPULSES_AT_S = 0.3, (1.5, 9.5)
_DRIVEN_FROM_S, _DRIVEN_TO_S, _DRIVEN_RAD_S = 4.0, 13.0, 2.2
_IMPULSE_RAD = {"aerosonde": math.radians(2.5), "jetstream": math.radians(10.0)}
_LAYOUT = SignalLayout(2, 1)


@dataclass(frozen=True, slots=True)
class Flown:
    """What a plant did, without noise.

    Attributes:
        plant: that flew.
        surface: rad from trim, held between samples, (samples,).
        states: velocity in m/s and rate in rad/s from trim, as the sensors have them, (samples, 2).
        force: the accelerometer without gravity, m/s2, (samples,).
    """

    plant: Plant
    surface: Array
    states: Array
    force: Array


@dataclass(frozen=True, slots=True)
class Record:
    """What was measured.

    Attributes:
        flown: without noise.
        rows: signal rows, (samples, columns), as ``wingwatch.estimators.Signals`` lays them out.
    """

    flown: Flown
    rows: Array

    @property
    def states(self) -> Array:
        """Measured velocity and rate, (samples, 2)."""
        return self.rows[:, 1:3]


def doublet(plant: Plant, seconds: float) -> Array:
    """The doublet of table 7.1 from 1 s on, rad, (samples,)."""
    return repeated_doublets(plant, seconds, math.inf)


def repeated_doublets(plant: Plant, seconds: float, every_s: float) -> Array:
    """The same again and again."""
    pulse = round(_pulse_s(plant) * RATE_HZ)
    u = np.zeros(round(seconds * RATE_HZ))
    start = _START_S
    while start < seconds:
        first = round(start * RATE_HZ)
        u[first : first + pulse] = _DOUBLET_RAD
        u[first + pulse : first + 2 * pulse] = -_DOUBLET_RAD
        start += every_s
    return u


def _pulse_s(plant: Plant) -> float:
    return printed_pulses().by_plant[plant.name][1]


def jetstream_input(plant: Plant, seconds: float) -> Array:
    """What stands in for the Jetstream's recorded input, rad, (samples,).

    Elevator: an impulse up and one down, 10 degrees, 2.5 on the Aerosonde. Rudder: 2 degrees to and fro at the
    frequency of the flown Dutch roll, 2.2 rad/s, from 4 to 13 s.
    """
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    if plant.structure.states[1] == "r":
        on = (t >= _DRIVEN_FROM_S) & (t < _DRIVEN_TO_S)
        return np.asarray(np.where(on, _DOUBLET_RAD * np.sin(_DRIVEN_RAD_S * (t - _DRIVEN_FROM_S)), 0.0))
    size = _IMPULSE_RAD[plant.name.partition("_")[0]]
    up, down = ((t >= at) & (t < at + _IMPULSE_S) for at in _IMPULSES_AT_S)
    return np.asarray(size * (up.astype(float) - down.astype(float)))


def flown(plant: Plant, surface: Array, *, delayed: bool = False) -> Flown:
    """The plant's exact response; ``delayed`` as the Jetstream's sensors pass it on."""
    return Flown(
        plant, surface, *_response(plant.structure, plant.derivatives, plant.turn, surface.tobytes(), delayed)
    )


@cache
def _response(
    structure: ModeStructure, derivatives: tuple[float, ...], turn: float, surface: bytes, delayed: bool
) -> tuple[Array, Array]:
    u = np.repeat(np.frombuffer(surface), _FINE)
    by_symbol = dict(zip(structure.derivatives, derivatives, strict=True))
    states = linear_response(structure, by_symbol, u, 1.0 / (RATE_HZ * _FINE))
    force = state_rates(structure, by_symbol, states, u)[:, 0] - turn * states[:, 1]
    if delayed:
        states = np.column_stack([states[:, 0], _late(states[:, 1], _RATE_DELAY_S)])
        force = _late(force, _ACCELEROMETER_DELAY_S)
    return states[::_FINE].copy(), force[::_FINE].copy()


def _late(column: Array, delay_s: float) -> Array:
    steps = round(delay_s * RATE_HZ * _FINE)
    return np.concatenate([np.zeros(steps), column[:-steps]])


def measured(flight: Flown, seed: int | None, loudness: Flown | None = None) -> Record:
    """The record of a flight with white noise of a seed; without any where it is None.

    Args:
        flight: what was flown.
        seed: of the noise.
        loudness: the flight whose signals the noise is a fifth of, where it is another.
    """
    plant = flight.plant
    states, force = flight.states, flight.force
    if seed is not None:
        rng = np.random.default_rng(seed)
        signal = loudness or flight
        states = states + signal.states.std(axis=0) / SIGNAL_TO_NOISE * rng.standard_normal(states.shape)
        force = force + signal.force.std() / SIGNAL_TO_NOISE * rng.standard_normal(force.size)
    rows = np.zeros((len(states), _LAYOUT.columns))
    rows[:, 0] = np.arange(len(states)) / RATE_HZ
    rows[:, 1:3] = states
    rows[:, _LAYOUT.accelerometer] = force
    rows[:, _LAYOUT.first_input] = flight.surface
    c = _LAYOUT.kinematic
    rows[:, c] = plant.turn * states[:, 1]
    rows[:, c + 1] = 1.0
    rows[:, c + 2] = plant.condition.airspeed_true_m_s
    rows[:, c + 3] = plant.condition.air_density_kg_m3
    rows[:, c + 4] = plant.condition.altitude_m
    rows[:, c + 6] = 1.0
    return Record(flight, rows)
