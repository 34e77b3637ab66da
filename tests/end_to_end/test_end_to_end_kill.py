"""An elevator has lost effect, the service is killed and started again: the alert stands, the fault teaches nothing."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from live import CLIENT, COMPILE_S, put, until
from loopback import free_endpoint, free_port

from wingwatch.aircraft import load_aircraft
from wingwatch.simulation import ElevatorEffectiveness, Scenario, doublet_schedule, simulate
from wingwatch.telemetry import (
    AircraftMessage,
    SampleBlock,
    ZenohSettings,
    encode_aircraft,
    encode_sensors,
    open_session,
    vehicle_key,
)

AEROSONDE = load_aircraft("aerosonde")
FAULT_S, KILLED_S, SECONDS, PIECE = 60, 130, 420, 50


class Served:
    """A service in a process of its own."""

    def __init__(self, port: int, endpoint: str, process: "subprocess.Popen[bytes]", log: Path) -> None:
        self.url, self.endpoint, self.process = f"http://127.0.0.1:{port}", endpoint, process
        self.log = log

    def get(self, path: str) -> Any:
        return CLIENT.get(f"{self.url}{path}").raise_for_status().json()

    def answers(self, path: str) -> bool:
        assert self.process.poll() is None, self.log.read_text()
        try:
            return CLIENT.get(f"{self.url}{path}").status_code == 200
        except httpx.HTTPError:
            return False

    def fly(self, flight: SampleBlock, from_s: int, to_s: int) -> None:
        """A second of samples a message, until all of them are taken in."""
        with open_session(ZenohSettings.for_vehicle((self.endpoint,))) as session:
            put(
                session,
                vehicle_key("default", "uav", "aircraft"),
                encode_aircraft(AircraftMessage(aircraft="aerosonde")),
            )
            for k in range(from_s, to_s):
                rows = SampleBlock(flight.values[k * PIECE : (k + 1) * PIECE])
                put(session, vehicle_key("default", "uav", "sensors"), encode_sensors(k, rows, stream=3))
                time.sleep(0.005)
            last_s = float(flight.time_s[to_s * PIECE - 1])
            until(lambda: self.get("/v1/vehicles/uav")["last_sample_time_s"] == last_s)


@contextmanager
def served(folder: Path) -> Iterator[Served]:
    port, endpoint = free_port(), free_endpoint()
    command = [
        sys.executable,
        "-m",
        "wingwatch.cli.main",
        "serve",
        "--data",
        str(folder),
        "--port",
        str(port),
    ]
    with (folder / "log").open("ab") as log:
        process = subprocess.Popen([*command, "--listen", endpoint], stdout=log, stderr=log)
    try:
        yield Served(port, endpoint, process, folder / "log")
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_an_alert_stands_through_a_kill_and_the_fault_teaches_nothing(tmp_path: Path) -> None:
    doublets = doublet_schedule(AEROSONDE, Scenario(AEROSONDE).condition)
    effect = ElevatorEffectiveness(0.6, float(FAULT_S))
    flight = simulate(Scenario(AEROSONDE, manoeuvres=(doublets,), effects=(effect,), seed=3), float(SECONDS))
    with served(tmp_path) as service:
        until(lambda: service.answers("/health/ready"), COMPILE_S)
        service.fly(flight, 0, KILLED_S)
        before = service.get("/v1/vehicles/uav")
        alerts = service.get("/v1/alerts")["items"]
        assert (before["state"], len(alerts)) == ("degraded", 1)
    with served(tmp_path) as service:
        until(lambda: service.answers("/v1/vehicles"), COMPILE_S)
        first = service.get("/v1/vehicles/uav")
        assert (first["state"], first["active_alerts"]) == ("degraded", before["active_alerts"])
        until(lambda: service.answers("/health/ready"), COMPILE_S)
        service.fly(flight, KILLED_S + 3, SECONDS)
        assert service.get("/v1/vehicles/uav")["state"] == "degraded"
        assert [alert["id"] for alert in service.get("/v1/alerts")["items"]] == [alerts[0]["id"]]
        modes = service.get("/v1/vehicles/uav/derivatives")["estimators"]["ekf"]["short_period"][
            "derivatives"
        ]
        assert modes["m_eta"]["expected"] < 1.5 * modes["m_eta"]["value"]  # that of before the fault
        counters = service.get("/v1/status")["counters"]["checkpoints"]
        assert (counters["resumed"], counters["refused"], counters["failed"]) == (1, 0, 0)
        assert counters["written"] > 0
