"""Filter error on plants whose truth is known: recovery, coverage, and silence where nothing is said."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from offline_flights import LATERAL_TRUTH, lateral_inputs, lateral_parts, lateral_rows
from reference_plant import PLANTS, Plant
from scipy.stats import binom
from situation_cases import CONDITIONS, SITUATIONS
from situation_plants import Flight, fly_situation
from situations import whole_manoeuvres

from wingwatch.aircraft import PHUGOID, SHORT_PERIOD
from wingwatch.estimators import (
    Estimate,
    FilterErrorConfig,
    Fit,
    Manoeuvre,
    ManoeuvreConfig,
    Outcome,
    filter_error,
    in_form,
    output_error,
)
from wingwatch.estimators.offline.filter_error import _unsettled

Array = NDArray[np.float64]

SHORT = PLANTS[0]
STILL = SITUATIONS["still, open, each 5 s"]
BOTH = pytest.mark.parametrize("plant", PLANTS, ids=["short_period", "dutch_roll"])


def solved(flight: Flight, parts: Sequence[Manoeuvre] = ()) -> tuple[Estimate, Fit]:
    """The whole flight or parts of it; noise of the surface is found in the data."""
    k = flight.known
    config = FilterErrorConfig(vane_ahead_m=k.vane_ahead_m)
    return filter_error(parts or whole_manoeuvres(flight), config, expected=k.start, natural=k.natural)


def inside(estimates: list[Estimate], truth: Array) -> tuple[int, int]:
    """Truths inside the 95 % interval, and how many there are."""
    hit = [np.abs(e.value - truth) <= 1.959964 * e.standard_error for e in estimates]
    return int(np.sum(hit)), int(np.size(hit))


def is_covered(hits: int, of: int) -> bool:
    """Not fewer than a 95 % interval has in 999 of 1,000 cases.

    Errors of one flight's derivatives are correlated: six of them count as two.
    """
    return hits / of >= float(binom.ppf(0.001, max(of // 3, 1), 0.95)) / max(of // 3, 1)


@BOTH
def test_clean_data_give_the_derivatives(plant: Plant) -> None:
    flight = fly_situation(plant, replace(STILL, signal_to_noise=math.inf), 0, 12.0)
    estimate, _ = solved(flight)
    error = np.abs(estimate.value / np.array(plant.truth) - 1.0)
    assert error.max() < 0.005
    assert all(o is Outcome.CONVERGED for o in estimate.outcomes)


@BOTH
def test_errors_hold_in_still_air(plant: Plant) -> None:
    found = [solved(fly_situation(plant, STILL, seed, 15.0))[0] for seed in range(6)]
    assert is_covered(*inside(found, np.array(plant.truth)))
    stated = np.array([e.standard_error / np.abs(plant.truth) for e in found])
    assert np.median(stated) < 0.1


@pytest.mark.parametrize(
    "name",
    [
        "moderate, autopilot",
        "unknown moment, autopilot",
        "moderate, vane 0.3 m ahead, autopilot",
        "moderate, open, each 5 s",
    ],
)
def test_errors_hold_in_rough_air_and_with_unmeasured_moments(name: str) -> None:
    found = [solved(fly_situation(SHORT, SITUATIONS[name], seed, 30.0))[0] for seed in range(3)]
    assert is_covered(*inside(found, np.array(SHORT.truth)))


def test_gusts_under_feedback_inform() -> None:
    estimate, _ = solved(fly_situation(SHORT, SITUATIONS["moderate, autopilot"], 11, 30.0))
    assert (estimate.standard_error / np.abs(SHORT.truth))[[0, 3, 4, 5]].max() < 0.1


@pytest.mark.parametrize("name", ["quiet", "unknown moment, surface at rest", "quiet, surface noise"])
def test_a_flight_without_surfaces_and_gusts_informs_nothing(name: str) -> None:
    flight = fly_situation(SHORT, {**SITUATIONS, **CONDITIONS}[name], 0, 30.0)
    estimate, _ = solved(flight)
    assert np.abs(estimate.value - flight.known.start - np.array([0, 25.0, 0, 0, 0, 0])).max() < 0.05
    np.testing.assert_allclose(estimate.standard_error, 3.0 * flight.known.natural, rtol=0.05)
    assert all(o is Outcome.NOT_OBSERVABLE for o in estimate.outcomes)


def test_noise_of_surfaces_biases_nothing() -> None:
    noisy = CONDITIONS["still, autopilot, each 10 s, surface noise, on a line"]
    found = [solved(fly_situation(SHORT, noisy, seed, 30.0))[0] for seed in range(4)]
    assert is_covered(*inside(found, np.array(SHORT.truth)))


def test_output_error_states_what_noise_of_surfaces_does_in_a_short_record() -> None:
    """The same likelihood without process noise: a noisy reading drives the model, and residuals do not show it all."""
    noisy = CONDITIONS["still, autopilot, each 10 s, surface noise, on a line"]
    flights = [fly_situation(SHORT, noisy, seed, 12.0) for seed in range(20)]
    found = [output_error(whole_manoeuvres(f), natural=f.known.natural)[0] for f in flights]
    assert is_covered(*inside(found, np.array(SHORT.truth)))
    z = np.array([(e.value - SHORT.truth) / e.standard_error for e in found])
    assert (
        np.sqrt(np.mean(z**2)) < 1.35
    )  # 120 values of which 40 are independent: above by chance in 1 of 1000


@pytest.mark.parametrize("name", ["quiet", "quiet, surface noise", "unknown moment, surface at rest"])
def test_output_error_claims_nothing_where_nothing_moves(name: str) -> None:
    for plant in PLANTS:
        for seed in range(3):
            flight = fly_situation(plant, {**SITUATIONS, **CONDITIONS}[name], seed, 20.0)
            estimate, _ = output_error(whole_manoeuvres(flight), natural=flight.known.natural)
            assert Outcome.CONVERGED not in estimate.outcomes


def test_a_vane_that_is_said_to_be_elsewhere_is_not_believed() -> None:
    unstated = SITUATIONS["moderate, vane 0.3 m ahead unstated, autopilot"]
    estimate, fit = solved(fly_situation(SHORT, unstated, 0, 30.0))
    assert all(o is not Outcome.CONVERGED for o in estimate.outcomes)
    guarded = np.sqrt(np.diagonal(fit.covariance_coloured) / np.diagonal(fit.covariance_white))
    assert guarded.max() > 2.0
    assert estimate.reason


def test_without_accelerometer() -> None:
    blind = replace(STILL, accelerometer=False)
    found = [solved(fly_situation(SHORT, blind, seed, 15.0))[0] for seed in range(4)]
    assert is_covered(*inside(found, np.array(SHORT.truth)))


@pytest.mark.parametrize("rate_hz", [20.0, 200.0])
def test_at_other_rates(rate_hz: float) -> None:
    rough = replace(SITUATIONS["moderate, open, each 5 s"], rate_hz=rate_hz)
    estimate, _ = solved(fly_situation(SHORT, rough, 5, 15.0))
    z = np.abs(estimate.value - SHORT.truth) / estimate.standard_error
    assert z.max() < 4.0


def test_lateral_structure() -> None:
    rows = lateral_rows(lateral_inputs(), 0.1, seed=4)
    alpha = math.asin(1.5 / 25.0)
    offsets = np.zeros(15)
    offsets[[1, 2]] = 1.5, -25.0 * math.cos(alpha)
    own = LATERAL_TRUTH - offsets
    off = own * (1.0 + 0.3 * np.where(np.arange(15) % 2, 1.0, -1.0))
    estimate, _ = filter_error(lateral_parts(rows), expected=off, natural=np.maximum(np.abs(off), 0.2))
    z = np.abs(estimate.value - LATERAL_TRUTH) / estimate.standard_error
    assert z.max() < 4.0
    strong = [d in ("y_v", "l_p", "l_xi", "n_v", "n_r", "n_zeta") for d in estimate.structure.derivatives]
    assert (estimate.standard_error / np.abs(LATERAL_TRUTH))[strong].max() < 0.1


def changed(flight: Flight, change: str) -> tuple[Manoeuvre, ...]:
    """A flight whose data a sensor spoils."""
    parts = []
    for part in whole_manoeuvres(flight):
        states, force = part.states.copy(), part.accelerometer.copy()
        if change == "quantised":
            states = np.round(states / 0.02) * 0.02
        elif change == "constant":
            states[:, 1] = 0.01
        else:
            force[100:140, 0] = np.nan
        parts.append(replace(part, states=states, accelerometer=force))
    return tuple(parts)


@pytest.mark.parametrize("change", ["quantised", "constant", "gap"])
def test_spoiled_channels_diverge_nothing(change: str) -> None:
    flight = fly_situation(SHORT, STILL, 1, 15.0)
    estimate, _ = solved(flight, changed(flight, change))
    assert np.isfinite(estimate.value).all()
    assert (estimate.standard_error > 0.0).all()
    z = np.abs(estimate.value - SHORT.truth) / estimate.standard_error
    assert z.max() < 5.0


def test_missing_samples_are_left_out() -> None:
    whole = fly_situation(SHORT, STILL, 1, 15.0)
    (part,) = whole_manoeuvres(whole)
    keep = np.ones(len(part), dtype=bool)
    keep[[200, 310, 311, 312]] = False
    names = (
        "time_s",
        "states",
        "accelerometer",
        "inputs",
        "known",
        "rest",
        "stability",
        "control",
        "pressure",
    )
    (holed,) = (replace(part, **{n: getattr(part, n)[keep] for n in names}),)
    one, _ = solved(whole)
    other, fit = solved(whole, [holed])
    assert (np.abs(one.value - other.value) < one.standard_error).all()
    assert fit.samples == len(part)


def test_what_it_cannot_do_is_said() -> None:
    with pytest.raises(ValueError, match="2 s of whole samples"):
        filter_error([])
    flight = fly_situation(SHORT, STILL, 0, 12.0)
    parts = whole_manoeuvres(flight)
    phugoid = tuple(replace(p, config=ManoeuvreConfig(PHUGOID, p.config.reference)) for p in parts)
    with pytest.raises(ValueError, match="phugoid has other states"):
        filter_error(phugoid)
    with pytest.raises(ValueError, match="input_noise_std has 2 entries"):
        filter_error(parts, FilterErrorConfig(input_noise_std=(0.1, 0.1)))


def test_statistics_and_forms_of_the_fit() -> None:
    flight = fly_situation(SHORT, STILL, 0, 12.0)
    estimate, fit = solved(flight)
    assert [c.name for c in fit.channels] == ["w", "q", "a_z"]
    assert list(fit.noise_std) == ["w", "q", "a_z"]
    assert all(c.r_squared > 0.9 for c in fit.channels)
    assert (np.diagonal(fit.covariance_coloured) >= 0.999 * np.diagonal(fit.covariance_white)).all()
    same, _ = in_form(estimate, fit, SHORT_PERIOD)
    assert same.structure == SHORT_PERIOD


def test_what_is_not_modelled_well_claims_nothing() -> None:
    estimate, _ = solved(fly_situation(SHORT, STILL, 0, 12.0))
    assert estimate.outcomes == (Outcome.CONVERGED,) * 6
    some = _unsettled(estimate, "why", 3)
    assert some.outcomes == (Outcome.CONVERGED,) * 3 + (Outcome.SETTLING,) * 3
    assert some.outcome is Outcome.SETTLING
    assert some.reason == "why"
