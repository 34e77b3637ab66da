"""Signals against hand computation."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.aircraft import DUTCH_ROLL, LATERAL, SHORT_PERIOD, ModeStructure, load_aircraft
from wingwatch.estimators import InertiaCoupling, SignalConfig, Signals, inertia_coupling
from wingwatch.telemetry import CHANNEL_INDEX, MAX_GAP_S, SampleBlock

G = 9.80665


def block(n: int = 1, **columns: float) -> SampleBlock:
    base = {
        "airspeed_true_m_s": 25.0, "roll_rate_rad_s": 0.2, "pitch_rate_rad_s": 0.1, "yaw_rate_rad_s": -0.3,
        "specific_force_y_m_s2": 0.4, "specific_force_z_m_s2": -9.0, "roll_rad": 0.3, "pitch_rad": 0.1,
        "elevator_rad": 0.01, "aileron_rad": 0.02, "rudder_rad": 0.03, "angle_of_attack_rad": 0.05,
        "sideslip_rad": -0.02, "altitude_m": 1000.0, "air_density_kg_m3": 1.1,
    }  # fmt: skip
    table = {k: np.full(n, v) for k, v in (base | columns).items() if not math.isnan(v)}
    return SampleBlock.from_columns({"time_s": np.arange(n) / 50.0} | table)


def rows(structure: ModeStructure, samples: SampleBlock, **config: object) -> NDArray[np.float64]:
    signals = Signals(SignalConfig(structure, **config))  # type: ignore[arg-type]
    out: NDArray[np.float64] = signals.update(signals.init(1), samples.values[None])[0]
    return out


def rate_of_motion(state: str, w: float, v: float) -> float:
    """Rate of V sin(alpha) or V beta where the air-relative velocity at the c.g. changes by force, gravity and turning.

    By a central difference of the velocity vector: no kinematics of angles is used.
    """
    force, turn = np.array([0.3, 0.4, -9.0]), np.array([0.2, 0.1, -0.3])
    gravity = G * np.array([-math.sin(0.1), math.cos(0.1) * math.sin(0.3), math.cos(0.1) * math.cos(0.3)])
    sin_alpha, sin_beta = w / 25.0, v / 25.0
    cos_alpha, cos_beta = math.sqrt(1.0 - sin_alpha**2), math.sqrt(1.0 - sin_beta**2)
    velocity = 25.0 * np.array([cos_alpha * cos_beta, sin_beta, sin_alpha * cos_beta])
    rate = force + gravity - np.cross(turn, velocity)

    def seen(air: NDArray[np.float64]) -> float:
        speed = float(np.linalg.norm(air))
        return speed * (math.sin(math.atan2(air[2], air[0])) if state == "w" else math.asin(air[1] / speed))

    return (seen(velocity + 1e-4 * rate) - seen(velocity - 1e-4 * rate)) / 2e-4


def test_short_period_by_hand() -> None:
    row = rows(SHORT_PERIOD, block(specific_force_x_m_s2=0.3), vane_position_m=(0.4, 0.0, -0.1))[0]
    w, v = 25.0 * math.sin(0.05) + 0.1 * 0.4, 25.0 * math.sin(-0.02) + 0.3 * 0.4 - 0.2 * 0.1
    kinematic = rate_of_motion("w", w, v) + 9.0
    want = [0.0, w, 0.1, -9.0, 0.01, kinematic, 1.1 / 1.225, 25.0, 1.1, 1000.0, 0.05, 1.0, 0.0, 0.0]
    np.testing.assert_allclose(row, want, rtol=1e-9)


def test_lateral_by_hand() -> None:
    row = rows(LATERAL, block(specific_force_x_m_s2=0.3), vane_position_m=(0.4, 0.0, -0.1))[0]
    w, v = 25.0 * math.sin(0.05) + 0.1 * 0.4, 25.0 * math.sin(-0.02) + 0.3 * 0.4 - 0.2 * 0.1
    kinematic, still = rate_of_motion("v", w, v) - 0.4, [0.0, 0.0]
    states = [25.0 * math.asin(v / 25.0), 0.2, -0.3]
    condition = [kinematic, 1.1 / 1.225, 25.0, 1.1, 1000.0, 0.05, 1.0]
    np.testing.assert_allclose(row, [0.0, *states, 0.4, 0.02, 0.03, *condition, *still, *still], rtol=1e-9)


def test_what_is_not_measured_is_that_of_steady_flight() -> None:
    """Without sideslip, accelerometers across and along, and yaw rate, nothing acts by them."""
    unknown = dict.fromkeys(("sideslip_rad", "specific_force_y_m_s2", "yaw_rate_rad_s"), math.nan)
    row = rows(SHORT_PERIOD, block(1, **unknown))[0]
    plain = 25.0 * math.cos(0.05) * 0.1 + G * math.cos(0.1) * math.cos(0.3)
    assert np.isfinite(row).all()
    assert row[5] == pytest.approx(plain, rel=1e-12)


def test_a_row_says_how_far_a_command_is_ahead_of_its_surface() -> None:
    """Of a measured one; what is known by its command alone has no reading that could say when it moved."""
    ahead = SignalConfig(LATERAL).layout.ahead
    found = rows(LATERAL, block(aileron_command_rad=0.05))
    np.testing.assert_allclose(found[0, ahead:], np.array([0.03, 0.0]), rtol=1e-12)
    np.testing.assert_array_equal(rows(LATERAL, block(aileron_command_rad=math.nan))[0, ahead:], 0.0)
    alone = rows(LATERAL, block(50, aileron_rad=0.05, aileron_command_rad=0.05), servo_s=(0.02, 0.0))
    np.testing.assert_array_equal(alone[:, ahead:], 0.0)


def test_known_moments_are_those_of_the_whole_inertia_tensor() -> None:
    """-I^-1 (omega x I omega), and nothing where inertia is not stated or a rate that it needs is missing."""
    inertia = InertiaCoupling(0.8, 1.1, 1.7, 0.3)
    tensor = np.array([[0.8, 0.0, -0.3], [0.0, 1.1, 0.0], [-0.3, 0.0, 1.7]])
    turn = np.array([0.2, 0.1, -0.3])
    want = dict(zip("pqr", -np.linalg.solve(tensor, np.cross(turn, tensor @ turn)), strict=True))
    for structure in (SHORT_PERIOD, DUTCH_ROLL, LATERAL):
        config = SignalConfig(structure)
        layout, expected = config.layout, [want[s] for s in structure.states[1:]]
        row = rows(structure, block(), inertia=inertia)[0]
        np.testing.assert_allclose(row[layout.known_moments : layout.ahead], expected, rtol=1e-12)
        assert (rows(structure, block())[0, layout.known_moments : layout.ahead] == 0.0).all()
    missing = rows(SHORT_PERIOD, block(yaw_rate_rad_s=math.nan), inertia=inertia)[0]
    assert missing[SignalConfig(SHORT_PERIOD).layout.known_moments] == 0.0


def test_inertia_is_that_of_the_aircraft_file() -> None:
    mass = load_aircraft("aerosonde").mass
    inertia = inertia_coupling(load_aircraft("aerosonde"))
    assert mass is not None
    assert inertia == InertiaCoupling(
        mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2
    )


def test_density_from_altitude_and_temperature() -> None:
    """Standard atmosphere at 1000 m: 89 874.6 Pa, 281.65 K (US Standard Atmosphere 1976), so 1.1116 kg/m3."""
    standard = rows(SHORT_PERIOD, block(air_density_kg_m3=math.nan))[0]
    assert standard[8] == pytest.approx(1.1116, abs=1e-4)
    warm = rows(SHORT_PERIOD, block(air_density_kg_m3=math.nan, outside_air_temperature_k=300.0))[0]
    assert warm[8] == pytest.approx(89874.6 / (287.05287 * 300.0), rel=1e-5)


def test_a_command_becomes_the_surface_that_its_servo_moves() -> None:
    """From the first command on, towards the one before at any step, over a missing one; after a gap as commanded."""
    time_s = np.array([0.0, 0.02, 0.05, 0.06, 0.08, 0.08 + 2.0 * MAX_GAP_S])
    command = np.array([0.1, 0.3, np.nan, -0.2, -0.2, 0.5])
    samples = block(time_s.size)
    samples.values[:, 0] = time_s
    samples.values[:, CHANNEL_INDEX["elevator_rad"]] = command
    column = SignalConfig(SHORT_PERIOD).layout.first_input
    surface = rows(SHORT_PERIOD, samples, servo_s=(0.02,))[:, column]
    at_third = 0.3 + (0.1 - 0.3) * math.exp(-0.04 / 0.02)  # commanded 0.3 from 0.02 s to 0.06 s
    last = -0.2 + (at_third + 0.2) * math.exp(-1.0)
    np.testing.assert_allclose(surface, [0.1, 0.1, math.nan, at_third, last, 0.5], rtol=1e-12)
    np.testing.assert_array_equal(rows(SHORT_PERIOD, samples)[:, column], command)


def test_without_a_vane_the_velocity_is_integrated() -> None:
    """A constant rate c with a leak of time constant L gives c L (1 - exp(-t / L)), but for half a step of the leak."""
    samples = block(200, angle_of_attack_rad=math.nan, sideslip_rad=math.nan, roll_rate_rad_s=0.0)
    out = rows(SHORT_PERIOD, samples, reconstruction_s=20.0)
    rate = -9.0 + 25.0 * 0.1 + G * math.cos(0.1) * math.cos(0.3)
    time = samples.time_s
    want = rate * 20.0 * (1.0 - np.exp(-time / 20.0))
    np.testing.assert_allclose(out[:, 1], want, rtol=0.02 / 20.0, atol=0.0)
    assert (out[:, 11] == 0.0).all()


def test_without_a_vane_the_angle_of_attack_is_that_of_level_flight() -> None:
    """Level and without sideslip, sin(climb) = 0: tan(alpha) = tan(pitch) / cos(roll)."""
    row = rows(SHORT_PERIOD, block(angle_of_attack_rad=math.nan))[0]
    assert row[10] == pytest.approx(math.atan(math.tan(0.1) / math.cos(0.3)), rel=1e-12)


def test_what_goes_with_a_reconstructed_velocity_passes_its_filter() -> None:
    """A velocity whose rate is 3 q' - 2 eta' is 3 q - 2 eta behind the filter, whatever the leak, cuts and trim."""
    rng = np.random.default_rng(8)
    samples = block(
        1000, angle_of_attack_rad=math.nan, sideslip_rad=math.nan, roll_rate_rad_s=0.0, pitch_rad=0.0
    )
    samples.column("pitch_rate_rad_s")[:] = 0.2 + 0.01 * rng.standard_normal(1000).cumsum()
    samples.column("elevator_rad")[:] = -0.1 + 0.01 * rng.standard_normal(1000).cumsum()
    combined = 3.0 * samples.column("pitch_rate_rad_s") - 2.0 * samples.column("elevator_rad")
    kinematic = 25.0 * samples.column("pitch_rate_rad_s") + G * math.cos(0.3)
    # the trapezoid's sum of these rates is the combination itself
    rate = np.zeros(1000)
    for k in range(1, 1000):
        rate[k] = 2.0 * (combined[k] - combined[k - 1]) / 0.02 - rate[k - 1]
    samples.column("specific_force_z_m_s2")[:] = rate - kinematic
    config = SignalConfig(SHORT_PERIOD, reconstruction_s=5.0)
    signals = Signals(config)
    state, whole = signals.init(1), []
    for piece in np.split(samples.values, [1, 7, 400]):
        raw = signals.update(state, piece[None])
        whole.append(signals.high_passed(state, raw)[0])
    out = np.concatenate(whole)
    np.testing.assert_allclose(out[:, 1], 3.0 * out[:, 2] - 2.0 * out[:, 4], atol=1e-9)
    assert np.ptp(out[:, 1]) > 0.5


def test_known_moments_pass_the_filter_of_a_reconstructed_velocity() -> None:
    """With p and r constant the pitch moment I_z - I_x over I_y times p r is too, and decays as any constant does."""
    samples = block(500, angle_of_attack_rad=math.nan, sideslip_rad=math.nan)
    samples.column("yaw_rate_rad_s")[0] = 0.0
    signals = Signals(
        SignalConfig(SHORT_PERIOD, reconstruction_s=5.0, inertia=InertiaCoupling(1.0, 1.0, 2.0))
    )
    state = signals.init(1)
    raw = signals.update(state, samples.values[None])
    moment = signals.config.layout.known_moments
    passed = signals.high_passed(state, raw)[0, :, moment]
    np.testing.assert_allclose(raw[0, 1:, moment], 0.2 * -0.3, rtol=1e-12)
    np.testing.assert_allclose(passed[1:], 0.2 * -0.3 * np.exp(-(samples.time_s[1:] - 0.02) / 5.0), rtol=1e-9)


def test_with_a_vane_nothing_is_filtered() -> None:
    signals = Signals(SignalConfig(SHORT_PERIOD))
    state = signals.init(1)
    raw = signals.update(state, block(50).values[None])
    np.testing.assert_array_equal(signals.high_passed(state, raw), raw)


def test_a_vane_that_falls_silent_is_not_replaced() -> None:
    samples = block(100)
    samples.column("angle_of_attack_rad")[40:60] = np.nan
    out = rows(SHORT_PERIOD, samples)
    assert np.isnan(out[40:60, 1]).all()
    assert np.isfinite(out[:40, 1]).all()
    assert np.isfinite(out[60:, 1]).all()
    assert (out[40:60, 11] == 0.0).all()


def test_a_gap_starts_the_reconstruction_anew() -> None:
    samples = block(100, sideslip_rad=math.nan)
    samples.time_s[50:] += MAX_GAP_S + 1.0
    out = rows(DUTCH_ROLL, samples)
    assert abs(out[49, 1]) > 0.0
    assert out[50, 1] == 0.0


def test_airspeed_noise_is_smoothed_away_in_still_air() -> None:
    """After 20 s a fifth of a metre per second is left as less than a tenth of that."""
    samples = block(1500, sideslip_rad=0.0)
    samples.column("airspeed_true_m_s")[:] += 0.2 * np.random.default_rng(6).standard_normal(1500)
    out = rows(SHORT_PERIOD, samples)
    assert np.std(out[1000:, 7]) < 0.02


def test_airspeed_follows_what_the_accelerometer_says_without_lag() -> None:
    """Along the path 0.5 m/s2 for 20 s: the smoothed airspeed stays within a tenth of the true one."""
    alpha, pitch, bank, az = 0.05, 0.1, 0.3, -9.0
    gravity = G * (math.cos(pitch) * math.cos(bank) * math.sin(alpha) - math.sin(pitch) * math.cos(alpha))
    steady = -(az * math.sin(alpha) + gravity) / math.cos(alpha)
    samples = block(1500, specific_force_x_m_s2=steady, sideslip_rad=0.0)
    time = samples.time_s
    speed = 25.0 + 0.5 * np.clip(time - 10.0, 0.0, None)
    samples.column("airspeed_true_m_s")[:] = speed + 0.2 * np.random.default_rng(7).standard_normal(1500)
    before = rows(SHORT_PERIOD, samples)
    samples.column("specific_force_x_m_s2")[time >= 10.0] += 0.5 / math.cos(alpha)
    after = rows(SHORT_PERIOD, samples)
    assert np.abs(after[600:, 7] - speed[600:]).max() < 0.1
    assert np.abs(before[600:, 7] - speed[600:]).max() > 0.1, "the accelerometer must matter here"


@pytest.mark.parametrize("shape", [(10, 30), (1, 10, 7)])
def test_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    signals = Signals(SignalConfig(SHORT_PERIOD))
    with pytest.raises(ValueError, match="values have shape"):
        signals.update(signals.init(1), np.zeros(shape))


def moving(n: int = 500) -> SampleBlock:
    """Ten seconds in which every sensor of both axes moves in every sample."""
    angles = np.outer(np.arange(n) / 50.0, [1.0, 1.3, 0.7, 1.9, 2.3, 0.9, 1.1])
    names = (
        "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_y_m_s2", "specific_force_z_m_s2",
        "angle_of_attack_rad", "sideslip_rad",
    )  # fmt: skip
    found = block(n)
    for name, values in zip(names, 0.1 * np.sin(angles).T, strict=True):
        found.values[:, CHANNEL_INDEX[name]] = values
    return found


@pytest.mark.parametrize("column", range(4), ids=("sideslip", "roll rate", "yaw rate", "accelerometer"))
def test_a_stuck_sensor_is_left_out_until_it_moves(column: int) -> None:
    """From two seconds after its last movement to its next one, however the samples were cut; the others stay."""
    signals, flight = Signals(SignalConfig(LATERAL)), moving()
    channel = CHANNEL_INDEX[signals.sensors[column]]
    flight.values[100:400, channel] = flight.values[99, channel]
    state = signals.init(1)
    whole = signals.update(state, flight.values[None])[0]
    assert np.flatnonzero(np.isnan(whole[:, 1 + column])).tolist() == list(range(200, 400))
    others = [c for c in range(whole.shape[1]) if c != 1 + column]
    assert np.isfinite(whole[:, others]).all()
    assert signals.stuck(state) == ()
    assert signals.stuck_rows(state) == {signals.sensors[column]: 200}
    parts, pieces = (
        signals.init(1),
        (flight.values[None, :37], flight.values[None, 37:251], flight.values[None, 251:]),
    )
    for piece, stuck in zip(pieces, ((), (signals.sensors[column],), ()), strict=True):
        out = signals.update(parts, piece)[0]
        np.testing.assert_array_equal(out, whole[: len(out)])
        whole = whole[len(out) :]
        assert signals.stuck(parts) == stuck


def test_what_rests_together_is_not_stuck() -> None:
    """Without noise a flight that has not begun to move in an axis rests bit by bit."""
    flight = moving()
    for name in ("roll_rate_rad_s", "yaw_rate_rad_s", "specific_force_y_m_s2", "sideslip_rad"):
        flight.values[:400, CHANNEL_INDEX[name]] = 0.0
    assert np.isfinite(rows(LATERAL, flight)).all()
    # The sideslip answers a sample after the others have begun.
    flight.values[400, CHANNEL_INDEX["sideslip_rad"]] = 0.0
    assert np.isfinite(rows(LATERAL, flight)).all()


def test_a_slow_sensor_is_not_stuck() -> None:
    """Read once a second, its reading stands for fifty samples."""
    flight = moving()
    channel = CHANNEL_INDEX["sideslip_rad"]
    flight.values[:, channel] = flight.values[:, channel][np.arange(500) // 50 * 50]
    assert np.isfinite(rows(LATERAL, flight)).all()


def test_a_gap_begins_anew() -> None:
    """What a sensor did in a gap nobody knows: two seconds count from its end."""
    flight = moving()
    channel = CHANNEL_INDEX["sideslip_rad"]
    flight.values[100:, channel] = flight.values[99, channel]
    flight.values[250:, 0] += 10.0
    left_out = np.flatnonzero(np.isnan(rows(LATERAL, flight)[:, 1]))
    assert left_out.tolist() == [*range(200, 250), *range(351, 500)]


def led(lead_m: float, noise: float = 0.0) -> tuple[SampleBlock, NDArray[np.float64]]:
    """A flight with a vane ahead of the c.g. through a gust; what a vane at the c.g. would have read, (samples,)."""
    n, speed = 1000, 25.0
    t = np.arange(n) / 50.0
    motion = 0.8 * np.sin(2.0 * t)
    noisy = noise * np.random.default_rng(2).standard_normal(n)

    def gust(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(0.5 * np.sin(3.0 * at) + 0.3 * np.sin(7.0 * at + 1.0))

    still = dict.fromkeys(
        ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "roll_rad", "pitch_rad"), 0.0
    )
    samples = block(n, **still)
    samples.values[:, CHANNEL_INDEX["angle_of_attack_rad"]] = np.arcsin(
        (motion - gust(t + lead_m / speed) + noisy) / speed
    )
    samples.values[:, CHANNEL_INDEX["specific_force_z_m_s2"]] = 1.6 * np.cos(2.0 * t) - G
    return samples, motion - gust(t)


@pytest.mark.parametrize("lead_m", [0.1, 0.3, 0.6, 2.0, 8.0])
def test_a_vane_ahead_meets_the_air_as_the_centre_of_gravity_does(lead_m: float) -> None:
    samples, want = led(lead_m)
    found = rows(SHORT_PERIOD, samples, vane_position_m=(lead_m, 0.0, 0.0), vane_leads=True)[:, 1]
    np.testing.assert_allclose(found[50:], want[50:], atol=2e-3)
    early = rows(SHORT_PERIOD, samples, vane_position_m=(lead_m, 0.0, 0.0))[:, 1]
    assert np.abs(early - want)[50:].max() > 4e-3


def test_the_delay_of_a_vane_keeps_its_noise_white() -> None:
    place = {"vane_position_m": (0.3, 0.0, 0.0), "vane_leads": True}
    clean, noisy = (rows(SHORT_PERIOD, led(0.3, noise)[0], **place)[:, 1] for noise in (0.0, 0.05))
    noise = (noisy - clean)[50:]
    assert noise.std() == pytest.approx(0.05, rel=4.0 / math.sqrt(2.0 * noise.size))
    for lag in (1, 2, 3):
        assert abs(np.corrcoef(noise[lag:], noise[:-lag])[0, 1]) < 4.0 / math.sqrt(noise.size)


def test_a_delayed_vane_is_the_same_in_pieces_and_begins_anew_after_a_gap() -> None:
    samples, _ = led(0.6)
    signals = Signals(SignalConfig(SHORT_PERIOD, vane_position_m=(0.6, 0.0, 0.0), vane_leads=True))
    whole = signals.update(signals.init(1), samples.values[None])
    state = signals.init(1)
    pieces = [signals.update(state, samples.values[None, at : at + 7]) for at in range(0, 1000, 7)]
    np.testing.assert_array_equal(np.concatenate(pieces, axis=1), whole)
    late = samples.values.copy()
    late[500:, CHANNEL_INDEX["time_s"]] += 2.0 * MAX_GAP_S
    after = signals.update(signals.init(1), late[None])[0, :, 1]
    assert after[500] == pytest.approx(25.0 * math.sin(samples.column("angle_of_attack_rad")[500]), rel=1e-12)
    np.testing.assert_allclose(after[550:], whole[0, 550:, 1], atol=1e-4)


def test_a_vane_is_not_delayed_where_the_motion_of_the_aircraft_is_not_measured() -> None:
    samples, _ = led(0.6)
    samples.values[:, CHANNEL_INDEX["specific_force_z_m_s2"]] = math.nan
    place = {"vane_position_m": (0.6, 0.0, 0.0)}
    found, raw = (rows(SHORT_PERIOD, samples, **place, vane_leads=leads)[:, 1] for leads in (True, False))
    np.testing.assert_array_equal(found, raw)


def test_a_vane_that_fails_for_a_moment_keeps_its_delay() -> None:
    samples, want = led(0.6)
    samples.values[400:410, CHANNEL_INDEX["angle_of_attack_rad"]] = math.nan
    found = rows(SHORT_PERIOD, samples, vane_position_m=(0.6, 0.0, 0.0), vane_leads=True)[:, 1]
    assert np.isnan(found[400:410]).all()
    np.testing.assert_allclose(found[420:], want[420:], atol=2e-3)
