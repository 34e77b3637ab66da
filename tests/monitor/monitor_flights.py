"""What the monitor says at the end of a flight that is handed to it in pieces."""

from collections.abc import Mapping

from wingwatch.aircraft import Aircraft, ModeStructure
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.supervision import ModeSolution
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
