"""Flights diagnosed one after another, each in a process of its own; the service's part of it.

Uploaded flights and alerts have a lane each: an alert does not wait for a flight that takes minutes.
The queue, the results and their age are bounded. Everything lies in a temporary folder that ends with the service.
"""

import json
import logging
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, Self
from uuid import uuid4

from wingwatch.aircraft import Aircraft, aircraft_toml
from wingwatch.api import DiagnosisState, DiagnosisView, QueueFullError
from wingwatch.operations.diagnosis_change import ChangeRequest
from wingwatch.operations.diagnosis_files import AIRCRAFT, FLIGHT, MAP, REPORT, REQUEST, RESULT
from wingwatch.service.diagnosis_process import DiagnosisProcess
from wingwatch.service.loops import Loop
from wingwatch.telemetry.maps import parse_map

__all__ = ["DiagnosisJobs", "JobLimits", "Lane"]

_LOG = logging.getLogger(__name__)
_COMMAND = (sys.executable, "-m", "wingwatch.service.diagnosis_worker")
_LOOK_S = 30.0
_JOIN_S = 2.0
_OPEN = (DiagnosisState.QUEUED, DiagnosisState.RUNNING)

_Ended = Callable[[DiagnosisView], None]


class Lane(StrEnum):
    """Jobs that run one after another."""

    UPLOADS = "uploads"
    ALERTS = "alerts"


@dataclass(frozen=True, slots=True)
class JobLimits:
    """How much may be going on.

    Attributes:
        waiting: flights that wait or come in.
        kept: diagnoses of each lane that have ended.
        kept_s: for how long those are kept.
        longest_s: of one diagnosis of an uploaded flight.
        alerts_waiting: alerts that wait.
        longest_alert_s: of one diagnosis of an alert.
    """

    waiting: int = 4
    kept: int = 16
    kept_s: float = 86_400.0
    longest_s: float = 3600.0
    alerts_waiting: int = 8
    longest_alert_s: float = 120.0


@dataclass(slots=True)
class _Job:
    """One diagnosis; its fields change under the lock."""

    id: str
    folder: Path
    aircraft: str
    file: str
    state: DiagnosisState = DiagnosisState.QUEUED
    doing: str = "waiting"
    progress: float = 0.0
    problem: str = ""
    result: dict[str, Any] | None = field(default=None, repr=False)
    ended_s: float = 0.0
    lane: Lane = Lane.UPLOADS
    ended: _Ended | None = field(default=None, repr=False)


