"""Taking vehicles over and giving them up, with parts made by hand."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from fleet_hall import OLD_ALERT

from wingwatch.baselines import DatabaseError
from wingwatch.monitor import AlertView, SavedVehicle
from wingwatch.service.workers.moves import MovesPorts, VehicleMoves


@dataclass
class Parts:
    """A monitor, a subscriber, checkpoints and a database that note what is asked of them."""

    said: list[tuple[str, ...]] = field(default_factory=list)
    mine: set[str] = field(default_factory=set)
    down: bool = False
    broken: str = ""
    now_s: float = 0.0
    prepared: set[str] = field(default_factory=set)

    def owned(self, vehicles: Sequence[tuple[str, str]]) -> set[tuple[str, str]]:
        return {key for key in vehicles if key[1] in self.mine}

    def heard(self, fleet: str, vehicle: str) -> None:
        self.said.append(("there", vehicle))

    def take_over(
        self, fleet: str, vehicle: str, saved: SavedVehicle | None, alerts: Sequence[AlertView]
    ) -> None:
        if vehicle == self.broken:
            raise RuntimeError("broken")
        self.said.append(("taken", vehicle, *(alert.id for alert in alerts)))

    def knows(self, fleet: str, vehicle: str) -> bool:
        return False

    def prepare(self, fleet: str, vehicle: str) -> None:
        self.prepared.add(vehicle)

    def cancel(self, fleet: str, vehicle: str) -> None:
        self.prepared.discard(vehicle)

    def watch(self, fleet: str, vehicle: str) -> None:
        self.said.append(("watched", vehicle))

    def leave(self, fleet: str, vehicle: str) -> None:
        self.said.append(("left", vehicle))

    def alerts(self, fleet: str, vehicle: str) -> Sequence[AlertView]:
        if self.down:
            raise DatabaseError("the database sleeps")
        return [OLD_ALERT]


def moves_of(parts: Parts) -> VehicleMoves:
    moves = VehicleMoves(parts, lambda: parts.now_s)
    moves._ports = MovesPorts(parts, parts, lambda _fleet, _vehicle: None, parts.alerts)
    return moves


def test_what_is_owned_is_taken_over_before_it_is_subscribed_and_given_up_when_it_is_another_s() -> None:
    parts = Parts(mine={"a"})
    moves = moves_of(parts)
    for name in ("a", "b", "a"):
        moves.heard("default", name)
    moves.turn()
    assert parts.said == [("there", "a"), ("there", "b"), ("taken", "a", "old"), ("watched", "a")]
    assert (moves.owns("default", "a"), moves.owns("default", "b")) == (True, False)
    parts.mine, parts.said = {"b"}, []
    moves.turn()
    assert parts.said == [("left", "a"), ("taken", "b", "old"), ("watched", "b")]
    assert moves.counts == {"taken": 2, "given": 1, "failed": 0}
    moves.give_up_all()
    moves.turn()
    assert parts.said[-1] == ("left", "b")
    assert not moves.owns("default", "b")


def test_vehicles_are_taken_over_a_few_at_a_time() -> None:
    parts = Parts(mine={f"v{k}" for k in range(25)})
    moves = moves_of(parts)
    for name in sorted(parts.mine):
        moves.heard("default", name)
    assert [moves.turn(), moves.turn(), moves.turn()] == [True, True, False]
    assert moves.counts["taken"] == 25


def test_a_database_that_does_not_answer_is_waited_for_and_then_done_without() -> None:
    parts = Parts(mine={"a"}, down=True)
    moves = moves_of(parts)
    moves.heard("default", "a")
    moves.turn()
    assert not moves.owns("default", "a")
    assert not parts.prepared
    parts.now_s = 6.0
    moves.turn()
    assert parts.said[-2:] == [("taken", "a"), ("watched", "a")]


def test_one_vehicle_s_fault_keeps_no_other_from_being_watched() -> None:
    parts = Parts(mine={"a", "b"}, broken="a")
    moves = moves_of(parts)
    for name in ("a", "b"):
        moves.heard("default", name)
    moves.turn()
    assert (moves.owns("default", "a"), moves.owns("default", "b")) == (False, True)
    assert moves.counts["failed"] == 1
    parts.broken = ""
    moves.turn()
    assert moves.owns("default", "a")


def test_a_vehicle_that_another_worker_asks_for_is_given_up_and_not_taken_back_at_once() -> None:
    parts = Parts(mine={"a", "b"})
    moves = moves_of(parts)
    for name in ("a", "b"):
        moves.heard("default", name)
    moves.turn()
    moves.release([("default", "a"), ("default", "unknown")])
    moves.turn()
    assert (moves.owns("default", "a"), moves.owns("default", "b")) == (False, True)
    assert parts.said[-1] == ("left", "a")
    parts.now_s = 3.0
    moves.turn()
    assert moves.owns("default", "a")  # nobody has taken it
