"""Diagnoses over REST: uploads in pieces, bounded, from our own callers; states, results, reports."""

import asyncio
import dataclasses
import json
from collections.abc import AsyncIterator, Generator, Mapping
from typing import Any

import httpx
import pytest
from api_fakes import FakeDiagnoses, FakeMonitor, diagnosis_view, served
from openapi_check import misfits

from wingwatch.api import DiagnosisState
from wingwatch.api.diagnosis_events import DiagnosisStreams
from wingwatch.api.diagnosis_routes import FLIGHT_SIZE
from wingwatch.api.problems import ProblemError

BINARY = {"content-type": "application/octet-stream"}


@pytest.fixture
def port() -> FakeDiagnoses:
    return FakeDiagnoses()


@pytest.fixture
def client(port: FakeDiagnoses) -> Generator[httpx.Client]:
    with served(FakeMonitor(), diagnoses=port) as (_, connection):
        yield connection


def problem(answer: httpx.Response, status: int) -> str:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    detail = answer.json()["detail"]
    assert isinstance(detail, str)
    assert detail.endswith(".")
    return detail


def fits(client: httpx.Client, value: Any, name: str) -> Mapping[str, Any]:
    """The value, held against its schema in the description."""
    description = client.get("/openapi.json").json()
    assert misfits(value, description["components"]["schemas"][name], description) == []
    assert isinstance(value, dict)
    return value


def test_a_flight_is_taken_as_it_is_and_its_job_can_be_followed(
    client: httpx.Client, port: FakeDiagnoses
) -> None:
    content = bytes(range(256)) * 2000
    query = {"aircraft": "aerosonde", "map": "format = 1\n", "file": "flight 7.csv"}
    answer = client.post("/v1/diagnoses", params=query, content=content, headers=BINARY)
    assert answer.status_code == 202
    document = fits(client, answer.json(), "DiagnosisDocument")
    assert (document["state"], document["file"], document["report"]) == ("queued", "flight 7.csv", None)
    assert answer.headers["location"] == f"/v1/diagnoses/{document['id']}"
    (upload,) = port.uploads
    assert (upload.content, upload.channel_map, upload.ended) == (content, "format = 1\n", "submitted")
    assert client.get(answer.headers["location"]).json() == document


def test_a_job_that_is_done_has_its_result_and_its_report(client: httpx.Client, port: FakeDiagnoses) -> None:
    result = {"misfit": {"pitch_rate_rad_s": {"tic": float("nan")}}}
    port.views = [diagnosis_view("d1", state=DiagnosisState.DONE, progress=1.0, doing="done", result=result)]
    document = fits(client, client.get("/v1/diagnoses/d1").json(), "DiagnosisDocument")
    assert document["result"] == {"misfit": {"pitch_rate_rad_s": {"tic": None}}}
    assert document["report"] == "/v1/diagnoses/d1/report"
    port.page = "<!doctype html>ü".encode()
    page = client.get(document["report"])
    assert (page.status_code, page.content) == (200, port.page)
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    policy = page.headers["content-security-policy"]
    assert policy.startswith("sandbox allow-scripts")
    assert "allow-same-origin" not in policy
    assert "default-src 'none'" in policy
    assert page.headers["x-content-type-options"] == "nosniff"


def test_progress_is_told_as_it_happens_until_the_job_has_ended(
    client: httpx.Client, port: FakeDiagnoses
) -> None:
    states = iter([
        diagnosis_view("d1"), diagnosis_view("d1"),
        diagnosis_view("d1", state=DiagnosisState.RUNNING, doing="looking for causes", progress=0.25),
        diagnosis_view("d1", state=DiagnosisState.DONE, doing="done", progress=1.0, result={"causes": []}),
    ])  # fmt: skip
    port.views = [diagnosis_view("d1")]
    port.diagnoses = lambda: [next(states)]  # type: ignore[method-assign]
    answer = client.get("/v1/diagnoses/d1/events")
    assert answer.headers["content-type"].startswith("text/event-stream")
    steps = [
        json.loads(line.removeprefix("data: "))
        for line in answer.text.splitlines()
        if line.startswith("data")
    ]
    assert [(one["state"], one["progress"]) for one in steps] == [
        ("queued", 0.0),
        ("running", 0.25),
        ("done", 1.0),
    ]
    assert steps[-1]["report"] == "/v1/diagnoses/d1/report"
    assert all(one["result"] is None for one in steps)


def test_a_diagnosis_that_there_is_not_has_no_progress(client: httpx.Client) -> None:
    assert "no diagnosis 'd9'" in problem(client.get("/v1/diagnoses/d9/events"), 404)


def test_streams_of_progress_are_bounded_and_end_with_the_service() -> None:
    async def work() -> None:
        over: list[bool] = []
        streams = DiagnosisStreams(lambda: bool(over), most=1)
        view = diagnosis_view("d1")

        def follow() -> AsyncIterator[bytes]:
            return streams.follow(lambda: view, lambda v: {"state": v.state}, lambda: True)

        stream = follow()
        await anext(stream)
        with pytest.raises(ProblemError, match="the limit"):
            follow()
        over.append(True)
        assert [piece async for piece in stream] == []
        follow()

    asyncio.run(asyncio.wait_for(work(), 10.0))