class DiagnosisJobs:
    """Implements the door's ``DiagnosisPort``; use it in a ``with`` statement.

    Args:
        aircraft: by its name; ValueError with one sentence where there is none.
        limits: of queue, results and time.
        command: of a job's process, to which its folder is appended.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        aircraft: Callable[[str], Aircraft],
        limits: JobLimits | None = None,
        command: Sequence[str] = _COMMAND,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._aircraft = aircraft
        self._limits = limits or JobLimits()
        self._command = tuple(command)
        self._clock = clock
        self._jobs: dict[str, _Job] = {}  # in the order of their submission
        self._incoming = 0
        self._changed = threading.Condition()
        self._processes: dict[Lane, DiagnosisProcess] = {}
        self._ending = False
        self._folder = Path()
        self.loop = Loop(
            "wingwatch-diagnoses", "the loop that runs diagnoses", partial(self._run, Lane.UPLOADS)
        )
        self.alert_loop = Loop(
            "wingwatch-alert-diagnoses", "the loop that diagnoses alerts", partial(self._run, Lane.ALERTS)
        )

    def __enter__(self) -> Self:
        self._folder = Path(tempfile.mkdtemp(prefix="wingwatch-diagnoses-"))
        self.loop.start()
        self.alert_loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._ending = True
            for process in self._processes.values():
                process.end()
            self._changed.notify_all()
        self.loop.join(_JOIN_S)
        self.alert_loop.join(_JOIN_S)
        shutil.rmtree(self._folder, ignore_errors=True)

    @property
    def waiting(self) -> int:
        """Flights that wait or come in."""
        with self._changed:
            return self._incoming + self._queued(Lane.UPLOADS)

    @property
    def alerts_waiting(self) -> int:
        """Alerts that wait."""
        with self._changed:
            return self._queued(Lane.ALERTS)

    def _queued(self, lane: Lane) -> int:
        return sum(j.lane is lane and j.state is DiagnosisState.QUEUED for j in self._jobs.values())

    # -- what the door calls -------------------------------------------------------------------------

    def open(self, aircraft: str, channel_map: str, file: str) -> "_Upload":
        """Reserve a place in the queue; see ``DiagnosisPort``."""
        known = self._aircraft(aircraft)
        if channel_map:
            parse_map(channel_map)
        with self._changed:
            waiting = self.waiting
            if self._ending or waiting >= self._limits.waiting:
                why = (
                    "the service is stopping"
                    if self._ending
                    else f"{waiting} flights wait already, the limit"
                )
                raise QueueFullError(f"No further flight is taken: {why}; try again later")
            self._incoming += 1
        try:
            job = self._prepared(known, channel_map, file)
            return _Upload(self, job)
        except BaseException:
            self._give_back()
            raise

    def diagnoses(self) -> Sequence[DiagnosisView]:
        """All that are kept, newest first."""
        with self._changed:
            self._forget_old()
            ahead, views = dict.fromkeys(Lane, 0), []
            for job in self._jobs.values():
                views.append(_view(job, ahead[job.lane]))
                ahead[job.lane] += job.state in _OPEN
            return views[::-1]

    def report(self, diagnosis_id: str) -> bytes | None:
        """The HTML report of one that is done."""
        with self._changed:
            job = self._jobs.get(diagnosis_id)
            if job is None or job.state is not DiagnosisState.DONE:
                return None
        try:
            return (job.folder / REPORT).read_bytes()
        except FileNotFoundError:  # forgotten in this very moment
            return None

    def remove(self, diagnosis_id: str) -> bool:
        """Cancel one that waits or runs, forget one that has ended."""
        with self._changed:
            job = self._jobs.get(diagnosis_id)
            if job is None:
                return False
            if job.state is DiagnosisState.RUNNING and job.lane in self._processes:
                self._processes[job.lane].end()
            if job.state in _OPEN:
                self._end(job, DiagnosisState.CANCELLED)
            else:
                self._forget(job)
            return True

    # -- what alerts call ----------------------------------------------------------------------------

    def diagnose(self, request: ChangeRequest, ended: _Ended) -> DiagnosisView:
        """Queue the diagnosis of an alert.

        Args:
            request: its vehicle's last minutes.
            ended: called in the thread that runs them when it is done, failed or cancelled while it ran.

        Raises:
            QueueFullError: as many wait as may, or the service is stopping.
        """
        with self._changed:
            if self._ending or self._queued(Lane.ALERTS) >= self._limits.alerts_waiting:
                raise QueueFullError(f"{self._limits.alerts_waiting} alerts wait for a diagnosis, the limit")
        number = uuid4().hex
        folder = self._folder / number
        folder.mkdir()
        request.write(folder)
        return self._queue(
            _Job(number, folder, request.aircraft.name, request.title, lane=Lane.ALERTS, ended=ended)
        )

    # -- what an upload calls ------------------------------------------------------------------------

    def _prepared(self, aircraft: Aircraft, channel_map: str, file: str) -> _Job:
        """A job's folder with all but the flight."""
        number = uuid4().hex
        folder = self._folder / number
        folder.mkdir()
        (folder / AIRCRAFT).write_text(aircraft_toml(aircraft), encoding="utf-8")
        (folder / REQUEST).write_text(json.dumps({"file": file}))
        if channel_map:
            (folder / MAP).write_text(channel_map, encoding="utf-8")
        return _Job(number, folder, aircraft.name, file)

    def _queue(self, job: _Job) -> DiagnosisView:
        with self._changed:
            self._jobs[job.id] = job
            self._changed.notify_all()
            return _view(job, sum(j.lane is job.lane and j.state in _OPEN for j in self._jobs.values()) - 1)

    def _give_back(self) -> None:
        with self._changed:
            self._incoming -= 1

    # -- the thread that runs them -------------------------------------------------------------------

    def _run(self, lane: Lane) -> None:
        while (job := self._await_next(lane)) is not None:
            try:
                self._follow(job)
            except Exception as error:  # one flight's fault must not end the queue
                _LOG.exception("a diagnosis led to a fault of the program")
                with self._changed:
                    job.problem = f"internal error: {type(error).__name__}"
                    self._end(job, DiagnosisState.FAILED)
            if job.ended is not None and not self._ending:
                self._tell(job, job.ended)

    def _tell(self, job: _Job, ended: _Ended) -> None:
        try:
            ended(_view(job, 0))
        except Exception:  # what becomes of one answer must not end the queue
            _LOG.exception("what a diagnosis found led to a fault of the program")

    def _await_next(self, lane: Lane) -> _Job | None:
        """The next job of a lane, now running; None at the end."""
        with self._changed:
            while not self._ending:
                waiting = (j for j in self._jobs.values() if j.lane is lane)
                job = next((j for j in waiting if j.state is DiagnosisState.QUEUED), None)
                if job is not None:
                    job.state, job.doing = DiagnosisState.RUNNING, "starting"
                    return job
                self._changed.wait(_LOOK_S)
                self._forget_old()
        return None

    def _follow(self, job: _Job) -> None:
        """Take what a job's process tells until it ends."""
        with self._changed:
            if job.state is not DiagnosisState.RUNNING or self._ending:  # cancelled before it began
                return
            command = [*self._command, str(job.folder)]
            limits = self._limits
            longest_s = limits.longest_s if job.lane is Lane.UPLOADS else limits.longest_alert_s
            process = self._processes[job.lane] = DiagnosisProcess(command, job.folder, longest_s)
        for message in process.lines():
            with self._changed:
                job.doing = str(message.get("doing", job.doing))
                job.progress = float(message.get("progress", job.progress))
                job.problem = str(message.get("problem", job.problem))
        problem = process.problem()
        with self._changed:
            self._processes.pop(job.lane, None)
            if job.state is not DiagnosisState.RUNNING:  # cancelled
                return
            if problem is None:
                job.result = json.loads((job.folder / RESULT).read_text())
                job.progress, job.doing = 1.0, "done"
            job.problem = "" if problem is None else job.problem or problem
            self._end(job, DiagnosisState.DONE if problem is None else DiagnosisState.FAILED)

    def _end(self, job: _Job, state: DiagnosisState) -> None:
        job.state, job.ended_s = state, self._clock()
        (job.folder / FLIGHT).unlink(missing_ok=True)
        self._forget_old()

    def _forget_old(self) -> None:
        oldest_s = self._clock() - self._limits.kept_s
        for lane in Lane:
            ended = [j for j in self._jobs.values() if j.lane is lane and j.state not in _OPEN]
            ended.sort(key=lambda j: j.ended_s, reverse=True)
            for place, job in enumerate(ended):
                if place >= self._limits.kept or job.ended_s < oldest_s:
                    self._forget(job)

    def _forget(self, job: _Job) -> None:
        self._jobs.pop(job.id, None)
        shutil.rmtree(job.folder, ignore_errors=True)


class _Upload:
    """Implements the door's ``DiagnosisUpload``."""

    def __init__(self, jobs: DiagnosisJobs, job: _Job) -> None:
        self._jobs = jobs
        self._job = job
        self._file = (job.folder / FLIGHT).open("wb")
        self._open = True

    def write(self, content: bytes) -> None:
        """The flight file's next bytes."""
        self._file.write(content)

    def submit(self) -> DiagnosisView:
        """The flight is whole: queue it."""
        self._file.close()
        view = self._jobs._queue(self._job)
        self._open = False
        self._jobs._give_back()
        return view

    def discard(self) -> None:
        """Give the place back; nothing happens after a submit."""
        if not self._open:
            return
        self._open = False
        self._file.close()
        shutil.rmtree(self._job.folder, ignore_errors=True)
        self._jobs._give_back()


def _view(job: _Job, ahead: int) -> DiagnosisView:
    return DiagnosisView(
        job.id, job.state, job.aircraft, job.file, ahead if job.state in _OPEN else 0, job.doing, job.progress,
        job.problem, job.result,
    )  # fmt: skip
