"""One channel's notices: what is new becomes notices, and these are delivered in order, tried again, or given up."""

import logging
import random
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from wingwatch.monitor import AlertState, AlertView
from wingwatch.monitor.views import LEVELS
from wingwatch.notifications.channel import Channel, NotDeliveredError, RefusedError
from wingwatch.notifications.notice import ALL_STEPS, Step, notice_of, said_of, steps_of
from wingwatch.notifications.outbox import Outbox

__all__ = ["Clocks", "Dispatcher", "Patience", "Selection"]

_LOG = logging.getLogger(__name__)
_MOST_NEW = 1000
_SAVE_AGAIN_S = 5.0
_SILENT_S = 60.0
"""Waiting for longer than this is shown as a problem."""


@dataclass(frozen=True, slots=True)
class Selection:
    """What a channel is to say.

    Attributes:
        least_level: alerts below it are not spoken of; one that was is followed to its end.
        fleets: empty for all; vehicles: names or ``fleet/name``, empty for all.
        steps: those that are said.
    """

    least_level: str = "watch"
    fleets: Collection[str] = ()
    vehicles: Collection[str] = ()
    steps: Collection[Step] = ALL_STEPS

    def is_of(self, alert: AlertView) -> bool:
        """Whether the alert is of a vehicle that the channel is about."""
        names = {alert.vehicle, f"{alert.fleet}/{alert.vehicle}"}
        return (not self.fleets or alert.fleet in self.fleets) and (
            not self.vehicles or not names.isdisjoint(self.vehicles)
        )

    def is_bad_enough(self, alert: AlertView) -> bool:
        """Whether an alert that was not spoken of yet is to be."""
        return LEVELS.index(alert.level) >= LEVELS.index(self.least_level)


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a notice is tried.

    Attributes:
        first_s, most_s: wait after the first failure, doubled by each further one up to the latter; each wait is drawn
            between half of that and all of it, so that many senders do not come back at once.
        keep_s: a notice that has waited for longer is given up; after a restart it waits anew. The wall clock is not
            asked: a small computer may begin in 1970 and find the time and the network together.
    """

    first_s: float = 1.0
    most_s: float = 300.0
    keep_s: float = 86_400.0

    def wait_s(self, failures: int, draw: float, wish_s: float | None) -> float:
        """Wait after so many failures in a row.

        Args:
            draw: from 0 to 1.
            wish_s: the receiver's own, followed up to the longest wait.
        """
        whole = min(self.most_s, self.first_s * 2.0 ** min(failures - 1, 60))
        return max(whole * (0.5 + 0.5 * draw), min(wish_s or 0.0, self.most_s))


@dataclass(frozen=True, slots=True)
class Clocks:
    """Of the service: monotonic seconds, seconds since 1970-01-01 UTC, and what draws waits (0 to 1)."""

    monotonic: Callable[[], float] = time.monotonic
    wall: Callable[[], float] = time.time
    draw: Callable[[], float] = field(default_factory=lambda: random.Random().random)


class Dispatcher:
    """Delivers what is said of alerts on one channel. ``hear`` is called by anybody, ``run`` by one thread.

    Args:
        name: of the channel, for log and health.
        aircraft: of a vehicle, by fleet and name; called in the channel's thread.

    Attributes:
        counts: notices ``delivered``, ``retried``, ``refused`` by the receiver, ``expired`` (given up after
            ``Patience.keep_s``) and ``dropped`` for want of room.
    """

    def __init__(
        self,
        name: str,
        channel: Channel,
        outbox: Outbox,
        selection: Selection,
        patience: Patience,
        clocks: Clocks,
        aircraft: Callable[[str, str], str | None] = lambda _fleet, _vehicle: None,
    ) -> None:
        self.name, self._channel, self._outbox, self._selection = name, channel, outbox, selection
        self._patience, self._clocks, self._aircraft = patience, clocks, aircraft
        self._new: deque[Callable[[], object]] = deque()
        self._event, self._ending = threading.Event(), False
        self._failures, self._due_s = 0, float("-inf")
        self._since: dict[str, float] = {}
        self._since_s: float | None = None
        self._why, self._refusal = "", ""
        self._unheard = 0
        self._counts = dict.fromkeys(("delivered", "retried", "refused", "expired"), 0)

    # -- for anybody --------------------------------------------------------------------------------

    def hear(self, news: Callable[[], object]) -> None:
        """There is a new version of an alert; returns at once and never raises.

        Args:
            news: gives it, in the channel's thread.
        """
        if len(self._new) >= _MOST_NEW:
            self._unheard += 1
            return
        self._new.append(news)
        self._event.set()

    def wake(self) -> None:
        """Look at what waits."""
        self._event.set()

    def stop(self) -> None:
        """Have ``run`` return; what is being sent is ended first."""
        self._ending = True
        self._event.set()

    @property
    def place(self) -> str:
        """Where the channel leads, without a secret."""
        return self._channel.place

    @property
    def counts(self) -> dict[str, int]:
        """Notices by what became of them."""
        return {**self._counts, "dropped": self._outbox.dropped + self._unheard}

    @property
    def waiting(self) -> int:
        """Notices that wait to be delivered, and versions of alerts that wait to be looked at."""
        return len(self._outbox.waiting) + len(self._new)

    @property
    def waits_s(self) -> float:
        """How long the oldest notice has waited in this run; 0 where none waits."""
        since_s = self._since_s
        return 0.0 if since_s is None else self._clocks.monotonic() - since_s

    @property
    def problem(self) -> str | None:
        """In one sentence why notices do not get through; None while they do."""
        about = f"{self.name} ({self._channel.place})"
        if (waits_s := self.waits_s) > _SILENT_S:
            why = f": {self._why}" if self._why else ""
            return f"{about} has delivered nothing for {waits_s:.0f} s, {self.waiting} wait{why}."
        if self._refusal:
            return f"{about} refused the latest notice: {self._refusal}."
        if self._outbox.problem is not None:
            return f"{about}: what waits is not kept on the disk: {self._outbox.problem}."
        return None

    # -- the channel's thread -------------------------------------------------------------------------

    def run(self) -> None:
        """Deliver until asked to stop."""
        while True:
            self._event.wait(self._wait_s())
            self._event.clear()
            if self._ending:
                self._take_in()
                self._outbox.save()
                return
            self.look()

    def look(self) -> None:
        """Take in what is new, and send what is due."""
        self._take_in()
        while self._outbox.waiting and not self._ending and self._clocks.monotonic() >= self._due_s:
            if self._channel.keeps_first:
                self._outbox.save()
            self._send()
            self._outbox.save()
            self._take_in()
        self._outbox.save()

    def _wait_s(self) -> float | None:
        """Until something is due; None where only news can make it so."""
        if self._outbox.waiting:
            return max(0.0, self._due_s - self._clocks.monotonic())
        return _SAVE_AGAIN_S if self._outbox.problem is not None else None

    def _take_in(self) -> None:
        while self._new:
            try:
                alert = self._new.popleft()()
                if isinstance(alert, AlertView) and self._selection.is_of(alert):
                    self._follow(alert)
            except Exception:  # one version that cannot be said must not keep the next from being
                _LOG.exception("%s cannot say what has happened to an alert", self.name)
        self._look_at_ages()

    def _look_at_ages(self) -> None:
        """Give up what has waited too long, and note how long the oldest of the rest has."""
        waiting, now_s = self._outbox.waiting, self._clocks.monotonic()
        self._since = {notice.key: self._since.get(notice.key, now_s) for notice in waiting}
        while waiting and now_s - self._since[waiting[0].key] > self._patience.keep_s:
            gone = waiting.popleft()
            self._counts["expired"] += 1
            _LOG.warning("%s gives up a notice of alert %s: it is too old", self.name, gone.alert["id"])
        self._since_s = self._since[waiting[0].key] if waiting else None

    def _follow(self, alert: AlertView) -> None:
        before = self._outbox.said.get(alert.id)
        if before is None and not self._selection.is_bad_enough(alert):
            return
        steps = steps_of(before, alert)
        if not steps:
            return
        now_s = self._clocks.wall()
        after = said_of(before, alert, now_s)
        self._outbox.note(alert.id, None if alert.state is AlertState.CLEARED else after)
        if wanted := tuple(step for step in steps if step in self._selection.steps):
            aircraft = self._aircraft(alert.fleet, alert.vehicle)
            self._outbox.add(notice_of(alert, wanted, before, after, aircraft, now_s))

    def _send(self) -> None:
        notice = self._outbox.waiting[0]
        about = (self.name, notice.alert["id"], ", ".join(notice.steps))
        try:
            self._channel.send(notice)
        except RefusedError as error:
            self._refusal = str(error)
            self._count("refused")
            _LOG.warning("%s refuses a notice of alert %s (%s): %s", *about, error)
            return
        except Exception as error:  # whatever a library raises, the notice is tried again
            self._failed(error, about)
            return
        self._refusal = ""
        self._count("delivered")
        _LOG.info("%s has delivered a notice of alert %s (%s)", *about)

    def _count(self, result: str) -> None:
        """The oldest notice is done with."""
        self._outbox.waiting.popleft()
        self._counts[result] += 1
        self._failures, self._due_s, self._why = 0, float("-inf"), ""

    def _failed(self, error: Exception, about: tuple[str, str, str]) -> None:
        known = isinstance(error, NotDeliveredError)
        why = str(error) if known else type(error).__name__  # the text of others may hold a secret
        wish_s = error.again_after_s if isinstance(error, NotDeliveredError) else None
        self._counts["retried"] += 1
        self._failures += 1
        wait_s = self._patience.wait_s(self._failures, self._clocks.draw(), wish_s)
        self._due_s = self._clocks.monotonic() + wait_s
        if why != self._why:
            _LOG.warning("%s has not delivered a notice of alert %s (%s): %s; it is tried again", *about, why)
        self._why = why
