"""Whether the service works, and the service in numbers: a watch and the HTTP in front of it.

Only readiness asks the database, in a thread of its own, and waits two seconds for the answer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from wingwatch.api import HttpServer, ServiceFigures
from wingwatch.service.notifications import Notifications
from wingwatch.service.tokens import TokenRegister
from wingwatch.service.watch import Watch
from wingwatch.service.watch_health import WatchHealth

__all__ = ["Health", "Parts"]


@dataclass(frozen=True, slots=True)
class Parts:
    """What a service consists of, each of them started and ended elsewhere."""

    http: HttpServer
    watch: Watch
    tokens: TokenRegister
    notifications: Notifications
    refusals: Mapping[str, int]


class Health:
    """Looks at the parts of a service.

    Args:
        parts: started; where one ends or fails later, that is a problem.
    """

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._watch = WatchHealth(parts.watch, parts.refusals)

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence. It takes up to two seconds where the database is frozen."""
        return {**self._watch.asked_problems(), **self._of_doors()}

    def problems(self) -> Mapping[str, str | None]:
        """The same without asking the database, with what keeps alerts from people and recordings from the disk; it
        returns at once.

        A receiver that does not answer, or a full disk of recordings, is no reason to take the service out of use: it
        is ready all the same.
        """
        notifications = self._parts.notifications.problem
        return {**self._watch.problems(), **self._of_doors(), "notifications": notifications}

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on."""
        watch, notifications = self._watch.counters(), self._parts.notifications
        return {
            **watch,
            "loop": {**watch["loop"], "restarts_notifications": notifications.restarts},
            "connections": self._parts.http.counts,
            "notifications": notifications.counts,
        }

    def figures(self) -> ServiceFigures:
        """The service in numbers, beside its counters."""
        watch = self._watch.figures()
        queues = {**watch.queues, **self._parts.notifications.queues}
        return replace(watch, queues=queues, connections=self._parts.http.connections)

    def _of_doors(self) -> Mapping[str, str | None]:
        return {"http": self._parts.http.problem, "tokens": self._parts.tokens.problem}
