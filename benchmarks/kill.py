"""A service killed with SIGKILL at random instants and started again on the same data, while three vehicles fly on.

The service is ``wingwatch serve`` in a process of its own. Vehicles are simulated and sent over Zenoh on loopback,
faster than they fly; one loses elevator, one aileron effect. Between two kills alerts are read and acted on over REST.
Each time the newest checkpoints are compared with an uninterrupted run in this process, to which the same messages were
given: those that the service counts as taken in. Instants, flights and actions are drawn with a seed; how far a message
gets before a kill is the machine's affair.

Run: python benchmarks/kill.py [--kills 200] [--seed 0] [--speed 4]
"""

import argparse
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

import httpx
import numpy as np
import zenoh

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import AlertState, JudgeConfig, VehicleMemory, VehicleMonitor, decode_checkpoint
from wingwatch.monitor.cell_memory import CellBookState
from wingwatch.monitor.chain import SavedChain
from wingwatch.monitor.checkpoint import CODEC, SavedVehicle
from wingwatch.monitor.monitor_state import MonitorState
from wingwatch.monitor.monitors import MonitorMaker
from wingwatch.simulation import (
    AileronEffectiveness,
    ElevatorEffectiveness,
    FleetSimulation,
    Scenario,
    doublet_schedule,
)
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    SensorsMessage,
    ZenohSettings,
    decode_sensors,
    encode_aircraft,
    encode_sensors,
    open_session,
    vehicle_key,
)

RATE_HZ, SAMPLES, STREAM = 50.0, 10, 7
SHORTEST_S, LONGEST_S = 0.5, 8.0
"""Wall-clock time for which a service takes samples in before it is killed."""
ACT_EVERY_S = 0.5
PATIENCE_S = 300.0
"""For a service that has to compile its kernels."""
AEROSONDE = load_aircraft("aerosonde")
MESSAGE = AircraftMessage(aircraft="aerosonde")
NEXT = {"active": "acknowledge", "acknowledged": "shelve", "shelved": "unshelve"}


def scenarios() -> list[Scenario]:
    """A healthy vehicle, one that loses elevator effect, one that loses aileron effect."""
    schedule = doublet_schedule(AEROSONDE, Scenario(AEROSONDE).condition)
    effects = ((), (ElevatorEffectiveness(0.6, 60.0),), (AileronEffectiveness(0.6, 90.0),))
    return [
        Scenario(AEROSONDE, manoeuvres=(schedule,), effects=effect, seed=i, name=f"v{i}")
        for i, effect in enumerate(effects)
    ]


@dataclass
class Uninterrupted:
    """The run that nobody kills, of one vehicle.

    Attributes:
        sent: messages that have not been given to it, the first of them with number ``first``.
    """

    monitor: VehicleMonitor
    sent: list[SensorsMessage] = field(default_factory=list)
    first: int = 0

    def equals(self, saved: SavedVehicle) -> tuple[bool, bool]:
        """Whether estimators and latest solution are those of a checkpoint, and whether all else is, to the bit."""
        end, missing = saved.arrivals.next or 0, set(chain(*saved.arrivals.gaps))
        for message in self.sent[: max(0, end - self.first)]:
            if message.sequence not in missing:
                self.monitor.feed(message.block)
        del self.sent[: max(0, end - self.first)]
        self.first = max(self.first, end)
        own, its = self.monitor.saved(), saved.monitor
        estimates = _estimates(own) == _estimates(its)
        whole = _comparable(own) == _comparable(its)
        if not whole:  # one difference counts once
            self.monitor = fresh()
            self.monitor.restore(its)
        return estimates, whole


def fresh() -> VehicleMonitor:
    """A monitor as the service makes it for these vehicles."""
    given = decode_sensors(encode_sensors(0, _rows()), PROTOBUF).given
    maker = MonitorMaker(lambda: "", JudgeConfig())
    return maker.make("default", "v", AEROSONDE, MESSAGE, given, VehicleMemory())


def _rows() -> SampleBlock:
    return SampleBlock(FleetSimulation(scenarios()[:1], RATE_HZ).step(SAMPLES)[0])


def _estimates(state: MonitorState) -> bytes:
    return CODEC.encode(SavedChain, state.chain)


