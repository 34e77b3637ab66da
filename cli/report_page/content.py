"""All that the page says, worked out once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wingwatch.aircraft import Aircraft, ModeQuantity, mode_quantities
from wingwatch.api import AlertDocument, CouldSeeDocument
from wingwatch.cli.flight_watch import OFFLINE, Watched, watch
from wingwatch.cli.monitor_command import alerts_of
from wingwatch.cli.report_page.course import Course
from wingwatch.cli.unusable import refuse_unusable
from wingwatch.diagnosis.condition_report import Conditioned, condition
from wingwatch.diagnosis.predicted_motion import PredictedManoeuvre, predicted_motion
from wingwatch.monitor import VehicleMonitor
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import Progress
from wingwatch.telemetry import Cleaner, FlightTable, SampleBlock

__all__ = ["PATH_S", "FlightContent", "collect"]

PATH_S = 240.0
"""Sensor errors are those of so much of the flight: ten minutes of it would take a gigabyte."""


@dataclass(frozen=True)
class FlightContent:
    """What is shown.

    Attributes:
        watched: the flight after it was watched, with its alerts.
        aircraft: as its file has it.
        clean: accepted samples.
        course: estimates over time.
        derivatives: the object of ``estimate``.
        alerts, evidence, could_see: as ``monitor`` has them.
        quantities: of the modes at the end, by structure and estimator.
        manoeuvres: measured against predicted motion; ``not_predicted`` says what is left out.
        conditioned: sensors and air; None where nothing could be found out.
    """

    watched: Watched
    aircraft: Aircraft
    clean: SampleBlock
    course: Course
    derivatives: Mapping[str, Any]
    alerts: list[AlertDocument]
    evidence: Mapping[str, list[dict[str, Any]]]
    could_see: list[CouldSeeDocument]
    quantities: Mapping[str, Mapping[str, Sequence[ModeQuantity]]]
    manoeuvres: Sequence[PredictedManoeuvre] = ()
    not_predicted: Sequence[str] = ()
    conditioned: Conditioned | None = None
    notes: Sequence[str] = field(default=())

    @property
    def flight(self) -> FlightTable:
        """As it was loaded."""
        return self.watched.flight

    @property
    def name(self) -> str:
        """Of the file, without its folder."""
        return Path(self.flight.source).name

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last stamp."""
        time_s = self.clean.time_s
        return float(time_s.min()), float(time_s.max())


def collect(flight: FlightTable, aircraft: Aircraft, progress: Progress) -> FlightContent:
    """Watch a flight, predict its manoeuvres, look at its sensors.

    Raises:
        CommandError: nothing could be judged.
    """
    clean = Cleaner().clean(flight.block).block
    time_s = clean.time_s
    course = Course(float(time_s.max() - time_s.min()) if time_s.size else 0.0)
    watched = watch(flight, aircraft, progress, listener=course)
    refuse_unusable(watched)
    alerts, evidence, could_see = alerts_of(watched, "concise")
    monitor = watched.monitor
    structures = monitor.chain.structures
    manoeuvres, not_predicted = predicted_motion(
        flight, aircraft, _attached(flight, aircraft), structures, course.known, progress.track
    )
    conditioned, notes = _conditioned(flight, aircraft, progress)
    return FlightContent(
        watched, aircraft, clean, course, monitor.derivatives(), alerts, evidence, could_see,
        _quantities(monitor), manoeuvres, not_predicted, conditioned, notes,
    )  # fmt: skip


def _conditioned(
    flight: FlightTable, aircraft: Aircraft, progress: Progress
) -> tuple[Conditioned | None, tuple[str, ...]]:
    try:
        found = condition(flight, aircraft, None, progress.track, PATH_S)
    except (ValueError, CommandError) as error:
        return None, (str(error),)
    return found, ()


def _attached(flight: FlightTable, aircraft: Aircraft) -> SampleBlock:
    """Samples as they are estimated from, of attached flight alone."""
    fresh = VehicleMonitor(
        aircraft, "default", OFFLINE, flight.block.present, flight.kinds, new_id=lambda: ""
    )
    return fresh.prepared(flight.block)


def _quantities(monitor: VehicleMonitor) -> dict[str, dict[str, Sequence[ModeQuantity]]]:
    found: dict[str, dict[str, Sequence[ModeQuantity]]] = {}
    for name, mode in monitor.chain.current(monitor.chain_state).modes.items():
        for one in mode.estimates:
            if np.isfinite(one.value).all():
                values = dict(zip(one.structure.derivatives, one.value.tolist(), strict=True))
                quantities = mode_quantities(one.structure, values, one.covariance)
                found.setdefault(name, {})[one.estimator] = quantities
    return found
