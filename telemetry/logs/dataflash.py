"""ArduPilot's DataFlash logs, binary and as text.

A binary log describes itself: records of type 128 say of every type how long it is and what its fields are. Records
have no check sum, so damage is found by records that do not follow one another.
"""

import struct
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.logs.log import AutopilotLog, Columns, LogError, Topic

__all__ = ["DATAFLASH_MAGIC", "is_dataflash_text", "read_dataflash", "read_dataflash_text"]

DATAFLASH_MAGIC = b"\xa3\x95"

_FORMAT_TYPE, _FORMAT_BYTES = 128, 89
_HEADER_BYTES = 3
_AT_ONCE = 65_536  # records
_CODES: Mapping[str, tuple[str, float]] = {
    "b": ("i1", 1.0), "B": ("u1", 1.0), "M": ("u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0), "i": ("<i4", 1.0),
    "I": ("<u4", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0),
    "c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01), "E": ("<u4", 0.01), "L": ("<i4", 1e-7),
    "n": ("S4", 0.0), "N": ("S16", 0.0), "Z": ("S64", 0.0), "a": ("S64", 0.0),
}  # fmt: skip
"""Type and unit of each letter of a format; unit 0 for text and arrays, which are no columns."""

_INSTANCES = ("I", "Inst", "Instance", "C")
_FIRMWARES = ("ArduPlane", "ArduCopter", "ArduRover", "ArduSub", "Blimp", "AntennaTracker")
_VEHICLES = {
    "ArduPlane": "fixed wing", "ArduCopter": "multicopter", "ArduRover": "rover", "ArduSub": "submarine",
    "Blimp": "airship", "AntennaTracker": "antenna tracker",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Format:
    """What one type of record holds."""

    name: str
    codes: str
    columns: tuple[str, ...]

    @property
    def dtype(self) -> np.dtype[np.void]:
        """The record behind its header."""
        return np.dtype(
            [(name, _CODES[code][0]) for name, code in zip(self.columns, self.codes, strict=True)]
        )


Records = dict[str, tuple[_Format, NDArray[np.void]]]


def read_dataflash(source: str, data: bytes) -> AutopilotLog:
    """A log from the bytes of a file that begins with ``DATAFLASH_MAGIC``.

    Raises:
        LogError: no record that can be read.
    """
    formats, places, notes = _walk(data)
    whole = np.frombuffer(data, dtype=np.uint8)
    records: Records = {}
    for kind, found in places.items():
        form = formats.get(kind)
        if form is None:
            continue
        records[form.name] = (form, _gathered(whole, np.frombuffer(found, dtype=np.int64), form.dtype))
    return _log(source, "dataflash", records, notes)


def _gathered(
    whole: NDArray[np.uint8], places: NDArray[np.int64], dtype: np.dtype[np.void]
) -> NDArray[np.void]:
    """Records of one type, a part at a time: the places of single bytes take eight times as much memory as they."""
    size = dtype.itemsize
    offsets = np.arange(_HEADER_BYTES, _HEADER_BYTES + size)
    rows = np.empty((places.size, size), dtype=np.uint8)
    for first in range(0, places.size, _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        rows[some] = whole[places[some, None] + offsets]
    return rows.view(dtype)[:, 0]


def _walk(data: bytes) -> "tuple[dict[int, _Format], dict[int, array[int]], list[str]]":
    """Formats and the places of the records by type, and what was lost."""
    formats: dict[int, _Format] = {}
    lengths = {_FORMAT_TYPE: _FORMAT_BYTES}
    places: dict[int, array[int]] = {}
    at, lost, breaks, cut, in_step = 0, 0, 0, False, True
    while at + _HEADER_BYTES <= len(data):
        length = lengths.get(data[at + 2], 0) if data.startswith(DATAFLASH_MAGIC, at) else 0
        end = at + length
        if length and end > len(data):
            cut = True
            break
        # after damage a chance pair of bytes is no record: the next one has to follow
        if length and (in_step or end == len(data) or data.startswith(DATAFLASH_MAGIC, end)):
            kind = data[at + 2]
            if kind == _FORMAT_TYPE:
                _learn(data[at + _HEADER_BYTES : end], formats, lengths)
            else:
                if kind not in places:
                    places[kind] = array("q")
                places[kind].append(at)
            at, in_step = end, True
            continue
        found = data.find(DATAFLASH_MAGIC, at + 1)
        after = len(data) if found < 0 else found
        breaks += in_step
        lost, at, in_step = lost + after - at, after, False
    notes = []
    if lost:
        notes.append(f"{lost} bytes in {breaks} places are damaged, the records in them are lost")
    if cut or 0 < len(data) - at < _HEADER_BYTES:
        notes.append("the file ends within a record: it is cut short")
    return formats, places, notes


def _learn(record: bytes, formats: dict[int, _Format], lengths: dict[int, int]) -> None:
    """Take in a record that describes a type; one that contradicts itself is left."""
    kind, length, name, codes, columns = struct.unpack("<BB4s16s64s", record)
    text = [part.split(b"\0", 1)[0].decode("latin-1") for part in (name, codes, columns)]
    names = tuple(column.strip() for column in text[2].split(",")) if text[2] else ()
    if kind == _FORMAT_TYPE or length <= _HEADER_BYTES or not text[0]:
        return
    lengths[kind] = length
    known = all(code in _CODES for code in text[1]) and len(names) == len(text[1]) == len(set(names))
    form = _Format(text[0], text[1], names)
    if known and form.dtype.itemsize == length - _HEADER_BYTES:
        formats[kind] = form


def is_dataflash_text(data: bytes) -> bool:
    """Whether a file's beginning is that of a log as text: lines of FMT among the first."""
    lines = [line.strip() for line in data[:8192].split(b"\n")]
    return sum(line.startswith(b"FMT,") and line.count(b",") >= 5 for line in lines) >= 2


def read_dataflash_text(source: str, data: bytes) -> AutopilotLog:
    """A log from the text that ground stations make of a binary one: values stand in it with their units applied.

    Raises:
        LogError: no line that can be read.
    """
    formats: dict[str, _Format] = {}
    rows: dict[str, list[tuple[str, ...]]] = {}
    damaged = 0
    for line in data.decode("utf-8", "replace").splitlines():
        name, *cells = (cell.strip() for cell in line.split(","))
        if name == "FMT" and len(cells) >= 5:
            formats[cells[2]] = _Format(cells[2], cells[3], tuple(cells[4:]))
            continue
        form = formats.get(name)
        if form is None:
            damaged += bool(name) and bool(formats)
        elif form.codes.endswith("Z") and len(cells) > len(form.columns):  # a text with commas of its own
            last = len(form.columns) - 1
            rows.setdefault(name, []).append((*cells[:last], ",".join(cells[last:])))
        elif len(cells) == len(form.columns) == len(form.codes):
            rows.setdefault(name, []).append(tuple(cells))
        else:
            damaged += 1
    records: Records = {}
    for name, found in rows.items():
        dtype = _text_dtype(formats[name])
        if dtype is not None:
            records[name] = (formats[name], np.array([_values(row, dtype) for row in found], dtype=dtype))
    notes = [f"{damaged} lines are damaged and left out"] if damaged else []
    if not data.endswith(b"\n"):
        notes.append("no line end after the last line: the file may be cut short")
    return _log(source, "dataflash-text", records, notes)


def _text_dtype(form: _Format) -> "np.dtype[np.void] | None":
    if len(set(form.columns)) != len(form.columns) or not all(code in _CODES for code in form.codes):
        return None
    pairs = zip(form.columns, form.codes, strict=True)
    return np.dtype([(name, "S64" if not _CODES[code][1] else "<f8") for name, code in pairs])


def _values(row: Sequence[str], dtype: "np.dtype[np.void]") -> tuple[float | bytes, ...]:
    values: list[float | bytes] = []
    for cell, name in zip(row, dtype.names or (), strict=True):
        if dtype[name].kind == "S":
            values.append(cell.encode("utf-8", "replace"))
            continue
        try:
            values.append(float(cell))
        except ValueError:
            values.append(np.nan)
    return tuple(values)


def _log(source: str, form: str, records: Records, notes: list[str]) -> AutopilotLog:
    firmware, parameters = _firmware(records), _parameters(records)
    kind = next((name for name in _FIRMWARES if name.lower() in firmware.lower()), "")
    topics: dict[str, Topic] = {}
    for name in list(records):
        described, rows = records.pop(
            name
        )  # those of several instances are copied, and need not be there twice
        for topic in _topics(described, rows, scaled=form == "dataflash"):
            topics[topic.key] = topic
    if not topics:
        raise LogError(f"{source}: the DataFlash log holds no records that can be read; copy it again")
    vehicle = (
        "vtol" if kind == "ArduPlane" and parameters.get("Q_ENABLE", 0.0) > 0.0 else _VEHICLES.get(kind, "")
    )
    return AutopilotLog(source, form, "ardupilot", vehicle, firmware, topics, parameters, tuple(notes))


def _topics(form: _Format, rows: NDArray[np.void], scaled: bool) -> Iterable[Topic]:
    """One topic an instance; none for records without a stamp."""
    time_s = _stamps(form, rows)
    if time_s is None:
        return
    units = {name: _CODES[code][1] for name, code in zip(form.columns, form.codes, strict=True)}
    names = [name for name, unit in units.items() if unit and name not in ("TimeUS", "TimeMS")]
    by = next((name for name in _INSTANCES if name in names and form.columns.index(name) <= 1), None)
    numbers = np.zeros(rows.size) if by is None else rows[by].astype(np.float64)
    for number in np.unique(numbers[np.isfinite(numbers)]):
        of = numbers == number
        own = rows if of.all() else rows[of]
        kept = {name: own[name] for name in names if name != by}
        yield Topic(form.name, int(number), time_s[of], Columns(kept, units if scaled else None))


def _stamps(form: _Format, rows: NDArray[np.void]) -> NDArray[np.float64] | None:
    """Seconds since boot; the field ``TimeMS`` of old GPS records is the receiver's time of the week."""
    for name, unit in (("TimeUS", 1e6), ("T", 1e3), ("TimeMS", 1e3)):
        if name in form.columns and (name != "T" or form.name.startswith("GPS")):
            return rows[name].astype(np.float64) / unit
    return None


def _firmware(records: Records) -> str:
    for name, (form, rows) in records.items():
        if name not in ("MSG", "VER"):
            continue
        for column, code in zip(form.columns, form.codes, strict=True):
            for text in rows[column] if code in "ZN" else ():
                said = _text(text)
                if any(firmware.lower() in said.lower() for firmware in _FIRMWARES):
                    return said
    return ""


def _parameters(records: Records) -> dict[str, float]:
    """Names and values as last written."""
    if "PARM" not in records or not {"Name", "Value"} <= set(records["PARM"][0].columns):
        return {}
    rows = records["PARM"][1]
    return {_text(name): float(value) for name, value in zip(rows["Name"], rows["Value"], strict=True)}


def _text(raw: bytes) -> str:
    return bytes(raw).split(b"\0", 1)[0].decode("utf-8", "replace").strip()
