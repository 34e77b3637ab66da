"""A scenario: one flight to be simulated, all of it that is not chance given, and chance by its seed."""

import math
from dataclasses import dataclass, field

from wingwatch.aircraft import Aircraft, FlightCondition
from wingwatch.simulation.effects import Effect
from wingwatch.simulation.gusts import DiscreteGust
from wingwatch.simulation.manoeuvres import Manoeuvre
from wingwatch.simulation.route import Route
from wingwatch.simulation.sensor_errors import SensorErrors
from wingwatch.simulation.turbulence import LEVELS, MODELS, Turbulence, TurbulenceModel
from wingwatch.simulation.wind import WindProfile

__all__ = ["Scenario"]

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
        wind_m_s: steady wind, the velocity of the air over the ground (north, east, down), where ``wind_profile`` says:
            without a boundary layer at the scenario's altitude.
        name: what the vehicle is called.
        sensor_errors: biases, scale errors, vane upwash and dropouts of this vehicle.
        turbulence_model: form of the spectra.
        gusts: discrete gusts, added to the turbulence.
        wind_profile: how the wind changes with height.
        ground_altitude_m: above sea level; turbulence and boundary layer go by the height above it.
        hands_off: whether the autopilot answers nothing, so that surfaces and throttle stay at the trim but for the
            manoeuvres: slow motions (phugoid, spiral) are then the aircraft's own. Not with a route.
        route: waypoints to fly, from where the flight starts; without one heading, altitude and airspeed are held.

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
    sensor_errors: SensorErrors = field(default_factory=SensorErrors)
    turbulence_model: TurbulenceModel = "dryden"
    gusts: tuple[DiscreteGust, ...] = ()
    wind_profile: WindProfile = field(default_factory=WindProfile)
    ground_altitude_m: float = 0.0
    route: Route | None = None
    hands_off: bool = False

    def __post_init__(self) -> None:
        if self.hands_off and self.route is not None:
            raise ValueError("a route needs the autopilot; leave out the route, or hands_off")
        if not _LOWEST_M <= self.altitude_m <= _HIGHEST_M:
            raise ValueError(f"altitude_m is {self.altitude_m}; give {_LOWEST_M:g} to {_HIGHEST_M:g} m")
        if self.turbulence not in LEVELS:
            raise ValueError(f"turbulence is {self.turbulence!r}; give one of {', '.join(LEVELS)}")
        if self.turbulence_model not in MODELS:
            raise ValueError(
                f"turbulence_model is {self.turbulence_model!r}; give one of {', '.join(MODELS)}"
            )
        if not math.isfinite(self.ground_altitude_m):
            raise ValueError(f"ground_altitude_m is {self.ground_altitude_m}; give a finite number of m")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}; give an integer from 0")
        if not all(math.isfinite(component) for component in self.wind_m_s):
            raise ValueError(f"wind_m_s is {self.wind_m_s}; give three finite numbers of m/s")
        FlightCondition(self.airspeed_true_m_s, self.altitude_m)

    @property
    def height_m(self) -> float:
        """Height above the ground where the flight is held."""
        return self.altitude_m - self.ground_altitude_m

    @property
    def condition(self) -> FlightCondition:
        """Where the flight is held."""
        return FlightCondition(self.airspeed_true_m_s, self.altitude_m)
