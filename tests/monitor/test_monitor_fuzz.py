"""What a fuzzer found, each by itself, and a short run of it."""

import random
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any

import fuzz
import numpy as np
import pytest
from fleet_hall import AEROSONDE, Hall, fly_doublets, second
from fuzz_messages import Fuzzer

from wingwatch.monitor import FleetMonitor, VehicleMonitor, VehicleState
from wingwatch.monitor.estimation.chain import condition_of
from wingwatch.monitor.fleet.member.waiting import PIECE_ROWS, PIECE_S, pieces
from wingwatch.telemetry import JSON, SampleBlock, SensorsMessage

REQUIRED = (
    "airspeed_true_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_x_m_s2",
    "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad", "altitude_m",
)  # fmt: skip
SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")
VANES = ("angle_of_attack_rad", "sideslip_rad")


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(20.0)


def stretched(flight: SampleBlock, step_s: float, rows: int = 1000) -> SampleBlock:
    """Samples of a flight with another step between them."""
    values = np.resize(flight.values, (rows, flight.values.shape[1])).copy()
    values[:, 0] = 1000.0 + step_s * np.arange(rows)
    return SampleBlock(values)


def later(flight: SampleBlock, by_s: float) -> SampleBlock:
    values = flight.values.copy()
    values[:, 0] += by_s
    return SampleBlock(values)


def test_a_short_run_of_the_fuzzer_finds_nothing() -> None:
    outcome = fuzz.fuzz(1500, 4, 4.0, dear=0.0)
    assert outcome.problems == ()
    assert outcome.answers["2xx"] > 30
    assert outcome.intake["received"] == outcome.course.handed_over
    assert outcome.course.kinds["sound"] == 3 * (4 * 5 + 1)


def test_a_run_that_is_ended_before_its_time_counts_what_it_sent() -> None:
    outcome = fuzz.fuzz(1500, 4, 4.0, dear=0.0, until_s=float("-inf"))
    assert outcome.problems == ()
    assert sum(outcome.course.kinds.values()) == outcome.intake["received"] == 0


def test_the_fuzzer_is_the_same_for_a_seed() -> None:
    flown = fuzz.flights(1.0, 0)
    twice = [Fuzzer(random.Random(5), fuzz.victims(flown)) for _ in range(2)]
    assert [twice[0].message() for _ in range(300)] == [twice[1].message() for _ in range(300)]


# -- large messages -------------------------------------------------------------------------------


@pytest.mark.parametrize("step_s", [0.0, 0.001, 0.02, 0.1, 0.49, -0.3, np.nan])
def test_a_large_message_is_cut_into_pieces_of_bounded_cost(flight: SampleBlock, step_s: float) -> None:
    whole = stretched(flight, step_s)
    parts = list(pieces(SensorsMessage(3, whole, flight.present)))
    np.testing.assert_array_equal(np.concatenate([p.block.values for p in parts]), whole.values)
    for part in parts:
        time_s = part.block.time_s
        assert len(time_s) <= PIECE_ROWS or np.abs(time_s - time_s[0]).max() < PIECE_S


def test_a_usual_message_stays_whole(flight: SampleBlock) -> None:
    message = SensorsMessage(0, second(flight, 0), flight.present)
    assert list(pieces(message)) == [message]


def test_one_large_message_does_not_keep_others_waiting(flight: SampleBlock) -> None:
    """A thousand slow samples took a second and more in one call, with the lock held."""
    hall = Hall()
    hall.announce()
    hall.fly(flight, 0, 2)
    slow = stretched(flight, 0.1, 250)
    hall.fleet._way._clock = time.monotonic
    longest_s, calls, begin_s = 0.0, 0, time.thread_time()
    hall.sample(slow, next(hall.sequence))
    while True:
        took_s = time.thread_time() - begin_s
        longest_s, calls = max(longest_s, took_s), calls + 1
        if not hall.fleet.behind:
            break
        begin_s = time.thread_time()
        hall.fleet.receive_all(())
    assert hall.view().counts["accepted"] == 100 + 250
    assert calls > 3
    assert longest_s < 0.25  # of more than a second in all on a machine that is busy with other tests


