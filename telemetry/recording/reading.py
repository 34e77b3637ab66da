"""A recording read: its files in order, what is attached to them, its messages."""

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wingwatch.telemetry.messages import JSON, PROTOBUF
from wingwatch.telemetry.recording.recording_file import RecordingError, RecordingPlace
from wingwatch.telemetry.recording.schemas import PROFILE

__all__ = ["MCAP_MAGIC", "RecordedMessage", "Recording", "is_recording", "open_recording"]

MCAP_MAGIC = b"\x89MCAP0\r\n"
_PROFILE_AT = len(MCAP_MAGIC) + 1 + 8  # behind the header record's kind and length
_MOST_RECORD = 67_108_864
_ENCODINGS = {"protobuf": PROTOBUF, "json": JSON}


def is_recording(head: bytes) -> bool:
    """Whether a file's first bytes are those of a recording of ours; other MCAP files begin alike."""
    name = PROFILE.encode()
    wanted = struct.pack("<I", len(name)) + name
    return head.startswith(MCAP_MAGIC) and head[_PROFILE_AT : _PROFILE_AT + len(wanted)] == wanted


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """One message of a recording.

    Attributes:
        topic: a Zenoh key, or that of an estimate.
        encoding: Zenoh's encoding, as text.
        time_ns: of its arrival, nanoseconds since 1970-01-01 UTC.
        payload: its bytes as they came.
    """

    topic: str
    encoding: str
    time_ns: int
    payload: bytes


@dataclass(slots=True)
class Recording:
    """Files of one run of a service, in their order.

    Attributes:
        session: of the run.
        version: of wingwatch that recorded it.
        started_ns: when it began, nanoseconds since 1970-01-01 UTC.
        paths: of the files; numbers: of each in the run, from 1.
        notes: what was lost, one clause each; known after ``messages``.
    """

    session: str
    version: str
    started_ns: int
    paths: Sequence[Path]
    numbers: Sequence[int]
    notes: list[str] = field(default_factory=list)

    @property
    def whole(self) -> bool:
        """Whether no file is missing at the beginning or in between."""
        return list(self.numbers) == list(range(1, len(self.numbers) + 1))

    def attachments(self) -> Mapping[str, bytes]:
        """What is attached, by name; of one name the first."""
        from mcap.records import Attachment

        found: dict[str, bytes] = {}
        for path in self.paths:
            for record in _records(path, [], in_chunks=False):
                if isinstance(record, Attachment):
                    found.setdefault(record.name, record.data)
        return found

    def messages(self) -> Iterator[RecordedMessage]:
        """All messages in the order in which they were taken in, none of them twice."""
        from mcap.records import Channel, Message

        self.notes.clear()
        for k, path in enumerate(self.paths):
            channels: dict[int, tuple[str, str]] = {}
            follows = k > 0 and self.numbers[k] == self.numbers[k - 1] + 1
            for record in _records(path, self.notes, in_chunks=True):
                if isinstance(record, Message):
                    if record.channel_id in channels and not (record.sequence and follows):
                        topic, encoding = channels[record.channel_id]
                        yield RecordedMessage(topic, encoding, record.log_time, record.data)
                elif isinstance(record, Channel):
                    encoding = _ENCODINGS.get(record.message_encoding, "")
                    channels[record.id] = record.topic, record.metadata.get("zenoh_encoding", encoding)


def open_recording(paths: Sequence[Path]) -> Recording:
    """A recording from its files, or from a folder of them; of several runs in a folder the latest.

    Raises:
        RecordingError: there is no file, one that is no recording, or files of several runs were named.
    """
    files = [file for path in paths for file in _files(path)]
    about = {file: _about(file) for file in dict.fromkeys(files)}
    if len(files) == 0:
        raise RecordingError(f"{paths[0]}: the folder holds no recording (*.mcap)")
    runs = {one["session"] for one in about.values()}
    latest = max(about.values(), key=lambda one: int(one["started_ns"]))["session"]
    if len(runs) > 1 and any(path.is_file() for path in paths):
        raise RecordingError(
            f"the files are of {len(runs)} runs of a service: give those of one run, or their folder for the latest"
        )
    chosen = sorted(
        (RecordingPlace(one["session"], int(one["number"])), file)
        for file, one in about.items()
        if one["session"] == latest
    )
    first = about[chosen[0][1]]
    return Recording(
        latest, first["version"], int(first["started_ns"]),
        [file for _, file in chosen], [place.number for place, _ in chosen],
    )  # fmt: skip


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        return [file for file in sorted(path.glob("*.mcap")) if is_recording(_head(file))]
    return [path]


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(64)
    except OSError as problem:
        raise RecordingError(f"{path}: cannot be read: {problem.strerror}") from None


def _about(path: Path) -> Mapping[str, str]:
    """Which run a file is of, and where in it.

    Raises:
        RecordingError: it does not say.
    """
    head = _head(path)
    if not is_recording(head):
        what = "it was not recorded by wingwatch" if head.startswith(MCAP_MAGIC) else "it is no MCAP file"
        raise RecordingError(f"{path}: {what}; wingwatch replay takes what wingwatch serve --record wrote")
    try:
        from mcap.records import Metadata
    except ImportError:
        raise RecordingError(
            f"{path}: recordings need mcap, which is not installed; install wingwatch with its extra logs"
        ) from None
    for record in _records(path, [], in_chunks=False):
        if isinstance(record, Metadata) and record.name == PROFILE:
            run = record.metadata
            if run.keys() >= {"version", "session", "number", "started_ns"} and _counts(run):
                return dict(run)
            break
    raise RecordingError(f"{path}: the recording is damaged: it names no run; record anew")


def _counts(run: Mapping[str, str]) -> bool:
    return run["number"].isdecimal() and run["started_ns"].isdecimal()


def _records(path: Path, notes: list[str], *, in_chunks: bool) -> Iterator[Any]:
    """Records one after another, to the end or to where the file is damaged; then a note is added.

    Args:
        in_chunks: whether those within chunks are wanted; without, chunks are passed over.
    """
    from mcap.exceptions import McapError
    from mcap.stream_reader import CRCValidationError, StreamReader

    damage: tuple[type[Exception], ...] = (
        McapError, CRCValidationError, struct.error, zlib.error, UnicodeDecodeError, ValueError, OverflowError,
        IndexError, KeyError, RuntimeError, *_compression_errors(),
    )  # fmt: skip
    with path.open("rb") as stream:
        reader = StreamReader(stream, emit_chunks=not in_chunks, record_size_limit=_MOST_RECORD)
        records = iter(reader.records)
        while True:
            try:
                record = next(records)
            except StopIteration:
                return
            except damage:
                notes.append(f"{path.name} ends early, as after a kill: what was written before is read")
                return
            yield record


def _compression_errors() -> tuple[type[Exception], ...]:
    import zstandard

    return (zstandard.ZstdError,)
