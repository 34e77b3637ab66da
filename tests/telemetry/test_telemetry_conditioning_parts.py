"""Positions, alignment, running trim, servo delay: against their definitions."""

import math

import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wingwatch.aircraft import DUTCH_ROLL, SHORT_PERIOD, load_aircraft
from wingwatch.estimators import SignalConfig, Signals
from wingwatch.simulation import Scenario, SensorPosition, multisine, simulate
from wingwatch.telemetry import SampleBlock
from wingwatch.telemetry.conditioning import (
    align,
    at_centre,
    estimate_servo_delay,
    flow_at_centre,
    forces_at_centre,
    lever_matrix,
    running_trim,
    without_trim,
)
from wingwatch.telemetry.conditioning.gust_spectrum import Whittle, dryden_across
from wingwatch.telemetry.conditioning.windows import even_window, runs, slopes

Array = NDArray[np.float64]
AIRCRAFT = load_aircraft("aerosonde")
PLACE = (0.4, 0.1, -0.05)


def flown(*effects: SensorPosition) -> SampleBlock:
    exciting = (multisine(AIRCRAFT, period_s=12.0),)
    return simulate(Scenario(AIRCRAFT, manoeuvres=exciting, effects=effects, noise=False), 30.0)


def moved(sensor: str) -> tuple[SensorPosition, ...]:
    return tuple(SensorPosition(d, target=f"{sensor}_{axis}") for axis, d in zip("xyz", PLACE, strict=True))


def test_vanes_carried_to_the_centre_read_what_vanes_there_read() -> None:
    there, centre = flown(*moved("vane")), flown()
    back = at_centre(there, PLACE, (0.0, 0.0, 0.0))
    for name in ("angle_of_attack_rad", "sideslip_rad"):
        assert np.max(np.abs(there.column(name) - centre.column(name))) > 1e-3
        assert np.max(np.abs(back.column(name) - centre.column(name))) < 1e-12


def test_accelerometers_carried_to_the_centre() -> None:
    there, centre = flown(*moved("imu")), flown()
    back = at_centre(there, (0.0, 0.0, 0.0), PLACE)
    for name in ("specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2"):
        off = np.std(there.column(name) - centre.column(name))
        left = np.std(back.column(name) - centre.column(name))
        # slopes of sampled rates lose what is quicker than a tenth of the sample rate: steps of the surfaces
        assert left < 0.2 * off


def test_the_first_order_correction_of_the_signals_agrees_to_second_order() -> None:
    block = flown(*moved("vane"))
    place = (PLACE[0], 0.0, PLACE[2])
    rates = np.stack([block.column(f"{n}_rate_rad_s") for n in ("roll", "pitch", "yaw")], axis=1)
    airspeed = block.column("airspeed_true_m_s")
    alpha, beta = flow_at_centre(
        airspeed, block.column("angle_of_attack_rad"), block.column("sideslip_rad"), rates, place
    )
    swing = np.linalg.norm(np.cross(rates, np.asarray(place)), axis=1)
    angles = np.hypot(np.abs(alpha) + swing / airspeed, np.abs(beta) + swing / airspeed)
    for structure, exact in (
        (SHORT_PERIOD, airspeed * np.sin(alpha) * np.cos(beta)),
        (DUTCH_ROLL, airspeed * np.sin(beta)),
    ):
        signals = Signals(SignalConfig(structure, vane_position_m=place))
        read = signals.update(signals.init(1), block.values[None])[0, :, 1]
        # left out: swing^2 / V, the swing's turn by the flow's angles, and V sin(alpha) (1 - cos(beta))
        bound = swing**2 / airspeed + 2.0 * swing * angles + 0.5 * airspeed * np.abs(alpha) * beta**2
        assert np.all(np.abs(read - exact) <= 1.01 * bound + 1e-12)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_lever_matrix_is_the_double_cross_product(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rates, spin, place = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=3)
    expected = np.cross(spin, place) + np.cross(rates, np.cross(rates, place))
    assert np.allclose(lever_matrix(rates, spin) @ place, expected, rtol=1e-12, atol=1e-12)
    forces = rng.normal(size=(5, 3))
    centre = forces_at_centre(forces + expected, rates, spin, (place[0], place[1], place[2]))
    assert np.allclose(centre, forces, rtol=1e-11, atol=1e-11)


