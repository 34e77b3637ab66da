"""Signals between their samples: the Fourier estimator's transforms against those of the motion itself."""

from functools import cache

import numpy as np
import pytest
from estimator_kernels import PITCH_MODEL, as_complex, curves_of, new_filters, rows_before, transforms_of
from numpy.typing import NDArray

from wingwatch.estimators.fourier.air import air_channels
from wingwatch.estimators.fourier.bank import advance_bank, bank_channels
from wingwatch.estimators.fourier.state import Prior
from wingwatch.estimators.kernels.intersample import Servos

Array = NDArray[np.float64]

OMEGA: Array = np.asarray(2.0 * np.pi * np.arange(1, 31) / 10.0, dtype=np.float64)
STEP_S, FINE, SPAN_S = 0.02, 200, 10.0
A = np.array([[-4.0, 24.0], [-4.3, -6.0]])
B = np.array([-2.4, -32.0])
FORWARD = np.array([0.0, 25.0])
THETA = np.array([A[0, 0], A[0, 1] - FORWARD[1], B[0], A[1, 0], A[1, 1], B[1]])
"""Aerodynamic derivatives (z_w z_q z_u m_w m_q m_u); the force is seen by an accelerometer."""


def flight(command: Array, servo_s: float) -> tuple[Array, Array, Array]:
    """Time, states (n, 2), surface and rates (n, 2) of a flight in fine steps, by the fourth-order Runge-Kutta method.

    ``command``: one value a sample, held to the next; the surface follows it at once if ``servo_s`` is 0. The motion is
    linear, so that a step of the method is a matrix, and as many as lie between two samples are its powers.
    """
    h = STEP_S / FINE
    z, rate = (
        np.zeros((4, command.size, FINE)),
        np.zeros((4, 4)),
    )  # of both states, the surface, and what is held
    rate[:2, :2] = A
    rate[:2, 2 if servo_s > 0.0 else 3] = B
    if servo_s > 0.0:
        rate[2, 2:] = -1.0 / servo_s, 1.0 / servo_s
    step = np.eye(4)
    for order in (4, 3, 2, 1):
        step = np.eye(4) + (h / order) * rate @ step
    powers = np.array([np.linalg.matrix_power(step, k) for k in range(FINE + 1)])
    x: Array = np.zeros(4)
    for k, held in enumerate(command):
        x[3] = held
        between = powers @ x
        z[:, k], x = between[:-1].T, between[-1]
    rows = z.reshape(4, -1)[:, : (command.size - 1) * FINE + 1]
    return h * np.arange(rows.shape[1], dtype=np.float64), rows[:2].T, rows[2 if servo_s > 0.0 else 3]


@cache
def trapezoid(steps: int) -> NDArray[np.complex128]:
    """What integrates x(t) exp(j w (T - t)) over so many fine steps."""
    time = STEP_S / FINE * np.arange(steps + 1)
    weights = np.asarray(STEP_S / FINE * np.exp(1j * OMEGA[:, None] * (time[-1] - time)[None, :]))
    weights[:, [0, -1]] *= 0.5
    return weights


def transform(time: Array, value: Array) -> NDArray[np.complex128]:
    """Integral of x(t) exp(j w (T - t)) over steps so fine that the trapezoid is exact for the purpose."""
    return np.asarray(trapezoid(time.size - 1) @ value)


