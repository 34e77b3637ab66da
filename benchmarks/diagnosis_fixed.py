"""Named cases of the diagnosis benchmark, the same each time: for the command line, for tests, for a look."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from diagnosis_draw import Plan, weakest_signal
from diagnosis_from_jsbsim import JsbsimPlan, subject_with
from diagnosis_from_plants import PlantPlan, frequencies
from diagnosis_from_simulation import SimulatedPlan
from diagnosis_hidden import Array, Case, Hidden
from diagnosis_inputs import commands
from diagnosis_plants import BASES, Plant
from jsbsim_aircraft import AIRCRAFT

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, load_aircraft
from wingwatch.simulation import doublet_schedule, three_two_one_one_schedule

__all__ = ["FIXED"]

_SEED, _SECONDS = 1, 60.0
_AMPLITUDE_RAD = math.radians(3.0)
_IMPULSE_RAD = math.radians(2.0)
_GYRO_DELAY = Hidden("sensor_delay", "pitch_rate_rad_s", "delay_s", 0.06)
_WEAK_ELEVATOR = Hidden("elevator_effectiveness", "", "fraction", 0.15)
_PITCH_DAMPING = Hidden("pitch_damping", "", "ratio", -0.25)
_INERTIAL = {
    "pitch_rate_rad_s": 0.05, "pitch_rad": 0.05, "specific_force_z_m_s2": 0.06, "specific_force_x_m_s2": 0.06,
}  # fmt: skip
"""Delays of the Jetstream's inertial channels (thesis 7.6.3), of those that its short period moves."""


def _made(plan: Plan, hidden: tuple[Hidden, ...]) -> Case:
    case = plan.case(hidden, weakest_signal(plan, hidden))
    if case is None:
        raise RuntimeError(f"{plan.aircraft.name} cannot be flown with {', '.join(h.label for h in hidden)}")
    return case


def _simulated(name: str, library: str, *hidden: Hidden) -> Case:
    """A minute of a library aircraft at its cruise: doublets of all surfaces; held out: 3-2-1-1."""
    aircraft = load_aircraft(library)
    assert aircraft.envelope is not None
    at = aircraft.envelope.cruise
    first = doublet_schedule(aircraft, at, _AMPLITUDE_RAD, spacing_s=6.0)
    second = three_two_one_one_schedule(aircraft, at, _AMPLITUDE_RAD)
    return _made(SimulatedPlan(_SEED, aircraft, at, ((first,), second), name=name), hidden)


def _inputs(
    kinds: tuple[str, str], frequencies_rad_s: tuple[float, float], size_rad: float
) -> tuple[Array, Array]:
    rng = np.random.default_rng(_SEED)
    first, second = (commands(rng, kind, _SECONDS, frequencies_rad_s, size_rad) for kind in kinds)
    return first, second


def _bundled(name: str, aircraft: str, *hidden: Hidden) -> Case:
    """A minute of a bundled aircraft: doublets; held out: 3-2-1-1."""
    condition = AIRCRAFT[aircraft]
    subject = subject_with(aircraft, condition)
    own = (subject.frequency_rad_s(SHORT_PERIOD), subject.frequency_rad_s(LATERAL))
    inputs = _inputs(("doublets", "3211"), own, _IMPULSE_RAD)
    return _made(JsbsimPlan(_SEED, aircraft, condition, inputs, fixed=name), hidden)


def _plant(name: str, plant: Plant, kind: str, kinds: tuple[str, str], *hidden: Hidden) -> Case:
    """A minute of a plant as its table has it."""
    moves = {"short": (1.0, 0.0, 0.0), "dutch": (0.0, 0.0, 1.0), "full": (1.0, 1.0, 1.0)}[kind]
    first, second = _inputs(kinds, frequencies(plant), _IMPULSE_RAD)
    noise = load_aircraft("twinotter").sensors.noise_std
    inputs = (np.array(moves) * first, np.array(moves) * second)
    return _made(PlantPlan(_SEED, plant, kind, inputs, noise, fixed=name), hidden)


_SIMULATED: Mapping[str, tuple[str, tuple[Hidden, ...]]] = {
    "gyro-delay": ("aerosonde", (_GYRO_DELAY,)),
    "vane-ahead": ("twinotter", (Hidden("sensor_position", "vane_x", "distance_m", 6.0),)),
    "airspeed-scale": ("aerosonde", (Hidden("airspeed_error", "", "scale", 0.05),)),
    "weak-elevator": ("aerosonde", (_WEAK_ELEVATOR,)),
    "slow-actuator": ("twinotter", (Hidden("actuator_lag", "elevator", "time_constant_s", 0.08),)),
    "pitch-damping": ("twinotter", (_PITCH_DAMPING,)),
    "nothing": ("aerosonde", ()),
}
_BUNDLED: Mapping[str, tuple[str, tuple[Hidden, ...]]] = {
    "jsbsim-gyro-delay": ("F80C", (_GYRO_DELAY,)),
    "jsbsim-weak-elevator": ("c172r", (_WEAK_ELEVATOR,)),
    "jsbsim-pitch-damping": ("B17", (_PITCH_DAMPING,)),
    "jsbsim-nothing": ("pa28", ()),
}
_COUPLING = Hidden("roll_yaw_coupling", "", "n_p", 1.0)
_DELAYS = tuple(Hidden("sensor_delay", column, "delay_s", size) for column, size in _INERTIAL.items())

FIXED: Mapping[str, Callable[[], Case]] = {
    **{name: partial(_simulated, name, library, *hidden) for name, (library, hidden) in _SIMULATED.items()},
    **{name: partial(_bundled, name, aircraft, *hidden) for name, (aircraft, hidden) in _BUNDLED.items()},
    "inertial-delay": partial(
        _plant, "inertial-delay", BASES["jetstream"], "short", ("pulses", "doublets"), *_DELAYS
    ),
    "dutch-roll-only": partial(
        _plant,
        "dutch-roll-only",
        replace(BASES["commuter"], rolls=False),
        "dutch",
        ("doublets", "3211"),
        _COUPLING,
    ),
    "plant-nothing": partial(
        _plant, "plant-nothing", BASES["commuter"], "full", ("doublets and multisine", "3211")
    ),
}
"""Cases by their names, made when called."""
