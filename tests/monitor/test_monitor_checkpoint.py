"""Saved and restored equals uninterrupted, to the bit: alone, together, in another process, for all kinds of input."""

import multiprocessing
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pytest
from fleet_hall import AEROSONDE, fly_doublets
from monitor_flights import bits, pieces

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.estimators import EkfEstimator
from wingwatch.monitor import Report, VehicleMonitor
from wingwatch.monitor.detection.alerts import AlertBook, BookState
from wingwatch.monitor.detection.cell_memory import CellBook, CellBookState
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.detection.redundancy import RedundancyWatch, VehicleRelations
from wingwatch.monitor.estimation.chain import ChainState, SavedChain
from wingwatch.monitor.estimation.mode_solution import ModeSolution
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.together import feed_together
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle.checkpoint import (
    CODEC,
    Checkpoint,
    CheckpointError,
    SavedVehicle,
    decode_checkpoint,
    encode_checkpoint,
    settings_of,
)
from wingwatch.monitor.vehicle.state import MonitorState, SavedMode, SavedSolution
from wingwatch.simulation import ElevatorEffectiveness, Scenario, doublet_schedule, simulate
from wingwatch.telemetry import (
    CHANNEL_INDEX,
    CHANNELS,
    AircraftMessage,
    Aligner,
    Cleaner,
    SampleBlock,
    SequenceState,
    SequenceTracker,
)

MESSAGE = AircraftMessage(aircraft="aerosonde")
SAMPLES = 10
VANES = [CHANNEL_INDEX[name] for name in ("angle_of_attack_rad", "sideslip_rad")]
POSITIONS = [CHANNEL_INDEX[f"{surface}_rad"] for surface in ("elevator", "aileron", "rudder")]
DELAYED = AEROSONDE.model_copy(
    update={
        "sensors": AEROSONDE.sensors.model_copy(
            update={
                "delay_s": {"specific_force_z_m_s2": 0.06, "angle_of_attack_rad": 0.04, "pitch_rad": 0.05}
            }
        )
    }
)


@dataclass(frozen=True)
class Case:
    """A flight, the aircraft it is expected to be of, and the filter's engine."""

    flight: SampleBlock
    aircraft: Aircraft = AEROSONDE
    engine: Literal["compiled", "filterpy"] = "compiled"
    cuts: int = 6

    def monitor(self) -> VehicleMonitor:
        """A new one, with estimators of its own."""
        maker = MonitorMaker(lambda: "1", JudgeConfig())
        made = maker.make("f", "v", self.aircraft, MESSAGE, self.flight.present, VehicleMemory())
        for name, pair in made.chain.supervisor.pairs.items():
            config = replace(pair.ekf.config, engine=self.engine)
            made.chain.supervisor.pairs[name] = replace(pair, ekf=EkfEstimator(config))
        return made

    @cached_property
    def whole(self) -> tuple[list[Any], bytes, Any]:
        """Of the flight without an interruption: reports, the state in the end, and what is shown then."""
        monitor = self.monitor()
        reports = [content(monitor.feed(piece)) for piece in pieces(self.flight, SAMPLES)]
        return reports, state_bytes(monitor), bits((monitor.derivatives(), monitor.view()))


def content(report: Report) -> Any:
    """What a report says, but for the manoeuvres: their verdicts are of one run (decision 99)."""
    return bits(replace(report, manoeuvres=[]))


def without(flight: SampleBlock, columns: Sequence[int], to_s: float = np.inf) -> SampleBlock:
    values = flight.values[flight.time_s < to_s].copy()
    values[:, columns] = np.nan
    return SampleBlock(values)


def torn(flight: SampleBlock) -> SampleBlock:
    """With readings missing, a gap, single wrong time stamps, and a clock that is set back for good."""
    values = flight.values.copy()
    values[200:230, CHANNEL_INDEX["pitch_rate_rad_s"]] = np.nan
    values[900:960, 0] = np.nan
    values[1500, 0] += 1e6
    values[2000:, 0] -= 30.0
    return SampleBlock(np.delete(values, slice(1200, 1300), axis=0))


def rough() -> SampleBlock:
    schedule = doublet_schedule(AEROSONDE, FlightCondition(25.0, 1000.0), start_s=1.0)
    return simulate(Scenario(AEROSONDE, manoeuvres=(schedule,), turbulence="moderate", seed=5), 60.0)


