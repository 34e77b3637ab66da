"""Jobs that diagnose uploaded flights: queue, process, results, all bounded; the live process stays out of it."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from cli_flights import ROOT, demo_block

from wingwatch.aircraft import Aircraft, load_aircraft, parse_aircraft
from wingwatch.api import DiagnosisState, DiagnosisView, QueueFullError
from wingwatch.service.diagnosis_jobs import DiagnosisJobs, JobLimits
from wingwatch.telemetry import SampleBlock, write_flight

PATIENCE_S = 60.0
MAP = "format = 1\n[channels]\n"

# Its flight says what it does: it stands for the process that does the work.
WORKER = """
import json, os, sys, time
from pathlib import Path
folder = Path(sys.argv[1])
word = (folder / "flight").read_text()
print("no json", flush=True)
print(json.dumps({"doing": "trying", "progress": 0.5}), flush=True)
if word == "wait":
    time.sleep(60)
if word == "refuse":
    print(json.dumps({"problem": "the flight is too short"}), flush=True)
    sys.exit(2)
if word == "die":
    os.kill(os.getpid(), 9)
if word == "forget":
    sys.exit(0)
(folder / "report.html").write_text("<p>report</p>")
(folder / "result.json").write_text(json.dumps({"threads": os.environ["NUMBA_NUM_THREADS"]}))
"""

# The real process, with numerics that answer at once.
REAL = """
import sys
from pathlib import Path
from wingwatch import diagnosis
from diagnosis_examples import FOUND
import dataclasses, os
def diagnose(flight, aircraft, *, kinds, validate, validate_kinds, source, progress):
    progress("looking", 0.25)
    print("a library's chatter")
    if len(flight) < 50:
        raise diagnosis.DiagnosisError(f"{source}: {len(flight)} samples are too few")
    return dataclasses.replace(FOUND, source=source, notes=(str(os.nice(0)), aircraft.name))
