"""Benchmarks on simulated flights in small: still air, another axis, how finely the air is drawn."""

from dataclasses import replace
from types import ModuleType

import air_steps
import numpy as np
import other_axis
import pytest
import simulated_flights
import still_flights
import turbulence
from refusals import refusal
from scipy.stats import binom

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, linearised_derivatives, load_aircraft, trimmed
from wingwatch.estimators import Estimate, Outcome
from wingwatch.simulation import Scenario, doublet_schedule

AEROSONDE = load_aircraft("aerosonde")


def stated(value: np.ndarray, error: float, outcome: Outcome) -> Estimate:
    k = value.size
    spread = np.diag(np.full(k, error**2))
    return Estimate(
        "x", SHORT_PERIOD, 0.0, value, spread, (outcome,) * k, outcome, "", (25.0, 1000.0, 1.1, 0.05)
    )


# still flights


def test_still_flights_are_covered_and_output_error_is_its_own_measure() -> None:
    flights = 3
    found = still_flights.collect(AEROSONDE, SHORT_PERIOD, flights, 30.0)
    rows = {f.estimator: f for f in still_flights.figures("aerosonde", SHORT_PERIOD, found)}
    assert set(rows) == {"fourier", "ekf", "output error"}
    peer = rows["output error"]
    assert peer.over_peer == pytest.approx([1.0] * 6)
    assert peer.over_peer_median == pytest.approx(1.0)
    assert peer.over_peer_worst == pytest.approx(1.0)
    for row in rows.values():
        # A true share of 95 % falls below this in one of a million tests.
        assert row.covered_all >= 100.0 * binom.ppf(1e-6, 6 * flights, 0.95) / (6 * flights)
        assert row.estimator in still_flights.line(row)


def test_one_flight_in_still_air_is_known_as_well_as_another() -> None:
    """In two of these the first doublet is met with derivatives so far off that innovations are many times their size;
    they left the level of the unmeasured moment where it began, and a fifteenth of the knowledge."""
    aircraft = load_aircraft("twinotter")
    doublets = doublet_schedule(
        aircraft, simulated_flights.cruise_of(aircraft), simulated_flights.AMPLITUDE_RAD
    )
    errors = []
    for seed in (3000, 3003, 3004):
        block = simulated_flights.fly(aircraft, [doublets], seed, 60.0)
        solution = simulated_flights.last_solution(simulated_flights.misstated(aircraft, seed), block)
        errors.append(solution.modes["short_period"].ekf.standard_error[3:])
    assert (np.max(errors, axis=0) < 3.0 * np.min(errors, axis=0)).all()


def test_the_chains_file_is_off_by_thirty_percent_and_the_flown_one_is_not() -> None:
    off = simulated_flights.misstated(AEROSONDE, 4)
    assert AEROSONDE.coefficients is not None
    assert off.coefficients is not None
    assert off.coefficients.CL.zero == AEROSONDE.coefficients.CL.zero
    ratios = [off.coefficients.Cm.alpha / AEROSONDE.coefficients.Cm.alpha]
    ratios += [off.coefficients.Cl.p / AEROSONDE.coefficients.Cl.p]
    assert all(min(abs(r - 0.7), abs(r - 1.3)) < 1e-12 for r in ratios)
    assert simulated_flights.misstated(AEROSONDE, 4) == off
    assert simulated_flights.misstated(AEROSONDE, 5) != off


def test_the_truth_has_the_angle_of_attack_that_the_estimate_reports() -> None:
    at = trimmed(AEROSONDE, simulated_flights.cruise_of(AEROSONDE))
    table = linearised_derivatives(AEROSONDE, at, SHORT_PERIOD)
    cruise = simulated_flights.cruise_of(AEROSONDE)
    estimate = replace(
        stated(np.zeros(6), 1.0, Outcome.CONVERGED),
        condition=(
            cruise.airspeed_true_m_s,
            cruise.altitude_m,
            cruise.air_density_kg_m3,
            at.angle_of_attack_rad,
        ),
    )
    truth = simulated_flights.truth_of(AEROSONDE, estimate)
    assert truth == pytest.approx([table[d] for d in SHORT_PERIOD.derivatives])


# another axis


def test_the_coupled_aircraft_differs_in_coupling_alone() -> None:
    coupled, at = other_axis.coupled(AEROSONDE), simulated_flights.cruise_of(AEROSONDE)
    for structure in (SHORT_PERIOD, LATERAL):
        plain, other = (linearised_derivatives(a, trimmed(a, at), structure) for a in (AEROSONDE, coupled))
        assert list(other.values()) == pytest.approx(list(plain.values()), rel=1e-9)
    doublets = other_axis.schedule(AEROSONDE, other_axis.SURFACES["ailerons and rudder"], 0.03)
    assert doublets.surfaces == ("aileron", "rudder")
    block = simulated_flights.fly(AEROSONDE, [doublets], 0, 10.0)
    ten, one = other_axis.pitch_coupling(coupled, block), other_axis.pitch_coupling(AEROSONDE, block)
    assert ten == pytest.approx(10.0 * one)
    assert np.abs(one).max() > 0.0


