"""The flight condition that a command's ``--airspeed`` and ``--altitude`` ask for."""

import argparse

from wingwatch.aircraft import Aircraft, FlightCondition
from wingwatch.operations.faults import CommandError

__all__ = ["asked_condition"]


def asked_condition(arguments: argparse.Namespace, aircraft: Aircraft) -> FlightCondition:
    """What was asked for, else the aircraft's cruise.

    Raises:
        CommandError: something was left out, and the aircraft states no envelope.
    """
    airspeed, altitude = arguments.airspeed, arguments.altitude
    if airspeed is None or altitude is None:
        if aircraft.envelope is None:
            raise CommandError(
                f"aircraft {aircraft.name} states no [envelope], so no cruise; give --airspeed and --altitude"
            )
        cruise = aircraft.envelope.cruise
        airspeed = cruise.airspeed_true_m_s if airspeed is None else airspeed
        altitude = cruise.altitude_m if altitude is None else altitude
    return FlightCondition(airspeed, altitude)