def test_pieces_give_the_numbers_of_the_whole(flight: SampleBlock) -> None:
    at_once = VehicleMonitor(AEROSONDE, "default", "uav", flight.present, {}, new_id=lambda: "1")
    in_parts = VehicleMonitor(AEROSONDE, "default", "uav", flight.present, {}, new_id=lambda: "1")
    at_once.feed(flight)
    for part in pieces(SensorsMessage(0, flight, flight.present)):
        in_parts.feed(part.block)
    assert in_parts.derivatives() == at_once.derivatives()


def test_a_vehicle_that_sends_more_than_may_wait_loses_nothing(
    flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its monitor is then made at once, and its samples are taken in before the next message is."""
    monkeypatch.setattr("wingwatch.monitor.fleet.sample_way._MOST_HELD", 60)
    monkeypatch.setattr("wingwatch.monitor.fleet.sample_way._MOST_WAITING", 30)
    hall = Hall()
    hall.announce()
    hall.fleet.prepare_with(Never())
    slow = stretched(flight, 0.4, 250)
    hall.sample(slow, 0)
    assert hall.view().counts == {}  # it waits
    for k in range(1, 5):
        hall.sample(later(slow, 100.0 * k), k)
    while hall.fleet.behind:
        hall.fleet.receive_all(())
    assert hall.view().counts["accepted"] == 5 * 250
    assert hall.fleet.intake == {"received": 6, "aircraft": 1, "sensors": 5}


# -- loadings -------------------------------------------------------------------------------------


class Never(Executor):
    """Takes work over and does none."""

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        return Future()


def test_another_loading_is_prepared_elsewhere_while_samples_wait(flight: SampleBlock) -> None:
    """To linearise the aircraft anew took half a second with the lock held, at every announcement of a mass."""
    hall, flown = Hall(), threading.Event()
    with ThreadPoolExecutor(1) as executor:
        executor.submit(flown.wait, 60.0)  # the executor has something else to do meanwhile
        hall.fleet.prepare_with(executor)
        here = threading.get_ident()
        hall.announce(mass_kg=12.0)
        hall.fly(flight, 0, 3)
        assert "accepted" not in hall.view().counts
        flown.set()
        until_s = time.monotonic() + 60.0
        while hall.fleet.held and time.monotonic() < until_s:
            hall.fleet.tick()
            time.sleep(0.01)
    assert threading.get_ident() == here
    assert hall.view().counts["accepted"] == 150
    assert hall.view().mass_kg == 12.0
    hall.fly(flight, 3, 8)
    at_once = Hall()
    at_once.announce(mass_kg=12.0)
    at_once.fly(flight, 0, 8)
    assert hall.derivatives() == at_once.derivatives()


def test_what_cannot_be_prepared_is_a_fault_of_that_vehicle(
    flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object) -> None:
        raise ZeroDivisionError("no such flight")

    hall = Hall()
    monkeypatch.setattr("wingwatch.monitor.fleet.monitors.apriori_envelope", failing)
    with ThreadPoolExecutor(1) as executor:
        hall.fleet.prepare_with(executor)
        hall.announce()
        hall.fly(flight, 0, 1)
    hall.fly(flight, 1, 2)
    assert hall.view().counts["faults"] == 1
    assert "no such flight" in hall.view().reason


# -- values ---------------------------------------------------------------------------------------


def test_deep_nesting_is_a_wrong_type_and_no_fault() -> None:
    hall = Hall()
    hall.announce()
    for column in (b'{"columns":%s}', b'{"columns":{"time_s":[%s]}}', b'{"columns":{},"sequence":%s}'):
        hall.raw(column % (b"[" * 1000 + b"]" * 1000), JSON)
    counts = hall.view().counts
    assert "faults" not in counts
    assert counts["message_wrong_type"] == 3


def test_steps_that_no_clock_resolves_are_duplicates_and_touch_no_other_vehicle(flight: SampleBlock) -> None:
    """A step of 1e-320 s was divided by, in the kernel that all vehicles of the type share."""
    hall = Hall()
    hall.announce()
    hall.announce("other")
    tiny = stretched(flight, 0.0, 6)
    tiny.values[:, 0] = 1e-320 * np.arange(1, 7)
    hall.sample(tiny, 0)
    hall.sample(second(flight, 0), 0, vehicle="other")
    assert hall.view().counts == {"accepted": 1, "duplicate": 5}
    assert hall.view("other").counts == {"accepted": 50}


def test_a_kernel_that_fails_is_a_fault_of_its_vehicles_and_ends_no_call(
    flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    hall = Hall()
    hall.announce()
    hall.announce("other")
    hall.fly(flight, 0, 2)
    monkeypatch.setattr("wingwatch.monitor.estimation.supervision.Supervisor.take", lambda *_: 1 / 0)
    hall.fly(flight, 2, 3)
    assert hall.view().counts["faults"] == 1
    assert "ZeroDivisionError" in hall.view().reason


@pytest.mark.parametrize(
    "found",
    [(np.nan,) * 4, (-50.4, 1000.0, 1.1, 0.06), (25.0, 1e6, np.nan, 0.0), (25.0, 1000.0, 0.0, 0.0)],
)
def test_what_is_no_flight_condition_is_none(found: tuple[float, float, float, float]) -> None:
    assert condition_of(found, "clean") is None
    assert condition_of((25.0, 1000.0, np.nan, np.nan), "clean") is not None


def test_accelerometers_at_their_limit_between_slow_samples_are_no_fault(flight: SampleBlock) -> None:
    """They carry the airspeed to below zero; the block that rests on it is compared with nothing, and that is said."""
    monitor = VehicleMonitor(AEROSONDE, "default", "uav", flight.present, {}, new_id=lambda: "1")
    monitor.feed(SampleBlock(flight.values[:200]))
    odd = stretched(flight, 0.45, 40)
    odd.values[:, 6] = -319.0
    monitor.feed(odd)
    assert monitor.state is VehicleState.NOT_OBSERVABLE
    assert "contradict each other" in monitor.reason


def test_a_filter_that_started_anew_is_no_fault() -> None:
    """Slow samples of rates that leap make it diverge; it then has no condition when the block closes."""
    rng, rows = np.random.default_rng(0), 300
    names = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
    columns: dict[str, Any] = {name: np.zeros(rows) for name in (*REQUIRED, *SURFACES, *VANES)}
    columns |= {name: (rng.random(rows) < 0.33).astype(float) for name in names}
    columns |= {"time_s": 100.0 + 0.49 * np.arange(rows), "airspeed_true_m_s": np.full(rows, 25.0)}
    columns |= {"altitude_m": np.full(rows, 5.0), "specific_force_z_m_s2": np.full(rows, -9.0)}
    columns["air_density_kg_m3"] = np.full(rows, 1.2244)
    monitor = VehicleMonitor(AEROSONDE, "default", "uav", tuple(columns), {}, new_id=lambda: "1")
    report = monitor.feed(SampleBlock.from_columns(columns))
    assert report.solutions
    assert monitor.view().counts == {"accepted": rows}


# -- counts ---------------------------------------------------------------------------------------


def test_every_message_is_counted_once_by_what_became_of_it(flight: SampleBlock) -> None:
    hall = Hall()
    hall.sample(second(flight, 0), 0)
    hall.announce()
    hall.fly(flight, 0, 2)
    hall.sample(second(flight, 1), 1)
    hall.raw(b"{", JSON)
    hall.raw(b'{"aircraft": 3}', JSON, "aircraft")
    hall.announce("uav2", aircraft="none")
    hall.sample(second(flight, 1), 1, vehicle="uav2")
    assert hall.fleet.intake == {
        "received": 9, "unannounced": 1, "aircraft": 2, "messages_repeated": 2, "sensors": 1,
        "message_malformed": 1, "message_wrong_type": 1, "unknown_aircraft": 1,
    }  # fmt: skip


def test_a_fleet_without_place_counts_that_too(flight: SampleBlock) -> None:
    fleet = FleetMonitor(lambda name: AEROSONDE, lambda: 0.0, lambda: "1")
    fleet._vehicles._most = 0
    fleet.receive("default", "uav", "sensors", b"", JSON)
    assert fleet.intake == {"received": 1, "too_many_vehicles": 1}
