"""A gateway and workers as processes over loopback, and three vehicles that fly: what is watched, and what was shown.

The gateway is what vehicles and workers connect to. Workers are ended, killed and frozen by who uses this.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import zenoh
from loopback import free_endpoint, free_port
from service_process import FLEET, PATIENCE_S, RATE_HZ, SAMPLES, Flights, RestClient

from wingwatch.aircraft import load_aircraft
from wingwatch.simulation import AileronEffectiveness, ElevatorEffectiveness, Scenario, doublet_schedule
from wingwatch.telemetry import ZenohSettings, open_session

__all__ = ["Shown", "WorkerFleet", "flown", "worker_fleet"]

STREAM = 11
AT_ONCE_S = 0.05
LOOK_S = 0.1
TWICE_WITHIN_S = 1.0


def scenarios() -> list[Scenario]:
    """A healthy vehicle, one that loses elevator effect, one that loses aileron effect."""
    aircraft = load_aircraft("aerosonde")
    schedule = doublet_schedule(aircraft, Scenario(aircraft).condition)
    effects = ((), (ElevatorEffectiveness(0.6, 60.0),), (AileronEffectiveness(0.6, 60.0),))
    return [
        Scenario(aircraft, manoeuvres=(schedule,), effects=effect, seed=i, name=f"v{i}")
        for i, effect in enumerate(effects)
    ]


class Shown:
    """What has been said: alerts by REST, and solutions on Zenoh.

    Attributes:
        announced: alerts that REST has shown, with their vehicles; in_force: those of them that stood when last seen.
        turned_healthy: looks at which a vehicle with an alert in force was healthy.
        lost: alerts that were shown and are not any more.
        solutions: how many were published; twice: vehicles that two workers watched at the same time.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self.announced: dict[str, str] = {}
        self.in_force: set[str] = set()
        self.turned_healthy = 0
        self.lost: set[str] = set()
        self.solutions = 0
        self.twice: set[str] = set()
        self._newest_s: dict[str, float] = {}
        self._repeated_s: dict[str, float] = {}
        heard = zenoh.handlers.Callback(self._heard, indirect=False)
        self._subscriber: Any = session.declare_subscriber(f"wingwatch/v1/{FLEET}/*/derivatives", heard)

    def _heard(self, sample: Any) -> None:
        solution = json.loads(sample.payload.to_bytes())
        self.solved(str(sample.key_expr).split("/")[-2], solution["time_s"], time.monotonic())

    def solved(self, vehicle: str, time_s: float, now_s: float) -> None:
        """A solution was published.

        Whoever takes a vehicle over from a checkpoint goes over the samples that waited in it: its first solution may
        be older than the last that was published. Where two workers watch a vehicle, that happens again and again.
        """
        self.solutions += 1
        if time_s <= self._newest_s.get(vehicle, float("-inf")):
            if now_s - self._repeated_s.get(vehicle, float("-inf")) < TWICE_WITHIN_S:
                self.twice.add(vehicle)
            self._repeated_s[vehicle] = now_s
        self._newest_s[vehicle] = time_s

    def look(self, alerts: Collection[Mapping[str, Any]], vehicles: Collection[Mapping[str, Any]]) -> None:
        """Take in what REST shows now."""
        self.lost = self.announced.keys() - {alert["id"] for alert in alerts}
        self.announced |= {alert["id"]: alert["vehicle"] for alert in alerts}
        before, self.in_force = self.in_force, {a["id"] for a in alerts if a["state"] != "cleared"}
        ill = {self.announced[alert] for alert in before & self.in_force}
        self.turned_healthy += sum(one["vehicle"] in ill and one["state"] == "healthy" for one in vehicles)


