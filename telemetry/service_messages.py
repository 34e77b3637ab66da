"""What the service publishes about a vehicle, as bytes and back: the REST objects in JSON or in protobuf.

Schema: ``proto/wingwatch/v1/service.proto``. JSON is the REST object as it stands; protobuf has the fields
of the schema, with a message of its own between estimator and mode: it has no map of maps.
"""

import math
from collections.abc import Mapping
from typing import Any, Literal

import orjson
from google.protobuf.json_format import MessageToDict, ParseDict, ParseError
from google.protobuf.message import DecodeError, Message

from wingwatch.telemetry.messages import JSON, PROTOBUF, MessageError, MessageLimits, is_json
from wingwatch.telemetry.protocol import service_pb2

__all__ = ["ServiceStream", "decode_service_object", "encode_service_object"]

ServiceStream = Literal["derivatives", "status", "alerts", "proposals"]
_SCHEMAS: Mapping[str, type[Message]] = {
    "derivatives": service_pb2.Derivatives,
    "status": service_pb2.Status,
    "alerts": service_pb2.Alert,
    "proposals": service_pb2.ProposedInput,
}
_LIMITS = MessageLimits(max_bytes=1_048_576)


def encode_service_object(stream: ServiceStream, value: Mapping[str, Any], encoding: str = JSON) -> bytes:
    """A REST object as the payload of its Zenoh key.

    Args:
        stream: which key: ``derivatives``, ``status`` (a vehicle's object), ``alerts`` (one alert) or ``proposals``
            (an input).
        value: the object; numbers that are not finite become null. In protobuf null is not set, and keys that
            the schema does not have stay out.
        encoding: ``application/json`` or ``application/protobuf``.

    Raises:
        ValueError: another encoding, or a value that does not fit the schema.
    """
    plain = _finite(value)
    if encoding == JSON:
        return orjson.dumps(plain)
    if encoding != PROTOBUF:
        raise ValueError(f"messages are encoded as {PROTOBUF} or {JSON}, not {encoding!r}")
    if stream == "derivatives":
        estimators = plain.get("estimators") or {}
        plain = {**plain, "estimators": {name: {"modes": modes} for name, modes in estimators.items()}}
    try:
        message = ParseDict(plain, _SCHEMAS[stream](), ignore_unknown_fields=True)
    except ParseError as problem:
        raise ValueError(f"the {stream} object does not fit its schema: {problem}") from None
    return message.SerializeToString()


def decode_service_object(stream: ServiceStream, payload: bytes, encoding: str) -> dict[str, Any]:
    """The REST object of a payload that a service published.

    Raises:
        MessageError: anything that is no such message.
    """
    if is_json(payload, encoding, _LIMITS):
        try:
            value = orjson.loads(payload)
        except orjson.JSONDecodeError:
            raise MessageError("malformed", f"the {stream} message is not valid JSON") from None
        if not isinstance(value, dict):
            raise MessageError("malformed", f"the {stream} message must be a JSON object")
        return value
    message = _SCHEMAS[stream]()
    try:
        message.ParseFromString(payload)
    except DecodeError:
        raise MessageError("malformed", f"the payload is no protobuf {stream} message") from None
    return _rest_object(stream, message)


def _rest_object(stream: ServiceStream, message: Message) -> dict[str, Any]:
    value: dict[str, Any] = MessageToDict(
        message, preserving_proto_field_name=True, always_print_fields_with_no_presence=True
    )
    if stream == "derivatives":
        value["estimators"] = {name: modes["modes"] for name, modes in value["estimators"].items()}
    if stream == "status":
        value["counts"] = {name: int(count) for name, count in value["counts"].items()}
    return value


def _finite(value: Any) -> Any:
    """The same object with None where a number is not finite."""
    if isinstance(value, Mapping):
        return {str(key): _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
