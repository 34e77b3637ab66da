"""What benchmarks of the live service share: the service in a process of its own, vehicles that fly, what REST says."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import zenoh

from wingwatch.service.kernel_steps import DEMO
from wingwatch.service.kernels import KernelCompiler
from wingwatch.simulation import FleetSimulation, Scenario
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    encode_aircraft,
    encode_sensors,
    vehicle_key,
)

RATE_HZ, SAMPLES = 50.0, 10
"""Of a vehicle, and of a message."""
FLEET = "default"
PATIENCE_S = 300.0
"""For a service that has to compile its kernels."""
_RESUMED = re.compile(r"vehicles resumed in (\d+\.\d+) s, of which (\d+\.\d+) s are processor time")


def prepare_kernels() -> None:
    """Have the kernels compiled by other processes and load them: who compiled them itself rounds some sums otherwise.

    Raises:
        KernelError: they cannot be compiled.
    """
    KernelCompiler(DEMO).prepare()


@contextmanager
def serving(folder: Path, port: int, options: Sequence[str]) -> "Iterator[subprocess.Popen[bytes]]":
    """``wingwatch serve`` in a process of its own, killed in the end; what it says is added to ``log.txt`` there.

    Args:
        folder: of its data.
        port: of REST.
        options: further ones of the command.
    """
    command = (sys.executable, "-m", "wingwatch.cli.main", "serve", "--data", str(folder))
    with (folder / "log.txt").open("ab") as log:
        process = subprocess.Popen([*command, "--port", str(port), *options], stdout=log, stderr=log)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class RestClient:
    """Questions to one service.

    Args:
        port: of REST.
        timeout_s: of a question.
    """

    def __init__(self, port: int, timeout_s: float = 15.0) -> None:
        self.http = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=timeout_s)

    def json(self, path: str) -> Any:
        """The answer of a path.

        Raises:
            httpx.HTTPError: there is none, or it is no 2xx.
        """
        return self.http.get(path).raise_for_status().json()

    def items(self, path: str) -> list[dict[str, Any]]:
        """The answer's ``items``."""
        found: list[dict[str, Any]] = self.json(path)["items"]
        return found

    def wait(self, path: str, process: "subprocess.Popen[bytes]", patience_s: float = PATIENCE_S) -> float:
        """Until a path is answered with 200; when that was, in monotonic seconds.

        Raises:
            TimeoutError: it is not, or the process has ended.
        """
        until_s = time.monotonic() + patience_s
        while time.monotonic() < until_s and process.poll() is None:
            with suppress(httpx.HTTPError):
                if self.http.get(path).status_code == 200:
                    return time.monotonic()
            time.sleep(0.01)
        raise TimeoutError(f"the service does not answer {path}")


def wait_until(condition: Callable[[], bool], patience_s: float) -> float:
    """How long it took until a condition held, s; infinite where it did not within the patience."""
    begin_s = time.monotonic()
    while time.monotonic() < begin_s + patience_s:
        with suppress(httpx.HTTPError):
            if condition():
                return time.monotonic() - begin_s
        time.sleep(0.05)
    return float("inf")


def resumed_in(log: Path) -> list[tuple[float, float]]:
    """How long resuming took at each start, s, and the processor time of it, by what the service has logged."""
    return [
        (float(took), float(spent)) for took, spent in _RESUMED.findall(log.read_text("utf-8", "replace"))
    ]


def processor_time_s(pid: int) -> float:
    """Of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Flights:
    """Vehicles that fly on from message to message, whoever listens.

    Args:
        scenarios: one a vehicle, each with a name.
        stream: number of the publishers' start.
    """

    def __init__(self, scenarios: Sequence[Scenario], stream: int) -> None:
        self.names = tuple(scenario.name for scenario in scenarios)
        self._aircraft = tuple(scenario.aircraft.name for scenario in scenarios)
        self._simulation = FleetSimulation(scenarios, RATE_HZ)
        self.stream = stream
        self.number = 0

    def announce(self, session: zenoh.Session) -> None:
        """Say what aircraft each vehicle is."""
        for name, aircraft in zip(self.names, self._aircraft, strict=True):
            message = encode_aircraft(AircraftMessage(aircraft=aircraft))
            session.put(vehicle_key(FLEET, name, "aircraft"), message, encoding=PROTOBUF)

    def send(self, session: zenoh.Session) -> Mapping[str, bytes]:
        """Send the next message of each vehicle; the payloads by vehicle."""
        sent = {}
        for name, rows in zip(self.names, self._simulation.step(SAMPLES), strict=True):
            sent[name] = encode_sensors(self.number, SampleBlock(rows), stream=self.stream)
            session.put(vehicle_key(FLEET, name, "sensors"), sent[name], encoding=PROTOBUF)
        self.number += 1
        return sent
