"""What vehicles publish, as bytes and back: sensors and aircraft messages in protobuf and in JSON.

Payloads come from strangers: whatever the bytes, decoding gives a message or a ``MessageError`` with a reason
a machine can count and a sentence a person can read. Schema: ``proto/wingwatch/v1/vehicle.proto``.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import Annotated, Any

import numpy as np
import orjson
from google.protobuf.message import DecodeError
from google.protobuf.unknown_fields import UnknownFieldSet
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wingwatch.telemetry.completion import complete
from wingwatch.telemetry.protocol import vehicle_pb2
from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNEL_NAMES, MAX_TIME_S, SampleBlock

__all__ = [
    "JSON",
    "PROTOBUF",
    "AircraftMessage",
    "MessageError",
    "MessageLimits",
    "SensorsMessage",
    "decode_aircraft",
    "decode_sensors",
    "encode_aircraft",
    "encode_sensors",
    "is_json",
]

PROTOBUF = "application/protobuf"
JSON = "application/json"
_JSON_ENCODINGS = (JSON, "text/json")
_UNSAID_ENCODINGS = ("", "zenoh/bytes", "zenoh/string", "application/octet-stream", "text/plain")
_MAX_SEQUENCE = 2**64 - 1
_MAX_MASS_KG, _MAX_SHIFT_M = 1e6, 100.0  # beyond any aircraft
_SENSORS_FIELDS = ("sequence", "stream", "columns")
_SHOWN_CHARACTERS = 60
_NUMBER_TYPES = {float, int, type(None)}
# protobuf's own JSON writes these numbers as text
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_NOT_JSON_NUMBER = re.compile(rb"(?<![\w\"])-?(?:nan|NaN|NAN|inf|Infinity|None)\b")
_NUMBER_WORDS: Mapping[Any, float] = {"NaN": np.nan, "Infinity": np.inf, "-Infinity": -np.inf}


class MessageError(ValueError):
    """A payload that is no message of the contract.

    Attributes:
        reason: short name for counting: ``too_large``, ``too_many_samples``, ``unsupported_encoding``,
            ``malformed``, ``unknown_field``, ``unknown_column``, ``wrong_type``, ``unequal_lengths``,
            ``missing_time``, ``bad_value``.
    """

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class MessageLimits:
    """How large a message may be.

    Attributes:
        max_bytes: longest payload.
        max_samples: most samples in one message.
    """

    max_bytes: int = 65_536
    max_samples: int = 1_000


@dataclass(frozen=True, slots=True)
class SensorsMessage:
    """Samples that arrived together.

    Attributes:
        sequence: the publisher's count of its messages, from 0.
        block: the samples, completed (``complete``).
        given: channels that the message itself carried.
        stream: new at each start of the publisher; None where it says none.
    """

    sequence: int
    block: SampleBlock
    given: tuple[str, ...]
    stream: int | float | None = None

    @property
    def span_s(self) -> tuple[float, float]:
        """Earliest and latest stamp; NaN without any."""
        stamps = self.block.time_s
        if not np.isfinite(stamps).all():
            stamps = stamps[np.isfinite(stamps)]
        return (float(stamps.min()), float(stamps.max())) if stamps.size else (np.nan, np.nan)


class AircraftMessage(BaseModel):
    """Which aircraft a vehicle is, and how it is loaded.

    Attributes:
        aircraft: name of a library aircraft or of a file that the service was given; never a path.
        configuration: configuration in the sense of the aircraft file.
        mass_kg: actual mass where it is known; whether an aircraft can have it, the monitor says.
        cg_shift_m: centre of gravity behind (positive) that of the aircraft file, where it is known.
        stream: that of the publisher's sensors messages, where it says one: while that publisher sends, what
            others announce under its name is refused.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    aircraft: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,127}$")]
    configuration: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")] = "clean"
    mass_kg: Annotated[float, Field(ge=0.0, le=_MAX_MASS_KG)] | None = None
    cg_shift_m: Annotated[float, Field(ge=-_MAX_SHIFT_M, le=_MAX_SHIFT_M)] | None = None
    stream: int | float | None = None


def decode_sensors(payload: bytes, encoding: str, limits: MessageLimits | None = None) -> SensorsMessage:
    """The samples of a sensors message, completed as a flight read from a file is.

    Args:
        payload: the bytes.
        encoding: Zenoh's encoding; where it says nothing (``zenoh/bytes``, text), a ``{`` tells JSON.
        limits: largest message; the defaults where not given.

    Raises:
        MessageError: anything that is no sensors message.
    """
    limits = MessageLimits() if limits is None else limits
    if is_json(payload, encoding, limits):
        sequence, stream, columns = _sensors_from_json(payload)
    else:
        sequence, stream, columns = _sensors_from_protobuf(payload)
    if "time_s" not in columns:
        raise MessageError("missing_time", "the sensors message has no time_s")
    table, samples = list(columns.values()), len(columns["time_s"])
    if set(map(len, table)) != {samples}:
        name, length = next((name, len(column)) for name, column in columns.items() if len(column) != samples)
        text = f"column {name} has {length} values and time_s {samples}: all columns must be equally long"
        raise MessageError("unequal_lengths", text)
    if samples > limits.max_samples:
        text = f"the message has {samples} samples, more than the {limits.max_samples} allowed: send fewer"
        raise MessageError("too_many_samples", text)
    places, given = _layout(tuple(columns))
    values = np.full((samples, len(CHANNEL_NAMES)), np.nan)
    values[:, places] = np.array(table, np.float64).T
    _demand_a_clock(values[:, CHANNEL_INDEX["time_s"]])
    return SensorsMessage(sequence, complete(SampleBlock(values), given), given, stream)


