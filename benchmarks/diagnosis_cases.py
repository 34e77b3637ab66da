"""Cases for the diagnosis: flights whose aircraft differs from its file by an effect that is known.

    case = draw("simulation", seed=3)                    # one hidden effect
    case = draw("simulation", seed=3, effects="none")    # the same flight without one
    case = FIXED["gyro-delay"]()                         # a named one

The instrument shares no code with a finder below the flight table and the aircraft file. A hidden effect is one that
can be seen: flown alone in still air without noise it changes some channel by at least ``LEAST_SIGNAL`` times its
noise. What the true model leaves of a held-out flight is not stated: that would need the finder's definition of misfit.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Literal

from diagnosis_draw import weakest_signal
from diagnosis_from_simulation import SimulatedPlan, draw_simulation
from diagnosis_hidden import Case, Hidden

from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.simulation import doublet_schedule, three_two_one_one_schedule

__all__ = ["FIXED", "SOURCES", "Case", "Effects", "Hidden", "Source", "draw"]

Source = Literal["jsbsim", "simulation", "plant"]
Effects = Literal["one", "none", "two"]
SOURCES: tuple[Source, ...] = ("simulation",)
COUNT: Mapping[Effects, int] = {"none": 0, "one": 1, "two": 2}


def draw(source: Source, seed: int, effects: Effects = "one") -> Case:
    """One case by its seed.

    Args:
        source: who flies it.
        seed: the same seed gives the same case.
        effects: how many are hidden. What is flown goes by the seed alone.

    Raises:
        ValueError: a source that there is not.
        RuntimeError: none of many draws could be flown and seen.
    """
    if source == "simulation":
        return draw_simulation(seed, COUNT[effects])
    raise ValueError(f"there is no source {source!r}; give one of {', '.join(SOURCES)}")


AMPLITUDE_RAD = math.radians(3.0)


def _fixed(name: str, library: str, *hidden: Hidden, turbulence: Literal["none", "light"] = "none") -> Case:
    """A minute at cruise: doublets of all surfaces; held out: 3-2-1-1."""
    aircraft: Aircraft = load_aircraft(library)
    assert aircraft.envelope is not None
    at = aircraft.envelope.cruise
    first = doublet_schedule(aircraft, at, AMPLITUDE_RAD, spacing_s=6.0)
    second = three_two_one_one_schedule(aircraft, at, AMPLITUDE_RAD)
    plan = SimulatedPlan(1, aircraft, at, ((first,), second), turbulence=turbulence, name=name)
    case = plan.case(hidden, weakest_signal(plan, hidden))
    assert case is not None
    return case


_HIDDEN: Mapping[str, tuple[str, tuple[Hidden, ...]]] = {
    "gyro-delay": ("aerosonde", (Hidden("sensor_delay", "pitch_rate_rad_s", "delay_s", 0.06),)),
    "vane-ahead": ("twinotter", (Hidden("sensor_position", "vane_x", "distance_m", 6.0),)),
    "airspeed-scale": ("aerosonde", (Hidden("airspeed_error", "", "scale", 0.05),)),
    "weak-elevator": ("aerosonde", (Hidden("elevator_effectiveness", "", "fraction", 0.15),)),
    "slow-actuator": ("twinotter", (Hidden("actuator_lag", "elevator", "time_constant_s", 0.08),)),
    "pitch-damping": ("twinotter", (Hidden("pitch_damping", "", "ratio", -0.25),)),
    "nothing": ("aerosonde", ()),
}

FIXED: Mapping[str, Callable[[], Case]] = {
    name: partial(_fixed, name, library, *hidden) for name, (library, hidden) in _HIDDEN.items()
}
"""Named cases, made when called."""
