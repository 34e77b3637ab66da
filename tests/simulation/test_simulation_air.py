"""The air: turbulence against the specification's spectra, discrete gusts and wind against their formulas."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.stats import chi2

from wingwatch.aircraft import load_aircraft
from wingwatch.simulation import DiscreteGust, Scenario, Turbulence, TurbulenceModel, WindProfile
from wingwatch.simulation.dynamics import quaternion
from wingwatch.simulation.flight import in_body_axes
from wingwatch.simulation.gusts import add_discrete_gusts, gust_rows
from wingwatch.simulation.turbulence import (
    NORMALS,
    STATES,
    GustScales,
    TurbulenceFilter,
    gust_scales,
    gust_spectra,
    gust_step,
    turbulence_filter,
)
from wingwatch.simulation.wind import wind_at, wind_row

Array = NDArray[np.float64]
FOOT, KNOT = 0.3048, 1852.0 / 3600.0
SPEED, SPAN = 25.0, 2.9
MODELS: tuple[TurbulenceModel, ...] = ("dryden", "von-karman")
FIT_ERROR = {"dryden": 1e-9, "von-karman": 0.0237}
"""What the filter's own spectrum may differ by from the specification's, up to FIT_BAND / T; beyond it falls off."""
FIT_BAND = 1e4


# strength and length


def test_low_altitude_turbulence_is_that_of_the_specification() -> None:
    for model in MODELS:
        g = gust_scales("moderate", 500.0 * FOOT, model)
        assert g.sigma_w_m_s == pytest.approx(3.0 * KNOT)  # a tenth of 30 knots
        assert g.length_w_m == pytest.approx(500.0 * FOOT)
        shape = 0.177 + 0.000823 * 500.0
        assert g.sigma_u_m_s == pytest.approx(3.0 * KNOT / shape**0.4)
        assert g.length_u_m == pytest.approx(500.0 / shape**1.2 * FOOT)


@pytest.mark.parametrize(("level", "rms_ft_s"), [("light", 7.4), ("moderate", 10.6), ("severe", 23.0)])
@pytest.mark.parametrize(("model", "length_ft"), [("dryden", 1750.0), ("von-karman", 2500.0)])
def test_medium_altitude_turbulence_is_that_of_figure_7(
    level: Turbulence, rms_ft_s: float, model: TurbulenceModel, length_ft: float
) -> None:
    g = gust_scales(level, 3750.0 * FOOT, model)
    assert (g.sigma_u_m_s, g.sigma_w_m_s) == pytest.approx((rms_ft_s * FOOT, rms_ft_s * FOOT))
    assert (g.length_u_m, g.length_w_m) == pytest.approx((length_ft * FOOT, length_ft * FOOT))


@pytest.mark.parametrize("height_ft", [1000.0, 2000.0])
@pytest.mark.parametrize("model", MODELS)
def test_turbulence_has_no_step_between_its_layers(height_ft: float, model: TurbulenceModel) -> None:
    below, above = (gust_scales("severe", (height_ft + d) * FOOT, model) for d in (-1e-6, 1e-6))
    assert below.sigma_u_m_s == pytest.approx(above.sigma_u_m_s, rel=1e-6)
    assert below.length_w_m == pytest.approx(above.length_w_m, rel=1e-6)


def test_level_and_model_are_checked() -> None:
    with pytest.raises(ValueError, match="turbulence is 'heavy'; give one of none, light, moderate, severe"):
        gust_scales("heavy", 100.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="turbulence_model is 'kolmogorov'; give one of dryden, von-karman"):
        gust_scales("light", 100.0, "kolmogorov")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="turbulence_model is 'kolmogorov'"):
        Scenario(load_aircraft("aerosonde"), turbulence_model="kolmogorov")  # type: ignore[arg-type]


# the specification's spectra


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("height_m", [30.0, 1000.0])
def test_the_spectra_hold_the_variances(model: TurbulenceModel, height_m: float) -> None:
    g = gust_scales("light", height_m, model)
    for axis, sigma in ((0, g.sigma_u_m_s), (1, g.sigma_u_m_s), (2, g.sigma_w_m_s)):
        found = quad(
            lambda x, a=axis: math.exp(x) * gust_spectra(model, g, SPEED, SPAN, np.array([math.exp(x)]))[a, 0],
            -30.0, 40.0, limit=500,
        )[0]  # fmt: skip
        # 1.339 is Gamma(1/3) / (sqrt(pi) Gamma(5/6)) = 1.33898 to four digits
        assert found == pytest.approx(sigma**2, rel=2e-5 if model == "von-karman" else 1e-7)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("height_m", [30.0, 1000.0])
def test_mil_hdbk_1797_describes_the_same_air(model: TurbulenceModel, height_m: float) -> None:
    g = gust_scales("moderate", height_m, model)
    omega = np.geomspace(1e-3, 100.0, 50)
    # as MIL-HDBK-1797 writes them, with its lengths: L_u as before, L_v and L_w half of those of MIL-F-8785C
    lv, lw = g.length_u_m / 2.0, g.length_w_m / 2.0

    def across(sigma: float, length: float) -> Array:
        scale = 2.0 * sigma**2 * length / (math.pi * SPEED)
        if model == "dryden":
            x = (length * omega / SPEED) ** 2
            return np.asarray(scale * (1.0 + 12.0 * x) / (1.0 + 4.0 * x) ** 2)
        x = (2.678 * length * omega / SPEED) ** 2
        return np.asarray(scale * (1.0 + 8.0 / 3.0 * x) / (1.0 + x) ** (11.0 / 6.0))

    roll = g.sigma_w_m_s**2 / (2.0 * SPEED * lw) * 0.8 * (2.0 * math.pi * lw / (4.0 * SPAN)) ** (1.0 / 3.0)
    wanted = [
        across(g.sigma_u_m_s, lv),
        across(g.sigma_w_m_s, lw),
        roll / (1.0 + (4.0 * SPAN * omega / (math.pi * SPEED)) ** 2),
    ]
    np.testing.assert_allclose(gust_spectra(model, g, SPEED, SPAN, omega)[1:4], wanted, rtol=1e-12)


# the filters, without chance


def covariance(f: TurbulenceFilter, steps: int) -> Array:
    """Covariance of the air's motion now with that some steps ago."""
    later = np.linalg.matrix_power(f.transition, steps)
    return np.asarray(f.output @ later @ f.stationary @ f.stationary.T @ f.output.T)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("dt", [0.001, 0.01, 0.5])
