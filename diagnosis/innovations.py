"""The residual of a replay, whitened: what sensor noise, gusts and unmodelled moments can do is taken out of it.

About a window's mean motion the residual of a perfect simulation through still air obeys

    x' = Phi x + Gamma g + noise,   r = H x + D g + e,                                                         (1)

x the eight states of ``replay.START``, e white sensor noise, and g the air's motion: velocities u, v, w and the roll
rate p are first-order Markov processes (Dryden's of MIL-F-8785C), pitch and yaw rate follow from the gradients of w
and v along the path; further come unmodelled angular accelerations in pitch and yaw, Markov processes too. A Kalman
filter of (1) turns the residual into independent innovations; run over a sensitivity it gives that sensitivity as the
innovations see it. It looks back only, so what an autopilot makes of a gust is no evidence of anything.

Gusts are large motions. So the replay flies through the air as it is estimated, and the linear response to that air is
added to its residual: (1) holds for the sum, and only what the estimate misses is linearised.
docs/methods/diagnosis.md, section 2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.replay import AIR, SCALE, Inputs, Model, body_state, fly_window, still
from wingwatch.simulation.dynamics import euler_angles

__all__ = [
    "Gains",
    "LinearModel",
    "Noise",
    "air_response",
    "estimate_air",
    "fastest_rad_s",
    "linear_model",
    "settled_gains",
    "whiten",
]

Array = NDArray[np.float64]

_STATES, _K = 8, len(OUTPUTS)
_U, _V, _W, _V_LATE, _W_LATE, _P, _PITCH, _YAW = range(_STATES, _STATES + 8)
"""Places of what moves the air: velocities, the same late, roll rate, angular accelerations."""
_N = _STATES + 8
_DRIVEN = np.array([_U, _V, _W, _P, _PITCH, _YAW])
_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4])
_AIR_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4])

_HOLDS = 1e-5
"""Relative change of gains below which they hold."""

GUST_SCALE_M = 100.0
"""Scale length of gusts."""


class LinearModel(NamedTuple):
    """Equation (1) over one sample.

    Attributes:
        transition: (16, 16); noise: of the processes' noise, (16, 6); output: (outputs, 16).
        air: motion of the air (``Inputs.air``) by the states, (8, 16).
        keep: of the Markov processes over a sample, (6,).
    """

    transition: Array
    noise: Array
    output: Array
    air: Array
    keep: Array

    def without(self, followed: tuple[int, ...]) -> "LinearModel":
        """With some of ``START`` held to what was measured."""
        if not followed:
            return self
        f, noise, h = self.transition.copy(), self.noise.copy(), self.output.copy()
        at = list(followed)
        f[at] = f[:, at] = noise[at] = h[:, at] = 0.0
        return self._replace(transition=f, noise=noise, output=h)

    def covariances(self, noise: "Noise") -> tuple[Array, Array]:
        """Of the processes' noise over a sample, and of the states before the first, (16, 16) each.

        Before the first sample the air is as it is long after its beginning.
        """
        variance = noise.gusts**2 * (1.0 - self.keep**2)
        process = (self.noise * variance) @ self.noise.T
        start, air = np.zeros((_N, _N)), slice(_STATES, None)
        start[air, air] = solve_discrete_lyapunov(self.transition[air, air], process[air, air])
        return process, start


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations.

    Attributes:
        sensors: of each output, in its unit, (outputs,).
        gusts: of the air, u, v, w, m/s, p, rad/s, and of unmodelled angular accelerations q, r, rad/s2, (6,).
    """

    sensors: Array
    gusts: Array


def linear_model(model: Model, mean: Array, trims: Array, inputs: Inputs, span_m: float) -> LinearModel:
    """Equation (1) about a mean motion, by central differences of the replay.

    Args:
        model: the simulation.
        mean: of ``START`` in the window, (8,).
        trims: of the window, (6,).
        inputs: of the window; their mean is held.
        span_m: of the wing.
    """
    held = still(inputs)
    states = np.array(
        [body_state(s, inputs.altitude) for s in (*(mean + np.diag(_STEPS)), *(mean - np.diag(_STEPS)))]
    )
    phi, h = np.empty((_STATES, _STATES)), np.empty((_K, _STATES))
    first, last, d = np.empty((_STATES, AIR)), np.empty((_STATES, AIR)), np.empty((_K, AIR))
    _differences(model.row, states, body_state(mean, inputs.altitude), trims, held, (phi, h, first, last, d))
    gain = 1.0 + model.sensors[:, SCALE, None]
    speed = max(float(np.linalg.norm(mean[:3])), 1.0)
    by_states, moves, noise, keep = _air_model(inputs.dt, speed, span_m)
    transition, output = moves.copy(), np.zeros((_K, _N))
    transition[:_STATES, :_STATES], output[:, :_STATES] = phi, h
    transition[:_STATES] += first @ by_states + last @ by_states @ moves
    noise[:_STATES] += last @ by_states @ noise
    output += d @ by_states
    return LinearModel(transition, noise, gain * output, by_states, keep)


