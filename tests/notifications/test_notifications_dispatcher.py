"""Delivery: tried again, in order, over outages, restarts and full disks; bounded; each notice once."""

import json
import threading
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from receivers import ICING, NOT_NOW, Bench, Recorder

from wingwatch.monitor import AlertState
from wingwatch.notifications import (
    Clocks,
    Dispatcher,
    NotDeliveredError,
    Outbox,
    Patience,
    RefusedError,
    Selection,
)
from wingwatch.notifications.outbox import MOST_WAITING
from wingwatch.service.loops import Loop

SECRET = "https://hooks.example/T0KEN"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "notifications" / "outbox.json"


def test_an_outage_is_waited_out_and_then_all_is_said_in_order(path: Path) -> None:
    bench = Bench(path, Recorder(fails=NOT_NOW))
    bench.hear()
    for level in ("critical", "warning"):
        bench.hear(level=level)
    bench.hear(replace(ICING, id="a2"))
    assert bench.dispatcher.counts["retried"] == 1  # what comes meanwhile does not have it tried sooner
    bench.after(100.0)
    assert "has delivered nothing for 100 s, 4 wait: not now." in (bench.dispatcher.problem or "")
    bench.channel.fails = None
    bench.after(1.0)  # two failures in a row: two seconds
    assert bench.channel.taken == []
    bench.after(1.0)
    assert bench.channel.steps == ["a1 raised", "a1 level", "a1 level", "a2 raised"]
    assert bench.dispatcher.counts == {"delivered": 4, "retried": 2, "refused": 0, "expired": 0, "dropped": 0}
    assert (bench.dispatcher.problem, bench.dispatcher.waiting, bench.dispatcher.waits_s) == (None, 0, 0.0)


def test_waits_double_up_to_a_limit_and_are_drawn() -> None:
    patience = Patience(first_s=1.0, most_s=60.0)
    assert [patience.wait_s(n, 1.0, None) for n in (1, 2, 3, 6, 7, 1000)] == [1.0, 2.0, 4.0, 32.0, 60.0, 60.0]
    assert patience.wait_s(3, 0.0, None) == 2.0
    assert patience.wait_s(1, 1.0, 17.0) == 17.0  # the receiver's wish
    assert patience.wait_s(1, 1.0, 1e9) == 60.0


def test_what_is_refused_for_ever_is_given_up_and_shown(path: Path) -> None:
    bench = Bench(path, Recorder(fails=RefusedError("answered 404")))
    bench.hear()
    assert bench.dispatcher.counts["refused"] == 1
    assert bench.dispatcher.problem == "test1 (nowhere) refused the latest notice: answered 404."
    bench.channel.fails = None
    bench.hear(level="critical")
    assert bench.channel.steps == ["a1 level"]
    assert bench.dispatcher.problem is None


def test_what_waits_too_long_is_given_up_whatever_the_wall_clock_does(path: Path) -> None:
    bench = Bench(path, Recorder(fails=NOT_NOW))
    bench.hear()
    bench.wall_s += 50 * 365 * 86_400.0  # a small computer has found the time
    bench.after(3500.0)
    assert bench.dispatcher.waiting == 1
    bench.hear(level="critical")
    bench.channel.fails = None
    bench.channel.taken.clear()
    bench.now_s = 3601.0
    bench.dispatcher.look()
    assert bench.dispatcher.counts["expired"] == 1
    bench.after(60.0)
    assert bench.channel.steps == ["a1 level"]


def test_the_queue_is_bounded_and_the_oldest_gives_way(path: Path) -> None:
    bench = Bench(path, Recorder(fails=NOT_NOW))
    for k in range(MOST_WAITING + 10):
        bench.dispatcher.hear(partial(replace, ICING, id=f"a{k}"))
    bench.dispatcher.look()
    assert bench.dispatcher.waiting == MOST_WAITING
    assert bench.dispatcher.counts["dropped"] == 10
    assert path.stat().st_size < 1_000_000
    for _ in range(2000):
        bench.dispatcher.hear(lambda: ICING)
    assert bench.dispatcher.counts["dropped"] == 1010
    assert bench.outbox.waiting[0].alert["id"] == "a10"


