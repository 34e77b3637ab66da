"""Checkpoints as files: what is written is read, what is damaged is said, and a kill costs nothing."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import JudgeConfig, SavedVehicle, VehicleMemory
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.vehicle.checkpoint import settings_of
from wingwatch.service.checkpoints import CheckpointFolder
from wingwatch.service.settings import ServeSettings
from wingwatch.telemetry import CHANNELS, AircraftMessage, SequenceTracker

GIVEN = ("time_s", "airspeed_true_m_s", "altitude_m", "angle_of_attack_rad", "pitch_rate_rad_s",
         "specific_force_z_m_s2", "elevator_rad")  # fmt: skip
PATIENCE_S = 60.0


def saved(vehicle: str, times: int = 0) -> SavedVehicle:
    """A vehicle without a sample; ``times`` tells states apart."""
    message = AircraftMessage(aircraft="aerosonde")
    maker = MonitorMaker(lambda: "1", JudgeConfig())
    monitor = maker.make("f", vehicle, load_aircraft("aerosonde"), message, GIVEN, VehicleMemory())
    return SavedVehicle(
        fleet="f", vehicle=vehicle, settings=settings_of(monitor, GIVEN), silent_s=1.0, message=message,
        watched_as=message, given=GIVEN, late=False, recalled=True, counts={"faults": times},
        arrivals=SequenceTracker().state, history_s=float("-inf"), waiting=np.empty((0, len(CHANNELS))),
        monitor=monitor.saved(),
    )  # fmt: skip


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def loaded(folder: Path, now_s: float = 0.0) -> dict[str, SavedVehicle]:
    return {one.vehicle: one for one in CheckpointFolder(folder, lambda: now_s).load()}


def test_the_newest_of_each_vehicle_is_kept_and_says_how_long_ago(tmp_path: Path) -> None:
    with CheckpointFolder(tmp_path / "c", lambda: 100.0) as folder:
        assert list(folder.load()) == []
        for times in range(3):
            folder.keep(saved("a", times), urgent=False)
        folder.keep(saved("b"), urgent=True)
    found = loaded(tmp_path / "c", 160.0)
    assert {name: one.silent_s for name, one in found.items()} == {"a": 61.0, "b": 61.0}
    assert found["a"].counts == {"faults": 2}
    assert loaded(tmp_path / "c", 50.0)["a"].silent_s == 1.0  # a wall clock that was set back
    assert len(list((tmp_path / "c").iterdir())) == 2
    assert (tmp_path / "c").stat().st_mode & 0o077 == 0


def test_damaged_cut_and_foreign_files_cost_one_sentence_each_and_nothing_else(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = CheckpointFolder(tmp_path, lambda: 0.0)
    for name in "abcd":
        folder.write(saved(name))
    paths = sorted(tmp_path.iterdir())
    data = [path.read_bytes() for path in paths]
    paths[0].write_bytes(data[0][:-100])
    paths[1].write_bytes(data[1].replace(b"wingwatch-checkpoint 3", b"wingwatch-checkpoint 9", 1))
    broken = bytearray(data[2])
    broken[len(broken) // 2] ^= 1
    paths[2].write_bytes(broken)
    (tmp_path / "half.unfinished").write_bytes(data[3][:50])
    again = CheckpointFolder(tmp_path, lambda: 0.0)
    assert len(again.load()) == 1
    assert again.counts["refused"] == 3
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 3
    assert all(text.endswith("; its vehicle starts anew") for text in said)
    assert sum("its checksum does not hold" in text for text in said) == 2
    assert sum("keeps its state in another form" in text for text in said) == 1
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [data[3]]
    assert again.counts["refused"] == 3


def test_the_number_of_files_is_bounded(tmp_path: Path) -> None:
    folder = CheckpointFolder(tmp_path, lambda: 0.0, most=3)
    for name in "abcad":
        folder.write(saved(name))
    assert set(loaded(tmp_path)) == {"c", "a", "d"}
    assert {one.vehicle for one in CheckpointFolder(tmp_path, lambda: 0.0, most=2).load()} == {"a", "d"}


def test_a_disk_that_takes_nothing_is_counted_said_once_and_heals(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = CheckpointFolder(tmp_path, lambda: 0.0)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with folder:
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", full)
            for _ in range(3):
                folder.write(saved("a"))
            assert folder.problem is not None
            assert "No space left on device" in folder.problem
        assert (folder.counts["failed"], folder.counts["written"]) == (3, 0)
        assert len(caplog.records) == 1
        folder.write(saved("a"))
        assert folder.problem is None
    assert list(loaded(tmp_path)) == ["a"]
    assert not folder.loop.alive


def test_little_waits_but_news_of_an_alert_always_does(tmp_path: Path) -> None:
    folder = CheckpointFolder(tmp_path, lambda: 0.0)  # its thread does not run yet
    for name in "abcd":
        assert folder.has_room()
        folder.keep(saved(name), urgent=False)
    assert not folder.has_room()
    folder.keep(saved("e"), urgent=True)
    with folder:
        until(folder.has_room)
    assert set(loaded(tmp_path)) == set("abcde")


def test_killed_while_writing_leaves_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    """Each writer is forked from a process that has imported everything, and ends by itself after a minute."""
    program = (
        "import os, signal, sys; sys.path.insert(0, sys.argv[2])\n"
        "from pathlib import Path\n"
        "from test_cli_checkpoints import CheckpointFolder, saved\n"
        "from dataclasses import replace\n"
        "folder, state, k = CheckpointFolder(Path(sys.argv[1]), lambda: 0.0), saved('a'), 0\n"
        "for _ in sys.stdin:\n"
        "    writer = os.fork()\n"
        "    if not writer: signal.alarm(60)\n"
        "    while not writer:\n"
        "        folder.write(replace(state, counts={'faults': k})); k += 1\n"
        "        if k == 1: print(os.getpid(), flush=True)\n"
        "    print(os.waitstatus_to_exitcode(os.waitpid(writer, 0)[1]), flush=True)\n"
    )
    rng = np.random.default_rng(4)
    command = [sys.executable, "-c", program, str(tmp_path), str(Path(__file__).parent)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for _ in range(5):
            process.stdin.write("one more\n")
            process.stdin.flush()
            writer = int(process.stdout.readline())
            time.sleep(float(rng.uniform(0.0, 0.1)))
            os.kill(writer, signal.SIGKILL)
            assert int(process.stdout.readline()) == -signal.SIGKILL
            folder = CheckpointFolder(tmp_path, lambda: 0.0)
            assert len(folder.load()) == 1
            assert folder.counts["refused"] == 0
            assert len(list(tmp_path.iterdir())) == 1


def test_states_lie_beside_their_own_database(tmp_path: Path) -> None:
    plain = ServeSettings(data=tmp_path)
    assert plain.checkpoints == tmp_path / "wingwatch.db.checkpoints"
    urls = [
        f"postgresql://{who}@db:5432/{name}" for who, name in (("a:x", "one"), ("b", "one"), ("a:x", "two"))
    ]
    first, same, other = (ServeSettings(data=tmp_path, database=url).checkpoints for url in urls)
    assert first == same != other
    assert first.parent == tmp_path