def banked(
    rows: Array, servo_s: float, lever_m: float, step_s: float = STEP_S, theta: Array = THETA
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Transforms of sampled rows: of lines, and of what is believed to go on between samples."""
    bank = np.zeros((bank_channels(2, 1) + air_channels(2, 1), 2, OMEGA.size))
    filters, servo = new_filters(OMEGA.size), Servos(np.array([servo_s]), np.array([np.inf]))
    for k in range(1, len(rows)):
        advance_bank(OMEGA, servo, np.zeros(1), filters, bank, rows_before(rows, k), rows[k], 2)
    lines, phase = transforms_of(OMEGA, bank, rows[-1, 0] - rows[0, 0], 2, 1)
    model = PITCH_MODEL._replace(
        omega=OMEGA, lever=np.array([0.0, lever_m]), servos=servo, prior=Prior(theta, np.ones(6))
    )
    curves = curves_of(model, lines, phase, rows, step_s, FORWARD)
    return as_complex(lines), as_complex(curves)


def doublets() -> Array:
    """A command of two doublets, one value a sample."""
    u = np.zeros(round(SPAN_S / STEP_S) + 1)
    for first, length in ((50, 10), (250, 17)):
        u[first : first + length] = 0.035
        u[first + length : first + 2 * length] = -0.035
    return u


@pytest.mark.parametrize("lever_m", [0.0, 0.3])
@pytest.mark.parametrize("case", ["command", "repeating position", "servo"])
def test_curves_between_samples_are_those_of_the_motion(case: str, lever_m: float) -> None:
    """States, surface and the force at an accelerometer: with a held surface it jumps, and a line has a ramp there."""
    lag = 0.02 if case == "servo" else 0.0
    time, states, surface = flight(doublets(), lag)
    every = slice(None, None, FINE)
    felt = THETA[:3] - lever_m * THETA[3:]
    rows = np.zeros((time[every].size, 14))
    rows[:, 0], rows[:, 1:3], rows[:, 4] = time[every], states[every], surface[every]
    rows[:, 3] = np.column_stack([states, surface])[every] @ felt
    rows[:, 6] = 1.0
    servo_s = {"command": 0.0, "repeating position": np.inf, "servo": lag}[case]
    lines, curves = banked(rows, servo_s, lever_m)
    # held, the bank has it exactly, and the trapezoid has not
    moved = transform(time, surface) if case == "servo" else lines[:, 3]
    truths = {0: transform(time, states[:, 0]), 1: transform(time, states[:, 1]), 3: moved}
    truths[2] = felt[0] * truths[0] + felt[1] * truths[1] + felt[2] * moved
    for channel, truth in truths.items():
        scale = np.abs(truth).max()
        of_lines = np.abs(lines[:, channel] - truth).max() / scale
        of_curves = np.abs(curves[:, channel] - truth).max() / scale
        # what is left is of fourth order in dt: (11 rad/s x 0.02 s)^4, against second order / 12
        assert of_curves <= 0.1 * of_lines
        assert of_curves < 1e-3


def test_a_surface_that_got_several_commands_in_a_sample_is_nearer_than_its_lines() -> None:
    """50 Hz commands, read at 25 Hz: where their own readings are known, when a surface moved is known exactly."""
    rng, servo_s, samples = np.random.default_rng(2), 0.02, 250
    of_lines, of_curves = np.zeros((2, OMEGA.size)), np.zeros((2, OMEGA.size))
    for _ in range(60):
        changes = np.where(rng.random(2 * samples + 1) < 0.1, rng.standard_normal(2 * samples + 1), 0.0)
        command = 0.01 * np.cumsum(changes)
        time, _, surface = flight(command, servo_s)
        truth = transform(time, surface)
        rows = np.zeros((samples + 1, 14))
        rows[:, 0], rows[:, 4], rows[:, 6] = time[:: 2 * FINE], surface[:: 2 * FINE], 1.0
        for known in (0, 1):
            rows[:, -1] = known * (command[::2] - rows[:, 4])
            lines, curves = banked(rows, servo_s, 0.0, 2.0 * STEP_S, np.zeros(6))
            of_lines[known] += np.abs(truth - lines[:, 3]) ** 2
            of_curves[known] += np.abs(truth - curves[:, 3]) ** 2
    assert of_curves[0].sum() < 0.9 * of_lines[0].sum()
    # but for a change and its return within a step, which look like a fault
    assert (of_curves[1] < 0.1 * of_lines[1]).all()
