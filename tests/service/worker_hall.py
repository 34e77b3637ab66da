"""A worker's side and a gateway's over a Zenoh link of their own, around any monitor."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
import zenoh
from loopback import free_endpoint

from wingwatch.api import DiagnosisView, ServiceFigures, WorkerView
from wingwatch.monitor import AlertView, FleetFigures
from wingwatch.service.workers.answering import AnsweringMonitor, AnsweringPorts, WorkerAnswers
from wingwatch.service.workers.link import WorkerLink
from wingwatch.service.workers.live import LiveWorkers
from wingwatch.service.workers.messages import WorkerState
from wingwatch.service.workers.remote_fleet import RemoteFleet
from wingwatch.telemetry import LinkSecurity, ZenohSettings, open_session
from wingwatch.telemetry.worker_keys import token_key

PATIENCE_S = 30.0


def until(condition: Callable[[], object]) -> None:
    """Wait for something that another thread brings about."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


@dataclass
class Reports:
    """Diagnoses of a worker's alerts, filled by hand."""

    views: list[DiagnosisView] = field(default_factory=list)
    pages: dict[str, bytes] = field(default_factory=dict)

    def diagnoses(self) -> Sequence[DiagnosisView]:
        return self.views

    def report(self, diagnosis_id: str) -> bytes | None:
        return self.pages.get(diagnosis_id)


@dataclass
class Said:
    """What a worker says of itself, changed by hand."""

    name: str
    counters: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    figures: Callable[[], FleetFigures] = lambda: FleetFigures({}, {}, {}, 0, 0)

    def __call__(self) -> WorkerState:
        view = WorkerView(self.name, "here", 1, 0.25, 1.0, 1)
        figures = self.figures()
        own = FleetFigures(figures.vehicles, {}, figures.counts, figures.solutions, figures.waiting)
        return WorkerState(view, own, ServiceFigures(), self.counters, {})


class Gateway:
    """A remote fleet with all around it."""

    def __init__(
        self,
        endpoint: str,
        alerts: Callable[[], Sequence[AlertView]] = list,
        security: LinkSecurity | None = None,
    ) -> None:
        self._stack = ExitStack()
        link = ZenohSettings.for_vehicle((endpoint,), security)
        session = self._stack.enter_context(open_session(link))
        self.heard: list[AlertView] = []
        live: LiveWorkers
        self.fleet = RemoteFleet(WorkerLink(session), lambda: live.names, alerts, self.heard.append)
        live = self._stack.enter_context(LiveWorkers(session, self.fleet.look_again))
        self._stack.enter_context(self.fleet)

    def close(self) -> None:
        self._stack.close()


@contextmanager
def hub() -> Iterator[tuple[zenoh.Session, str]]:
    """What workers and gateways connect to, and its endpoint."""
    endpoint = free_endpoint()
    with open_session(ZenohSettings(listen=(endpoint,))) as session:
        yield session, endpoint


@contextmanager
def worker(
    endpoint: str, monitor: AnsweringMonitor, said: Said, reports: Reports | None = None, **ports: Any
) -> Iterator[WorkerAnswers]:
    """A worker around a monitor."""
    with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
        answers = WorkerAnswers(
            session, said.name, AnsweringPorts(monitor, reports or Reports(), said, **ports)
        )
        with answers:
            token = session.liveliness().declare_token(token_key(said.name, 1.0))
            yield answers
            token.undeclare()  # type: ignore[no-untyped-call]


def plain(value: Any) -> Any:
    """A value in which it does not show whether a sequence was a list or a tuple."""
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return "NaN" if isinstance(value, float) and np.isnan(value) else value
