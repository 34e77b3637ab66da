"""Whether a watch works, and the watch in numbers: both by looking at its parts, without waiting for any.

Only ``asked_problems`` asks the database, in a thread of its own, and waits two seconds for the answer.
"""

from collections import Counter
from collections.abc import Mapping

from wingwatch.api import QueueView, ServiceFigures
from wingwatch.monitor import default_settings
from wingwatch.service.processor_time import ProcessorTimes
from wingwatch.service.recorder import COUNTED
from wingwatch.service.store import DatabaseStore
from wingwatch.service.watch import Watch, connected, waiting_for

__all__ = ["LINKS", "WatchHealth"]

_MOST_QUEUED_S = 5.0
_MOST_BEHIND_S = 60.0
LINKS = ("client", "peer", "router")
"""Kinds of the other side of a link."""


class WatchHealth:
    """Looks at the parts of a watch.

    Args:
        watch: begun; where a part ends or fails later, that is a problem.
        refusals: counts of what access rules refuse.
    """

    def __init__(self, watch: Watch, refusals: Mapping[str, int]) -> None:
        self._watch, self._refusals = watch, refusals
        self._processor = ProcessorTimes()
        self._settings = default_settings()

    def asked_problems(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence. It takes up to two seconds where the database is frozen."""
        return self._problems(self._database_problem())

    def problems(self) -> Mapping[str, str | None]:
        """The same without asking the database, with what keeps recordings from the disk; it returns at once."""
        store = self._watch.store
        problems = self._problems(_ended(store) or waiting_for(store))
        recorder = self._watch.recorder
        recording = None if recorder is None else recorder.problem or recorder.loop.problem
        return {**problems, "recording": recording}

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on."""
        watch = self._watch
        return {
            "messages": watch.subscriber.counts,
            "intake": watch.monitor.intake,
            "monitor": watch.monitor.problems,
            "loop": {"faults": watch.ingest.faults, **self._restarts()},
            "store": watch.store.counts,
            "checkpoints": watch.checkpoints.counts,
            "outputs": dict(watch.outputs.dropped),
            "links": {**self._refusals, "foreign_alerts": watch.outputs.foreign_alerts},
            "alert_diagnoses": {} if watch.alert_diagnoses is None else dict(watch.alert_diagnoses.counts),
            "recording": dict.fromkeys(COUNTED, 0) if watch.recorder is None else watch.recorder.counts,
        }

    def figures(self) -> ServiceFigures:
        """The watch in numbers, beside its counters."""
        watch = self._watch
        return ServiceFigures(
            settings=self._settings,
            delay=watch.ingest.delays.view(),
            queues=self._queues(),
            links=self._links(),
            processor_s=self._processor.by_stage(),
        )

    def _restarts(self) -> Mapping[str, int]:
        watch = self._watch
        writing, reading = watch.store.loops
        loops = {
            "messages": watch.ingest.loop, "store": writing, "recall": reading, "checkpoints": watch.checkpoints.loop,
            "outputs": watch.outputs.loop, "diagnoses": watch.diagnoses.loop,
            "alert_diagnoses": watch.diagnoses.alert_loop,
        }  # fmt: skip
        return {f"restarts_{name}": loop.restarts for name, loop in loops.items()}

    def _queues(self) -> Mapping[str, QueueView]:
        watch = self._watch
        writes, outputs = watch.store.waiting, watch.outputs.waiting
        recalls = writes.pop("recalls")
        messages_s = max(watch.subscriber.waiting_s, watch.ingest.in_hand_s)
        return {
            "messages": QueueView(watch.subscriber.waiting, messages_s),
            "store": QueueView(sum(writes.values()), watch.store.behind_s),
            **{f"store_{kind}": QueueView(length) for kind, length in writes.items()},
            "recalls": QueueView(recalls),
            "checkpoints": QueueView(watch.checkpoints.waiting),
            "published_alerts": QueueView(outputs["alerts"], watch.outputs.alerts_wait_s),
            "published_latest": QueueView(outputs["latest"]),
            "queries": QueueView(outputs["queries"]),
            "diagnoses": QueueView(watch.diagnoses.waiting),
            "alert_diagnoses": QueueView(watch.diagnoses.alerts_waiting),
            "recording": QueueView(0 if watch.recorder is None else watch.recorder.waiting),
        }

    def _links(self) -> Mapping[str, int]:
        session = self._watch.session
        others = [] if session.is_closed() else session.info.transports()
        return dict.fromkeys(LINKS, 0) | Counter(str(other.whatami).lower() for other in others)

    def _problems(self, database: str | None) -> Mapping[str, str | None]:
        watch = self._watch
        return {
            "zenoh": self._zenoh_problem(),
            "messages": self._messages_problem(),
            "capacity": self._capacity_problem(),
            "database": database,
            "checkpoints": self._checkpoints_problem(),
            "estimators": watch.ingest.problem,
            "diagnoses": self._diagnoses_problem(),
        }

    def _diagnoses_problem(self) -> str | None:
        watch = self._watch
        watching = None if watch.alert_diagnoses is None else watch.alert_diagnoses.loop.problem
        return watch.diagnoses.loop.problem or watch.diagnoses.alert_loop.problem or watching

    def _zenoh_problem(self) -> str | None:
        watch = self._watch
        if watch.session.is_closed():
            return "the Zenoh session is closed."
        if not connected(watch.session, watch.link):
            return f"the connection to {' '.join(watch.link.connect)} is lost; it is tried again."
        if (problem := watch.outputs.loop.problem) is not None:
            return problem
        waiting_s = watch.outputs.alerts_wait_s
        if waiting_s > _MOST_QUEUED_S:
            return f"alerts have waited for {waiting_s:.0f} s to be published."
        return None

    def _messages_problem(self) -> str | None:
        watch = self._watch
        if not watch.subscriber.alive:
            return "the loop that takes messages over from Zenoh has ended."
        waiting_s = max(watch.subscriber.waiting_s, watch.ingest.in_hand_s)
        if waiting_s <= _MOST_QUEUED_S:
            return None
        return f"messages wait for {waiting_s:.0f} s before they are taken in; what is shown is as old."

    def _capacity_problem(self) -> str | None:
        left_out = self._watch.monitor.left_out
        if not left_out:
            return None
        who = "1 vehicle is" if left_out == 1 else f"{left_out} vehicles are"
        return f"degraded service: {who} not watched, because the machine is overloaded."

    def _database_problem(self) -> str | None:
        store = self._watch.store
        if (ended := _ended(store)) is not None:
            return ended
        if store.behind_s > _MOST_BEHIND_S:
            return f"entries have waited for {store.behind_s:.0f} s to be written."
        if (problem := self._watch.probe.problem()) is not None:
            return problem
        return None if store.problem is None else f"{store.problem}."

    def _checkpoints_problem(self) -> str | None:
        checkpoints = self._watch.checkpoints
        if (ended := checkpoints.loop.problem) is not None:
            return ended
        problem = checkpoints.problem
        return None if problem is None else f"states of vehicles are not saved: {problem}."


def _ended(store: DatabaseStore) -> str | None:
    return next((loop.problem for loop in store.loops if loop.problem is not None), None)
