"""PX4's ULog files."""

import contextlib
import re
from dataclasses import dataclass, field
from io import BytesIO, StringIO
from typing import Any

import numpy as np

from wingwatch.telemetry.logs.log import AutopilotLog, Columns, LogError, Topic

__all__ = ["ULOG_MAGIC", "read_ulog"]

ULOG_MAGIC = b"ULog\x01\x12\x35"

_HEADER_BYTES = 16
_MOST_BYTES = 10_000  # of a message; more is damage
_LEAST_BYTES = {**dict.fromkeys(b"BFIMPQARLCSO", 1), ord("D"): 10}
"""By type of message, what one has at least: samples have a number and a stamp."""
_BEGINNING = re.compile(rb"(?s)(?=.[\x00-\x27][BFIMPQARDLCSO])")
_BELIEVED = 4

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
    said, framing = StringIO(), _framing(data)
    try:
        with contextlib.redirect_stdout(said):  # the library prints its warnings there
            log = ULog(BytesIO(_repaired(data, framing)))
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
        tuple(_lost(log, framing, said.getvalue())),
    )


def _words(problem: Exception) -> str:
    return " ".join(str(problem).split())[:120].rstrip(".") or type(problem).__name__


def _topic(read: Any) -> Topic | None:
    """A topic of the library's, its stamps in seconds; None for one without stamps."""
    columns = read.data
    if "timestamp" not in columns:
        return None
    fields = Columns(
        {
            str(name): np.asarray(column)
            for name, column in columns.items()
            if name != "timestamp" and np.asarray(column).dtype.kind in "biuf"
        }
    )
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


def _lost(log: Any, framing: "_Framing", said: str) -> list[str]:
    """What the file lost on its way: logger's dropouts, a truncated end, bytes that are no messages."""
    notes = []
    if log.dropouts:
        seconds = sum(dropout.duration for dropout in log.dropouts) * 1e-3
        notes.append(f"the logger dropped samples {len(log.dropouts)} times, {seconds:.1f} s in all")
    if framing.damaged:
        notes.append(
            f"{framing.damaged} bytes from byte {framing.first_damaged} on are damaged, the samples in them are lost"
        )
    elif log.file_corruption or "orrupt" in said:
        notes.append("the file is damaged in places, samples are lost")
    if framing.lacking:
        notes.append(f"the file ends within a message: it is cut short by {framing.lacking} bytes or more")
    return notes


@dataclass(slots=True)
class _Framing:
    """Where a file's messages stand.

    Attributes:
        spans: first and last byte of each run of messages, the latter excluded.
        damaged: bytes outside any.
        first_damaged: the first of them.
        lacking: bytes that the last message would need and the file has not.
    """

    spans: list[tuple[int, int]] = field(default_factory=list)
    damaged: int = 0
    first_damaged: int = 0
    lacking: int = 0


def _framing(data: bytes) -> _Framing:
    """Walk the messages; behind damage a few must follow one another before they are believed."""
    found, at, start = _Framing(), _HEADER_BYTES, _HEADER_BYTES
    length = len(data)
    while at + 3 <= length:
        least, size = _LEAST_BYTES.get(data[at + 2], _MOST_BYTES), data[at] | data[at + 1] << 8
        end = at + 3 + size if least <= size < _MOST_BYTES else 0  # as _end, without a call for each message
        if end and end <= len(data):
            at = end
            continue
        if end and not _follows(data, at):
            found.lacking = end - len(data)
            break
        found.spans.append((start, at))
        found.first_damaged = found.first_damaged or at
        after = _next(data, at + 1)
        found.damaged += after - at
        at = start = after
    else:
        found.lacking = 3 + at - len(data) if at < len(data) else 0
    found.spans.append((start, min(at, len(data))))
    return found


def _end(data: bytes, at: int) -> int:
    """Where a message ends that begins here, which may be beyond the file; 0 where none does."""
    if at + 3 > len(data):
        return 0
    least, size = _LEAST_BYTES.get(data[at + 2], _MOST_BYTES), data[at] | data[at + 1] << 8
    return at + 3 + size if least <= size < _MOST_BYTES else 0


def _follows(data: bytes, at: int) -> bool:
    """Whether later bytes of the file look like messages again, so that a message too long for it is damage."""
    return _next(data, at + 1) < len(data)


def _next(data: bytes, at: int) -> int:
    """The next place from where several messages follow one another; the file's end where there is none."""
    for candidate in _BEGINNING.finditer(data, at):
        place = candidate.start()
        for _ in range(_BELIEVED):
            place = _end(data, place)
            if not place or place > len(data):
                break
        else:
            return candidate.start()
    return len(data)


def _repaired(data: bytes, framing: _Framing) -> bytes:
    """The messages alone. The library would try every damaged byte, which takes minutes for a few megabytes; offsets
    of appended data, which no longer hold, are cleared."""
    if not framing.damaged:
        return data
    kept = bytearray(data[:_HEADER_BYTES])
    for start, end in framing.spans:
        kept += data[start:end]
    if kept[_HEADER_BYTES + 2 : _HEADER_BYTES + 3] == b"B":
        size = kept[_HEADER_BYTES] | kept[_HEADER_BYTES + 1] << 8
        kept[_HEADER_BYTES + 3 : _HEADER_BYTES + 3 + size] = bytes(size)
    return bytes(kept)