@lru_cache(maxsize=256)
def _layout(names: tuple[str, ...]) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Where a message's columns stand in a block, and their names in the order of the channels."""
    places = np.array([CHANNEL_INDEX[name] for name in names])
    return places, tuple(name for name in CHANNEL_NAMES if name in names)


def encode_sensors(
    sequence: int,
    block: SampleBlock,
    encoding: str = PROTOBUF,
    columns: Sequence[str] | None = None,
    stream: int | None = None,
) -> bytes:
    """A sensors message.

    Args:
        sequence: number of this message, from 0.
        block: the samples.
        encoding: ``application/protobuf`` or ``application/json``.
        columns: channels to send; those with a finite value in this block where not given. Pieces of one
            flight must all send the same.
        stream: new at each start of the publisher, 0 to 2^64 - 1.

    Raises:
        ValueError: an encoding that is neither.
    """
    names = block.present if columns is None else columns
    values = {name: block.column(name).tolist() for name in names}
    if encoding == JSON:
        named = {} if stream is None else {"stream": stream}
        return orjson.dumps({"sequence": sequence, **named, "columns": values})  # NaN becomes null
    _demand_protobuf(encoding)
    message = vehicle_pb2.Sensors(sequence=sequence, stream=stream)
    for name, column in values.items():
        getattr(message.columns, name).extend(column)
    return message.SerializeToString()


def decode_aircraft(payload: bytes, encoding: str, limits: MessageLimits | None = None) -> AircraftMessage:
    """An aircraft message.

    Raises:
        MessageError: anything that is no aircraft message.
    """
    if is_json(payload, encoding, MessageLimits() if limits is None else limits):
        fields = _json_object(payload, "aircraft message")
    else:
        message = vehicle_pb2.Aircraft()
        _parse(message, payload)
        fields = {field.name: value for field, value in message.ListFields()}
    if "stream" in fields:
        fields["stream"] = _stream(fields["stream"])
    try:
        return AircraftMessage.model_validate(fields)
    except ValidationError as problem:
        first = problem.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            raise _unknown_field(where, "aircraft message", AircraftMessage.model_fields) from None
        reason = "wrong_type" if first["type"].endswith("_type") else "bad_value"
        text = f"the aircraft message's {where} is not valid ({_shown(first['input'])}): {first['msg']}"
        raise MessageError(reason, text) from None


def encode_aircraft(message: AircraftMessage, encoding: str = PROTOBUF) -> bytes:
    """An aircraft message's bytes.

    Raises:
        ValueError: an encoding that is neither protobuf nor JSON.
    """
    fields = message.model_dump(exclude_none=True)
    if encoding == JSON:
        return orjson.dumps(fields)
    _demand_protobuf(encoding)
    return vehicle_pb2.Aircraft(**fields).SerializeToString()


def is_json(payload: bytes, encoding: str, limits: MessageLimits) -> bool:
    """Whether a payload is JSON, else protobuf: by its encoding or, where that says nothing, its first byte.

    Raises:
        MessageError: a payload too large, or an encoding that is neither.
    """
    if len(payload) > limits.max_bytes:
        text = (
            f"the payload is longer than the {limits.max_bytes} bytes allowed: send fewer samples a message"
        )
        raise MessageError("too_large", text)
    kind = encoding.partition(";")[0].strip().lower()
    if kind in _JSON_ENCODINGS:
        return True
    if kind == PROTOBUF:
        return False
    if kind in _UNSAID_ENCODINGS or kind.startswith("text/"):
        return payload.lstrip()[:1] == b"{"
    text = f"the encoding {_shown(encoding)} is not known: send {PROTOBUF} or {JSON}"
    raise MessageError("unsupported_encoding", text)


def _demand_protobuf(encoding: str) -> None:
    if encoding != PROTOBUF:
        raise ValueError(f"messages are encoded as {PROTOBUF} or {JSON}, not {encoding!r}")


def _demand_a_clock(time_s: NDArray[np.float64]) -> None:
    """Stamps that no clock shows make a message worthless; every other value is judged sample by sample (cleaning)."""
    size = np.abs(time_s)
    if (size <= MAX_TIME_S).all():
        return
    if (beyond := time_s[(size > MAX_TIME_S) & np.isfinite(time_s)]).size:
        text = f"time_s holds {beyond[0]:.6g}, which no clock shows in seconds: stamps lie within {MAX_TIME_S:.0f}"
        raise MessageError("bad_value", text)


