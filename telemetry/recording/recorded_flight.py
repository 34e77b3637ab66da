"""A vehicle's samples out of a recording, as the columns of a flight."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.keys import KeyNameError, parse_key
from wingwatch.telemetry.messages import MessageError, SensorsMessage, decode_sensors
from wingwatch.telemetry.recording.reading import Recording, open_recording
from wingwatch.telemetry.recording.recording_file import RecordingError
from wingwatch.telemetry.sample import CHANNEL_NAMES
from wingwatch.telemetry.tables.raw_table import RawTable, make_table

__all__ = ["RecordedSamples", "read_recording", "recorded_samples"]

Array = NDArray[np.float64]
_NAMED = 8


@dataclass(slots=True)
class RecordedSamples:
    """Sensors messages of one vehicle in the order in which they came.

    Attributes:
        messages: decoded.
        unread: messages that are none.
    """

    messages: list[SensorsMessage] = field(default_factory=list)
    unread: int = 0

    def columns(self) -> dict[str, Array]:
        """Channels that messages carried, one after another; NaN where one did not carry a channel."""
        given = {name for message in self.messages for name in message.given}
        return {
            name: np.concatenate([_column(message, name) for message in self.messages])
            for name in CHANNEL_NAMES
            if name in given
        }


def _column(message: SensorsMessage, name: str) -> Array:
    if name in message.given:
        return message.block.column(name)
    return np.full(len(message.block), np.nan)


def recorded_samples(recording: Recording) -> Mapping[tuple[str, str], RecordedSamples]:
    """Samples by fleet and vehicle."""
    found: dict[tuple[str, str], RecordedSamples] = {}
    for message in recording.messages():
        try:
            key = parse_key(message.topic)
        except KeyNameError:
            continue
        if key.leaf != "sensors":
            continue
        samples = found.setdefault((key.fleet, key.vehicle), RecordedSamples())
        try:
            samples.messages.append(decode_sensors(message.payload, message.encoding))
        except MessageError:
            samples.unread += 1
    return {key: samples for key, samples in found.items() if samples.messages}


def read_recording(path: Path) -> RawTable:
    """The flight of a recording's one vehicle.

    Raises:
        RecordingError: the recording cannot be read, or has no vehicle's samples or those of several.
    """
    recording = open_recording([path])
    found = recorded_samples(recording)
    if not found:
        raise RecordingError(f"{path}: the recording holds no samples of a vehicle")
    if len(found) > 1:
        names = [f"{fleet}/{vehicle}" for fleet, vehicle in sorted(found)]
        shown = ", ".join(names[:_NAMED]) + (
            f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        )
        raise RecordingError(
            f"{path}: the recording holds {len(names)} vehicles ({shown}); "
            "wingwatch replay RECORDING --tables DIR writes a flight of each"
        )
    samples = next(iter(found.values()))
    notes = list(recording.notes)
    if samples.unread:
        notes.append(f"{samples.unread} messages of sensors cannot be decoded")
    return make_table(str(path), "recording", samples.columns(), (), notes)
