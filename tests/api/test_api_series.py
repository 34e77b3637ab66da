"""Derivatives over time: thinned so that extremes stay, beside what is expected, the same as CSV."""

import csv
import io
import json
from collections.abc import Generator, Sequence

import httpx
import numpy as np
import pytest
from api_fakes import FakeHistory, FakeMonitor, past, served, vehicle
from hypothesis import given
from hypothesis import strategies as st

from wingwatch.api import series as series_module
from wingwatch.api.series import column_suffix, thinned
from wingwatch.baselines import DatabaseError, HistoryColumns, HistoryKey, HistoryWanted

PATH = "/v1/vehicles/aero-1/derivatives"
INSTANTS = 120
SPIKE_AT = 61


def flown() -> FakeHistory:
    """Two minutes of two estimators; one value stands out. A flight before it was of another aircraft."""
    rows = [past(7.0, "ekf", "short_period", [9.0] * 6, [1.0] * 6, flight=1)]
    for k in range(INSTANTS):
        value = [-6.0 + 0.001 * k + (3.0 if k == SPIKE_AT else 0.0)] * 6
        both = ("ekf", "fourier")
        rows += [past(float(k), name, "short_period", value, [0.1] * 6, flight=2) for name in both]
        rows.append(past(float(k), "ekf", "lateral", [0.5] * 15, [0.2] * 15, flight=2))
    return FakeHistory(rows)


@pytest.fixture(scope="module")
def client() -> Generator[httpx.Client]:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    with served(monitor, flown()) as (_, connection):
        yield connection


@given(
    st.lists(st.one_of(st.floats(-1e6, 1e6), st.just(float("nan"))), min_size=1, max_size=300),
    st.integers(4, 60),
)
def test_thinning_keeps_the_ends_and_the_extremes_of_each_part(values: list[float], points: int) -> None:
    time_s, value = np.arange(float(len(values))), np.array(values)
    kept = thinned(time_s, value, points)
    assert len(kept) <= max(points, len(values) if len(values) <= points else points)
    assert {0, len(values) - 1} <= set(kept.tolist())
    assert np.all(np.diff(kept) > 0)
    if not np.isnan(value).all():
        assert np.nanmax(value[kept]) == np.nanmax(value)
        assert np.nanmin(value[kept]) == np.nanmin(value)


def test_a_series_has_both_estimators_beside_what_is_expected(client: httpx.Client) -> None:
    answer = client.get(f"{PATH}/series?names=m_q&points=5000").json()
    assert (answer["flight"], answer["thinned"], answer["from_s"], answer["to_s"]) == (2, False, 0.0, 119.0)
    assert [one["estimator"] for one in answer["series"]] == ["ekf", "fourier"]
    for one in answer["series"]:
        assert (one["structure"], one["derivative"], one["unit"]) == ("short_period", "m_q", "1/s")
        assert one["time_s"] == [float(k) for k in range(INSTANTS)]
        assert one["value"][SPIKE_AT] == -6.0 + 0.001 * SPIKE_AT + 3.0
        assert set(one["expected"]) == {10.0}
        assert set(one["expected_standard_error"]) == {2.5}
        assert set(one["outcome"]) == {"converged"}


def test_a_thinned_series_says_so_and_keeps_the_spike(client: httpx.Client) -> None:
    answer = client.get(f"{PATH}/series?names=m_q&points=12").json()
    assert answer["thinned"] is True
    for one in answer["series"]:
        assert len(one["time_s"]) <= 12
        assert one["kept"] == INSTANTS
        assert float(SPIKE_AT) in one["time_s"]


def test_a_part_of_an_earlier_flight_and_of_a_time_can_be_asked_for(client: httpx.Client) -> None:
    old = client.get(f"{PATH}/series?flight=1").json()["series"]
    assert {one["estimator"] for one in old} == {"ekf"}
    assert old[0]["time_s"] == [7.0]
    part = client.get(f"{PATH}/series?from=10&to=12.5&names=l_p").json()["series"]
    assert [one["time_s"] for one in part] == [[10.0, 11.0, 12.0]]
    assert client.get(f"{PATH}/series?from=500").json()["series"] == []