@njit(cache=True, error_model="numpy", nogil=True)
def _differences(row, states, centre, trims, held, out):  # type: ignore[no-untyped-def]
    """Central differences over one sample with the states, then with the air at its start and end, into ``out``."""
    phi, h, first, last, d = out
    rows, read, trim = row.reshape(1, row.size), np.empty((1, 1, _K)), trims.reshape(1, trims.size)
    below, start, end = np.empty(_K), np.empty((1, 13)), np.empty((1, 13))
    before, after = np.empty(_STATES), np.empty(_STATES)
    for j in range(_STATES):
        for side in range(2):
            start[0] = states[j + side * _STATES]
            fly_window(rows, start, trim, held, read, end)
            if side == 0:
                _coordinates(end[0], after)
                below[:] = read[0, 0]
        _coordinates(end[0], before)
        phi[:, j] = (after - before) / (2.0 * _STEPS[j])
        h[:, j] = (below - read[0, 0]) / (2.0 * _STEPS[j])
    start[0] = centre
    for j in range(AIR):
        for at in range(2):
            for side in range(2):
                held.air[:] = 0.0
                held.air[at, j] = _AIR_STEPS[j] * (1.0 - 2.0 * side)
                fly_window(rows, start, trim, held, read, end)
                if side == 0:
                    _coordinates(end[0], after)
                    below[:] = read[0, 0]
            _coordinates(end[0], before)
            gamma = first if at == 0 else last
            gamma[:, j] = (after - before) / (2.0 * _AIR_STEPS[j])
            if at == 0:
                d[:, j] = (below - read[0, 0]) / (2.0 * _AIR_STEPS[j])


@njit(cache=True, error_model="numpy", nogil=True)
def _coordinates(x, out):  # type: ignore[no-untyped-def]
    """``START`` of a rigid-body state (13,) into ``out`` (8,)."""
    out[:3], out[3:6] = x[3:6], x[10:13]
    roll, pitch, _ = euler_angles(x)
    out[6], out[7] = roll, pitch


def _air_model(dt: float, speed: float, span_m: float) -> tuple[Array, Array, Array, Array]:
    """The air's motion by the states (8, 16); the air's part of the transition (16, 16) and of the noise (16, 6); what
    the processes keep over a sample (6,).

    A gradient along the path is felt over a length of the wing: q = (w - w_late) / (V tau), tau w_late' = w - w_late,
    w on straight lines between samples.
    """
    slow, quick = math.exp(-dt * speed / GUST_SCALE_M), math.exp(-dt * math.pi * speed / (4.0 * span_m))
    keep = np.array([slow, slow, slow, quick, quick, quick])
    moves, noise = np.zeros((_N, _N)), np.eye(_N)[:, _DRIVEN]
    moves[_DRIVEN, _DRIVEN] = keep
    by_states = np.zeros((AIR, _N))
    by_states[[0, 1, 2, 3, 6, 7], _DRIVEN] = 1.0
    for late, process, lengths, rate, sign in ((_V_LATE, 1, 3.0, 5, 1.0), (_W_LATE, 2, 4.0, 4, -1.0)):
        lag_s, now = lengths * span_m / (math.pi * speed), int(_DRIVEN[process])
        stays = math.exp(-dt / lag_s)
        end = 1.0 - (1.0 - stays) * lag_s / dt
        moves[late, late], noise[late, process] = stays, end
        moves[late, now] = 1.0 - stays - end + end * keep[process]
        by_states[rate, now], by_states[rate, late] = sign / (speed * lag_s), -sign / (speed * lag_s)
    return by_states, moves, noise, keep


def fastest_rad_s(linear: LinearModel, dt_s: float) -> float:
    """Size of the fastest eigenvalue of the motion."""
    values = np.linalg.eigvals(linear.transition[:_STATES, :_STATES])
    moving = values[np.abs(values) > 1e-9]  # a state that is followed has none
    return float(np.abs(np.log(moving)).max(initial=0.0)) / dt_s


