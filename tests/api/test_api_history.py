"""Past estimates in the three forms, one truth."""

import csv
import io
import math
from collections.abc import Generator
from typing import Any

import httpx
import pyarrow.parquet as pq
import pytest
from api_fakes import FakeHistory, FakeMonitor, past, served, vehicle

from wingwatch.aircraft import SHORT_PERIOD
from wingwatch.api.history import negotiate
from wingwatch.api.problems import ProblemError

PATH = "/v1/vehicles/aero-1/derivatives/history"
ROWS = [
    past(2.5, "fourier", "short_period", [-4.0, 24.0, -9.5, -3.5, -6.0, -116.1], [0.1] * 6),
    past(2.0, "fourier", "short_period", [math.nan] * 6, [math.inf] * 6, "settling"),
    past(2.5, "ekf", "short_period", [1 / 3, 24.5, -9.0, -3.25, -6.125, -116.0], [0.2] * 6),
    past(3.0, "ekf", "dutch_roll", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [0.3] * 6),
]


@pytest.fixture(scope="module")
def client() -> Generator[httpx.Client]:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    with served(monitor, FakeHistory(ROWS)) as (_, connection):
        yield connection


def items(client: httpx.Client, query: str = "") -> list[dict[str, Any]]:
    answer = client.get(f"{PATH}?{query}")
    assert answer.status_code == 200, answer.text
    found: list[dict[str, Any]] = answer.json()["items"]
    return found


def test_rows_become_derivatives_in_order_of_time_and_structure(client: httpx.Client) -> None:
    found = items(client)
    assert len(found) == 24
    assert [i["time_s"] for i in found] == [2.0] * 6 + [2.5] * 12 + [3.0] * 6
    assert tuple(i["derivative"] for i in found[:6]) == SHORT_PERIOD.derivatives
    assert found[0] == {
        "time_s": 2.0,
        "estimator": "fourier",
        "structure": "short_period",
        "derivative": "z_w",
        "value": None,
        "standard_error": None,
        "unit": "1/s",
        "outcome": "settling",
        "recorded_at_s": 1.7e9 + 2.0,
        "flight": 1,
        "aircraft": "aerosonde",
        "configuration": "clean",
    }
    assert found[6]["value"] == 1 / 3


def test_names_and_times_select(client: httpx.Client) -> None:
    found = items(client, "names=m_q,%20z_w&from=2.5&to=2.5")
    assert [(i["estimator"], i["derivative"]) for i in found] == [
        ("ekf", "z_w"),
        ("ekf", "m_q"),
        ("fourier", "z_w"),
        ("fourier", "m_q"),
    ]
    assert items(client, "from=3.5") == []


def test_pages_join_to_the_whole(client: httpx.Client) -> None:
    joined: list[dict[str, Any]] = []
    cursor = ""
    pages = 0
    while True:
        page = client.get(f"{PATH}?limit=7{cursor}").json()
        joined += page["items"]
        pages += 1
        if page["next"] is None:
            break
        cursor = f"&cursor={page['next']}"
    assert pages == 4
    assert joined == items(client)


def test_flights_follow_each_other_and_can_be_asked_for_alone() -> None:
    """Their clocks may overlap."""
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    rows = [past(t, "ekf", "dutch_roll", [t] * 6, [0.1] * 6, flight=f) for f in (3, 8) for t in (1.0, 2.0)]
    with served(monitor, FakeHistory(rows)) as (_, client):
        found = items(client, "names=n_r")
        assert [(i["flight"], i["time_s"]) for i in found] == [(3, 1.0), (3, 2.0), (8, 1.0), (8, 2.0)]
        assert items(client, "names=n_r&flight=8") == found[2:]
        assert client.get(f"{PATH}?flight=-1").status_code == 422


def test_a_small_page_is_read_from_few_rows() -> None:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    history = FakeHistory([past(float(t), "ekf", "dutch_roll", [1.0] * 6, [0.1] * 6) for t in range(500)])
    with served(monitor, history) as (_, client):
        page = client.get(f"{PATH}?limit=1&names=n_r").json()
        for _ in range(5):
            page = client.get(f"{PATH}?limit=1&names=n_r&cursor={page['next']}").json()
        assert [i["time_s"] for i in page["items"]] == [5.0]
    assert history.most == 3


def test_csv_and_parquet_say_the_same_as_json(client: httpx.Client) -> None:
    found = items(client)
    answer = client.get(PATH, headers={"accept": "text/csv"})
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    table = list(csv.DictReader(io.StringIO(answer.text)))
    assert [float(row["time_s"]) for row in table] == [i["time_s"] for i in found]
    assert [float(row["value"]) if row["value"] else None for row in table] == [i["value"] for i in found]
    assert [row["derivative"] for row in table] == [i["derivative"] for i in found]
    answer = client.get(PATH, headers={"accept": "application/vnd.apache.parquet"})
    assert answer.headers["content-type"] == "application/vnd.apache.parquet"
    assert pq.read_table(io.BytesIO(answer.content)).to_pylist() == found


def test_an_empty_part_keeps_its_columns(client: httpx.Client) -> None:
    answer = client.get(f"{PATH}?from=99", headers={"accept": "text/csv"})
    assert answer.text.startswith("time_s,estimator,structure,derivative,value")
    answer = client.get(f"{PATH}?from=99", headers={"accept": "application/vnd.apache.parquet"})
    table = pq.read_table(io.BytesIO(answer.content))
    assert table.num_rows == 0
    assert str(table.schema.field("value").type) == "double"


def test_a_service_without_history_says_so() -> None:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    with served(monitor) as (_, client):
        answer = client.get(PATH)
    assert answer.status_code == 404
    assert "keeps no history" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("accept", "wanted"),
    [
        (None, "application/json"),
        ("", "application/json"),
        ("*/*", "application/json"),
        ("text/html,application/xhtml+xml,*/*;q=0.8", "application/json"),
        ("text/csv", "text/csv"),
        ("text/*", "text/csv"),
        ("TEXT/CSV ; q=1.0", "text/csv"),
        ("application/json;q=0.2, text/csv;q=0.9", "text/csv"),
        ("application/json;q=0, */*", "text/csv"),
        ("application/vnd.apache.parquet", "application/vnd.apache.parquet"),
        ("text/csv;q=0.5, application/vnd.apache.parquet", "application/vnd.apache.parquet"),
        ("text/csv;q=wrong, application/json;q=0.1", "application/json"),
    ],
)
def test_accept_chooses_the_form(accept: str | None, wanted: str) -> None:
    assert negotiate(accept) == wanted


@pytest.mark.parametrize("accept", ["image/png", "text/html", "application/json;q=0", ";;,,"])
def test_a_form_that_is_not_offered_is_refused_with_those_that_are(accept: str) -> None:
    with pytest.raises(
        ProblemError, match=r"application/json, text/csv, application/vnd\.apache\.parquet"
    ) as refused:
        negotiate(accept)
    assert refused.value.status == 406
