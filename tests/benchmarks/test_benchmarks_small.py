"""The benchmarks in small: the figures that are not a matter of the machine, and that the commands hold together."""

import importlib.util
import re
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from refusals import refusal
from scipy.stats import binom

from wingwatch.aircraft import STRUCTURES, FlightCondition, load_aircraft
from wingwatch.estimators.ekf.state import arrays_of
from wingwatch.monitor import Checkpoint, FleetMonitor, SavedVehicle, decode_checkpoint, encode_checkpoint
from wingwatch.simulation import FleetSimulation, demo_fleet
from wingwatch.telemetry import (
    CHANNELS,
    PROTOBUF,
    AircraftMessage,
    InboundMessage,
    SampleBlock,
    SequenceTracker,
    decode_sensors,
    encode_sensors,
)

FOLDER = Path(__file__).parents[2] / "benchmarks"


def load(name: str) -> ModuleType:
    known = f"wingwatch_benchmark_{name}"
    if known not in sys.modules:
        spec = importlib.util.spec_from_file_location(known, FOLDER / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[known] = module  # dataclasses look their module up
        spec.loader.exec_module(module)
    return sys.modules[known]


@pytest.mark.parametrize("number", [0, 1], ids=["short_period", "dutch_roll"])
@pytest.mark.parametrize("estimator", ["fourier", "ekf"])
def test_clean_data_give_the_truth_within_one_percent(number: int, estimator: str) -> None:
    plants = load("reference_plant")
    plant = plants.PLANTS[number]
    error = plants.clean_errors(plant)[estimator]
    weak = [s in ("z_eta", "y_zeta") for s in plant.structure.derivatives]
    assert np.abs(error[~np.array(weak)]).max() < 1.0
    assert np.isfinite(error).all()


@pytest.mark.parametrize("number", [0, 1], ids=["short_period", "dutch_roll"])
def test_the_bounds_own_response_is_the_plants(number: int) -> None:
    plants = load("reference_plant")
    plant = plants.PLANTS[number]
    ours = plants._outputs(plant, np.concatenate([plant.truth, np.zeros(4)]))
    clean = plants.clean_states(plant)
    assert np.abs(ours - clean).max() < 1e-9 * np.abs(clean).max()


def test_the_bound_grows_with_the_noise_and_with_a_shorter_pulse() -> None:
    plants = load("reference_plant")
    plant = plants.PLANTS[0]
    std = plants.noise_std(plant)
    bound = plants.cramer_rao(plant, std)
    assert plants.cramer_rao(plant, 3.0 * std) == pytest.approx(3.0 * bound, rel=1e-6)
    brief = plants.Plant(plant.structure, plant.truth, plant.turn, 0.04)
    assert (plants.cramer_rao(brief, std) > bound).all()


@pytest.mark.parametrize("number", [0, 1], ids=["short_period", "dutch_roll"])
@pytest.mark.parametrize("estimator", ["fourier", "ekf"])
def test_stated_intervals_hold_the_truth_in_noise(number: int, estimator: str) -> None:
    plants = load("reference_plant")
    seeds = 60
    scores = plants.noisy_scores(plants.PLANTS[number], seeds)
    # A true share of 95 % falls below this in one of a million tests.
    assert (scores[estimator].covered * seeds >= binom.ppf(1e-6, seeds, 0.95)).all()


def test_the_same_seeds_give_the_same_score() -> None:
    plants = load("reference_plant")
    first, again = (plants.noisy_scores(plants.PLANTS[0], 3)["fourier"].rms for _ in range(2))
    assert np.array_equal(first, again)


def test_cost_counts_every_part_of_every_structure() -> None:
    cost = load("cost")
    aircraft = load_aircraft("aerosonde")
    spent, state_bytes = cost.estimator_cost(aircraft, 2, 2.5)
    assert set(spent) == set(cost.PARTS)
    assert sum(spent.values()) > 0.0
    assert [m.structure.name for m in cost.modes(aircraft, 1)] == list(STRUCTURES)
    modes = cost.modes(aircraft, 1)
    assert state_bytes == {part: sum(m.state_bytes[part] for m in modes) for part in cost.HELD}
    states = [s for m in modes for s in (m.signal_state, m.fourier_state)]
    held = sum(getattr(s, f.name).nbytes for s in states for f in fields(s))
    held += sum(array.nbytes for m in modes for _, array in arrays_of(m.ekf_state))
    assert sum(state_bytes.values()) == held


def test_filterpys_bare_loop_and_engine_are_both_timed() -> None:
    # Not which is dearer: the first call on a fresh machine has compilation in it, which the command runs beforehand.
    peer = load("cost").filterpy_cost(load_aircraft("aerosonde"), 1.0)
    assert set(peer) == {"bare", "with adaptation"}
    assert min(peer.values()) > 0.0


def test_a_healthy_flight_and_an_iced_one_through_the_monitor() -> None:
    alerts = load("alerts")
    flown = alerts.Flown(load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0))
    healthy, *_ = alerts.cases("none")
    iced = next(c for c in alerts.cases("none") if c.name == "icing 0.3")
    (quiet,) = alerts.fly(healthy, flown, 1, 40.0, 0)
    assert (quiet.false, quiet.hit) == (0, None)
    (flight,) = alerts.fly(iced, flown, 1, 150.0, 0)
    assert flight.false == 0
    assert flight.hit is not None
    assert flight.hit.cause == "icing"


