"""Two workers and a gateway over one data folder: each vehicle is watched once, and goes on where a worker leaves."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh
from fleet_hall import fly_doublets
from loopback import free_endpoint
from worker_hall import until

from wingwatch.monitor import AlertAction, AlertState, VehicleState
from wingwatch.service.settings import ServeSettings
from wingwatch.service.workers.gateway import running_gateway
from wingwatch.service.workers.worker import running_worker
from wingwatch.simulation import ElevatorEffectiveness
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    ZenohSettings,
    encode_aircraft,
    encode_sensors,
    open_session,
    vehicle_key,
)

NAMES = ("uav0", "uav1", "uav2", "uav3", "uav4")
ILL = NAMES[0]
SAMPLES = 50


class Loaded:
    """A preparation that has nothing to do: kernels are loaded at their first use."""

    def prepare(self) -> bool:
        return True

    def view(self) -> None:
        return None

    def stop(self) -> None:
        pass


class Vehicles:
    """Vehicles that send the same flight, one of them with a fault; they say what they are once."""

    def __init__(self, endpoint: str, stack: ExitStack) -> None:
        self._session = stack.enter_context(open_session(ZenohSettings.for_vehicle((endpoint,))))
        sound = fly_doublets(20.0)
        self._flights = dict.fromkeys(NAMES, sound)
        self.sent = 0

    def give(self, name: str, flight: SampleBlock) -> None:
        """A longer flight for one of them."""
        self._flights[name] = flight

    def announce(self) -> None:
        for name in NAMES:
            message = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
            self._session.put(vehicle_key("default", name, "aircraft"), message, encoding=PROTOBUF)

    def send(self, seconds: int, *names: str) -> None:
        """The next seconds of some, a message each second."""
        for k in range(self.sent, self.sent + seconds):
            for name in names or NAMES:
                block = SampleBlock(self._flights[name].values[k * SAMPLES : (k + 1) * SAMPLES])
                self._session.put(
                    vehicle_key("default", name, "sensors"),
                    encode_sensors(k, block, stream=1),
                    encoding=PROTOBUF,
                    congestion_control=zenoh.CongestionControl.BLOCK,  # a busy machine loses none
                )
        self.sent += seconds


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Any]:
    """A gateway that workers connect to, what starts one, and vehicles."""
    endpoint = free_endpoint()
    of_worker: dict[str, Any] = {"connect": (endpoint,), "data": tmp_path, "diagnose_alerts": False}

    def start(name: str, stack: ExitStack) -> Any:
        settings = ServeSettings(worker_name=name, **of_worker)
        return stack.enter_context(running_worker(settings, preparation=Loaded()))

    with ExitStack() as stack:
        settings = ServeSettings(port=0, listen=(endpoint,), data=tmp_path, documents=None)
        gateway = stack.enter_context(running_gateway(settings))
        vehicles = Vehicles(endpoint, stack)
        yield SimpleNamespace(
            gateway=gateway, seen=gateway.fleet, start=start, vehicles=vehicles, stack=stack
        )


def watchers(fleet: Any) -> dict[str, str | None]:
    """By vehicle its worker, as that was named."""
    return {view.vehicle: view.worker and view.worker[0] for view in fleet.seen.vehicles()}


def accepted(fleet: Any) -> dict[str, int]:
    return {view.vehicle: view.counts.get("accepted", 0) for view in fleet.seen.vehicles()}


def test_a_worker_that_leaves_hands_its_vehicles_over_and_one_that_comes_takes_its_part(fleet: Any) -> None:
    first = fleet.stack.enter_context(ExitStack())
    fleet.start("a", first)
    until(lambda: fleet.gateway.waits_for is None)
    fleet.vehicles.announce()
    until(lambda: watchers(fleet) == dict.fromkeys(NAMES, "a"))
    fleet.vehicles.send(4)
    until(lambda: accepted(fleet) == dict.fromkeys(NAMES, 4 * SAMPLES))

    fleet.start("b", fleet.stack)  # it has not been there when the vehicles said what they are
    until(lambda: set(watchers(fleet).values()) == {"a", "b"})
    until(lambda: sum(one.vehicles for one in workers(fleet)) == len(NAMES))
    both = watchers(fleet)
    until(lambda: all(ready(fleet, name, worker) for name, worker in both.items()))
    fleet.vehicles.send(4)
    until(lambda: accepted(fleet) == dict.fromkeys(NAMES, 8 * SAMPLES))
    until(lambda: total(fleet) == 8 * SAMPLES * len(NAMES))

    first.close()
    until(lambda: watchers(fleet) == dict.fromkeys(NAMES, "b"))
    until(lambda: all(ready(fleet, name, "b") for name in NAMES))
    fleet.vehicles.send(4)
    until(lambda: accepted(fleet) == dict.fromkeys(NAMES, 12 * SAMPLES))
    assert all("gap" not in view.counts for view in fleet.seen.vehicles())
    until(lambda: total(fleet) == 12 * SAMPLES * len(NAMES))


def test_an_alert_stands_through_the_end_of_its_worker_and_can_be_acted_on_at_the_next(fleet: Any) -> None:
    first = fleet.stack.enter_context(ExitStack())
    fleet.start("a", first)
    until(lambda: fleet.gateway.waits_for is None)
    fleet.vehicles.give(ILL, fly_doublets(130.0, ElevatorEffectiveness(0.5, 60.0)))
    fleet.vehicles.announce()
    until(lambda: watchers(fleet).get(ILL) == "a")
    fleet.vehicles.send(125, ILL)
    until(lambda: fleet.seen.alerts())
    until(lambda: fleet.seen.vehicle("default", ILL).last_sample_time_s > 124.0)
    (alert,) = fleet.seen.alerts()
    second = fleet.stack.enter_context(ExitStack())
    fleet.start("b", second)
    first.close()
    until(lambda: watchers(fleet)[ILL] == "b")
    until(lambda: fleet.seen.vehicle("default", ILL).state is VehicleState.DEGRADED)
    assert fleet.seen.vehicle("default", ILL).active_alerts == [alert.id]
    assert fleet.seen.act_on_alert(alert.id, AlertAction.ACKNOWLEDGE, "lead", "seen") is not None
    (acted,) = fleet.seen.alerts()
    assert (acted.id, acted.state, acted.note[-1]) == (
        alert.id,
        AlertState.ACKNOWLEDGED,
        "lead: acknowledge (seen)",
    )
    second.close()
    fleet.start("c", fleet.stack)  # nothing is sent to it
    until(lambda: [one.name[0] for one in workers(fleet)] == ["c"])
    assert fleet.seen.act_on_alert(alert.id, AlertAction.CLEAR, "lead", "repaired") is not None
    assert fleet.seen.alerts()[0].state is AlertState.CLEARED


def total(fleet: Any) -> int:
    """Samples accepted by all workers, those that have ended included."""
    return int(fleet.seen.figures().counts.get("accepted", 0))


def workers(fleet: Any) -> list[Any]:
    return [state.view for state, _ in fleet.seen.states().values() if state is not None]


def ready(fleet: Any, name: str, worker: str | None) -> bool:
    """Whether a vehicle is watched by a worker, its state resumed."""
    view = fleet.seen.vehicle("default", name)
    return view is not None and (view.worker or "?")[0] == worker and view.counts.get("accepted", 0) > 0