class Gains(NamedTuple):
    """A Kalman filter of (1) with every reading there, until it has settled.

    Attributes:
        gain: (samples, used, 16); deviation: of the innovations, (samples, used).
    """

    gain: Array
    deviation: Array


def settled_gains(linear: LinearModel, noise: Noise, used: Sequence[int], lead: int, samples: int) -> Gains:
    """Gains for windows of up to so many samples; the last holds from then on."""
    process, start = linear.covariances(noise)
    index = np.array(used)
    gain, deviation = np.zeros((samples, index.size, _N)), np.ones((samples, index.size))
    count = _settle(
        linear.transition, np.ascontiguousarray(linear.output[index]), process, noise.sensors[index] ** 2, start,
        gain, deviation, lead,
    )  # fmt: skip
    return Gains(gain[:count], deviation[:count])


def whiten(
    linear: LinearModel,
    noise: Noise,
    columns: Array,
    used: Sequence[int],
    lead: int,
    gains: Gains | None = None,
) -> tuple[Array, Array]:
    """Innovations of several columns by the same filter.

    Args:
        linear: of the window.
        noise: standard deviations.
        columns: (samples, outputs, columns); a residual first, NaN where it was not measured.
        used: outputs that count.
        lead: samples at the start that do not count.
        gains: of ``settled_gains``, for a window that misses no reading.

    Returns:
        Innovations (samples, used, columns), 0 where nothing was measured, and their standard deviations (samples,
        used), 1 there.
    """
    index = np.array(used)
    chosen, output = np.ascontiguousarray(columns[:, index]), np.ascontiguousarray(linear.output[index])
    spread = np.ones(chosen.shape[:2])
    if gains is not None and np.isfinite(chosen[lead:, :, 0]).all():
        _apply(linear.transition, output, gains.gain, gains.deviation, chosen, spread, lead)
    else:
        process, start = linear.covariances(noise)
        _filter(linear.transition, output, process, noise.sensors[index] ** 2, start, chosen, spread, lead)
    return chosen, spread


def estimate_air(linear: LinearModel, noise: Noise, residual: Array, used: Sequence[int], lead: int) -> Array:
    """States of the air (samples, 8) that explain a residual (samples, outputs) best, looking back and ahead."""
    process, start = linear.covariances(noise)
    index = np.array(used)
    states = _smooth(
        linear.transition, np.ascontiguousarray(linear.output[index]), process, noise.sensors[index] ** 2, start,
        np.ascontiguousarray(residual[:, index]), lead,
    )  # fmt: skip
    return np.asarray(states[:, _STATES:])


def air_response(linear: LinearModel, air_states: Array) -> Array:
    """What the air of ``estimate_air`` alone does to the outputs by (1), (samples, outputs)."""
    out = np.empty((len(air_states), _K))
    _respond(linear.transition, linear.noise, linear.output, air_states, out)
    return out


@njit(cache=True, error_model="numpy", nogil=True)
def _respond(f, noise, h, air_states, out):  # type: ignore[no-untyped-def]
    x = np.zeros(_N)
    x[_STATES:] = air_states[0]
    drive = np.empty(_DRIVEN.size)
    for t in range(out.shape[0]):
        out[t] = h @ x
        x = f @ x
        if t + 1 < out.shape[0]:
            for j in range(_DRIVEN.size):
                drive[j] = air_states[t + 1, _DRIVEN[j] - _STATES] - x[_DRIVEN[j]]
            x += noise @ drive


@njit(cache=True, error_model="numpy", nogil=True)
def _settle(f, h, process, variance, p, gain, deviation, lead):  # type: ignore[no-untyped-def]
    """Gains and deviations of every sample until they hold; how many samples these are."""
    samples, outputs = deviation.shape
    new = np.zeros(f.shape[0])
    last = np.ones(outputs)
    for t in range(samples):
        change = 0.0
        if t >= lead:
            for k in range(outputs):
                gain[t, k] = gain[t - 1, k]
                change = max(change, _gain(p, h[k], variance[k], gain[t, k], new, last, k))
            deviation[t] = last
            if change < _HOLDS:
                return t + 1
        p = f @ p @ f.T + process
    return samples