def test_flights_repeat_by_their_seed() -> None:
    alerts = load("alerts")
    flown = alerts.Flown(load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0))
    iced = next(c for c in alerts.cases("none") if c.name == "icing 0.3")
    first, again = (alerts.fly(iced, flown, 1, 120.0, 7) for _ in range(2))
    assert first == again


def test_latency_pairs_arrivals_with_what_was_done_with_them() -> None:
    latency = load("latency")
    delays_s: list[float] = []
    receive_all = latency.timed_receive_all(delays_s)
    monitor = FleetMonitor(load_aircraft, lambda: 0.0, lambda: "id")
    aircraft, sensors = (
        InboundMessage("f", "v", stream, b"{}", "application/json", time.monotonic() - 1.0)
        for stream in ("aircraft", "sensors")
    )
    receive_all(monitor, [aircraft])
    assert delays_s == []
    receive_all(monitor, [aircraft, sensors])
    assert len(delays_s) == 1
    assert 1.0 <= delays_s[0] < 10.0


def test_a_stage_that_takes_another_in_is_timed_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    live = load("live_fleet")
    clock_s = iter([0.0, 1.0, 3.0, 10.0])
    monkeypatch.setattr(live.time, "thread_time", lambda: next(clock_s))
    monkeypatch.setattr(live.threading.current_thread(), "name", live.INGEST)
    watch = live.Stopwatch()
    inner = watch.timed("filter", lambda: None)
    watch.timed("all else", inner)()
    assert watch.spent_s["filter"] == 2.0
    assert watch.spent_s["all else"] == 8.0