def test_where_there_is_no_room_the_newest_of_each_alert_stays(path: Path) -> None:
    bench = Bench(path, Recorder(fails=NOT_NOW))
    for level in ("watch", "warning", "critical"):
        for k in range(MOST_WAITING // 2):
            bench.dispatcher.hear(partial(replace, ICING, id=f"a{k}", level=level))
    bench.dispatcher.look()
    kept = [(notice.alert["id"], notice.alert["level"]) for notice in bench.outbox.waiting]
    assert kept == [(f"a{k}", level) for level in ("warning", "critical") for k in range(MOST_WAITING // 2)]


def test_a_restart_goes_on_where_it_was_and_says_nothing_twice(path: Path) -> None:
    first = Bench(path)
    first.hear()
    first.hear(replace(ICING, id="a2"))
    first.channel.fails = NOT_NOW
    first.hear(level="critical")
    second = Bench(path)  # the first was killed: nothing of it was ended
    second.hear(level="critical")  # what stands is announced again
    second.hear(replace(ICING, id="a2"))
    assert second.channel.steps == ["a1 level"]
    second.hear(replace(ICING, id="a2"), state=AlertState.CLEARED)
    third = Bench(path)
    third.hear(replace(ICING, id="a2"), state=AlertState.CLEARED)
    third.hear(level="critical")
    assert third.channel.steps == []


@pytest.mark.parametrize("keeps_first", [True, False])
def test_a_kill_between_delivery_and_its_note_repeats_the_notice_under_its_key(
    path: Path, keeps_first: bool
) -> None:
    class KilledError(BaseException):
        pass

    def kill() -> None:
        raise KilledError

    first = Bench(path, Recorder(keeps_first=keeps_first, after=kill))
    with pytest.raises(KilledError):
        first.hear()
    second = Bench(path, Recorder(keeps_first=keeps_first))
    second.hear()
    assert [n.key for n in second.channel.taken] == [n.key for n in first.channel.taken]
    assert len(second.channel.taken) == 1


def test_a_damaged_file_begins_anew_and_says_so(path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path.parent.mkdir()
    for content in (b"", b"{", b"[]", b'{"form": 2}', b'{"form": 1, "said": {"a": {}}, "waiting": []}'):
        path.write_bytes(content)
        caplog.clear()
        bench = Bench(path)
        bench.hear()
        assert bench.channel.steps == ["a1 raised"]
        assert "alerts in force are announced again" in caplog.text
    assert json.loads(path.read_bytes())["form"] == 1
    assert path.stat().st_mode & 0o077 == 0


def test_a_disk_that_takes_nothing_keeps_nothing_from_being_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    bench = Bench(tmp_path / "file" / "outbox.json")
    bench.hear()
    assert bench.channel.steps == ["a1 raised"]
    assert "what waits is not kept on the disk: " in (bench.dispatcher.problem or "")
    (tmp_path / "file").unlink()
    bench.dispatcher.look()
    assert bench.dispatcher.problem is None


def test_the_file_is_written_when_something_changes_and_only_then(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(path)
    bench.hear()
    before = path.stat().st_ino, path.stat().st_mtime_ns
    bench.hear()
    bench.hear(size=0.2)
    assert (path.stat().st_ino, path.stat().st_mtime_ns) == before


def test_the_text_of_a_foreign_error_is_not_shown(path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(path, Recorder(fails=RuntimeError(f"cannot reach {SECRET}")))
    bench.hear()
    bench.now_s = 100.0
    assert "RuntimeError" in caplog.text
    assert "T0KEN" not in caplog.text + (bench.dispatcher.problem or "")


class Holding(Recorder):
    """A channel whose receiver takes its time."""

    def __init__(self) -> None:
        super().__init__()
        self.free, self.entered = threading.Event(), threading.Event()

    def send(self, notice: object) -> None:
        self.entered.set()
        assert self.free.wait(20.0)
        super().send(notice)  # type: ignore[arg-type]


def test_a_slow_channel_holds_up_neither_who_announces_nor_another(tmp_path: Path) -> None:
    said = threading.Event()
    slow, quick = Holding(), Recorder(after=said.set)
    dispatchers = [
        Dispatcher(name, channel, Outbox(tmp_path / name), Selection(), Patience(), Clocks())
        for name, channel in (("slow", slow), ("quick", quick))
    ]
    loops = [Loop("test", one.name, one.run, one.wake) for one in dispatchers]
    for loop in loops:
        loop.start()
    for one in dispatchers:
        one.hear(lambda: ICING)
    assert slow.entered.wait(20.0)
    assert said.wait(20.0)
    for one in dispatchers:
        one.hear(lambda: replace(ICING, level="critical"))
    slow.free.set()
    for one in dispatchers:
        one.stop()
    for loop in loops:
        loop.join(20.0)
        assert not loop.alive
    kept = Outbox(tmp_path / "slow")
    assert slow.steps[0] == "a1 raised"
    assert len(slow.taken) + len(kept.waiting) == 2


def test_a_wish_of_the_receiver_is_followed(path: Path) -> None:
    bench = Bench(path, Recorder(fails=NotDeliveredError("answered 429", 30.0)))
    bench.hear()
    bench.channel.fails = None
    bench.after(29.0)
    assert bench.channel.taken == []
    bench.after(1.0)
    assert bench.channel.steps == ["a1 raised"]
