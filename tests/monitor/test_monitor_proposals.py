"""Inputs that would help are proposed: seldom, in calm flight, within the aircraft's limits, and never flown."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import count, pairwise
from typing import Any, cast

import pytest
from fleet_hall import AEROSONDE, Clock, Hall, fly_doublets

from wingwatch.aircraft import FlightCondition
from wingwatch.monitor import CouldSeeView, FleetSettings, ProposedInputView, VehicleState
from wingwatch.monitor.fleet.context import FleetContext
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.loading import Loading
from wingwatch.monitor.fleet.member.recalled_memory import RecalledMemory
from wingwatch.monitor.fleet.member.states import Basis, Said, Watched
from wingwatch.monitor.fleet.member.waiting import WaitingSamples
from wingwatch.monitor.fleet.proposals import LEAST_FLIGHT_S, LOOK_S, FleetProposals
from wingwatch.monitor.vehicle.proposing import VALID_S, proposed_input, wanted_surface
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor
from wingwatch.telemetry import AircraftMessage

CRUISE = FlightCondition(25.0, 1000.0)
STILL = replace(CRUISE, angle_of_attack_rad=0.05)


def watched(aircraft: Any = AEROSONDE, seconds: float = 2.0) -> VehicleMonitor:
    flight = fly_doublets(seconds)
    monitor = VehicleMonitor(aircraft, "f", "v", flight.present, {}, new_id=lambda: "1")
    monitor.feed(flight)
    return monitor


def with_actuator(**limits: Any) -> Any:
    assert AEROSONDE.actuators.elevator is not None
    elevator = AEROSONDE.actuators.elevator.model_copy(update=limits)
    actuators = AEROSONDE.actuators.model_copy(update={"elevator": elevator})
    return AEROSONDE.model_copy(update={"actuators": actuators})


def test_a_surface_that_has_not_shown_itself_comes_first_then_what_is_seen_worst() -> None:
    rows = [
        CouldSeeView("sensor_bias", "roll_rad", 0.02, "rad", ""),
        CouldSeeView("thrust_loss", "throttle", None, "", "a change of throttle"),
        CouldSeeView("icing", None, 0.14, "", "a doublet of the elevator"),
    ]
    assert wanted_surface(("rudder_rad",), rows) == (
        "rudder_rad",
        "A stuck rudder would not have been noticed yet.",
    )
    assert wanted_surface((), rows) == (
        "elevator_rad",
        "A change of icing below 0.14 would not have been noticed in the last minutes.",
    )
    assert wanted_surface((), rows[:2]) is None


def test_the_input_is_one_of_the_mode_and_ends_at_trim() -> None:
    monitor = watched()
    doublet, longer = (proposed_input(monitor, STILL, shape, lambda: "p1") for shape in ("doublet", "3211"))
    assert doublet is not None
    assert longer is not None
    assert (doublet.surface, doublet.shape, doublet.id) == ("elevator_rad", "doublet", "p1")
    width = doublet.width_s
    assert width == pytest.approx(2.3 / 11.0, rel=0.25), "2.3 over the short period's frequency, 11 rad/s"
    a = doublet.amplitude_rad
    assert doublet.steps == ((0.0, a), (pytest.approx(width), -a), (pytest.approx(2.0 * width), 0.0))
    assert doublet.duration_s == pytest.approx(2.0 * width)
    assert [math.copysign(1.0, to_rad) for _, to_rad in longer.steps[:-1]] == [1.0, -1.0, 1.0, -1.0]
    assert longer.steps[-1][1] == 0.0
    assert doublet.proposed_s == monitor.last_sample_time_s
    assert doublet.valid_until_s == doublet.proposed_s + VALID_S


def test_the_aircraft_files_limits_hold() -> None:
    free = proposed_input(watched(), STILL, "doublet", lambda: "1")
    assert free is not None
    assert free.amplitude_rad == pytest.approx(math.radians(2.0))
    # the elevator's trim leaves 6 degrees less its own; half of what is left may be used
    narrow = proposed_input(watched(with_actuator(position_limit_rad=0.1)), STILL, "doublet", lambda: "1")
    assert narrow is None or narrow.amplitude_rad < 0.05
    slow = proposed_input(watched(with_actuator(rate_limit_rad_s=0.35)), STILL, "doublet", lambda: "1")
    assert slow is not None
    assert 2.0 * slow.amplitude_rad / 0.35 <= 0.5 * slow.width_s, (
        "from one step to the next in half of its width"
    )
    assert (
        proposed_input(watched(with_actuator(rate_limit_rad_s=0.05)), STILL, "doublet", lambda: "1") is None
    )


@dataclass
class Vehicle:
    """A monitor that says what the test says."""

    last_sample_time_s: float = 100.0
    flown_s: float = LEAST_FLIGHT_S
    unseen_surfaces: tuple[str, ...] = ("rudder_rad",)
    alarmed: bool = False
    waits: str = ""
    in_rough_air: bool = False
    state: VehicleState = VehicleState.NOT_OBSERVABLE
    condition: FlightCondition | None = CRUISE
    reason: str = ""


@dataclass
class Room:
    """Vehicles, a clock, and what was proposed."""

    vehicles: dict[tuple[str, str], Vehicle]
    settings: FleetSettings = field(default_factory=lambda: FleetSettings(excite=True))
    clock: Clock = field(default_factory=Clock)

    def __post_init__(self) -> None:
        context = FleetContext(self.settings, self.clock)
        self.known = {}
        for key, vehicle in self.vehicles.items():
            known = context.vehicles.heard(key)
            assert known is not None
            message = AircraftMessage(aircraft="aerosonde")
            loading = Loading(AEROSONDE, AEROSONDE, {})
            known.state = Watched(
                Said(message, AEROSONDE, loading), Basis(message, loading), WaitingSamples(),
                cast(VehicleMonitor, vehicle), (), "", RecalledMemory(True),
            )  # fmt: skip
            known.messages.received_s = math.inf
            self.known[key] = known
        ids = count(1)
        self.proposals = FleetProposals(context, lambda: f"p{next(ids)}")

    def wait(self, seconds: float) -> list[ProposedInputView]:
        """What was said in so many seconds."""
        said: list[ProposedInputView] = []
        for _ in range(round(seconds)):
            self.clock.now_s += 1.0
            for vehicle in self.vehicles.values():
                vehicle.last_sample_time_s += 1.0
            for _, news in self.proposals.look():
                assert news != "ask"
                stream, give = news
                assert stream == "proposals"
                said.append(cast(ProposedInputView, give()))
        return said

    def shown(self, key: tuple[str, str] = ("f", "one")) -> ProposedInputView | None:
        return self.proposals.current(key, self.known[key])


@pytest.fixture(autouse=True)
def _designed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The design is tested above."""

    def proposed(monitor: Vehicle, _: object, shape: str, new_id: Callable[[], str]) -> Any:
        now_s = monitor.last_sample_time_s
        if not monitor.unseen_surfaces:
            return None
        surface = monitor.unseen_surfaces[0]
        return ProposedInputView(new_id(), surface, shape, 0.03, 0.2, 0.4, (), "why", now_s, now_s + VALID_S)

    monkeypatch.setattr("wingwatch.monitor.fleet.proposals.proposed_input", proposed)