diagnosis.diagnose = diagnose
from wingwatch.service.diagnosis_worker import main
sys.exit(main(Path(sys.argv[1])))
"""


def library(name: str) -> Aircraft:
    return load_aircraft(name)


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def submit(jobs: DiagnosisJobs, content: bytes, file: str = "flight") -> str:
    upload = jobs.open("aerosonde", MAP, file)
    upload.write(content)
    view = upload.submit()
    upload.discard()  # as the door does, whatever happened
    return view.id


def find(jobs: DiagnosisJobs, name: str) -> DiagnosisView:
    (view,) = [view for view in jobs.diagnoses() if view.id == name]
    return view


def ended(jobs: DiagnosisJobs, name: str) -> DiagnosisView:
    until(lambda: find(jobs, name).state not in (DiagnosisState.QUEUED, DiagnosisState.RUNNING))
    return find(jobs, name)


@pytest.fixture
def jobs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Generator[DiagnosisJobs]:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    limits = JobLimits(waiting=2, kept=2, longest_s=20.0)
    with DiagnosisJobs(library, limits, (sys.executable, "-c", WORKER)) as running:
        yield running
    assert list(tmp_path.iterdir()) == []


def test_a_job_is_done_with_one_thread_and_gives_result_and_report(jobs: DiagnosisJobs) -> None:
    view = ended(jobs, submit(jobs, b"work", "flight 7.csv"))
    assert (view.state, view.progress, view.problem) == (DiagnosisState.DONE, 1.0, "")
    assert (view.file, view.aircraft, view.result) == ("flight 7.csv", "aerosonde", {"threads": "1"})
    assert jobs.report(view.id) == b"<p>report</p>"


@pytest.mark.parametrize(
    ("word", "said"),
    [(b"refuse", "the flight is too short"), (b"die", "without an answer"), (b"forget", "internal error")],
)
def test_a_job_that_fails_says_why_and_the_next_one_runs(jobs: DiagnosisJobs, word: bytes, said: str) -> None:
    view = ended(jobs, submit(jobs, word))
    assert view.state is DiagnosisState.FAILED
    assert said in view.problem
    assert jobs.report(view.id) is None
    assert ended(jobs, submit(jobs, b"work")).state is DiagnosisState.DONE


def test_the_queue_is_bounded_uploads_included(jobs: DiagnosisJobs) -> None:
    running = submit(jobs, b"wait")
    until(lambda: find(jobs, running).doing == "trying")
    waiting = submit(jobs, b"work")
    assert find(jobs, waiting).ahead == 1
    upload = jobs.open("aerosonde", "", "flight")
    with pytest.raises(QueueFullError, match="2 flights wait already, the limit"):
        jobs.open("aerosonde", "", "flight")
    upload.discard()
    upload.discard()
    last = submit(jobs, b"work")
    with pytest.raises(QueueFullError):
        jobs.open("aerosonde", "", "flight")
    assert jobs.remove(running)
    assert find(jobs, running).state is DiagnosisState.CANCELLED
    assert ended(jobs, last).state is DiagnosisState.DONE


def test_one_that_waits_can_be_cancelled_and_one_that_ended_forgotten(jobs: DiagnosisJobs) -> None:
    running, waiting = submit(jobs, b"wait"), submit(jobs, b"work")
    assert jobs.remove(waiting)
    assert find(jobs, waiting).state is DiagnosisState.CANCELLED
    assert jobs.remove(waiting)
    assert not jobs.remove(waiting)
    assert jobs.remove(running)
    assert jobs.remove(running)
    assert jobs.diagnoses() == []


def test_results_are_bounded_in_number(jobs: DiagnosisJobs) -> None:
    done = []
    for _ in range(4):
        done.append(submit(jobs, b"work"))
        ended(jobs, done[-1])
    assert [view.id for view in jobs.diagnoses()] == done[:1:-1]


def test_results_are_bounded_in_age_and_jobs_in_time(tmp_path: Path) -> None:
    now = [0.0]
    limits = JobLimits(kept_s=100.0, longest_s=0.5)
    with DiagnosisJobs(library, limits, (sys.executable, "-c", WORKER), clock=lambda: now[0]) as jobs:
        view = ended(jobs, submit(jobs, b"wait"))
        assert view.state is DiagnosisState.FAILED
        assert "longer than" in view.problem
        now[0] = 99.0
        assert len(jobs.diagnoses()) == 1
        now[0] = 101.0
        assert jobs.diagnoses() == []


@pytest.mark.parametrize(
    ("aircraft", "channel_map", "said"),
    [("zeppelin", "", "zeppelin"), ("aerosonde", "format = 7", "format"), ("aerosonde", "[", "TOML")],
)
def test_what_cannot_be_used_is_refused_before_the_flight_comes(
    jobs: DiagnosisJobs, aircraft: str, channel_map: str, said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        jobs.open(aircraft, channel_map, "flight")


def test_the_end_of_the_service_ends_a_job_at_once() -> None:
    with DiagnosisJobs(library, command=(sys.executable, "-c", WORKER)) as jobs:
        name = submit(jobs, b"wait")
        until(lambda: find(jobs, name).doing == "trying")
        before = time.monotonic()
    assert time.monotonic() - before < 1.5
    with pytest.raises(QueueFullError, match="stopping"):
        jobs.open("aerosonde", "", "flight")


@pytest.fixture
def real(monkeypatch: pytest.MonkeyPatch) -> Generator[DiagnosisJobs]:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    with DiagnosisJobs(library, command=(sys.executable, "-c", REAL)) as running:
        yield running


def test_the_process_diagnoses_at_the_lowest_priority(real: DiagnosisJobs, tmp_path: Path) -> None:
    flight = tmp_path / "flight.parquet"
    write_flight(SampleBlock(demo_block("healthy", 10.0).values[:200]), flight)
    view = ended(real, submit(real, flight.read_bytes(), "flight <7>"))
    assert (view.state, view.problem) == (DiagnosisState.DONE, "")
    assert view.result is not None
    assert (view.result["source"], view.result["notes"]) == ("flight <7>", ["19", "aerosonde"])
    model = Aircraft.model_validate(view.result["model"])
    assert parse_aircraft(b'format = 1\nname = "aerosonde"', "x").name == model.name
    page = real.report(view.id)
    assert page is not None
    assert page.startswith(b"<!doctype html>")


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"no table at all", "flight 7: "), (None, "flight 7: 20 samples are too few")],
)
def test_a_flight_that_cannot_be_diagnosed_is_told_by_its_own_name(
    real: DiagnosisJobs, tmp_path: Path, content: bytes | None, said: str
) -> None:
    if content is None:
        flight = tmp_path / "flight.parquet"
        write_flight(SampleBlock(demo_block("healthy", 10.0).values[:20]), flight)
        content = flight.read_bytes()
    view = ended(real, submit(real, content, "flight 7"))
    assert view.state is DiagnosisState.FAILED
    assert view.problem.startswith(said)
    assert "wingwatch-diagnoses" not in view.problem


def test_the_process_ends_when_the_service_is_gone(tmp_path: Path) -> None:
    """Its standard input ends with us, whatever ended us."""
    (tmp_path / "request.json").write_text('{"file": "flight"}')
    os.mkfifo(tmp_path / "flight")  # which it would read for ever
    (tmp_path / "aircraft.toml").write_text((ROOT / "aircraft" / "library" / "aerosonde.toml").read_text())
    command = [sys.executable, "-m", "wingwatch.service.diagnosis_worker", str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 1


def test_the_service_itself_loads_neither_diagnosis_nor_simulation() -> None:
    program = (
        "import sys, wingwatch.service.service; "
        "print([m for m in sys.modules if m.startswith(('wingwatch.diagnosis', 'wingwatch.simulation'))])"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"
