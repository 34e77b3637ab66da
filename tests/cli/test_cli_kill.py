"""A service that is killed has lost nothing that it had announced or answered."""

import json
import os
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
import zenoh
from cli_services import service_in

from wingwatch.baselines import open_database
from wingwatch.monitor import AlertState, AlertView
from wingwatch.service.stored_alerts import alert_record
from wingwatch.telemetry import JSON, ZenohSettings, decode_service_object, open_session

ALERT = AlertView(
    id="a1", fleet="default", vehicle="uav1", kind="icing", cause="icing", level="warning",
    state=AlertState.ACTIVE, raised_s=80.5, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97,
    basis="a-priori", text="Icing.", evidence=(),
)  # fmt: skip

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork and SIGKILL")]


def test_no_alert_that_was_told_and_no_action_that_was_answered_is_lost_at_a_kill(tmp_path: Path) -> None:
    command = [sys.executable, str(Path(__file__).parent / "killed.py"), str(tmp_path / "w.db"), "12", "1"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert ended.returncode == 0, ended.stderr
    result = json.loads(ended.stdout)
    assert result["lost"] == []
    assert result["announced"] > result["rounds"]
    assert result["acted"] > 0


def test_who_joins_later_gets_every_alert_also_those_of_an_earlier_run(tmp_path: Path) -> None:
    alerts = [
        replace(ALERT, id=f"a{k}", raised_s=float(k), fleet=("north", "default")[k % 2]) for k in range(5)
    ]
    with open_database(tmp_path / "wingwatch.db") as database:
        for alert in alerts:
            database.save_alert(alert_record(alert, 1.0, 1.0))
    with service_in(tmp_path) as service, open_session(ZenohSettings.for_vehicle(service.endpoints)) as late:
        found = {}
        for _ in range(50):
            replies = late.get("wingwatch/v1/*/*/alerts", consolidation=zenoh.ConsolidationMode.NONE)
            for reply in replies:
                assert reply.ok is not None
                payload = reply.ok.payload.to_bytes()
                found[decode_service_object("alerts", payload, JSON)["id"]] = str(reply.ok.key_expr)
            if len(found) == len(alerts):
                break
            time.sleep(0.1)
    assert found == {a.id: f"wingwatch/v1/{a.fleet}/{a.vehicle}/alerts" for a in alerts}


def test_an_action_that_a_locked_database_does_not_take_is_answered_503_and_has_not_happened(
    tmp_path: Path,
) -> None:
    where = tmp_path / "wingwatch.db"
    with open_database(where) as database:
        database.save_alert(alert_record(ALERT, 1.0, 1.0))
    with service_in(tmp_path) as service, httpx.Client(base_url=service.url, timeout=30.0) as client:

        def act() -> httpx.Response:
            return client.post(
                "/v1/alerts/a1/acknowledge", json={"who": "ann"}, headers={"Idempotency-Key": "k1"}
            )

        other = sqlite3.connect(where, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        refused = act()
        assert refused.status_code == 503
        assert "nothing has happened" in refused.json()["detail"]
        assert client.get("/v1/alerts/a1").json()["state"] == "active"
        assert "locked" in client.get("/health/ready").json()["checks"]["database"]
        other.execute("ROLLBACK")
        other.close()
        taken, again = act(), act()
        assert (taken.status_code, taken.json()["state"]) == (200, "acknowledged")
        assert again.json() == taken.json()
        assert taken.json()["notes"] == ["ann: acknowledge"]
