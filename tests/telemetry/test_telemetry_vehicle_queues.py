"""Queues of vehicles: taken in turn, bounded, and a flood of one vehicle costs itself."""

from collections import Counter

from hypothesis import given, settings
from hypothesis import strategies as st

from wingwatch.telemetry import InboundMessage
from wingwatch.telemetry.vehicle_queues import VehicleQueues


def message(vehicle: str, payload: bytes = b"", received_s: float = 0.0) -> InboundMessage:
    return InboundMessage("default", vehicle, "sensors", payload, "", received_s)


def names(taken: list[InboundMessage]) -> str:
    return "".join(one.vehicle for one in taken)


def test_one_message_of_each_in_a_round_whatever_one_vehicle_sends() -> None:
    queues = VehicleQueues(100, 1000)
    for k in range(50):
        assert queues.add(message("h", str(k).encode()))
    assert queues.add(message("a"))
    assert queues.add(message("b"))
    taken = queues.take(5)
    assert names(taken) == "habhh"
    assert [one.payload for one in taken if one.vehicle == "h"] == [b"0", b"1", b"2"]
    assert len(queues) == 47


def test_what_waits_of_a_vehicle_that_has_enough_stays_and_comes_later_in_order() -> None:
    queues = VehicleQueues(100, 1000)
    for name in "hhab":
        queues.add(message(name))
    assert names(queues.take(10, {("default", "h")})) == "ab"
    assert names(queues.take(10)) == "hh"
    assert queues.take(10) == []


def test_a_full_house_takes_from_the_vehicle_that_has_most() -> None:
    queues = VehicleQueues(10, 1000)
    assert [queues.add(message("h")) for _ in range(12)] == [True] * 10 + [False] * 2
    assert all([queues.add(message("a")), queues.add(message("b")), queues.add(message("a"))])
    assert (queues.refused, queues.gave_way) == (2, 3)
    assert Counter(names(queues.take(20))) == {"h": 7, "a": 2, "b": 1}


def test_bytes_are_bounded_alike() -> None:
    queues = VehicleQueues(100, 100)
    assert queues.add(message("h", b"x" * 60))
    assert queues.add(message("h", b"x" * 30))
    assert not queues.add(message("h", b"x" * 30))
    assert queues.add(message("a", b"x" * 30))
    assert names(queues.take(10)) == "ha"
    assert not queues.add(message("a", b"x" * 101))


def test_ages_are_those_of_the_oldest() -> None:
    queues = VehicleQueues(100, 100)
    queues.add(message("a", received_s=1.0))
    queues.add(message("a", received_s=3.0))
    queues.add(message("b", received_s=2.0))
    assert queues.ages(5.0) == {("default", "a"): 4.0, ("default", "b"): 3.0}


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from("abcd"), st.integers(0, 9), st.booleans()), max_size=60))
def test_nothing_is_lost_uncounted_and_each_vehicles_messages_stay_in_order(
    done: list[tuple[str, int, bool]],
) -> None:
    queues = VehicleQueues(8, 30)
    taken: list[InboundMessage] = []
    for number, (name, size, take) in enumerate(done):
        queues.add(message(name, b"x" * size, float(number)))
        taken += queues.take(2) if take else []
        assert len(queues) <= 8
    taken += queues.take(100)
    assert len(taken) + queues.refused + queues.gave_way == len(done)
    for name in "abcd":
        stamps = [one.received_s for one in taken if one.vehicle == name]
        assert stamps == sorted(stamps)
