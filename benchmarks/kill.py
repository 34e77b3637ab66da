"""A service killed with SIGKILL at random instants and started again on the same data, while three vehicles fly on.

The service is ``wingwatch serve`` in a process of its own. Vehicles are simulated and sent over Zenoh on loopback,
faster than they fly; one loses elevator, one aileron effect, and the first kill comes when both alerts are in force.
Between two kills alerts are read and acted on over REST. Each time the newest checkpoints are compared with an
uninterrupted run in this process, to which the same messages were given: those that the service counts as taken in.
Instants, flights and actions are drawn with a seed; how far a message gets before a kill is the machine's affair.

Run: python benchmarks/kill.py [--kills 200] [--seed 0] [--speed 4]
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import zenoh
from loopback import free_endpoint, free_port
from saving import run_benchmark
from service_process import (
    RATE_HZ,
    SAMPLES,
    Flights,
    RestClient,
    prepare_kernels,
    resumed_in,
    serving,
)
from threadpoolctl import threadpool_limits
from uninterrupted_run import AIRCRAFT, Comparison, Uninterrupted

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import decode_checkpoint
from wingwatch.simulation import (
    AileronEffectiveness,
    ElevatorEffectiveness,
    FleetSimulation,
    Scenario,
    doublet_schedule,
)
from wingwatch.telemetry import (
    PROTOBUF,
    SampleBlock,
    ZenohSettings,
    decode_sensors,
    encode_sensors,
    open_session,
)

STREAM = 7
SHORTEST_S, LONGEST_S = 0.5, 6.0
"""Wall-clock time for which a service takes samples in before it is killed."""
BEFORE_S, BEFORE_SPEED = 240.0, 12.0
"""Flight before the first kill at most, and how fast: until two alerts are in force."""
ACT_EVERY_S = 0.5
BEHIND_S = 120.0
"""For which a service that is behind may take to come to its second alert, on a machine that does much else."""
REST_PATIENCE_S = 30.0
NEXT = {"active": "acknowledge", "acknowledged": "shelve", "shelved": "unshelve"}


def scenarios() -> list[Scenario]:
    """A healthy vehicle, one that loses elevator effect, one that loses aileron effect."""
    aircraft = load_aircraft(AIRCRAFT)
    schedule = doublet_schedule(aircraft, Scenario(aircraft).condition)
    effects = ((), (ElevatorEffectiveness(0.6, 60.0),), (AileronEffectiveness(0.6, 60.0),))
    return [
        Scenario(aircraft, manoeuvres=(schedule,), effects=effect, seed=i, name=f"v{i}")
        for i, effect in enumerate(effects)
    ]


@dataclass
class Tally:
    """What was found.

    Attributes:
        announced: alerts that REST has shown, with their vehicles; acted: actions that were answered, by alert.
        unanswered: questions and actions without an answer within the client's patience; such an action counts as none.
        turned_healthy: vehicles with an alert in force that were not degraded after a start.
        standing: vehicles with an alert in force, of all kills together.
        compared: checkpoints that had gone on since the comparison before.
        resumed_s: time that the service took from the first checkpoint read to the last vehicle resumed.
    """

    kills: int = 0
    announced: dict[str, str] = field(default_factory=dict)
    acted: list[tuple[str, str]] = field(default_factory=list)
    lost_alerts: set[str] = field(default_factory=set)
    lost_actions: set[str] = field(default_factory=set)
    unanswered: int = 0
    turned_healthy: int = 0
    standing: list[int] = field(default_factory=list)
    compared: list[Comparison] = field(default_factory=list)
    refused: int = 0
    first_s: float = 0.0
    shown_s: list[float] = field(default_factory=list)
    ready_s: list[float] = field(default_factory=list)
    resumed_s: list[float] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)


class Operator(RestClient):
    """What a person sees and does over REST."""

    def __init__(self, port: int, tally: Tally) -> None:
        super().__init__(port, REST_PATIENCE_S)
        self._tally = tally
        self._able = 0

    def check(self) -> None:
        """After a start: whether all that was said and done before is there."""
        alerts = {alert["id"]: alert for alert in self._patiently("/v1/alerts")}
        self._tally.lost_alerts |= set(self._tally.announced) - set(alerts)
        self._tally.lost_actions |= {
            said for a, said in self._tally.acted if said not in alerts.get(a, {"notes": ()})["notes"]
        }
        standing = {a["vehicle"] for a in alerts.values() if a["state"] != "cleared"}
        gone = {a: v for a, v in self._tally.announced.items() if a not in alerts}
        standing |= set(gone.values())
        for vehicle in self._patiently("/v1/vehicles"):
            self._tally.turned_healthy += vehicle["vehicle"] in standing and vehicle["state"] != "degraded"

    def _patiently(self, path: str) -> list[dict[str, Any]]:
        """The answer's ``items``, asked for until there is one: ten times at most."""
        for _ in range(9):
            try:
                return self.items(path)
            except httpx.TransportError:
                self._tally.unanswered += 1
        return self.items(path)

    def act(self, rng: np.random.Generator) -> int:
        """Read the alerts, and now and then do what may be done to one; how many are in force, as last answered."""
        try:
            self._able = self._act(rng)
        except httpx.TransportError:  # too busy to answer in time, or killed
            self._tally.unanswered += 1
        return self._able

    def _act(self, rng: np.random.Generator) -> int:
        alerts = self.items("/v1/alerts")
        self._tally.announced |= {a["id"]: a["vehicle"] for a in alerts}
        able = [a for a in alerts if a["state"] in NEXT]
        if able and rng.random() < 0.5:
            alert = able[rng.integers(len(able))]
            who, action = f"person{len(self._tally.acted)}", NEXT[alert["state"]]
            answer = self.http.post(f"/v1/alerts/{alert['id']}/{action}", json={"who": who, "note": ""})
            if answer.status_code == 200:
                self._tally.acted.append((alert["id"], f"{who}: {action}"))
        return len(able)