def test_the_list_is_newest_first_and_without_results(client: httpx.Client, port: FakeDiagnoses) -> None:
    port.views = [
        diagnosis_view("d2"),
        diagnosis_view("d1", state=DiagnosisState.DONE, result={"misfit": {}}),
    ]
    listed = fits(client, client.get("/v1/diagnoses").json(), "DiagnosisList")
    assert [(item["id"], item["result"]) for item in listed["items"]] == [("d2", None), ("d1", None)]
    assert listed["next"] is None


def test_a_failure_says_why(client: httpx.Client, port: FakeDiagnoses) -> None:
    port.views = [diagnosis_view("d1", state=DiagnosisState.FAILED, problem="flight: 4 s are too short")]
    assert client.get("/v1/diagnoses/d1").json()["problem"] == "flight: 4 s are too short"
    assert "failed and has no report" in problem(client.get("/v1/diagnoses/d1/report"), 409)


def test_a_job_can_be_removed_once(client: httpx.Client, port: FakeDiagnoses) -> None:
    port.views = [diagnosis_view("d1")]
    answer = client.delete("/v1/diagnoses/d1")
    assert (answer.status_code, answer.content) == (204, b"")
    problem(client.delete("/v1/diagnoses/d1"), 404)


@pytest.mark.parametrize("path", ["/v1/diagnoses/none", "/v1/diagnoses/none/report"])
def test_an_id_that_is_not_known_says_where_to_look(client: httpx.Client, path: str) -> None:
    assert "'none'; /v1/diagnoses lists" in problem(client.get(path), 404)


@pytest.mark.parametrize(
    ("query", "status", "words"),
    [
        ({}, 422, "aircraft is required"),
        ({"aircraft": "zeppelin"}, 422, "Aircraft 'zeppelin' is not known here."),
        ({"aircraft": "aerosonde", "colour": "red"}, 422, "colour is not known"),
        ({"aircraft": "aerosonde", "file": "a\nb"}, 422, "file"),
        ({"aircraft": "aerosonde", "map": "x" * 20_001}, 422, "20000"),
    ],
)
def test_what_cannot_be_used_is_told(
    client: httpx.Client, port: FakeDiagnoses, query: dict[str, str], status: int, words: str
) -> None:
    answer = client.post("/v1/diagnoses", params=query, content=b"x" * 300_000, headers=BINARY)
    assert words in problem(answer, status)
    assert port.uploads == []


def test_a_queue_that_is_full_is_told_though_the_flight_is_large(
    client: httpx.Client, port: FakeDiagnoses
) -> None:
    port.full = True
    query = {"aircraft": "aerosonde"}
    answer = client.post("/v1/diagnoses", params=query, content=b"x" * 8_000_000, headers=BINARY)
    assert "4 flights wait already" in problem(answer, 503)


@pytest.mark.parametrize(
    "kind",
    [
        None,
        "text/plain",
        "multipart/form-data; boundary=x",
        "Application/X-WWW-Form-Urlencoded; charset=utf-8",
    ],
)
def test_a_form_of_another_site_cannot_have_a_flight_diagnosed(
    client: httpx.Client, port: FakeDiagnoses, kind: str | None
) -> None:
    headers = {} if kind is None else {"content-type": kind}
    answer = client.post("/v1/diagnoses?aircraft=aerosonde", content=b"time_s", headers=headers)
    assert "application/octet-stream" in problem(answer, 415)
    assert port.uploads == []


def test_an_empty_flight_is_refused_and_its_place_given_back(
    client: httpx.Client, port: FakeDiagnoses
) -> None:
    answer = client.post("/v1/diagnoses?aircraft=aerosonde", content=b"", headers=BINARY)
    assert "empty" in problem(answer, 422)
    assert [upload.ended for upload in port.uploads] == ["discarded"]


def test_a_flight_too_large_is_refused_and_its_place_given_back(
    client: httpx.Client, port: FakeDiagnoses
) -> None:
    def pieces() -> Generator[bytes]:
        for _ in range(FLIGHT_SIZE.most_bytes // 2**20 + 1):
            yield bytes(2**20)

    answer = client.post("/v1/diagnoses?aircraft=aerosonde", content=pieces(), headers=BINARY, timeout=60.0)
    assert "at most 64 MB" in problem(answer, 413)
    assert [upload.ended for upload in port.uploads] == ["discarded"]


def test_a_service_without_diagnoses_says_so() -> None:
    with served(FakeMonitor()) as (_, client):
        assert "wingwatch diagnose" in problem(client.get("/v1/diagnoses"), 404)


def test_a_view_is_not_changed_by_reading(client: httpx.Client, port: FakeDiagnoses) -> None:
    port.views = [diagnosis_view("d1", progress=0.25, doing="simulating")]
    before = dataclasses.replace(port.views[0])
    document = client.get("/v1/diagnoses/d1").json()
    assert (document["progress"], document["doing"]) == (0.25, "simulating")
    assert port.views[0] == before
