"""Pieces of filter error, each beside an independent computation."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray
from reference_plant import PLANTS
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_discrete_lyapunov
from situation_cases import CONDITIONS, SITUATIONS
from situation_plants import Situation, fly_situation
from situations import whole_manoeuvres

from wingwatch.estimators.offline.filter_error import FilterErrorConfig, problem_of
from wingwatch.estimators.offline.innovations import Trace, empty_trace, innovations
from wingwatch.estimators.offline.likelihood import Problem, evaluate, sensitivities
from wingwatch.estimators.offline.scoring import solve
from wingwatch.estimators.offline.surface import at_rest
from wingwatch.estimators.plant.discretisation import discretise, stationary_covariance

Array = NDArray[np.float64]

SHORT = PLANTS[0]
NOISY_SURFACE = CONDITIONS["still, autopilot, each 10 s, surface noise, on a line"]


def problem(case: Situation, seconds: float = 12.0) -> Problem:
    flight = fly_situation(SHORT, case, 0, seconds)
    config = FilterErrorConfig(vane_ahead_m=flight.known.vane_ahead_m)
    return problem_of(whole_manoeuvres(flight), config, flight.known.start, flight.known.natural)


@pytest.mark.parametrize("stiffness", [1.0, 200.0])
def test_discretisation_is_the_matrix_exponential(stiffness: float) -> None:
    rng = np.random.default_rng(3)
    n, m, h = 5, 2, 0.02
    a = rng.standard_normal((n, n)) - 2.0 * np.eye(n)
    a[4, 4] = -stiffness
    b, root = rng.standard_normal((n, m)), rng.standard_normal((n, n))
    w = root @ root.T
    f, early, late, q = discretise(a, b, w, h)
    # Van Loan (1978) for Q; a line between samples as an input that integrates a constant
    large = np.zeros((2 * n, 2 * n))
    large[:n, :n], large[:n, n:], large[n:, n:] = -a, w, a.T
    block = expm(large * h)
    np.testing.assert_allclose(f, expm(a * h), rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(q, f @ block[:n, n:], rtol=1e-10, atol=1e-13)
    chain = np.zeros((n + 2 * m, n + 2 * m))
    chain[:n, :n], chain[:n, n : n + m], chain[n : n + m, n + m :] = a, b, np.eye(m)
    whole = expm(chain * h)
    np.testing.assert_allclose(late, whole[:n, n + m :] / h, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(early, whole[:n, n : n + m] - whole[:n, n + m :] / h, rtol=0.0, atol=1e-13)


def test_a_line_between_samples_is_integrated() -> None:
    a = np.array([[-1.0, 3.0], [-4.0, -2.0]])
    b = np.array([[1.0], [-2.0]])
    f, early, late, _ = discretise(a, b, np.zeros((2, 2)), 0.1)
    x0, u0, u1 = np.array([0.3, -0.2]), 0.4, -0.7
    there = solve_ivp(
        lambda t, x: a @ x + b[:, 0] * (u0 + (u1 - u0) * t / 0.1), (0.0, 0.1), x0, rtol=1e-11, atol=1e-12
    ).y[:, -1]
    np.testing.assert_allclose(f @ x0 + early[:, 0] * u0 + late[:, 0] * u1, there, atol=1e-9)


def test_stationary_covariance_is_lyapunovs() -> None:
    f = np.array([[0.99, 0.02], [0.0, 0.9]])
    q = np.array([[0.1, 0.02], [0.02, 0.3]])
    np.testing.assert_allclose(stationary_covariance(f, q), solve_discrete_lyapunov(f, q), rtol=1e-10)


def test_innovations_are_those_of_filterpy() -> None:
    made = problem(SITUATIONS["moderate, vane 0.3 m ahead, autopilot"])
    window = made.windows[0]
    p = made.prior.start
    system = made.model.system(p, window)
    record = made.model.record(window, np.zeros(5))
    trace = empty_trace(len(window), 3, system.covariance.shape[0])
    innovations(system, record, trace, False)
    peer = KalmanFilter(dim_x=system.covariance.shape[0], dim_z=1)
    peer.x, peer.P = record.state.copy(), system.covariance.copy()
    f, q = system.transition[0], system.noise[0]
    found = np.zeros((200, 3, 2))
    for t in range(200):
        if t:
            peer.x = f @ peer.x
            peer.x[:2] += system.early[0] @ record.start[t - 1] + system.late[0] @ record.end[t - 1]
            peer.P = f @ peer.P @ f.T + q
        for c in range(3):
            peer.update(
                np.array([record.readings[t, c] - system.direct[c] @ record.start[t]]),
                R=np.array([[system.variance[c]]]), H=system.output[0, c][None],
            )  # fmt: skip
            found[t, c] = peer.y.item(), peer.S.item()
    np.testing.assert_allclose(trace.variances[:200], found[:, :, 1], rtol=1e-9)
    np.testing.assert_allclose(trace.innovations[:200], found[:, :, 0], rtol=1e-9, atol=1e-12)


def test_settled_gains_are_those_that_would_have_come() -> None:
    made = problem(SITUATIONS["moderate, autopilot"], seconds=30.0)
    window, p = made.windows[0], made.prior.start
    system, record = made.model.system(p, window), made.model.record(window, np.zeros(5))
    kept, renewed = (empty_trace(len(window), 3, system.covariance.shape[0]) for _ in range(2))
    innovations(system, record, kept, True)
    innovations(system, record, renewed, False)
    assert not kept.renewed.all()
    np.testing.assert_allclose(kept.variances, renewed.variances, rtol=1e-4)
    error = np.abs(kept.innovations - renewed.innovations) / np.sqrt(renewed.variances)
    assert error.max() < 1e-3


def test_a_missing_reading_opens_the_gain_again() -> None:
    made = problem(SITUATIONS["moderate, autopilot"], seconds=30.0)
    window, p = made.windows[0], made.prior.start
    window.used[-10] = False
    system, record = made.model.system(p, window), made.model.record(window, np.zeros(5))
    trace: Trace = empty_trace(len(window), 3, system.covariance.shape[0])
    innovations(system, record, trace, True)
    assert trace.renewed[-10:].all()
    assert not trace.innovations[-10].any()
    assert trace.variances[-9, 0] > trace.variances[-11, 0]


@pytest.mark.parametrize(
    "case", [SITUATIONS["moderate, autopilot"], NOISY_SURFACE], ids=["rough air", "noisy surface"]
)
def test_the_score_is_the_gradient_of_the_cost(case: Situation) -> None:
    made = problem(case)
    p = made.prior.start.copy()
    point = evaluate(made, p)
    assert point is not None
    found = (made.prior.mean - p) / made.prior.std**2
    for m in range(len(made.windows)):
        s = sensitivities(made, point, m)
        found = found + s.score().sum(axis=1) + s.surface_noise_score
    for i in range(p.size):
        h = 10.0 * made.prior.step[i]
        ends = []
        for sign in (-1.0, 1.0):
            moved = p.copy()
            moved[i] += sign * h
            there = evaluate(made, moved)
            assert there is not None
            ends.append(there.cost)
        gradient = -(ends[1] - ends[0]) / (2.0 * h)
        assert found[i] == pytest.approx(gradient, rel=0.02, abs=0.02 * np.abs(found).max() ** 0.5)


def test_the_gate_keeps_gusts_that_are_there_and_no_others() -> None:
    still, rough = (
        solve(problem(SITUATIONS["still, open, each 5 s"])),
        solve(problem(SITUATIONS["light, autopilot"])),
    )
    assert still is not None
    assert rough is not None
    assert not still.gusts
    assert rough.gusts


def test_levels_follow_a_changing_airspeed() -> None:
    flight = fly_situation(SHORT, SITUATIONS["still, open, each 5 s"], 0, 12.0)
    (part,) = whole_manoeuvres(flight)
    slow = replace(part, stability=np.linspace(0.9, 1.1, len(part)))
    made = problem_of([slow], FilterErrorConfig(), flight.known.start, flight.known.natural)
    (window,) = made.windows
    assert window.levels.size == 6
    assert np.abs(window.levels[window.level] - slow.stability).max() < 0.021
    assert evaluate(made, made.prior.start) is not None


def test_surfaces_at_rest_lose_their_noise_and_keep_their_movement() -> None:
    rng = np.random.default_rng(1)
    clean = np.zeros(1000)
    clean[400:420] = 0.03
    clean[600:] = -0.01
    noisy = clean + 0.001 * rng.standard_normal(1000)
    quiet = at_rest(noisy, 0.02, 0.001)
    assert quiet[:380].std() < 1e-12
    assert abs(quiet[100]) < 0.0002
    assert abs(quiet[800] + 0.01) < 0.0002
    np.testing.assert_array_equal(quiet[398:422], noisy[398:422])
    np.testing.assert_array_equal(at_rest(noisy, 0.02, 0.0), noisy)
    drifting = np.linspace(0.0, 0.02, 1000) + 0.001 * rng.standard_normal(1000)
    np.testing.assert_array_equal(at_rest(drifting, 0.02, 0.001), drifting)
