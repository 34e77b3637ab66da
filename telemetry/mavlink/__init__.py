"""A live MAVLink link as samples: the same channels, by the same code, as a recorded one."""

from wingwatch.telemetry.mavlink.connection import Arrival, MavlinkConnection, open_connection
from wingwatch.telemetry.mavlink.receiver import LinkReceiver, LinkSystem, RoundTrip
from wingwatch.telemetry.mavlink.requests import LinkRequests
from wingwatch.telemetry.mavlink.vehicle import LinkVehicle, Piece

__all__ = [
    "Arrival",
    "LinkReceiver",
    "LinkRequests",
    "LinkSystem",
    "LinkVehicle",
    "MavlinkConnection",
    "Piece",
    "RoundTrip",
    "open_connection",
]
