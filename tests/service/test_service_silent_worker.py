"""Workers that freeze, end or lie: a gateway goes on, and says what it does not know."""

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import httpx
import pytest
from api_fakes import FakeMonitor, alert, vehicle
from worker_hall import Gateway, Said, hub, until, worker

from wingwatch.api import AppSettings, HttpServer, WorkerSilentError, create_app, listen
from wingwatch.monitor import AlertAction, Event, VehicleState, VehicleView
from wingwatch.monitor.positions import Place, Position
from wingwatch.monitor.views import FleetFigures


class Monitor(FakeMonitor):
    """A fleet by hand that can be frozen."""

    def __init__(self, *views: VehicleView) -> None:
        super().__init__()
        self.views = list(views)
        self.free = threading.Event()
        self.free.set()

    def vehicles(self) -> Sequence[VehicleView]:
        self.free.wait(30.0)
        return super().vehicles()

    def brief(self) -> Sequence[VehicleView]:
        return self.vehicles()

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        self.free.wait(30.0)
        return super().vehicle(fleet, vehicle)

    def alert_places(self) -> Mapping[str, tuple[int, Place]]:
        return {}


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    for place in ("link.PATIENCE_S", "watchers.SILENT_S"):
        monkeypatch.setattr(f"wingwatch.service.workers.{place}", 0.4)


@contextmanager
def seen(*monitors: Monitor) -> Iterator[Gateway]:
    """Workers w0, w1, ... and what a gateway sees of them."""
    with hub() as (_, endpoint):
        held = [worker(endpoint, monitor, Said(f"w{k}")) for k, monitor in enumerate(monitors)]
        for one in held:
            one.__enter__()
        gateway = Gateway(endpoint, lambda: [alert(1)])
        try:
            until(lambda: len(gateway.fleet.vehicles()) == sum(len(one.views) for one in monitors))
            yield gateway
        finally:
            gateway.close()
            for monitor, one in zip(monitors, held, strict=True):
                monitor.free.set()
                one.__exit__(None, None, None)


@pytest.mark.usefixtures("impatient")
def test_vehicles_of_a_frozen_worker_are_unknown_and_nobody_waits_for_them() -> None:
    ill = vehicle("aero-2", VehicleState.DEGRADED, reason="Icing.")
    frozen, good = Monitor(vehicle("uav"), ill), Monitor(vehicle("other"))
    with seen(frozen, good) as gateway:
        fleet = gateway.fleet
        frozen.free.clear()
        until(lambda: fleet.states()["w0"][1] > 0.0)
        views = {view.vehicle: view for view in fleet.vehicles()}
        assert views["uav"].state is VehicleState.UNKNOWN
        assert views["uav"].reason.startswith("its worker w0 has not answered for")
        assert views["aero-2"].state is VehicleState.DEGRADED
        assert views["aero-2"].reason.startswith("Icing. Meanwhile its worker w0 has not")
        assert views["other"].state is VehicleState.HEALTHY
        began_s = time.monotonic()
        assert fleet.vehicle("default", "uav") is not None
        with pytest.raises(WorkerSilentError, match="worker w0 has not answered for"):
            fleet.derivatives("default", "uav")
        with pytest.raises(WorkerSilentError, match="and is not asked"):
            fleet.act_on_alert("a1", AlertAction.CLEAR, "lead", "")
        assert time.monotonic() - began_s < 5.0 * 0.4  # none of the three has waited for its answer
        frozen.free.set()
        until(lambda: fleet.states()["w0"][1] == 0.0 and fleet.vehicles()[-1].state is VehicleState.HEALTHY)


@pytest.mark.usefixtures("impatient")
def test_what_rest_says_of_a_frozen_worker_s_vehicle() -> None:
    frozen = Monitor(vehicle("uav"))
    with seen(frozen) as gateway:
        frozen.free.clear()
        until(lambda: gateway.fleet.states()["w0"][1] > 0.0)
        app = create_app(gateway.fleet, dict, None, "1", AppSettings(waits=True))
        with HttpServer(app, listen("127.0.0.1", 0)) as server:
            answer = httpx.get(f"{server.url}/v1/vehicles/uav/derivatives")
            assert answer.status_code == 503
            assert answer.json()["detail"].startswith("Worker w0 has not answered for")
            view = httpx.get(f"{server.url}/v1/vehicles/uav").json()
            assert (view["state"], view["worker"]) == ("unknown", "w0")