def test_slopes_are_exact_for_quartics_and_as_noisy_as_stated() -> None:
    rng = np.random.default_rng(1)
    time_s: Array = np.sort(rng.uniform(0.0, 4.0, 80))
    curve = 1.0 - time_s + 0.5 * time_s**3 - 0.2 * time_s**4
    assert np.allclose(
        slopes(time_s, np.asarray(curve, dtype=np.float64), 5.0),
        -1.0 + 1.5 * time_s**2 - 0.8 * time_s**3,
        atol=1e-6,
    )
    even = np.arange(20000, dtype=np.float64) * 0.02
    noisy = slopes(even, rng.normal(size=even.size))
    # of 20000 values that go together over 7, 2800 independent: 1.3 % one sigma of a standard deviation
    assert np.std(noisy) == pytest.approx(0.511 / 0.02, rel=0.05)


def test_runs_end_at_gaps_and_even_window_takes_the_longest() -> None:
    time_s = np.concatenate(
        [np.arange(70, dtype=np.float64) * 0.02, 3.0 + np.arange(100, dtype=np.float64) * 0.02]
    )
    assert runs(time_s) == [slice(0, 70), slice(70, 170)]
    block = SampleBlock.from_columns({"time_s": time_s, "pitch_rad": time_s**2})
    even, columns = even_window(block, ["pitch_rad"])
    assert even[0] == 3.0
    assert even.size == 100
    assert np.array_equal(columns["pitch_rad"], time_s[70:] ** 2)
    with pytest.raises(ValueError, match="no roll_rad"):
        even_window(block, ["roll_rad"])
    with pytest.raises(ValueError, match="at least 64"):
        even_window(SampleBlock(block.values[:50]), ["pitch_rad"])


def test_aligned_channels_take_the_value_they_show_later() -> None:
    time_s = np.arange(400, dtype=np.float64) * 0.02
    heading = np.angle(np.exp(1j * (3.0 + 0.4 * time_s)))
    late = np.angle(np.exp(1j * (3.0 + 0.4 * (time_s - 0.07))))
    block = SampleBlock.from_columns({"time_s": time_s, "heading_rad": late, "pitch_rad": time_s - 0.03})
    aligned = align(block, {"heading_rad": 0.07, "pitch_rad": 0.03})
    inside = slice(0, 396)
    gap = np.angle(np.exp(1j * (aligned.column("heading_rad") - heading)))
    assert np.max(np.abs(gap[inside])) < 1e-9
    assert np.allclose(aligned.column("pitch_rad")[inside], time_s[inside], atol=1e-9)
    assert np.isnan(aligned.column("pitch_rad")[-1])
    with pytest.raises(ValueError, match="cannot be aligned"):
        align(block, {"time_s": 0.1})
    with pytest.raises(ValueError, match="finite number of seconds"):
        align(block, {"pitch_rad": math.inf})


@given(st.floats(-5.0, 5.0), st.floats(-1.0, 1.0), st.floats(0.02, 0.5))
@settings(max_examples=20, deadline=None)
def test_constants_and_straight_drifts_are_wholly_trim(level: float, drift: float, corner_hz: float) -> None:
    time_s = np.arange(1500, dtype=np.float64) * 0.02
    line = level + drift * time_s
    assert np.allclose(running_trim(time_s, line, corner_hz), line, atol=1e-9)


def test_the_running_trim_halves_the_power_at_its_corner_and_starts_anew_after_a_gap() -> None:
    time_s = np.arange(10000, dtype=np.float64) * 0.02
    inside = slice(2500, 7500)
    for frequency, gain in ((0.1, math.sqrt(0.5)), (0.3, math.sqrt(0.5) ** 9)):
        tone = np.sin(2.0 * math.pi * frequency * time_s)
        slow = running_trim(time_s, tone, 0.1)
        # the kernel is cut where 6e-5 of it are left out
        assert np.max(np.abs(slow - gain * tone)[inside]) < 2e-4
    step = np.where(time_s < 100.0, 0.0, 1.0)
    after_gap = np.where(time_s < 100.0, time_s, time_s + 5.0)
    assert np.allclose(running_trim(after_gap, step, 0.1), step, atol=1e-9)
    with pytest.raises(ValueError, match="positive number of Hz"):
        running_trim(time_s, step, 0.0)


