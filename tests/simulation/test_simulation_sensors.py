"""Sensors: each error against its definition, on tables made here; alike in any company and however cut."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from wingwatch.aircraft import load_aircraft
from wingwatch.aircraft.aircraft_file import SecondOrderLag
from wingwatch.simulation import Effect, FleetSimulation, Scenario, SensorErrors, simulate
from wingwatch.simulation.effects import (
    AirspeedError,
    SensorBias,
    SensorDelay,
    SensorFault,
    SensorFreeze,
    SensorScale,
    VaneUpwash,
)
from wingwatch.simulation.sensor_errors import NAVIGATION, READINGS, SIMULATED
from wingwatch.simulation.sensors import Sensors
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, Cleaner, SampleBlock

AEROSONDE = load_aircraft("aerosonde")
RATE_HZ = 50.0
STEP_S = 1.0 / RATE_HZ
DEVIATIONS = 4.5
"""Bound of a statistic in standard deviations: one such test in 150,000 fails by chance, were the seed not fixed."""
Q, ALPHA, HEADING, SPEED = "pitch_rate_rad_s", "angle_of_attack_rad", "heading_rad", "airspeed_true_m_s"


def scenario(
    stated: Mapping[str, object] | None = None,
    effects: tuple[Effect, ...] = (),
    seed: int = 0,
    **errors: Any,
) -> Scenario:
    """An aircraft whose sensors have nothing but what is stated."""
    sensors = AEROSONDE.sensors.model_copy(update={"noise_std": {}} | dict(stated or {}))
    aircraft = AEROSONDE.model_copy(update={"sensors": sensors})
    return Scenario(aircraft, effects=effects, seed=seed, sensor_errors=SensorErrors(**errors))


def table(n: int, columns: Mapping[str, NDArray[np.float64]] | None = None) -> NDArray[np.float64]:
    """A true flight: zero where not given, one vehicle."""
    values = np.full((1, n, len(CHANNELS)), np.nan)
    for name in SIMULATED:
        values[0, :, CHANNEL_INDEX[name]] = (columns or {}).get(name, 0.0)
    values[0, :, 0] = np.arange(n) / RATE_HZ
    return values


def read(
    scenarios: Sequence[Scenario], values: NDArray[np.float64], pieces: Sequence[int] = ()
) -> NDArray[np.float64]:
    """Readings of a table in one piece or in several; the rest of it as one."""
    out = np.repeat(values, len(scenarios), axis=0) if len(values) == 1 else values.copy()
    sensors = Sensors(scenarios, [np.random.default_rng(s.seed) for s in scenarios], RATE_HZ)
    cuts = np.cumsum(pieces).astype(int).tolist()
    for first, last in zip([0, *cuts], [*cuts, values.shape[1]], strict=True):
        piece = np.ascontiguousarray(out[:, first:last])
        sensors.read(piece)
        out[:, first:last] = piece
    return out


def reading(one: Scenario, name: str, truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """What one column shows of its truth."""
    return np.asarray(read([one], table(len(truth), {name: truth}))[0, :, CHANNEL_INDEX[name]])


def turned(angle: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    return np.asarray(np.angle(np.exp(1j * angle)))


LAG_S, SECOND = 0.08, SecondOrderLag(natural_frequency_hz=3.0, damping_ratio=0.6)
LAGS: dict[str, dict[str, object]] = {
    "first": {"lag_s": {Q: LAG_S}},
    "second": {"second_order": {Q: SECOND}},
    "both": {"lag_s": {Q: LAG_S}, "second_order": {Q: SECOND}},
}


def transfer(kind: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Numerator and denominator in s."""
    w, damping = 2.0 * math.pi * SECOND.natural_frequency_hz, SECOND.damping_ratio
    second = np.array([1.0 / w**2, 2.0 * damping / w, 1.0])
    first = np.array([LAG_S, 1.0])
    bottom = {"first": first, "second": second, "both": np.polymul(first, second)}[kind]
    return np.array([1.0]), bottom


