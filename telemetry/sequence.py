"""Which messages of a vehicle count: by their numbers, the number of their stream and their stamps.

A message that comes after newer ones is late, and late is late: it is counted and dropped. A publisher that was started
again counts from 0 anew, and looks alike to whoever sees its first message only. The contract's ``stream`` number
distinguishes the two at once; without it the messages have to agree with one another first.

A publisher that still sends owns the vehicle's name: whoever begins another count meanwhile is a second
publisher, and is refused.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import nan

__all__ = ["SECOND_PUBLISHER", "SequenceState", "SequenceTracker"]

AGREEING = 3
"""Messages in a row, each counting on from the one before it and none of the present run between them, that are
believed to be a publisher started again. One may be a message repeated on the way and two its neighbour; three that all
have been here before are nothing that a network does. Publishers that send ten samples a message lose 0.4 s by it."""

AGREEING_LATE = 100
"""The same where every number is one that was missing: what a radio link held back comes in one lump, and 100 messages
are 20 s of ten samples at 50 Hz. A restart is believed sooner, at its first number that was here before."""

MOST_LOST = 1_000_000
"""Numbers that a gap can span: two days of ten-sample messages at 50 Hz. A longer leap is another count."""

_KEPT_GAPS = 64
_KEPT_STREAMS = 8
_MOST_COUNTED = 2**53 - 1  # what JSON carries exactly

SECOND_PUBLISHER = "messages_second_publisher"
"""The count of messages that were refused because another publisher owns the name."""

Stream = int | float


@dataclass(frozen=True, slots=True)
class SequenceState:
    """Everything a tracker remembers, by the names that it has there."""

    counts: Mapping[str, int]
    first: int
    next: int | None
    last_s: float
    gaps: tuple[range, ...]
    stream: int | float | None
    former: tuple[int | float, ...]
    rivals: int
    rival_next: int
    enough: int


class SequenceTracker:
    """Follows the numbers of one vehicle's sensors messages.

    Attributes:
        counts: ``messages_lost`` (numbers that did not come in time), ``messages_late`` (came after newer ones),
            ``messages_repeated`` (had been here), ``messages_stray`` (a number that does not go with the others),
            ``messages_second_publisher`` (of another publisher while the first sends), ``publisher_restarts``;
            all of them but the first and last were dropped.
        refusal: under which of these names the last message that was dropped was counted; empty before one was.
    """

    def __init__(self) -> None:
        names = ("lost", "late", "repeated", "stray", "second_publisher")
        self.counts = dict.fromkeys((*(f"messages_{name}" for name in names), "publisher_restarts"), 0)
        self.refusal = ""
        self._first = 0
        self._next: int | None = None
        self._last_s = nan
        self._gaps: deque[range] = deque(maxlen=_KEPT_GAPS)
        self._stream: Stream | None = None
        self._former: deque[Stream] = deque(maxlen=_KEPT_STREAMS)
        self._rivals, self._rival_next, self._enough = 0, -1, AGREEING_LATE

    @property
    def state(self) -> SequenceState:
        """What must be kept to go on later as if there had been no interruption."""
        return SequenceState(
            dict(self.counts), self._first, self._next, self._last_s, tuple(self._gaps), self._stream,
            tuple(self._former), self._rivals, self._rival_next, self._enough,
        )  # fmt: skip

    def resume(self, state: SequenceState) -> None:
        """Go on from where another tracker stopped."""
        self.counts |= state.counts
        self._first, self._next, self._last_s, self._stream = (
            state.first,
            state.next,
            state.last_s,
            state.stream,
        )
        self._gaps.extend(state.gaps)
        self._former.extend(state.former)
        self._rivals, self._rival_next, self._enough = state.rivals, state.rival_next, state.enough

    @property
    def stream(self) -> Stream | None:
        """The number of the present publisher's start; None where it says none, or nothing has come yet."""
        return self._stream

    def refuse(self) -> None:
        """Count a message of a second publisher that something else than its numbers has shown to be one."""
        self.refusal = SECOND_PUBLISHER
        self._count(SECOND_PUBLISHER)

    def observe(
        self,
        sequence: int,
        stream: Stream | None = None,
        first_s: float = nan,
        last_s: float = nan,
        owned: bool = False,
    ) -> bool:
        """Takes the number of a message that arrived; whether the message is to be used.

        Args:
            sequence: its number.
            stream: the number of its publisher's start, None where it says none.
            first_s: its earliest stamp, NaN without any.
            last_s: its latest.
            owned: whether the present publisher still sends; no other takes its place then.
        """
        if self._next is None:
            self._begin(sequence, stream)
        elif (doubt := self._doubt(sequence, stream, first_s)) is None:
            self._go_on(sequence)
        elif self._agree(sequence, doubt[1]):
            if owned:
                self.refuse()
                return False
            self._count("publisher_restarts")
            self._begin(sequence, stream)
        else:
            self.refusal = doubt[0]
            self._count(doubt[0])
            return False
        self._rivals = 0
        self._last_s = last_s if last_s == last_s else self._last_s
        return True

    def _doubt(self, sequence: int, stream: Stream | None, first_s: float) -> tuple[str, int] | None:
        """Why a message does not go on from those before, and how many like it are believed; None where it does."""
        expected, newer = self._next or 0, first_s > self._last_s
        named = stream is not None
        if named and stream != self._stream:
            return ("messages_late", AGREEING_LATE if stream in self._former else 1)
        if sequence - expected > MOST_LOST:
            return ("messages_stray", AGREEING)
        if sequence > expected and first_s < self._last_s and not named:
            return ("messages_stray", AGREEING)  # ahead by its number, behind by its stamps
        if sequence >= expected or (sequence == 0 and expected == 1 and newer):
            return None  # the latter publisher does not count
        late = any(sequence in gap for gap in self._gaps)
        enough = AGREEING_LATE if late else AGREEING
        if newer:  # nothing that was sent earlier carries a later stamp
            enough = AGREEING if late else 1
        return ("messages_late" if late else "messages_repeated", AGREEING_LATE if named else enough)

    def _agree(self, sequence: int, enough: int) -> bool:
        """Whether as many messages in a row as are needed speak for a publisher that was started again."""
        follows = 0 <= sequence - self._rival_next <= AGREEING_LATE or (sequence == 0 == self._rival_next - 1)
        if not (self._rivals and follows):
            self._rivals, self._enough = 0, AGREEING_LATE
        self._rivals += 1
        self._rival_next = sequence + 1
        self._enough = min(self._enough, enough)
        return self._rivals >= self._enough

    def _begin(self, sequence: int, stream: Stream | None) -> None:
        if self._stream is not None and self._stream != stream:
            self._former.append(self._stream)
        self._first, self._next, self._stream, self._last_s = sequence, sequence + 1, stream, nan
        self._gaps.clear()

    def _go_on(self, sequence: int) -> None:
        expected = self._next or 0
        if sequence > expected:
            self._count("messages_lost", sequence - expected)
            self._gaps.append(range(expected, sequence))
        self._next = max(expected, sequence + 1)

    def _count(self, name: str, times: int = 1) -> None:
        self.counts[name] = min(self.counts[name] + times, _MOST_COUNTED)