def test_honest_is_inside_or_withheld() -> None:
    truth = np.zeros(6)
    rows = [
        (stated(truth + 0.5, 1.0, Outcome.CONVERGED), truth),
        (stated(truth + 9.0, 1.0, Outcome.CONVERGED), truth),
        (stated(truth + 9.0, 1.0, Outcome.NOT_OBSERVABLE), truth),
        (stated(truth + 9.0, 1.0, Outcome.SETTLING), truth),
    ]
    found = other_axis.figures(("a", "elevator", 2.0), ("short_period", "x"), rows, 0.1)
    assert (found.converged, found.settling, found.withheld) == (50.0, 25.0, 25.0)
    assert (found.covered_claims, found.true_or_withheld, found.worst_score) == (50.0, 50.0, 9.0)


def test_lateral_derivatives_of_an_elevator_flight_are_withheld_by_the_chain() -> None:
    rows = other_axis.case_figures(AEROSONDE, "elevator", 2.0, 1, 30.0)
    by_key = {(f.structure, f.estimator): f for f in rows}
    assert len(by_key) == 6
    for name in ("fourier", "ekf"):
        assert by_key["lateral", name].withheld == 100.0
        assert by_key["short_period", name].converged > 0.0
    assert rows[0].coupling_rad_s2 < 0.01


# how finely the air is drawn


def test_straight_air_lacks_what_its_mean_has() -> None:
    straight, whole = (
        air_steps.rough_fleet(AEROSONDE, "moderate", 1, 1, straight) for straight in (True, False)
    )
    rows = [fleet._fleet.gust_filter[0] for fleet in (straight, whole)]
    assert np.array_equal(rows[0][:-2], rows[1][:-2])
    assert rows[0][-1] == 0.0 < rows[1][-1]
    seen = [fleet.step(500)[0] for fleet in (straight, whole)]
    assert not np.array_equal(seen[0], seen[1], equal_nan=True)


def test_rates_do_not_change_how_often_sensors_read() -> None:
    found = air_steps.errors(AEROSONDE, air_steps.rough_fleet(AEROSONDE, "light", 2, 2, False), 2, 31.0)
    assert found.shape == (2, len(air_steps.SHOWN))
    assert np.isfinite(found).all()
    assert "with mean" in air_steps.line("aerosonde", 100.0, "with mean", found)


@pytest.mark.parametrize(
    ("module", "arguments", "words"),
    [
        (still_flights, ["--flights", "0"], "at least 1"),
        (still_flights, ["--seconds", "nan"], "at least 15"),
        (other_axis, ["--flights", "0"], "at least 1"),
        (other_axis, ["--degrees", "0"], "above 0"),
        (air_steps, ["--flights", "1"], "at least 2"),
        (air_steps, ["--finer", "0"], "1 to 20"),
    ],
)
def test_bad_arguments_get_one_sentence(
    module: ModuleType,
    arguments: list[str],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert words in refusal(module, arguments, monkeypatch, capsys)


# records slower than the autopilot


@pytest.mark.parametrize(("drawn", "commands"), [(False, False), (True, False), (True, True)])
def test_at_twenty_samples_a_second_stated_errors_hold(drawn: bool, commands: bool) -> None:
    """Doublets whose edges fall on samples, and at any time; both estimators, both structures."""
    flights = 4
    at = simulated_flights.cruise_of(AEROSONDE)
    doublets = doublet_schedule(AEROSONDE, at, simulated_flights.AMPLITUDE_RAD)
    scenarios = [
        Scenario(
            AEROSONDE,
            at.airspeed_true_m_s,
            at.altitude_m,
            manoeuvres=(turbulence.drawn(doublets, seed) if drawn else doublets,),
            seed=seed,
        )
        for seed in range(87600, 87600 + flights)
    ]
    files = [simulated_flights.misstated(AEROSONDE, s.seed) for s in scenarios]
    estimates = turbulence.finals(scenarios, files, 20.0, 60.0, commands)
    scores = np.concatenate(
        [(e.value - simulated_flights.truth_of(AEROSONDE, e)) / e.standard_error for e in estimates]
    )
    assert scores.size == flights * 2 * (6 + 15)
    assert np.mean(np.abs(scores) < 1.96) > 0.9
    assert np.abs(scores).max() < 6.0
