"""What a channel is: a way on which notices reach people, and how it says that one did not."""

from typing import Protocol

from wingwatch.notifications.notice import Notice

__all__ = ["Channel", "ChannelError", "NotDeliveredError", "RefusedError"]


class ChannelError(Exception):
    """A channel cannot be set up: one sentence, without a secret."""


class NotDeliveredError(Exception):
    """A notice has not arrived and is to be tried again: why, in a clause without a secret.

    Attributes:
        again_after_s: the receiver's wish for how long to wait; None where it has none.
    """

    def __init__(self, why: str, again_after_s: float | None = None) -> None:
        super().__init__(why)
        self.again_after_s = again_after_s


class RefusedError(Exception):
    """The receiver will never take this notice: why, in a clause without a secret."""


class Channel(Protocol):
    """A way on which notices reach people; called in one thread at a time.

    Attributes:
        place: what may be shown of where it leads: no secret is in it.
        keeps_first: whether a notice is brought to the disk before it is sent; a channel that cannot wait for a disk
            has it noted afterwards.
    """

    place: str
    keeps_first: bool

    def send(self, notice: Notice) -> None:
        """Deliver a notice; returns within a bounded time once the receiver has it.

        Raises:
            NotDeliveredError: it is to be tried again; so is it after any other exception but the next.
            RefusedError: it never will be taken.
        """
        ...

    def close(self) -> None:
        """Nothing more is sent."""
        ...