@pytest.mark.parametrize("height_m", [1.0, 200.0, 3000.0])
def test_a_step_leaves_the_stationary_covariance_alone(
    model: TurbulenceModel, dt: float, height_m: float
) -> None:
    f = turbulence_filter("light", height_m, SPEED, SPAN, dt, model)
    stationary = f.stationary @ f.stationary.T
    after = f.transition @ stationary @ f.transition.T + f.input_gain @ f.input_gain.T
    np.testing.assert_allclose(after, stationary, rtol=1e-9, atol=1e-12 * np.abs(stationary).max())


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.5])
def test_dryden_s_filter_has_its_autocovariances_whatever_the_step(dt: float) -> None:
    g = gust_scales("light", 200.0)
    f = turbulence_filter("light", 200.0, SPEED, SPAN, dt)
    time_u, time_w = g.length_u_m / SPEED, g.length_w_m / SPEED
    for steps in (0, 1, 7, 100):
        lag = steps * dt
        found = covariance(f, steps)
        # autocorrelations that belong to Dryden's spectra (Etkin, Dynamics of Atmospheric Flight, chapter 13)
        assert found[0, 0] == pytest.approx(g.sigma_u_m_s**2 * math.exp(-lag / time_u), rel=1e-9)
        for axis, sigma, time in ((1, g.sigma_u_m_s, time_u), (2, g.sigma_w_m_s, time_w)):
            wanted = sigma**2 * math.exp(-lag / time) * (1.0 - 0.5 * lag / time)
            assert found[axis, axis] == pytest.approx(wanted, abs=1e-9 * sigma**2)


