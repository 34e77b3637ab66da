"""Which MAVLink messages are read, and how their bytes lie: by the tables of pymavlink's ardupilotmega dialect."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from wingwatch.telemetry.zenoh_link import LinkError

__all__ = ["HEARTBEAT", "PARAM_VALUE", "TIMESYNC", "Layout", "layouts", "library"]

HEARTBEAT, PARAM_VALUE, TIMESYNC = "HEARTBEAT", "PARAM_VALUE", "TIMESYNC"

_SERVOS = "SERVO_OUTPUT_RAW"
_TOPICS = frozenset(
    (
        "ATTITUDE", "ATTITUDE_QUATERNION", "HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3",
        "VFR_HUD", "SCALED_PRESSURE", "SCALED_PRESSURE2", _SERVOS, "ACTUATOR_OUTPUT_STATUS", "GLOBAL_POSITION_INT",
        "GPS_RAW_INT", "ODOMETRY", "SYSTEM_TIME",
    )
)  # fmt: skip
_HANDED_ON = _TOPICS | {HEARTBEAT, PARAM_VALUE, TIMESYNC}


@dataclass(frozen=True, slots=True)
class Layout:
    """One message of the dialect.

    Attributes:
        name: such as ``ATTITUDE``.
        checksum_extra: byte that goes into the checksum behind the payload.
        size: bytes of the whole payload; MAVLink 2 cuts zeros off its end, MAVLink 1 has no extensions.
        dtype: fields as they lie in the payload.
        wanted: whether anything is made of it; the others only count.
        is_topic: whether its readings are channels.
        stamp: first byte, bytes and seconds a unit of the vehicle's clock; None where it carries none.
        wraps: whether that clock begins anew after 32 bits.
        instance: byte of the payload that distinguishes several senders of it; None where there is none.
    """

    name: str
    checksum_extra: int
    size: int
    dtype: np.dtype[Any]
    wanted: bool
    is_topic: bool
    stamp: tuple[int, int, float] | None
    wraps: bool
    instance: int | None


def library() -> Any:
    """The dialect's module.

    Raises:
        LinkError: pymavlink is not installed.
    """
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError:
        raise LinkError(
            "a MAVLink link needs pymavlink, which is not installed; install wingwatch with its extra logs"
        ) from None
    return ardupilotmega


@cache
def layouts() -> Mapping[int, Layout]:
    """Every message of the dialect by its number.

    Raises:
        LinkError: pymavlink is not installed.
    """
    return {number: _layout(kind) for number, kind in library().mavlink_map.items()}


def _layout(kind: Any) -> Layout:
    codes = bytes(kind.native_format).decode().removeprefix("<")
    fields: list[tuple[Any, ...]] = []
    for name, code, count in zip(kind.ordered_fieldnames, codes, kind.array_lengths, strict=True):
        plain = f"S{count or 1}" if code == "c" else f"<{np.dtype(code).str[1:]}"
        fields.append((name, plain, (count,)) if count and code != "c" else (name, plain))
    dtype = np.dtype(fields)
    stamp = _stamp(dtype)
    name = kind.msgname
    instance = int(dtype.fields["port"][1]) if name == _SERVOS and dtype.fields else None
    wraps = stamp is not None and stamp[1:] == (4, 1e-6)
    size, extra = int(kind.unpacker.size), int(kind.crc_extra)
    return Layout(name, extra, size, dtype, name in _HANDED_ON, name in _TOPICS, stamp, wraps, instance)


def _stamp(dtype: np.dtype[Any]) -> tuple[int, int, float] | None:
    for name, unit in (("time_boot_ms", 1e-3), ("time_usec", 1e-6)):
        if dtype.fields and name in dtype.fields:
            kind, start = dtype.fields[name][:2]
            return int(start), int(kind.itemsize), unit
    return None
