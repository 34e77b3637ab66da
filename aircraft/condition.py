"""The flight condition: where in the envelope derivatives hold."""

import math
from dataclasses import dataclass

from wingwatch.aircraft.atmosphere import isa_density_kg_m3

__all__ = ["FlightCondition"]


@dataclass(frozen=True, slots=True)
class FlightCondition:
    """One point of the envelope.

    Attributes:
        airspeed_true_m_s: true airspeed V.
        altitude_m: pressure altitude.
        air_density_kg_m3: density; the standard atmosphere's at that altitude when none (NaN) is given.
        configuration: name of the flap, gear or payload setting.
        angle_of_attack_rad: of the x body axis; it splits V into the two body components below.

    Raises:
        ValueError: an airspeed, density or angle that no flight has, named with its value.
    """

    airspeed_true_m_s: float
    altitude_m: float
    air_density_kg_m3: float = math.nan
    configuration: str = "clean"
    angle_of_attack_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.airspeed_true_m_s) and self.airspeed_true_m_s > 0.0):
            raise ValueError(f"airspeed_true_m_s is {self.airspeed_true_m_s}; give a positive number of m/s")
        if math.isnan(self.air_density_kg_m3):
            object.__setattr__(self, "air_density_kg_m3", float(isa_density_kg_m3(self.altitude_m)))
        if not (math.isfinite(self.air_density_kg_m3) and self.air_density_kg_m3 > 0.0):
            raise ValueError(
                f"air density is {self.air_density_kg_m3} at altitude_m {self.altitude_m}; "
                "give a positive density, or an altitude from -5000 m to 47000 m"
            )
        if not abs(self.angle_of_attack_rad) < math.pi / 2:
            raise ValueError(f"angle_of_attack_rad is {self.angle_of_attack_rad}; give less than pi/2")

    @property
    def forward_velocity_m_s(self) -> float:
        """U_e = V cos(alpha), the steady velocity along x body."""
        return self.airspeed_true_m_s * math.cos(self.angle_of_attack_rad)

    @property
    def normal_velocity_m_s(self) -> float:
        """W_e = V sin(alpha), the steady velocity along z body."""
        return self.airspeed_true_m_s * math.sin(self.angle_of_attack_rad)

    @property
    def dynamic_pressure_pa(self) -> float:
        """Half of density times airspeed squared."""
        return 0.5 * self.air_density_kg_m3 * self.airspeed_true_m_s**2