def _comparable(state: MonitorState) -> bytes:
    """Without names of alerts and what persons did to them, and without what is only handed over once more."""
    alert = state.book.active
    if alert is not None:
        alert = replace(alert, id="", fleet="", vehicle="", state=AlertState.ACTIVE, note=())
    cells = CellBookState(state.cells.accounts, state.cells.visits, set())
    return CODEC.encode(MonitorState, replace(state, book=replace(state.book, active=alert), cells=cells))


@dataclass
class Tally:
    """What was found."""

    kills: int = 0
    told: dict[str, str] = field(default_factory=dict)
    acted: list[tuple[str, str]] = field(default_factory=list)
    lost_alerts: set[str] = field(default_factory=set)
    lost_actions: set[str] = field(default_factory=set)
    turned_healthy: int = 0
    compared: int = 0
    equal: int = 0
    whole: int = 0
    not_resumed: int = 0
    first_s: float = 0.0
    shown_s: list[float] = field(default_factory=list)
    ready_s: list[float] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)


class Client:
    """What an operator sees and does over REST."""

    def __init__(self, port: int, tally: Tally) -> None:
        self._http = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=10.0)
        self._tally = tally
        self._standing: set[str] = set()

    def wait(self, path: str, process: "subprocess.Popen[bytes]") -> float:
        """Until a path is answered with 200; when that was."""
        until_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s and process.poll() is None:
            with suppress(httpx.HTTPError):
                if self._http.get(path).status_code == 200:
                    return time.monotonic()
            time.sleep(0.01)
        raise TimeoutError(f"the service does not answer {path}")

    def check(self) -> None:
        """After a start: whether all that was said and done before is there."""
        alerts = {a["id"]: a for a in self._http.get("/v1/alerts").raise_for_status().json()["items"]}
        self._tally.lost_alerts |= set(self._tally.told) - set(alerts)
        done = [
            (a, said) for a, said in self._tally.acted if said not in alerts.get(a, {"notes": ()})["notes"]
        ]
        self._tally.lost_actions |= {said for _, said in done}
        standing = {a["vehicle"] for a in alerts.values() if a["state"] != "cleared"} | self._standing
        for vehicle in self._http.get("/v1/vehicles").raise_for_status().json()["items"]:
            gone = vehicle["vehicle"] in standing and vehicle["state"] != "degraded"
            self._tally.turned_healthy += gone

    def act(self, rng: np.random.Generator) -> None:
        """Read the alerts, and now and then do what may be done to one."""
        alerts = self._http.get("/v1/alerts").raise_for_status().json()["items"]
        self._tally.told |= {a["id"]: a["vehicle"] for a in alerts}
        self._standing = {a["vehicle"] for a in alerts if a["state"] != "cleared"}
        able = [a for a in alerts if a["state"] in NEXT]
        if able and rng.random() < 0.5:
            alert = able[rng.integers(len(able))]
            who, action = f"person{len(self._tally.acted)}", NEXT[alert["state"]]
            answer = self._http.post(f"/v1/alerts/{alert['id']}/{action}", json={"who": who, "note": ""})
            if answer.status_code == 200:
                self._tally.acted.append((alert["id"], f"{who}: {action}"))