def _sensors_from_protobuf(payload: bytes) -> tuple[int, int | None, dict[str, list[Any]]]:
    message = vehicle_pb2.Sensors()
    _parse(message, payload)
    if len(UnknownFieldSet(message.columns)):
        raise MessageError("unknown_column", "the message has a column with a number that is no channel's")
    stream = message.stream if message.HasField("stream") else None
    return message.sequence, stream, {field.name: column[:] for field, column in message.columns.ListFields()}


def _parse(message: vehicle_pb2.Sensors | vehicle_pb2.Aircraft, payload: bytes) -> None:
    try:
        message.ParseFromString(payload)
    except DecodeError:
        raise MessageError("malformed", "the payload is no protobuf message of this schema") from None
    if len(UnknownFieldSet(message)):
        raise MessageError("unknown_field", "the message has a field that the schema does not know")


def _sensors_from_json(payload: bytes) -> tuple[int, int | float | None, dict[str, list[Any]]]:
    fields = _json_object(payload, "sensors message")
    for name in fields:
        if name not in _SENSORS_FIELDS:
            raise _unknown_field(name, "sensors message", _SENSORS_FIELDS)
    columns = fields.get("columns")
    if not isinstance(columns, dict):
        text = f"the sensors message's columns must be an object of lists, not {_shown(columns)}"
        raise MessageError("wrong_type", text)
    if not columns.keys() <= CHANNEL_INDEX.keys() or set(map(type, columns.values())) != {list}:
        _demand_columns(columns)
    if not set(map(type, chain.from_iterable(columns.values()))) <= _NUMBER_TYPES:
        columns = {name: _numbers(name, column) for name, column in columns.items()}
    return _sequence(fields.get("sequence", 0)), _stream(fields.get("stream")), columns


def _demand_columns(columns: Mapping[str, Any]) -> None:
    """Every column is a channel's, and a list."""
    for name, column in columns.items():
        if name not in CHANNEL_INDEX:
            text = f"column {_shown(name)} is no channel of the flight table: send its channels only"
            raise MessageError("unknown_column", text)
        if not isinstance(column, list):
            raise MessageError("wrong_type", f"column {name} must be a list of numbers, not {_shown(column)}")


def _sequence(value: Any) -> int:
    """A message number."""
    value = _whole_number(value)
    if type(value) is not int or not 0 <= value <= _MAX_SEQUENCE:
        raise MessageError("wrong_type", f"sequence must be a whole number from 0, not {_shown(value)}")
    return value


def _stream(value: Any) -> int | float | None:
    """Any finite number: it is only compared."""
    value = _whole_number(value)
    if value is not None and not (type(value) in (int, float) and abs(value) <= _MAX_SEQUENCE):
        raise MessageError("wrong_type", f"stream must be a number, not {_shown(value)}")
    return value  # type: ignore[no-any-return]


def _whole_number(value: Any) -> Any:
    """Protobuf's own JSON writes 64-bit integers as text."""
    text = isinstance(value, str) and value.isascii() and value.isdigit() and len(value) <= 20
    return int(value) if text else value


def _numbers(name: str, column: list[Any]) -> list[Any]:
    """The column with numbers in place of the words for some; MessageError where it holds anything else."""
    column = [_NUMBER_WORDS.get(value, value) if isinstance(value, str) else value for value in column]
    for value in column:
        if type(value) not in _NUMBER_TYPES:
            raise MessageError("wrong_type", f"column {name} holds {_shown(value)}, which is no number")
    return column


def _json_object(payload: bytes, what: str) -> dict[str, Any]:
    try:
        value = orjson.loads(payload.removeprefix(_BYTE_ORDER_MARK))
    except orjson.JSONDecodeError as problem:
        raise MessageError(
            "malformed", f"the {what} is not valid JSON ({_json_fault(payload, problem)})"
        ) from None
    if not isinstance(value, dict):
        raise MessageError("malformed", f"the {what} must be a JSON object, not {_shown(value)}")
    return value


def _json_fault(payload: bytes, problem: orjson.JSONDecodeError) -> str:
    """Why a text is no JSON, the usual mistakes first."""
    if b"\0" in payload[:4] or payload[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "it is UTF-16 or UTF-32; send UTF-8"
    if not payload.strip():
        return "it is empty"
    if _NOT_JSON_NUMBER.search(payload):
        return "a missing value is null, not NaN"
    return f"{problem.msg}, at character {problem.pos}"


def _unknown_field(name: str, what: str, allowed: Any) -> MessageError:
    return MessageError(
        "unknown_field", f"the {what} has no field {_shown(name)}: it has {', '.join(allowed)}"
    )


def _shown(value: Any) -> str:
    try:
        text = repr(value)
    except RecursionError:  # nested as deeply as JSON may be
        text = f"a deeply nested {type(value).__name__}"
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."