def test_a_worker_that_ends_leaves_its_vehicles_unknown_until_another_has_them() -> None:
    first, second = Monitor(vehicle("uav")), Monitor()
    with hub() as (_, endpoint), worker(endpoint, second, Said("w1")):
        with worker(
            endpoint, first, Said("w0", {"loop": {"faults": 2}}, lambda: FleetFigures({}, {}, {}, 7, 0))
        ):
            gateway = Gateway(endpoint)
            fleet = gateway.fleet
            until(lambda: len(fleet.vehicles()) == 1 and len(fleet.states()) == 2)
        until(lambda: len(fleet.states()) == 1)
        (view,) = fleet.vehicles()
        assert (view.state, view.worker) == (VehicleState.UNKNOWN, None)
        assert view.reason == "its worker w0 has ended, and no other watches it"
        assert fleet.vehicle("default", "uav") is not None
        with pytest.raises(WorkerSilentError, match="its worker w0 has ended"):
            fleet.derivatives("default", "uav")
        assert fleet.gone_counters() == {"loop": {"faults": 2}}
        assert fleet.figures().solutions == 7
        assert fleet.events(-1)[-1].data["state"] == "unknown"
        second.views.append(vehicle("uav"))
        until(lambda: fleet.vehicles()[0].worker == "w1")
        gateway.close()


def test_of_two_workers_that_have_a_vehicle_the_one_with_newer_samples_is_shown() -> None:
    old, new = Monitor(vehicle("uav", sample_age_s=9.0)), Monitor(vehicle("uav", sample_age_s=0.5))
    with hub() as (_, endpoint), worker(endpoint, old, Said("w0")), worker(endpoint, new, Said("w1")):
        gateway = Gateway(endpoint)
        until(lambda: [view.worker for view in gateway.fleet.vehicles()] == ["w1"])
        until(lambda: len(gateway.fleet.states()) == 2)
        assert [view.worker for view in gateway.fleet.vehicles()] == ["w1"]
        gateway.close()


def test_ice_on_vehicles_of_two_workers_is_one_event() -> None:
    monitors = Monitor(vehicle("aero-1")), Monitor(vehicle("aero-2"))
    for k, monitor in enumerate(monitors):
        monitor.raised = [alert(k, vehicle=f"aero-{k + 1}")]
        place = Place(Position(47.0, 8.0 + 0.01 * k, 900.0), 100.0)
        monitor.alert_places = lambda k=k, place=place: {f"a{k}": (0, place)}  # type: ignore[method-assign, misc]
    with seen(*monitors) as gateway:
        until(lambda: gateway.fleet.alert_groups())
        (group,) = gateway.fleet.alert_groups()
        assert set(group.alerts) == {"a0", "a1"}


def test_missed_events_of_a_worker_are_said_to_be_missed() -> None:
    monitor = Monitor(vehicle("uav"))
    with seen(monitor) as gateway:
        monitor.kept.append(Event(5, "status", {"fleet": "default", "vehicle": "uav", "state": "healthy"}))
        until(lambda: gateway.fleet.events(-1))
        assert gateway.fleet.events_complete_after() == 0
        monitor.events_complete_after = lambda: 8  # type: ignore[method-assign]
        monitor.kept.append(Event(9, "status", {"fleet": "default", "vehicle": "uav", "state": "stale"}))
        until(lambda: gateway.fleet.events_complete_after() > 0)


def test_alerts_of_the_database_and_of_workers_are_one_list_without_repeats() -> None:
    monitor = Monitor(vehicle("aero-2"))
    monitor.raised = [replace(alert(1), diagnosis_id="d1"), alert(2)]
    with seen(monitor) as gateway:
        until(lambda: len(gateway.fleet.alerts()) == 2)
        until(lambda: gateway.fleet.alerts()[-1].diagnosis_id == "d1")
        assert [one.id for one in gateway.fleet.alerts()] == ["a2", "a1"]
        gateway.fleet._book.look()
        assert {one.id: one.diagnosis_id for one in gateway.fleet.alerts()} == {"a1": "d1"}
