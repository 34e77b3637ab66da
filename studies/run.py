"""A study from its first task to its file.

A task is a fixed run of seeds: which flights are simulated together follows from the grid alone, so rows are the same
to the bit whatever flew them, in whatever order, and however often a worker or the client was killed.
"""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from wingwatch.aircraft import Aircraft
from wingwatch.studies.flight import FlightMaker
from wingwatch.studies.flight_rows import unflown_row
from wingwatch.studies.grid import Grid, Kind, StudyError
from wingwatch.studies.journal import Journal
from wingwatch.studies.plan import draw_plan
from wingwatch.studies.table import StudySettings
from wingwatch.studies.versions import code_version

__all__ = ["Answer", "Progress", "Task", "Workers", "fly_task", "run_study"]

TASK_FLIGHT_S = 4800.0
"""Flight time of a task: some 15 s of one core, which is what a killed worker loses."""


@dataclass(frozen=True, slots=True)
class Task:
    """Flights that one worker flies together."""

    index: int
    kind: Kind
    grid: Grid
    aircraft: Mapping[str, Aircraft]
    first_seed: int
    flights: int
    command: str


@dataclass(frozen=True, slots=True)
class Answer:
    """A task's rows, or why there are none."""

    task: Task
    rows: Sequence[Mapping[str, Any]]
    code_version: str = ""
    problem: str = ""


class Workers(Protocol):
    """Who flies tasks: local processes, or a cluster."""

    def answers(self, tasks: Sequence[Task], end: threading.Event) -> Iterator[Answer]:
        """Every task's answer, in the order in which they come, until ``end`` is set."""
        ...


@dataclass(slots=True)
class Progress:
    """How far a study is, and what it has found so far.

    Attributes:
        flights, done: of the whole study; kept: done in an earlier run.
        faulty, noticed: flights with an effect, and how many of them led to an alert.
        healthy_h, false_alerts: flight time without anything wrong, and alerts in it.
        failed: flights that could not be flown.
        elapsed_s: of this run.
    """

    flights: int
    done: int = 0
    kept: int = 0
    faulty: int = 0
    noticed: int = 0
    healthy_h: float = 0.0
    false_alerts: int = 0
    failed: int = 0
    elapsed_s: float = 0.0

    def count(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Take in finished rows."""
        for row in rows:
            self.done += 1
            self.failed += row["failed"] != ""
            self.faulty += row["effect"] != "" and row["failed"] == ""
            self.noticed += bool(row["detected"])
            self.healthy_h += row["healthy_h"]
            self.false_alerts += row["false_alerts"]

    @property
    def left_s(self) -> float | None:
        """Time until the end at the pace so far; None before the first flight."""
        flown = self.done - self.kept
        return self.elapsed_s / flown * (self.flights - self.done) if flown else None

    @property
    def text(self) -> str:
        """What has been found so far, as a clause."""
        parts = []
        if self.faulty:
            parts.append(f"{self.noticed} of {self.faulty} effects noticed")
        parts.append(f"{self.false_alerts} false alerts in {self.healthy_h:.1f} h")
        if self.failed:
            parts.append(f"{self.failed} failed")
        return ", ".join(parts)


def run_study(
    settings: StudySettings,
    out: Path,
    workers: Workers,
    *,
    resume: bool,
    end: threading.Event,
    show: Callable[[Progress], None],
) -> Progress:
    """Fly what is not flown yet, and write the study's file once all is.

    Args:
        workers: who flies.
        resume: go on with an unfinished study of the same settings.
        end: set to stop; what is finished stays in the journal.
        show: called after each task.

    Raises:
        StudyError: see ``Journal``; a full disk; a worker of another version.
    """
    journal = Journal(out, settings, resume=resume)
    tasks = _tasks(settings, out)
    progress = Progress(settings.flights)
    finished = journal.finished(len(tasks))
    for index in sorted(finished):
        progress.count(journal.rows(index))
    progress.kept = progress.done
    show(progress)
    began_s = time.monotonic()
    missing = [task for task in tasks if task.index not in finished]
    for answer in workers.answers(missing, end):
        rows = answer.rows or _failed(answer)
        if answer.rows and answer.code_version != settings.code_version:
            raise StudyError(
                f"a worker runs version {answer.code_version} of the program and this is {settings.code_version}; "
                "install the same on all, then go on with --resume"
            )
        journal.keep(answer.task.index, rows)
        progress.count(rows)
        progress.elapsed_s = time.monotonic() - began_s
        show(progress)
    if progress.done == progress.flights:
        journal.finish(len(tasks))
    return progress


def _tasks(settings: StudySettings, out: Path) -> list[Task]:
    size = max(1, round(TASK_FLIGHT_S / settings.grid.seconds))
    command = f"wingwatch study replay {out.name} --seed {{seed}}"
    return [
        Task(
            index, settings.kind, settings.grid, settings.aircraft, settings.first_seed + first,
            min(size, settings.flights - first), command,
        )
        for index, first in enumerate(range(0, settings.flights, size))
    ]  # fmt: skip


def _failed(answer: Answer) -> list[dict[str, Any]]:
    """Rows of a task that no worker brought back."""
    task = answer.task
    return [
        unflown_row(draw_plan(task.kind, task.grid, seed, task.aircraft), task.command, answer.problem)
        for seed in range(task.first_seed, task.first_seed + task.flights)
    ]


@dataclass(slots=True)
class _Kept:
    """What a worker keeps from one task to the next."""

    aircraft: Mapping[str, Aircraft] = field(default_factory=dict)
    maker: FlightMaker = field(default_factory=lambda: FlightMaker({}))


_KEPT = _Kept()


def fly_task(task: Task) -> Answer:
    """A task's rows, in a worker."""
    if _KEPT.aircraft != task.aircraft:
        _KEPT.aircraft, _KEPT.maker = task.aircraft, FlightMaker(task.aircraft)
    plans = [
        draw_plan(task.kind, task.grid, seed, task.aircraft)
        for seed in range(task.first_seed, task.first_seed + task.flights)
    ]
    return Answer(task, _KEPT.maker.rows(plans, task.command), code_version())
