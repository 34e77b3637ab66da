"""Whether a gateway and its workers work, and both in numbers; nobody is waited for but the database, for readiness."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import zenoh

from wingwatch.api import HttpServer, QueueView, ServiceFigures
from wingwatch.service.database_probe import DatabaseProbe
from wingwatch.service.diagnosis_jobs import DiagnosisJobs
from wingwatch.service.notifications import Notifications
from wingwatch.service.processor_time import ProcessorTimes
from wingwatch.service.tokens import TokenRegister
from wingwatch.service.watch import connected
from wingwatch.service.watch_health import LINKS
from wingwatch.service.workers.children import WorkerChildren
from wingwatch.service.workers.gateway_parts import joined_figures, summed
from wingwatch.service.workers.remote_fleet import RemoteFleet
from wingwatch.telemetry import ZenohSettings

__all__ = ["GatewayHealth", "GatewayParts"]

_NOBODY = "no worker is there, so no vehicle is watched; start one with `wingwatch worker`."
_UNHEARD = "no worker has answered yet, so no vehicle is shown."


@dataclass(frozen=True, slots=True)
class GatewayParts:
    """What a gateway consists of, each of them started and ended elsewhere."""

    http: HttpServer
    session: zenoh.Session
    link: ZenohSettings
    fleet: RemoteFleet
    probe: DatabaseProbe
    tokens: TokenRegister
    notifications: Notifications
    diagnoses: DiagnosisJobs
    children: WorkerChildren | None
    refusals: Mapping[str, int]


class GatewayHealth:
    """Looks at the parts of a gateway, and at what its workers say of themselves.

    Args:
        parts: started.
    """

    def __init__(self, parts: GatewayParts) -> None:
        self._parts = parts
        self._processor = ProcessorTimes()

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence. It takes up to two seconds where the database is frozen.

        A gateway is ready while any of its workers is: one that has ended is shown, and no reason to take it out of
        use.
        """
        waiting = self.waits_for()
        nobody = waiting if waiting in (_NOBODY, _UNHEARD) else None
        return {**self._own(self._parts.probe.problem()), "workers": nobody, "estimators": waiting}

    def problems(self) -> Mapping[str, str | None]:
        """The same without asking the database, with the notifications' and what each worker says of itself."""
        fleet, found = self._parts.fleet, dict[str, str | None]()
        database = None if fleet.read_problem is None else f"{fleet.read_problem}."
        found.update(self._own(database))
        found["notifications"] = self._parts.notifications.problem
        for name, (state, _) in fleet.states().items():
            for part, problem in ({} if state is None else state.problems).items():
                said = f"Worker {name}: {problem}"
                found[part] = said if (before := found.get(part)) is None else f"{before} {said}"
        return found

    def waits_for(self) -> str | None:
        """Why no worker takes samples in; None where one does."""
        states = [state for state, silent_s in self._parts.fleet.states().values() if state and not silent_s]
        if not states:
            return _UNHEARD if self._parts.fleet.states() else _NOBODY
        waiting = [state.problems.get("estimators") for state in states]
        return None if None in waiting else waiting[0]

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on: of the workers in sum, also of those that have gone."""
        parts = self._parts
        states = [state.counters for state, _ in parts.fleet.states().values() if state is not None]
        loops = {"workers": parts.fleet.loop, "alerts": parts.fleet.reader, "diagnoses": parts.diagnoses.loop}
        restarts = {f"restarts_{name}": loop.restarts for name, loop in loops.items()}
        restarts["restarts_notifications"] = parts.notifications.restarts
        own = {
            "loop": restarts,
            "links": dict(parts.refusals),
            "connections": dict(parts.http.counts),
            "notifications": dict(parts.notifications.counts),
            "workers": {
                **parts.fleet.counts,
                "restarted": 0 if parts.children is None else parts.children.restarts,
            },
        }
        return summed(parts.fleet.gone_counters(), *states, own)

    def figures(self) -> ServiceFigures:
        """The gateway and its workers in numbers."""
        parts = self._parts
        own = ServiceFigures(
            queues={
                "diagnoses": QueueView(parts.diagnoses.waiting),
                **parts.notifications.queues,
            },
            links=self._links(),
            processor_s=self._processor.by_stage(),
            connections=parts.http.connections,
        )
        states = [state.service for state, _ in parts.fleet.states().values() if state is not None]
        return joined_figures(own, states)

    def _links(self) -> Mapping[str, int]:
        session = self._parts.session
        others = [] if session.is_closed() else session.info.transports()
        return dict.fromkeys(LINKS, 0) | Counter(str(other.whatami).lower() for other in others)

    def _own(self, database: str | None) -> Mapping[str, str | None]:
        parts = self._parts
        return {
            "zenoh": self._zenoh_problem(),
            "workers": self._workers_problem(),
            "database": database,
            "http": parts.http.problem,
            "tokens": parts.tokens.problem,
            "diagnoses": parts.diagnoses.loop.problem,
        }

    def _zenoh_problem(self) -> str | None:
        parts = self._parts
        if parts.session.is_closed():
            return "the Zenoh session is closed."
        if not connected(parts.session, parts.link):
            return f"the connection to {' '.join(parts.link.connect)} is lost; it is tried again."
        return parts.fleet.loop.problem or parts.fleet.reader.problem

    def _workers_problem(self) -> str | None:
        parts = self._parts
        states = parts.fleet.states()
        silent = [
            f"worker {name} has not answered for {silent_s:.0f} s."
            for name, (_, silent_s) in states.items()
            if silent_s
        ]
        ended = None if parts.children is None else parts.children.problem
        found = [_NOBODY] if not states and ended is None else [] if ended is None else [ended]
        return " ".join([*found, *silent]) or None
