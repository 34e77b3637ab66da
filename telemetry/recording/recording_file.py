"""One MCAP file of a recording, written."""

from pathlib import Path
from typing import NamedTuple

from wingwatch import __version__
from wingwatch.telemetry.messages import JSON, PROTOBUF
from wingwatch.telemetry.recording.schemas import (
    JSON_SCHEMA,
    PROFILE,
    MessageSchema,
    message_encoding,
    schema_of,
)

__all__ = ["RecordingError", "RecordingFile", "RecordingPlace"]

_CHUNK_BYTES = 1_048_576
_MEDIA_TYPE = "application/octet-stream"


class RecordingError(ValueError):
    """A recording that cannot be written or read; one sentence."""


class RecordingPlace(NamedTuple):
    """Where a file stands in a recording: of which run of a service it is, and its number in that, from 1."""

    session: str
    number: int


class RecordingFile:
    """Messages under their topics, and attachments, each with the time at which it came.

    Args:
        path: must not exist.
        place: of the file in the recording.
        started_ns: when the recording began, nanoseconds since 1970-01-01 UTC.

    Raises:
        RecordingError: the library is not installed.
        OSError: the file cannot be written; so do all methods.
    """

    def __init__(self, path: Path, place: RecordingPlace, started_ns: int) -> None:
        try:
            from mcap.writer import CompressionType, Writer
        except ImportError:
            raise RecordingError(
                "recordings need mcap, which is not installed; install wingwatch with its extra logs"
            ) from None
        self.path = path
        self._stream = path.open("xb", buffering=_CHUNK_BYTES)
        self._writer = Writer(self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._schemas: dict[MessageSchema, int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}
        self._writer.start(PROFILE, f"wingwatch {__version__}")
        about = {
            "version": __version__,
            "session": place.session,
            "number": str(place.number),
            "started_ns": str(started_ns),
        }
        self._writer.add_metadata(PROFILE, about)
        self.flush()

    @property
    def size_bytes(self) -> int:
        """What has been written so far; the chunk in progress not included."""
        return self._stream.tell()

    def add(self, topic: str, encoding: str, time_ns: int, payload: bytes, *, repeated: bool = False) -> None:
        """One message.

        Args:
            topic: a Zenoh key, or that of an estimate.
            encoding: Zenoh's encoding, as text.
            time_ns: of its arrival, nanoseconds since 1970-01-01 UTC.
            payload: its bytes as they came.
            repeated: whether an earlier file of the recording has it, too, so that this one can be read alone.
        """
        key = topic, encoding, message_encoding(payload, encoding)
        channel = self._channels.get(key) or self._channel(*key)
        self._writer.add_message(channel, time_ns, payload, time_ns, int(repeated))

    def attach(self, name: str, time_ns: int, data: bytes) -> None:
        """What belongs to the recording and is no message."""
        self._writer.add_attachment(time_ns, time_ns, name, _MEDIA_TYPE, data)

    def flush(self) -> None:
        """Have the system keep all that was added: it is there even if this process is killed."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._stream.flush()

    def close(self) -> None:
        """End the file with its index."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._stream.close()

    def _channel(self, topic: str, encoding: str, kind: str) -> int:
        schema = JSON_SCHEMA if kind == "json" else schema_of(_leaf(topic))
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(*schema)
        metadata = {} if encoding in (PROTOBUF, JSON) else {"zenoh_encoding": encoding}
        channel: int = self._writer.register_channel(topic, kind, self._schemas[schema], metadata)
        self._channels[topic, encoding, kind] = channel
        return channel


def _leaf(topic: str) -> str:
    """What kind of messages a topic has: ``wingwatch/v1/<fleet>/<vehicle>/<leaf>[/...]``."""
    return topic.split("/")[4]
