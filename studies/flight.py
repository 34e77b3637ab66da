"""From plans to rows: flights simulated together, each watched by the code that runs live."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from wingwatch.aircraft import Aircraft
from wingwatch.monitor import Chain
from wingwatch.monitor.estimation.chain import STRUCTURES_WATCHED
from wingwatch.monitor.fleet.together import feed_together
from wingwatch.simulation import (
    FleetSimulation,
    Scenario,
)
from wingwatch.studies.expectation import Expectations
from wingwatch.studies.flight_rows import row_of, sentence_of, unflown_row
from wingwatch.studies.plan import FlightPlan
from wingwatch.studies.watched_flight import UNSENSED, WatchedFlight, scenario_of
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = ["FlightMaker"]

_PIECE_S = 0.5
"""No more than one solution of the monitor falls into a piece."""


class FlightMaker:
    """Flies plans and makes their rows; keeps what the aircraft share.

    Args:
        aircraft: by the name under which plans know them.
    """

    def __init__(self, aircraft: Mapping[str, Aircraft]) -> None:
        self._aircraft = aircraft
        self._expectations: dict[str, Expectations] = {}
        self._chains: dict[tuple[str, tuple[str, ...]], Chain] = {}

    def rows(self, plans: Sequence[FlightPlan], command: str) -> list[dict[str, Any]]:
        """One row a plan, in their order.

        Args:
            command: that flies one of them again, with ``{seed}``.
        """
        with threadpool_limits(limits=1):  # more threads would change the last bit of sums, and help nobody
            flown = self._flown(plans)
        return [
            row_of(plan, command, watch)
            if isinstance(watch, WatchedFlight)
            else unflown_row(plan, command, watch)
            for plan, watch in zip(plans, flown, strict=True)
        ]

    def samples(self, plan: FlightPlan) -> SampleBlock:
        """The whole flight of a plan, all channels, as its sensors report it."""
        simulation = FleetSimulation([scenario_of(plan, self._aircraft[plan.aircraft])], plan.rate_hz)
        values = simulation.step(round(plan.seconds * plan.rate_hz))[0]
        beyond = np.flatnonzero(~np.isfinite(values[:, CHANNEL_INDEX[UNSENSED]]))
        return SampleBlock(values[: beyond[0]] if beyond.size else values)

    def _flown(self, plans: Sequence[FlightPlan]) -> list["WatchedFlight | str"]:
        """A watched flight of each plan, or why there is none."""
        out: list[WatchedFlight | str] = []
        scenarios: list[Scenario] = []
        watches: list[WatchedFlight] = []
        for plan in plans:
            try:
                aircraft = self._aircraft[plan.aircraft]
                scenario = scenario_of(plan, aircraft)
                FleetSimulation([scenario], plan.rate_hz)
                watch = WatchedFlight(plan, aircraft, self._expected(plan.aircraft), self._chains)
            except Exception as error:  # one flight that cannot be flown must not stop the others
                out.append(sentence_of(error))
                continue
            out.append(watch)
            scenarios.append(scenario)
            watches.append(watch)
        problems = _fly(scenarios, watches) if watches else {}
        return [problems.get(id(w), w) for w in out]

    def _expected(self, name: str) -> Expectations:
        if name not in self._expectations:
            self._expectations[name] = Expectations(self._aircraft[name], STRUCTURES_WATCHED)
        return self._expectations[name]


def _fly(scenarios: Sequence[Scenario], watches: Sequence[WatchedFlight]) -> dict[int, str]:
    """Fly and watch to the end; the sentence of each watch that failed, by its identity."""
    plan = watches[0].plan
    simulation = FleetSimulation(scenarios, plan.rate_hz)
    piece = max(1, int(_PIECE_S * plan.rate_hz))
    left = round(plan.seconds * plan.rate_hz)
    problems: dict[int, str] = {}
    while left > 0:
        with _timed(watches):
            values = simulation.step(min(piece, left))
        left -= piece
        flying = [n for n, w in enumerate(watches) if not w.lost and id(w) not in problems]
        with _timed([watches[n] for n in flying]):
            blocks = {n: block for n in flying if len(block := watches[n].sensed(values[n]))}
            reports = feed_together([watches[n].monitor for n in blocks], list(blocks.values()))
            for n, report in zip(blocks, reports, strict=True):
                watch = watches[n]
                try:
                    if isinstance(report, Exception):
                        raise report
                    watch.hear(report)
                except Exception as error:  # a fault over one flight is that flight's row
                    problems[id(watch)] = sentence_of(error)
    return problems


@contextmanager
def _timed(watches: Sequence[WatchedFlight]) -> Iterator[None]:
    """The time spent, shared out evenly."""
    wall_s, processor_s = time.perf_counter(), time.process_time()
    yield
    for watch in watches:
        watch.wall_s += (time.perf_counter() - wall_s) / len(watches)
        watch.processor_s += (time.process_time() - processor_s) / len(watches)