class Sender:
    """Vehicles that fly on, whoever listens; what they send is kept for the uninterrupted runs."""

    def __init__(self, speed: float) -> None:
        rows = FleetSimulation(scenarios()[:1], RATE_HZ).step(SAMPLES)[0]
        given = decode_sensors(encode_sensors(0, SampleBlock(rows)), PROTOBUF).given
        self._flights = Flights(scenarios(), STREAM)
        self.runs: Mapping[str, Uninterrupted] = {name: Uninterrupted(given) for name in self._flights.names}
        self._speed = speed

    def fly(self, session: zenoh.Session, client: Operator, rng: np.random.Generator, first: bool) -> int:
        """Send for a time; a person acts meanwhile, and just before the end. How many alerts are in force then."""
        seconds = float(rng.uniform(SHORTEST_S, LONGEST_S))
        speed, standing = self._speed, 0
        if first:
            seconds, speed = BEFORE_S / BEFORE_SPEED, BEFORE_SPEED
        begin_s, due_s, act_s = time.monotonic(), 0.0, ACT_EVERY_S
        self._flights.announce(session)
        while due_s < seconds and not (first and standing >= 2):
            time.sleep(max(0.0, begin_s + due_s - time.monotonic()))
            for name, payload in self._flights.send(session).items():
                self.runs[name].sent.append(decode_sensors(payload, PROTOBUF))
            due_s += SAMPLES / RATE_HZ / speed
            if due_s >= act_s:
                standing = client.act(rng)
                act_s += ACT_EVERY_S
        while first and standing < 2 and time.monotonic() - begin_s < seconds + BEHIND_S:
            time.sleep(ACT_EVERY_S)
            standing = client.act(rng)
        return client.act(rng)


