"""Notifications of a whole service, its settings, and `wingwatch notify test`."""

import io
import json
import logging
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from cli_services import service_in
from receivers import ICING, HttpReceiver, http_receiver, udp_receiver

from wingwatch.cli.main import main
from wingwatch.monitor import AlertAction, AlertView
from wingwatch.operations.faults import CommandError
from wingwatch.service.notify_settings import NotifyTable, channel_plans
from wingwatch.service.service import Service
from wingwatch.service.settings import file_settings

SECRET = "T0KENT0KEN"
pytestmark = pytest.mark.filterwarnings("ignore:.imghdr.:DeprecationWarning")  # apprise imports it


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def keep(service: Service, alert: AlertView) -> None:
    """A version of an alert by the monitor: to the database first."""
    fleet: Any = service.monitor
    with fleet._lock:
        fleet._alerts.keep(alert)


def steps(receiver: HttpReceiver) -> list[str]:
    return [one["alerts"][0]["annotations"]["steps"] for one in receiver.alerts()]


@pytest.fixture
def log() -> Iterator[io.StringIO]:
    written, root = io.StringIO(), logging.getLogger()
    handler, level = logging.StreamHandler(written), root.level
    root.addHandler(handler)
    root.setLevel(logging.INFO)
    yield written
    root.setLevel(level)
    root.removeHandler(handler)


def test_a_service_says_what_is_committed_once_over_restarts_and_shows_no_secret(
    tmp_path: Path, log: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OUR_HOOK_SECRET", SECRET)
    with http_receiver() as receiver:
        hook = {"url": f"{receiver.url}/{SECRET}", "secret_env": "OUR_HOOK_SECRET"}
        settings = {"notify": NotifyTable.model_validate({"webhook": [hook]})}
        with service_in(tmp_path, **settings) as service:
            keep(service, ICING)
            receiver.await_got(1)
            service.monitor.act_on_alert("a1", AlertAction.ACKNOWLEDGE, "ann", "seen")
            receiver.await_got(2)
            until(lambda: service.counters()["notifications"]["delivered"] == 2)
            shown = httpx.get(f"{service.url}/v1/status").text + httpx.get(f"{service.url}/metrics").text
        with service_in(tmp_path, **settings) as service:  # announces a1 again
            until(lambda: any(a.id == "a1" for a in service.monitor.alerts()))
            keep(service, replace(ICING, id="a2"))
            receiver.await_got(3)
            service.monitor.act_on_alert("a1", AlertAction.CLEAR, "ann", "")
            receiver.await_got(4)
    assert steps(receiver) == ["raised", "acknowledged", "raised", "cleared"]
    first = receiver.alerts()[0]
    assert first["externalURL"].startswith("http://127.0.0.1:")
    assert first["receiver"] == "webhook1"
    assert 'wingwatch_notifications_total{result="delivered"} 2.0' in shown
    assert 'wingwatch_queue_length{queue="notify_webhook1"} 0.0' in shown
    kept = "".join(path.read_text() for path in (tmp_path / "notifications").iterdir())
    for text in (shown, log.getvalue(), kept):
        assert SECRET not in text
    assert "webhook1 has delivered a notice of alert a1 (raised)" in log.getvalue()


def test_an_outage_is_shown_and_leaves_the_service_ready(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: io.StringIO
) -> None:
    monkeypatch.setattr("wingwatch.notifications.dispatcher._SILENT_S", 0.0)
    with http_receiver(503) as receiver, udp_receiver() as station:
        table = {
            "webhook": [{"url": f"{receiver.url}/{SECRET}", "name": "ops"}],
            "statustext": [
                {"connect": f"udpout:127.0.0.1:{station.getsockname()[1]}", "systems": {"uav1": 4}}
            ],
        }
        with service_in(tmp_path, notify=NotifyTable.model_validate(table)) as service:
            keep(service, ICING)
            while b"WARNING: Icing" not in (packet := station.recv(1000)):
                assert packet
            receiver.await_got(1)
            until(lambda: "answered 503" in (service.problems()["notifications"] or ""))
            status = httpx.get(f"{service.url}/v1/status").json()
            checks = httpx.get(f"{service.url}/health/ready", timeout=10.0).json()["checks"]
            metrics = httpx.get(f"{service.url}/metrics").text
    assert status["problems"]["notifications"].startswith("ops (http://127.0.0.1) has delivered nothing for")
    assert status["counters"]["notifications"]["retried"] >= 1
    assert status["counters"]["notifications"]["delivered"] == 1  # by MAVLink
    assert "notifications" not in checks
    assert 'wingwatch_part_failing{part="notifications"} 1.0' in metrics
    assert (
        "ops has not delivered a notice of alert a1 (raised): answered 503; it is tried again"
        in log.getvalue()
    )
    assert (tmp_path / "notifications" / "webhook-ops.json").exists()


def test_a_service_without_channels_has_neither_thread_nor_folder(tmp_path: Path) -> None:
    with service_in(tmp_path) as service:
        assert not any(service.counters()["notifications"].values())
        assert service.problems()["notifications"] is None
        assert "wingwatch-notify" not in {thread.name for thread in threading.enumerate()}
    assert not (tmp_path / "notifications").exists()


def settings_file(folder: Path, text: str) -> Path:
    file = folder / "service.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[notify.webhook]]", "takes one of url, url_env and url_file"),
        (f'[[notify.webhook]]\nurl = "https://a/{SECRET}"\nurl_env = "B"', "takes one of url"),
        (
            f'[[notify.webhook]]\nurl = ["https://a/{SECRET}"]',
            "webhook.0.url is not shown, for it may be a secret",
        ),
        (
            f'[[notify.webhook]]\nurl = "https://a"\nsecret = "{SECRET}"',
            "secret is no setting; known are name, least",
        ),
        (f'[[notify.webhook]]\nurl = "https://a"\nsecret_env = "{SECRET}-"', "secret_env is not shown"),
        (
            '[[notify.webhook]]\nurl = "https://a"\nleast_level = "bad"',
            "least_level is 'bad'; allowed is 'watch'",
        ),
        ('[[notify.webhook]]\nurl = "https://a"\nsteps = ["rised"]', "steps.0 is 'rised'"),
        ('[[notify.webhook]]\nurl = "https://a"\ntimeout_s = 0', "timeout_s is 0"),
        ("[[notify.statustext]]\nsystems = {uav1 = 256}", "systems.uav1 is 256"),
        ('[notify]\nexternal_url = "wing"', "external_url is 'wing'"),
        (
            "[notify]\nmail = 1",
            "notify.mail is no setting; known are external_url, webhook, apprise, statustext",
        ),
    ],
)
def test_wrong_settings_are_one_sentence_without_a_secret(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(CommandError) as failure:
        file_settings(settings_file(tmp_path, text), {})
    assert words in str(failure.value)
    assert SECRET not in str(failure.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[notify.webhook]]\nurl_env = "HOOK"', "number 1: the environment variable HOOK of url_env is not"),
        (f'[[notify.webhook]]\nurl = "wss://{SECRET}"', "number 1: the address is not of the form https://HOST/PATH"),
        ('[[notify.webhook]]\nurl = "https://a"\nsecret_file = "none"', "secret_file"),
        ('[[notify.webhook]]\nurl = "https://a"\nsecret_file = "empty"', "empty or above 4096 characters"),
        ('[[notify.webhook]]\nurl_file = "binary"', "not UTF-8 text"),
        (f'[[notify.apprise]]\nurl = "nosuch://{SECRET}"', "[[notify.apprise]] number 1: apprise does not understand"),
        ('[[notify.statustext]]\n[[notify.statustext]]\nconnect = "com3"', "number 2: connect is 'com3'"),
        ('[[notify.webhook]]\nurl = "https://a"\nname = "x"\n' * 2, "the name 'x' is taken"),
    ],
)  # fmt: skip
def test_channels_that_cannot_be_set_up_are_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "empty").write_text("\n")
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    table = file_settings(settings_file(tmp_path, text), {}).notify
    with pytest.raises(CommandError) as failure:
        channel_plans(table, {}, "http://wing")
    assert words in str(failure.value)
    assert SECRET not in str(failure.value)


