"""The watch of a vehicle is one state at a time, and what belongs to one object is set by nobody else."""

import ast
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from fleet_hall import AEROSONDE, find

import wingwatch.monitor.fleet
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.fleet.member import known_vehicle
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.states import Announced, LeftOut, Recalling, Stranger, Watched
from wingwatch.telemetry import CHANNELS, AircraftMessage, SampleBlock, SensorsMessage

AS_FILED = AircraftMessage(aircraft="aerosonde")
TWIN = AircraftMessage(aircraft="twin")
HEAVIER = AircraftMessage(aircraft="aerosonde", mass_kg=14.5)


def samples(count: int = 3) -> SensorsMessage:
    values = np.zeros((count, len(CHANNELS)))
    values[:, 0] = np.arange(count)
    return SensorsMessage(0, SampleBlock(values), ("pitch_rate_rad_s",))


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> KnownVehicle:
    monkeypatch.setattr(known_vehicle, "settings_of", lambda monitor, given: "settings")
    return KnownVehicle()


def watched(known: KnownVehicle, alarmed: bool = False) -> Watched:
    """The vehicle with a monitor that does nothing."""
    if isinstance(known.state, Stranger):
        known.announce(AS_FILED, find)
    if not known.waiting:
        known.hold(samples())
    monitor = SimpleNamespace(alarmed=alarmed, suspects=False, learned_blocks=4, counts={"accepted": 2})
    known.begin_watch(cast(VehicleMonitor, monitor), ("pitch_rate_rad_s",), None)
    assert isinstance(known.state, Watched)
    return known.state


def test_a_vehicle_is_announced_recalled_and_watched(known: KnownVehicle) -> None:
    assert known.state == Stranger()
    known.announce(AS_FILED, find)
    assert isinstance(known.state, Announced)
    assert known.state.said.aircraft is AEROSONDE
    assert known.hold(samples()) == 1
    assert isinstance(known.state, Recalling)
    assert (known.note_recall(10.0), known.note_recall(12.5)) == (0.0, 2.5)
    watch = watched(known)
    assert len(watch.samples) == 1, "what waited is the monitor's to take in"
    assert (watch.memory.read, watch.memory.saved_blocks) == (False, 4)
    assert watch.basis.message == AS_FILED


def test_one_that_is_not_known_here_stays_a_stranger_and_says_why(known: KnownVehicle) -> None:
    known.announce(AircraftMessage(aircraft="nobody"), find)
    assert isinstance(known.state, Stranger)
    assert "nobody is not known" in known.state.problem
    with pytest.raises(ValueError, match="not watched"):
        known.hold(samples())
    known.announce(AS_FILED, find)
    assert isinstance(known.state, Announced)


def test_as_another_aircraft_its_watch_ends_and_what_waited_is_counted(known: KnownVehicle) -> None:
    watched(known)
    known.saving.note_change(urgent=True)
    known.announce(TWIN, find)
    assert isinstance(known.state, Announced)
    assert known.counts.own["dropped_waiting"] == 3
    assert (known.saving.unsaved, known.saving.urgent) == (False, False)
    total: dict[str, int] = {}
    known.add_counts(total)
    assert total["accepted"] == 2, "what the monitor has counted is not lost with it"


def test_an_alert_in_force_defers_another_aircraft_until_it_is_cleared(known: KnownVehicle) -> None:
    watch = watched(known, alarmed=True)
    known.announce(TWIN, find)
    assert known.state is watch
    assert watch.deferred == TWIN
    assert not known.take_deferred(find)
    cast(SimpleNamespace, watch.monitor).alarmed = False
    assert known.take_deferred(find)
    assert known.message == TWIN
    assert isinstance(known.state, Announced)


def test_at_another_loading_it_is_recalled_anew_unless_an_alert_is_in_force(known: KnownVehicle) -> None:
    watch = watched(known, alarmed=True)
    known.announce(HEAVIER, find)
    known.hold(samples())
    assert known.state is watch
    assert (watch.said.message, watch.basis.message) == (HEAVIER, AS_FILED)
    cast(SimpleNamespace, watch.monitor).alarmed = False
    known.hold(samples())
    assert isinstance(known.state, Recalling)
    assert known.state.basis.message == HEAVIER
    assert known.waiting == 1


def test_one_that_is_left_out_goes_on_as_it_was_or_as_it_has_said_since(known: KnownVehicle) -> None:
    watch = watched(known)
    known.leave_out()
    assert known.state == LeftOut(watch)
    assert (known.watch, known.waiting) == (watch, 0)
    with pytest.raises(ValueError, match="not watched"):
        known.hold(samples())
    known.take_back()
    assert (known.watch, known.left_out) == (watch, False)
    known.leave_out()
    known.announce(TWIN, find)
    assert known.left_out
    known.take_back()
    assert isinstance(known.state, Announced)


def test_of_one_that_is_left_out_while_it_is_recalled_nothing_waits(known: KnownVehicle) -> None:
    known.announce(AS_FILED, find)
    known.hold(samples())
    known.leave_out()
    known.take_back()
    assert isinstance(known.state, Announced)
    assert known.counts.own["dropped_waiting"] == 3


def test_a_fault_drops_what_waits_for_a_monitor_and_not_what_waits_for_its_turn(known: KnownVehicle) -> None:
    known.announce(AS_FILED, find)
    known.hold(samples())
    known.note_fault(ZeroDivisionError("division by zero"), 5.0)
    assert (known.waiting, known.fault.text) == (0, "ZeroDivisionError: division by zero")
    watched(known)
    known.note_fault(ZeroDivisionError("division by zero"), 6.0)
    assert known.waiting == 1


def foreign_stores(tree: ast.AST) -> Iterator[str]:
    """Assignments to fields, and to entries of fields, of anything but the method's own object."""
    for node in ast.walk(tree):
        if not isinstance(node, (ast.Attribute, ast.Subscript)) or isinstance(node.ctx, ast.Load):
            continue
        owner = node.value
        if isinstance(node, ast.Subscript):
            if not isinstance(owner, ast.Attribute):
                continue  # an entry of a local variable
            owner = owner.value
        if not (isinstance(owner, ast.Name) and owner.id == "self"):
            yield ast.unparse(node)


def test_no_file_of_the_fleet_sets_a_field_of_another_object() -> None:
    folder = Path(wingwatch.monitor.fleet.__file__).parent
    found = {path.name: list(foreign_stores(ast.parse(path.read_text()))) for path in folder.rglob("*.py")}
    assert len(found) > 20
    assert {name: stores for name, stores in found.items() if stores} == {}


@pytest.mark.parametrize(
    "line", ["known.state = 1", "self.a.b = 1", "known.rows[2] = 1", "del known.state", "x.y += 1"]
)
def test_that_would_be_noticed(line: str) -> None:
    assert list(foreign_stores(ast.parse(line)))