def course(tally: Tally, kills: int, seed: int, speed: float) -> None:
    """Start, fly and kill so many times, and start once more."""
    rng = np.random.default_rng(seed)
    sender = Sender(speed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kill in range(kills + 1):
            port, endpoint = free_port(), free_endpoint()
            client = Operator(port, tally)
            began_s = time.monotonic()
            with serving(folder, port, ("--listen", endpoint)) as process:
                shown_s = client.wait("/v1/vehicles", process) - began_s
                client.check()
                if kill:
                    tally.shown_s.append(shown_s)
                else:
                    tally.first_s = shown_s
                if kill == kills:
                    break
                ready_s = client.wait("/health/ready", process) - began_s
                if kill:
                    tally.ready_s.append(ready_s)
                with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
                    tally.standing.append(sender.fly(session, client, rng, kill == 0))
                    end(process)
            tally.kills += 1
            compare(folder, sender.runs, tally)
            print(f"\r{tally.kills} of {kills}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def end(process: "subprocess.Popen[bytes]") -> None:
    """SIGKILL."""
    process.kill()
    process.wait()


def compare(folder: Path, runs: Mapping[str, Uninterrupted], tally: Tally) -> None:
    """The newest checkpoints with the uninterrupted runs."""
    for path in (folder / "wingwatch.db.checkpoints").glob("*.checkpoint"):
        data = path.read_bytes()
        saved = decode_checkpoint(data).saved
        found = runs[saved.vehicle].compare(saved)
        if found.messages:
            tally.compared.append(found)
        tally.sizes.append(len(data))
    tally.refused = (folder / "log.txt").read_text().count("starts anew")
    tally.resumed_s = [took_s for took_s, _ in resumed_in(folder / "log.txt")]


def show(tally: Tally) -> None:
    """Print what was found."""

    def times(name: str, values: Sequence[float]) -> None:
        if values:
            print(f"{name}: p50 {np.median(values):.2f} s, worst {max(values):.2f} s")

    def equal(name: str, same: Sequence[bool]) -> None:
        print(f"{name} equal: {'yes' if all(same) else 'no'} ({sum(same)} of {len(same)} states)")

    actions = Counter(said.rsplit(" ", 1)[1] for _, said in tally.acted)
    known = [c for c in tally.compared if c.known]
    print(f"kills: {tally.kills}, with an alert in force: {sum(n > 0 for n in tally.standing)}, with two: "
          f"{sum(n > 1 for n in tally.standing)}")  # fmt: skip
    print(f"alerts announced: {len(tally.announced)}, lost: {len(tally.lost_alerts)}")
    print(f"actions answered: {len(tally.acted)}, lost: {len(tally.lost_actions)}")
    print(f"questions and actions not answered within {REST_PATIENCE_S:.0f} s: {tally.unanswered}")
    print("actions by kind: " + (", ".join(f"{kind} {n}" for kind, n in sorted(actions.items())) or "none"))
    print(f"vehicles with an alert that were not degraded after a start: {tally.turned_healthy}")
    print(f"checkpoints refused: {tally.refused}")
    equal("derivatives", [c.estimates for c in known])
    equal("whole states", [c.whole for c in known])
    print(f"states with an alert in force: {sum(c.alarmed for c in known)}, "
          f"not comparable for more than 64 gaps: {len(tally.compared) - len(known)}")  # fmt: skip
    differing = Counter(part for c in known for part in c.differs)
    if differing:
        print("parts that differ: " + ", ".join(f"{part} {n}" for part, n in differing.items()))
    if tally.sizes:
        print(f"checkpoint of a vehicle: {np.mean(tally.sizes) / 1024.0:.0f} KiB")
    times("from the first checkpoint read to all vehicles resumed", tally.resumed_s)
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
    prepare_kernels()
    try:
        with suppress(KeyboardInterrupt), threadpool_limits(1, "blas"):
            course(tally, arguments.kills, arguments.seed, arguments.speed)
    finally:
        show(tally)  # what was found until then, whatever ended it


if __name__ == "__main__":
    run_benchmark(main)
