"""Lost, late, repeated, or started again: known by numbers, streams and stamps."""

from hypothesis import given
from hypothesis import strategies as st

from wingwatch.telemetry import SequenceTracker
from wingwatch.telemetry.sequence import AGREEING, AGREEING_LATE

PERIOD_S = 0.2


def counted(tracker: SequenceTracker) -> dict[str, int]:
    """Counts above zero, under their short names."""
    return {name.removeprefix("messages_"): n for name, n in tracker.counts.items() if n}


class Publisher:
    """Sends numbers and stamps to a tracker; message k of a start has the stamps from k periods on."""

    def __init__(self, tracker: SequenceTracker, stream: int | None = None, begin_s: float = 0.0) -> None:
        self.tracker, self.stream, self.begin_s = tracker, stream, begin_s

    def send(self, *numbers: int) -> list[bool]:
        return [
            self.tracker.observe(k, self.stream, at_s := self.begin_s + PERIOD_S * k, at_s + 0.18)
            for k in numbers
        ]


def test_gaps_are_counted_and_what_fills_them_late_is_dropped() -> None:
    tracker = SequenceTracker()
    sender = Publisher(tracker)
    assert sender.send(5, 6, 9, 10) == [True] * 4
    assert sender.send(8, 11, 7, 12) == [False, True, False, True]
    assert counted(tracker) == {"lost": 2, "late": 2}


def test_a_lump_that_a_link_held_back_is_late_however_long() -> None:
    """Eight seconds of messages that come at once, after the newer ones: no start of anything."""
    tracker = SequenceTracker()
    sender = Publisher(tracker)
    assert all(sender.send(*range(10), *range(50, 60)))
    assert not any(sender.send(*range(10, 50)))
    assert sender.send(60) == [True]
    assert counted(tracker) == {"lost": 40, "late": 40}


def test_a_message_twice_is_dropped_once() -> None:
    tracker = SequenceTracker()
    assert Publisher(tracker).send(0, 1, 1, 2, 0, 3) == [True, True, False, True, False, True]
    assert counted(tracker) == {"repeated": 2}


def test_a_new_stream_is_a_restart_at_once_and_the_old_one_is_late_from_then_on() -> None:
    tracker = SequenceTracker()
    old, new = Publisher(tracker, 7), Publisher(tracker, 3)
    assert all(old.send(*range(20)))
    assert new.send(0, 1) == [True, True]
    assert old.send(20, 21) == [False, False]
    assert new.send(2, 4) == [True, True]
    assert counted(tracker) == {"publisher_restarts": 1, "late": 2, "lost": 1}


def test_a_stream_where_none_was_said_is_a_restart() -> None:
    tracker = SequenceTracker()
    assert all([*Publisher(tracker).send(0, 1), *Publisher(tracker, 7).send(0, 1, 2)])
    assert counted(tracker) == {"publisher_restarts": 1}


def test_of_one_stream_nothing_that_goes_back_is_a_restart() -> None:
    tracker = SequenceTracker()
    sender = Publisher(tracker, 7)
    assert all(sender.send(*range(50)))
    assert not any(sender.send(*range(AGREEING + 2)))
    assert sender.send(50) == [True]
    assert counted(tracker) == {"repeated": AGREEING + 2}


def test_a_former_stream_that_alone_goes_on_is_believed_in_the_end() -> None:
    """Two publishers of one name, of which the later ended."""
    tracker = SequenceTracker()
    first, second = Publisher(tracker, 1), Publisher(tracker, 2)
    assert all([*first.send(0, 1), *second.send(0, 1)])
    used = first.send(*range(2, 2 + 2 * AGREEING_LATE))
    assert used == [False] * (AGREEING_LATE - 1) + [True] * (AGREEING_LATE + 1)


def test_without_a_stream_a_clock_that_goes_on_tells_a_restart_at_once() -> None:
    tracker = SequenceTracker()
    assert all(Publisher(tracker).send(*range(20)))
    assert all(Publisher(tracker, begin_s=100.0).send(0, 1, 3))
    assert counted(tracker) == {"publisher_restarts": 1, "lost": 1}


