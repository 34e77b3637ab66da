"""What angle an aircraft's surfaces have at full travel, for logs of servo signals."""

from wingwatch.aircraft import Aircraft
from wingwatch.aircraft.vocabulary import SURFACES

__all__ = ["surface_travel"]


def surface_travel(aircraft: Aircraft) -> dict[str, float]:
    """Deflection at full travel by channel, rad: position limits of the aircraft file, where it has them."""
    found = {f"{surface}_rad": getattr(aircraft.actuators, surface) for surface in SURFACES}
    return {
        channel: actuator.position_limit_rad
        for channel, actuator in found.items()
        if actuator is not None and actuator.position_limit_rad is not None
    }
