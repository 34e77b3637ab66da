"""A scenario: one flight to be simulated, all of it that is not chance given, and chance by its seed."""

import math
from dataclasses import dataclass
from typing import Any

from wingwatch.aircraft import Aircraft, FlightCondition
from wingwatch.simulation.effects import Effect
from wingwatch.simulation.manoeuvres import Manoeuvre
from wingwatch.simulation.turbulence import LEVELS, Turbulence

__all__ = ["Scenario", "truth"]

_HIGHEST_M, _LOWEST_M = 20_000.0, -1_000.0


@dataclass(frozen=True, slots=True)
class Scenario:
    """One flight: it starts trimmed and level, heading north, and is held there by the autopilot.

    Attributes:
        aircraft: needs [coefficients], [geometry] and [mass].
        airspeed_true_m_s: held.
        altitude_m: held.
        manoeuvres: excitations added to the autopilot's commands.
        effects: what befalls the aircraft, and when.
        turbulence: level by MIL-F-8785C.
        seed: of turbulence and sensor noise; the same seed gives the same flight.
        noise: whether sensors are noisy as the aircraft file says.
        wind_m_s: steady wind, the velocity of the air over the ground (north, east, down).
        name: what the vehicle is called.

    Raises:
        ValueError: a value outside what can be simulated, named.
    """

    aircraft: Aircraft
    airspeed_true_m_s: float = 25.0
    altitude_m: float = 1000.0
    manoeuvres: tuple[Manoeuvre, ...] = ()
    effects: tuple[Effect, ...] = ()
    turbulence: Turbulence = "none"
    seed: int = 0
    noise: bool = True
    wind_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    name: str = ""

    def __post_init__(self) -> None:
        if not _LOWEST_M <= self.altitude_m <= _HIGHEST_M:
            raise ValueError(f"altitude_m is {self.altitude_m}; give {_LOWEST_M:g} to {_HIGHEST_M:g} m")
        if self.turbulence not in LEVELS:
            raise ValueError(f"turbulence is {self.turbulence!r}; give one of {', '.join(LEVELS)}")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}; give an integer from 0")
        if not all(math.isfinite(component) for component in self.wind_m_s):
            raise ValueError(f"wind_m_s is {self.wind_m_s}; give three finite numbers of m/s")
        FlightCondition(self.airspeed_true_m_s, self.altitude_m)

    @property
    def condition(self) -> FlightCondition:
        """Where the flight is held."""
        return FlightCondition(self.airspeed_true_m_s, self.altitude_m)


def truth(scenario: Scenario, time_s: float) -> dict[str, Any]:
    """What is true of a flight at a time, ready for JSON.

    Returns:
        ``time_s``; ``effects``: for each effect of the scenario its ``name``, its ``size`` at that time, the size it
        grows to (``size_final``), ``onset_s`` and ``ramp_s``.
    """
    return {
        "time_s": time_s,
        "effects": [
            {
                "name": effect.name,
                "size": effect.severity(time_s),
                "size_final": effect.size,
                "onset_s": effect.onset_s,
                "ramp_s": effect.ramp_s,
            }
            for effect in scenario.effects
        ],
    }
