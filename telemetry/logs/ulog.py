"""PX4's ULog files."""

import contextlib
import struct
from io import BytesIO, StringIO
from typing import Any

import numpy as np

from wingwatch.telemetry.logs.log import AutopilotLog, LogError, Topic

__all__ = ["ULOG_MAGIC", "read_ulog"]

ULOG_MAGIC = b"ULog\x01\x12\x35"

_HEADER_BYTES = 16
_SYNC = bytes((0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12))
_MESSAGES = frozenset(b"BFIMPQARDLCSO")
_MOST_BYTES = 10_000  # of a message; more is damage

_MULTICOPTERS = frozenset((2, 3, 4, 13, 14, 15, 29, 35))
_VTOLS = frozenset(range(19, 26))
_FIXED_WING = 1
_SAYS_FIXED_WING = 2.0


def read_ulog(source: str, data: bytes) -> AutopilotLog:
    """A log from the bytes of a file that begins with ``ULOG_MAGIC``.

    Raises:
        LogError: the library is not installed, or nothing in the file can be read.
    """
    try:
        from pyulog import ULog
    except ImportError:
        raise LogError(
            f"{source}: ULog files need pyulog, which is not installed; install wingwatch with its extra logs"
        ) from None
    said = StringIO()
    try:
        with contextlib.redirect_stdout(said):  # the library prints its warnings there
            log = ULog(BytesIO(data))
    except Exception as problem:  # a damaged file makes the library raise almost anything
        raise LogError(f"{source}: the ULog file is damaged ({_words(problem)}); copy it again") from None
    topics = {topic.key: topic for topic in map(_topic, log.data_list) if topic is not None}
    if not topics:
        raise LogError(f"{source}: the ULog file holds no samples that can be read; copy it again")
    named = [*log.initial_parameters.items(), *((name, value) for _, name, value in log.changed_parameters)]
    parameters = {name: float(value) for name, value in named if isinstance(value, int | float)}
    infos = log.msg_info_dict
    firmware = " ".join(str(infos[key]) for key in ("sys_name", "ver_sw_release", "ver_sw") if key in infos)
    autopilot = "px4" if str(infos.get("sys_name", "PX4")).upper().startswith("PX4") else ""
    vehicle = _vehicle(topics, parameters)
    return AutopilotLog(
        source,
        "ulog",
        autopilot,
        vehicle,
        firmware,
        topics,
        parameters,
        tuple(_lost(log, data, said.getvalue())),
    )


def _words(problem: Exception) -> str:
    return " ".join(str(problem).split())[:120].rstrip(".") or type(problem).__name__


def _topic(read: Any) -> Topic | None:
    """A topic of the library's, its stamps in seconds; None for one without stamps."""
    columns = read.data
    if "timestamp" not in columns:
        return None
    fields = {
        str(name): np.array(column, dtype=np.float64)
        for name, column in columns.items()
        if name != "timestamp" and np.asarray(column).dtype.kind in "biuf"
    }
    stamps = np.array(columns["timestamp"], dtype=np.float64)
    sampled = fields.get("timestamp_sample")
    if sampled is not None and sampled.all() and not str(read.name).startswith("actuator"):
        stamps = sampled  # when it was measured; the other says when it was sent, perhaps once more
    return Topic(str(read.name), int(read.multi_id), stamps / 1e6, fields)


def _vehicle(topics: dict[str, Topic], parameters: dict[str, float]) -> str:
    """By the parameter MAV_TYPE, else by what the vehicle says of itself throughout."""
    status = topics.get("vehicle_status[0]")
    if status is not None and status.fields.get("is_vtol", np.zeros(1)).any():
        return "vtol"
    kind = parameters.get("MAV_TYPE")
    types = set() if status is None else set(status.fields.get("vehicle_type", np.zeros(0)).tolist())
    if kind is not None and types != {_SAYS_FIXED_WING}:
        return (
            "multicopter" if kind in _MULTICOPTERS
            else "vtol" if kind in _VTOLS
            else "fixed wing" if kind == _FIXED_WING
            else f"MAV_TYPE {kind:g}"
        )  # fmt: skip
    return {(1.0,): "multicopter", (_SAYS_FIXED_WING,): "fixed wing"}.get(tuple(types), "")


def _lost(log: Any, data: bytes, said: str) -> list[str]:
    """What the file lost on its way: logger's dropouts, a truncated end, bytes that are no messages."""
    notes = []
    if log.dropouts:
        seconds = sum(dropout.duration for dropout in log.dropouts) * 1e-3
        notes.append(f"the logger dropped samples {len(log.dropouts)} times, {seconds:.1f} s in all")
    unreadable, where, cut = _framing(data)
    if unreadable:
        notes.append(f"{unreadable} bytes from byte {where} on are damaged, the samples in them are lost")
    elif log.file_corruption or "orrupt" in said:
        notes.append("the file is damaged in places, samples are lost")
    if cut:
        notes.append(f"the file ends within a message: it is cut short by {cut} bytes or more")
    return notes


def _framing(data: bytes) -> tuple[int, int, int]:
    """Walk the messages: bytes outside any, the first of them, and how many the last message lacks."""
    at, unreadable, first = _HEADER_BYTES, 0, 0
    while at + 3 <= len(data):
        size, kind = struct.unpack_from("<HB", data, at)
        if kind in _MESSAGES and 0 < size <= _MOST_BYTES:
            if at + 3 + size > len(data):
                return unreadable, first, at + 3 + size - len(data)
            at += 3 + size
            continue
        found = data.find(_SYNC, at)
        after = len(data) if found < 0 else found - 3
        first = first or at
        unreadable += max(after - at, 1)
        at = max(after, at + 1)
    return unreadable, first, 3 + at - len(data) if at < len(data) else 0
