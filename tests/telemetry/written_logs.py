"""Writers of autopilot logs for tests, from the published formats: they share no code with what reads."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

ULOG_SYNC = bytes((0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12))


def _ulog_message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<H", len(body)) + kind + body


@dataclass
class UlogTopic:
    """One topic: ``fields`` as (C type, name, values); values of shape (n,) or (n, k) for an array of k."""

    name: str
    time_us: Sequence[int]
    fields: Sequence[tuple[str, str, Array]]
    instance: int = 0


_ULOG_TYPES = {
    "float": "f", "double": "d", "uint64_t": "Q", "int64_t": "q", "uint32_t": "I", "int32_t": "i", "uint16_t": "H",
    "int16_t": "h", "uint8_t": "B", "int8_t": "b", "bool": "?",
}  # fmt: skip


@dataclass
class Ulog:
    """A file of PX4's logger."""

    topics: list[UlogTopic]
    parameters: Mapping[str, float] = field(default_factory=dict)
    infos: Mapping[str, str] = field(default_factory=lambda: {"sys_name": "PX4", "ver_sw": "0123abcd"})
    sync_every: int = 0

    def head(self) -> bytes:
        out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + _ulog_message(b"B", bytes(40))
        for name, text in self.infos.items():
            key = f"char[{len(text)}] {name}".encode()
            out += _ulog_message(b"I", bytes((len(key),)) + key + text.encode())
        for name in dict.fromkeys(topic.name for topic in self.topics):
            topic = next(t for t in self.topics if t.name == name)
            described = ["uint64_t timestamp"]
            for kind, field_name, values in topic.fields:
                size = f"[{np.shape(values)[1]}]" if np.ndim(values) == 2 else ""
                described.append(f"{kind}{size} {field_name}")
            out += _ulog_message(b"F", f"{name}:{';'.join(described)};".encode())
        for name, value in self.parameters.items():
            kind, code = ("int32_t", "<i") if isinstance(value, int) else ("float", "<f")
            key = f"{kind} {name}".encode()
            out += _ulog_message(b"P", bytes((len(key),)) + key + struct.pack(code, value))
        for number, topic in enumerate(self.topics):
            out += _ulog_message(b"A", struct.pack("<BH", topic.instance, number) + topic.name.encode())
        return out

    def records(self) -> list[bytes]:
        """Data messages in the order of time, those of one topic in the order given."""
        rows: list[tuple[float, int, bytes]] = []
        for number, topic in enumerate(self.topics):
            newest = 0
            for i, stamp in enumerate(topic.time_us):
                body = struct.pack("<HQ", number, stamp)
                for kind, _, values in topic.fields:
                    code = _ULOG_TYPES[kind]
                    cells = np.atleast_1d(values[i]).tolist()
                    if code not in "fd":
                        cells = [bool(c) if code == "?" else int(c) for c in cells]
                    body += struct.pack(f"<{len(cells)}{code}", *cells)
                newest = max(newest, stamp)
                rows.append((newest, len(rows), _ulog_message(b"D", body)))
        return [record for _, _, record in sorted(rows, key=lambda row: row[:2])]

    def encode(self) -> bytes:
        records = self.records()
        if self.sync_every:
            sync = _ulog_message(b"S", ULOG_SYNC)
            every = self.sync_every
            records = [r + (sync if i % every == every - 1 else b"") for i, r in enumerate(records)]
        return self.head() + b"".join(records)


@dataclass
class FlashTopic:
    """One type of DataFlash record: letters and columns as its FMT has them, rows in the file's own integers."""

    name: str
    codes: str
    columns: str
    rows: Sequence[Sequence[object]]


_FLASH_CODES = {
    "b": "b", "B": "B", "M": "B", "h": "h", "H": "H", "i": "i", "I": "I", "q": "q", "Q": "Q", "f": "f", "d": "d",
    "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "n": "4s", "N": "16s", "Z": "64s",
}  # fmt: skip


@dataclass
class Flash:
    """A file of ArduPilot's logger; records in the order of their first column where it is ``TimeUS``."""

    topics: list[FlashTopic]
    parameters: Mapping[str, float] = field(default_factory=dict)
    firmware: str = "ArduPlane V4.3.1 (1a2b3c4d)"

    def _all(self) -> list[FlashTopic]:
        parm = FlashTopic(
            "PARM", "QNf", "TimeUS,Name,Value", [(0, k.encode(), v) for k, v in self.parameters.items()]
        )
        text = FlashTopic("MSG", "QZ", "TimeUS,Message", [(0, self.firmware.encode())])
        return [parm, text, *self.topics]

    def _kinds(self) -> dict[str, int]:
        """Number of each type; messages of one name are of one type, distinguished by a field."""
        return {name: kind for kind, name in enumerate(dict.fromkeys(t.name for t in self._all()), 1)}

    def encode(self) -> bytes:
        return b"".join((self.head(), *self.records()))

    def head(self) -> bytes:
        out = _format_record(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
        kinds = self._kinds()
        for topic in {topic.name: topic for topic in self._all()}.values():
            kind = kinds[topic.name]
            size = 3 + struct.calcsize("<" + "".join(_FLASH_CODES[c] for c in topic.codes))
            out += _format_record(kind, size, topic.name, topic.codes, topic.columns)
        return out

    def records(self) -> list[bytes]:
        rows: list[tuple[int, int, bytes]] = []
        kinds = self._kinds()
        for topic in self._all():
            kind = kinds[topic.name]
            code = "<" + "".join(_FLASH_CODES[c] for c in topic.codes)
            newest = 0
            for row in topic.rows:
                newest = max(newest, int(row[0])) if isinstance(row[0], int) else newest
                rows.append((newest, len(rows), b"\xa3\x95" + bytes((kind,)) + struct.pack(code, *row)))
        return [record for _, _, record in sorted(rows, key=lambda row: row[:2])]

    def text(self) -> str:
        """The same as lines, as ground stations write them: units applied."""
        lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
        for kind, topic in enumerate({topic.name: topic for topic in self._all()}.values(), 1):
            lines.append(f"FMT, {kind}, 0, {topic.name}, {topic.codes}, {topic.columns}")
        for topic in self._all():
            for row in topic.rows:
                cells = [_cell(code, value) for code, value in zip(topic.codes, row, strict=True)]
                lines.append(", ".join((topic.name, *cells)))
        return "\n".join(lines) + "\n"


def _cell(code: str, value: object) -> str:
    if isinstance(value, bytes):
        return value.decode()
    assert isinstance(value, int | float)
    unit = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}.get(code)
    return repr(value) if unit is None else repr(round(value * unit, 9))


def _format_record(kind: int, size: int, name: str, codes: str, columns: str) -> bytes:
    return b"\xa3\x95\x80" + struct.pack(
        "<BB4s16s64s", kind, size, name.encode(), codes.encode(), columns.encode()
    )