def test_what_is_left_obeys_the_same_linear_equation_while_the_condition_changes() -> None:
    rng = np.random.default_rng(2)
    time_s = np.arange(6000, dtype=np.float64) * 0.02
    surface = np.repeat(rng.normal(size=120), 50) * 0.03
    steady = 0.05 - 0.0005 * time_s
    response = 7.0 * surface + steady
    surface[40] = np.nan
    block = SampleBlock.from_columns(
        {"time_s": time_s, "elevator_rad": surface, "pitch_rate_rad_s": response}
    )
    split = without_trim(block, ["elevator_rad", "pitch_rate_rad_s"], 0.1)
    whole = split.trim.column("pitch_rate_rad_s") + split.perturbation.column("pitch_rate_rad_s")
    assert np.allclose(whole, response, atol=1e-12)
    far = slice(500, None)
    x = split.perturbation.column("elevator_rad")[far]
    y = split.perturbation.column("pitch_rate_rad_s")[far]
    assert np.allclose(y, 7.0 * x, atol=1e-9)
    assert np.isnan(split.perturbation.column("elevator_rad")[40])


def servo_flight(delay_s: float, constant_s: float, seed: int) -> SampleBlock:
    """A servo solved on a grid 40 times finer than the samples, with noise."""
    rng = np.random.default_rng(seed)
    fine, n = 40, 3000
    command = np.repeat(rng.normal(size=n // 10) * 0.03, 10)
    asked = np.roll(np.repeat(command, fine), round(delay_s * 50.0 * fine))
    stays = math.exp(-0.02 / fine / constant_s)
    position = np.empty(n * fine)
    at = command[0]
    for k, wanted in enumerate(asked.tolist()):
        position[k] = at
        at = wanted - (wanted - at) * stays
    read = position[::fine] + 0.00087 * rng.normal(size=n)
    return SampleBlock.from_columns(
        {"time_s": np.arange(n) * 0.02, "elevator_rad": 0.01 + read, "elevator_command_rad": command}
    )


@pytest.mark.parametrize("delay_s", [0.033, 0.0605, 0.04])
def test_delay_and_time_constant_of_a_servo(delay_s: float) -> None:
    misses = []
    for seed in range(6):
        block = servo_flight(delay_s, 0.05, seed)
        for constant in (None, 0.05):
            found = estimate_servo_delay(block, "elevator", constant)
            for parameter, truth in zip(found, (delay_s, 0.05), strict=False):
                assert parameter.observable
                assert parameter.standard_error < 2e-3  # a tenth of a sample
                misses.append((parameter.value - truth) / parameter.standard_error)
    assert np.max(np.abs(misses)) < 4.0  # 18 numbers a delay: beyond four standard errors once in 900 runs


def test_a_servo_that_is_not_moved_tells_nothing() -> None:
    rng = np.random.default_rng(3)
    quiet = SampleBlock.from_columns(
        {
            "time_s": np.arange(1000, dtype=np.float64) * 0.02,
            "rudder_rad": 0.001 * rng.normal(size=1000),
            "rudder_command_rad": 1e-9 * rng.normal(size=1000),
        }
    )
    assert not estimate_servo_delay(quiet, "rudder")[0].observable
    with pytest.raises(ValueError, match="give elevator, aileron or rudder"):
        estimate_servo_delay(quiet, "flap")


@pytest.mark.parametrize("seed", range(6))
def test_levels_of_a_periodogram_are_as_likely_as_a_general_optimiser_finds_them(seed: int) -> None:
    """Exponential powers about w^2 s^2 G + w^2 R + A, with a gust or without; the other is scipy's L-BFGS-B."""
    rng = np.random.default_rng(seed)
    omega = 2.0 * math.pi * np.linspace(0.1, 12.0, 350)
    shapes = np.array([omega**2 * dryden_across(omega, 20.0), omega**2, np.ones_like(omega)])
    levels = np.array([[0.0, 0.01, 2.0][seed % 3], 1e-4, 1e-3])
    power = levels @ shapes * rng.exponential(size=omega.size)

    def cost(x: Array) -> float:
        model = np.exp(x) @ shapes
        off = (x[2] - math.log(levels[2])) / 0.2
        return float(np.sum(np.log(model) + power / model) + 0.5 * off**2)

    x, likelihood = Whittle(power, shapes, float(levels[2]), 0.2, 1.0).best(gusts=True)
    start = np.log(np.maximum(levels, 1e-6))
    peer = scipy.optimize.minimize(cost, start, method="L-BFGS-B", bounds=[(-40.0, 20.0)] * 3)
    assert likelihood == pytest.approx(-cost(x), abs=1e-9)
    assert likelihood > -float(peer.fun) - 1e-3
    seen = 0 if levels[0] > 1.0 else 1  # the vane's noise does not show beside a strong gust
    assert x[seen] == pytest.approx(math.log(levels[seen]), abs=0.5)
