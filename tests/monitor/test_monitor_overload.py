"""More to compute than the machine can: whole vehicles are left out in a stated order, said so, and taken back."""

import pytest
from fleet_hall import FakeStore, Hall, fly_doublets, second

from wingwatch.monitor import VehicleState
from wingwatch.monitor.fleet.left_out import LATE_S, Overload
from wingwatch.monitor.fleet.member.pace import Pace
from wingwatch.simulation import ElevatorEffectiveness
from wingwatch.telemetry import SampleBlock

Key = tuple[str, str]


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(30.0)


@pytest.fixture(scope="module")
def damaged() -> SampleBlock:
    return fly_doublets(130.0, ElevatorEffectiveness(0.5, 60.0))


def key(name: str) -> Key:
    return "default", name


class Machine:
    """Vehicles that each send a second of samples a second, on a machine that takes in those of so many."""

    def __init__(self, vehicles: int, capacity: float) -> None:
        self.lags_s = {key(f"v{k:03}"): 0.0 for k in range(vehicles)}
        self.capacity, self.now_s = capacity, 0.0
        self.overload = Overload()

    def run(self, seconds: int) -> None:
        for _ in range(seconds):
            self.now_s += 1.0
            out = set(self.overload.left_out)
            watched = [one for one in self.lags_s if one not in out]
            behind_s = 1.0 - self.capacity / max(len(watched), 1)
            lags_s = {one: max(0.0, self.lags_s[one] + behind_s) for one in watched}
            self.lags_s |= lags_s | dict.fromkeys(out, 0.0)
            self.overload.look(self.now_s, lags_s, lambda watched=watched: watched)  # type: ignore[misc]


def test_a_machine_that_is_fast_enough_leaves_nobody_out() -> None:
    machine = Machine(250, 250.0)
    machine.run(1000)
    assert machine.overload.left_out == []


@pytest.mark.parametrize(("vehicles", "longest_s"), [(260, 3.0), (300, 4.0), (1000, 15.0)])
def test_vehicles_are_left_out_until_the_others_are_in_time(vehicles: int, longest_s: float) -> None:
    machine, waits_s = Machine(vehicles, 250.0), 0.0
    while not machine.overload.left_out or max(machine.lags_s.values()) > LATE_S:
        machine.run(1)
        waits_s = max(waits_s, *machine.lags_s.values())
    assert waits_s < longest_s
    assert machine.now_s < 300.0
    assert vehicles - 250 <= len(machine.overload.left_out) <= vehicles - 180
    assert machine.overload.left_out[0] == key("v000")


def test_a_machine_at_its_limit_watches_what_it_can() -> None:
    machine = Machine(300, 250.0)
    machine.run(300)
    out, late = 0, 0
    for _ in range(7200):
        machine.run(1)
        out += len(machine.overload.left_out)
        late += max(machine.lags_s.values()) > LATE_S
    assert out < 60 * 7200
    assert late < 0.02 * 7200


@pytest.mark.parametrize("waited_s", [30.0, 300.0, 1000.0])
def test_what_waited_for_the_start_is_caught_up_with(waited_s: float) -> None:
    machine = Machine(3, 9.0)  # a second of messages takes a third of one
    machine.run(3)
    machine.lags_s = dict.fromkeys(machine.lags_s, waited_s)
    machine.run(int(waited_s))
    assert machine.overload.left_out == []
    assert max(machine.lags_s.values()) < LATE_S


def test_what_cannot_be_caught_up_with_is_too_much() -> None:
    machine = Machine(100, 120.0)
    machine.run(3)
    machine.lags_s = dict.fromkeys(machine.lags_s, 300.0)
    machine.run(10)
    assert machine.overload.left_out


def test_they_are_taken_back_last_out_first_in() -> None:
    machine = Machine(300, 250.0)
    machine.run(30)
    out = list(machine.overload.left_out)
    machine.capacity = 400.0
    while len(machine.overload.left_out) == len(out):
        machine.run(1)
    assert machine.now_s < 60.0
    assert machine.overload.left_out == out[: len(machine.overload.left_out)]
    assert len(out) - len(machine.overload.left_out) <= 300 // 20
    machine.run(300)
    assert machine.overload.left_out == []
    machine.run(1000)  # and none goes again
    assert machine.overload.left_out == []


def test_a_machine_that_was_at_its_limit_and_is_no_more_takes_all_back_within_two_hours() -> None:
    machine = Machine(300, 250.0)
    machine.run(7200)
    machine.capacity = 400.0
    machine.run(7200)
    assert machine.overload.left_out == []


def test_what_was_taken_back_too_early_waits_longer_each_time() -> None:
    """A machine at its limit does not leave out and take back the same vehicle every few seconds."""
    machine = Machine(20, 19.5)
    changes = 0
    before: list[Key] = []
    for _ in range(2000):
        machine.run(1)
        changes += machine.overload.left_out != before
        before = list(machine.overload.left_out)
    assert 2 <= changes <= 30


def test_a_pause_of_the_machine_is_no_overload() -> None:
    machine = Machine(10, 100.0)
    machine.run(5)
    machine.lags_s = dict.fromkeys(machine.lags_s, 30.0)  # everything stood still for half a minute
    machine.run(60)
    assert machine.overload.left_out == []


