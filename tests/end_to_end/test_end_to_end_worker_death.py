"""Workers as processes that leave, freeze, wake and are killed with alerts in force: what was shown stands, once."""

import signal
import time
from pathlib import Path
from typing import Any

import zenoh
from worker_fleet import Shown, WorkerFleet, flown, worker_fleet

PATIENCE_S = 60.0
FROZEN_S = 8.0
ILL = ("v1", "v2")


def owner_of_one(fleet: WorkerFleet) -> str:
    """A worker that watches a vehicle with an alert."""
    name = fleet.watcher(ILL[0])
    assert name is not None
    return name


def watched_by_others(fleet: WorkerFleet, gone: str) -> dict[str, Any]:
    """Vehicles as they are shown once others than a worker have taken in what all have sent since."""
    since_s = fleet.flown_s
    fleet.until(lambda: fleet.watched(since_s, set(fleet.workers) - {gone}), PATIENCE_S)
    return fleet.vehicles()


def test_solutions_that_go_back_in_time_again_and_again_are_of_two_workers() -> None:
    with zenoh.open(
        zenoh.Config.from_json5('{mode: "peer", scouting: {multicast: {enabled: false}}}')
    ) as session:
        shown = Shown(session)
        for k, time_s in enumerate((1.0, 1.5, 2.0, 1.8, 2.3, 2.8)):  # taken over at the fourth
            shown.solved("v0", time_s, 0.1 * k)
        assert shown.twice == set()
        for k, time_s in enumerate((1.0, 1.0, 1.5, 1.5)):
            shown.solved("v1", time_s, 0.1 * k)
        assert shown.twice == {"v1"}
        assert shown.solutions == 10


def test_what_was_told_stands_once_through_an_end_in_order_a_freeze_and_a_kill(tmp_path: Path) -> None:
    with worker_fleet(tmp_path, "a", "b") as fleet:
        fleet.until(lambda: fleet.watched(0.0, fleet.workers))
        flown(fleet, len(ILL), 15.0)
        shown = dict(fleet.shown.announced)
        fleet.speed = 4.0

        before, leaving = fleet.vehicles(), owner_of_one(fleet)
        fleet.signal(leaving, signal.SIGTERM)
        handed = watched_by_others(fleet, leaving)
        assert all(
            handed[name]["counts"]["accepted"] >= before[name]["counts"]["accepted"] for name in before
        )
        assert [handed[name]["state"] for name in ("v0", *ILL)] == ["healthy", "degraded", "degraded"]

        fleet.start("c")
        fleet.until(lambda: len(fleet.rest.items("/v1/fleet/workers")) == 2)
        frozen, began_s = owner_of_one(fleet), time.monotonic()
        fleet.signal(frozen, signal.SIGSTOP)
        watched_by_others(fleet, frozen)
        fleet.until(lambda: time.monotonic() - began_s > FROZEN_S)
        assert fleet.counter("store", "fenced") == 0
        fleet.signal(frozen, signal.SIGCONT)
        fleet.until(lambda: fleet.counter("store", "fenced") > 0, PATIENCE_S)

        fleet.until(lambda: fleet.watched(fleet.flown_s - 5.0, fleet.workers), PATIENCE_S)
        killed = owner_of_one(fleet)
        fleet.signal(killed, signal.SIGKILL)
        assert {watched_by_others(fleet, killed)[name]["state"] for name in ILL} == {"degraded"}

        assert fleet.shown.announced == shown  # no second alert of what was shown
        assert fleet.shown.in_force == set(shown)
        assert (fleet.shown.lost, fleet.shown.turned_healthy) == (set(), 0)
