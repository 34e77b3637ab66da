"""What MAVLink's messages say beside their fields, the same for a recorded link and a live one: vehicle, clock,
parameters."""

import struct
from collections.abc import Mapping

__all__ = [
    "AUTOPILOTS",
    "NO_AUTOPILOT",
    "boot_s",
    "is_vehicle",
    "next_wrap_s",
    "parameter_value",
    "vehicle_word",
]

AUTOPILOTS: Mapping[int, str] = {3: "ardupilot", 12: "px4"}
"""By MAV_AUTOPILOT."""

NO_AUTOPILOT = 8
"""MAV_AUTOPILOT_INVALID: ground stations, gimbals, cameras, companion computers."""

_MULTICOPTERS, _VTOLS = frozenset((2, 3, 4, 13, 14, 15, 29, 35)), frozenset(range(19, 26))
_NO_VEHICLES = frozenset((5, 6, 18, 26, 27, *range(30, 35), *range(36, 43)))
"""MAV_TYPE of antenna trackers, ground stations, companion computers, gimbals, transponders, cameras and the like."""

_EARLIEST_S = 946_684_800.0  # the year 2000
_WRAP_S = 2.0**32 / 1e6
_INTEGERS: Mapping[int, str] = {1: "B3x", 2: "b3x", 3: "H2x", 4: "h2x", 5: "I", 6: "i"}
"""MAV_PARAM_TYPE of integers, as PX4 puts them into the bytes of a float."""


def is_vehicle(kind: int, autopilot: int) -> bool:
    """Whether a heartbeat's sender flies: by its MAV_TYPE and MAV_AUTOPILOT."""
    return autopilot != NO_AUTOPILOT and kind not in _NO_VEHICLES


def vehicle_word(kind: int) -> str:
    """What a MAV_TYPE is called."""
    if kind in _MULTICOPTERS:
        return "multicopter"
    if kind in _VTOLS:
        return "vtol"
    return "fixed wing" if kind == 1 else f"MAV_TYPE {kind}"


def boot_s(time_boot_ms: float | None, time_usec: float | None) -> float:
    """What the vehicle's clock says, NaN where a message carries no stamp of it (Unix time is none)."""
    if time_boot_ms is not None:
        return time_boot_ms / 1e3
    stamp_s = (time_usec or 0.0) / 1e6
    return stamp_s if 0.0 < stamp_s < _EARLIEST_S else float("nan")


def next_wrap_s(stamp_s: float, reference_s: float) -> float:
    """A stamp of 32-bit microseconds, which begin anew after 71.6 minutes, on the clock of one that does not.

    Args:
        stamp_s: as sent.
        reference_s: what the vehicle's clock said last; NaN where nobody knows.
    """
    if reference_s != reference_s:
        return stamp_s
    return stamp_s + _WRAP_S * max(0, round((reference_s - stamp_s) / _WRAP_S))


def parameter_value(value: float, kind: int, autopilot: str) -> float:
    """A parameter's value: PX4 sends the bytes of an integer in the place of the float, ArduPilot its value."""
    if autopilot != "px4" or kind not in _INTEGERS:
        return value
    return float(struct.unpack(f"<{_INTEGERS[kind]}", struct.pack("<f", value))[0])
