"""Apprise against a server on loopback; what it says of addresses stays out of log and errors."""

import email
import email.policy
import io
import json
import logging
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from receivers import Bench, http_receiver, smtp_receiver

from wingwatch.monitor import AlertState
from wingwatch.notifications import AppriseChannel, ChannelError, NotDeliveredError

pytestmark = pytest.mark.filterwarnings("ignore:.imghdr.:DeprecationWarning")  # apprise imports it
SECRET = "T0KENT0KEN"


@pytest.fixture(autouse=True)
def _installed() -> None:
    pytest.importorskip("apprise")


@pytest.fixture
def root_log() -> Iterator[io.StringIO]:
    """What would come into the service's log, at its most talkative."""
    written, root = io.StringIO(), logging.getLogger()
    handler, level = logging.StreamHandler(written), root.level
    root.addHandler(handler)
    root.setLevel(logging.DEBUG)
    yield written
    root.setLevel(level)
    root.removeHandler(handler)


def test_a_notice_arrives_with_title_text_and_kind(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "o.json")
    for changes in ({}, {"level": "critical"}, {"level": "watch"}, {"state": AlertState.CLEARED}):
        bench.hear(**changes)
    with http_receiver() as receiver:
        channel = AppriseChannel(f"json://{receiver.url.removeprefix('http://')}/{SECRET}")
        for notice in bench.channel.taken:
            channel.send(notice)
    got = [json.loads(body) for _, body in receiver.got]
    assert [one["type"] for one in got] == ["warning", "failure", "info", "success"]
    assert got[0]["title"].startswith("uav1 (north), warning: Icing of severity 0.16 ± 0.02")
    assert "with 95 % confidence between 0.121 and 0.199" in got[0]["message"]


def test_a_mail_arrives(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "o.json")
    bench.hear()
    with smtp_receiver() as (port, mails):
        who = "from=wing@example.com&to=ops@example.com&mode=insecure"
        AppriseChannel(f"mailto://127.0.0.1:{port}?{who}").send(bench.channel.taken[0])
        mail = email.message_from_bytes(mails.get(timeout=20.0), policy=email.policy.default)
    assert mail["subject"].startswith("uav1 (north), warning: Icing of severity 0.16 ± 0.02")
    body = mail.get_body(("plain",))
    assert body is not None
    assert "with 95 % confidence between 0.121 and 0.199" in body.get_content()


def test_a_failure_is_tried_again_and_shows_no_secret(
    tmp_path: Path, root_log: io.StringIO, capfd: pytest.CaptureFixture[str]
) -> None:
    bench = Bench(tmp_path / "o.json")
    bench.hear()
    with http_receiver(500) as receiver:
        url = f"json://ann:{SECRET}@{receiver.url.removeprefix('http://')}/{SECRET}?to={SECRET}"
        channel = AppriseChannel(url)
        with pytest.raises(NotDeliveredError) as failure:
            channel.send(bench.channel.taken[0])
    assert channel.place == "json"
    assert "500" in str(failure.value)
    for text in (str(failure.value), root_log.getvalue(), *capfd.readouterr()):
        assert SECRET not in text


@pytest.mark.parametrize("url", [f"nosuch://{SECRET}", SECRET, f"mailto://{SECRET}", "json://"])
def test_an_address_that_apprise_does_not_understand_is_refused(
    url: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ChannelError, match="apprise does not understand") as failure:
        AppriseChannel(url)
    assert SECRET not in str(failure.value) + "".join(capfd.readouterr())


def test_without_apprise_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "apprise", None)
    with pytest.raises(ChannelError, match=r"pip install 'wingwatch\[notify\]'"):
        AppriseChannel("json://localhost")
