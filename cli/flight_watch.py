"""A recorded flight through the very code that watches live, in pieces of one message each."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.cli.flight_clocks import Clock, clocks_of
from wingwatch.monitor import AlertView, ManoeuvreView, MonitorStart, Report, VehicleMonitor
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import Progress
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.telemetry import FlightTable, SampleBlock, load_flight

__all__ = ["OFFLINE", "Watched", "load", "watch"]

OFFLINE = "offline"
"""What a vehicle is called that is known from a file only."""

PIECE = 10
"""Samples at a time, as a vehicle sends them; how a flight is cut changes nothing but how often we look."""

Listener = Callable[[VehicleMonitor, Report], None]


@dataclass(frozen=True)
class Watched:
    """What watching a flight led to.

    Attributes:
        monitor: in its state after the last sample.
        flight: the flight.
        alerts: each alert as it stood last, in the order in which they were raised.
        conditions: by alert, the flight condition of the evidence.
        clock_numbers: by alert, which of ``clocks`` its times are of, counted from 0.
        manoeuvres: verdicts in the order of the flight; empty where they were not asked for.
    """

    monitor: VehicleMonitor
    flight: FlightTable
    alerts: tuple[AlertView, ...]
    conditions: Mapping[str, FlightCondition] = field(default_factory=dict)
    clock_numbers: Mapping[str, int] = field(default_factory=dict)
    manoeuvres: tuple[ManoeuvreView, ...] = ()

    @cached_property
    def clocks(self) -> tuple[Clock, ...]:
        """The clocks of the accepted samples, in the order of the rows."""
        return clocks_of(self.flight.block)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last accepted sample, of all clocks together."""
        return sum(clock.to_s - clock.from_s for clock in self.clocks)

    @property
    def cleaning(self) -> dict[str, Any]:
        """What reading and cleaning counted, for JSON."""
        read, report = self.flight.report, self.monitor.cleaner.report
        return {
            "rows_read": read.rows_read,
            "rows_kept": read.rows_kept,
            **report.counts,
            "pending": report.pending,
            "by_channel": dict(report.by_channel),
            "unused_columns": list(read.unused),
            "unreadable_columns": list(read.ignored),
            "notes": list(read.notes),
            **({"rates_hz": dict(read.rates_hz)} if read.rates_hz else {}),
        }

    @property
    def cleaning_text(self) -> str:
        """The same as one line for a person."""
        return f"{self.flight.report.text}; {self.monitor.cleaner.report.text}"


def load(path: Path, channel_map: Path | None, aircraft: str) -> tuple[FlightTable, Aircraft]:
    """The flight and its aircraft; the aircraft first, since it is quicker to be wrong about."""
    known = load_aircraft(aircraft)
    return load_flight(path, channel_map, surface_travel(known)), known


def watch(
    flight: FlightTable,
    aircraft: Aircraft,
    progress: Progress,
    *,
    fleet: str = "default",
    vehicle: str = OFFLINE,
    start: MonitorStart | None = None,
    listener: Listener | None = None,
) -> Watched:
    """Feed a flight to the monitor of one vehicle.

    Args:
        start: configuration, engine of the filter, and what is kept of earlier flights; nothing without.
        listener: called after each piece.

    Raises:
        CommandError: the flight has not the channels for any mode, or the aircraft no expectation.
    """
    numbers = iter(range(1, 1 + len(flight.block)))
    monitor = VehicleMonitor(
        aircraft, fleet, vehicle, flight.block.present, flight.kinds,
        new_id=lambda: f"alert-{next(numbers)}", start=start,
    )  # fmt: skip
    if not monitor.chain.structures:
        reasons = "; ".join(f"{name}: {why}" for name, why in monitor.chain.absent.items())
        raise CommandError(f"{flight.source}: no mode can be estimated ({reasons})")
    alerts: dict[str, AlertView] = {}
    clock_numbers: dict[str, int] = {}
    conditions: dict[str, FlightCondition] = {}
    for piece in progress.track(list(_pieces(flight.block)), "watching the flight"):
        report = monitor.feed(piece)
        for alert in report.alerts:
            known, block = alerts.get(alert.id), monitor.last_block
            if block is not None and (known is None or alert.evidence is not known.evidence):
                conditions[alert.id] = (
                    block.condition
                )  # a piece holds one solution, so this is the evidence's block
            clock_numbers.setdefault(alert.id, monitor.cleaner.report.events.get("clock_change", 0))
            alerts[alert.id] = alert
        if listener is not None:
            listener(monitor, report)
    return Watched(monitor, flight, tuple(alerts.values()), conditions, clock_numbers)


def _pieces(block: SampleBlock) -> Iterator[SampleBlock]:
    for start in range(0, len(block), PIECE):
        yield SampleBlock(block.values[start : start + PIECE])
