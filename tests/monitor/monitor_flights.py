"""What the monitor says of a flight that is handed to it in pieces."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wingwatch.aircraft import Aircraft, ModeStructure
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.estimation.mode_solution import ModeSolution
from wingwatch.telemetry import SampleBlock


def last_mode(
    aircraft: Aircraft, block: SampleBlock, piece: int, structure: ModeStructure, kinds: Mapping[str, str]
) -> ModeSolution:
    """The last solution of one structure; ``kinds`` of the surfaces as ``VehicleMonitor`` takes them."""
    monitor = VehicleMonitor(aircraft, "f", "v", block.present, kinds, new_id=lambda: "1")
    last = None
    for start in range(0, len(block), piece):
        report = monitor.feed(SampleBlock(block.values[start : start + piece]))
        last = report.solutions[-1].modes[structure.name] if report.solutions else last
    assert last is not None
    return last


def pieces(flight: SampleBlock, samples: int) -> Iterator[SampleBlock]:
    for start in range(0, len(flight), samples):
        yield SampleBlock(flight.values[start : start + samples])


def bits(value: Any) -> Any:
    """What two equal answers have in common, arrays by their bytes."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, ModeSolution):
        reported = (value.fourier, value.ekf, value.block, value.gained, value.rough, value.says_something)
        return tuple(map(bits, reported))
    if hasattr(value, "__dataclass_fields__") and not isinstance(value, type):
        return tuple(bits(getattr(value, name)) for name in value.__dataclass_fields__ if name != "structure")
    if isinstance(value, dict):
        return tuple((key, bits(one)) for key, one in value.items())
    return tuple(map(bits, value)) if isinstance(value, (list, tuple)) else repr(value)
