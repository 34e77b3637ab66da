"""Kills a process that raises alerts and acts on them, at random instants, and prints what it had announced and lost.

Run: python tests/cli/killed.py DATABASE ROUNDS SEED. A process of its own, because it forks: it must have no threads.
"""

import json
import os
import random
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import IO

from wingwatch.aircraft import load_aircraft
from wingwatch.baselines import AlertRecord, open_database
from wingwatch.monitor import AlertAction, AlertState, AlertView, FleetMonitor, FleetPorts
from wingwatch.monitor.ports import News
from wingwatch.service.store import DatabaseStore


class _Said:
    """Outputs that write down what is announced."""

    def __init__(self, paper: IO[str]) -> None:
        self._paper = paper

    def announce(self, fleet: str, vehicle: str, stream: str, news: Callable[[], News]) -> None:
        value = news()
        if isinstance(value, AlertView):
            self.write("announced", value)

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        pass

    def write(self, what: str, alert: AlertView) -> None:
        line = json.dumps([what, alert.id, str(alert.state), alert.level, list(alert.note)])
        os.write(self._paper.fileno(), f"{line}\n".encode())


def work(database: str, paper: IO[str], name: str) -> None:
    """Raise alerts, follow them, and act on them in another thread, until killed."""
    with open_database(database) as opened, DatabaseStore(opened, time.time) as store:
        said = _Said(paper)
        fleet = FleetMonitor(load_aircraft, time.monotonic, lambda: "", FleetPorts(store, said))

        def people() -> None:
            while True:
                for alert in fleet.alerts():
                    if alert.state is not AlertState.ACTIVE:
                        continue
                    with suppress(ValueError):  # another was quicker
                        done = fleet.act_on_alert(alert.id, AlertAction.ACKNOWLEDGE, "ann", "")
                        assert done is not None
                        said.write("acted", done)

        for _ in range(3):
            threading.Thread(target=people, daemon=True).start()
        for k in count():
            for level in ("watch", "warning", "critical"):
                with fleet._lock:
                    fleet._alerts.keep(_alert(f"{name}-{k}", level))
                time.sleep(0.003)


def _alert(name: str, level: str) -> AlertView:
    return AlertView(
        id=name, fleet="default", vehicle="uav1", kind="icing", cause="icing", level=level, state=AlertState.ACTIVE,
        raised_s=80.5, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97, basis="a-priori",
        text="Icing.", evidence=(),
    )  # fmt: skip


def lost_of(lines: list[str], kept: dict[str, AlertRecord]) -> list[str]:
    """What was announced or done and is not in the database."""
    lost = []
    levels = ("watch", "warning", "critical")
    for line in lines:
        what, name, state, level, note = json.loads(line)
        stored = kept.get(name)
        if stored is None or levels.index(stored.level) < levels.index(level):
            lost.append(line)
        elif not set(note) <= set(stored.note) or (state != "active" and stored.state == "active"):
            lost.append(f"{what} {line}")
    return lost


def main(database: str, rounds: int, seed: int) -> dict[str, object]:
    """All rounds; each goes on with the database of the one before."""
    draw = random.Random(seed)
    announced = acted = 0
    lost: list[str] = []
    for k in range(rounds):
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            with os.fdopen(writing, "w") as paper:
                work(database, paper, f"r{k}")
        os.close(writing)
        with os.fdopen(reading) as paper:
            first = paper.readline()  # from now on it works
            time.sleep(draw.uniform(0.0, 1.0))
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            lines = [first, *paper.read().splitlines()]
        announced += sum('"announced"' in line for line in lines)
        acted += sum('"acted"' in line for line in lines)
        lost += lost_of(lines, _kept(database))
    return {"rounds": rounds, "announced": announced, "acted": acted, "lost": lost}


def _kept(database: str) -> dict[str, AlertRecord]:
    with open_database(database) as opened:
        found: dict[str, AlertRecord] = {}
        cursor: str | None = None
        while True:
            page = opened.alerts(limit=1000, cursor=cursor)
            found |= {a.id: a for a in page.items}
            if (cursor := page.next) is None:
                return found


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
