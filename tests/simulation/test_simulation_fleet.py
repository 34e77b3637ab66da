"""Flights: repeatable, cut anywhere, alone or in company; held by the autopilot; read by honest sensors."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.simulation import (
    ActuatorBacklash,
    CgShift,
    DiscreteGust,
    Doublet,
    ElevatorEffectiveness,
    FleetSimulation,
    Icing,
    Scenario,
    SensorBias,
    SurfaceStuck,
    ThreeTwoOneOne,
    WindProfile,
    demo_fleet,
    doublet_schedule,
    patrol,
    set_up,
    simulate,
)
from wingwatch.simulation.navigation import M_A_DEGREE_EAST, M_A_DEGREE_NORTH, ORIGIN_DEG
from wingwatch.simulation.sensor_errors import NAVIGATION, SIMULATED
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, SampleBlock

AEROSONDE = load_aircraft("aerosonde")
SCHEDULE = doublet_schedule(AEROSONDE, FlightCondition(25.0, 1000.0))

VARIED = (
    Scenario(AEROSONDE, seed=3, manoeuvres=(SCHEDULE,), turbulence="light"),
    Scenario(AEROSONDE, 22.0, 500.0, seed=4, effects=(Icing(0.2, 1.0, 2.0), ElevatorEffectiveness(0.5, 1.5))),
    Scenario(load_aircraft("ultrastick25e"), 17.0, 300.0, seed=5, turbulence="moderate", noise=False),
    Scenario(
        AEROSONDE, seed=3, manoeuvres=(ThreeTwoOneOne("rudder", 0.03, 0.4, 0.5),), wind_m_s=(3.0, -4.0, 0.5)
    ),
    Scenario(
        AEROSONDE, 25.0, 300.0, seed=6, manoeuvres=(SCHEDULE,), turbulence="light", turbulence_model="von-karman",
        wind_m_s=(5.0, 2.0, 0.0), wind_profile=WindProfile("other"), gusts=(DiscreteGust("w", 2.0, 30.0, 1.0),),
        effects=(
            CgShift(0.02, 1.0, 1.0), ActuatorBacklash(0.02, 0.5, target="elevator"), Icing(0.2, 0.5, 2.0, "left"),
            SurfaceStuck(math.nan, 2.5, target="rudder"), SensorBias(0.01, 1.0, target="pitch_rate_rad_s"),
        ),
        route=patrol(AEROSONDE, FlightCondition(25.0, 300.0)),
    ),
)  # fmt: skip


def with_sensors(**changes: object) -> Aircraft:
    return AEROSONDE.model_copy(update={"sensors": AEROSONDE.sensors.model_copy(update=changes)})


def column(values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    return np.asarray(values[..., CHANNEL_INDEX[name]])


def test_a_flight_is_the_same_to_the_bit_alone_and_in_company() -> None:
    together = FleetSimulation(VARIED).step(200)
    for i, scenario in enumerate(VARIED):
        np.testing.assert_array_equal(FleetSimulation([scenario]).step(200)[0], together[i])
    swapped = FleetSimulation(VARIED[::-1]).step(200)
    np.testing.assert_array_equal(swapped[::-1], together)


def test_a_flight_is_the_same_to_the_bit_in_pieces() -> None:
    whole = FleetSimulation(VARIED).step(200)
    fleet = FleetSimulation(VARIED)
    pieces = [fleet.step(n) for n in (1, 0, 31, 3, 64, 101)]
    np.testing.assert_array_equal(np.concatenate(pieces, axis=1), whole)
    assert fleet.time_s == 4.0


def test_chance_is_the_seed_and_nothing_else() -> None:
    scenario = VARIED[0]
    same, other = simulate(scenario, 2.0), simulate(replace(scenario, seed=99), 2.0)
    np.testing.assert_array_equal(simulate(scenario, 2.0).values, same.values)
    assert not np.array_equal(
        column(other.values, "angle_of_attack_rad"), column(same.values, "angle_of_attack_rad")
    )


def test_a_flight_table_has_the_simulated_columns_on_the_vehicles_clock() -> None:
    block = simulate(Scenario(AEROSONDE), 2.0, rate_hz=25.0)
    assert set(block.present) == set(SIMULATED)
    np.testing.assert_array_equal(block.time_s, np.arange(50) / 25.0)
    assert FleetSimulation(VARIED).step(3).shape == (len(VARIED), 3, len(CHANNELS))


@pytest.mark.parametrize("airspeed", [20.0, 25.0, 32.0])
def test_a_healthy_aircraft_holds_height_speed_and_heading_through_doublets(airspeed: float) -> None:
    schedule = doublet_schedule(AEROSONDE, FlightCondition(airspeed, 1000.0))
    block = simulate(Scenario(AEROSONDE, airspeed, manoeuvres=(schedule,), noise=False), 120.0)
    # what a survey flight asks of its autopilot, and what keeps it at one condition of the envelope: 2 % of airspeed
    assert np.abs(block.column("altitude_m") - 1000.0).max() < 5.0
    assert np.abs(block.column("airspeed_true_m_s") / airspeed - 1.0).max() < 0.02
    assert np.abs(block.column("heading_rad")).max() < math.radians(5.0)
    assert np.ptp(block.column("pitch_rate_rad_s")) > 0.05


def test_the_autopilot_does_not_suppress_a_doublet() -> None:
    pulse = SCHEDULE.pulses_s[0]
    block = simulate(
        Scenario(AEROSONDE, manoeuvres=(Doublet("elevator", 0.035, pulse, 1.0),), noise=False), 2.0
    )
    command = block.column("elevator_command_rad") - block.column("elevator_command_rad")[0]
    during = (block.time_s >= 1.0) & (block.time_s < 1.0 + 2.0 * pulse)
    wanted = np.where(block.time_s < 1.0 + pulse, 0.035, -0.035)
    # the attitude loop closes at 1.5 rad/s: over the doublet it can answer at most 1.5 rad/s x its length of it
    assert np.abs(command - wanted)[during].max() < 0.035 * 1.5 * 2.0 * pulse


@pytest.mark.parametrize("level", ["light", "moderate"])
def test_turbulence_shakes_but_does_not_upset(level: str) -> None:
    block = simulate(Scenario(AEROSONDE, turbulence=level, seed=1, noise=False), 120.0)  # type: ignore[arg-type]
    assert np.isfinite(block.values[:, [CHANNEL_INDEX[c] for c in SIMULATED]]).all()
    assert np.abs(block.column("roll_rad")).max() < math.radians(45.0)
    assert np.abs(block.column("altitude_m") - 1000.0).max() < 50.0
    assert np.std(block.column("specific_force_z_m_s2")) > 0.3


def test_damaged_and_iced_aircraft_are_flown_on() -> None:
    for scenario in demo_fleet():
        block = simulate(replace(scenario, noise=False), 180.0)
        assert np.abs(block.column("altitude_m") - 1000.0).max() < 10.0, scenario.name
        assert np.abs(block.column("airspeed_true_m_s") - 25.0).max() < 1.5, scenario.name


def test_a_steady_wind_carries_the_aircraft_and_is_not_felt() -> None:
    calm = simulate(Scenario(AEROSONDE, manoeuvres=(SCHEDULE,), noise=False), 20.0)
    windy = simulate(
        Scenario(AEROSONDE, manoeuvres=(SCHEDULE,), noise=False, wind_m_s=(-6.0, 8.0, 0.0)), 20.0
    )
    # the wind's part of the velocity turns with the body, which a fourth-order step follows to (spin dt)^4 of
    # it; so much airspeed too much changes the forces by less than the fastest motion, 20/s, times that
    spin = max(float(np.abs(calm.column(f"{axis}_rate_rad_s")).max()) for axis in ("roll", "pitch", "yaw"))
    drift = 10.0 * (spin * 0.01) ** 4
    felt = [CHANNEL_INDEX[name] for name in SIMULATED if name not in NAVIGATION]
    np.testing.assert_allclose(windy.values[:, felt], calm.values[:, felt], rtol=1e-9, atol=20.0 * drift)
    for axis, wind in (("north", -6.0), ("east", 8.0), ("down", 0.0)):
        carried = windy.column(f"velocity_{axis}_m_s") - calm.column(f"velocity_{axis}_m_s")
        # attitudes differ by as much, and turn 25 m/s
        np.testing.assert_allclose(carried, wind, rtol=0.0, atol=(1.0 + 25.0) * 20.0 * drift)


def velocity(block: SampleBlock) -> NDArray[np.float64]:
    """Over the ground, shape (samples, 3)."""
    return np.stack([block.column(f"velocity_{axis}_m_s") for axis in ("north", "east", "down")], axis=1)


def test_in_still_air_the_velocity_over_the_ground_is_that_through_the_air() -> None:
    """Also of an aircraft whose centre of gravity is not the file's: both are the reference point's."""
    for effects in ((), (CgShift(0.1, 2.0, 1.0), Icing(0.2, 1.0))):
        block = simulate(Scenario(AEROSONDE, manoeuvres=(SCHEDULE,), effects=effects, noise=False), 12.0)
        speed, alpha, beta = (
            block.column(c) for c in ("airspeed_true_m_s", "angle_of_attack_rad", "sideslip_rad")
        )
        np.testing.assert_allclose(np.linalg.norm(velocity(block), axis=1), speed, rtol=1e-13)
        # along the body's axes, by Euler angles
        body = speed[:, None] * np.stack(
            [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)], axis=1
        )
        angles = np.stack([block.column(c) for c in ("heading_rad", "pitch_rad", "roll_rad")], axis=1)
        to_earth = Rotation.from_euler("ZYX", angles)
        np.testing.assert_allclose(velocity(block), to_earth.apply(body), atol=1e-12)


def test_the_position_is_where_the_velocity_leads() -> None:
    rate = 200.0
    effects = (CgShift(0.05, 3.0),)
    scenario = Scenario(
        AEROSONDE, manoeuvres=(SCHEDULE,), effects=effects, noise=False, wind_m_s=(3.0, 9.0, 0.0)
    )
    block = simulate(scenario, 12.0, rate)
    place = np.stack(
        [
            (block.column("latitude_deg") - ORIGIN_DEG[0]) * M_A_DEGREE_NORTH,
            (block.column("longitude_deg") - ORIGIN_DEG[1]) * M_A_DEGREE_EAST,
        ],
        axis=1,
    )
    v = velocity(block)[:, :2]
    # trapezoids err by (step^2 / 12) times the change of acceleration; degrees resolve a nanometre
    bend = np.abs(np.diff(v, axis=0)).sum(axis=0).max() * rate
    led = np.concatenate([np.zeros((1, 2)), np.cumsum(0.5 * (v[1:] + v[:-1]), axis=0) / rate])
    np.testing.assert_allclose(place - place[0], led, rtol=0.0, atol=bend / rate**2 / 12.0)
    assert np.hypot(*place[0]) < 1e-6
    assert place[-1] == pytest.approx([28.0 * 12.0, 9.0 * 12.0], rel=0.05)
    fleet = FleetSimulation([replace(scenario, effects=())])
    fleet.step(300)
    flown = fleet.step(1)[0, 0]
    here = FleetSimulation([replace(scenario, effects=())])
    here.step(300)
    north, east, _ = here.positions_m[0]
    assert flown[CHANNEL_INDEX["latitude_deg"]] == pytest.approx(
        ORIGIN_DEG[0] + north / M_A_DEGREE_NORTH, rel=1e-15
    )
    assert flown[CHANNEL_INDEX["longitude_deg"]] == pytest.approx(
        ORIGIN_DEG[1] + east / M_A_DEGREE_EAST, rel=1e-15
    )


def test_the_sample_rate_does_not_change_the_flight() -> None:
    scenario = Scenario(AEROSONDE, manoeuvres=(SCHEDULE,), noise=False)
    slow, fast = simulate(scenario, 10.0, 25.0), simulate(scenario, 10.0, 100.0)
    np.testing.assert_allclose(fast.values[::4], slow.values, rtol=1e-9, atol=2000 * 1e-13)


@pytest.mark.parametrize("rate", [7.0, 30.0, 60.0, 200.0])
def test_any_sample_rate_gives_the_flight(rate: float) -> None:
    """Frames and steps then have other lengths, so pulses start up to half a frame apart: a calm flight has none."""
    calm = Scenario(AEROSONDE, effects=(ElevatorEffectiveness(0.4, 1.0),), noise=False)
    usual, other = simulate(calm, 12.0, 50.0), simulate(calm, 12.0, rate)
    np.testing.assert_array_equal(other.time_s, np.arange(len(other)) / rate)
    for name in ("pitch_rad", "airspeed_true_m_s", "elevator_rad"):
        # the loss and the autopilot's answers come with a frame, of 17 to 21 ms: so much apart at most, and as much
        # again for what has grown from that
        there = np.interp(other.time_s, usual.time_s, usual.column(name))
        fastest = 50.0 * float(np.abs(np.diff(usual.column(name))).max())
        assert np.abs(other.column(name) - there).max() <= 2.0 * 0.021 * fastest


def test_halving_the_step_changes_nothing_that_a_sensor_could_show() -> None:
    """And does so by the fourth order where the surfaces move smoothly."""
    free = {
        name: getattr(AEROSONDE.actuators, name).model_copy(update={"rate_limit_rad_s": None})
        for name in ("elevator", "aileron", "rudder")
    }
    smooth = AEROSONDE.model_copy(update={"actuators": AEROSONDE.actuators.model_copy(update=free)})
    for aircraft in (AEROSONDE, smooth):
        scenario = Scenario(aircraft, manoeuvres=(SCHEDULE,), effects=(Icing(0.1, 2.0, 10.0),), noise=False)
        flown, half, exact = (FleetSimulation([scenario], refine=n).step(800)[0] for n in (1, 2, 8))
        for name, noise_std in AEROSONDE.sensors.noise_std.items():
            errors = [float(np.abs(column(flight - exact, name)).max()) for flight in (flown, half)]
            assert errors[0] < 0.02 * noise_std, name
            if aircraft is smooth and name.endswith("rate_rad_s") and errors[0] > 1e-9:
                assert 16.0 / 1.5 < errors[0] / errors[1] < 16.0 * 1.5, name


def test_what_vehicles_share_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    computed: list[str] = []

    def counted(name: str) -> Callable[..., object]:
        original = getattr(set_up, name)

        def count(*arguments: object) -> object:
            computed.append(name)
            return original(*arguments)

        return count

    for name in ("trim_row", "autopilot_row", "turbulence_filter", "timeline_of"):
        monkeypatch.setattr(set_up, name, counted(name))
    scenarios = [
        Scenario(AEROSONDE, seed=i, turbulence="light", effects=(Icing(0.1, 5.0),)) for i in range(50)
    ]
    first = FleetSimulation([*scenarios, Scenario(AEROSONDE, 22.0)]).step(1)
    # two conditions; a trim each to fly from and one to choose the step by; turbulence in one of them
    assert Counter(computed) == {"trim_row": 4, "autopilot_row": 2, "turbulence_filter": 1, "timeline_of": 2}
    assert len(np.unique(column(first, "airspeed_true_m_s"))) == 51


def test_sensor_noise_is_what_the_aircraft_file_says() -> None:
    scenario = Scenario(AEROSONDE, seed=7)
    n = 6000
    noisy, clean = simulate(scenario, n / 50.0), simulate(replace(scenario, noise=False), n / 50.0)
    stated = AEROSONDE.sensors.noise_std
    for name in SIMULATED:
        error = noisy.column(name) - clean.column(name)
        if name not in stated:
            np.testing.assert_array_equal(error, 0.0)
            continue
        # 4.5 standard deviations of a standard deviation, a mean and a lag-one correlation over n samples
        assert np.std(error) == pytest.approx(stated[name], rel=4.5 / math.sqrt(2 * n)), name
        assert abs(np.mean(error)) < 4.5 * stated[name] / math.sqrt(n), name
        assert abs(np.mean(error[1:] * error[:-1])) < 4.5 * stated[name] ** 2 / math.sqrt(n), name


def test_a_delayed_column_is_read_that_much_earlier() -> None:
    scenario = Scenario(AEROSONDE, manoeuvres=(SCHEDULE,), noise=False)
    late = Scenario(with_sensors(delay_s={"pitch_rate_rad_s": 0.05}), manoeuvres=(SCHEDULE,), noise=False)
    prompt = simulate(scenario, 8.0)
    fleet = FleetSimulation([late])
    delayed = np.concatenate([fleet.step(n) for n in (1, 2, 397)], axis=1)[0]
    q = prompt.column("pitch_rate_rad_s")
    wanted = 0.5 * (q[1:-2] + q[:-3])  # 0.05 s is two samples and a half
    np.testing.assert_allclose(column(delayed, "pitch_rate_rad_s")[3:], wanted, rtol=0.0, atol=1e-15)
    np.testing.assert_array_equal(column(delayed, "roll_rad"), prompt.column("roll_rad"))


def test_a_vane_away_from_the_centre_of_gravity_feels_the_rates() -> None:
    x, y, z = 0.5, 0.2, -0.1
    manoeuvres = (
        Doublet("elevator", 0.05, 0.2, 0.5),
        Doublet("rudder", 0.05, 0.4, 0.5),
        Doublet("aileron", 0.05, 0.4, 0.5),
    )
    here = simulate(Scenario(AEROSONDE, manoeuvres=manoeuvres, noise=False), 3.0)
    there = simulate(
        Scenario(with_sensors(vane_position_m=(x, y, z)), manoeuvres=manoeuvres, noise=False), 3.0
    )
    speed, alpha, beta = (
        here.column(c) for c in ("airspeed_true_m_s", "angle_of_attack_rad", "sideslip_rad")
    )
    p, q, r = (here.column(f"{axis}_rate_rad_s") for axis in ("roll", "pitch", "yaw"))
    u = speed * np.cos(alpha) * np.cos(beta) + q * z - r * y
    v = speed * np.sin(beta) + r * x - p * z
    w = speed * np.sin(alpha) * np.cos(beta) + p * y - q * x
    np.testing.assert_allclose(there.column("angle_of_attack_rad"), np.arctan2(w, u), atol=1e-12)
    np.testing.assert_allclose(
        there.column("sideslip_rad"), np.arcsin(v / np.sqrt(u**2 + v**2 + w**2)), atol=1e-12
    )
    assert np.abs(there.column("angle_of_attack_rad") - alpha).max() > 1e-3


def test_an_accelerometer_away_from_the_centre_of_gravity_feels_the_rotation() -> None:
    arm = np.array([0.3, -0.2, 0.1])
    manoeuvres = (Doublet("elevator", 0.05, 0.2, 0.2), Doublet("aileron", 0.05, 0.4, 0.2))
    rate = 1000.0
    here = simulate(Scenario(AEROSONDE, manoeuvres=manoeuvres, noise=False), 1.2, rate)
    there = simulate(
        Scenario(with_sensors(imu_position_m=tuple(arm)), manoeuvres=manoeuvres, noise=False), 1.2, rate
    )
    spin = np.stack([here.column(f"{axis}_rate_rad_s") for axis in ("roll", "pitch", "yaw")], axis=1)
    turning = np.gradient(spin, 1.0 / rate, axis=0)
    felt = np.cross(turning, arm) + np.cross(spin, np.cross(spin, arm))
    for j, axis in enumerate("xyz"):
        name = f"specific_force_{axis}_m_s2"
        difference = there.column(name) - here.column(name)
        # central differences err by (bandwidth x step)^2 / 6, where a command jumps by (bandwidth x step) / 2, with
        # 50 rad/s and 1 ms
        worst = 0.5 * 50.0 / rate * np.abs(turning).max() * np.linalg.norm(arm)
        assert np.abs(difference - felt[:, j])[1:-1].max() < worst
        assert np.abs(difference).max() > 4.0 * worst


def test_the_accelerometer_tells_how_the_velocity_changes() -> None:
    rate = 200.0
    block = simulate(
        Scenario(AEROSONDE, manoeuvres=(Doublet("elevator", 0.03, 0.25, 0.5),), noise=False), 2.0, rate
    )
    speed, alpha, pitch = (block.column(c) for c in ("airspeed_true_m_s", "angle_of_attack_rad", "pitch_rad"))
    u, w = speed * np.cos(alpha), speed * np.sin(alpha)
    wanted = (
        block.column("specific_force_z_m_s2") + block.column("pitch_rate_rad_s") * u + 9.80665 * np.cos(pitch)
    )
    change = np.cumsum(0.5 * (wanted[1:] + wanted[:-1])) / rate
    # trapezoids of a motion of 50 rad/s at most: (50/200)^2/12 = 0.5 % of the swing
    np.testing.assert_allclose(w[1:] - w[0], change, atol=0.005 * np.ptp(w))


def test_effects_change_nothing_before_their_onset_and_something_after() -> None:
    clean = simulate(Scenario(AEROSONDE, manoeuvres=(SCHEDULE,), seed=2), 14.0)
    iced = simulate(
        Scenario(AEROSONDE, manoeuvres=(SCHEDULE,), seed=2, effects=(Icing(0.3, 6.0, 4.0),)), 14.0
    )
    before = clean.time_s <= 6.0
    np.testing.assert_array_equal(iced.values[before], clean.values[before])
    assert iced.column("throttle")[-1] > clean.column("throttle")[-1] + 0.05


def test_the_demonstration_is_three_aerosondes_as_announced() -> None:
    healthy, icing, elevator = demo_fleet()
    assert [s.name for s in (healthy, icing, elevator)] == ["healthy", "icing", "elevator"]
    assert healthy.effects == ()
    assert [(e.name, e.onset_s) for e in icing.effects] == [("icing", 60.0)]
    assert [(e.name, e.onset_s, e.size) for e in elevator.effects] == [("elevator_effectiveness", 90.0, 0.5)]
    assert len({s.seed for s in demo_fleet()}) == 3


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: FleetSimulation([]), "at least one"),
        (lambda: FleetSimulation(VARIED, rate_hz=0.0), "rate_hz is 0.0"),
        (lambda: FleetSimulation(VARIED[:1]).step(-1), "n_samples is -1"),
        (lambda: simulate(VARIED[0], 0.0), "seconds is 0.0"),
        (lambda: FleetSimulation(VARIED, refine=0), "refine is 0"),
        (lambda: Scenario(AEROSONDE, -3.0), "airspeed_true_m_s is -3.0"),
        (lambda: Scenario(AEROSONDE, altitude_m=math.nan), "altitude_m is nan"),
        (lambda: Scenario(AEROSONDE, turbulence="heavy"), "turbulence is 'heavy'"),  # type: ignore[arg-type]
        (lambda: Scenario(AEROSONDE, seed=-1), "seed is -1"),
        (lambda: Scenario(AEROSONDE, wind_m_s=(math.inf, 0.0, 0.0)), "wind_m_s"),
    ],
)
def test_bad_input_is_named(build: object, names: str) -> None:
    with pytest.raises(ValueError, match=names):
        build()  # type: ignore[operator]
