"""What the messages of a recording are, as MCAP files say it: protobuf descriptors, or JSON."""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from wingwatch.telemetry.messages import MessageError, MessageLimits, is_json
from wingwatch.telemetry.protocol import recording_pb2, service_pb2, vehicle_pb2

__all__ = ["JSON_SCHEMA", "PROFILE", "MessageSchema", "message_encoding", "schema_of"]

PROFILE = "wingwatch"
"""Of the header of MCAP files that are recordings of ours."""

_BY_LEAF: Mapping[str, type[Message]] = {
    "sensors": vehicle_pb2.Sensors,
    "aircraft": vehicle_pb2.Aircraft,
    "alerts": service_pb2.Alert,
    "estimates": recording_pb2.RecordedEstimate,
}
_LIMITS = MessageLimits()


class MessageSchema(NamedTuple):
    """A schema as MCAP has it: ``name`` of the message, ``encoding`` of the schema, and its ``data``."""

    name: str
    encoding: str
    data: bytes


JSON_SCHEMA = MessageSchema("wingwatch.v1.Json", "jsonschema", b'{"type":"object"}')
"""Of messages that came in JSON: their names are those of the protobuf messages."""


@cache
def schema_of(leaf: str) -> MessageSchema:
    """The protobuf schema of a topic's messages, with every file that it needs.

    Args:
        leaf: ``sensors``, ``aircraft``, ``alerts`` or ``estimates``.
    """
    descriptor = _BY_LEAF[leaf].DESCRIPTOR
    files = FileDescriptorSet()
    _add(files, descriptor.file)
    return MessageSchema(descriptor.full_name, "protobuf", files.SerializeToString())


def message_encoding(payload: bytes, encoding: str) -> str:
    """``json`` or ``protobuf``: what a payload is by the encoding that Zenoh gave with it."""
    try:
        return "json" if is_json(payload, encoding, _LIMITS) else "protobuf"
    except MessageError:
        return "protobuf"


def _add(files: FileDescriptorSet, file: Any) -> None:
    for needed in file.dependencies:
        _add(files, needed)
    if file.name not in {one.name for one in files.file}:
        file.CopyToProto(files.file.add())