def test_true_sensors_change_nothing() -> None:
    rng = np.random.default_rng(0)
    values = table(100, {name: rng.standard_normal(100) for name in READINGS})
    np.testing.assert_array_equal(read([scenario()], values), values)


@pytest.mark.parametrize("kind", LAGS)
def test_a_lag_is_exact_for_an_input_linear_between_samples(kind: str) -> None:
    truth = np.concatenate([[0.0], np.random.default_rng(1).standard_normal(400)])
    t = np.arange(truth.size) * STEP_S
    _, wanted, _ = signal.lsim(transfer(kind), truth, t, interp=True)
    np.testing.assert_allclose(reading(scenario(LAGS[kind]), Q, truth), wanted, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("kind", LAGS)
@pytest.mark.parametrize("frequency_hz", [0.5, 2.0, 5.0])
def test_a_lag_has_its_frequency_response(kind: str, frequency_hz: float) -> None:
    t, w = np.arange(600) * STEP_S, 2.0 * math.pi * frequency_hz
    seen = reading(scenario(LAGS[kind]), Q, np.sin(w * t))
    _, response = signal.freqs(*transfer(kind), [w])
    wanted = np.imag(response[0] * np.exp(1j * w * t))
    # a straight line between samples misses a sine by (w h)^2 / 8 at most; a lag whose impulse response has the
    # absolute integral A hands on A times that: 1 of a first-order lag, (1 + e) / (1 - e) of an oscillating one
    e = math.exp(-math.pi * SECOND.damping_ratio / math.sqrt(1.0 - SECOND.damping_ratio**2))
    gain = 1.0 if kind == "first" else (1.0 + e) / (1.0 - e)
    settled = t > 4.0  # 45 time constants: the start is forgotten to the last digit
    assert np.abs(seen - wanted)[settled].max() < gain * (w * STEP_S) ** 2 / 8.0
    assert np.abs(np.sin(w * t) - wanted)[settled].max() > 0.1


@pytest.mark.parametrize("kind", LAGS)
def test_a_lag_starts_in_its_steady_state(kind: str) -> None:
    np.testing.assert_allclose(reading(scenario(LAGS[kind]), Q, np.full(200, 0.3)), 0.3, rtol=1e-13)


def test_a_delay_of_whole_samples_is_exact_and_one_between_is_linear() -> None:
    truth = np.random.default_rng(2).standard_normal(700)
    late = reading(scenario({"delay_s": {Q: 3 * STEP_S}}), Q, truth)
    np.testing.assert_array_equal(late, np.concatenate([np.full(3, truth[0]), truth[:-3]]))
    between = reading(scenario({"delay_s": {Q: 0.05}}), Q, truth)
    t = np.arange(700) * STEP_S
    np.testing.assert_allclose(between, np.interp(t - 0.05, t, truth), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("delay_s", [0.02, 0.037, 0.25])
def test_a_delayed_sine_is_that_much_later(delay_s: float) -> None:
    t, w = np.arange(600) * STEP_S, 2.0 * math.pi * 1.5
    late = reading(scenario({"delay_s": {Q: delay_s}}), Q, np.sin(w * t))
    error = np.abs(late - np.sin(w * (t - delay_s)))[t >= delay_s + STEP_S]
    assert error.max() < max((w * STEP_S) ** 2 / 8.0, 1e-12)
    # and by no other delay: of those a quarter sample apart, the one of the greatest correlation is next to it
    lags_s = np.arange(60) * STEP_S / 4.0
    products = [float(np.mean(late[100:] * np.sin(w * (t[100:] - lag_s)))) for lag_s in lags_s]
    assert abs(lags_s[int(np.argmax(products))] - delay_s) < STEP_S / 4.0


@pytest.mark.parametrize("name", [HEADING, "roll_rad"])
def test_an_angle_that_leaps_by_a_turn_is_followed_the_shorter_way(name: str) -> None:
    t, rate, lag_s, delay_s = np.arange(3000) * STEP_S, 0.7, 0.2, 0.13
    going = scenario({"lag_s": {name: lag_s}, "delay_s": {name: delay_s}}, bias={name: 0.1})
    seen = reading(going, name, turned(rate * t))
    wanted = turned(rate * (t - lag_s - delay_s) + 0.1)
    settled = t > 40.0 * lag_s
    assert np.abs(turned(seen - wanted))[settled].max() < 1e-12
    assert np.abs(seen).max() <= math.pi
    assert np.ptp(seen[settled]) > 6.2
    backwards = reading(going, name, turned(-rate * t))
    assert np.abs(turned(backwards - turned(-rate * (t - lag_s - delay_s) + 0.1)))[settled].max() < 1e-12


def test_noise_has_its_standard_deviation_and_nothing_in_common() -> None:
    n, stated = 20_000, AEROSONDE.sensors.noise_std
    one = Scenario(AEROSONDE, seed=7)
    seen = read([one], table(n))[0]
    names = [name for name in READINGS if name in stated]
    assert len(names) == 19
    errors = seen[:, [CHANNEL_INDEX[name] for name in names]] / [stated[name] for name in names]
    np.testing.assert_array_less(np.abs(errors.std(axis=0) - 1.0), DEVIATIONS / math.sqrt(2.0 * n))
    np.testing.assert_array_less(np.abs(errors.mean(axis=0)), DEVIATIONS / math.sqrt(n))
    between = np.corrcoef(np.concatenate([errors[1:], errors[:-1]], axis=1).T)
    assert np.abs(between[~np.eye(38, dtype=bool)]).max() < (DEVIATIONS + 0.5) / math.sqrt(n)  # of 703
    others = [CHANNEL_INDEX[name] for name in SIMULATED if name not in names]
    np.testing.assert_array_equal(seen[:, others], table(n)[0][:, others])


def test_the_readings_of_a_seed_are_those_before_there_was_a_navigation_receiver() -> None:
    errors = SensorErrors(bias_std={"throttle": 1.0}, dropout_fraction=0.1)
    seen = read([Scenario(AEROSONDE, seed=7, sensor_errors=errors)], table(1000))[0]
    assert np.count_nonzero(np.isfinite(seen[:, CHANNEL_INDEX[SPEED]])) == 912
    for name, sample, value in (
        (SPEED, 0, 0.1369153703621506),
        (Q, 300, 0.004164860635434451),
        ("rudder_rad", 999, -0.00038844685006589086),
        ("throttle", 999, 0.2712643588217015),
    ):
        assert seen[sample, CHANNEL_INDEX[name]] == value


def test_the_navigation_receiver_and_the_others_do_not_share_their_noise() -> None:
    stated = AEROSONDE.sensors.noise_std
    receiver = {name: std for name, std in stated.items() if name in NAVIGATION}
    others = {name: std for name, std in stated.items() if name not in NAVIGATION}
    of_receiver = [CHANNEL_INDEX[name] for name in NAVIGATION]
    of_others = [CHANNEL_INDEX[name] for name in READINGS if name not in NAVIGATION]
    whole, without, alone = (
        read([scenario({"noise_std": noise}, seed=5, bias_std=bias)], table(600))[0]
        for noise, bias in ((stated, {}), (others, {}), (receiver, {Q: 1.0}))
    )
    np.testing.assert_array_equal(without[:, of_others], whole[:, of_others])
    np.testing.assert_array_equal(without[:, of_receiver], 0.0)
    np.testing.assert_array_equal(alone[:, of_receiver], whole[:, of_receiver])
    assert np.ptp(whole[:, CHANNEL_INDEX["velocity_down_m_s"]]) > 0.3


def test_without_noise_the_other_errors_stay() -> None:
    sensors = AEROSONDE.sensors.model_copy(update={"delay_s": {Q: 0.05}})
    errors = SensorErrors(bias={ALPHA: 0.01}, bias_std={SPEED: 0.5})
    aircraft = AEROSONDE.model_copy(update={"sensors": sensors})
    truth = {Q: np.sin(np.arange(300) / 10.0), SPEED: np.full(300, 25.0)}
    quiet, noisy = (
        read([Scenario(aircraft, noise=noise, sensor_errors=errors)], table(300, truth))[0]
        for noise in (False, True)
    )
    assert np.all(quiet[:, CHANNEL_INDEX[ALPHA]] == 0.01)
    assert np.ptp(quiet[:, CHANNEL_INDEX[SPEED]]) == 0.0
    assert quiet[0, CHANNEL_INDEX[SPEED]] != 25.0
    assert np.all(quiet[3:, CHANNEL_INDEX[Q]] != truth[Q][3:])
    for name in (Q, ALPHA, SPEED):
        error = noisy[:, CHANNEL_INDEX[name]] - quiet[:, CHANNEL_INDEX[name]]
        assert np.std(error) == pytest.approx(
            aircraft.sensors.noise_std[name], rel=DEVIATIONS / math.sqrt(600)
        )


def test_bias_scale_and_upwash_are_as_given() -> None:
    truth = np.random.default_rng(3).standard_normal(100)
    one = scenario(bias={ALPHA: 0.02, Q: -0.01}, scale={ALPHA: 0.05, Q: -0.1}, vane_upwash={ALPHA: 0.3})
    np.testing.assert_allclose(reading(one, ALPHA, truth), 1.05 * 1.3 * truth + 0.02, rtol=1e-13, atol=1e-16)
    np.testing.assert_allclose(reading(one, Q, truth), 0.9 * truth - 0.01, rtol=1e-13, atol=1e-16)


def test_turn_on_biases_are_drawn_once_a_flight() -> None:
    n = 3000
    fleet = [scenario(seed=i, bias_std={Q: 0.02, ALPHA: 0.5}, bias={Q: 0.1}) for i in range(n)]
    seen = read(fleet, table(3))
    assert np.all(np.ptp(seen[:, :, CHANNEL_INDEX[Q]], axis=1) == 0.0)
    drawn = (seen[:, 0, CHANNEL_INDEX[Q]] - 0.1) / 0.02
    assert abs(drawn.std() - 1.0) < DEVIATIONS / math.sqrt(2.0 * n)
    assert abs(drawn.mean()) < DEVIATIONS / math.sqrt(n)
    assert abs(np.corrcoef(drawn, seen[:, 0, CHANNEL_INDEX[ALPHA]])[0, 1]) < DEVIATIONS / math.sqrt(n)
    alone = read([scenario(seed=5, bias_std={ALPHA: 0.5})], table(3))
    assert alone[0, 0, CHANNEL_INDEX[ALPHA]] == seen[5, 0, CHANNEL_INDEX[ALPHA]]


def test_rounding_is_to_the_resolution_with_its_error() -> None:
    n, resolution = 50_000, 0.01
    truth = np.random.default_rng(4).uniform(-1.0, 1.0, n)
    seen = reading(scenario({"resolution": {Q: resolution}}), Q, truth)
    steps = seen / resolution
    np.testing.assert_allclose(steps, np.rint(steps), rtol=0.0, atol=1e-12)
    error = seen - truth
    assert np.abs(error).max() <= resolution / 2.0 * (1.0 + 1e-12)
    # uniform: variance r^2 / 12, of the square r^4 / 180
    assert abs(np.mean(error**2) - resolution**2 / 12.0) < DEVIATIONS * resolution**2 / math.sqrt(180.0 * n)


def test_rounding_comes_after_noise_and_bias() -> None:
    seen = reading(
        scenario({"resolution": {Q: 0.01}, "noise_std": {Q: 0.05}}, bias={Q: 0.003}), Q, np.zeros(500)
    )
    np.testing.assert_allclose(seen / 0.01, np.rint(seen / 0.01), rtol=0.0, atol=1e-12)
    assert len(np.unique(seen)) > 10


@pytest.mark.parametrize("own_hz", [10.0, 7.0, 50.0 / 29.0, 33.0])
def test_a_slow_column_has_readings_at_its_own_instants_only(own_hz: float) -> None:
    n = 5000
    truth = np.random.default_rng(5).standard_normal(n)
    seen = reading(scenario({"rate_hz": {Q: own_hz}}), Q, truth)
    instants = np.arange(int(n / RATE_HZ * own_hz) + 1) / own_hz
    due = np.ceil(instants * RATE_HZ - 1e-6).astype(int)
    due = due[due < n]
    wanted = np.full(n, np.nan)
    wanted[due] = truth[due]
    np.testing.assert_array_equal(seen, wanted)
    repeated = reading(scenario({"rate_hz": {Q: own_hz}}, slow_columns="held"), Q, truth)
    np.testing.assert_array_equal(repeated, truth[due[np.searchsorted(due, np.arange(n), side="right") - 1]])


def test_a_column_as_fast_as_the_table_has_every_reading() -> None:
    truth = np.random.default_rng(6).standard_normal(100)
    for own_hz in (50.0, 400.0):
        np.testing.assert_array_equal(reading(scenario({"rate_hz": {Q: own_hz}}), Q, truth), truth)


def test_the_service_works_on_the_rows_that_a_slow_required_column_leaves() -> None:
    flown = {SPEED: np.full(500, 25.0), "air_density_kg_m3": np.full(500, 1.1)}
    values = read([scenario({"rate_hz": {SPEED: 10.0}})], table(500, flown))[0]
    result = Cleaner().clean(SampleBlock(values))
    assert result.report.accepted == 100
    assert result.report.by_channel == {SPEED: 400}
    held = read([scenario({"rate_hz": {SPEED: 10.0}}, slow_columns="held")], table(500, flown))[0]
    assert Cleaner().clean(SampleBlock(held)).report.accepted == 500


def runs(missing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Lengths of the runs of missing samples that begin and end inside the flight."""
    edges = np.flatnonzero(np.diff(missing.astype(int)))
    if missing[0]:
        edges = edges[1:]
    return np.diff(edges[: edges.size // 2 * 2].reshape(-1, 2), axis=1).ravel()


def assert_markov(missing: NDArray[np.bool_], fraction: float, length: float) -> None:
    """Fraction and mean length within their standard deviations of a two-state Markov chain."""
    n, end = missing.size, 1.0 / length
    memory = 1.0 - end - end * fraction / (1.0 - fraction)
    spread = math.sqrt(fraction * (1.0 - fraction) / n * (1.0 + memory) / (1.0 - memory))
    assert abs(missing.mean() - fraction) < DEVIATIONS * spread
    lengths = runs(missing)
    assert abs(lengths.mean() - length) < DEVIATIONS * math.sqrt((1.0 - end) / end**2 / lengths.size)


@pytest.mark.parametrize(
    ("fraction", "length_s", "samples"),
    [(0.05, 0.2, 10.0), (0.3, 1.0, 50.0), (0.2, 0.0, 1.25), (0.8, 0.02, 5.0)],
)
def test_dropouts_have_their_fraction_and_length(fraction: float, length_s: float, samples: float) -> None:
    n = 200_000
    one = scenario(dropout_fraction=fraction, dropout_length_s=length_s)
    seen = read([one], table(n))[0]
    missing = np.isnan(seen[:, CHANNEL_INDEX[Q]])
    assert_markov(missing, fraction, samples)
    columns = [CHANNEL_INDEX[name] for name in SIMULATED[1:]]
    assert np.isnan(seen[missing][:, columns]).all()
    assert np.isfinite(seen[~missing][:, columns]).all()
    np.testing.assert_array_equal(seen[:, 0], np.arange(n) / RATE_HZ)


def test_single_columns_drop_out_by_themselves() -> None:
    one = scenario(column_dropout_fraction={Q: 0.1, ALPHA: 0.2}, dropout_length_s=0.1)
    seen = read([one], table(200_000))[0]
    q, alpha = (np.isnan(seen[:, CHANNEL_INDEX[name]]) for name in (Q, ALPHA))
    assert_markov(q, 0.1, 5.0)
    assert_markov(alpha, 0.2, 5.0)
    # together as often as chance has it; 5 samples' memory leaves some 200,000 / 10 looks
    assert abs((q & alpha).mean() - 0.02) < DEVIATIONS * math.sqrt(0.02 * 0.98 / 20_000)
    assert np.isfinite(seen[:, CHANNEL_INDEX[HEADING]]).all()


def test_dropouts_leave_the_other_readings_as_they_were() -> None:
    stated = {"noise_std": {Q: 0.1, ALPHA: 0.2}, "rate_hz": {ALPHA: 10.0}}
    sound = read([scenario(stated)], table(500))
    holed = read([scenario(stated, dropout_fraction=0.2, column_dropout_fraction={Q: 0.2})], table(500))
    kept = np.isfinite(holed)
    assert np.count_nonzero(~kept[0, :, CHANNEL_INDEX[Q]]) > 100
    np.testing.assert_array_equal(holed[kept], sound[kept])


def test_faults_grow_with_their_severity() -> None:
    t = np.arange(600) * STEP_S
    truth = np.sin(1.3 * t) + 2.0
    effects = (
        SensorBias(0.2, 3.0, 2.0, target=Q),
        SensorScale(-0.3, 4.0, target=Q),
        SensorScale(0.5, 6.0, 3.0, target=Q),
        SensorDelay(0.5, 5.0, 4.0, target=Q),
    )
    bias, less, more, delay = ([e.severity(float(time)) for time in t] for e in effects)
    wanted = (1.0 + np.array(less)) * (1.0 + np.array(more)) * np.interp(t - np.array(delay), t, truth)
    seen = reading(scenario(effects=effects), Q, truth)
    np.testing.assert_allclose(seen, wanted + np.array(bias), rtol=0.0, atol=1e-12)
    assert delay[-1] == 0.5
    on_top = reading(scenario({"delay_s": {Q: 0.1}}, effects=effects[3:], scale={Q: 0.1}), Q, truth)
    np.testing.assert_allclose(
        on_top, 1.1 * np.interp(t - np.array(delay) - 0.1, t, truth), rtol=0.0, atol=1e-12
    )


NOISY: dict[str, object] = {"noise_std": {Q: 0.1, HEADING: 0.5}, "resolution": {Q: 1e-3}}


@pytest.mark.parametrize(("onset_s", "last"), [(2.0, 100), (2.01, 100), (0.0, 0), (1e6, 599)])
@pytest.mark.parametrize("name", [Q, HEADING])
def test_a_frozen_reading_repeats_the_last_one_up_to_the_onset(name: str, onset_s: float, last: int) -> None:
    truth = turned(np.cumsum(np.random.default_rng(8).standard_normal(600)))
    sound = reading(scenario(NOISY, seed=2), name, truth)
    frozen = reading(scenario(NOISY, (SensorFreeze(1.0, onset_s, target=name),), seed=2), name, truth)
    np.testing.assert_array_equal(frozen[: last + 1], sound[: last + 1])
    np.testing.assert_array_equal(frozen[last:], sound[last])


def test_a_freeze_comes_after_every_other_fault_and_the_first_one_counts() -> None:
    truth = np.random.default_rng(8).standard_normal(600)
    before = (SensorBias(0.5, 1.0, target=Q), SensorDelay(0.1, 1.0, target=Q))
    freezes = (SensorFreeze(1.0, 9.0, target=Q), SensorFreeze(1.0, 4.0, target=Q))
    after = (SensorScale(0.5, 6.0, target=Q), SensorFreeze(1.0, 3.0, target=ALPHA))
    sound = reading(scenario(NOISY, before), Q, truth)
    frozen = reading(scenario(NOISY, (*before, *freezes, *after)), Q, truth)
    np.testing.assert_array_equal(frozen[:201], sound[:201])
    np.testing.assert_array_equal(frozen[200:], sound[200])


@pytest.mark.parametrize("slow", ["absent", "held"])
def test_a_slow_column_freezes_at_its_own_instants_and_drops_out_as_ever(slow: str) -> None:
    stated = {"noise_std": {Q: 0.1}, "rate_hz": {Q: 10.0}}
    errors: dict[str, Any] = {"slow_columns": slow, "column_dropout_fraction": {Q: 0.2}}
    truth = np.random.default_rng(8).standard_normal(600)
    sound = reading(scenario(stated, **errors), Q, truth)
    whole = reading(scenario(stated, slow_columns="held"), Q, truth)
    frozen = reading(scenario(stated, (SensorFreeze(1.0, 4.07, target=Q),), **errors), Q, truth)
    np.testing.assert_array_equal(np.isnan(frozen), np.isnan(sound))
    np.testing.assert_array_equal(frozen[:204], sound[:204])
    later = frozen[204:]
    np.testing.assert_array_equal(later[np.isfinite(later)], whole[203])


def test_vane_and_pitot_faults_scale_their_columns() -> None:
    values = table(
        100, {ALPHA: np.full(100, 0.1), SPEED: np.full(100, 25.0), "sideslip_rad": np.full(100, 0.05)}
    )
    effects = (VaneUpwash(0.4, 1.0, target="angle_of_attack"), AirspeedError(-0.5, 0.0, 1.98))
    seen = read([scenario(effects=effects)], values)[0]
    np.testing.assert_allclose(seen[50:, CHANNEL_INDEX[ALPHA]], 0.14, rtol=1e-13)
    np.testing.assert_array_equal(seen[:50, CHANNEL_INDEX[ALPHA]], 0.1)
    np.testing.assert_allclose(
        seen[:, CHANNEL_INDEX[SPEED]], 25.0 * (1.0 - 0.5 * np.arange(100) / 99), rtol=1e-13
    )
    np.testing.assert_array_equal(seen[:, CHANNEL_INDEX["sideslip_rad"]], 0.05)


def everything(seed: int = 3) -> Scenario:
    """All that sensors can have, at once."""
    named = (Q, ALPHA, HEADING, SPEED, "roll_rad", "specific_force_z_m_s2")
    stated = {
        "noise_std": AEROSONDE.sensors.noise_std,
        "lag_s": {Q: 0.03, HEADING: 0.1, "roll_rad": 0.04},
        "second_order": {ALPHA: SECOND, HEADING: SECOND},
        "delay_s": {name: 0.03 + 0.01 * i for i, name in enumerate(named)},
        "resolution": dict.fromkeys(named, 1e-3),
        "rate_hz": {SPEED: 10.0, "altitude_m": 7.0},
    }
    effects = (
        SensorBias(0.02, 2.0, 3.0, target=Q),
        SensorDelay(0.2, 1.0, 2.0, target=HEADING),
        AirspeedError(-0.3, 3.0, 4.0),
        SensorFreeze(1.0, 5.11, target="roll_rad"),
        SensorFreeze(1.0, 6.0, target="altitude_m"),
    )
    return scenario(
        stated,
        effects,
        seed,
        bias_std={Q: 0.01, ALPHA: 0.02},
        bias={"sideslip_rad": 0.01},
        scale={"altitude_m": 0.01},
        vane_upwash={ALPHA: 0.2},
        dropout_fraction=0.05,
        dropout_length_s=0.1,
        column_dropout_fraction={HEADING: 0.1, "throttle": 0.1},
    )


def moving(n: int) -> NDArray[np.float64]:
    """A table in which every column moves, the heading through all quarters."""
    rng = np.random.default_rng(9)
    columns = {name: np.cumsum(0.1 * rng.standard_normal(n)) for name in READINGS}
    columns[HEADING] = turned(0.9 * np.arange(n) * STEP_S)
    return table(n, columns)


def test_readings_are_the_same_to_the_bit_in_pieces() -> None:
    values = moving(700)
    whole = read([everything()], values)
    for pieces in ((1, 0, 31, 3, 64, 257), (256,), (255, 1, 1), tuple([1] * 300)):
        np.testing.assert_array_equal(read([everything()], values, pieces), whole)


def test_readings_are_the_same_to_the_bit_alone_and_in_company() -> None:
    values = moving(400)
    fleet = [everything(3), Scenario(AEROSONDE, seed=4), scenario(), everything(5), scenario(LAGS["both"])]
    together = read(fleet, values, (100,))
    for i, one in enumerate(fleet):
        np.testing.assert_array_equal(read([one], values)[0], together[i])
    np.testing.assert_array_equal(read(fleet[::-1], values)[::-1], together)
    assert not np.array_equal(together[0], together[3], equal_nan=True)


def test_a_fault_changes_nothing_before_its_onset() -> None:
    values = moving(400)
    sound, late = scenario({"noise_std": AEROSONDE.sensors.noise_std}), 5.0
    faults = tuple(SensorDelay(0.2, late, target=name) for name in READINGS)
    faulty = scenario({"noise_std": AEROSONDE.sensors.noise_std}, faults)
    before = int(late * RATE_HZ)
    ours, theirs = read([sound], values)[0], read([faulty], values)[0]
    np.testing.assert_array_equal(theirs[:before], ours[:before])
    assert np.all(
        theirs[before + 20, [CHANNEL_INDEX[c] for c in READINGS]]
        != ours[before + 20, [CHANNEL_INDEX[c] for c in READINGS]]
    )


def test_a_flown_table_is_read_by_the_scenarios_sensors() -> None:
    true, read_out = (
        simulate(scenario(), 2.0),
        simulate(scenario(bias={ALPHA: 0.01}, scale={SPEED: 0.1}), 2.0),
    )
    np.testing.assert_array_equal(read_out.column(ALPHA), true.column(ALPHA) + 0.01)
    np.testing.assert_array_equal(read_out.column(SPEED), 1.1 * true.column(SPEED))
    np.testing.assert_array_equal(read_out.column(Q), true.column(Q))
    fleet = FleetSimulation([everything()])
    pieces = np.concatenate([fleet.step(n) for n in (1, 40, 59)], axis=1)[0]
    np.testing.assert_array_equal(pieces, simulate(everything(), 2.0).values)


@dataclass(frozen=True, slots=True)
class _Misdirected(Effect):
    name: ClassVar[str] = "misdirected"
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "anything"

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        return (SensorFault("roll_demand_rad", bias=1.0),)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: SensorErrors(bias={"time_s": 1.0}), "bias of 'time_s' cannot be simulated"),
        (lambda: SensorErrors(scale={Q: math.nan}), "scale of pitch_rate_rad_s is nan"),
        (lambda: SensorErrors(bias_std={Q: -0.1}), "bias_std of pitch_rate_rad_s is -0.1"),
        (lambda: SensorErrors(vane_upwash={Q: 0.1}), "give one of angle_of_attack_rad, sideslip_rad"),
        (lambda: SensorErrors(dropout_fraction=1.0), "dropout_fraction is 1.0"),
        (lambda: SensorErrors(column_dropout_fraction={Q: -0.5}), "dropout_fraction of pitch_rate_rad_s is -0.5"),
        (lambda: SensorErrors(dropout_length_s=math.inf), "dropout_length_s is inf"),
        (lambda: SensorErrors(slow_columns="guessed"), "slow_columns is 'guessed'; give one of absent, held"),  # type: ignore[arg-type]
        (lambda: read([scenario(effects=(_Misdirected(1.0),))], table(1)), "misdirected acts on .* 'roll_demand_rad'"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_by_name(build: Any, names: str) -> None:
    with pytest.raises(ValueError, match=names):
        build()