CASES: dict[str, Callable[[], Case]] = {
    "an elevator that loses effect": lambda: Case(fly_doublets(140.0, ElevatorEffectiveness(0.6, 60.0))),
    "rough air": lambda: Case(rough()),
    "stated delays": lambda: Case(fly_doublets(60.0), DELAYED),
    "surfaces by command": lambda: Case(without(fly_doublets(60.0), POSITIONS)),
    "delays and commands": lambda: Case(without(fly_doublets(60.0), POSITIONS), DELAYED),
    "no vanes": lambda: Case(without(rough(), VANES)),
    "a torn stream": lambda: Case(torn(fly_doublets(60.0)), cuts=15),
    "the other engine": lambda: Case(without(fly_doublets(60.0), [], to_s=8.0), engine="filterpy", cuts=5),
}


@pytest.fixture(scope="module")
def cases() -> dict[str, Case]:
    return {}


def case_of(name: str, cases: dict[str, Case]) -> Case:
    if name not in cases:
        cases[name] = CASES[name]()
    return cases[name]


def saved_vehicle(monitor: VehicleMonitor, given: Sequence[str]) -> SavedVehicle:
    return SavedVehicle(
        fleet="f", vehicle="v", settings=settings_of(monitor, given), silent_s=0.5, message=MESSAGE,
        watched_as=MESSAGE, given=tuple(given), late=False, recalled=True, counts={"faults": 2},
        arrivals=SequenceTracker().state, history_s=float("-inf"), waiting=np.empty((0, len(CHANNELS))),
        monitor=monitor.saved(),
    )  # fmt: skip


def as_bytes(monitor: VehicleMonitor, given: Sequence[str]) -> bytes:
    return encode_checkpoint(Checkpoint(1.7e9, saved_vehicle(monitor, given)))


def restored(case: Case, data: bytes) -> VehicleMonitor:
    saved = decode_checkpoint(data).saved
    monitor = case.monitor()
    assert settings_of(monitor, case.flight.present) == saved.settings
    monitor.restore(saved.monitor)
    return monitor


def state_bytes(monitor: VehicleMonitor) -> bytes:
    """All that it remembers; which cells are handed over once more is the store's affair."""
    monitor.cells.take_changed()
    return CODEC.encode(MonitorState, monitor.saved())


@pytest.mark.parametrize("name", CASES)
def test_a_flight_that_was_saved_and_restored_is_the_uninterrupted_one(
    name: str, cases: dict[str, Case]
) -> None:
    case = case_of(name, cases)
    expected, last, shown = case.whole
    parts = list(pieces(case.flight, SAMPLES))
    cuts = np.random.default_rng(7).choice(np.arange(1, len(parts)), case.cuts, replace=False)
    monitor = case.monitor()
    for k, piece in enumerate(parts):
        if k in cuts:
            monitor = restored(case, as_bytes(monitor, case.flight.present))
        assert content(monitor.feed(piece)) == expected[k], f"message {k}, cuts at {sorted(cuts)}"
    assert state_bytes(monitor) == last
    assert bits((monitor.derivatives(), monitor.view())) == shown
    if name == "an elevator that loses effect":
        assert "elevator_effectiveness" in repr(expected)


def test_vehicles_that_fly_together_are_restored_into_one_batch(cases: dict[str, Case]) -> None:
    several = [case_of(name, cases) for name in list(CASES)[:2]] + [Case(fly_doublets(60.0))]
    expected = [case.whole for case in several]

    def joined(states: Sequence[MonitorState] | None) -> list[VehicleMonitor]:
        maker = MonitorMaker(lambda: "1", JudgeConfig())
        made = [maker.make("f", "v", AEROSONDE, MESSAGE, c.flight.present, VehicleMemory()) for c in several]
        for monitor, state in zip(made, states or (), strict=states is not None):
            monitor.restore(state)
        return made

    monitors, lists = joined(None), [list(pieces(case.flight, SAMPLES)) for case in several]
    cuts = np.random.default_rng(8).choice(300, 6, replace=False)
    for k in range(max(map(len, lists))):
        if k in cuts:
            kept = [as_bytes(m, c.flight.present) for m, c in zip(monitors, several, strict=True)]
            monitors = joined([decode_checkpoint(data).saved.monitor for data in kept])
        there = [i for i, parts in enumerate(lists) if k < len(parts)]
        reports = feed_together([monitors[i] for i in there], [lists[i][k] for i in there])
        for i, report in zip(there, reports, strict=True):
            assert isinstance(report, Report)
            assert content(report) == expected[i][0][k], f"vehicle {i}, message {k}"
    for i, monitor in enumerate(monitors):
        assert state_bytes(monitor) == expected[i][1]