def test_a_recording_that_is_replayed_is_ahead_and_an_aircraft_is_not() -> None:
    replay, aircraft = Pace(), Pace()
    for k in range(100):
        replay.note(0.2 * k, 1000.0 + 0.001 * k)
        aircraft.note(0.2 * k, 1000.0 + 0.2 * k)
    assert (replay.ahead, aircraft.ahead) == (True, False)
    for k in range(100):  # it goes on in its own time
        replay.note(20.0 + 0.2 * k, 1001.0 + 0.2 * k)
    assert not replay.ahead


def test_what_a_link_held_back_is_ahead_for_a_while_only() -> None:
    pace = Pace()
    for k in range(50):
        pace.note(0.2 * k, 0.2 * k)
    for k in range(50, 100):
        pace.note(0.2 * k, 20.0)
    assert pace.ahead
    for k in range(100, 200):
        pace.note(0.2 * k, 0.2 * k)
    assert not pace.ahead


def too_much(hall: Hall, lags_s: dict[Key, float], looks: int = 5) -> None:
    """Messages wait longer with each look."""
    for k in range(looks):
        hall.clock.now_s += 1.0
        hall.fleet.relieve({one: lag_s + k for one, lag_s in lags_s.items()})


def test_who_is_left_out_is_shown_as_unknown_and_its_messages_cost_nothing(flight: SampleBlock) -> None:
    hall = Hall()
    for name in ("a", "b"):
        hall.announce(name)
        for k in range(10):
            hall.clock.now_s += 1.0
            hall.sample(second(flight, k), k, name)
    too_much(hall, {key("a"): 3.0, key("b"): 4.0})
    assert hall.fleet.left_out == 1
    shown = hall.view("b")  # furthest behind
    assert shown.state is VehicleState.UNKNOWN
    assert shown.reason.startswith("degraded service")
    assert hall.view("a").state is not VehicleState.UNKNOWN
    accepted = shown.counts["accepted"]
    for k in range(10, 14):
        hall.sample(second(flight, k), k, "b")
    after = hall.view("b").counts
    assert (after["accepted"], after["message_left_out"]) == (accepted, 4)
    assert hall.fleet.figures().left_out == 1
    assert [e.data["what"] for e in hall.fleet.events(0) if e.kind == "problem"] == ["capacity"]
    for _ in range(30):
        hall.clock.now_s += 1.0
        hall.fleet.relieve({})
    assert hall.fleet.left_out == 0
    hall.sample(second(flight, 20), 20, "b")
    assert hall.view("b").counts["accepted"] == accepted + 50
    assert hall.view("b").counts["messages_lost"] == 10


def test_an_alert_is_the_last_to_go_and_stands_all_the_while(
    damaged: SampleBlock, flight: SampleBlock
) -> None:
    hall = Hall()
    for name, of in (("ill", damaged), ("well", flight), ("new", flight), ("replay", flight)):
        hall.announce(name)
        for k in range({"ill": 129, "well": 25, "new": 2, "replay": 20}[name]):
            hall.clock.now_s += 0.0 if name == "replay" else 1.0
            hall.sample(second(of, k), k, name)
    assert hall.view("ill").state is VehicleState.DEGRADED
    gone: list[str] = []
    everyone = {key(name): 10.0 for name in ("ill", "well", "new", "replay")}
    for _ in range(24):
        too_much(hall, everyone, 1)
        everyone = {one: lag_s + 0.05 for one, lag_s in everyone.items()}
        gone += [
            v.vehicle
            for v in hall.fleet.vehicles()
            if "degraded service" in v.reason and v.vehicle not in gone
        ]
    assert gone == ["replay", "new", "well", "ill"]
    view = hall.view("ill")
    assert view.state is VehicleState.DEGRADED
    assert "Meanwhile degraded service" in view.reason
    assert view.active_alerts


def test_a_replay_that_is_behind_alone_is_no_overload(flight: SampleBlock) -> None:
    hall = Hall()
    hall.announce()
    for k in range(20):
        hall.sample(second(flight, k), k)
    too_much(hall, {key("uav"): 100.0}, 20)
    assert hall.fleet.left_out == 0


def test_a_vehicle_of_which_much_waits_is_said_to_be_full(
    flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    hall = Hall()
    hall.announce()
    assert not hall.fleet.full
    monkeypatch.setattr("wingwatch.monitor.fleet.sample_way._AT_ONCE_S", -1.0)
    for k in range(5):
        hall.sample(SampleBlock(flight.values[200 * k : 200 * (k + 1)]), k)
    assert hall.fleet.full == {key("uav")}
    while hall.fleet.behind:
        hall.fleet.receive_all([])
    assert not hall.fleet.full
    assert hall.view().counts["accepted"] == 1000


def test_samples_that_wait_for_what_is_kept_of_their_vehicle_fill_it_alike(flight: SampleBlock) -> None:
    hall = Hall(store=FakeStore(unread=True))
    for name in ("uav", "another"):
        hall.announce(name)
        hall.sample(second(flight, 0), 0, name)
    for k in range(1, 10):
        assert not hall.fleet.full
        hall.sample(second(flight, k), k)
    assert hall.fleet.full == {key("uav")}
    hall.store.unread = False
    hall.fleet.tick()
    assert not hall.fleet.full
    assert hall.view().counts["accepted"] == 500
