"""The service's notifications: what is announced of alerts, handed to a thread for each channel."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Self

from wingwatch.api import QueueView
from wingwatch.monitor import MonitorPort
from wingwatch.monitor.ports import News, Outputs
from wingwatch.notifications import Clocks, Dispatcher, Outbox
from wingwatch.service.loops import Loop
from wingwatch.service.notify_settings import ChannelPlan
from wingwatch.telemetry import ServiceStream

__all__ = ["Notifications", "NotifyingOutputs"]

_JOIN_S = 2.0
_RESULTS = ("delivered", "retried", "refused", "expired", "dropped")


class Notifications:
    """All channels of a service; use it in a ``with`` statement, and ``begin`` once the monitor is there.

    Args:
        plans: of the channels.
        folder: of what they have still to say.
        clocks: of the service.
    """

    def __init__(self, plans: Sequence[ChannelPlan], folder: Path, clocks: Clocks) -> None:
        self._plans = plans
        self._monitor: MonitorPort | None = None
        self._dispatchers = [self._dispatcher(plan, folder, clocks) for plan in plans]
        self._loops = [
            Loop("wingwatch-notify", f"the loop that notifies {one.name}", one.run, one.wake)
            for one in self._dispatchers
        ]
        self._begun = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """What has not been delivered is kept; a receiver that does not answer is waited for 2 s at most."""
        for one in self._dispatchers:
            one.stop()
        for loop in self._loops if self._begun else ():
            loop.join(_JOIN_S)
        for plan in self._plans:
            plan.channel.close()

    def begin(self, monitor: MonitorPort) -> None:
        """Deliver from now on; earlier announcements wait until then."""
        self._monitor, self._begun = monitor, True
        for loop in self._loops:
            loop.start()

    def hear(self, news: Callable[[], News]) -> None:
        """There is a new version of an alert, committed; returns at once and never raises."""
        for one in self._dispatchers:
            one.hear(news)

    @property
    def counts(self) -> Mapping[str, int]:
        """Notices of all channels by what became of them."""
        total = Counter(dict.fromkeys(_RESULTS, 0))
        for one in self._dispatchers:
            total.update(one.counts)
        return dict(total)

    @property
    def restarts(self) -> int:
        """How often a channel's loop failed and began again."""
        return sum(loop.restarts for loop in self._loops)

    @property
    def queues(self) -> Mapping[str, QueueView]:
        """What waits, by channel."""
        return {f"notify_{one.name}": QueueView(one.waiting, one.waits_s) for one in self._dispatchers}

    @property
    def problem(self) -> str | None:
        """What does not get through, in a sentence for each channel; None where all does."""
        problems = [loop.problem for loop in self._loops if self._begun]
        found = [one for one in (*problems, *(d.problem for d in self._dispatchers)) if one is not None]
        return " ".join(found) or None

    def _dispatcher(self, plan: ChannelPlan, folder: Path, clocks: Clocks) -> Dispatcher:
        outbox = Outbox(folder / plan.file)
        aircraft = self._aircraft if plan.says_aircraft else (lambda _fleet, _vehicle: None)
        return Dispatcher(plan.name, plan.channel, outbox, plan.selection, plan.patience, clocks, aircraft)

    def _aircraft(self, fleet: str, vehicle: str) -> str | None:
        view = None if self._monitor is None else self._monitor.vehicle(fleet, vehicle)
        return None if view is None else view.aircraft


class NotifyingOutputs:
    """Implements the monitor's ``Outputs``: alerts go to the notifications, and everything to other outputs.

    Args:
        outputs: where all news goes.
        notifications: where alerts go, too.
    """

    def __init__(self, outputs: Outputs, notifications: Notifications) -> None:
        self._outputs, self._notifications = outputs, notifications

    def announce(self, fleet: str, vehicle: str, stream: ServiceStream, news: Callable[[], News]) -> None:
        """Hand on; returns at once."""
        if stream == "alerts":
            self._notifications.hear(news)
        self._outputs.announce(fleet, vehicle, stream, news)

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """Hand on."""
        self._outputs.ask_aircraft(fleet, vehicle)
