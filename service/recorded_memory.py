"""What a database knew of vehicles, as bytes that a recording carries, and back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from wingwatch.aircraft import STRUCTURES, Aircraft
from wingwatch.baselines import DECLARED, MEASURED, CellMemory, Envelope, Expectation, Reference
from wingwatch.monitor import AlertView
from wingwatch.monitor.detection.cell_memory import CellPlace
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle.checkpoint import CODEC

__all__ = [
    "decode_earlier_alerts",
    "decode_envelopes",
    "decode_memory",
    "encode_earlier_alerts",
    "encode_envelopes",
    "encode_memory",
]


@dataclass(frozen=True, slots=True)
class _Points:
    """Of an envelope: its entries, and whether somebody declared its edge."""

    points: tuple[Expectation, ...]
    declared: bool


@dataclass(frozen=True, slots=True)
class _Memory:
    """``VehicleMemory`` in what can be written."""

    references: Mapping[str, Reference] = field(default_factory=dict)
    envelopes: Mapping[str, _Points] = field(default_factory=dict)
    cells: Mapping[CellPlace, CellMemory] = field(default_factory=dict)


def encode_memory(memory: VehicleMemory) -> bytes:
    """What a vehicle's monitor started with."""
    return CODEC.encode(_Memory, _Memory(memory.references, _points(memory.envelopes), memory.cells))


def decode_memory(data: bytes, aircraft: Aircraft, configuration: str) -> VehicleMemory:
    """The memory that ``encode_memory`` wrote.

    Raises:
        StateError: bytes of something else.
    """
    found = CODEC.decode(_Memory, data)
    return VehicleMemory(found.references, _envelopes(found.envelopes, aircraft, configuration), found.cells)


def encode_envelopes(envelopes: Mapping[str, Envelope]) -> bytes:
    """Expectations of a type."""
    return CODEC.encode(_Memory, _Memory(envelopes=_points(envelopes)))


def decode_envelopes(data: bytes, aircraft: Aircraft, configuration: str) -> dict[str, Envelope]:
    """The expectations that ``encode_envelopes`` wrote.

    Raises:
        StateError: bytes of something else.
    """
    return _envelopes(CODEC.decode(_Memory, data).envelopes, aircraft, configuration)


def encode_earlier_alerts(alerts: Sequence[AlertView]) -> bytes:
    """Alerts of earlier runs."""
    return CODEC.encode(tuple[AlertView, ...], tuple(alerts))


def decode_earlier_alerts(data: bytes) -> tuple[AlertView, ...]:
    """The alerts that ``encode_earlier_alerts`` wrote.

    Raises:
        StateError: bytes of something else.
    """
    alerts: tuple[AlertView, ...] = CODEC.decode(tuple[AlertView, ...], data)
    return alerts


def _points(envelopes: Mapping[str, Envelope]) -> dict[str, _Points]:
    return {name: _Points(one.points, one.neighbourhood == DECLARED) for name, one in envelopes.items()}


def _envelopes(points: Mapping[str, _Points], aircraft: Aircraft, configuration: str) -> dict[str, Envelope]:
    return {
        name: Envelope(
            aircraft, STRUCTURES[name], one.points, configuration=configuration,
            neighbourhood=DECLARED if one.declared else MEASURED,
        )
        for name, one in points.items()
    }  # fmt: skip