@pytest.mark.parametrize("model", MODELS)
def test_autocovariances_do_not_depend_on_the_step(model: TurbulenceModel) -> None:
    fine, coarse = (turbulence_filter("severe", 60.0, SPEED, SPAN, dt, model) for dt in (0.002, 0.1))
    size = np.sqrt(np.diagonal(covariance(coarse, 0)))
    for tenths in (0, 1, 5, 40):
        difference = covariance(fine, 50 * tenths) - covariance(coarse, tenths)
        assert np.abs(difference / np.outer(size, size)).max() < 1e-9


def folded(model: TurbulenceModel, g: GustScales, omega: Array, dt: float) -> tuple[Array, Array, Array]:
    """Spectra of the air sampled every ``dt``: the specification's with what aliasing folds onto it, and what the
    filter's may lie between, given its fit in its band and at most the specification beyond; each (6, frequencies)."""
    turn, terms = 2.0 * math.pi / dt, 4000
    at = np.abs(omega[:, None] + turn * np.arange(-terms, terms + 1)[None, :])
    spectra = gust_spectra(model, g, SPEED, SPAN, at.ravel()).reshape(6, *at.shape)
    # spectra that fall as a power: the terms left out are their integral
    edge = gust_spectra(model, g, SPEED, SPAN, np.array([1.0, 2.0]) * turn * (terms + 0.5))
    power = np.log2(edge[:, 0] / edge[:, 1])
    left = 2.0 * edge[:, 0] * (terms + 0.5) / (power - 1.0)
    whole = spectra.sum(axis=2) + left[:, None]
    length = max(g.length_u_m, g.length_w_m)
    inside = (spectra * (at * length / SPEED <= FIT_BAND)).sum(axis=2)
    error = FIT_ERROR[model]
    if model == "dryden":
        return whole, whole * (1.0 - 1e-4), whole * (1.0 + 1e-4)  # 1e-4: the integral for a sum, at its worst
    return whole, inside * (1.0 - error), whole * (1.0 + error)


def discrete_spectra(f: TurbulenceFilter, omega: Array, dt: float) -> Array:
    """One-sided spectra of what a filter gives, (6, frequencies)."""
    unit = np.eye(STATES)
    responses = [
        f.output @ np.linalg.solve(unit - f.transition * np.exp(-1j * w * dt), f.input_gain) for w in omega
    ]
    return np.asarray((np.abs(responses) ** 2).sum(axis=2).T * dt / math.pi)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("height_m", "dt"), [(30.0, 0.01), (1000.0, 0.01), (1000.0, 0.001)])
def test_the_filter_has_the_specification_s_spectra(
    model: TurbulenceModel, height_m: float, dt: float
) -> None:
    g = gust_scales("moderate", height_m, model)
    f = turbulence_filter("moderate", height_m, SPEED, SPAN, dt, model)
    omega = np.geomspace(1e-3, 0.9 * math.pi / dt, 60)
    _, low, high = folded(model, g, omega, dt)
    found = discrete_spectra(f, omega, dt)
    assert np.all(found > low), (found / low).min(axis=1)
    assert np.all(found < high), (found / high).max(axis=1)


def test_von_karman_s_fit_is_as_close_as_it_says() -> None:
    g = gust_scales("moderate", 1000.0, "von-karman")
    dt = 1e-5
    f = turbulence_filter("moderate", 1000.0, SPEED, SPAN, dt, "von-karman")
    omega = np.geomspace(1e-3, 1.0, 400) * FIT_BAND * SPEED / g.length_u_m
    # all but continuous: what folds onto the highest frequency is 2 zeta(5/3) (w dt / (2 pi))^(5/3) = 2e-5 of it
    found = discrete_spectra(f, omega, dt)
    error = np.abs(np.log(found / gust_spectra("von-karman", g, SPEED, SPAN, omega))).max(axis=1)
    assert error[0] < 0.0237
    assert error[1] < 0.0172
    assert error[2] < 0.0172
    assert error[0] > 0.02  # the statement is no better than the fit


