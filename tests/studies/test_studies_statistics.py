"""Statistics of studies against known values and known truth."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from wingwatch.studies.statistics import (
    clustered_proportion,
    clustered_ratio,
    exceedance_rates,
    fit_detection,
    noticed_fraction,
    poisson_rate,
    quickest_delay_s,
    time_to_notice,
    wilson,
)

MOST_UNLIKELY = 1e-5


def covered(hits: int, trials: int, stated: float = 0.95, at_least: float = 0.02) -> bool:
    """Whether so many hits are possible for an interval whose true coverage is within ``at_least`` of the stated."""
    low = binom.ppf(MOST_UNLIKELY, trials, stated - at_least)
    return bool(low <= hits <= binom.isf(MOST_UNLIKELY, trials, min(stated + at_least, 0.999)))


def test_wilson_as_published() -> None:
    # Newcombe (1998), table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29
    for successes, trials, low, high in (
        (81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718),
    ):  # fmt: skip
        found = wilson(successes, trials)
        assert (found.low, found.high) == pytest.approx((low, high), abs=6e-5)
    assert wilson(7, 7).high == 1.0
    assert math.isnan(wilson(0, 0).value)


def test_exact_poisson_limits_as_published() -> None:
    # Garwood (1936), 95 %: 0, 1, 5 and 20 events
    for events, low, high in ((0, 0.0, 3.689), (1, 0.0253, 5.572), (5, 1.623, 11.668), (20, 12.217, 30.888)):
        found = poisson_rate(events, 2.0)
        assert (found.low, found.high) == pytest.approx((low / 2.0, high / 2.0), abs=1e-3)
    assert poisson_rate(0, 300.0, 0.9).high == pytest.approx(0.01, rel=2e-3)
    assert math.isnan(poisson_rate(0, 0.0).value)


@pytest.mark.parametrize("flights", [60, 400])
def test_detection_curve_band_and_size_hold_the_truth(flights: int) -> None:
    rng = np.random.default_rng(flights)
    trials = 300
    size_95, slope = 0.25, 4.0
    in_band = in_interval = fits = 0
    at = np.array([0.15])
    truth = 1.0 / (1.0 + np.exp(-(math.log(19.0) + slope * np.log(at / size_95))))
    for _ in range(trials):
        sizes = rng.uniform(0.02, 0.5, flights)
        chance = 1.0 / (1.0 + np.exp(-(math.log(19.0) + slope * np.log(sizes / size_95))))
        curve = fit_detection(sizes, rng.random(flights) < chance)
        assert curve is not None
        _, low, high = curve.probability(at)
        in_band += bool(low[0] <= truth[0] <= high[0])
        size = curve.size_at(0.95)
        in_interval += size.low <= size_95 <= size.high
        fits += not curve.fit_probability < 0.05
    assert covered(in_band, trials)
    assert covered(in_interval, trials, at_least=0.04)
    assert flights < 100 or covered(fits, trials, at_least=0.03)


def test_a_curve_that_does_not_fit_is_noticed() -> None:
    rng = np.random.default_rng(1)
    sizes = rng.uniform(0.02, 0.5, 2000)
    curve = fit_detection(sizes, rng.random(2000) < np.where(sizes > 0.1, 0.6, 0.0))
    assert curve is not None
    assert curve.fit_probability < 1e-3


def test_flights_that_say_nothing_give_no_limit() -> None:
    sizes = np.linspace(0.1, 0.4, 40)
    never = fit_detection(sizes, np.zeros(40))
    assert never is not None
    assert (never.size_at(0.95).low, never.size_at(0.95).high) == (0.0, math.inf)
    separated = fit_detection(sizes, sizes > 0.2)
    assert separated is not None
    assert separated.size_at(0.5).low < 0.2 < separated.size_at(0.5).high
    always = fit_detection(np.linspace(0.1, 0.4, 4000), np.ones(4000))
    assert always is not None
    assert always.size_at(0.95).high == pytest.approx(0.1)
    assert fit_detection([0.1] * 20, [True] * 20) is None
    assert fit_detection([0.1, 0.2], [True, False]) is None


def test_delays_of_flights_that_end_before_their_alert_are_not_lost() -> None:
    rng = np.random.default_rng(2)
    mean_s, hits, trials = 20.0, 0, 200
    for _ in range(trials):
        delay, end = rng.exponential(mean_s, 200), rng.uniform(5.0, 60.0, 200)
        half = time_to_notice(np.where(delay < end, delay, np.nan), end, 0.5)
        hits += half.low <= mean_s * math.log(2.0) <= half.high
    assert covered(hits, trials, at_least=0.03)
    assert math.isinf(time_to_notice([5.0, math.nan, math.nan], [60.0, 60.0, 60.0], 0.5).value)
    times, fraction, low, high = noticed_fraction([1.0, 2.0], [9.0, 9.0])
    assert times.tolist() == [1.0, 2.0]
    assert fraction.tolist() == [0.5, 1.0]
    assert (low <= fraction).all()
    assert (fraction <= high).all()
    assert noticed_fraction([math.nan], [60.0])[0].size == 0


def test_the_quickest_delay_is_what_the_cumulative_sum_test_attains() -> None:
    interval_s, rate = 360_000.0, 0.1
    (bound,) = quickest_delay_s(interval_s, [rate])
    assert bound == pytest.approx(math.log(interval_s * rate) / rate, rel=0.12)
    # the threshold h that gives the interval, by its own equations
    h = bound * rate + 1.0 - math.exp(-(bound * rate + 1.0))
    assert math.exp(h) - h - 1.0 == pytest.approx(rate * interval_s, rel=0.05)
    none, unknown = quickest_delay_s(interval_s, [0.0, math.nan])
    assert math.isinf(none)
    assert math.isnan(unknown)


def test_evidence_that_passes_at_a_known_rate() -> None:
    rng = np.random.default_rng(3)
    per_hour, trials = 2.0, 200
    hits = np.zeros(3, dtype=int)
    levels = np.array([0.0, 2.0, 4.0])
    for _ in range(trials):
        hours = rng.uniform(0.02, 1.0, 400)
        peaks = [rng.exponential(1.0, n).max(initial=-5.0) for n in rng.poisson(per_hour * hours)]
        found = exceedance_rates(peaks, hours, levels)
        truth = per_hour * np.exp(-levels)
        hits += (found.low <= truth) & (truth <= found.high)
    assert all(h >= binom.ppf(MOST_UNLIKELY, trials, 0.93) for h in hits)  # exact limits are never too narrow
    nothing = exceedance_rates([-1.0, -1.0], [150.0, 150.0], [0.0], 0.9)
    assert nothing.rate[0] == 0.0
    assert nothing.high[0] == pytest.approx(0.01, rel=2e-3)
    assert math.isinf(exceedance_rates([1.0], [1.0], [0.0]).rate[0])


def test_a_ratio_whose_blocks_share_an_error_has_an_interval_as_wide() -> None:
    rng = np.random.default_rng(4)
    trials, flights, blocks, freedom = 300, 60, 30, 5.0
    hits = 0
    for _ in range(trials):
        common = rng.chisquare(20.0, flights) / 20.0
        sums = common * rng.chisquare(blocks * freedom, flights)
        found = clustered_ratio(sums, np.full(flights, blocks * freedom))
        hits += found.low <= 1.0 <= found.high
    assert covered(hits, trials, at_least=0.03)
    assert math.isnan(clustered_ratio([], []).value)


@pytest.mark.parametrize("share", [0.01, 0.2])
def test_a_proportion_of_blocks_of_one_flight_that_err_together_is_covered(share: float) -> None:
    rng = np.random.default_rng(7)
    flights, blocks, trials = 200, 30, 1000
    hits = 0
    for _ in range(trials):
        bad = rng.random(flights) < 0.5
        count = rng.binomial(blocks, np.where(bad, 2.0 * share, 0.0))
        found = clustered_proportion(count, np.full(flights, blocks))
        hits += found.low <= share <= found.high
    assert covered(hits, trials, at_least=0.03)


def test_a_proportion_without_a_success_has_an_upper_limit() -> None:
    assert clustered_proportion([0.0, 0.0], [50.0, 50.0]) == wilson(0.0, 100.0)
    assert clustered_proportion([5.0, 5.0], [5.0, 5.0]) == wilson(10.0, 10.0)
    assert math.isnan(clustered_proportion([], []).value)