@pytest.mark.slow
def test_two_vehicles_are_watched_live_and_nothing_is_lost() -> None:
    arguments = ["--vehicles", "2", "--seconds", "7", "--over", "2", "--stages"]
    said = subprocess.run(
        [sys.executable, FOLDER / "live_fleet.py", *arguments], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    row = next(line.split() for line in said if line.split()[:1] == ["2"])
    assert row[:3] == [
        "2",
        "65",
        "0",
    ]  # vehicles, messages sent, messages lost: the second begins a second later
    assert float(row[4]) < 5.0  # seconds behind
    taken_us = {line[:21].strip(): line[21:].split() for line in said}
    stages = ("decoding", "cleaning", "Fourier estimator", "filter")
    for place in ("wingwatch-pump", "REST, Zenoh and else", *stages):
        assert float(taken_us[place][0]) > 0.0
    assert sum(float(taken_us[stage][0]) for stage in stages) < float(taken_us["wingwatch-pump"][0])


@pytest.mark.slow
def test_a_service_that_is_killed_loses_no_alert_and_goes_on_to_the_bit() -> None:
    arguments = ["--kills", "2"]
    said = subprocess.run(
        [sys.executable, FOLDER / "kill.py", *arguments], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    found = dict(line.split(": ", 1) for line in said)
    assert found["kills"] == "2, with an alert in force: 2, with two: 2"
    assert re.fullmatch(r"[2-9]\d*, lost: 0", found["alerts announced"])
    assert re.fullmatch(r"[1-9]\d*, lost: 0", found["actions answered"])
    assert found["vehicles with an alert that were not degraded after a start"] == "0"
    assert found["checkpoints refused"] == "0"
    for what in ("derivatives", "whole states"):
        assert re.fullmatch(r"yes \((\d+) of \1 states\)", found[f"{what} equal"]), said
    assert re.fullmatch(
        r"[1-9]\d*, not comparable for more than 64 gaps: 0", found["states with an alert in force"]
    )


@pytest.mark.slow
def test_an_outage_of_the_database_loses_nothing_and_heals() -> None:
    """``check``: the command fails where something is lost or does not heal."""
    arguments = ["--cases", "sqlite-locked", "--seconds", "5"]
    said = subprocess.run(
        [sys.executable, FOLDER / "outages.py", *arguments], capture_output=True, text=True, check=True
    ).stdout
    assert "is locked by another program" in said
    (row,) = (line.split() for line in said.splitlines() if line.startswith("sqlite-locked"))
    raised, acted, wrong = map(int, row[-3:])
    assert raised > 0
    assert acted > 0
    assert wrong == 0


@pytest.mark.slow
def test_half_a_minute_of_disturbances_costs_no_thread_and_shows_no_wrong_state() -> None:
    """``check``: the command fails where they do."""
    arguments = ["--minutes", "0.5"]
    said = subprocess.run(
        [sys.executable, FOLDER / "soak.py", *arguments], capture_output=True, text=True, check=True
    ).stdout
    assert "lost: none" in said
    assert "vehicles in a wrong state: 0" in said


@pytest.mark.slow
def test_a_service_goes_on_with_every_vehicle_at_once() -> None:
    said = subprocess.run(
        [sys.executable, FOLDER / "resume.py", "--vehicles", "2", "--starts", "1"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    row = next(line.split() for line in said.splitlines() if "last vehicle resumed" in line)
    assert 0.0 < float(row[-1]) < 60.0


def written(state: SavedVehicle) -> SavedVehicle:
    """As it comes back from its file."""
    return decode_checkpoint(encode_checkpoint(Checkpoint(0.0, state))).saved


def test_the_reference_of_a_killed_service_is_not_given_what_the_service_did_not_get() -> None:
    """Nor is it called different where the service names too few gaps to know, or where somebody has asked."""
    run = load("uninterrupted_run")
    flight = FleetSimulation(demo_fleet()[:1], 50.0)
    messages = [
        decode_sensors(encode_sensors(k, SampleBlock(flight.step(10)[0]), stream=1), PROTOBUF)
        for k in range(200)
    ]
    given = messages[0].given
    taken = [m for m in messages if m.sequence not in range(50, 60)]
    service, arrivals = run.fresh(given), SequenceTracker()
    for message in taken:
        arrivals.observe(message.sequence, 1)
        service.feed(message.block)
    assert service.air is not None  # as who shows the vehicle does
    state = SavedVehicle(
        fleet="default", vehicle="v", settings="", silent_s=0.0, message=AircraftMessage(aircraft="aerosonde"),
        watched_as=AircraftMessage(aircraft="aerosonde"), given=given, late=False, recalled=True, counts={},
        arrivals=arrivals.state, history_s=0.0, waiting=np.empty((0, len(CHANNELS))), monitor=service.saved(),
    )  # fmt: skip
    found = run.Uninterrupted(given, sent=list(messages)).compare(written(state))
    assert (found.messages, found.known, found.differs) == (190, True, ())
    unnamed = replace(state, arrivals=replace(state.arrivals, gaps=()))
    found = run.Uninterrupted(given, sent=list(messages)).compare(written(unnamed))
    assert (found.known, found.differs) == (False, ())
    other = run.Uninterrupted(given, sent=messages[1:], first=1)
    assert "chain" in other.compare(written(state)).differs


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("reference_plant", ["--seeds", "1"], "at least 2"),
        ("live_fleet", ["--seconds", "nan"], "give 5 to 3600"),
        ("live_fleet", ["--vehicles", "0"], "give 1 to 5000"),
        ("live_fleet", ["--samples-per-message", "101"], "give 1 to 100"),
        ("live_fleet", ["--over", "-1"], "give 0 to 5 less"),
        ("fleet_views", ["--vehicles", "0"], "give 1 to 5000"),
        ("fleet_views", ["--seconds", "nan"], "give 20 to 3600"),
        ("cost", ["--vehicles", "1"], "at least 2"),
        ("alerts", ["--flights", "0"], "at least 1"),
        ("alerts", ["--seconds", "50"], "above 100"),
        ("latency", ["--seconds", "nan"], "at least 1"),
        ("kill", ["--kills", "0"], "give 1 to 10000"),
        ("kill", ["--speed", "nan"], "give 1 to 20"),
        ("outages", ["--seconds", "nan"], "give 2 to 600"),
        ("resume", ["--vehicles", "0"], "give 1 to 5000"),
        ("resume", ["--starts", "0"], "give 1 to 1000"),
        ("soak", ["--minutes", "nan"], "give 0.5 to 1440"),
    ],
)
def test_bad_arguments_get_one_sentence(
    name: str, arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    assert words in refusal(load(name), arguments, monkeypatch, capsys)


def test_relations_alone_are_watched_in_drawn_flights(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    relations = load("relations")
    monkeypatch.setattr(sys, "argv", ["relations.py", "--flights", "3", "--seconds", "70", "--all"])
    relations.main()
    said = capsys.readouterr().out
    assert len(re.findall(r"healthy .* never ", said)) == 3
    assert "false   0 in" in said