@pytest.mark.parametrize("model", MODELS)
def test_an_updraught_that_grows_ahead_acts_as_a_pitch_rate_of_the_air(model: TurbulenceModel) -> None:
    now, before = (covariance(turbulence_filter("light", 1000.0, SPEED, SPAN, 0.1, model), k) for k in (0, 1))
    # what the vertical and the side gust gained in the step that led here, with the angular gusts now
    assert now[4, 2] - before[4, 2] < 0.0 < now[5, 1] - before[5, 1]


def test_still_air_has_no_gusts() -> None:
    f = turbulence_filter("none", 1000.0, SPEED, SPAN, 0.01)
    assert not f.input_gain.any()
    assert not f.stationary.any()


# the filters, with chance


@pytest.mark.parametrize("model", MODELS)
def test_the_kernel_is_the_filter(model: TurbulenceModel) -> None:
    f = turbulence_filter("severe", 100.0, SPEED, SPAN, 0.01, model)
    rng = np.random.default_rng(1)
    state, after = f.stationary @ rng.standard_normal(STATES), np.empty(6)
    kernel = state.copy()
    for normals in rng.standard_normal((50, NORMALS)):
        state = f.transition @ state + f.input_gain @ normals
        gust_step(f.row, kernel, normals, after, np.empty(6))
        np.testing.assert_allclose(kernel, state, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(after, f.output @ state, rtol=1e-11, atol=1e-12)


def record(f: TurbulenceFilter, steps: int, seed: int) -> Array:
    """The air's motion over some steps, shape (6, steps)."""
    return with_middles(f, steps, seed)[0]


def with_middles(f: TurbulenceFilter, steps: int, seed: int) -> tuple[Array, Array]:
    """The air's motion at the ends of some steps, and how far their middles lie from straight lines, (6, steps)."""
    rng = np.random.default_rng(seed)
    state, out, middle = (
        f.stationary @ rng.standard_normal(STATES),
        np.empty((steps, 6)),
        np.empty((steps, 6)),
    )
    for k, normals in enumerate(rng.standard_normal((steps, NORMALS))):
        gust_step(f.row, state, normals, out[k], middle[k])
    return out.T, middle.T


@pytest.mark.parametrize("model", MODELS)
def test_means_over_steps_are_those_of_air_drawn_finely(model: TurbulenceModel) -> None:
    """What moves the aircraft in a step: mean less the mean of both ends, beside a record 64 times as fine."""
    dt, finer, steps = 0.04, 64, 4000
    coarse, middles = with_middles(turbulence_filter("light", 30.0, SPEED, SPAN, dt, model), steps, 5)
    fine = record(turbulence_filter("light", 30.0, SPEED, SPAN, dt / finer, model), steps * finer + 1, 6)
    paths = np.stack([fine[:, k : k + steps * finer : finer] for k in range(finer)])
    ends = np.stack([fine[:, : steps * finer : finer], fine[:, finer::finer]])
    drawn = paths[1:].mean(axis=0) * (finer - 1) / finer + ends.mean(axis=0) / finer - ends.mean(axis=0)
    given = 2.0 / 3.0 * middles
    rough = [1, 2, 3, 4, 5]  # all but u, which is taken straight
    # the scatter of a variance from 4000 values is 2.2 %; the finer record's own lines lack 1/64
    np.testing.assert_allclose(given[rough].var(axis=1), drawn[rough].var(axis=1), rtol=0.15)
    # and they go with the gains of the steps beside them, and with each other, as the finer record's do
    gains, gains_drawn = np.diff(coarse, axis=1), np.diff(ends[0], axis=1)
    for lag in (0, 1):
        ours = [np.corrcoef(given[j, 1 : steps - 1], gains[j, lag : steps - 2 + lag])[0, 1] for j in rough]
        theirs = [
            np.corrcoef(drawn[j, : steps - 2], gains_drawn[j, lag : steps - 2 + lag])[0, 1] for j in rough
        ]
        np.testing.assert_allclose(ours, theirs, atol=5.0 * math.sqrt(2.0 / steps))
    turns = np.corrcoef(given[1], given[5])[0, 1], np.corrcoef(drawn[1], drawn[5])[0, 1]
    assert turns[0] == pytest.approx(turns[1], abs=0.02)


def expected_periodogram(model: TurbulenceModel, g: GustScales, taper: Array, dt: float) -> Array:
    """Mean of the tapered periodogram: the folded spectrum seen through the taper, (6, bins)."""
    n = 16 * taper.size
    omega = np.asarray(2.0 * math.pi * np.arange(n // 2 + 1) / (n * dt), dtype=np.float64)
    correlation = np.fft.irfft(folded_on_a_grid(model, g, omega, dt), axis=1)
    window = np.fft.irfft(np.abs(np.fft.rfft(taper, n)) ** 2) / (taper**2).sum()
    fine = np.fft.rfft(correlation * window, axis=1).real
    return fine[:, :: n // taper.size]


def folded_on_a_grid(model: TurbulenceModel, g: GustScales, omega: Array, dt: float) -> Array:
    """``folded`` at few frequencies, between them by the ratio to the spectrum itself, which changes slowly."""
    few = np.linspace(0.0, math.pi / dt, 129)
    few[0] = 1e-9
    direct = gust_spectra(model, g, SPEED, SPAN, few)
    excess = folded(model, g, few, dt)[0] - direct
    return np.asarray(
        gust_spectra(model, g, SPEED, SPAN, omega) + np.array([np.interp(omega, few, e) for e in excess])
    )


@pytest.mark.parametrize(
    ("model", "height_m"), [("dryden", 1000.0), ("dryden", 50.0), ("von-karman", 1000.0)]
)
def test_a_long_record_has_the_specification_s_spectra(model: TurbulenceModel, height_m: float) -> None:
    dt, size, segments = 0.02, 8192, 32
    g = gust_scales("light", height_m, model)
    f = turbulence_filter("light", height_m, SPEED, SPAN, dt, model)
    pieces = record(f, size * segments, seed=11).reshape(6, segments, size)
    taper = np.hanning(size + 1)[:size]
    measured = (np.abs(np.fft.rfft(pieces * taper, axis=2)) ** 2).mean(axis=1)
    measured *= dt / math.pi / (taper**2).sum()
    ratio = measured / expected_periodogram(model, g, taper, dt)
    # Hann's taper leaves bins three apart uncorrelated, so each bin's mean over the segments is chi-square with two
    # degrees of freedom a segment, and so is the sum over every third bin of a band with as many more
    edges = np.unique(np.geomspace(3, size // 2, 13).astype(int))
    chance = 1e-4 / (6 * (edges.size - 1))
    for low, high in itertools.pairwise(edges):
        bins = np.arange(low, high, 3)
        freedom = 2 * segments * bins.size
        below = float(chi2.ppf(chance / 2.0, freedom)) / freedom
        above = float(chi2.isf(chance / 2.0, freedom)) / freedom
        omega = 2.0 * math.pi * bins / (size * dt)
        whole, least, most = folded(model, g, omega, dt)
        for axis in range(6):
            found = float(ratio[axis, bins].mean())
            assert found > below * float((least / whole)[axis].min()), (axis, omega[0], found)
            assert found < above * float((most / whole)[axis].max()), (axis, omega[0], found)


# discrete gusts


def gust_at(gusts: tuple[DiscreteGust, ...], time_s: float, speed: float = 20.0) -> Array:
    out = np.zeros(6)
    rows = gust_rows(gusts, speed)
    add_discrete_gusts(rows, len(rows), time_s, out)
    return out


def test_a_gust_rises_as_one_minus_cosine_and_stays() -> None:
    gust = (DiscreteGust("w", -3.0, 40.0, start_s=5.0),)
    # 20 m/s into 40 m: it has grown after 2 s
    assert [gust_at(gust, t)[2] for t in (4.99, 5.0, 5.5, 6.0, 7.0, 60.0)] == pytest.approx(
        [0.0, 0.0, -1.5 * (1.0 - math.sqrt(0.5)), -1.5, -3.0, -3.0]
    )


def test_a_pulse_comes_and_goes() -> None:
    gust = (DiscreteGust("u", 4.0, 10.0, start_s=1.0, shape="pulse"),)
    values = [gust_at(gust, t)[0] for t in (1.0, 1.25, 1.5, 1.75, 2.0, 9.0)]
    assert values == pytest.approx([0.0, 2.0, 4.0, 2.0, 0.0, 0.0], abs=1e-12)


def test_a_step_is_there_at_once() -> None:
    gust = (DiscreteGust("v", 2.0, 1.0, start_s=3.0, shape="step"),)
    np.testing.assert_array_equal(gust_at(gust, 2.999), 0.0)
    np.testing.assert_array_equal(gust_at(gust, 3.0), [0.0, 2.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(("axis", "column", "rate", "sign"), [("w", 2, 4, -1.0), ("v", 1, 5, 1.0)])
def test_a_gust_s_gradient_turns_as_turbulence_does(axis: str, column: int, rate: int, sign: float) -> None:
    gust = (DiscreteGust(axis, 3.0, 40.0, 0.0, "pulse"),)  # type: ignore[arg-type]
    h = 1e-5
    for t in (0.3, 1.0, 1.9, 2.5, 3.9):
        slope = (gust_at(gust, t + h)[column] - gust_at(gust, t - h)[column]) / (2.0 * h)
        # the central difference errs by h^2 / 6 of the third derivative, and by rounding
        assert gust_at(gust, t)[rate] == pytest.approx(sign * slope / 20.0, abs=1e-9)
    np.testing.assert_array_equal(np.delete(gust_at(gust, 1.0), [column, rate]), 0.0)


def test_gusts_add_up_to_what_is_there() -> None:
    one, other = DiscreteGust("u", 1.0, 10.0, 0.0), DiscreteGust("u", 2.0, 10.0, 0.0, "step")
    out = np.full(6, 0.5)
    rows = np.concatenate(
        [gust_rows((one, other), 20.0), np.zeros((2, 6))]
    )  # a longer table of another vehicle
    add_discrete_gusts(rows, 2, 10.0, out)
    np.testing.assert_array_equal(out, [3.5, 0.5, 0.5, 0.5, 0.5, 0.5])
    assert gust_rows((), 20.0).shape == (0, 6)


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: DiscreteGust("x", 1.0, 10.0, 0.0), "a gust along 'x'.*; give one of u, v, w"),  # type: ignore[arg-type]
        (lambda: DiscreteGust("u", 1.0, 10.0, 0.0, "ramp"), "shape 'ramp'; give one of rise, pulse, step"),  # type: ignore[arg-type]
        (lambda: DiscreteGust("u", math.inf, 10.0, 0.0), "amplitude inf m/s"),
        (lambda: DiscreteGust("u", 1.0, 0.0, 0.0), "grows over 0.0 m; give a positive length"),
        (lambda: DiscreteGust("u", 1.0, 10.0, -1.0), "starts at -1.0 s"),
        (lambda: WindProfile("sea"), "boundary_layer is 'sea'; give one of none, terminal, other"),  # type: ignore[arg-type]
        (lambda: WindProfile(shear_per_s=(0.1, math.nan)), "give two finite numbers, north and east"),
        (lambda: WindProfile(veer_rad_m=math.inf), "veer_rad_m is inf"),
        (lambda: WindProfile("other", (0.1, 0.0)), "and boundary_layer 'other'; give one of the two"),
        (
            lambda: Scenario(load_aircraft("aerosonde"), ground_altitude_m=math.nan),
            "ground_altitude_m is nan",
        ),
    ],
)
def test_air_that_makes_no_sense_is_refused(build: Callable[[], object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        build()


# wind


def wind(altitude_m: float, profile: WindProfile, ground_m: float = 0.0) -> Array:
    scenario = Scenario(
        load_aircraft("aerosonde"), altitude_m=1000.0, wind_m_s=(6.0, -8.0, 0.5), wind_profile=profile,
        ground_altitude_m=ground_m,
    )  # fmt: skip
    out = np.empty(3)
    row = wind_row(scenario.wind_profile, scenario.wind_m_s, scenario.altitude_m, scenario.ground_altitude_m)
    wind_at(row, altitude_m, out)
    return out


def test_wind_is_the_same_everywhere_unless_told() -> None:
    for altitude in (-100.0, 0.0, 1000.0, 9000.0):
        np.testing.assert_array_equal(wind(altitude, WindProfile()), [6.0, -8.0, 0.5])


@pytest.mark.parametrize(("layer", "roughness_ft"), [("terminal", 0.15), ("other", 2.0)])
@pytest.mark.parametrize("ground_m", [0.0, 350.0])
def test_the_boundary_layer_is_logarithmic(layer: str, roughness_ft: float, ground_m: float) -> None:
    profile = WindProfile(layer)  # type: ignore[arg-type]
    np.testing.assert_allclose(wind(ground_m + 20.0 * FOOT, profile, ground_m), [6.0, -8.0, 0.5], rtol=1e-12)
    for height_ft in (3.0, 50.0, 400.0, 1000.0):
        share = math.log(height_ft / roughness_ft) / math.log(20.0 / roughness_ft)
        np.testing.assert_allclose(
            wind(ground_m + height_ft * FOOT, profile, ground_m), [6.0 * share, -8.0 * share, 0.5], rtol=1e-9
        )
    for inside, outside in ((3.0, -5.0), (1000.0, 8000.0)):
        np.testing.assert_allclose(
            wind(ground_m + outside * FOOT, profile, ground_m),
            wind(ground_m + inside * FOOT, profile, ground_m),
            rtol=1e-9,
        )


def test_a_shear_is_a_gradient_about_the_scenario_s_altitude() -> None:
    profile = WindProfile(shear_per_s=(0.01, -0.02))
    np.testing.assert_allclose(wind(1000.0, profile), [6.0, -8.0, 0.5])
    np.testing.assert_allclose(wind(1100.0, profile), [7.0, -10.0, 0.5])
    np.testing.assert_allclose(wind(900.0, profile), [5.0, -6.0, 0.5])


def test_a_wind_that_veers_turns_clockwise_with_height() -> None:
    north, east, down = wind(1000.0 + 90.0, WindProfile(veer_rad_m=math.radians(1.0)))
    # a quarter turn to the right: what blew north blows east
    np.testing.assert_allclose([north, east, down], [8.0, 6.0, 0.5], atol=1e-12)


# from level axes along the path to body axes


def flying(roll_rad: float, pitch_rad: float, heading_rad: float) -> Array:
    """A rigid-body state whose velocity lies along body x."""
    state = np.zeros(13)
    state[3], state[6:10] = SPEED, quaternion(roll_rad, pitch_rad, heading_rad)
    return state


@pytest.mark.parametrize(
    ("roll_deg", "expected"),
    [(0.0, (1.0, 2.0, 3.0)), (90.0, (1.0, 3.0, -2.0)), (180.0, (1.0, -2.0, -3.0)), (-90.0, (1.0, -3.0, 2.0))],
)
def test_a_gust_stays_with_the_air_when_the_aircraft_banks(
    roll_deg: float, expected: tuple[float, float, float]
) -> None:
    motion = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    in_body_axes(flying(math.radians(roll_deg), 0.0, 2.0), motion)
    np.testing.assert_allclose(motion[:3], expected, atol=1e-12)
    np.testing.assert_array_equal(motion[3:], [0.1, 0.2, 0.3])  # rates are those of body axes already


@pytest.mark.parametrize("pitch_deg", [0.0, 30.0, 90.0, -90.0])
def test_a_turn_of_axes_keeps_a_gust_s_size(pitch_deg: float) -> None:
    motion = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
    in_body_axes(flying(0.4, math.radians(pitch_deg), 2.0), motion)
    assert np.linalg.norm(motion[:3]) == pytest.approx(math.sqrt(14.0))
