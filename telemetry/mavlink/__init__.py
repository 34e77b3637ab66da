"""A live MAVLink link as samples: the same channels, by the same code, as a recorded one."""

from wingwatch.telemetry.mavlink.receiver import LinkReceiver, LinkSystem, RoundTrip
from wingwatch.telemetry.mavlink.vehicle import LinkVehicle, Piece

__all__ = ["LinkReceiver", "LinkSystem", "LinkVehicle", "Piece", "RoundTrip"]