def go_on(data: bytes, flight: SampleBlock, first: int) -> tuple[str, bytes]:
    """In another process: the rest of the flight, and the state at its end."""
    case = Case(flight)
    monitor = restored(case, data)
    reports = [content(monitor.feed(piece)) for piece in list(pieces(flight, SAMPLES))[first:]]
    return repr(reports), state_bytes(monitor)


def test_another_process_goes_on_to_the_bit(cases: dict[str, Case]) -> None:
    case = case_of("an elevator that loses effect", cases)
    expected, last, _ = case.whole
    monitor, first = case.monitor(), 333
    for piece in list(pieces(case.flight, SAMPLES))[:first]:
        monitor.feed(piece)
    data = as_bytes(monitor, case.flight.present)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(go_on, (data, case.flight, first)) == (repr(expected[first:]), last)


def test_a_checkpoint_is_small_and_says_what_it_is(cases: dict[str, Case]) -> None:
    case = case_of("an elevator that loses effect", cases)
    monitor = case.monitor()
    for piece in pieces(case.flight, SAMPLES):
        monitor.feed(piece)
    data = as_bytes(monitor, case.flight.present)
    assert len(data) < 800_000
    assert data.startswith(b"wingwatch-checkpoint 3 ")
    assert data.partition(b"\n")[0].endswith(b" f/v")


def test_damaged_and_foreign_checkpoints_are_refused_with_a_clause() -> None:
    case = Case(fly_doublets(12.0))
    monitor = case.monitor()
    monitor.feed(case.flight)
    data = as_bytes(monitor, case.flight.present)
    line, _, state = data.partition(b"\n")
    magic, _, layout, checksum, name = line.split(b" ")
    foreign = {
        b"": "no checkpoint",
        b"\x80\x04pickle": "no checkpoint",
        data[: len(data) // 2]: "checksum",
        data + b"x": "checksum",
        data[:-1] + bytes([data[-1] ^ 1]): "checksum",
        b" ".join((magic, b"2", layout, checksum, name)) + b"\n" + state: "in another form",
        b" ".join((magic, b"3", b"0" * 16, checksum, name)) + b"\n" + state: "in another form",
    }
    for bad, words in foreign.items():
        with pytest.raises(CheckpointError, match=words):
            decode_checkpoint(bad)


def test_another_aircraft_channels_or_configuration_is_another_setting() -> None:
    flight = fly_doublets(2.0)
    own = Case(flight).monitor()
    known = settings_of(own, flight.present)
    assert settings_of(Case(flight).monitor(), flight.present) == known
    assert settings_of(own, flight.present[:-1]) != known
    assert settings_of(Case(flight, DELAYED).monitor(), flight.present) != known
    assert settings_of(Case(flight, engine="filterpy").monitor(), flight.present) != known


def test_no_state_is_forgotten() -> None:
    """What objects remember by hand-written states: a new attribute has to be entered there, or here as no state."""

    def attributes(one: Any) -> set[str]:
        return {name.lstrip("_") for name in vars(one)}

    def names(kind: Any) -> set[str]:
        return {f.name for f in fields(kind)}

    assert names(SequenceState) == attributes(SequenceTracker()) - {"refusal"}  # answer of the last call
    assert attributes(Aligner({})) == {"delays", "held", "waiting", "dropped"}
    assert attributes(Cleaner()) == {"config", "required", "state", "report"}
    assert names(AlertBook) - {"fleet", "vehicle", "new_id"} == names(BookState)
    assert attributes(CellBook({})) == {"coordinates", "state"}
    assert names(CellBookState) == {"accounts", "visits", "changed"}
    relations = VehicleRelations(RedundancyWatch(load_aircraft("aerosonde"), (), {}), "f", "v", str)
    assert attributes(relations) == {"watch", "book", "state"} | {"waiting", "raised"}  # of the last call
    assert names(ChainState) - {"lane"} == names(SavedChain) - {"estimators"}
    assert names(ModeSolution) - {"pair", "made"} - {"_made"} == names(SavedMode)
    assert names(SavedSolution) == {"time_s", "modes"}
    settings = {
        "aircraft",
        "fleet",
        "vehicle",
        "configuration",
        "chain",
        "compared",
        "stated",
        "judge",
        "regime",
        "surfaces",
    }
    state = {
        "cleaner",
        "aligner",
        "chain_state",
        "cells",
        "judge_state",
        "book",
        "memory",
        "relations",
        "alerts",
    }
    worked_out = {"worst", "could_see"}  # of the last solution, when somebody asks
    of_this_run = {"manoeuvres"}  # decision 99
    assert attributes(Case(fly_doublets(1.0)).monitor()) == settings | state | worked_out | of_this_run
