"""What access rules refuse, and alerts that somebody else publishes: noticed, counted and logged."""

import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from certificates import Authority, needs_openssl
from cli_services import service_in
from loopback import free_port

from wingwatch.service.refusals import Refusals, noticed_refusals
from wingwatch.telemetry import LinkSecurity, ZenohSettings, access_rules, open_session, vehicle_key

PATIENCE_S = 120.0
LINE = (
    "\x1b[2m2026-11-24T12:34:32.283911Z\x1b[0m \x1b[35mTRACE\x1b[0m rx-1 ThreadId(10) \x1b[2mzenoh::net::routing::"
    "interceptor::access_control\x1b[0m\x1b[2m:\x1b[0m d7de74 on Interface(lo)+Transport(Tls)+{who}+d7de74 "
    "is {may} to {what} ({way}) on {key}\n"
)


def line(key: str, who: str = "CertCommonName(default.uav1)", what: str = "Put", may: str = "unauthorized",
         way: str = "ingress") -> bytes:  # fmt: skip
    return LINE.format(key=key, who=who, what=what, may=may, way=way).encode()


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)


def test_refused_writes_are_counted_and_said_once_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    now_s = [0.0]
    refusals = Refusals(lambda: now_s[0])
    key = "wingwatch/v1/default/uav2/sensors"
    text = b"".join((
        line(key), line(key), line(key, may="authorized"), line(key, what="Query"), line(key, way="egress"),
        line("wingwatch/v1/**"), line("other/key"), line("wingwatch/v1/default/uav2/alerts", "Username(eve)"),
    ))  # fmt: skip
    for start in range(0, len(text), 7):  # a pipe cuts anywhere
        refusals.take(text[start : start + 7])
    assert refusals.counts == {"refused_writes": 3, "unknown_subjects": 0}
    said = [record.getMessage() for record in caplog.records]
    assert said == [
        "the access rules refuse that default.uav1 writes wingwatch/v1/default/uav2/sensors",
        "the access rules refuse that eve writes wingwatch/v1/default/uav2/alerts",
    ]
    assert [getattr(record, "vehicle", None) for record in caplog.records] == ["default/uav2"] * 2
    now_s[0] = 61.0
    refusals.take(line(key))
    assert len(caplog.records) == 3


def test_links_that_no_rule_knows_are_counted_and_said(caplog: pytest.LogCaptureFixture) -> None:
    refusals = Refusals()
    refusals.take(
        b"WARN x: Interface(lo) did not match any configured ACL subject. Default permission is deny\n" * 3
    )
    assert refusals.counts["unknown_subjects"] == 3
    assert caplog.text.count("a link was opened by somebody of whom no access rule knows") == 1


def test_lines_without_an_end_take_no_room() -> None:
    refusals = Refusals()
    for _ in range(100):
        refusals.take(b"x" * 65_536)
    assert len(refusals._rest) <= 16_384


def test_without_rules_nothing_is_touched() -> None:
    before = sys.stdout
    with noticed_refusals(False) as counts:
        assert sys.stdout is before
        assert counts == {}


@pytest.mark.slow
@needs_openssl
def test_a_service_that_keeps_rules_logs_and_counts_each_attempt(tmp_path: Path) -> None:
    """In a process of its own, since it reads what that process writes to its standard output."""
    authority, port, endpoint = Authority(tmp_path), free_port(), f"tls/127.0.0.1:{free_port()}"
    own, uav1 = authority.sign("service"), authority.sign("default.uav1")
    (tmp_path / "access.json5").write_text(
        json.dumps(access_rules([("default", "uav1"), ("default", "uav2")]))
    )
    (tmp_path / "service.toml").write_text(
        f'listen = "{endpoint}"\n[zenoh]\nauthority = "{authority.certificate}"\ncertificate = "{own.certificate}"\n'
        f'private_key = "{own.private_key}"\naccess = "access.json5"\n'
    )
    command = [sys.executable, "-m", "wingwatch.cli.main", "serve", "--json", "--port", str(port)]
    command += ["--data", str(tmp_path / "data"), "--config", str(tmp_path / "service.toml")]
    out, err = tmp_path / "out.txt", tmp_path / "err.txt"
    with out.open("wb") as to_out, err.open("wb") as to_err:
        process = subprocess.Popen(command, stdout=to_out, stderr=to_err, env={**os.environ, "RUST_LOG": ""})
    try:
        until(lambda: process.poll() is not None or out.read_text().count("\n") == 1)
        assert json.loads(out.read_text())["zenoh"] == [endpoint]  # what it prints goes round Zenoh's log
        shown = LinkSecurity(authority.certificate, uav1.certificate, uav1.private_key)
        with open_session(ZenohSettings.for_vehicle((endpoint,), shown)) as vehicle:
            for leaf in ("sensors", "alerts"):
                vehicle.put(vehicle_key("default", "uav2", leaf), b"forged")
            until(lambda: err.read_text().count("the access rules refuse that default.uav1 writes") == 2)
        links = httpx.get(f"http://127.0.0.1:{port}/v1/status").json()["counters"]["links"]
        assert links["refused_writes"] >= 2
        assert links["foreign_alerts"] == 0
    finally:
        process.terminate()
        process.wait(PATIENCE_S)
    assert out.read_text().count("\n") == 1


def test_alerts_of_somebody_else_are_counted_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with service_in(tmp_path) as service:
        caplog.set_level(logging.WARNING)
        with open_session(ZenohSettings.for_vehicle(service.endpoints)) as stranger:
            for _ in range(3):
                stranger.put(vehicle_key("default", "uav1", "alerts"), b'{"state": "cleared"}')
            until(lambda: service.counters()["links"]["foreign_alerts"] == 3)
            until(lambda: "somebody else publishes alerts of default/uav1" in caplog.text)
        assert caplog.text.count("somebody else publishes alerts") == 1
