"""A study on its way: journal, resuming, dead workers, full disks, files of other versions."""

import errno
import importlib.util
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from study_flights import InThisProcess, flown, settings, small_grid, untimed

from wingwatch.studies import StudyError, StudySettings, read_study
from wingwatch.studies import run as run_module
from wingwatch.studies.journal import settings_of
from wingwatch.studies.local_workers import LocalWorkers
from wingwatch.studies.run import Answer, Progress, Task, run_study

FLIGHTS = 6
PATIENCE_S = 250.0


@pytest.fixture(autouse=True)
def _small_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two flights a task."""
    monkeypatch.setattr(run_module, "TASK_FLIGHT_S", 80.0)


@pytest.fixture
def study(tmp_path: Path) -> StudySettings:
    return settings(small_grid(tmp_path), FLIGHTS, first_seed=10)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    """The rows of the study above, flown one after another."""
    folder = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_module, "TASK_FLIGHT_S", 80.0)
        out = folder / "whole.parquet"
        flown(settings(small_grid(folder), FLIGHTS, first_seed=10), out, InThisProcess())
    return rows_of(out)


def rows_of(out: Path) -> list[dict[str, str]]:
    rows = read_study(out).table.to_pylist()
    return untimed([{k: v for k, v in row.items() if k != "command"} for row in rows])


def test_a_study_that_was_interrupted_goes_on_and_repeats_nothing(
    tmp_path: Path, study: StudySettings, undisturbed: list[dict[str, str]]
) -> None:
    out = tmp_path / "study.parquet"
    first = flown(study, out, InThisProcess(most=1))
    assert (first.done, first.flights, out.exists()) == (2, FLIGHTS, False)
    assert settings_of(out) == study
    with pytest.raises(StudyError, match="go on with it by --resume"):
        flown(study, out, InThisProcess())
    rest = InThisProcess()
    progress = flown(study, out, rest, resume=True)
    assert rest.flown == [1, 2]
    assert (progress.done, progress.kept, progress.left_s) == (FLIGHTS, 2, 0.0)
    assert rows_of(out) == undisturbed
    assert read_study(out).settings == study
    assert [row["seed"] for row in rows_of(out)] == [str(seed) for seed in range(10, 16)]
    assert not (tmp_path / "study.parquet.parts").exists()
    with pytest.raises(StudyError, match="is there already"):
        flown(study, out, InThisProcess(), resume=True)


def test_only_the_same_study_is_resumed(tmp_path: Path, study: StudySettings) -> None:
    out = tmp_path / "study.parquet"
    flown(study, out, InThisProcess(most=0))
    other = settings(study.grid.model_copy(update={"turbulence": {"light": 1.0}}), FLIGHTS, first_seed=10)
    with pytest.raises(StudyError, match="has another grid"):
        flown(other, out, InThisProcess(), resume=True)
    with pytest.raises(StudyError, match="has another number of flights"):
        flown(settings(study.grid, 4, first_seed=10), out, InThisProcess(), resume=True)


class Failing(InThisProcess):
    """Its second task comes back without rows."""

    def answers(self, tasks: Sequence[Task], end: threading.Event) -> Iterator[Answer]:
        for task, answer in zip(tasks, super().answers(tasks, end), strict=True):
            yield Answer(task, (), problem="the worker fell over") if task.index == 1 else answer


def test_a_task_that_fails_is_reported_with_its_seeds(
    tmp_path: Path, study: StudySettings, undisturbed: list[dict[str, str]]
) -> None:
    out = tmp_path / "study.parquet"
    progress = flown(study, out, Failing())
    assert progress.failed == 2
    rows = rows_of(out)
    assert [row["failed"] for row in rows] == ["''"] * 2 + ["'the worker fell over'"] * 2 + ["''"] * 2
    assert [rows[i] for i in (0, 1, 4, 5)] == [undisturbed[i] for i in (0, 1, 4, 5)]
    assert rows[2]["severity"] == undisturbed[2]["severity"]


def test_a_full_disk_is_one_sentence_and_loses_nothing(
    tmp_path: Path, study: StudySettings, undisturbed: list[dict[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "study.parquet"
    write = pq.write_table
    written = 0

    def full(*arguments: Any) -> None:
        nonlocal written
        written += 1
        if written == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(*arguments)

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(StudyError, match=r"no space left on device.*--resume"):
        flown(study, out, InThisProcess())
    assert sorted(p.name for p in (tmp_path / "study.parquet.parts").iterdir()) == [
        "00000000.parquet",
        "study.json",
    ]
    rest = InThisProcess()
    flown(study, out, rest, resume=True)
    assert rest.flown == [1, 2]
    assert rows_of(out) == undisturbed


def test_files_of_other_versions_and_other_tables_are_refused(tmp_path: Path, study: StudySettings) -> None:
    path = tmp_path / "old.parquet"
    old = study.as_json().replace('"schema": 3', '"schema": 7')
    pq.write_table(pa.table({"a": [1]}).replace_schema_metadata({"wingwatch.study": old}), path)
    with pytest.raises(StudyError, match="has version 7 of the study table"):
        read_study(path)
    pq.write_table(pa.table({"a": [1]}), path)
    with pytest.raises(StudyError, match="is no table of a wingwatch study"):
        read_study(path)
    path.write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(StudyError, match="is no Parquet file"):
        read_study(path)


def test_a_worker_of_another_version_is_refused(
    tmp_path: Path, study: StudySettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_module, "code_version", lambda: "0.0.0+other")
    with pytest.raises(StudyError, match="install the same on all"):
        flown(study, tmp_path / "study.parquet", InThisProcess())


@pytest.mark.slow
def test_rows_are_the_same_though_one_of_two_workers_is_killed(
    tmp_path: Path, study: StudySettings, undisturbed: list[dict[str, str]]
) -> None:
    out = tmp_path / "study.parquet"
    killed: list[int] = []

    def kill_one(progress: Progress) -> None:
        if progress.done and not killed:
            worker = multiprocessing.active_children()[0].pid
            assert worker is not None
            os.kill(worker, signal.SIGKILL)
            killed.append(worker)

    progress = run_study(study, out, LocalWorkers(2), resume=False, end=threading.Event(), show=kill_one)
    assert killed
    assert (progress.done, progress.failed) == (FLIGHTS, 0)
    assert rows_of(out) == undisturbed


def _client(study: StudySettings, out: Path) -> None:
    run_module.TASK_FLIGHT_S = 80.0
    flown(study, out, InThisProcess())


@pytest.mark.slow
def test_a_client_that_is_killed_has_lost_no_finished_task_and_goes_on(
    tmp_path: Path, study: StudySettings, undisturbed: list[dict[str, str]]
) -> None:
    out = tmp_path / "study.parquet"
    client = multiprocessing.get_context("spawn").Process(target=_client, args=(study, out))
    client.start()
    first = tmp_path / "study.parquet.parts" / "00000000.parquet"
    deadline = time.monotonic() + PATIENCE_S
    while not first.exists():
        assert client.is_alive()
        assert time.monotonic() < deadline
        time.sleep(0.002)
    client.kill()
    client.join()
    assert client.exitcode == -signal.SIGKILL
    assert not out.exists()
    rest = InThisProcess()
    progress = flown(study, out, rest, resume=True)
    assert 0 not in rest.flown
    assert progress.kept == FLIGHTS - 2 * len(rest.flown)
    assert rows_of(out) == undisturbed
    assert list(tmp_path.glob("*.parts")) == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of Dask's own threads and sockets, whose worker is killed under them
@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="Dask is not installed (extra dask)"
)
def test_rows_are_the_same_on_a_cluster_of_which_a_worker_is_killed(
    tmp_path: Path, study: StudySettings, undisturbed: list[dict[str, str]]
) -> None:
    import distributed

    from wingwatch.studies.dask_workers import DaskWorkers

    out = tmp_path / "study.parquet"
    killed: list[int] = []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:

        def kill_one(progress: Progress) -> None:
            if progress.done and not killed:
                worker = cluster.workers[0].process.pid
                os.kill(worker, signal.SIGKILL)
                killed.append(worker)

        progress = run_study(
            study,
            out,
            DaskWorkers(cluster.scheduler_address),
            resume=False,
            end=threading.Event(),
            show=kill_one,
        )
    assert killed
    assert (progress.done, progress.failed) == (FLIGHTS, 0)
    assert rows_of(out) == undisturbed


def test_no_scheduler_is_one_sentence() -> None:
    from wingwatch.studies.dask_workers import DaskWorkers

    said = (
        "no Dask scheduler answers"
        if importlib.util.find_spec("distributed")
        else "Dask, which is not installed"
    )
    with pytest.raises(StudyError, match=said):
        DaskWorkers("nowhere")
