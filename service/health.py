"""Whether the service works, and the service in numbers: both by looking at its parts, without waiting for any.

Only readiness asks the database, in a thread of its own, and waits two seconds for the answer.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import zenoh

from wingwatch.api import HttpServer, QueueView, ServiceFigures
from wingwatch.monitor import FleetMonitor, default_settings
from wingwatch.service.alert_diagnoses import AlertDiagnoses
from wingwatch.service.checkpoints import CheckpointFolder
from wingwatch.service.database_probe import DatabaseProbe
from wingwatch.service.diagnosis_jobs import DiagnosisJobs
from wingwatch.service.ingest import IngestLoop
from wingwatch.service.notifications import Notifications
from wingwatch.service.outputs import ZenohOutputs
from wingwatch.service.processor_time import ProcessorTimes
from wingwatch.service.recorder import COUNTED, Recorder
from wingwatch.service.store import DatabaseStore
from wingwatch.service.tokens import TokenRegister
from wingwatch.telemetry import SensorSubscriber, ZenohSettings

__all__ = ["Health", "Parts", "connected", "waiting_for"]

_MOST_QUEUED_S = 5.0
_MOST_BEHIND_S = 60.0
_LINKS = ("client", "peer", "router")


@dataclass(frozen=True, slots=True)
class Parts:
    """What a service consists of, each of them started and ended elsewhere."""

    http: HttpServer
    monitor: FleetMonitor
    probe: DatabaseProbe
    store: DatabaseStore
    checkpoints: CheckpointFolder
    session: zenoh.Session
    link: ZenohSettings
    subscriber: SensorSubscriber
    outputs: ZenohOutputs
    ingest: IngestLoop
    tokens: TokenRegister
    diagnoses: DiagnosisJobs
    alert_diagnoses: AlertDiagnoses | None
    notifications: Notifications
    refusals: Mapping[str, int]
    recorder: Recorder | None = None


class Health:
    """Looks at the parts of a service.

    Args:
        parts: started; where one ends or fails later, that is a problem.
    """

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._processor = ProcessorTimes()
        self._settings = default_settings()

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence. It takes up to two seconds where the database is frozen."""
        return self._problems(self._database_problem())

    def problems(self) -> Mapping[str, str | None]:
        """The same without asking the database, with what keeps alerts from people and recordings from the disk; it
        returns at once.

        A receiver that does not answer, or a full disk of recordings, is no reason to take the service out of use: it
        is ready all the same.
        """
        store = self._parts.store
        problems = self._problems(_ended(store) or waiting_for(store))
        recorder = self._parts.recorder
        recording = None if recorder is None else recorder.problem or recorder.loop.problem
        return {**problems, "notifications": self._parts.notifications.problem, "recording": recording}

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on."""
        parts = self._parts
        return {
            "messages": parts.subscriber.counts,
            "intake": parts.monitor.intake,
            "monitor": parts.monitor.problems,
            "loop": {"faults": parts.ingest.faults, **self._restarts()},
            "store": parts.store.counts,
            "checkpoints": parts.checkpoints.counts,
            "outputs": dict(parts.outputs.dropped),
            "links": {**parts.refusals, "foreign_alerts": parts.outputs.foreign_alerts},
            "connections": parts.http.counts,
            "alert_diagnoses": {} if parts.alert_diagnoses is None else dict(parts.alert_diagnoses.counts),
            "recording": dict.fromkeys(COUNTED, 0) if parts.recorder is None else parts.recorder.counts,
            "notifications": parts.notifications.counts,
        }

    def figures(self) -> ServiceFigures:
        """The service in numbers, beside its counters."""
        parts = self._parts
        return ServiceFigures(
            settings=self._settings,
            delay=parts.ingest.delays.view(),
            queues=self._queues(),
            links=self._links(),
            processor_s=self._processor.by_stage(),
            connections=parts.http.connections,
        )

    def _restarts(self) -> Mapping[str, int]:
        parts = self._parts
        writing, reading = parts.store.loops
        loops = {
            "messages": parts.ingest.loop, "store": writing, "recall": reading, "checkpoints": parts.checkpoints.loop,
            "outputs": parts.outputs.loop, "diagnoses": parts.diagnoses.loop,
            "alert_diagnoses": parts.diagnoses.alert_loop,
        }  # fmt: skip
        restarts = {f"restarts_{name}": loop.restarts for name, loop in loops.items()}
        return {**restarts, "restarts_notifications": parts.notifications.restarts}

    def _queues(self) -> Mapping[str, QueueView]:
        parts = self._parts
        writes, outputs = parts.store.waiting, parts.outputs.waiting
        recalls = writes.pop("recalls")
        messages_s = max(parts.subscriber.waiting_s, parts.ingest.in_hand_s)
        return {
            "messages": QueueView(parts.subscriber.waiting, messages_s),
            "store": QueueView(sum(writes.values()), parts.store.behind_s),
            **{f"store_{kind}": QueueView(length) for kind, length in writes.items()},
            "recalls": QueueView(recalls),
            "checkpoints": QueueView(parts.checkpoints.waiting),
            "published_alerts": QueueView(outputs["alerts"], parts.outputs.alerts_wait_s),
            "published_latest": QueueView(outputs["latest"]),
            "queries": QueueView(outputs["queries"]),
            "diagnoses": QueueView(parts.diagnoses.waiting),
            "alert_diagnoses": QueueView(parts.diagnoses.alerts_waiting),
            "recording": QueueView(0 if parts.recorder is None else parts.recorder.waiting),
            **parts.notifications.queues,
        }

    def _links(self) -> Mapping[str, int]:
        session = self._parts.session
        others = [] if session.is_closed() else session.info.transports()
        return dict.fromkeys(_LINKS, 0) | Counter(str(other.whatami).lower() for other in others)

    def _problems(self, database: str | None) -> Mapping[str, str | None]:
        parts = self._parts
        return {
            "zenoh": self._zenoh_problem(),
            "messages": self._messages_problem(),
            "capacity": self._capacity_problem(),
            "database": database,
            "checkpoints": self._checkpoints_problem(),
            "http": parts.http.problem,
            "tokens": parts.tokens.problem,
            "estimators": parts.ingest.problem,
            "diagnoses": self._diagnoses_problem(),
        }

    def _diagnoses_problem(self) -> str | None:
        parts = self._parts
        watching = None if parts.alert_diagnoses is None else parts.alert_diagnoses.loop.problem
        return parts.diagnoses.loop.problem or parts.diagnoses.alert_loop.problem or watching

    def _zenoh_problem(self) -> str | None:
        parts = self._parts
        if parts.session.is_closed():
            return "the Zenoh session is closed."
        if not connected(parts.session, parts.link):
            return f"the connection to {' '.join(parts.link.connect)} is lost; it is tried again."
        if (problem := parts.outputs.loop.problem) is not None:
            return problem
        waiting_s = parts.outputs.alerts_wait_s
        if waiting_s > _MOST_QUEUED_S:
            return f"alerts have waited for {waiting_s:.0f} s to be published."
        return None

    def _messages_problem(self) -> str | None:
        parts = self._parts
        if not parts.subscriber.alive:
            return "the loop that takes messages over from Zenoh has ended."
        waiting_s = max(parts.subscriber.waiting_s, parts.ingest.in_hand_s)
        if waiting_s <= _MOST_QUEUED_S:
            return None
        return f"messages wait for {waiting_s:.0f} s before they are taken in; what is shown is as old."

    def _capacity_problem(self) -> str | None:
        left_out = self._parts.monitor.left_out
        if not left_out:
            return None
        who = "1 vehicle is" if left_out == 1 else f"{left_out} vehicles are"
        return f"degraded service: {who} not watched, because the machine is overloaded."

    def _database_problem(self) -> str | None:
        store = self._parts.store
        if (ended := _ended(store)) is not None:
            return ended
        if store.behind_s > _MOST_BEHIND_S:
            return f"entries have waited for {store.behind_s:.0f} s to be written."
        if (problem := self._parts.probe.problem()) is not None:
            return problem
        return None if store.problem is None else f"{store.problem}."

    def _checkpoints_problem(self) -> str | None:
        checkpoints = self._parts.checkpoints
        if (ended := checkpoints.loop.problem) is not None:
            return ended
        problem = checkpoints.problem
        return None if problem is None else f"states of vehicles are not saved: {problem}."


def connected(session: zenoh.Session, link: ZenohSettings) -> bool:
    """Whether a client has its router."""
    info = session.info
    return link.mode != "client" or bool([*info.routers_zid(), *info.peers_zid()])


def waiting_for(store: DatabaseStore) -> str | None:
    """Why entries wait for the database, without asking it."""
    if store.problem is not None:
        return f"{store.problem}."
    if store.behind_s <= _MOST_QUEUED_S:
        return None
    return f"the database has taken no entry for {store.behind_s:.0f} s."


def _ended(store: DatabaseStore) -> str | None:
    return next((loop.problem for loop in store.loops if loop.problem is not None), None)