def free_port() -> int:
    """One that nobody listens on now."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@contextmanager
def serving(folder: Path, port: int, endpoint: str) -> "Iterator[subprocess.Popen[bytes]]":
    """The service in a process of its own, killed in the end."""
    command = (sys.executable, "-m", "wingwatch.cli.main", "serve", "--data", str(folder))
    with (folder / "log.txt").open("ab") as log:
        process = subprocess.Popen(
            [*command, "--port", str(port), "--listen", endpoint], stdout=log, stderr=log
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class Sender:
    """Vehicles that fly on, whoever listens."""

    def __init__(self, runs: Sequence[Uninterrupted], speed: float) -> None:
        self._flights = FleetSimulation(scenarios(), RATE_HZ)
        self._runs, self._period_s, self._number = runs, SAMPLES / RATE_HZ / speed, 0

    def fly(self, session: zenoh.Session, seconds: float, client: Client, rng: np.random.Generator) -> None:
        """Send for a time; a person acts meanwhile, and just before the end."""
        begin_s, due_s = time.monotonic(), 0.0
        act_s = ACT_EVERY_S
        while due_s < seconds:
            time.sleep(max(0.0, begin_s + due_s - time.monotonic()))
            for i, rows in enumerate(self._flights.step(SAMPLES)):
                payload = encode_sensors(self._number, SampleBlock(rows), stream=STREAM)
                self._runs[i].sent.append(decode_sensors(payload, PROTOBUF))
                session.put(vehicle_key("default", f"v{i}", "sensors"), payload, encoding=PROTOBUF)
            self._number += 1
            due_s += self._period_s
            if due_s >= act_s:
                client.act(rng)
                act_s += ACT_EVERY_S
        client.act(rng)


def course(tally: Tally, kills: int, seed: int, speed: float) -> None:
    """Start, fly and kill so many times, and start once more."""
    rng = np.random.default_rng(seed)
    runs = [Uninterrupted(fresh()) for _ in scenarios()]
    sender = Sender(runs, speed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kill in range(kills + 1):
            port, endpoint = free_port(), f"tcp/127.0.0.1:{free_port()}"
            client = Client(port, tally)
            began_s = time.monotonic()
            with serving(folder, port, endpoint) as process:
                shown_s = client.wait("/v1/vehicles", process) - began_s
                client.check()
                if kill == kills:
                    tally.shown_s.append(shown_s)
                    break
                ready_s = client.wait("/health/ready", process) - began_s
                if kill:
                    tally.shown_s.append(shown_s)
                    tally.ready_s.append(ready_s)
                else:
                    tally.first_s = shown_s
                with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
                    for i in range(len(runs)):
                        key = vehicle_key("default", f"v{i}", "aircraft")
                        session.put(key, encode_aircraft(MESSAGE), encoding=PROTOBUF)
                    sender.fly(session, float(rng.uniform(SHORTEST_S, LONGEST_S)), client, rng)
                    process.kill()
                    process.wait()
            tally.kills += 1
            compare(folder, runs, tally)
            print(f"\r{tally.kills} of {kills}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def compare(folder: Path, runs: Sequence[Uninterrupted], tally: Tally) -> None:
    """The newest checkpoints with the uninterrupted run."""
    paths = list((folder / "wingwatch.db.checkpoints").glob("*.checkpoint"))
    for path in paths:
        data = path.read_bytes()
        saved = decode_checkpoint(data).saved
        estimates, whole = runs[int(saved.vehicle[1:])].equals(saved)
        tally.compared += 1
        tally.equal += estimates
        tally.whole += whole
        tally.sizes.append(len(data))
    tally.not_resumed += (folder / "log.txt").read_text().count("starts anew") - tally.not_resumed


def show(tally: Tally) -> None:
    """Print what was found."""

    def times(name: str, values: Sequence[float]) -> None:
        if values:
            print(f"{name}: p50 {np.median(values):.2f} s, worst {max(values):.2f} s")

    print(f"kills: {tally.kills}")
    print(f"alerts told: {len(tally.told)}, lost: {len(tally.lost_alerts)}")
    print(f"actions answered: {len(tally.acted)}, lost: {len(tally.lost_actions)}")
    print(f"vehicles with an alert that were not degraded after a start: {tally.turned_healthy}")
    print(f"checkpoints refused: {tally.not_resumed}")
    same = "yes" if tally.equal == tally.compared else "no"
    print(f"derivatives equal: {same} ({tally.equal} of {tally.compared} states)")
    same = "yes" if tally.whole == tally.compared else "no"
    print(f"whole states equal: {same} ({tally.whole} of {tally.compared} states)")
    if tally.sizes:
        print(f"checkpoint of a vehicle: {np.mean(tally.sizes) / 1024.0:.0f} KiB")
    print(f"from start to the first answer, nothing to resume: {tally.first_s:.2f} s")
    times("from start to all vehicles shown", tally.shown_s)
    times("from start to samples taken in", tally.ready_s)


def main() -> None:
    parser = argparse.ArgumentParser(description="Kill the service at random instants and see what is lost.")
    parser.add_argument("--kills", type=int, default=20, help="1 to 10000")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--speed", type=float, default=4.0, help="flight seconds a second, 1 to 20")
    arguments = parser.parse_args()
    if not 1 <= arguments.kills <= 10_000:
        parser.error(f"--kills is {arguments.kills}; give 1 to 10000")
    if not 1.0 <= arguments.speed <= 20.0:
        parser.error(f"--speed is {arguments.speed}; give 1 to 20")
    tally = Tally()
    with suppress(KeyboardInterrupt):  # what was found until then is shown
        course(tally, arguments.kills, arguments.seed, arguments.speed)
    show(tally)


if __name__ == "__main__":
    main()