class WorkerFleet:
    """The processes, and vehicles that fly while somebody waits.

    Args:
        folder: of the data that all share.
    """

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._folder, self._stack = folder, stack
        self._endpoint, port = free_endpoint(), free_port()
        self._log = stack.enter_context((folder / "log.txt").open("ab"))
        self.workers: dict[str, subprocess.Popen[bytes]] = {}
        self._gateway = self._started("gateway", "--port", str(port), "--listen", self._endpoint)
        self.rest = RestClient(port)
        stack.callback(self.rest.http.close)
        self.rest.wait("/health/live", self._gateway)
        self.session = stack.enter_context(open_session(ZenohSettings.for_vehicle((self._endpoint,))))
        self.shown = Shown(self.session)
        self.flights = Flights(scenarios(), STREAM)
        self._next_s, self._looked_s = time.monotonic(), 0.0
        self.speed = 1.0

    def _started(self, *options: str) -> "subprocess.Popen[bytes]":
        command = (sys.executable, "-m", "wingwatch.cli.main", *options, "--data", str(self._folder))
        process = subprocess.Popen(command, stdout=self._log, stderr=self._log)
        self._stack.callback(_end, process)
        return process

    def start(self, name: str) -> None:
        """A worker, by a name that no other has; it is waited for by ``until``."""
        self.workers[name] = self._started("worker", "--connect", self._endpoint, "--worker-name", name)

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a worker a signal; one that ends it is waited for."""
        self.workers[name].send_signal(number)
        if number in (signal.SIGKILL, signal.SIGTERM):
            process = self.workers.pop(name)
            if number is signal.SIGKILL:
                process.wait()

    @property
    def flown_s(self) -> float:
        """Time of the vehicles' flight."""
        return self.flights.number * SAMPLES / RATE_HZ

    def fly(self) -> None:
        """Send what is due, for a twentieth of a second."""
        until_s = time.monotonic() + AT_ONCE_S
        while time.monotonic() < until_s:
            if self._next_s <= time.monotonic():
                self.flights.send(self.session)
                self._next_s = max(self._next_s, time.monotonic() - 1.0) + SAMPLES / RATE_HZ / self.speed
            time.sleep(min(0.005, max(0.0, self._next_s - time.monotonic())))

    def until(self, condition: Callable[[], object], patience_s: float = PATIENCE_S) -> float:
        """Fly until a condition holds, and look at what is shown; how long that took, s.

        Raises:
            TimeoutError: it does not within the patience.
        """
        began_s = time.monotonic()
        while True:
            self.fly()
            with suppress(httpx.HTTPError):
                self.look()
                if condition():
                    return time.monotonic() - began_s
            if time.monotonic() - began_s > patience_s:
                raise TimeoutError(f"waited for {patience_s:.0f} s in vain")

    def wait(self, seconds: float) -> None:
        """Fly for so long."""
        until_s = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > until_s)

    def look(self) -> None:
        """Read alerts and vehicles, ten times a second at most."""
        if time.monotonic() - self._looked_s >= LOOK_S:
            self._looked_s = time.monotonic()
            alerts = self.rest.items("/v1/alerts")
            self.shown.look(alerts, self.rest.items("/v1/vehicles"))

    def vehicles(self) -> dict[str, dict[str, Any]]:
        """As REST shows them, by name."""
        return {one["vehicle"]: one for one in self.rest.items("/v1/vehicles")}

    def watcher(self, vehicle: str) -> str | None:
        """The worker that a vehicle is shown with, by the name that it was started under."""
        shown = self.vehicles().get(vehicle, {}).get("worker") or ""
        return next((name for name in self.workers if shown.startswith(f"{name}-")), None)

    def watched(self, since_s: float, by: Collection[str]) -> bool:
        """Whether some of these workers have taken in what all vehicles have sent after a time of flight."""
        shown = self.vehicles()
        return len(shown) == len(self.flights.names) and all(
            (one["last_sample_time_s"] or 0.0) > since_s and (one["worker"] or "").rpartition("-")[0] in by
            for one in shown.values()
        )

    def counter(self, part: str, name: str) -> int:
        """A counter of ``/v1/status``, of all workers in sum."""
        return int(self.rest.json("/v1/status")["counters"][part].get(name, 0))


def _end(process: "subprocess.Popen[bytes]") -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()


@contextmanager
def worker_fleet(folder: Path, *names: str) -> Iterator[WorkerFleet]:
    """A gateway and workers; they and what flies end with it."""
    with ExitStack() as stack:
        fleet = WorkerFleet(folder, stack)
        for name in names:
            fleet.start(name)
        fleet.until(lambda: fleet.rest.json("/health/ready")["ready"])
        fleet.flights.announce(fleet.session)
        yield fleet


def flown(fleet: WorkerFleet, alerts: int, speed: float) -> None:
    """Fly, faster than vehicles do, until so many alerts are in force."""
    fleet.speed, before = speed, fleet.speed
    fleet.until(lambda: len(fleet.shown.in_force) >= alerts)
    fleet.speed = before