def test_pieces_of_the_history_make_the_same_series(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = client.get(f"{PATH}/series?points=5000").json()
    monkeypatch.setattr(series_module, "_ROWS_AT_ONCE", 7)
    assert client.get(f"{PATH}/series?points=5000").json() == whole


def test_the_csv_has_the_numbers_of_the_series_and_units_in_its_columns(client: httpx.Client) -> None:
    answer = client.get(f"{PATH}/history.csv?names=m_q,l_p")
    assert answer.headers["content-type"].startswith("text/csv")
    assert 'filename="default-aero-1-flight-2.csv"' in answer.headers["content-disposition"]
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert list(rows[0])[:9] == [
        "flight", "time_s", "estimator", "structure", "outcome", "airspeed_true_m_s", "altitude_m",
        "m_q_per_s", "m_q_standard_error_per_s",
    ]  # fmt: skip
    by_rest = client.get(f"{PATH}/series?names=m_q,l_p&points=5000").json()["series"]
    for one in by_rest:
        mine = [r for r in rows if (r["estimator"], r["structure"]) == (one["estimator"], one["structure"])]
        name = one["derivative"]
        assert [float(r["time_s"]) for r in mine] == one["time_s"]
        assert [float(r[f"{name}_per_s"]) for r in mine] == one["value"]
        assert [float(r[f"{name}_expected_per_s"]) for r in mine] == one["expected"]
    assert {r["m_q_per_s"] for r in rows if r["structure"] == "lateral"} == {""}


@pytest.mark.parametrize(
    ("unit", "suffix"),
    [
        ("1/s", "_per_s"),
        ("m/s", "_m_s"),
        ("1/(m s)", "_per_m_s"),
        ("m/s2", "_m_s2"),
        ("1/s2", "_per_s2"),
        ("", ""),
    ],
)
def test_a_unit_ends_a_column_name(unit: str, suffix: str) -> None:
    assert column_suffix(unit) == suffix


def test_flights_are_listed(client: httpx.Client) -> None:
    answer = client.get("/v1/vehicles/aero-1/flights").json()
    assert answer["kept"] is True
    items = answer["items"]
    assert [(one["flight"], one["last_time_s"]) for one in items] == [(2, 119.0), (1, 7.0)]


@pytest.mark.parametrize("path", ["derivatives/series", "derivatives/history.csv"])
def test_without_a_history_or_a_vehicle_there_is_none(client: httpx.Client, path: str) -> None:
    assert client.get(f"/v1/vehicles/nobody/{path}").status_code == 404
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    with served(monitor) as (_, bare):
        answer = bare.get(f"/v1/vehicles/aero-1/{path}")
        assert answer.status_code == 404
        assert "keeps no history" in answer.json()["detail"]
        assert bare.get("/v1/vehicles/aero-1/flights").json() == {"items": [], "kept": False, "next": None}
    assert client.get("/v1/vehicles/nobody/flights").status_code == 404


@pytest.mark.parametrize("query", ["points=3", "from=5&to=4", "names=m_x", "step=2"])
def test_a_question_that_makes_no_sense_is_refused(client: httpx.Client, query: str) -> None:
    answer = client.get(f"{PATH}/series?{query}")
    assert answer.status_code == 422
    assert json.loads(answer.text)["detail"]


def test_a_database_that_cannot_answer_is_said_before_the_csv_begins() -> None:
    class Locked(FakeHistory):
        def history_columns(
            self, fleet: str, vehicle: str, wanted: HistoryWanted
        ) -> tuple[Sequence[HistoryColumns], HistoryKey | None]:
            raise DatabaseError("database wingwatch.db is locked by another program; end it or wait")

    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    with served(monitor, Locked(flown().rows)) as (_, connection):
        answers = [connection.get(f"{PATH}/{name}") for name in ("series", "history.csv")]
    assert [answer.status_code for answer in answers] == [503, 503]
