"""Vehicles taken over, given up and dropped by a worker, with parts made by hand."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fleet_hall import OLD_ALERT

from wingwatch.baselines import DatabaseError, Lease, VehicleName
from wingwatch.monitor import AlertView
from wingwatch.service.checkpoints import CheckpointFolder
from wingwatch.service.workers.vehicle_watch import VehicleWatch

UAV, LEASE = ("default", "uav1"), Lease("w1", 3)


@dataclass
class Parts:
    """Monitor, subscriber, checkpoints and store in one, which note what is asked of them."""

    said: list[tuple[str, ...]] = field(default_factory=list)
    in_monitor: set[VehicleName] = field(default_factory=set)
    down: bool = False
    broken: bool = False
    busy: bool = False

    def __post_init__(self) -> None:
        self.monitor = self.subscriber = self
        self.checkpoints = SimpleNamespace(
            idle=True, read=self.read, decoded=self.decoded, begin_hand_over=self.begin_hand_over,
            handed_over=self.handed_over, drop=self.drop_state,
        )  # fmt: skip
        self.store = SimpleNamespace(alerts_of=self.alerts_of, wait_for=self.wait_for, drop=self.drop_entries)

    def take_over(self, fleet: str, vehicle: str, saved: Any, alerts: Sequence[AlertView]) -> None:
        self.said.append(("over", vehicle, str(saved), *(alert.id for alert in alerts)))
        if self.broken:
            raise RuntimeError("broken")
        self.in_monitor.add((fleet, vehicle))

    def knows(self, fleet: str, vehicle: str) -> bool:
        return (fleet, vehicle) in self.in_monitor

    def watch(self, fleet: str, vehicle: str) -> None:
        self.said.append(("watch", vehicle))

    def prepare(self, fleet: str, vehicle: str) -> None:
        self.said.append(("prepare", vehicle))

    def cancel(self, fleet: str, vehicle: str) -> None:
        self.said.append(("cancel", vehicle))

    def leave(self, fleet: str, vehicle: str) -> None:
        self.said.append(("given_up", vehicle))
        if not self.busy:
            self.in_monitor.discard((fleet, vehicle))

    def drop(self, fleet: str, vehicle: str) -> None:
        self.said.append(("dropped", vehicle))
        self.in_monitor.discard((fleet, vehicle))

    def read(self, fleet: str, vehicle: str) -> Any:
        return "of the folder"

    def decoded(self, data: bytes, where: str) -> Any:
        return None if data == b"damaged" else data.decode()

    def begin_hand_over(self, vehicles: Collection[VehicleName]) -> None:
        self.said.append(("hand over",))

    def handed_over(self, vehicles: Collection[VehicleName]) -> Mapping[VehicleName, bytes]:
        return dict.fromkeys(vehicles, b"state")

    def drop_state(self, fleet: str, vehicle: str) -> None:
        self.said.append(("no checkpoint", vehicle))

    def drop_entries(self, fleet: str, vehicle: str, lease: Lease) -> None:
        self.said.append(("no entries", vehicle, str(lease.number)))

    def alerts_of(self, fleet: str, vehicle: str) -> Sequence[AlertView]:
        if self.down:
            raise DatabaseError("the database sleeps")
        return [OLD_ALERT]

    def wait_for(self, vehicles: Collection[VehicleName], patience_s: float) -> bool:
        self.said.append(("written",))
        return True


def begun(parts: Any) -> VehicleWatch:
    watch = VehicleWatch()
    watch.begin(parts)
    return watch


@pytest.mark.parametrize(
    ("state", "saved"),
    [
        (b"handed over", "handed over"),
        (b"damaged", "of the folder"),
        (b"", "of the folder"),
        (None, "of the folder"),
    ],
)
def test_a_vehicle_goes_on_from_what_came_with_its_release_else_from_the_folder(
    state: bytes | None, saved: str
) -> None:
    parts = Parts()
    watch = begun(parts)
    watch.start(UAV, LEASE, state)
    assert parts.said == [("over", "uav1", saved, "old"), ("watch", "uav1")]
    assert watch.watches(*UAV)
    assert watch.known() == (UAV,)


def test_what_is_given_up_is_left_then_saved_then_written_and_comes_with_its_state() -> None:
    parts = Parts()
    watch = begun(parts)
    watch.start(UAV, LEASE, None)
    parts.said.clear()
    assert watch.stop([UAV]) == {UAV: b"state"}
    assert parts.said == [("hand over",), ("given_up", "uav1"), ("written",)]
    assert not watch.watches(*UAV)
    assert watch.known() == (UAV,)  # it is there, whoever watches it


def test_what_another_worker_has_already_is_dropped_with_all_that_waits() -> None:
    parts = Parts()
    watch = begun(parts)
    watch.start(UAV, LEASE, None)
    parts.said.clear()
    watch.drop(UAV, LEASE)
    assert parts.said == [("dropped", "uav1"), ("no entries", "uav1", "3"), ("no checkpoint", "uav1")]
    assert not watch.watches(*UAV)


def test_a_vehicle_that_cannot_be_taken_over_is_not_watched_and_may_be_tried_again() -> None:
    parts = Parts(down=True)
    watch = begun(parts)
    with pytest.raises(DatabaseError):
        watch.start(UAV, LEASE, None)
    assert parts.said == []
    parts.down, parts.broken = False, True
    with pytest.raises(RuntimeError, match="broken"):
        watch.start(UAV, LEASE, None)
    assert parts.said[-1] == ("dropped", "uav1")
    assert not watch.watches(*UAV)
    parts.broken = False
    watch.start(UAV, LEASE, None)
    assert watch.watches(*UAV)


def test_a_vehicle_whose_former_watch_goes_on_is_not_watched_again() -> None:
    times = iter(range(100))
    watch = VehicleWatch(clock=lambda: float(next(times)))
    parts: Any = Parts(in_monitor={UAV})
    watch.begin(parts)
    with pytest.raises(RuntimeError, match="has not ended yet"):
        watch.start(UAV, LEASE, None)
    assert parts.said == []


def test_a_vehicle_that_gave_way_to_another_is_forgotten_until_it_is_heard_again() -> None:
    forgotten: list[Collection[VehicleName]] = []
    parts: Any = Parts()
    watch = VehicleWatch(forgotten.append)
    watch.begin(parts)
    watch.start(UAV, LEASE, None)
    watch.forgotten(UAV)
    watch.tidy()
    watch.tidy()
    assert forgotten == [[UAV]]
    assert watch.known() == ()
    assert parts.said[-1] == ("dropped", "uav1")
    watch.heard(*UAV)
    assert watch.known() == (UAV,)


def test_a_vehicle_that_is_asked_for_is_prepared_and_not_held_for_long() -> None:
    now_s = [0.0]
    parts: Any = Parts()
    watch = VehicleWatch(clock=lambda: now_s[0])
    watch.begin(parts)
    watch.expect(UAV)
    watch.start(UAV, LEASE, b"state")
    watch.expect(("default", "uav2"))
    now_s[0] = 5.0
    watch.tidy()
    watch.tidy()
    said = [one for one in parts.said if one[0] in ("prepare", "cancel")]
    assert said == [("prepare", "uav1"), ("prepare", "uav2"), ("cancel", "uav2")]


def test_a_vehicle_of_which_too_much_waits_is_dropped_after_a_second() -> None:
    times = iter(range(100))
    parts: Any = Parts(busy=True)
    watch = VehicleWatch(clock=lambda: float(next(times)))
    watch.begin(parts)
    watch.start(UAV, LEASE, None)
    watch.stop([UAV])
    assert [one[0] for one in parts.said[-3:]] == ["given_up", "dropped", "written"]


def test_nothing_is_watched_before_it_has_begun(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="has not begun"):
        VehicleWatch().start(UAV, LEASE, None)
    with CheckpointFolder(tmp_path, lambda: 0.0) as folder:
        folder.begin_hand_over([UAV])
        assert folder.handed_over([UAV]) == {UAV: b""}
        assert folder.decoded(b"none", "in a test") is None
        assert folder.counts["refused"] == 1
