"""A loop that fails begins again and says so; one that was asked to end does not."""

import threading
import time
from collections.abc import Callable

import pytest

from wingwatch.service.loops import Loop

PATIENCE_S = 60.0


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


@pytest.fixture(autouse=True)
def no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wingwatch.service.loops._PAUSE_S", 0.01)


def test_a_loop_that_fails_begins_again_and_says_so_for_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    now_s, ended, begun = [0.0], threading.Event(), []

    def work() -> None:
        begun.append(now_s[0])
        if len(begun) < 3:
            raise KeyError("uav1")
        ended.wait(PATIENCE_S)

    loop = Loop("wingwatch-test", "the loop that is tested", work, clock=lambda: now_s[0])
    assert loop.problem == "the loop that is tested has ended."
    loop.start()
    until(lambda: loop.restarts == 2)
    assert loop.problem == "the loop that is tested failed with KeyError: 'uav1' and was started again."
    assert sum("the loop that is tested failed" in record.message for record in caplog.records) == 2
    now_s[0] = 61.0
    assert loop.problem is None
    ended.set()
    loop.join(PATIENCE_S)
    assert (loop.alive, loop.restarts, len(begun)) == (False, 2, 3)


def test_a_loop_that_is_told_to_end_does_not_begin_again() -> None:
    ended, begun = threading.Event(), []

    def work() -> None:
        begun.append(1)
        ended.wait(PATIENCE_S)
        raise OSError("the link is gone")

    loop = Loop("wingwatch-test", "the loop that is tested", work)
    loop.start()
    until(lambda: bool(begun))
    threading.Timer(0.05, ended.set).start()
    loop.join(PATIENCE_S)
    assert (loop.alive, loop.restarts, begun) == (False, 0, [1])