def one(**changes: Any) -> Room:
    return Room({("f", "one"): Vehicle(**changes)})


def test_a_vehicle_is_proposed_one_input_in_five_minutes_and_more_of_it_where_it_did_not_help() -> None:
    room = one()
    said = room.wait(1000.0)
    times = [proposal.proposed_s for proposal in said]
    assert len(said) == 4
    assert all(300.0 <= b - a <= 300.0 + LOOK_S for a, b in pairwise(times))
    assert [proposal.shape for proposal in said] == ["doublet", "3211", "3211", "3211"]


@pytest.mark.parametrize(
    "changes",
    [
        {"alarmed": True},
        {"waits": "on the ground"},
        {"in_rough_air": True},
        {"state": VehicleState.DEGRADED},
        {"flown_s": LEAST_FLIGHT_S - 1.0},
        {"condition": None},
        {"unseen_surfaces": ()},
    ],
)
def test_nothing_is_proposed(changes: dict[str, Any]) -> None:
    room = one(**changes)
    assert room.wait(400.0) == []
    assert room.shown() is None


def test_nothing_is_proposed_unless_it_was_asked_for_or_to_one_that_is_silent() -> None:
    quiet = Room({("f", "one"): Vehicle()}, FleetSettings())
    assert quiet.wait(400.0) == []
    silent = one()
    silent.known["f", "one"].messages.received_s = 0.0
    assert silent.wait(400.0) == []


@pytest.mark.parametrize("what", ["alarmed", "in_rough_air", "waits"])
def test_a_proposal_is_taken_back_when_it_ceases_to_be_sensible(what: str) -> None:
    room = one()
    (proposal,) = room.wait(2.0)
    assert room.shown() == proposal
    setattr(room.vehicles["f", "one"], what, True)
    (back,) = room.wait(1.0)
    assert (back.id, back.valid_until_s) == (proposal.id, proposal.proposed_s + 2.0)
    assert room.shown() is None
    setattr(room.vehicles["f", "one"], what, False)
    assert room.wait(200.0) == [], "no sooner for it"


def test_a_proposal_ends_with_its_time_and_where_the_surface_has_moved() -> None:
    room = one()
    room.wait(2.0)
    room.vehicles["f", "one"].unseen_surfaces = ()
    assert room.shown() is None
    room.vehicles["f", "one"].unseen_surfaces = ("rudder_rad",)
    assert room.shown() is not None
    room.wait(VALID_S + 1.0)
    assert room.shown() is None


def test_one_vehicle_is_looked_at_a_second_each_in_its_turn() -> None:
    room = Room({("f", name): Vehicle() for name in ("one", "two", "three")})
    assert [len(room.wait(1.0)) for _ in range(4)] == [1, 1, 1, 0]
    assert all(room.shown(key) for key in room.vehicles)


def test_the_service_says_it_on_its_key_and_in_the_vehicles_view(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()  # the real design
    monkeypatch.setattr(VehicleMonitor, "in_rough_air", False)  # that is known after half a minute
    monkeypatch.setattr("wingwatch.monitor.fleet.proposals.LEAST_FLIGHT_S", 2.0)
    hall, flight = Hall(FleetSettings(excite=True)), fly_doublets(4.0)
    hall.announce()
    hall.fly(flight, 0, 4)
    hall.fleet.tick()
    (said,) = [value for stream, value in hall.outputs.said if stream == "proposals"]
    assert isinstance(said, ProposedInputView)
    assert said.surface == "elevator_rad"
    assert hall.view().proposed_input == said
    known = KnownVehicle()
    assert hall.fleet._proposals.current(("default", "nobody"), known) is None
