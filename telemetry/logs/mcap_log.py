"""MCAP files of others (ROS bags, loggers of companion computers) as topics, from messages in JSON and in protobuf.

Other encodings (ROS's own) are named and left out. Stamps are those at which messages were published, from the first
one on. A topic's name loses what no expression can hold: ``/imu/data`` becomes ``imu_data[0]``.
"""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import numpy as np

from wingwatch.telemetry.logs.log import AutopilotLog, LogError, Topic

__all__ = ["read_mcap"]

_MOST_ELEMENTS = 32
"""Of an array in a message; longer ones are no channel."""

_MOST_RECORD = 67_108_864
_MOST_FIELDS = 2000
_NOT_IN_NAMES = re.compile(r"\W+")

_Decode = Callable[[bytes], Mapping[str, Any]]


@dataclass(slots=True)
class _Rows:
    """Messages of one topic."""

    name: str
    time_ns: list[int] = field(default_factory=list)
    columns: dict[str, list[float]] = field(default_factory=dict)

    def add(self, time_ns: int, values: Mapping[str, float]) -> None:
        """One more message."""
        before = len(self.time_ns)
        self.time_ns.append(time_ns)
        for name, value in values.items():
            column = self.columns.get(name)
            if column is None:
                if len(self.columns) >= _MOST_FIELDS:
                    continue
                column = self.columns[name] = [np.nan] * before
            column.append(value)
        for column in self.columns.values():
            if len(column) == before:
                column.append(np.nan)


def read_mcap(source: str, data: bytes) -> AutopilotLog:
    """The topics of a file whose messages are JSON or protobuf.

    Raises:
        LogError: the library is not installed, or no message can be read.
    """
    try:
        from mcap.records import Channel, Message, Schema
    except ImportError:
        raise LogError(
            f"{source}: MCAP files need mcap, which is not installed; install wingwatch with its extra logs"
        ) from None
    schemas: dict[int, Any] = {}
    channels: dict[int, tuple[_Rows, _Decode | None]] = {}
    rows: dict[str, _Rows] = {}
    left_out: dict[str, str] = {}
    bad: dict[str, int] = {}
    notes: list[str] = []
    for record in _records(data, notes):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in channels:
            decode = _decoder(record.message_encoding, schemas.get(record.schema_id))
            if decode is None:
                left_out[record.topic] = record.message_encoding or "no encoding"
            name = _free_name(record.topic, rows)
            channels[record.id] = rows.setdefault(record.topic, _Rows(name)), decode
        elif isinstance(record, Message) and record.channel_id in channels:
            of_topic, decode = channels[record.channel_id]
            if decode is None:
                continue
            try:
                values = dict(_numbers("", decode(record.data)))
            except Exception:  # bytes of strangers: what a decoder raises is its own affair
                bad[of_topic.name] = bad.get(of_topic.name, 0) + 1
                continue
            of_topic.add(record.publish_time or record.log_time, values)
    if left_out:
        listed = ", ".join(f"{topic} ({encoding})" for topic, encoding in list(left_out.items())[:8])
        notes.append(f"topics that are neither JSON nor protobuf are left out: {listed}")
    notes += [f"{times} messages of {name} cannot be decoded" for name, times in bad.items()]
    topics = _topics(rows.values())
    if not topics:
        why = f"; {notes[0]}" if notes else ""
        raise LogError(f"{source}: the MCAP file holds no numbers that can be read{why}")
    return AutopilotLog(source, "mcap", "", "", "an MCAP file", topics, {}, tuple(notes))


def _records(data: bytes, notes: list[str]) -> Any:
    """Records in order, to the end or to where the file is damaged; then a note is added."""
    from mcap.stream_reader import StreamReader

    records = iter(StreamReader(BytesIO(data), record_size_limit=_MOST_RECORD).records)
    while True:
        try:
            record = next(records)
        except StopIteration:
            return
        except Exception:  # damaged bytes make the library and its decompressors raise almost anything
            notes.append("the file is cut short or damaged: what was written before is read")
            return
        yield record


def _decoder(encoding: str, schema: Any) -> _Decode | None:
    """What decodes messages of a channel; None for an encoding that is not read."""
    if encoding == "json":
        return _from_json
    if encoding == "protobuf" and schema is not None and schema.encoding == "protobuf":
        try:
            return _from_protobuf(schema)
        except Exception:  # a descriptor of strangers
            return None
    return None


def _from_json(data: bytes) -> Mapping[str, Any]:
    value = json.loads(data)
    if not isinstance(value, dict):
        raise ValueError("no object")
    return value


def _from_protobuf(schema: Any) -> _Decode:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.json_format import MessageToDict
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    kind = GetMessageClass(pool.FindMessageTypeByName(schema.name))

    def decode(data: bytes) -> Mapping[str, Any]:
        value: Mapping[str, Any] = MessageToDict(
            kind.FromString(data), preserving_proto_field_name=True, always_print_fields_with_no_presence=True
        )
        return value

    return decode


def _numbers(prefix: str, value: Any) -> Any:
    """Every number in a message by its path, as expressions write it: ``angular_velocity.x``, ``xyz[0]``."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from _numbers(f"{prefix}.{name}" if prefix else str(name), part)
    elif isinstance(value, list):
        if len(value) <= _MOST_ELEMENTS:
            for k, part in enumerate(value):
                yield from _numbers(f"{prefix}[{k}]", part)
    elif isinstance(value, bool | int | float):
        yield prefix, float(value)
    elif isinstance(value, str):
        try:  # protobuf's own JSON writes 64-bit integers, NaN and infinity as text
            yield prefix, float(value)
        except ValueError:
            return


def _free_name(topic: str, rows: Mapping[str, _Rows]) -> str:
    name = _NOT_IN_NAMES.sub("_", topic).strip("_") or "topic"
    taken = {one.name for known, one in rows.items() if known != topic}
    while name in taken:
        name += "_"
    return name


def _topics(rows: Any) -> dict[str, Topic]:
    filled = [one for one in rows if one.columns]
    first_ns = min((min(one.time_ns) for one in filled), default=0)
    topics = {}
    for one in filled:
        stamps = (np.array(one.time_ns, dtype=np.int64) - first_ns) / 1e9
        fields = {name: np.array(column) for name, column in one.columns.items()}
        topic = Topic(one.name, 0, stamps, fields)
        topics[topic.key] = topic
    return topics
