"""Manoeuvres against their own definitions; the autopilot by what it holds, follows and survives."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import chirp

from wingwatch.aircraft import Aircraft, FlightCondition, TrimError, load_aircraft
from wingwatch.aircraft.excitation import (
    doublet_pulse_s,
    relative_peak_factor,
    schroeder_phases_rad,
    step_3211_s,
)
from wingwatch.simulation import (
    AirspeedError,
    Doublet,
    DoubletSchedule,
    FleetSimulation,
    Manoeuvre,
    Multisine,
    Route,
    Scenario,
    SensorFreeze,
    SurfaceOffset,
    Sweep,
    ThreeTwoOneOne,
    ThrustLoss,
    Waypoint,
    check_route,
    doublet_schedule,
    multisine,
    patrol,
    simulate,
    three_two_one_one_schedule,
    trim,
)
from wingwatch.simulation.autopilot import BANK_LIMIT_RAD, CLIMB_RAD, autopilot_row
from wingwatch.simulation.manoeuvres import excitation, excitation_rows
from wingwatch.simulation.route import TRACK_RAD_S, route_bank, route_rows, turn_radius_m
from wingwatch.telemetry import CHANNEL_INDEX

AEROSONDE, ULTRASTICK, TWIN_OTTER = (load_aircraft(n) for n in ("aerosonde", "ultrastick25e", "twinotter"))
CRUISE = FlightCondition(25.0, 1000.0)
G = 9.80665


def cruise(aircraft: Aircraft) -> FlightCondition:
    assert aircraft.envelope is not None
    return aircraft.envelope.cruise


# manoeuvres


def deflections(
    manoeuvres: tuple[Manoeuvre, ...], times: NDArray[np.float64] | list[float]
) -> NDArray[np.float64]:
    rows, out = excitation_rows(manoeuvres), np.empty(3)
    result = np.empty((len(times), 3))
    for i, t in enumerate(times):
        excitation(rows, len(rows), float(t), out)
        result[i] = out
    return result


def test_a_doublet_is_a_pulse_up_and_a_pulse_down() -> None:
    doublet = Doublet("elevator", 0.03, 0.2, 1.0)
    elevator = deflections((doublet,), [0.9, 1.0, 1.19, 1.21, 1.39, 1.41, 100.0])[:, 0]
    assert elevator.tolist() == [0.0, 0.03, 0.03, -0.03, -0.03, 0.0, 0.0]


def test_a_3211_has_steps_of_three_two_one_and_one() -> None:
    manoeuvre = ThreeTwoOneOne("rudder", 0.1, 1.0, 0.0)
    rudder = deflections((manoeuvre,), [0.0, 2.9, 3.1, 4.9, 5.1, 5.9, 6.1, 6.9, 7.1])[:, 2]
    assert rudder.tolist() == [0.1, 0.1, -0.1, -0.1, 0.1, 0.1, -0.1, -0.1, 0.0]


def test_pulse_widths_are_those_of_the_thesis() -> None:
    # thesis table 7.1: 0.2018 s for a short period of 11.4 rad/s, 0.3846 s for a Dutch roll of 5.98 rad/s
    assert doublet_pulse_s(11.397) == pytest.approx(0.2018, abs=5e-5)
    assert step_3211_s(1.6) == 1.0


def test_a_schedule_repeats_elevator_aileron_rudder() -> None:
    schedule = doublet_schedule(AEROSONDE, CRUISE, 0.02)
    assert schedule.surfaces == ("elevator", "aileron", "rudder")
    assert schedule.pulses_s[0] == pytest.approx(2.3 / 10.19, rel=0.01)
    for start in (5.0, 25.0, 1005.0):
        for i in range(3):
            at = deflections((schedule,), [start + 4.0 * i + 0.01])[0]
            assert at.tolist() == [0.02 if j == i else 0.0 for j in range(3)]
    assert not deflections((schedule,), [0.0, 4.99, 18.0, 24.9]).any()


def test_every_manoeuvre_repeats_after_its_period() -> None:
    manoeuvres: tuple[Manoeuvre, ...] = (
        Doublet("elevator", 0.03, 0.2, 1.0, period_s=7.0),
        ThreeTwoOneOne("aileron", 0.02, 0.3, 2.0, period_s=7.0),
        Sweep("rudder", 0.01, (0.5, 2.0), 4.0, 2.5, period_s=7.0),
        Multisine(("rudder",), (0.01,), ((1, 3),), ((0.0, 0.5),), 2.0, 1.0, period_s=7.0),
    )
    times = np.linspace(0.0, 7.9, 80) + 1.013
    first = deflections(manoeuvres, times)
    assert np.abs(first).max(axis=0) == pytest.approx([0.03, 0.02, 0.01], rel=0.1)
    # a sine's phase is known to rounding of the time since the start: 1e-16 x 100 s x 2 pi 2 Hz x 0.01 rad
    np.testing.assert_allclose(deflections(manoeuvres, times + 7.0 * 13), first, atol=2e-15)
    assert not deflections(manoeuvres, [0.0, 0.99]).any()


def test_the_schedule_of_3211_fits_each_mode() -> None:
    elevator, aileron, rudder = three_two_one_one_schedule(AEROSONDE, CRUISE)
    assert elevator.step_s == pytest.approx(1.6 / 10.19, rel=0.01)
    assert aileron.step_s == rudder.step_s > elevator.step_s
    times = np.arange(0.0, 35.0, 0.05)
    assert (np.count_nonzero(deflections((elevator, aileron, rudder), times), axis=1) <= 1).all()


def test_manoeuvres_add_up() -> None:
    both = (Doublet("aileron", 0.1, 1.0, 0.0), Doublet("aileron", 0.02, 2.0, 0.0))
    assert deflections(both, [0.5, 1.5])[:, 1] == pytest.approx([0.12, -0.08])


@pytest.mark.parametrize("kind", ["linear", "logarithmic"])
@pytest.mark.parametrize("band", [(0.2, 4.0), (4.0, 0.2)])
def test_a_sweep_is_scipys_chirp(kind: Literal["linear", "logarithmic"], band: tuple[float, float]) -> None:
    sweep = Sweep("elevator", 0.05, band, 20.0, 3.0, kind)
    since = np.arange(0.0, sweep.ends_s, 0.01)
    wanted = 0.05 * chirp(since, band[0], 20.0, band[1], method=kind, phi=-90.0)
    np.testing.assert_allclose(deflections((sweep,), since + 3.0)[:, 0], wanted, atol=0.05 * 1e-10)
    # it ends at zero, as soon as one more half cycle would not fit, and is over
    last = deflections((sweep,), [3.0 + sweep.ends_s - 1e-9, 3.0 + sweep.ends_s, 30.0])[:, 0]
    assert abs(last[0]) < 0.05 * 2.0 * math.pi * max(band) * 2e-9
    assert last[1:].tolist() == [0.0, 0.0]
    assert 20.0 - sweep.ends_s < 0.5 / min(band)


PERIOD_S = 10.0
SINES = multisine(AEROSONDE, 0.03, length_s=PERIOD_S, start_s=2.0)
TIMES = np.arange(0.0, PERIOD_S, 0.01)
WAVES = deflections((SINES,), TIMES + 2.0)


def test_the_multisines_of_the_surfaces_are_orthogonal_over_the_period() -> None:
    gram = WAVES.T @ WAVES
    size = np.sqrt(np.diagonal(gram))
    # rounding of a thousand products
    assert np.abs(gram / np.outer(size, size) - np.eye(3)).max() < 1000 * 1e-16
    assert not set(SINES.harmonics[0]) & set(SINES.harmonics[1])


def test_a_multisine_has_power_at_its_harmonics_alone_all_in_its_modes_band() -> None:
    spectrum = np.abs(np.fft.rfft(WAVES, axis=0)) / (len(TIMES) / 2)
    bands = ((0.1, 4.0), (0.1, 6.0), (0.1, 4.0))  # the file's short period, lateral, Dutch roll
    for i, (ks, band) in enumerate(zip(SINES.harmonics, bands, strict=True)):
        lines = spectrum[list(ks), i]
        np.testing.assert_allclose(lines, lines[0], rtol=1e-10)
        assert np.delete(spectrum[:, i], list(ks)).max() < 1e-15
        assert band[0] <= ks[0] / PERIOD_S
        assert band[1] >= ks[-1] / PERIOD_S > band[1] - 3.0 / PERIOD_S
    assert SINES.harmonics[0][0] / SINES.length_s == 0.1


def test_a_multisine_starts_and_ends_at_zero_and_stays_within_its_amplitude() -> None:
    assert np.abs(WAVES[0]).max() < 1e-14
    top = np.abs(deflections((SINES,), np.arange(2.0, 12.0, 0.001))).max(axis=0)
    # the amplitude is set at 16 points a cycle of the fastest sine: between them it may rise by 1 / cos(pi / 16)
    assert (top <= 0.03 / math.cos(math.pi / 16.0)).all()
    assert (top >= 0.03 * math.cos(math.pi / 16.0)).all()


def test_the_peak_factor_is_lower_than_schroeders(capsys: pytest.CaptureFixture[str]) -> None:
    for surface, ks, factor in zip(SINES.surfaces, SINES.harmonics, SINES.relative_peak_factors, strict=True):
        schroeder = relative_peak_factor(ks, schroeder_phases_rad(len(ks)))
        in_phase = relative_peak_factor(ks, np.zeros(len(ks)))
        with capsys.disabled():
            print(
                f"\n{surface}: {len(ks)} sines, relative peak factor {factor:.3f}, Schroeder {schroeder:.3f}",
                end="",
            )
        assert factor < schroeder < in_phase
        assert factor < 1.2  # a sine has 1; Schroeder's phases give 1.3 here
    assert relative_peak_factor((3,), [0.4]) == pytest.approx(1.0, abs=1.0 - math.cos(math.pi / 16.0))


def test_a_multisine_without_a_pause_runs_on() -> None:
    np.testing.assert_allclose(deflections((SINES,), TIMES + 12.0), WAVES, atol=1e-14)
    paused = multisine(AEROSONDE, 0.03, surfaces=("rudder",), band_hz=(0.2, 1.0), period_s=15.0, start_s=0.0)
    assert paused.harmonics == (tuple(range(2, 11)),)
    assert not deflections((paused,), [10.0, 12.0, 14.99]).any()
    assert np.ptp(deflections((paused,), TIMES + 15.0)[:, 2]) > 0.03


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: Doublet("flap", 0.1, 0.2, 0.0), "surface 'flap'; give one of elevator, aileron, rudder"),  # type: ignore[arg-type]
        (lambda: Doublet("elevator", 2.0, 0.2, 0.0), "amplitude 2.0 rad"),
        (lambda: Doublet("elevator", 0.1, 1.0, 0.0, period_s=1.5), "repeats after 1.5 s but lasts 2 s"),
        (lambda: ThreeTwoOneOne("rudder", 0.1, 0.0, 0.0), "lasts 0.0 s"),
        (lambda: Doublet("rudder", 0.1, 0.1, math.nan), "starts at nan s"),
        (lambda: DoubletSchedule(("rudder",), (0.1, 0.1), (0.1,)), "give one of each a surface"),
        (lambda: DoubletSchedule(("rudder",), (0.1,), (6.0,), period_s=10.0), "one round takes 12 s"),
        (lambda: Sweep("rudder", 0.1, (1.0, 1.0), 10.0, 0.0), "two different positive frequencies"),
        (lambda: Sweep("rudder", 0.1, (0.01, 0.02), 10.0, 0.0), "less than a whole cycle"),
        (lambda: Sweep("rudder", 0.1, (0.1, 2.0), 10.0, 0.0, "square"), "kind 'square'"),  # type: ignore[arg-type]
        (lambda: Multisine(("rudder",), (0.1,), ((2, 2),), ((0.0, 0.0),), 10.0, 0.0), "ascending"),
        (
            lambda: Multisine(("rudder", "aileron"), (0.1, 0.1), ((2,), (2,)), ((0.0,), (0.0,)), 10.0, 0.0),
            r"harmonics \[2\] on two surfaces",
        ),
        (lambda: Multisine((), (), (), (), 10.0, 0.0), "give one of each a surface"),
        (lambda: multisine(AEROSONDE, length_s=0.5, band_hz=(0.1, 1.0)), "has no harmonic for elevator"),
    ],
)
def test_manoeuvres_that_make_no_sense_are_refused(build: object, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        build()  # type: ignore[operator]


# routes


def test_legs_lead_from_the_start_round_the_patrol_and_round_again() -> None:
    square = Route(tuple(Waypoint(n, e, 100.0, 20.0) for n, e in ((900, 0), (900, 900), (0, 900), (0, 0))))
    rows = route_rows(square)
    assert rows[0, :2].tolist() == [5.0, 1.0]
    assert rows[1:, 4].tolist() == [900.0] * 5
    assert rows[1:, 2:4].tolist() == [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 0]]
    # a right angle is turned from R tan(45 degrees) before the corner on
    np.testing.assert_allclose(rows[1:, 5], turn_radius_m(20.0), rtol=1e-12)
    once = route_rows(Route(square.waypoints, loops=False))
    assert once[0, :2].tolist() == [4.0, -1.0]
    assert once[4, 5] == 0.0
    assert route_rows(None)[0, 0] == 0.0


def test_a_patrol_that_begins_at_the_start_has_no_first_leg() -> None:
    rows = route_rows(Route((Waypoint(0.0, 0.0, 100.0, 20.0), Waypoint(500.0, 0.0, 100.0, 20.0))))
    assert rows[0, :2].tolist() == [2.0, 0.0]
    # back on itself there is no arc that touches both legs: no more than half a leg ahead
    assert rows[1:, 5] == pytest.approx([min(2.0 * turn_radius_m(20.0), 250.0)] * 2)


@pytest.mark.parametrize("ground_m_s", [10.0, 25.0, 60.0])
def test_near_its_leg_the_track_is_a_loop_of_its_frequency_damped_by_half_root_two(ground_m_s: float) -> None:
    rows = route_rows(Route((Waypoint(1e5, 1e5, 0.0, 25.0),), loops=False))
    along, right = np.array([1.0, 1.0]) / math.sqrt(2.0), np.array([-1.0, 1.0]) / math.sqrt(2.0)

    def side_acceleration(across_m: float, rate_m_s: float) -> float:
        velocity = math.sqrt(ground_m_s**2 - rate_m_s**2) * along + rate_m_s * right
        place = 1e4 * along + across_m * right
        bank, _ = route_bank(rows, 0, *place, *velocity)
        return G * math.tan(bank)

    # e'' = -w^2 e - 2 (1/sqrt 2) w e', both terms alone and small against the distance looked ahead
    small = 1e-4 * ground_m_s
    assert side_acceleration(small, 0.0) / small == pytest.approx(-(TRACK_RAD_S**2), rel=1e-6)
    assert side_acceleration(0.0, small) / small == pytest.approx(-math.sqrt(2.0) * TRACK_RAD_S, rel=1e-6)
    # far away it is met at 45 degrees: flown so, nothing is left to turn
    far = 1e4
    speed = ground_m_s / math.sqrt(2.0)
    assert route_bank(rows, 0, *(1e4 * along - far * right), *(speed * along + speed * right))[
        0
    ] == pytest.approx(0.0, abs=1e-12)


def test_flying_away_from_its_leg_it_turns_back_hard() -> None:
    rows = route_rows(Route((Waypoint(1e5, 0.0, 0.0, 25.0),), loops=False))
    # east of a leg to the north and flying south, the right hand is the side of the leg
    assert route_bank(rows, 0, 100.0, 10.0, -25.0, 0.1)[0] > BANK_LIMIT_RAD
    assert route_bank(rows, 0, 100.0, -10.0, -25.0, -0.1)[0] < -BANK_LIMIT_RAD
    assert route_bank(rows, 0, 100.0, -10.0, 0.0, 0.0)[0] == 0.0


@pytest.mark.parametrize("aircraft", [AEROSONDE, ULTRASTICK, TWIN_OTTER], ids=lambda a: a.name)
def test_a_patrol_turns_climbs_and_changes_speed_within_what_trim_allows(aircraft: Aircraft) -> None:
    condition = cruise(aircraft)
    route = patrol(aircraft, condition)
    check_route(aircraft, route)
    assert aircraft.envelope is not None
    heights = {w.altitude_m for w in route.waypoints}
    speeds = {w.airspeed_true_m_s for w in route.waypoints}
    assert len(heights) == 2
    assert len(speeds) == 3
    assert all(aircraft.envelope.altitude_m[0] <= h <= aircraft.envelope.altitude_m[1] for h in heights)
    assert all(
        aircraft.envelope.airspeed_true_m_s[0] <= v <= aircraft.envelope.airspeed_true_m_s[1] for v in speeds
    )
    legs = [math.hypot(b.north_m - a.north_m, b.east_m - a.east_m) for a, b in pairwise(route.waypoints)]
    assert min(legs) >= 3.9 * turn_radius_m(max(speeds))


def test_a_patrol_at_the_fastest_trim_goes_no_faster() -> None:
    route = patrol(AEROSONDE, FlightCondition(31.5, 1000.0))
    assert max(w.airspeed_true_m_s for w in route.waypoints) == 31.5


def test_a_route_that_cannot_be_flown_is_refused() -> None:
    with pytest.raises(TrimError, match="45 m/s"):
        check_route(AEROSONDE, Route((Waypoint(900.0, 0.0, 100.0, 45.0),), loops=False))


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: Waypoint(0.0, math.nan, 100.0, 20.0), "all finite"),
        (lambda: Waypoint(0.0, 1.0, 100.0, 0.0), "positive airspeed"),
        (lambda: Route(()), "0 waypoints; give at least 2"),
        (lambda: Route((Waypoint(9.0, 0.0, 100.0, 20.0),) * 2), "same place"),
        (lambda: Route((Waypoint(0.0, 0.0, 100.0, 20.0),), loops=False), "from the start to the start"),
    ],
)
def test_routes_that_make_no_sense_are_refused(build: object, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        build()  # type: ignore[operator]


# the autopilot


def tracks(scenarios: list[Scenario], seconds: float) -> NDArray[np.float64]:
    """Places over the ground, shape (vehicles, seconds x 5, 2)."""
    fleet = FleetSimulation(scenarios, 5.0)
    places = []
    for _ in range(round(seconds * 5.0)):
        places.append(fleet.positions_m[:, :2])
        fleet.step(1)
    return np.stack(places, axis=1)


def test_a_patrol_passes_its_waypoints_and_keeps_to_its_legs_in_wind_and_turbulence_for_ten_minutes() -> None:
    scenarios = []
    for aircraft, wind in (
        (AEROSONDE, (-4.8, 3.6, 0.0)),
        (ULTRASTICK, (3.0, 3.0, 0.0)),
        (AEROSONDE, (0.0, 0.0, 0.0)),
    ):
        condition = cruise(aircraft)
        route = patrol(aircraft, condition)
        scenarios.append(
            Scenario(
                aircraft, condition.airspeed_true_m_s, condition.altitude_m, turbulence="light", seed=8,
                noise=False, wind_m_s=wind, route=route,
            )
        )  # fmt: skip
    for scenario, places in zip(scenarios, tracks(scenarios, 600.0), strict=True):
        assert scenario.route is not None
        corners = [(0.0, 0.0), *((w.north_m, w.east_m) for w in scenario.route.waypoints)]
        radius = turn_radius_m(max(w.airspeed_true_m_s for w in scenario.route.waypoints))
        for corner in corners[1:]:
            away = np.hypot(*(places - corner).T)
            # an arc that touches both legs of a right angle passes (sqrt 2 - 1) R = 0.41 R inside the corner
            assert away.min() < 0.5 * radius
            laps = np.count_nonzero(np.diff((away < radius).astype(int)) == 1)
            assert laps >= 3
        # between the turns it is on the leg: of all places on the second half of long legs, none is 25 m off
        for (n0, e0), (n1, e1) in ((corners[0], corners[1]), (corners[2], corners[3])):
            length = abs(n1 - n0)
            along = (places[:, 0] - n0) * np.sign(n1 - n0)
            on = (
                (along > 0.6 * length)
                & (along < length - radius)
                & (np.abs(places[:, 1] - e0) < 0.9 * radius)
            )
            assert on.any()
            assert np.abs(places[on, 1] - 0.5 * (e0 + e1)).max() < 25.0


def test_a_patrol_holds_altitude_and_airspeed() -> None:
    for aircraft in (AEROSONDE, ULTRASTICK):
        condition = cruise(aircraft)
        calm = Scenario(
            aircraft, condition.airspeed_true_m_s, condition.altitude_m, noise=False, route=patrol(aircraft, condition)
        )  # fmt: skip
        block = simulate(calm, 600.0, 10.0)
        height = block.column("altitude_m") - block.column("altitude_demand_m")
        speed = block.column("airspeed_true_m_s") / block.column("airspeed_demand_m_s") - 1.0
        # in still air: an altimeter's and a pitot tube's own error, through turns, climbs and speed changes
        assert np.abs(height).max() < 3.0
        assert np.abs(speed).max() < 0.07
        assert np.abs(block.column("roll_rad")).max() < BANK_LIMIT_RAD + 0.1
        assert np.abs(block.column("sideslip_rad")).max() < math.radians(6.0)
        assert len(np.unique(np.sign(np.round(np.diff(block.column("altitude_demand_m")), 4)))) == 3
        assert np.ptp(block.column("airspeed_demand_m_s")) > 0.2 * condition.airspeed_true_m_s


def test_a_climb_and_a_faster_leg_are_flown_at_limited_rates_and_then_held() -> None:
    route = Route((Waypoint(1e5, 0.0, 1060.0, 28.0),), loops=False)
    block = simulate(Scenario(AEROSONDE, route=route, noise=False), 120.0)
    demand, speed = block.column("altitude_demand_m"), block.column("airspeed_demand_m_s")
    assert np.diff(demand).max() <= CLIMB_RAD * 28.0 / 50.0 * 1.001
    assert np.diff(speed).max() <= 0.4 / 50.0 * 1.001
    assert (np.diff(speed) >= 0.0).all()
    late = block.time_s > 90.0
    assert np.abs(block.column("altitude_m")[late] - 1060.0).max() < 0.5
    assert np.abs(block.column("airspeed_true_m_s")[late] - 28.0).max() < 0.2
    assert block.column("throttle").max() < 1.0


def test_a_route_that_does_not_loop_goes_on_along_its_last_leg() -> None:
    route = Route((Waypoint(600.0, 0.0, 1000.0, 25.0), Waypoint(600.0, 800.0, 1000.0, 25.0)), loops=False)
    (places,) = tracks([Scenario(AEROSONDE, route=route, noise=False)], 180.0)
    assert places[-1, 1] > 2000.0
    assert np.abs(places[places[:, 1] > 1500.0][:, 0] - 600.0).max() < 3.0


ENVELOPE = [
    (aircraft, speed, altitude)
    for aircraft, speeds, altitudes in (
        (AEROSONDE, (20.0, 25.0, 30.0, 32.0), (0.0, 1000.0, 2000.0)),
        (ULTRASTICK, (13.0, 17.0, 20.0, 23.0), (0.0, 1000.0)),
    )
    for speed in speeds
    for altitude in altitudes
]


def test_the_loops_are_stable_over_the_envelope() -> None:
    """Upset by five degrees on every surface, each flight comes back to its trim."""
    five = math.radians(5.0)
    kicks = (
        Doublet("elevator", five, 0.4, 1.0),
        Doublet("aileron", five, 0.4, 2.0),
        Doublet("rudder", five, 0.4, 3.0),
    )
    scenarios = []
    for aircraft, speed, altitude in ENVELOPE:
        try:
            trim(aircraft, FlightCondition(speed, altitude))
        except TrimError:
            continue
        scenarios.append(Scenario(aircraft, speed, altitude, kicks, noise=False))
    assert len(scenarios) >= 15
    flights = FleetSimulation(scenarios, 50.0).step(80 * 50)
    for scenario, flight in zip(scenarios, flights, strict=True):
        now = {
            name: flight[:, CHANNEL_INDEX[name]]
            for name in ("roll_rad", "pitch_rate_rad_s", "altitude_m", "airspeed_true_m_s", "heading_rad")
        }
        late = slice(70 * 50, None)
        assert np.abs(now["roll_rad"]).max() > 0.05, scenario.aircraft.name
        assert np.abs(now["roll_rad"][late]).max() < 0.005
        assert np.abs(now["heading_rad"][late]).max() < 0.02
        assert np.abs(now["pitch_rate_rad_s"][late]).max() < 0.001
        assert np.abs(now["altitude_m"][late] - scenario.altitude_m).max() < 0.3
        assert np.abs(now["airspeed_true_m_s"][late] - scenario.airspeed_true_m_s).max() < 0.1


def test_the_rudder_is_left_to_its_excitation() -> None:
    block = simulate(
        Scenario(AEROSONDE, route=patrol(AEROSONDE, CRUISE), turbulence="light", noise=False), 60.0, 20.0
    )
    assert np.ptp(block.column("rudder_command_rad")) == 0.0


def test_a_wrong_airspeed_reading_is_flown() -> None:
    scenario = Scenario(AEROSONDE, effects=(AirspeedError(-0.1, 5.0),), noise=False)
    (places,) = tracks([scenario], 100.0)
    assert float(np.hypot(*(places[-1] - places[-6]))) == pytest.approx(25.0 / 0.9, rel=0.005)
    assert simulate(scenario, 100.0, 5.0).column("airspeed_true_m_s")[-1] == pytest.approx(25.0, rel=0.005)


def test_a_frozen_airspeed_is_flown() -> None:
    """Frozen below what is demanded, the airspeed is never enough: throttle grows by the integral, airspeed with it."""
    low, high, climb = (
        Waypoint(300.0, 0.0, 1000.0, 25.0),
        Waypoint(1e5, 0.0, 1000.0, 27.0),
        "velocity_down_m_s",
    )
    scenario = Scenario(AEROSONDE, route=Route((low, high), loops=False), noise=False)
    onset = SensorFreeze(1.0, 15.0, target="airspeed_true_m_s")
    free, frozen, other = (
        simulate(s, 60.0)
        for s in (
            scenario,
            replace(scenario, effects=(onset,)),
            replace(scenario, effects=(replace(onset, target=climb),)),
        )
    )
    speed = frozen.column("airspeed_true_m_s")
    at = 15 * 50
    np.testing.assert_array_equal(frozen.values[: at + 1], free.values[: at + 1])
    np.testing.assert_array_equal(speed[at:], free.column("airspeed_true_m_s")[at])
    assert speed[-1] < 26.5
    truth = np.linalg.norm(
        [frozen.column(f"velocity_{axis}_m_s") for axis in ("north", "east", "down")], axis=0
    )
    assert truth[-1] > 29.0
    assert free.column("airspeed_true_m_s")[-1] == pytest.approx(27.0, abs=0.1)
    assert frozen.column("throttle")[-1] > free.column("throttle")[-1] + 0.1
    np.testing.assert_array_equal(other.column("throttle"), free.column("throttle"))


def test_the_autopilot_holds_the_airspeed_read_at_the_last_frame_up_to_the_onset() -> None:
    """Its orders are those of a flight whose airspeed is read as often as it gives them, whatever the sample rate."""
    for onset_s in (2.0, 2.01, 0.0):
        effects = (SensorFreeze(1.0, onset_s, target="airspeed_true_m_s"),)
        scenario = Scenario(AEROSONDE, effects=effects, turbulence="moderate", noise=False, seed=4)
        fleet = FleetSimulation([scenario])
        held = fleet.step(300)[0, -1, CHANNEL_INDEX["airspeed_true_m_s"]]
        assert fleet._state.airspeed_read[0] == pytest.approx(held, rel=1e-13)


def test_an_aircraft_that_pulls_to_one_side_is_held_straight() -> None:
    block = simulate(
        Scenario(AEROSONDE, effects=(SurfaceOffset(0.05, 5.0, target="aileron"),), noise=False), 90.0, 20.0
    )
    assert np.abs(block.column("roll_rad")).max() > 0.02
    assert abs(block.column("heading_rad")[-1]) < 0.01
    assert block.column("aileron_command_rad")[-1] == pytest.approx(-0.05, abs=0.01)


def test_where_thrust_lacks_airspeed_gives_way_before_altitude() -> None:
    # at 25 m/s level flight takes 29 % of full thrust, at 23 m/s 24 %
    less, nearly, none = (
        simulate(Scenario(AEROSONDE, effects=(ThrustLoss(size, 5.0),), noise=False), 180.0, 20.0)
        for size in (0.5, 0.76, 1.0)
    )
    assert less.column("airspeed_true_m_s")[-1] == pytest.approx(25.0, abs=0.05)
    assert less.column("throttle")[-1] < 1.0
    for block in (nearly, none):
        assert block.column("throttle")[-1] == 1.0
        assert 0.9 * 25.0 < block.column("airspeed_true_m_s")[-1] < 0.98 * 25.0
        # the wing stalls near 17 m/s
        assert block.column("airspeed_true_m_s").min() > 19.0
    assert np.abs(nearly.column("altitude_m") - 1000.0).max() < 3.0
    assert none.column("altitude_m")[-1] < 800.0
    assert np.abs(none.column("pitch_rad")).max() < 0.2


def test_an_aircraft_whose_surfaces_have_no_power_is_refused() -> None:
    assert AEROSONDE.coefficients is not None
    changed = AEROSONDE.model_copy(
        update={"coefficients": AEROSONDE.coefficients.with_value("Cl_aileron", 0.17)}
    )
    with pytest.raises(ValueError, match=r"cannot be flown by the autopilot at 25 m/s.*aileron roll rate"):
        autopilot_row(changed, CRUISE, trim(changed, CRUISE))
