"""Delays, flight path, gusts, steady segments and the centre of gravity: injected into simulated flights, and found."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation import (
    CgShift,
    Effect,
    FleetSimulation,
    Route,
    Scenario,
    SensorDelay,
    SensorErrors,
    SensorPosition,
    Turbulence,
    Waypoint,
    doublet_schedule,
    gust_scales,
    multisine,
    patrol,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock
from wingwatch.telemetry.conditioning import (
    AirConfig,
    Parameter,
    PathConfig,
    SteadyLimits,
    align,
    centre_of_gravity,
    centre_shift,
    estimate_delays,
    imu_separation,
    reconstruct_path,
    steady_segments,
    turbulence_intensity,
)

Array = NDArray[np.float64]
AIRCRAFT = load_aircraft("aerosonde")
CRUISE = FlightCondition(25.0, 1000.0)
# whole numbers of samples: between samples the simulated delay is a straight line, which a real one is not
DELAYS_S = {
    "roll_rad": 0.02,
    "pitch_rad": 0.04,
    "heading_rad": 0.1,
    "angle_of_attack_rad": 0.06,
    "specific_force_z_m_s2": 0.02,
    "sideslip_rad": 0.04,
    "altitude_m": 0.2,
}


def flights(scenarios: Sequence[Scenario], seconds: float) -> list[SampleBlock]:
    return [SampleBlock(v) for v in FleetSimulation(scenarios).step(round(seconds * 50.0))]


@lru_cache
def delayed(turbulence: Turbulence, seeds: int) -> list[SampleBlock]:
    effects = tuple(SensorDelay(d, target=c) for c, d in DELAYS_S.items())
    doublets = (doublet_schedule(AIRCRAFT, CRUISE),)
    route = patrol(AIRCRAFT, CRUISE)
    return flights(
        [
            Scenario(
                AIRCRAFT, manoeuvres=doublets, effects=effects, turbulence=turbulence, seed=s, route=route
            )
            for s in range(seeds)
        ],
        100.0,
    )


def check(found: Sequence[Sequence[Parameter]], truth: dict[str, float], needless: float = 2.0) -> None:
    """Truth within three standard errors in every flight, and errors neither too small nor needlessly large.

    Of n flights the mean square of misses over stated errors is chi-square over n; one number in 1000 beyond.
    """
    for name, true in truth.items():
        misses = []
        for parameters in found:
            (parameter,) = [p for p in parameters if p.name == name]
            assert parameter.observable, parameter.text
            misses.append((parameter.value - true) / parameter.standard_error)
        n = len(misses)
        square = float(np.mean(np.square(misses)))
        assert np.max(np.abs(misses)) < 3.5, (name, misses)
        assert square < chi2.ppf(0.999, n) / n, (name, misses)
        assert square > chi2.ppf(0.001, n) / n / needless**2, (name, misses)


@pytest.mark.slow
def test_delays_are_found_within_their_errors() -> None:
    found = [estimate_delays(block) for block in delayed("none", 6)]
    check(found, {f"delay of {name}": d for name, d in DELAYS_S.items()}, needless=4.0)
    first = {p.name: p for p in found[0]}
    assert first["delay of roll_rad"].standard_error < 0.002
    assert first["delay of angle_of_attack_rad"].standard_error < 0.02


def test_rough_air_leaves_delays_of_vanes_unknown_and_those_of_attitude_known() -> None:
    found = {p.name: p for p in estimate_delays(delayed("light", 1)[0])}
    for name in ("roll_rad", "pitch_rad", "heading_rad"):
        parameter = found[f"delay of {name}"]
        assert abs(parameter.value - DELAYS_S[name]) < 3.5 * parameter.standard_error
    for name in ("angle_of_attack_rad", "specific_force_z_m_s2", "sideslip_rad"):
        parameter = found[f"delay of {name}"]
        assert not parameter.observable
        assert "rough air" in parameter.reason


def test_found_delays_align_the_flight() -> None:
    block = delayed("none", 6)[0]
    found = {p.name.removeprefix("delay of "): p for p in estimate_delays(block) if p.name[9:] in DELAYS_S}
    again = estimate_delays(align(block, {name: p.value for name, p in found.items()}))
    for parameter in again:
        before = found.get(parameter.name.removeprefix("delay of "))
        if before is not None:
            # the same noise, so nothing but what interpolation does to it is left
            assert abs(parameter.value) < 1.5 * before.standard_error


ERRORS = SensorErrors(
    bias={
        "roll_rate_rad_s": 0.01,
        "pitch_rate_rad_s": -0.008,
        "yaw_rate_rad_s": 0.006,
        "specific_force_x_m_s2": 0.15,
        "specific_force_y_m_s2": -0.1,
        "specific_force_z_m_s2": 0.2,
        "angle_of_attack_rad": 0.015,
        "sideslip_rad": -0.02,
    },
    scale={"airspeed_true_m_s": 0.04, "angle_of_attack_rad": 0.1, "sideslip_rad": -0.08},
)
INJECTED = {f"bias of {c}": v for c, v in ERRORS.bias.items()} | {
    f"scale of {c}": v for c, v in ERRORS.scale.items()
}


def patrolled(turbulence: Turbulence, seeds: int, seconds: float) -> list[SampleBlock]:
    doublets = (doublet_schedule(AIRCRAFT, CRUISE),)
    route = patrol(AIRCRAFT, CRUISE)
    return flights(
        [
            Scenario(
                AIRCRAFT,
                manoeuvres=doublets,
                sensor_errors=ERRORS,
                turbulence=turbulence,
                seed=s,
                route=route,
            )
            for s in range(seeds)
        ],
        seconds,
    )


@pytest.mark.slow
def test_sensor_errors_are_found_within_theirs() -> None:
    config = PathConfig(noise_std=AIRCRAFT.sensors.noise_std)
    paths = [reconstruct_path(block, config) for block in patrolled("none", 3, 90.0)]
    check([path.parameters for path in paths], INJECTED, needless=6.0)
    assert all(path.compatible for path in paths)
    assert ("scale of airspeed_true_m_s", "bias of airspeed_true_m_s") in paths[0].confounded
    assert np.isfinite(paths[0].states).all()


@pytest.mark.slow
def test_in_rough_air_inertial_biases_are_found_and_scales_are_not_claimed() -> None:
    gust = gust_scales("light", 1000.0).sigma_w_m_s
    config = PathConfig(noise_std=AIRCRAFT.sensors.noise_std, gust_std_m_s=(gust, gust, gust))
    paths = [reconstruct_path(block, config) for block in patrolled("light", 2, 60.0)]
    kept = {n: v for n, v in INJECTED.items() if "rate" in n or "specific_force" in n}
    check([path.parameters for path in paths], kept, needless=20.0)
    for name in ("scale of airspeed_true_m_s", "scale of angle_of_attack_rad", "scale of sideslip_rad"):
        (parameter,) = [p for p in paths[0].parameters if p.name == name]
        assert not parameter.observable
        assert "gusts" in parameter.reason


def test_straight_flight_does_not_tell_airspeed_scale_from_bias() -> None:
    (block,) = flights([Scenario(AIRCRAFT, seed=1)], 20.0)
    path = reconstruct_path(block, PathConfig(noise_std=AIRCRAFT.sensors.noise_std))
    parameters = {p.name: p for p in path.parameters}
    assert not parameters["scale of airspeed_true_m_s"].observable
    assert not parameters["bias of airspeed_true_m_s"].observable
    assert "flight alone" in parameters["scale of airspeed_true_m_s"].reason
    assert parameters["bias of pitch_rate_rad_s"].observable


def test_a_path_says_what_it_lacks() -> None:
    (block,) = flights([Scenario(AIRCRAFT)], 2.0)
    lame = block.values.copy()
    lame[:, CHANNEL_INDEX["altitude_m"]] = np.nan
    with pytest.raises(ValueError, match="no altitude_m"):
        reconstruct_path(SampleBlock(lame))
    with pytest.raises(ValueError, match="at least 64"):
        reconstruct_path(SampleBlock(block.values[:30]))
    with pytest.raises(ValueError, match="is not known"):
        PathConfig(prior_std={"bias of nothing": 1.0})


@pytest.mark.parametrize(
    ("turbulence", "altitude_m"), [("light", 1000.0), ("moderate", 1000.0), ("light", 100.0)]
)
def test_strength_of_gusts_within_its_error(turbulence: Turbulence, altitude_m: float) -> None:
    scales = gust_scales(turbulence, altitude_m)
    # across the path sideways the specification gives the same as along it
    lengths = AirConfig(vertical_length_m=scales.length_w_m, lateral_length_m=scales.length_u_m)
    doublets = (doublet_schedule(AIRCRAFT, CRUISE),)
    found = []
    for block in flights(
        [
            Scenario(AIRCRAFT, altitude_m=altitude_m, manoeuvres=doublets, turbulence=turbulence, seed=s)
            for s in range(5)
        ],
        100.0,
    ):
        air = turbulence_intensity(block, lengths)
        for parameter, truth in zip(air.sigma, (scales.sigma_w_m_s, scales.sigma_u_m_s), strict=True):
            assert not air.fit_for_estimating
            assert "not fit" in air.text
            assert parameter.observable
            assert parameter.standard_error < 0.05 * parameter.value
            found.append((parameter.value - float(truth)) / parameter.standard_error)
    n = len(found)
    assert np.max(np.abs(found)) < 3.5
    assert chi2.ppf(0.001, n) < np.sum(np.square(found)) < chi2.ppf(0.999, n)


def test_still_air_is_fit_and_has_no_gust() -> None:
    doublets = (doublet_schedule(AIRCRAFT, CRUISE),)
    for block in flights([Scenario(AIRCRAFT, manoeuvres=doublets, seed=s) for s in range(5)], 60.0):
        air = turbulence_intensity(block)
        assert air.fit_for_estimating
        assert not any(p.observable for p in air.sigma)
        assert "no vertical or lateral gust" in air.text
    blind = block.values.copy()
    blind[:, [CHANNEL_INDEX["angle_of_attack_rad"], CHANNEL_INDEX["sideslip_rad"]]] = np.nan
    with pytest.raises(ValueError, match="turbulence needs a vane"):
        turbulence_intensity(SampleBlock(blind))


def test_steady_segments_leave_out_turns_and_doublets_and_state_their_errors() -> None:
    legs = tuple(Waypoint(500.0 * (i + 1), 0.0, 1000.0, v) for i, v in enumerate((25.0, 22.0, 27.0)))
    (clean,) = flights([Scenario(AIRCRAFT, route=Route(legs, loops=False), noise=False)], 70.0)
    (noisy,) = flights([Scenario(AIRCRAFT, route=Route(legs, loops=False), seed=4)], 70.0)
    found = steady_segments(noisy)
    assert len(found) >= 3
    misses = []
    for segment in found:
        rows = (clean.time_s >= segment.start_s) & (clean.time_s <= segment.end_s)
        for name in ("angle_of_attack_rad", "elevator_rad", "pitch_rad"):
            truth = float(np.mean(clean.column(name)[rows]))
            misses.append((segment.mean[name] - truth) / segment.standard_error[name])
    # the stated error counts slow motion too, so misses are no more than of chance
    assert np.max(np.abs(misses)) < 4.0
    assert steady_segments(noisy, SteadyLimits(shortest_s=100.0)) == ()
    with pytest.raises(ValueError, match="positive number"):
        SteadyLimits(window_s=0.0)


FIRST, SECOND = (0.3, 0.0, 0.02), (-0.4, 0.05, -0.03)


@lru_cache
def two_units(shift_m: float, exciting: bool, seeds: int, seconds: float) -> list[tuple[SampleBlock, Array]]:
    """Flights with two triads of accelerometers: the same flight twice, and noise on all of it."""
    pair = []
    for place in (FIRST, SECOND):
        effects: tuple[Effect, ...] = tuple(
            SensorPosition(d, target=f"imu_{axis}") for axis, d in zip("xyz", place, strict=True) if d
        )
        effects += (CgShift(shift_m),) if shift_m else ()
        excited = (multisine(AIRCRAFT, math.radians(4.0), period_s=12.0),) if exciting else ()
        route = patrol(AIRCRAFT, CRUISE) if exciting else None
        scenarios = [
            Scenario(AIRCRAFT, manoeuvres=excited, effects=effects, noise=False, seed=s, route=route)
            for s in range(seeds)
        ]
        pair.append(FleetSimulation(scenarios).step(round(50.0 * seconds)))
    forces = [CHANNEL_INDEX[f"specific_force_{axis}_m_s2"] for axis in "xyz"]
    rng = np.random.default_rng(5)
    out = []
    for first, second in zip(*pair, strict=True):
        for name, std in AIRCRAFT.sensors.noise_std.items():
            first[:, CHANNEL_INDEX[name]] += std * rng.standard_normal(len(first))
        out.append((SampleBlock(first), second[:, forces] + 0.0245 * rng.standard_normal((len(second), 3))))
    return out


def test_place_of_a_second_triad() -> None:
    truth = np.subtract(SECOND, FIRST)
    # sampled at the instants at which surfaces are commanded, a servo of 8 Hz leaves images of up to |H(50 Hz)| f / 50
    # of the motion: 1 % at 3 Hz, by which rates of change and accelerations may differ
    image = 0.01 * float(np.linalg.norm(truth))
    for block, second in two_units(0.0, True, 3, 120.0):
        for parameter, true in zip(imu_separation(block, second), truth, strict=True):
            assert parameter.standard_error < 0.002
            assert abs(parameter.value - true) < 3.0 * parameter.standard_error + image


def test_place_of_a_second_triad_on_a_body_that_moves_smoothly() -> None:
    rng = np.random.default_rng(6)
    time_s, place = np.arange(6000) * 0.02, np.array([-0.7, 0.05, -0.05])
    tones = rng.uniform(0.3, 3.0, (3, 6)) * 2.0 * math.pi
    phases = rng.uniform(0.0, 2.0 * math.pi, (3, 6))
    rates = np.array(
        [
            np.sum(0.1 * np.sin(w[:, None] * time_s + f[:, None]), axis=0)
            for w, f in zip(tones, phases, strict=True)
        ]
    ).T
    spin = np.array(
        [
            np.sum(0.1 * w[:, None] * np.cos(w[:, None] * time_s + f[:, None]), axis=0)
            for w, f in zip(tones, phases, strict=True)
        ]
    ).T
    apart = np.cross(spin, place) + np.cross(rates, np.cross(rates, place))
    misses = []
    for _ in range(8):
        read = rates + 0.00227 * rng.standard_normal(rates.shape)
        first = 0.0245 * rng.standard_normal(rates.shape)
        second = apart + 0.2 + 0.0245 * rng.standard_normal(rates.shape)
        columns = dict(zip(("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"), read.T, strict=True))
        columns |= {f"specific_force_{a}_m_s2": f for a, f in zip("xyz", first.T, strict=True)}
        found = imu_separation(SampleBlock.from_columns({"time_s": time_s, **columns}), second)
        misses += [(p.value - t) / p.standard_error for p, t in zip(found, place, strict=True)]
    assert np.max(np.abs(misses)) < 3.5
    assert chi2.ppf(0.001, 24) / 4.0 < np.sum(np.square(misses)) < chi2.ppf(0.999, 24)


def test_centre_of_gravity_and_its_shift() -> None:
    places, shift_m = (FIRST, SECOND), 0.06
    shifts = []
    for (before, other), (after, late) in zip(
        two_units(0.0, True, 3, 120.0), two_units(shift_m, True, 3, 120.0), strict=True
    ):
        at_first, at_last = (
            centre_of_gravity(before, places, (other,)),
            centre_of_gravity(after, places, (late,)),
        )
        for found, true in ((at_first, (0.0, 0.0, 0.0)), (at_last, (-shift_m, 0.0, 0.0))):
            for parameter, place in zip(found, true, strict=True):
                assert abs(parameter.value - place) < 3.0 * parameter.standard_error
        shifts.append(centre_shift(at_first[0], at_last[0]))
        assert not centre_shift(at_first[1], at_last[1]).observable
    for shift in shifts:
        assert abs(shift.value + shift_m) < 3.0 * shift.standard_error
        assert shift.standard_error < 0.06


def test_straight_flight_tells_no_place() -> None:
    ((block, second),) = two_units(0.0, False, 1, 60.0)
    assert not any(p.observable for p in imu_separation(block, second))
    assert not any(p.observable for p in centre_of_gravity(block, (FIRST,)))
    with pytest.raises(ValueError, match="one place a triad"):
        centre_of_gravity(block, (FIRST, SECOND))