@njit(cache=True, error_model="numpy", nogil=True)
def _apply(f, h, gains, deviations, columns, spread, lead):  # type: ignore[no-untyped-def]
    """Columns become innovations by known gains, in place."""
    samples, outputs, width = columns.shape
    n = f.shape[0]
    x = np.zeros((n, width))
    for t in range(samples):
        at = min(t, gains.shape[0] - 1)
        if t < lead:
            columns[t] = 0.0
        else:
            for k in range(outputs):
                spread[t, k] = deviations[at, k]
                e = columns[t, k]
                for i in range(n):
                    if h[k, i] != 0.0:
                        for c in range(width):
                            e[c] -= h[k, i] * x[i, c]
                for i in range(n):
                    for c in range(width):
                        x[i, c] += gains[at, k, i] * e[c]
        x = f @ x


@njit(cache=True, error_model="numpy", nogil=True)
def _filter(f, h, process, variance, p, columns, spread, lead):  # type: ignore[no-untyped-def]
    """The Kalman filter of (1), in place: columns become innovations."""
    samples, outputs, width = columns.shape
    n = f.shape[0]
    x, work, new = np.zeros((n, width)), np.zeros((n, n)), np.zeros(n)
    gains, deviations = np.zeros((outputs, n)), np.ones(outputs)
    settled, last = False, np.zeros(outputs)
    for t in range(samples):
        same = True
        for k in range(outputs):
            there = 1.0 if t >= lead and columns[t, k, 0] == columns[t, k, 0] else 0.0
            same = same and there == last[k]
            last[k] = there
        settled = settled and same
        change = 0.0
        for k in range(outputs):
            if last[k] == 0.0:
                columns[t, k, :] = 0.0
                continue
            if not settled:
                change = max(change, _gain(p, h[k], variance[k], gains[k], new, deviations, k))
            spread[t, k] = deviations[k]
            e = columns[t, k]
            for i in range(n):
                if h[k, i] != 0.0:
                    for c in range(width):
                        e[c] -= h[k, i] * x[i, c]
            for i in range(n):
                for c in range(width):
                    x[i, c] += gains[k, i] * e[c]
        x = f @ x
        if not settled:
            settled = same and change < _HOLDS and t >= lead
            work[:] = f @ p
            p[:] = work @ f.T + process


@njit(cache=True, error_model="numpy", nogil=True)
def _gain(p, h, variance, gain, new, deviations, k):  # type: ignore[no-untyped-def]
    """Gain of one output, and p after it; returns the relative change of the innovation's deviation."""
    n = h.size
    s = variance
    for i in range(n):
        new[i] = 0.0
        for j in range(n):
            new[i] += p[i, j] * h[j]
    for i in range(n):
        s += h[i] * new[i]
    deviation = math.sqrt(s)
    change = abs(deviation / deviations[k] - 1.0)
    deviations[k] = deviation
    for i in range(n):
        moved = new[i] / s
        change = max(change, abs(moved - gain[i]) * abs(h[i]))
        gain[i] = moved
        for j in range(i + 1):
            p[i, j] -= moved * new[j]
            p[j, i] = p[i, j]
    return change


@njit(cache=True, error_model="numpy", nogil=True)
def _smooth(f, h, process, variance, p, residual, lead):  # type: ignore[no-untyped-def]
    """States by Rauch, Tung and Striebel's smoother in Bryson and Frazier's form, (samples, n).

    Backward adjoint: lambda over the samples behind, so that no covariance is inverted.
    """
    samples, outputs = residual.shape
    n = f.shape[0]
    predicted, spreads = np.zeros((samples, n)), np.zeros((samples, n, n))
    gains, scales, errors = (
        np.zeros((samples, outputs, n)),
        np.zeros((samples, outputs)),
        np.zeros((samples, outputs)),
    )
    x, new, deviations = np.zeros(n), np.zeros(n), np.ones(outputs)
    for t in range(samples):
        predicted[t], spreads[t] = x, p
        for k in range(outputs):
            if t < lead or residual[t, k] != residual[t, k]:
                continue
            _gain(p, h[k], variance[k], gains[t, k], new, deviations, k)
            scales[t, k] = 1.0 / (deviations[k] * deviations[k])
            errors[t, k] = residual[t, k] - np.dot(h[k], x)
            x += gains[t, k] * errors[t, k]
        x = f @ x
        p = f @ p @ f.T + process
    out, behind = np.empty((samples, n)), np.zeros(n)
    for t in range(samples - 1, -1, -1):
        behind = f.T @ behind
        for k in range(outputs - 1, -1, -1):
            if scales[t, k] > 0.0:
                behind = behind + h[k] * (errors[t, k] * scales[t, k] - np.dot(gains[t, k], behind))
        out[t] = predicted[t] + spreads[t] @ behind
    return out
