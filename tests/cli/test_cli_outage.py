"""A database that is locked or frozen: samples are taken in, nothing announced is lost, and it heals by itself."""

import os
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
import pytest
from cli_services import service_in
from postgres_cluster import PostgresCluster, find_programs
from test_cli_checkpoints import saved

from wingwatch.aircraft import load_aircraft
from wingwatch.baselines import DatabaseError, open_database
from wingwatch.monitor import AlertAction, AlertState, AlertView, FleetMonitor, FleetPorts
from wingwatch.service.patient import PatientReader
from wingwatch.service.store import DatabaseStore
from wingwatch.service.stored_alerts import alert_record
from wingwatch.simulation import Scenario, simulate
from wingwatch.telemetry import PROTOBUF, AircraftMessage, SampleBlock, encode_aircraft, encode_sensors

ALERT = AlertView(
    id="a1", fleet="default", vehicle="uav1", kind="icing", cause="icing", level="warning",
    state=AlertState.ACTIVE, raised_s=80.5, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97,
    basis="a-priori", text="Icing.", evidence=(),
)  # fmt: skip
PATIENCE_S = 30.0
OUTAGE_S = float(os.environ.get("WINGWATCH_TEST_OUTAGE_S", "8"))
"""A minute differs from this only in how long the test takes: every limit that is waited for is shorter."""
LONGEST_DELAY_S = 0.25


@dataclass(frozen=True)
class Outage:
    """A database, and how it stops answering."""

    where: str
    begin: Callable[[], AbstractContextManager[None]]
    said: tuple[str, ...]


@contextmanager
def locked(path: Path) -> Iterator[None]:
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


@pytest.fixture(params=["sqlite", "postgres"])
def outage(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Outage]:
    if request.param == "sqlite":
        path = tmp_path / "w.db"
        yield Outage(str(path), lambda: locked(path), ("is locked by another program",))
        return
    if find_programs() is None:
        pytest.skip("no PostgreSQL server is installed: install the package postgresql")
    # One of its own, which no other test freezes or waits for; a path short enough for a socket.
    with (
        TemporaryDirectory() as folder,
        TemporaryDirectory() as data,
        PostgresCluster(Path(folder), Path(data)) as cluster,
    ):
        yield Outage(cluster.url, cluster.frozen, ("has not answered", "wait"))


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def test_the_service_says_what_is_wrong_answers_all_else_and_heals(outage: Outage, tmp_path: Path) -> None:
    with open_database(outage.where) as database:
        database.save_alert(alert_record(ALERT, 1.0, 1.0))
    with (
        service_in(tmp_path / "data", database=outage.where) as service,
        httpx.Client(base_url=service.url, timeout=30.0) as client,
    ):

        def act() -> httpx.Response:
            return client.post("/v1/alerts/a1/acknowledge", json={"who": "ann"})

        def problem() -> str:
            return str(client.get("/health/ready").json()["checks"]["database"])

        until(lambda: problem() == "None")
        with outage.begin():
            refused = act()
            assert refused.status_code == 503
            assert "nothing has happened" in refused.json()["detail"]
            assert any(words in problem() for words in outage.said)
            with service.monitor._lock:
                service.monitor._alerts.keep(replace(ALERT, id="a2"))
            until(lambda: "the database" in str(client.get("/v1/status").json()["database"]))
            for path in ("/v1/status", "/v1/alerts/a1", "/health/live"):
                began = time.monotonic()
                assert client.get(path).status_code == 200
                assert time.monotonic() - began < 5.0
            assert client.get("/v1/alerts/a2").status_code == 404
        until(lambda: problem() == "None")
        until(lambda: client.get("/v1/status").json()["database"] is None)
        until(lambda: client.get("/v1/alerts/a2").status_code == 200)
        assert client.get("/v1/alerts/a1").json()["state"] == "active"
        acted = act()
        assert acted.json().get("state") == "acknowledged", acted.text

    def notes() -> tuple[str, ...]:
        """As a program that begins now reads them; a server that has just come back may answer too late once."""
        with suppress(DatabaseError), open_database(outage.where) as database:
            kept = database.alert("a1")
            assert kept is not None
            return tuple(kept.note)
        return ()

    until(lambda: notes() == ("ann: acknowledge",))


def test_states_that_cannot_be_saved_are_said_and_it_heals(tmp_path: Path) -> None:
    """The database may be another machine's, and work."""
    with service_in(tmp_path) as service, httpx.Client(base_url=service.url, timeout=30.0) as client:

        def problem() -> str | None:
            found: str | None = client.get("/health/ready").json()["checks"]["checkpoints"]
            return found

        assert problem() is None
        place = tmp_path / "wingwatch.db.checkpoints"
        place.write_text("in the way")
        service._parts.watch.checkpoints.write(saved("a"))
        assert str(problem()).startswith("states of vehicles are not saved: FileExistsError")
        place.unlink()
        service._parts.watch.checkpoints.write(saved("a"))
        assert problem() is None


@pytest.mark.slow
def test_samples_are_taken_in_while_the_database_does_not_answer(outage: Outage) -> None:
    flight = simulate(Scenario(load_aircraft("aerosonde"), seed=3), 330.0)
    numbers = count()
    with (
        open_database(outage.where, busy_timeout_s=1.0) as database,
        DatabaseStore(database, time.time) as store,
    ):
        fleet = FleetMonitor(load_aircraft, time.monotonic, lambda: "a9", FleetPorts(store))
        fleet.receive(
            "default", "uav1", "aircraft", encode_aircraft(AircraftMessage(aircraft="aerosonde")), PROTOBUF
        )

        def take_in() -> float:
            """One message of a second; how long it took."""
            k = next(numbers)
            payload = encode_sensors(k, SampleBlock(flight.values[50 * k : 50 * k + 50]), PROTOBUF)
            began = time.monotonic()
            fleet.receive("default", "uav1", "sensors", payload, PROTOBUF)
            fleet.tick()
            return time.monotonic() - began

        take_in()
        until(lambda: (fleet.tick() or fleet.vehicle("default", "uav1")).counts.get("accepted", 0) > 0)  # type: ignore[func-returns-value, union-attr]
        before = [take_in() for _ in range(20)]
        with outage.begin():
            with fleet._lock:
                fleet._alerts.keep(ALERT)
                fleet._alerts.keep(replace(ALERT, level="critical"))
            ended = time.monotonic() + OUTAGE_S
            during = []
            while time.monotonic() < ended:
                during.append(take_in())
                time.sleep(0.2)
            assert fleet.alerts() == []
        until(lambda: [a.level for a in fleet.alerts()] == ["critical"])
        acted = fleet.act_on_alert("a1", AlertAction.ACKNOWLEDGE, "ann", "")
        assert acted is not None
        until(lambda: store.problem is None)
    assert sorted(during)[len(during) * 99 // 100] < max(LONGEST_DELAY_S, 3.0 * max(before))


def test_who_asks_a_frozen_database_waits_for_a_bounded_time() -> None:
    thawed = threading.Event()
    reader = PatientReader(patience_s=0.2, most=2)
    for sentence in ("within 0.2 s", "within 0.2 s", "earlier questions"):
        began = time.monotonic()
        with pytest.raises(DatabaseError, match=sentence):
            reader.ask(lambda: thawed.wait(PATIENCE_S))
        assert time.monotonic() - began < 2.0
    thawed.set()
    assert reader.ask(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        reader.ask(lambda: 1 / 0)
