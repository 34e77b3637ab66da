"""What is shown of a fleet: what takes long is worked out without its lock, and one vehicle hides no other."""

import threading
from collections.abc import Sequence

import pytest
from fleet_hall import AEROSONDE, Hall, fly_doublets

from wingwatch.estimators import Outcome
from wingwatch.monitor import VehicleMonitor, VehicleState, WorstDerivative
from wingwatch.monitor.detection.furthest import PendingWorst, furthest
from wingwatch.monitor.estimation.air_watch import PendingAir
from wingwatch.monitor.positions import Position
from wingwatch.monitor.vehicle import readings
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock
from wingwatch.telemetry.conditioning import AirQuality


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(35.0)


@pytest.fixture
def hall(flight: SampleBlock) -> Hall:
    hall = Hall()
    hall.announce()
    hall.fly(flight, 0, 35)
    return hall


def test_a_view_of_all_is_without_what_takes_most_of_the_work_and_that_of_one_has_it(
    hall: Hall, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = hall.fleet.vehicle("default", "uav")
    assert one is not None
    assert {"icing", "surface_stuck"} <= {row.cause for row in one.could_see}
    monkeypatch.setattr(VehicleMonitor, "could_see", lambda _: 1 / 0)
    (listed,) = hall.fleet.vehicles()
    assert listed.could_see == ()
    assert listed.unseen_surfaces == one.unseen_surfaces
    assert listed.state is one.state


def test_a_view_says_where_the_vehicle_was_last_and_how_old_that_is(hall: Hall, flight: SampleBlock) -> None:
    columns = [CHANNEL_INDEX[name] for name in ("latitude_deg", "longitude_deg", "altitude_m")]
    hall.clock.now_s += 1.5
    (view,) = hall.fleet.vehicles()
    assert view.sample_age_s == 1.5
    assert view.position == Position(*flight.values[-1, columns])


def is_free(hall: Hall) -> bool:
    """Whether another thread gets the fleet's lock."""
    got = threading.Event()

    def take() -> None:
        hall.fleet.events(0)
        got.set()

    threading.Thread(target=take, daemon=True).start()
    return got.wait(1.0)


def test_the_air_and_the_worst_derivative_are_worked_out_without_the_lock(
    hall: Hall, monkeypatch: pytest.MonkeyPatch
) -> None:
    free: dict[str, list[bool]] = {"air": [], "worst": []}
    measure = PendingAir.measure

    def measured(pending: PendingAir) -> AirQuality | None:
        free["air"].append(is_free(hall))
        return measure(pending)

    def found(pending: Sequence[PendingWorst]) -> list[WorstDerivative | None]:
        free["worst"].append(is_free(hall))
        return furthest(pending)

    monkeypatch.setattr(PendingAir, "measure", measured)
    monkeypatch.setattr(readings, "furthest", found)
    view = hall.view()
    assert view.air is not None
    assert view.worst is not None
    assert free == {"air": [True], "worst": [True]}  # and not once more with the lock


def test_a_vehicle_whose_air_cannot_be_measured_is_shown_with_its_fault_beside_the_others(
    hall: Hall, monkeypatch: pytest.MonkeyPatch
) -> None:
    hall.announce("other")

    def fails(_: PendingAir) -> AirQuality | None:
        raise ArithmeticError("no air")

    monkeypatch.setattr(PendingAir, "measure", fails)
    views = {view.vehicle: view for view in hall.fleet.vehicles()}
    assert set(views) == {"uav", "other"}
    assert views["uav"].state is VehicleState.UNKNOWN
    assert "ArithmeticError" in views["uav"].reason
    assert hall.fleet.problems["faults"] == 1


def test_a_vehicle_whose_worst_derivative_cannot_be_found_does_not_hide_that_of_others(
    hall: Hall, flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    hall.announce("other")
    hall.fly(flight, 0, 35, "other")
    known = hall.fleet._context.vehicles.get(("default", "uav"))
    assert known is not None
    assert known.monitor is not None
    broken = known.monitor.pending_worst
    assert broken is not None

    def fails(pending: Sequence[PendingWorst]) -> list[WorstDerivative | None]:
        if any(o.taught is broken.taught for o in pending):
            raise ArithmeticError("no distance")
        return furthest(pending)

    monkeypatch.setattr(readings, "furthest", fails)
    views = {view.vehicle: view for view in hall.fleet.vehicles()}
    assert views["other"].worst is not None
    assert "ArithmeticError" in views["uav"].reason


def test_what_the_filter_says_is_told_without_its_estimate() -> None:
    """As its estimate has it, from the first half second on, with vanes and without."""
    said = set()
    for columns in ([], ["angle_of_attack_rad", "sideslip_rad"]):
        block = fly_doublets(25.0)
        present = [name for name in block.present if name not in columns]
        values = block.values.copy()
        values[:, [CHANNEL_INDEX[name] for name in columns]] = float("nan")
        monitor = VehicleMonitor(AEROSONDE, "f", "v", present, {}, new_id=lambda: "1")
        for solution in monitor.feed(SampleBlock(values)).solutions:
            for mode in solution.modes.values():
                expected = mode.ekf.outcome in (Outcome.CONVERGED, Outcome.SETTLING)
                assert mode.filter_says_something == expected
                said.add(expected)
    assert said == {True, False}
