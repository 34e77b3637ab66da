"""Workers as processes: started again where they die, ended with whoever started them."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from worker_hall import until

from wingwatch.service.settings import ServeSettings
from wingwatch.service.workers.children import WorkerChildren, child_settings
from wingwatch.telemetry import ZenohSettings

LINK = ZenohSettings(listen=("tcp/0.0.0.0:7447",))
OBEDIENT = "import sys; sys.stdin.readline(); sys.stdin.read()"
STUBBORN = (
    f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {OBEDIENT}; import time; time.sleep(60)"
)


def children(code: str, count: int = 1) -> WorkerChildren:
    return WorkerChildren(ServeSettings(), LINK, count, (sys.executable, "-c", code))


def is_there(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_worker_that_dies_is_started_again_counted_and_named(caplog: pytest.LogCaptureFixture) -> None:
    with children(OBEDIENT, 2) as running:
        until(lambda: len(running.pids) == 2)
        before = set(running.pids)
        assert running.problem is None
        os.kill(running.pids[0], signal.SIGKILL)
        until(lambda: running.restarts == 1 and len(running.pids) == 2)
        assert len(before & set(running.pids)) == 1
        assert "(number 1) was ended by signal SIGKILL; it is started again." in (running.problem or "")
        last = running.pids
    assert "was ended by signal SIGKILL" in caplog.text
    assert not any(is_there(pid) for pid in last)


def test_a_worker_that_cannot_start_is_tried_again_later_and_later() -> None:
    with children("raise SystemExit(2)") as running:
        until(lambda: running.restarts == 1)
        assert "ended with code 2" in (running.problem or "")
        child = running._children[0]
        until(lambda: child.pause_s >= 2.0)
        assert running.restarts <= 2


def test_a_worker_that_does_not_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wingwatch.service.workers.children._END_S", 0.2)
    with children(STUBBORN) as running:
        until(lambda: running.pids)
        time.sleep(0.1)  # until it ignores the signal; where it has not, it ends by it
        pid = running.pids[0]
    assert not is_there(pid)


def test_a_worker_sees_that_whoever_started_it_was_killed(tmp_path: Path) -> None:
    starter = f"""
import sys, time
from wingwatch.service.settings import ServeSettings
from wingwatch.service.workers.children import WorkerChildren
from wingwatch.telemetry import ZenohSettings
with WorkerChildren(ServeSettings(), ZenohSettings(), 1, (sys.executable, "-c", {OBEDIENT!r})) as children:
    while not children.pids:
        time.sleep(0.01)
    print(children.pids[0], flush=True)
    time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", starter], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        assert is_there(pid)
        process.kill()
    until(lambda: not is_there(pid))


def test_a_worker_gets_the_settings_of_its_starter_and_a_place_of_its_own(tmp_path: Path) -> None:
    settings = ServeSettings(data=tmp_path, record=tmp_path / "recordings", workers=3, stale_s=7.0)
    given = child_settings(settings, LINK, 2)
    assert (given.listen, given.connect) == ((), ("tcp/127.0.0.1:7447",))
    assert (given.workers, given.record, given.stale_s) == (1, tmp_path / "recordings" / "worker-2", 7.0)
    assert given.worker_name == "w2"  # each start of it adds a name of its own
    routed = child_settings(settings, ZenohSettings.for_service((), ("tcp/router:7447",)), 1)
    assert routed.connect == ("tcp/router:7447",)
    assert ServeSettings.model_validate_json(given.model_dump_json()) == given
    assert (
        json.loads(given.model_dump_json())["notify"]
        == json.loads(ServeSettings().model_dump_json())["notify"]
    )
