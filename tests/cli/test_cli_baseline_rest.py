"""The baseline over REST: the objects of the command line, and a version taken back by who may."""

import json
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from cli_flights import run

from wingwatch.aircraft import SHORT_PERIOD, Aircraft, load_aircraft
from wingwatch.api import AccessSettings, AppSettings, Caller, HttpServer, TokenScope, create_app, listen
from wingwatch.baselines import (
    Cell,
    Database,
    ExpectationRecord,
    Reference,
    ReferenceKey,
    apriori_envelope,
    open_database,
)
from wingwatch.monitor import FleetMonitor
from wingwatch.service.patient_baselines import PatientBaselines

AEROSONDE = load_aircraft("aerosonde")
KEY = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
READ, OPERATE = ({"Authorization": f"Bearer {token}"} for token in ("look", "act"))
CALLERS = {"look": Caller("tower", TokenScope.READ), "act": Caller("lead", TokenScope.OPERATE)}
NOW_S = 2e9


def find(name: str) -> Aircraft:
    if name != "aerosonde":
        raise ValueError(f"aircraft {name} is not known; known is aerosonde")
    return AEROSONDE


@dataclass
class Served:
    """A database that is served, and where."""

    path: Path
    database: Database
    client: httpx.Client

    def get(self, path: str, **query: object) -> Any:
        return self.client.get(path, params={k: str(v) for k, v in query.items()}, headers=READ)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    path = tmp_path / "w.db"
    monitor = FleetMonitor(find, lambda: 0.0, lambda: "a1")
    with open_database(path) as database:
        for value, point in enumerate(apriori_envelope(AEROSONDE, SHORT_PERIOD).points[12:14]):
            for at_s in (10.0, 20.0):
                database.put_expectation(ExpectationRecord.of("aerosonde", point, at_s + value))
        for blocks in (3, 7):
            database.save_reference(
                KEY, Reference(np.eye(6), np.ones(6), blocks, 10.0 * blocks), float(blocks)
            )
        database.save_cell(KEY, Cell(23, 1), Reference(np.eye(6), np.ones(6), 3, 30.0), 3.0)
        settings = AppSettings(
            access=AccessSettings(find=CALLERS.get, required=True), aircraft=find,
            baselines=PatientBaselines(database, lambda: NOW_S),
        )  # fmt: skip
        app = create_app(monitor, lambda: {"http": None}, None, "1", settings)
        with (
            HttpServer(app, listen("127.0.0.1", 0)) as server,
            httpx.Client(base_url=server.url, verify=False) as client,
        ):
            yield Served(path, database, client)


def test_answers_are_the_command_line_s_objects(capsys: pytest.CaptureFixture[str], served: Served) -> None:
    own = ["--aircraft", "aerosonde", "--vehicle", "uav1", "--convention", "american", "--json"]
    query = {"vehicle": "uav1", "convention": "american"}
    assert served.get("/v1/baselines").json() == run(capsys, ["baseline", "list", served.path, "--json"]).json
    past = run(capsys, ["baseline", "history", served.path, *own]).json
    assert served.get("/v1/baselines/aerosonde/history", **query).json() == past
    shown = run(capsys, ["baseline", "show", served.path, *own, "--at", "26.0,800.0"]).json
    found = served.get(
        "/v1/baselines/aerosonde", **query, airspeed_true_m_s=26.0, altitude_m=800.0, configuration="clean"
    ).json()
    (cell,) = found["cells"]
    assert cell["age_s"] == NOW_S - 3.0
    shown["cells"][0]["age_s"] = cell["age_s"]
    assert found == shown


def test_bad_questions_are_problems(served: Served) -> None:
    assert served.get("/v1/baselines/twin").status_code == 404
    assert served.get("/v1/baselines/aerosonde", airspeed_true_m_s=26.0).status_code == 422
    assert served.get("/v1/baselines/aerosonde", vehicle="UAV 1").status_code == 422
    assert served.get("/v1/baselines/aerosonde/history", colour="red").status_code == 422


