"""`wingwatch serve --workers`, `worker` and `gateway` as processes: started, killed, ended."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import httpx
import pytest
from live import until
from loopback import free_endpoint

from wingwatch.cli.main import main

LONGEST_END_S = 3.0


class Running:
    """A command in a process of its own, and the line with which it says where it is."""

    def __init__(self, *arguments: object) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "wingwatch.cli.main", *map(str, arguments), "--json"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, self.process.communicate()[1]
        self.said: dict[str, Any] = json.loads(line)

    def get(self, path: str) -> Any:
        return httpx.get(f"{self.said['url']}{path}", timeout=10.0)

    def workers(self) -> list[int]:
        """Processes that have answered."""
        return [one["pid"] for one in self.get("/v1/fleet/workers").json()["items"] if one["pid"]]

    def end(self) -> tuple[int, float, str]:
        """Exit code, seconds it took, standard error."""
        began_s = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        _, err = self.process.communicate(timeout=20.0)
        return self.process.returncode, time.monotonic() - began_s, err


def is_there(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_killed_worker_is_replaced_and_all_end_in_order(tmp_path: Path) -> None:
    running = Running("serve", "--workers", 2, "--port", 0, "--listen", free_endpoint(), "--data", tmp_path)
    until(lambda: len(running.workers()) == 2)
    first = running.workers()
    os.kill(first[0], signal.SIGKILL)
    until(lambda: len(now := running.workers()) == 2 and first[0] not in now)
    problems = running.get("/v1/status").json()["problems"]
    assert f"worker process {first[0]} (number" in problems["workers"]
    assert 'wingwatch_worker_link_total{kind="restarted"} 1.0' in running.get("/metrics").text
    last = running.workers()
    code, took_s, err = running.end()
    assert (code, took_s <= LONGEST_END_S) == (0, True), (took_s, err)
    assert "was ended by signal SIGKILL; it is started again" in err
    assert not any(is_there(pid) for pid in last)


@pytest.fixture
def ended_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands whose end is asked for before they begin, in this process."""

    @contextmanager
    def asked() -> Iterator[threading.Event]:
        end = threading.Event()
        end.set()
        yield end

    def leave(code: int) -> NoReturn:
        raise SystemExit(code)

    for command in ("worker_command", "gateway_command"):
        monkeypatch.setattr(f"wingwatch.cli.{command}.asked_to_end", asked)
        monkeypatch.setattr(f"wingwatch.cli.{command}.leave_at_once", leave)


@pytest.mark.usefixtures("ended_at_once")
def test_worker_and_gateway_say_where_they_are(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    common = ("--listen", "tcp/127.0.0.1:0", "--data", str(tmp_path), "--json")
    with pytest.raises(SystemExit, match="0"):
        main(["worker", "--worker-name", "w1", *common])
    said = json.loads(capsys.readouterr().out)
    assert said["worker"].startswith("w1-")
    assert said["zenoh"][0].startswith("tcp/127.0.0.1:")
    with pytest.raises(SystemExit, match="0"):
        main(["gateway", "--port", "0", *common])
    assert json.loads(capsys.readouterr().out)["url"].startswith("http://127.0.0.1:")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("serve", "--workers", "0"), "'0' is not allowed: give a whole number from 1 to 64"),
        (("worker", "--worker-name", "A B"), "worker 'A B' is no valid name"),
        (("worker", "--worker-name", "alive"), "worker 'alive' is no valid name"),
        (("worker", "--capacity", "0"), "0"),
        (("worker", "--ready-file", "/none/ready"), "--ready-file /none/ready: no such file or directory"),
        (("worker", "--port", "8000"), "--port"),
        (("gateway", "--record", "recordings"), "--record"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    try:
        code = main([*arguments, "--data", str(tmp_path)])
    except SystemExit as end:
        code = int(end.code or 0)
    err = capsys.readouterr().err
    assert code == 2
    assert sentence in err
    assert "Traceback" not in err
