"""Vehicles that advance as one batch: each says what it says alone, to the bit, and no fault passes to another."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from fleet_hall import AEROSONDE, fly_doublets
from monitor_flights import bits, pieces

from wingwatch.estimators import EkfState
from wingwatch.estimators.ekf.accepted import go_back
from wingwatch.monitor import Report, VehicleMonitor
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.together import feed_together
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.simulation import ElevatorEffectiveness, FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import CHANNEL_INDEX, AircraftMessage, SampleBlock

RATE_HZ, SECONDS = 50.0, 100.0
CUTS = (7, 10, 64, 25)
"""Samples a message of each vehicle."""
JOINS = 30
"""Turns after which the last vehicle joins; all but the first land long before that one does."""


@pytest.fixture(scope="module")
def flights() -> list[SampleBlock]:
    """One whose elevator loses effect, one in rough air, two in still air."""
    scenes = [
        Scenario(AEROSONDE, manoeuvres=(doublet_schedule(AEROSONDE, Scenario(AEROSONDE).condition, start_s=s),), **more)
        for s, more in ((1.0, {"turbulence": "moderate", "seed": 5}), (2.5, {"seed": 6}), (0.5, {"seed": 7}))
    ]  # fmt: skip
    rows = FleetSimulation(scenes, RATE_HZ).step(round(30.0 * RATE_HZ))
    return [
        fly_doublets(SECONDS, ElevatorEffectiveness(0.6, 60.0)),
        *(SampleBlock(values) for values in rows),
    ]


def maker() -> MonitorMaker:
    return MonitorMaker(lambda: "1", JudgeConfig())


def made(by: MonitorMaker, name: str, flight: SampleBlock) -> VehicleMonitor:
    message = AircraftMessage(aircraft="aerosonde")
    return by.make("f", name, AEROSONDE, message, flight.present, VehicleMemory())


def said(monitor: VehicleMonitor, reports: Sequence[Report | Exception]) -> list[Any]:
    """All solutions and alerts on the way, the last block with its verdict, and what is shown in the end."""
    assert not [r for r in reports if isinstance(r, Exception)]
    end = (monitor.last_block, monitor.last_verdict, monitor.derivatives(), monitor.view())
    return [bits(reports), bits(end)]


def alone(flight: SampleBlock, name: str, samples: int) -> list[Any]:
    monitor = made(maker(), name, flight)
    return said(monitor, [monitor.feed(piece) for piece in pieces(flight, samples)])


def in_company(flights: Sequence[SampleBlock]) -> list[list[Any]]:
    """By turns a message of every vehicle that is there, all of a turn at once; the last one joins late."""
    one = maker()
    monitors = [made(one, f"v{i}", flight) for i, flight in enumerate(flights[:-1])]
    waiting = [pieces(flight, samples) for flight, samples in zip(flights, CUTS, strict=True)]
    reports: list[list[Report | Exception]] = [[] for _ in flights]
    turn = 0
    while waiting:
        if turn == JOINS:
            monitors.append(made(one, f"v{len(monitors)}", flights[-1]))
        there = [(i, piece) for i in range(len(monitors)) if (piece := next(waiting[i], None)) is not None]
        if not there:
            break
        for (i, _), report in zip(
            there, feed_together([monitors[i] for i, _ in there], [piece for _, piece in there]), strict=True
        ):
            reports[i].append(report)
        turn += 1
    return [said(monitor, reported) for monitor, reported in zip(monitors, reports, strict=True)]


def test_what_a_vehicle_says_does_not_depend_on_its_company_to_the_bit(flights: list[SampleBlock]) -> None:
    together = in_company(flights)
    assert "elevator_effectiveness" in repr(together[0])  # there is an alert to compare
    for i, flight in enumerate(flights):
        assert together[i] == alone(flight, f"v{i}", CUTS[i]), f"vehicle {i}"


def test_a_vehicle_that_comes_into_the_place_of_another_begins_anew(flights: list[SampleBlock]) -> None:
    one = maker()
    first, gone = made(one, "v0", flights[1]), made(one, "v1", flights[2])
    feed_together([first, gone], [flights[1], flights[2]])
    place = gone.chain_state.lane.place
    del gone
    second = made(one, "v3", flights[3])
    assert second.chain_state.lane.place == place
    reports = [feed_together([second], [piece])[0] for piece in pieces(flights[3], CUTS[3])]
    assert said(second, reports) == alone(flights[3], "v3", CUTS[3])


@pytest.mark.parametrize("method", ["judge_solution", "prepared"])
def test_a_fault_over_one_vehicle_touches_no_other(
    flights: list[SampleBlock], method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = maker()
    monitors = [made(one, name, flights[i]) for name, i in (("v2", 2), ("v3", 3))]
    monkeypatch.setattr(monitors[0], method, lambda *_: 1 / 0)
    reports = [
        feed_together(monitors, blocks)
        for blocks in zip(*(list(pieces(flights[i], 25)) for i in (2, 3)), strict=True)
    ]
    assert all(isinstance(report[0], ZeroDivisionError) for report in reports[-40:])
    assert said(monitors[1], [report[1] for report in reports]) == alone(flights[3], "v3", 25)


def test_a_fault_of_the_filter_over_one_vehicle_touches_no_other(
    flights: list[SampleBlock], monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = alone(flights[3], "v3", 25)
    one = maker()
    monitors = [made(one, name, flights[i]) for name, i in (("v2", 2), ("v3", 3))]
    place = monitors[0].chain_state.lane.place

    def failing(state: EkfState, i: int, first: int) -> None:
        if i == place:
            raise np.linalg.LinAlgError("singular")
        go_back(state, i, first)

    monkeypatch.setattr("wingwatch.estimators.ekf.estimator.go_back", failing)
    reports = [
        feed_together(monitors, blocks)
        for blocks in zip(*(list(pieces(flights[i], 25)) for i in (2, 3)), strict=True)
    ]
    assert any(isinstance(report[0], np.linalg.LinAlgError) for report in reports)
    assert said(monitors[1], [report[1] for report in reports]) == expected


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_vehicle_whose_numbers_overflow_touches_no_other(flights: list[SampleBlock]) -> None:
    one = maker()
    wild = flights[2].values.copy()
    wild[500:, CHANNEL_INDEX["pitch_rate_rad_s"]] = 1e300  # cleaning would not let it through
    monitors = [made(one, f"v{i}", flights[i]) for i in (2, 3)]
    states = [m.chain_state for m in monitors]
    faults: dict[int, Exception] = {}
    blocks = [SampleBlock(wild), flights[3]]
    solutions = [s[1] for s in monitors[0].chain.advance_together(states, blocks, faults) if 1 in s]
    single = made(maker(), "v3", flights[3])
    expected = list(single.chain.advance(single.chain_state, flights[3]))
    assert list(map(bits, solutions)) == list(map(bits, expected))
