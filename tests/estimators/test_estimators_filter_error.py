"""Filter error on plants whose truth is known: recovery, coverage, and silence where nothing is said."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filter_situations import PLANTS, SITUATIONS, Flight, Situation, fly
from numpy.typing import NDArray
from offline_flights import LATERAL_TRUTH, lateral_inputs, lateral_parts, lateral_rows
from scipy.stats import binom

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
)
from wingwatch.estimators.kalman.filter_error import _unsettled

Array = NDArray[np.float64]

SHORT = PLANTS["short_period"]


def solved(flight: Flight) -> tuple[Estimate, Fit]:
    config = FilterErrorConfig(vane_ahead_m=flight.vane_ahead_m)
    return filter_error(flight.parts, config, expected=flight.expected, natural=flight.natural)


def inside(estimates: list[Estimate], truth: Array) -> tuple[int, int]:
    """Truths inside the 95 % interval, and how many there are."""
    hit = [np.abs(e.value - truth) <= 1.959964 * e.standard_error for e in estimates]
    return int(np.sum(hit)), int(np.size(hit))


def is_covered(hits: int, of: int) -> bool:
    """Not fewer than a 95 % interval has in 999 of 1,000 cases.

    Errors of one flight's derivatives are correlated: six of them count as two.
    """
    return hits / of >= float(binom.ppf(0.001, max(of // 3, 1), 0.95)) / max(of // 3, 1)


@pytest.mark.parametrize("mode", sorted(PLANTS))
def test_clean_data_give_the_derivatives(mode: str) -> None:
    plant = PLANTS[mode]
    flight = fly(plant, Situation((2.0, 5.0)), 0, 12.0, noise=0.0)
    estimate, _ = solved(flight)
    error = np.abs(estimate.value / np.array(plant.derivatives) - 1.0)
    assert error.max() < 0.005
    assert all(o is Outcome.CONVERGED for o in estimate.outcomes)


@pytest.mark.parametrize("mode", sorted(PLANTS))
def test_errors_hold_in_still_air(mode: str) -> None:
    plant = PLANTS[mode]
    found = [solved(fly(plant, Situation((2.0, 5.0)), seed, 15.0))[0] for seed in range(6)]
    assert is_covered(*inside(found, np.array(plant.derivatives)))
    stated = np.array([e.standard_error / np.abs(plant.derivatives) for e in found])
    assert np.median(stated) < 0.1


@pytest.mark.parametrize(
    "name",
    ["moderate, autopilot", "moment, autopilot", "moderate, vane ahead, autopilot", "moderate, doublets"],
)
def test_errors_hold_in_rough_air_and_with_unmeasured_moments(name: str) -> None:
    found = [solved(fly(SHORT, SITUATIONS[name], seed, 30.0))[0] for seed in range(3)]
    assert is_covered(*inside(found, np.array(SHORT.derivatives)))


def test_gusts_under_feedback_inform() -> None:
    estimate, _ = solved(fly(SHORT, SITUATIONS["moderate, autopilot"], 11, 30.0))
    assert (estimate.standard_error / np.abs(SHORT.derivatives))[[0, 3, 4, 5]].max() < 0.1


@pytest.mark.parametrize("name", ["quiet", "moment", "quiet, surface noise"])
def test_a_flight_without_surfaces_and_gusts_informs_nothing(name: str) -> None:
    flight = fly(SHORT, SITUATIONS[name], 3, 30.0)
    estimate, _ = solved(flight)
    assert np.abs(estimate.value - flight.expected - np.array([0, 25.0, 0, 0, 0, 0])).max() < 0.05
    np.testing.assert_allclose(estimate.standard_error, 3.0 * flight.natural, rtol=0.05)
    assert all(o is Outcome.NOT_OBSERVABLE for o in estimate.outcomes)


def test_noise_of_surfaces_biases_nothing() -> None:
    name = "still, autopilot, doublets, surface noise"
    found = [solved(fly(SHORT, SITUATIONS[name], seed, 30.0))[0] for seed in range(4)]
    assert is_covered(*inside(found, np.array(SHORT.derivatives)))


def test_a_vane_that_is_said_to_be_elsewhere_is_not_believed() -> None:
    estimate, fit = solved(fly(SHORT, SITUATIONS["moderate, vane ahead unsaid, autopilot"], 0, 30.0))
    assert all(o is not Outcome.CONVERGED for o in estimate.outcomes)
    guarded = np.sqrt(np.diagonal(fit.covariance_coloured) / np.diagonal(fit.covariance_white))
    assert guarded.max() > 2.0
    assert estimate.reason


def test_without_accelerometer() -> None:
    found = [
        solved(fly(SHORT, Situation((2.0, 5.0)), seed, 15.0, accelerometer=False))[0] for seed in range(4)
    ]
    assert is_covered(*inside(found, np.array(SHORT.derivatives)))


@pytest.mark.parametrize("rate_hz", [20.0, 200.0])
def test_at_other_rates(rate_hz: float) -> None:
    flight = fly(SHORT, SITUATIONS["moderate, doublets"], 5, 15.0, rate_hz=rate_hz)
    estimate, _ = solved(flight)
    z = np.abs(estimate.value - SHORT.derivatives) / estimate.standard_error
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
    for part in flight.parts:
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
    flight = fly(SHORT, Situation((2.0, 5.0)), 1, 15.0)
    estimate, _ = filter_error(changed(flight, change), expected=flight.expected, natural=flight.natural)
    assert np.isfinite(estimate.value).all()
    assert (estimate.standard_error > 0.0).all()
    z = np.abs(estimate.value - SHORT.derivatives) / estimate.standard_error
    assert z.max() < 5.0


def test_missing_samples_are_left_out() -> None:
    whole = fly(SHORT, Situation((2.0, 5.0)), 1, 15.0)
    (part,) = whole.parts
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
    other, fit = filter_error([holed], expected=whole.expected, natural=whole.natural)
    assert (np.abs(one.value - other.value) < one.standard_error).all()
    assert fit.samples == len(part)


def test_what_it_cannot_do_is_said() -> None:
    with pytest.raises(ValueError, match="2 s of whole samples"):
        filter_error([])
    flight = fly(SHORT, Situation((2.0, 5.0)), 0, 12.0)
    phugoid = tuple(replace(p, config=ManoeuvreConfig(PHUGOID, p.config.reference)) for p in flight.parts)
    with pytest.raises(ValueError, match="phugoid has other states"):
        filter_error(phugoid)
    with pytest.raises(ValueError, match="input_noise_std has 2 entries"):
        filter_error(flight.parts, FilterErrorConfig(input_noise_std=(0.1, 0.1)))


def test_statistics_and_forms_of_the_fit() -> None:
    flight = fly(SHORT, Situation((2.0, 5.0)), 0, 12.0)
    estimate, fit = solved(flight)
    assert [c.name for c in fit.channels] == ["w", "q", "a_z"]
    assert list(fit.noise_std) == ["w", "q", "a_z"]
    assert all(c.r_squared > 0.9 for c in fit.channels)
    assert (np.diagonal(fit.covariance_coloured) >= 0.999 * np.diagonal(fit.covariance_white)).all()
    same, _ = in_form(estimate, fit, SHORT_PERIOD)
    assert same.structure == SHORT_PERIOD


def test_what_is_not_modelled_well_claims_nothing() -> None:
    estimate, _ = solved(fly(SHORT, Situation((2.0, 5.0)), 0, 12.0))
    assert estimate.outcomes == (Outcome.CONVERGED,) * 6
    some = _unsettled(estimate, "why", 3)
    assert some.outcomes == (Outcome.CONVERGED,) * 3 + (Outcome.SETTLING,) * 3
    assert some.outcome is Outcome.SETTLING
    assert some.reason == "why"