def test_files_count_from_the_settings_and_keep_their_channel_when_the_order_changes(tmp_path: Path) -> None:
    (tmp_path / "url").write_text("https://b/hook\n")
    one, two = '[[notify.webhook]]\nurl = "https://a"\n', '[[notify.webhook]]\nurl_file = "url"\n'
    plans = [
        channel_plans(file_settings(settings_file(tmp_path, text), {}).notify, {}, "http://wing")
        for text in (one + two, two + one)
    ]
    assert [plan.channel.place for plan in plans[0]] == ["https://a", "https://b"]
    assert [plan.file for plan in plans[0]] == [plan.file for plan in reversed(plans[1])]
    same = channel_plans(file_settings(settings_file(tmp_path, one + one), {}).notify, {}, "http://wing")
    assert len({plan.file for plan in same}) == 2


def test_the_command_tries_each_channel(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with http_receiver() as good, http_receiver(404) as bad:
        file = settings_file(
            tmp_path,
            f'[[notify.webhook]]\nurl = "{good.url}/{SECRET}"\n[[notify.webhook]]\nurl = "{bad.url}/{SECRET}"\n'
            f'name = "pager"\n[[notify.apprise]]\nurl = "{good.url.replace("http", "json")}/{SECRET}"\n',
        )
        assert main(["notify", "test", "--config", str(file), "--json"]) == 2
        out, err = capsys.readouterr()
        assert main(["notify", "test", "--config", str(file), "--channel", "1"]) == 0
        text = capsys.readouterr().out
        assert main(["notify", "test", "--config", str(file), "--channel", "pager"]) == 2
        refused = capsys.readouterr().out
    assert json.loads(out)["channels"] == [
        {"channel": "webhook1", "place": "http://127.0.0.1", "delivered": True, "problem": None},
        {"channel": "pager", "place": "http://127.0.0.1", "delivered": False, "problem": "answered 404"},
        {"channel": "apprise1", "place": "json", "delivered": True, "problem": None},
    ]
    assert text == "webhook1 (http://127.0.0.1): delivered\n"
    assert refused == "pager (http://127.0.0.1): not delivered: answered 404\n"
    assert SECRET not in out + err
    assert good.alerts()[0]["alerts"][0]["labels"]["alertname"] == "WingwatchTest"
    assert "TEST" in good.alerts()[1]["title"]


@pytest.mark.parametrize(
    ("text", "more", "words"),
    [
        ("", (), "it has no [[notify.webhook]]"),
        (
            '[[notify.webhook]]\nurl = "http://127.0.0.1"',
            ("--channel", "7"),
            "--channel is '7'; there are webhook1",
        ),
    ],
)
def test_nothing_to_try_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, more: tuple[str, ...], words: str
) -> None:
    assert main(["notify", "test", "--config", str(settings_file(tmp_path, text)), *more]) == 2
    assert words in capsys.readouterr().err
