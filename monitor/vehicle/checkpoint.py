"""A checkpoint of one vehicle: all that is known of it, as bytes that are checked before anything is made of them.

The first line is text: format, layout of the state, checksum, vehicle. What follows is the state. A checkpoint of
another format or layout is refused, and so is one whose checksum does not hold. One that was saved under other settings
is refused by its ``settings`` when the vehicle's monitor is made again.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import STRUCTURES, ModeStructure
from wingwatch.estimators import EkfConfig, FourierConfig, SignalConfig
from wingwatch.monitor.detection.causes import CAUSES, UNEXPLAINED, Cause
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.detection.redundancy.layout import RELATIONS
from wingwatch.monitor.state_codec import Codec, Named, StateError
from wingwatch.monitor.vehicle.state import MonitorState
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor
from wingwatch.telemetry import AircraftMessage, SequenceState

__all__ = [
    "Checkpoint",
    "CheckpointError",
    "SavedVehicle",
    "decode_checkpoint",
    "default_settings",
    "encode_checkpoint",
    "settings_of",
]

FORMAT = 3
"""To be raised when the same layout comes to mean something else."""

MOST_BYTES = 16 * 2**20
"""Of a checkpoint; a vehicle that sends 50 samples a second has about half a megabyte."""

_MAGIC = b"wingwatch-checkpoint"
_MOST_LINE = 400

CODEC = Codec(
    {
        Cause: Named(lambda cause: str(cause.name), {c.name: c for c in (*CAUSES, UNEXPLAINED)}),
        ModeStructure: Named(lambda structure: str(structure.name), STRUCTURES),
    }
)
"""Writes states, and the settings that they were made under."""


class CheckpointError(ValueError):
    """A checkpoint that cannot be used; one clause."""


@dataclass(frozen=True, slots=True)
class SavedVehicle:
    """What the live loop knows of a vehicle (``KnownVehicle``), wall-clock times as ages.

    Attributes:
        settings: of ``settings_of``, for the monitor.
        silent_s: time since the last message that was used, at the moment of saving.
        message: what it said it is; watched_as: with the loading that it is watched at.
        given: channels of the messages that the monitor was made for.
        late: whether what is kept of the vehicle came after the monitor had been made; recalled: whether it has come.
        counts, arrivals, history_s: as there.
        waiting: samples that ``arrivals`` names as taken in and ``monitor`` has not seen, shape (samples, channels).
    """

    fleet: str
    vehicle: str
    settings: str
    silent_s: float
    message: AircraftMessage
    watched_as: AircraftMessage
    given: tuple[str, ...]
    late: bool
    recalled: bool
    counts: dict[str, int]
    arrivals: SequenceState
    history_s: float
    waiting: NDArray[np.float64]
    monitor: MonitorState

    @property
    def alarmed(self) -> bool:
        """Whether an alert was in force."""
        return self.monitor.book.active is not None or bool(self.monitor.redundancy_book.active)


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A saved vehicle and when that was, seconds since 1970-01-01 UTC."""

    saved_at_s: float
    saved: SavedVehicle


def encode_checkpoint(checkpoint: Checkpoint) -> bytes:
    """A checkpoint as bytes."""
    state = CODEC.encode(Checkpoint, checkpoint)
    name = f"{checkpoint.saved.fleet}/{checkpoint.saved.vehicle}"
    line = (_MAGIC, str(FORMAT).encode(), _layout(), _checksum(state), name.encode())
    return b" ".join(line) + b"\n" + state


def decode_checkpoint(data: bytes) -> Checkpoint:
    """The checkpoint that ``encode_checkpoint`` wrote.

    Raises:
        CheckpointError: bytes of something else, damaged, or of another version of the state.
    """
    line, _, state = data.partition(b"\n")
    parts = line.split(b" ")
    if len(line) > _MOST_LINE or len(parts) != 5 or parts[0] != _MAGIC:
        raise CheckpointError("it is no checkpoint, or its beginning is damaged")
    if parts[1:3] != [str(FORMAT).encode(), _layout()]:
        raise CheckpointError("it was saved by a version of wingwatch that keeps its state in another form")
    if parts[3] != _checksum(state):
        raise CheckpointError("it is damaged: its checksum does not hold")
    try:
        return CODEC.decode(Checkpoint, state)
    except StateError as error:
        raise CheckpointError(f"it is damaged: {error}") from error


def settings_of(monitor: VehicleMonitor, given: Sequence[str]) -> str:
    """What a monitor was made from, as a fingerprint: under others its state means something else.

    Args:
        monitor: before or after samples.
        given: channels of the messages that it was made for.
    """
    found = hashlib.sha256(monitor.aircraft.model_dump_json().encode())
    found.update(CODEC.encode(tuple[str, ...], (monitor.configuration, *given)))
    found.update(CODEC.encode(JudgeConfig, monitor.judge.config))
    found.update(repr(RELATIONS).encode())
    for name, pair in monitor.chain.supervisor.pairs.items():
        found.update(CODEC.encode(str, name))
        found.update(CODEC.encode(bool, pair.vane))
        found.update(CODEC.encode(SignalConfig, pair.signals.config))
        found.update(CODEC.encode(FourierConfig, pair.fourier.config))
        found.update(CODEC.encode(EkfConfig, pair.ekf.config))
    return found.hexdigest()


@cache
def default_settings() -> str:
    """Fingerprint of the settings that estimators and test have where nothing else is said, and of the state's form.

    Two services that show the same one estimate alike from the same aircraft file.
    """
    found = hashlib.sha256(_layout() + repr(RELATIONS).encode())
    for kind in (SignalConfig, FourierConfig, EkfConfig, JudgeConfig):
        for one in fields(kind):
            if one.default is not MISSING:
                found.update(f"{kind.__name__}.{one.name}={one.default!r}\n".encode())
    return found.hexdigest()[:12]


@cache
def _layout() -> bytes:
    return hashlib.sha256(CODEC.layout(Checkpoint).encode()).hexdigest()[:16].encode()


def _checksum(state: bytes) -> bytes:
    return hashlib.blake2b(state, digest_size=16).hexdigest().encode()
