"""Actuators, turbulence, manoeuvres: each against its own equation."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation import (
    Doublet,
    DoubletSchedule,
    Manoeuvre,
    ThreeTwoOneOne,
    Turbulence,
    doublet_pulse_s,
    doublet_schedule,
    step_3211_s,
)
from wingwatch.simulation.actuators import actuator_position
from wingwatch.simulation.manoeuvres import excitation, pulse_rows
from wingwatch.simulation.turbulence import STATES, gust_scales, step_gust, turbulence_filter

FOOT, KNOT = 0.3048, 1852.0 / 3600.0


# actuators


@pytest.mark.parametrize("command", [0.05, -0.3, 0.9])
@pytest.mark.parametrize("after", [0.0, 0.01, 0.08, 0.5])
def test_an_actuator_follows_its_equation(command: float, after: float) -> None:
    bandwidth, rate_limit, limit, start = 50.0, 3.5, 0.4, 0.1
    target = max(-limit, min(limit, command))
    x, steps = start, 20_000
    for _ in range(steps):
        x += after / steps * max(-rate_limit, min(rate_limit, bandwidth * (target - x)))
    # Euler's method errs by half a step of the largest curvature: rate_limit x bandwidth x after x (after / steps) / 2
    worst = 0.5 * rate_limit * bandwidth * after * after / steps + 1e-12
    assert actuator_position(start, command, bandwidth, rate_limit, limit, after) == pytest.approx(
        x, abs=worst
    )


def test_an_ideal_actuator_is_where_it_is_told() -> None:
    assert actuator_position(0.1, 0.3, math.inf, math.inf, math.inf, 0.0) == 0.3
    assert actuator_position(0.1, 0.5, math.inf, math.inf, 0.4, 0.01) == 0.4
    assert actuator_position(0.1, 0.5, math.inf, 2.0, math.inf, 0.01) == pytest.approx(0.12, abs=1e-15)


def test_half_a_step_twice_is_a_step() -> None:
    once = actuator_position(0.0, 0.3, 50.0, 3.5, 0.39, 0.12)
    half = actuator_position(0.0, 0.3, 50.0, 3.5, 0.39, 0.06)
    assert actuator_position(half, 0.3, 50.0, 3.5, 0.39, 0.06) == pytest.approx(once, rel=1e-12)


# turbulence


def test_low_altitude_turbulence_is_that_of_the_specification() -> None:
    g = gust_scales("moderate", 500.0 * FOOT)
    assert g.sigma_w_m_s == pytest.approx(3.0 * KNOT)  # a tenth of 30 knots
    assert g.length_w_m == pytest.approx(500.0 * FOOT)
    shape = 0.177 + 0.000823 * 500.0
    assert g.sigma_u_m_s == pytest.approx(3.0 * KNOT / shape**0.4)
    assert g.length_u_m == pytest.approx(500.0 / shape**1.2 * FOOT)


@pytest.mark.parametrize(("level", "rms_ft_s"), [("light", 7.4), ("moderate", 10.6), ("severe", 23.0)])
def test_medium_altitude_turbulence_is_that_of_figure_7(level: Turbulence, rms_ft_s: float) -> None:
    g = gust_scales(level, 3750.0 * FOOT)
    assert (g.sigma_u_m_s, g.sigma_w_m_s) == pytest.approx((rms_ft_s * FOOT, rms_ft_s * FOOT))
    assert (g.length_u_m, g.length_w_m) == pytest.approx((1750.0 * FOOT, 1750.0 * FOOT))


@pytest.mark.parametrize("height_ft", [1000.0, 2000.0])
def test_turbulence_has_no_step_between_its_layers(height_ft: float) -> None:
    below, above = (gust_scales("severe", (height_ft + d) * FOOT) for d in (-1e-6, 1e-6))
    assert below.sigma_u_m_s == pytest.approx(above.sigma_u_m_s, rel=1e-6)
    assert below.length_w_m == pytest.approx(above.length_w_m, rel=1e-6)


def test_the_level_is_checked() -> None:
    with pytest.raises(ValueError, match="turbulence is 'heavy'; give one of none, light, moderate, severe"):
        gust_scales("heavy", 100.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("dt", [0.001, 0.005, 0.5])
def test_the_discrete_filter_has_dryden_statistics_whatever_its_step(dt: float) -> None:
    speed, span = 25.0, 2.9
    g = gust_scales("light", 200.0)
    f = turbulence_filter("light", 200.0, speed, span, dt)
    stationary = f.stationary @ f.stationary.T
    # one step leaves the stationary covariance alone: transition and added covariance belong together
    after = f.transition @ stationary @ f.transition.T + f.input_gain @ f.input_gain.T
    np.testing.assert_allclose(after, stationary, rtol=1e-7, atol=1e-9 * np.abs(stationary).max())
    now = f.output @ stationary @ f.output.T
    later = f.output @ f.transition @ stationary @ f.output.T
    time_u, time_w = g.length_u_m / speed, g.length_w_m / speed
    # autocorrelations that belong to Dryden's spectra (Etkin, Dynamics of Atmospheric Flight, chapter 13)
    assert now[0, 0] == pytest.approx(g.sigma_u_m_s**2, rel=1e-9)
    assert later[0, 0] == pytest.approx(g.sigma_u_m_s**2 * math.exp(-dt / time_u), rel=1e-8)
    for axis, sigma, scale in ((1, g.sigma_u_m_s, time_u), (2, g.sigma_w_m_s, time_w)):
        assert now[axis, axis] == pytest.approx(sigma**2, rel=1e-9)
        wanted = sigma**2 * math.exp(-dt / scale) * (1.0 - 0.5 * dt / scale)
        assert later[axis, axis] == pytest.approx(wanted, rel=1e-7, abs=1e-8 * sigma**2)


def test_angular_gusts_have_the_spectra_of_the_specification() -> None:
    speed, span = 25.0, 2.9
    g = gust_scales("moderate", 1000.0)
    f = turbulence_filter("moderate", 1000.0, speed, span, 0.005)
    variance = np.diagonal(f.output @ f.stationary @ f.stationary.T @ f.output.T)
    lw, tw = g.length_w_m, g.length_w_m / speed

    def roll(w: float) -> float:
        top = 0.8 * (math.pi * lw / (4.0 * span)) ** (1.0 / 3.0)
        return float(
            g.sigma_w_m_s**2 / (speed * lw) * top / (1.0 + (4.0 * span * w / (math.pi * speed)) ** 2)
        )

    def gradient(w: float, sigma: float, lag: float) -> float:
        dryden = sigma**2 * tw / math.pi * (1.0 + 3.0 * (tw * w) ** 2) / (1.0 + (tw * w) ** 2) ** 2
        return (w / speed) ** 2 / (1.0 + (lag * w) ** 2) * dryden

    lags = 4.0 * span / (math.pi * speed), 3.0 * span / (math.pi * speed)
    wanted = [
        quad(roll, 0.0, np.inf)[0],
        quad(gradient, 0.0, np.inf, args=(g.sigma_w_m_s, lags[0]), limit=500)[0],
        quad(gradient, 0.0, np.inf, args=(g.sigma_u_m_s, lags[1]), limit=500)[0],
    ]
    assert variance[3:] == pytest.approx(wanted, rel=1e-5)


def test_an_updraught_that_grows_ahead_acts_as_a_pitch_rate_of_the_air() -> None:
    f = turbulence_filter("light", 1000.0, 25.0, 2.9, 0.1)
    stationary = f.stationary @ f.stationary.T
    # covariance of the angular gust now with what the gust gained in the step that led here
    gained = (np.eye(STATES) - f.transition) @ stationary @ f.output.T
    with_w, with_v = float(f.output[4] @ gained[:, 2]), float(f.output[5] @ gained[:, 1])
    assert with_w < 0.0 < with_v


def test_a_long_gust_record_has_its_variance() -> None:
    speed, dt = 25.0, 0.02
    f = turbulence_filter("light", 50.0, speed, 2.9, dt)
    g = gust_scales("light", 50.0)
    rng = np.random.default_rng(5)
    n = 200_000
    state, after, record = f.stationary @ rng.standard_normal(STATES), np.empty(6), np.empty((n, 6))
    for k, normals in enumerate(rng.standard_normal((n, STATES))):
        step_gust(f.transition, f.input_gain, f.output, state, normals, after)
        record[k] = after
    wanted = np.diagonal(f.output @ f.stationary @ f.stationary.T @ f.output.T)
    # the square of a process that forgets in T has n dt / T independent values: 4 standard errors of sqrt(2 T / (n dt))
    slowest = g.length_u_m / speed
    np.testing.assert_allclose(record.var(axis=0), wanted, rtol=4.0 * math.sqrt(2.0 * slowest / (n * dt)))


# manoeuvres


def deflections(manoeuvres: tuple[Manoeuvre, ...], times: list[float]) -> list[tuple[float, ...]]:
    rows, out = pulse_rows(manoeuvres), np.empty(3)
    result: list[tuple[float, ...]] = []
    for t in times:
        excitation(rows, len(rows), t, out)
        result.append(tuple(float(v) for v in out))
    return result


def test_a_doublet_is_a_pulse_up_and_a_pulse_down() -> None:
    doublet = Doublet("elevator", 0.03, 0.2, 1.0)
    elevator = [d[0] for d in deflections((doublet,), [0.9, 1.0, 1.19, 1.21, 1.39, 1.41, 100.0])]
    assert elevator == [0.0, 0.03, 0.03, -0.03, -0.03, 0.0, 0.0]


def test_a_3211_has_steps_of_three_two_one_and_one() -> None:
    manoeuvre = ThreeTwoOneOne("rudder", 0.1, 1.0, 0.0)
    rudder = [d[2] for d in deflections((manoeuvre,), [0.0, 2.9, 3.1, 4.9, 5.1, 5.9, 6.1, 6.9, 7.1])]
    assert rudder == [0.1, 0.1, -0.1, -0.1, 0.1, 0.1, -0.1, -0.1, 0.0]


def test_pulse_widths_are_those_of_the_thesis() -> None:
    # thesis table 7.1: 0.2018 s for a short period of 11.4 rad/s, 0.3846 s for a Dutch roll of 5.98 rad/s
    assert doublet_pulse_s(11.397) == pytest.approx(0.2018, abs=5e-5)
    assert step_3211_s(1.6) == 1.0


def test_a_schedule_repeats_elevator_aileron_rudder() -> None:
    schedule = doublet_schedule(load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0), 0.02)
    assert schedule.surfaces == ("elevator", "aileron", "rudder")
    assert schedule.pulses_s[0] == pytest.approx(2.3 / 10.19, rel=0.01)
    for start in (5.0, 25.0, 1005.0):
        for i in range(3):
            at = deflections((schedule,), [start + 4.0 * i + 0.01])[0]
            assert at == tuple(0.02 if j == i else 0.0 for j in range(3))
    assert deflections((schedule,), [0.0, 4.99, 18.0, 24.9]) == [(0.0, 0.0, 0.0)] * 4


def test_manoeuvres_add_up() -> None:
    both = (Doublet("aileron", 0.1, 1.0, 0.0), Doublet("aileron", 0.02, 2.0, 0.0))
    assert deflections(both, [0.5, 1.5])[0][1] == pytest.approx(0.12)
    assert deflections(both, [0.5, 1.5])[1][1] == pytest.approx(-0.08)


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: Doublet("flap", 0.1, 0.2, 0.0), "surface 'flap'; give one of elevator, aileron, rudder"),  # type: ignore[arg-type]
        (lambda: Doublet("elevator", 2.0, 0.2, 0.0), "amplitude 2.0 rad"),
        (lambda: ThreeTwoOneOne("rudder", 0.1, 0.0, 0.0), "pulses of 0.0 s"),
        (lambda: Doublet("rudder", 0.1, 0.1, math.nan), "starts at nan s"),
        (lambda: DoubletSchedule(("rudder",), (0.1, 0.1), (0.1,)), "give one of each a surface"),
        (lambda: DoubletSchedule(("rudder",), (0.1,), (6.0,), period_s=10.0), "one round takes 12 s"),
    ],
)
def test_manoeuvres_that_make_no_sense_are_refused(build: object, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        build()  # type: ignore[operator]
