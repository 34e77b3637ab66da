"""The table of situations in small: its plants against exact ones, its figures against estimators of known worth."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
import situation_plants as plants
import situations
from reference_plant import AMPLITUDE_RAD, PLANTS, Plant
from refusals import refusal
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lsim
from scipy.stats import binom
from situation_cases import CONDITIONS, SITUATIONS

from wingwatch.estimators import Estimate, Outcome, SignalLayout
from wingwatch.simulation import linear_response

BOTH = pytest.mark.parametrize("plant", PLANTS, ids=["short_period", "dutch_roll"])
LAYOUT = SignalLayout(2, 1)


@BOTH
def test_still_air_without_noise_is_the_exact_linear_plant(plant: Plant) -> None:
    record = replace(CONDITIONS["record"], signal_to_noise=np.inf)
    rows = plants.fly_situation(plant, record, 0, 12.0).rows
    surface = rows[:, LAYOUT.first_input] - plants.TRIM_SURFACE_RAD
    exact = linear_response(plant.structure, plant.by_symbol, surface, 0.02)
    flown = rows[:, 1:3] - [plants.TRIM_VELOCITY_M_S, 0.0]
    assert np.abs(flown - exact).max(axis=0) == pytest.approx(np.zeros(2), abs=1e-4 * np.abs(exact).max())
    rate = np.gradient(exact[:, 0], 0.02)
    carried = rows[:, LAYOUT.accelerometer] + rows[:, LAYOUT.kinematic]
    smooth = np.abs(np.gradient(surface)) == 0.0  # the rate jumps with the surface
    assert carried[smooth][1:-1] == pytest.approx(rate[smooth][1:-1], abs=0.03 * np.abs(rate).max())


def test_a_surface_that_moves_does_so_on_a_line() -> None:
    moving = replace(CONDITIONS["record"], signal_to_noise=np.inf, surface_moves=True)
    flight = plants.fly_situation(PLANTS[0], moving, 0, 12.0)
    surface = flight.rows[:, LAYOUT.first_input] - plants.TRIM_SURFACE_RAD
    a = np.reshape(PLANTS[0].truth, (2, 3))
    _, exact, _ = lsim((a[:, :2], a[:, 2:], np.eye(2), np.zeros((2, 1))), surface, flight.rows[:, 0])
    flown = flight.rows[:, 1:3] - [plants.TRIM_VELOCITY_M_S, 0.0]
    assert flown == pytest.approx(exact, abs=1e-4 * np.abs(exact).max())
    assert not flight.known.held


@pytest.mark.parametrize("shape", plants.SHAPES)
def test_gusts_have_the_variance_and_the_spectrum_they_are_asked_for(shape: plants.GustShape) -> None:
    numerator, denominator = plants.SHAPES[shape]
    rng, time_s = np.random.default_rng(3), 0.05
    gust = plants._stationary(numerator, denominator, time_s, 2**18, rng)[:-1]
    # 131 s of a process that remembers for 0.05 s: some 1300 independent values
    assert gust.var() == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / 1300.0))
    power = np.abs(np.fft.rfft(gust)) ** 2
    x = 2j * np.pi * np.fft.rfftfreq(gust.size, plants.FINE_S) * time_s
    wanted = np.abs(np.polyval(numerator, x) / np.polyval(denominator, x)) ** 2
    ratio = power / wanted
    low, high = ratio[100:600].mean(), ratio[2000:6000].mean()  # 0.8 to 4.6 Hz, 15 to 46 Hz
    assert low == pytest.approx(high, rel=5.0 * np.sqrt(1.0 / 500.0 + 1.0 / 4000.0))


@BOTH
def test_the_air_turns_as_its_gradient_behind_the_span(plant: Plant) -> None:
    time_s: plants.Array = np.asarray(plants.FINE_S * np.arange(20_000), dtype=np.float64)
    situation = SITUATIONS["moderate, open"]
    air = plants._air_path(situation, plant, time_s, np.random.default_rng(0))
    sign, spans = (-1.0, 4.0) if plant is PLANTS[0] else (1.0, 3.0)
    lag_s = spans * plants.SPAN_M / (np.pi * plants.AIRSPEED_M_S)
    # By its definition the rate holds gust less smoothed gust; the smoothed one must then be the rate's integral.
    smooth = air.gust - sign * air.rate * lag_s * plants.AIRSPEED_M_S
    travelled = sign * plants.AIRSPEED_M_S * cumulative_trapezoid(air.rate, dx=plants.FINE_S, initial=0)
    assert smooth - smooth[0] == pytest.approx(travelled, abs=1e-3 * air.gust.std())


def test_a_vane_ahead_meets_the_gust_earlier_and_reads_the_rotation() -> None:
    unstated = replace(SITUATIONS["moderate, open"], vane_ahead_m=1.0, vane_stated_m=0.0, seconds=10.0)
    time_s: plants.Array = np.asarray(plants.FINE_S * np.arange(20_000), dtype=np.float64)
    air = plants._air_path(unstated, PLANTS[0], time_s, np.random.default_rng(0))
    steps = round(1.0 / plants.AIRSPEED_M_S / plants.FINE_S)
    assert np.array_equal(air.at_vane[:-steps], air.gust[steps:])
    far = plants.fly_situation(PLANTS[0], unstated, 1, 10.0).rows
    corrected = plants.fly_situation(PLANTS[0], replace(unstated, vane_stated_m=None), 1, 10.0).rows
    assert corrected[:, 1] - far[:, 1] == pytest.approx(far[:, 2], abs=1e-12)


def test_the_estimator_is_told_the_vane_that_the_signals_are_corrected_for() -> None:
    for words, ahead_m in (("ahead", 0.3), ("ahead unstated", 0.0)):
        situation = SITUATIONS[f"moderate, vane 0.3 m {words}, autopilot"]
        assert plants.fly_situation(PLANTS[0], situation, 0, 5.0).known.vane_ahead_m == ahead_m


@BOTH
def test_still_flight_with_doublets_is_claimed_and_covered(plant: Plant) -> None:
    seeds = 8
    every = list(situations.ESTIMATORS)
    readings = situations.read(plant, SITUATIONS["still, open, each 5 s"], every, seeds, 30.0)
    for name, found in readings.items():
        figures = situations.figures((plant.structure.name, "still", name), found)
        assert figures.claimed >= 80.0
        # A true share of 95 % falls below this in one of a million tests.
        assert figures.covered_all >= 100.0 * binom.ppf(1e-6, 6 * seeds, 0.95) / (6 * seeds)


def test_figures_tell_an_honest_estimator_from_a_boaster(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)

    def stating(factor: float, outcome: Outcome) -> object:
        def estimate(flight: plants.Flight) -> Estimate:
            k = flight.known
            wrong = 0.1 * k.natural * rng.standard_normal(6)
            spread = np.diag((factor * 0.1 * k.natural) ** 2)
            value = np.array(k.plant.truth) + wrong
            nowhere = (np.nan,) * 4
            return Estimate("x", k.plant.structure, 0.0, value, spread, (outcome,) * 6, outcome, "", nowhere)

        return estimate

    table = {
        "honest": stating(1.0, Outcome.CONVERGED),
        "boaster": stating(0.1, Outcome.CONVERGED),
        "silent": stating(1.0, Outcome.NOT_OBSERVABLE),
    }
    monkeypatch.setattr(situations, "ESTIMATORS", table)
    found = situations.read(PLANTS[0], CONDITIONS["record"], list(table), 40, 5.0)
    honest, boaster, silent = (situations.figures(("p", "s", name), found[name]) for name in table)
    assert honest.claimed == boaster.claimed == 100.0
    assert honest.covered_claims is not None
    assert boaster.covered_claims is not None
    assert honest.covered_claims >= 100.0 * binom.ppf(1e-6, 240, 0.95) / 240
    assert boaster.covered_claims < 40.0
    assert honest.stated == pytest.approx(10.0)
    assert boaster.rms_score == pytest.approx(10.0, rel=0.3)
    assert (silent.claimed, silent.covered_claims, silent.worst_score) == (0.0, None, None)
    assert "-" in situations.line(silent)
    words = situations.summary([replace(honest, estimator="x"), replace(boaster, estimator="x")])
    assert len(words) == 1
    assert "below 90 % in 1 of the 2 situations" in words[0]


def test_one_seed_is_one_flight_and_another_another() -> None:
    first, again, other = (
        plants.fly_situation(PLANTS[1], SITUATIONS["random moment, moderate, autopilot"], seed, 5.0)
        for seed in (2, 2, 3)
    )
    assert np.array_equal(first.rows, again.rows)
    assert not np.array_equal(first.rows, other.rows)
    off = np.abs(first.known.start - plants.aerodynamic(PLANTS[1])) / first.known.natural
    assert off == pytest.approx(np.full(6, 0.3))


@pytest.mark.parametrize("name", [*SITUATIONS, *CONDITIONS])
def test_every_situation_can_be_flown(name: str) -> None:
    situation = {**SITUATIONS, **CONDITIONS}[name]
    short = replace(situation, seconds=12.0)
    flight = plants.fly_situation(PLANTS[1], short, 0, 12.0)
    assert flight.rows.shape == (round(12.0 * situation.rate_hz), LAYOUT.columns)
    assert np.isfinite(flight.rows).all()
    if situation.surface is not None and situation.loop is None and situation.surface_noise_rad == 0.0:
        moved = np.abs(flight.rows[:, LAYOUT.first_input] - plants.TRIM_SURFACE_RAD)
        assert moved.max() == pytest.approx(AMPLITUDE_RAD, rel=1e-6)


def test_json_has_one_object_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["situations.py", "--seeds", "1", "--seconds", "5", "--cases", "quiet; record", "--json"]
    monkeypatch.setattr(sys, "argv", [*words, "--plants", "short_period"])
    assert situations.main() == 0
    rows = [json.loads(text) for text in capsys.readouterr().out.splitlines()]
    assert [(r["situation"], r["estimator"]) for r in rows] == [
        (case, name) for case in ("quiet", "record") for name in situations.ESTIMATORS
    ]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--seeds", "0"], "at least 1"),
        (["--seconds", "nan"], "at least 5"),
        (["--cases", "calm"], "--list names them"),
        (["--estimators", "oracle"], "fourier, ekf"),
        (["--plants", "phugoid"], "short_period, dutch_roll"),
    ],
)
def test_bad_arguments_get_one_sentence(
    arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in refusal(situations, arguments, monkeypatch, capsys)