def test_without_a_stream_and_with_a_new_clock_several_messages_have_to_agree() -> None:
    tracker = SequenceTracker()
    assert all(Publisher(tracker).send(*range(100, 120)))
    again = Publisher(tracker)
    assert again.send(*range(6)) == [False] * (AGREEING - 1) + [True] * (7 - AGREEING)
    assert counted(tracker) == {"publisher_restarts": 1, "repeated": AGREEING - 1}


def test_messages_of_the_present_run_between_them_speak_against_a_restart() -> None:
    tracker = SequenceTracker()
    sender = Publisher(tracker)
    assert all(sender.send(*range(20)))
    for k in range(10):
        assert sender.send(k, 20 + k) == [False, True]
    assert counted(tracker) == {"repeated": 10}


def test_a_restart_whose_first_messages_were_lost_is_believed_at_the_first_number_not_missing() -> None:
    tracker = SequenceTracker()
    assert all(Publisher(tracker).send(0, *range(11, 40)))
    assert Publisher(tracker).send(*range(2, 14)) == [False] * 9 + [True] * 3
    assert counted(tracker) == {"lost": 10, "late": 9, "publisher_restarts": 1}


def test_a_number_that_no_publisher_reaches_is_stray_and_costs_nothing() -> None:
    tracker = SequenceTracker()
    sender = Publisher(tracker)
    assert sender.send(0, 1, 2**64 - 1, 2, 2**63, 3) == [True, True, False, True, False, True]
    assert counted(tracker) == {"stray": 2}


def test_another_count_is_believed_when_messages_agree_on_it_and_nothing_is_lost_by_it() -> None:
    tracker = SequenceTracker()
    sender = Publisher(tracker)
    far = 2**40
    assert sender.send(0, 1, far, far + 1, far + 2, far + 3) == [True, True, False, False, True, True]
    assert counted(tracker) == {"stray": 2, "publisher_restarts": 1}


def test_a_number_ahead_whose_stamps_are_behind_is_stray() -> None:
    """Of the run before a restart, come late."""
    tracker = SequenceTracker()
    old, new = Publisher(tracker), Publisher(tracker, begin_s=1000.0)
    assert all([*old.send(*range(20)), *new.send(0, 1, 2)])
    assert old.send(20) == [False]
    assert new.send(3, 4) == [True, True]
    assert counted(tracker) == {"publisher_restarts": 1, "stray": 1}


def test_a_publisher_that_does_not_count_is_used_and_what_it_sent_before_is_not() -> None:
    tracker = SequenceTracker()
    stamps = (0.0, 0.2, 0.4, 0.2, 0.6)
    assert [tracker.observe(0, None, t, t + 0.18) for t in stamps] == [True, True, True, False, True]
    assert counted(tracker) == {"repeated": 1}


@given(st.lists(st.tuples(st.integers(0, 2**64 - 1), st.integers(0, 3), st.floats()), max_size=60))
def test_no_numbers_make_a_count_that_json_cannot_carry(messages: list[tuple[int, int, float]]) -> None:
    tracker = SequenceTracker()
    for sequence, stream, at_s in messages:
        tracker.observe(sequence, stream or None, at_s, at_s)
    assert all(0 <= n < 2**53 for n in tracker.counts.values())
    assert tracker.counts["messages_lost"] <= 1_000_000 * len(messages)


@given(st.integers(0, 10**9), st.lists(st.booleans(), min_size=1, max_size=50))
def test_every_number_is_here_or_lost(first: int, arrives: list[bool]) -> None:
    tracker = SequenceTracker()
    sender = Publisher(tracker)
    sent = [first, *(first + 1 + k for k, here in enumerate(arrives) if here)]
    assert all(sender.send(*sent))
    assert tracker.counts["messages_lost"] == sent[-1] - first + 1 - len(sent)