def test_a_version_is_taken_back_by_who_may_and_noted(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    path = "/v1/baselines/aerosonde/revert"
    assert served.client.post(path, json={}).status_code == 401
    assert served.client.post(path, json={}, headers=READ).status_code == 403
    with caplog.at_level(logging.INFO, "wingwatch"):
        body = {"who": "ada", "vehicle": "uav1", "note": "it had ice", "version": 1}
        answer = served.client.post(path, json=body, headers=OPERATE)
    assert answer.status_code == 200
    assert answer.json() == {
        "aircraft": "aerosonde", "configuration": "clean", "withdrawn": [2], "restored": [1], "cells": 0,
    }  # fmt: skip
    assert (
        "revert of the baseline of 'aerosonde', what default/uav1 taught (2) by lead, for ada" in caplog.text
    )
    left = served.database.load_reference(KEY)
    assert left is not None
    assert left.blocks == 3
    assert (
        served.client.post(path, json=body, headers=OPERATE).status_code == 409
    )  # nothing more is taken back
    (change,) = served.get("/v1/baselines/aerosonde/history", vehicle="uav1").json()["changes"]
    assert (change["who"], change["text"]) == ("lead, for ada", "back to version 1: it had ice")
    before = served.get("/v1/baselines/aerosonde").json()["structures"]["short_period"]
    assert served.client.post(path, json={"entry": before[0]["id"]}, headers=OPERATE).status_code == 200
    after = served.get("/v1/baselines/aerosonde").json()["structures"]["short_period"]
    assert [e["id"] for e in after] == [before[0]["id"] - 1, before[1]["id"]]
    both = {"entry": 1, "vehicle": "uav1"}
    assert served.client.post(path, json=both, headers=OPERATE).status_code == 409


def test_what_export_wrote_is_put_back_by_who_may(
    capsys: pytest.CaptureFixture[str], served: Served, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    out = tmp_path / "baseline.json"
    counts = run(capsys, ["baseline", "export", served.path, "--out", out, "--json"]).json
    document, path = json.loads(out.read_text()), "/v1/baselines/aerosonde"

    def put(body: Any, headers: dict[str, str] = OPERATE, **query: str) -> httpx.Response:
        return served.client.put(path, params=query, json=body, headers=headers)

    assert served.client.put(path, json=document).status_code == 401
    assert put(document, READ).status_code == 403
    assert put(document).json() == counts | {"stored": 0}  # all of it is there to the bit
    document["entries"][0]["value"][0] *= 1.1
    with caplog.at_level(logging.INFO, "wingwatch"):
        answer = put(document, note="after the new wing", who="ada")
    assert answer.json() == counts | {"stored": 1}
    assert "import into the baseline of 'aerosonde'" in caplog.text
    assert "by lead, for ada" in caplog.text
    (change,) = served.get(f"{path}/history").json()["changes"][-1:]
    assert (change["who"], change["text"]) == ("lead, for ada", "imported over REST: after the new wing")
    assert (
        len(served.get(path).json()["structures"]["short_period"]) == 2
    )  # it superseded the one at its point


def test_a_file_that_is_none_changes_nothing(
    capsys: pytest.CaptureFixture[str], served: Served, tmp_path: Path
) -> None:
    out = tmp_path / "baseline.json"
    run(capsys, ["baseline", "export", served.path, "--out", out])
    whole, path = json.loads(out.read_text()), "/v1/baselines/aerosonde"
    before = served.get(f"{path}/history").json()
    foreign = whole | {"units": whole["units"] | {"z_w": "ft"}}
    newer = whole | {"version": 9}
    other = whole | {"entries": [whole["entries"][0] | {"aircraft": "twin"}]}
    half = whole | {"cells": [{"aircraft": "aerosonde"}]}
    bad_covariance = [whole["entries"][0] | {"covariance": [[float(-k) for k in range(6)]] * 6}]
    for body, said in (
        (foreign, "z_w is in ft"), (newer, "version 9"), (other, "is of aircraft twin"), (half, "cells.0"),
        (whole | {"entries": bad_covariance}, "export it again"),
    ):  # fmt: skip
        answer = served.client.put(path, json=body, headers=OPERATE)
        assert answer.status_code == 422
        assert said in answer.json()["detail"]
    assert served.client.put(path, json={}, headers=OPERATE).status_code == 422
    assert served.client.put("/v1/baselines/twin", json=whole, headers=OPERATE).status_code == 404
    assert served.get(f"{path}/history").json() == before
