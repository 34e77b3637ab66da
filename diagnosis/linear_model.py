"""How small disturbances move a simulated aircraft and the air around it, over one sample.

About a window's mean motion the residual of a perfect simulation through still air obeys

    x' = Phi x + Gamma g + noise,   r = H x + D g + e,                                                         (1)

x the eight states of ``replay.START``, e white sensor noise, and g what disturbs the replay: velocities u, v, w of the
air and its roll rate p are first-order Markov processes (Dryden's of MIL-F-8785C), pitch and yaw rate of the air follow
from the gradients of w and v along the path, as much as the aircraft feels of them; unmodelled angular accelerations in
pitch and yaw and an unmodelled specific force along x are Markov processes too; and a surface whose measured position
is flown is off by its sensor's noise.
docs/methods/diagnosis.md, section 2.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.replay import (
    AIR,
    DISTURBANCES,
    SCALE,
    SURFACE_OUTPUTS,
    TRIM_STEPS,
    Inputs,
    Model,
    body_state,
    motion_of,
    move,
    read_sensors,
    ready,
    still,
    with_trims,
    work_space,
)
from wingwatch.kernels.decorators import compiled

__all__ = [
    "DRIVEN",
    "STATES",
    "WIDTH",
    "LinearModel",
    "MeanMotion",
    "Noise",
    "by_coefficients",
    "fastest_rad_s",
    "linear_model",
    "mean_motion",
]

Array = NDArray[np.float64]

STATES, _K = 8, len(OUTPUTS)
_COEFFICIENTS = 5
"""Of ``TRIMS``, the first."""
(_U, _V, _W, _V_FELT, _W_FELT, _V_LATE, _W_LATE, _P, _PITCH, _YAW, _FORWARD, _SURFACES) = range(
    STATES, STATES + 12
)
"""Places of what disturbs: velocities, the same as felt, the same late, roll rate, angular accelerations, specific
force along x, the first surface."""
WIDTH = _SURFACES + 3
"""Of the states of equation (1)."""
_PROCESSES = 7
"""Of what noise drives, all but the surfaces' sensors."""
_FORCE = 6
"""Of what noise drives, the specific force along x."""
DRIVEN = np.array([_U, _V, _W, _P, _PITCH, _YAW, _FORWARD, _SURFACES, _SURFACES + 1, _SURFACES + 2])
"""Which of them noise drives."""
_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4])
_DISTURBANCE_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-2, 1e-4, 1e-4, 1e-4])

_START_SPREAD = np.array([3.0, 3.0, 3.0, 0.1, 0.1, 0.1, 0.1, 0.1])
"""How far a window's start may be from what its first samples say."""

_ANY_FORCE_M_S2 = 30.0
"""Standard deviation of a specific force of which nothing is known."""

GUST_SCALE_M = 100.0
"""Scale length of gusts."""


class LinearModel(NamedTuple):
    """Equation (1) over one sample.

    Attributes:
        transition: (22, 22); noise: of the processes' noise, (22, 10); output: (outputs, 22).
        disturbance: ``replay.DISTURBANCES`` by the states, (12, 22).
        keep: of the Markov processes over a sample, (10,).
        within: what the processes' mean way off the straight line within a sample does to the motion, (8, 7).
    """

    transition: Array
    noise: Array
    output: Array
    disturbance: Array
    keep: Array
    within: Array

    def without(self, followed: tuple[int, ...]) -> "LinearModel":
        """With some of ``START`` held to what was measured."""
        if not followed:
            return self
        f, noise, h, within = (
            self.transition.copy(),
            self.noise.copy(),
            self.output.copy(),
            self.within.copy(),
        )
        at = list(followed)
        f[at] = f[:, at] = noise[at] = h[:, at] = within[at] = 0.0
        return self._replace(transition=f, noise=noise, output=h, within=within)

    def covariances(self, noise: "Noise") -> tuple[Array, Array]:
        """Of the processes' noise over a sample, and of the states before the first, (22, 22) each.

        White noise that has moved a process from one value to the next has left the straight line between them, in
        the mean over the sample by a twelfth of its variance (Brownian bridge), whatever both values are.
        Before the first sample the air is as it is long after its beginning, and next to nothing is known of the
        motion.
        """
        variance = np.concatenate([noise.gusts, noise.surfaces]) ** 2 * (1.0 - self.keep**2)
        process = (self.noise * variance) @ self.noise.T
        process[:STATES, :STATES] += (self.within * variance[:_PROCESSES] / 12.0) @ self.within.T
        if noise.any_force_x:
            process += _ANY_FORCE_M_S2**2 * np.outer(self.noise[:, _FORCE], self.noise[:, _FORCE])
        start, air = np.zeros((WIDTH, WIDTH)), slice(STATES, None)
        start[:STATES, :STATES] = np.diag(_START_SPREAD**2)
        start[air, air] = _long_after(self.transition[air, air], process[air, air])
        return process, start


_DOUBLINGS = 24
"""2^24 samples are long after any beginning."""
_FORGOTTEN = 1e-12
"""Part of a beginning below which its square adds nothing."""


def _long_after(moves: Array, process: Array) -> Array:
    """Covariance p = F p F' + process, by doubling the time gone."""
    return _doubled(moves.tobytes(), process.tobytes())


@lru_cache(maxsize=64)
def _doubled(moves_of_air: bytes, process: bytes) -> Array:
    """The same air surrounds every version of an aircraft that is compared at some noise."""
    moves, spread = (np.frombuffer(part).reshape(WIDTH - STATES, -1) for part in (moves_of_air, process))
    for _ in range(_DOUBLINGS):
        if np.abs(moves).max() < _FORGOTTEN:
            break
        spread = spread + moves @ spread @ moves.T
        moves = moves @ moves
    return spread


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations.

    Attributes:
        sensors: of each output, in its unit, (outputs,); of a surface: of its way by the actuator of the file.
        gusts: of the air, u, v, w, m/s, p, rad/s, of unmodelled angular accelerations q, r, rad/s2, and of the
            unmodelled specific force along x, m/s2, (7,).
        surfaces: of the sensors whose positions are flown, rad, (3,).
        gradients: how much of the air's gradients along the path the aircraft feels; 1: all, as MIL-F-8785C has it.
        lag_s: time constant with which a gust's lift comes (Kuessner's effect, mean over the wing).
        any_force_x: whether the unmodelled specific force along x is anything from sample to sample, for the aircraft
            file states none: what the accelerometer reads.
    """

    sensors: Array
    gusts: Array
    surfaces: Array
    gradients: float = 1.0
    lag_s: float = 0.01
    any_force_x: bool = False


class MeanMotion(NamedTuple):
    """A window's mean motion, and what lies a small step beside it.

    Attributes:
        inputs: at their mean, over one sample.
        centre: rigid-body state (13,); beside: one step further along each of ``START``, then one step back, (16, 13).
        speed: m/s.
        flown: whether each surface's measured position is flown, (3,).
    """

    inputs: Inputs
    centre: Array
    beside: Array
    speed: float
    flown: NDArray[np.bool_]


def mean_motion(mean: Array, inputs: Inputs) -> MeanMotion:
    """Of the mean of ``START`` in a window (8,) and the window's inputs."""
    beside = [body_state(s, inputs.altitude) for s in (*(mean + np.diag(_STEPS)), *(mean - np.diag(_STEPS)))]
    speed = max(float(np.linalg.norm(mean[:3])), 1.0)
    flown = np.asarray(np.isfinite(inputs.flown).all(axis=0))
    return MeanMotion(still(inputs), body_state(mean, inputs.altitude), np.array(beside), speed, flown)


def linear_model(model: Model, about: MeanMotion, trims: Array, span_m: float, noise: Noise) -> LinearModel:
    """Equation (1) about a mean motion, by central differences of the replay.

    Args:
        model: the simulation.
        about: the mean motion of the window.
        trims: of the window, (6,).
        span_m: of the wing.
        noise: how gusts are felt.
    """
    held, speed, flown = about.inputs, about.speed, about.flown
    phi, h = np.empty((STATES, STATES)), np.empty((_K, STATES))
    first, last = np.empty((STATES, DISTURBANCES)), np.empty((STATES, DISTURBANCES))
    d = np.empty((_K, DISTURBANCES))
    _differences(model.row, about.beside, about.centre, trims, held, (phi, h, first, last, d))
    gain = 1.0 + model.sensors[:, SCALE, None]
    for by_disturbance in (first, last, d):
        by_disturbance[:, AIR:] *= flown
    # a servo follows its command, not its sensor; the disturbance is position less reading
    d[SURFACE_OUTPUTS:, AIR:] = -np.diag(flown.astype(np.float64))
    by_states, moves, driven, keep = _disturbances(held.dt, speed, span_m, noise)
    transition, output = moves.copy(), np.zeros((_K, WIDTH))
    transition[:STATES, :STATES], output[:, :STATES] = phi, h
    transition[:STATES] += first @ by_states + last @ by_states @ moves
    driven[:STATES] += last @ by_states @ driven
    output += d @ by_states
    within = (first + last) @ by_states[:, [_U, _V_FELT, _W_FELT, _P, _PITCH, _YAW, _FORWARD]]
    return LinearModel(transition, driven, gain * output, by_states, keep, within)


def by_coefficients(model: Model, mean: Array, trims: Array, inputs: Inputs) -> tuple[Array, Array]:
    """What one of CL, CY, Cl, Cm and Cn does to the motion over a sample (8, 5), and to the true outputs (outputs, 5).

    Args:
        model: the simulation.
        mean: of ``START`` in the window, (8,).
        trims: of the window, (6,).
        inputs: of the window; their mean is held.
    """
    held, calm = still(inputs), np.zeros(DISTURBANCES)
    after, read = np.empty((2, STATES)), np.empty((2, _K))
    by_state, by_output = np.zeros((STATES, _COEFFICIENTS)), np.zeros((_K, _COEFFICIENTS))
    for j in range(_COEFFICIENTS):
        for side in (0, 1):
            moved = trims + (2 * side - 1) * TRIM_STEPS[j] * (np.arange(len(trims)) == j)
            c, x, work = (
                with_trims(model.row, moved),
                body_state(mean, inputs.altitude),
                work_space(held.steps),
            )
            ready(c, held, work)
            read_sensors(c, x, held, 0, work, calm, read[side])
            move(c, x, held, 0, work, calm, calm)
            motion_of(x, after[side])
        by_state[:, j] = (after[1] - after[0]) / (2.0 * TRIM_STEPS[j])
        by_output[:, j] = (read[1] - read[0]) / (2.0 * TRIM_STEPS[j])
    return by_state, by_output


@compiled(error_model="numpy", nogil=True)
def _differences(row, states, centre, trims, held, out):  # type: ignore[no-untyped-def]
    """Central differences over one sample with the states, then with what disturbs at its start and end."""
    phi, h, first, last, d = out
    c, work = with_trims(row, trims), work_space(held.steps)
    sample = np.int64(0)  # written in a call, 0 has a type of its own, for which numba compiles all anew
    below, read, x = np.empty(_K), np.empty(_K), np.empty(13)
    before, after = np.empty(STATES), np.empty(STATES)
    here, there = np.zeros(DISTURBANCES), np.zeros(DISTURBANCES)
    for j in range(STATES):
        for side in range(2):
            x[:] = states[j + side * STATES]
            ready(c, held, work)
            read_sensors(c, x, held, sample, work, here, read)
            move(c, x, held, sample, work, here, there)
            if side == 0:
                motion_of(x, after)
                below[:] = read
        motion_of(x, before)
        phi[:, j] = (after - before) / (2.0 * _STEPS[j])
        h[:, j] = (below - read) / (2.0 * _STEPS[j])
    for j in range(DISTURBANCES):
        for at in range(2):
            disturbed = here if at == 0 else there
            for side in range(2):
                x[:] = centre
                disturbed[j] = _DISTURBANCE_STEPS[j] * (1.0 - 2.0 * side)
                ready(c, held, work)
                read_sensors(c, x, held, sample, work, here, read)
                move(c, x, held, sample, work, here, there)
                disturbed[j] = 0.0
                if side == 0:
                    motion_of(x, after)
                    below[:] = read
            motion_of(x, before)
            gamma = first if at == 0 else last
            gamma[:, j] = (after - before) / (2.0 * _DISTURBANCE_STEPS[j])
            if at == 0:
                d[:, j] = (below - read) / (2.0 * _DISTURBANCE_STEPS[j])


def _disturbances(dt: float, speed: float, span_m: float, noise: Noise) -> tuple[Array, Array, Array, Array]:
    """What disturbs by the states (12, 22); its part of the transition (22, 22) and of the noise (22, 10); what the
    processes keep over a sample (10,).

    A gust across the path is felt with a lag. A gradient along the path is felt over a length of the wing: q = (w -
    w_late) / (V tau), tau w_late' = w - w_late. Both follow what they lag behind on straight lines between samples.
    """
    slow, quick = math.exp(-dt * speed / GUST_SCALE_M), math.exp(-dt * math.pi * speed / (4.0 * span_m))
    force = 0.0 if noise.any_force_x else slow  # what is read is what moves the aircraft, on straight lines
    keep = np.array([slow, slow, slow, quick, quick, quick, force, 0.0, 0.0, 0.0])
    moves, driven = np.zeros((WIDTH, WIDTH)), np.eye(WIDTH)[:, DRIVEN]
    moves[DRIVEN, DRIVEN] = keep
    by_states = np.zeros((DISTURBANCES, WIDTH))
    by_states[[0, 1, 2, 3, 6, 7, 8, 9, 10, 11], [_U, _V_FELT, _W_FELT, *DRIVEN[3:]]] = 1.0
    for now, felt, late, lengths, rate, sign in (
        (_V, _V_FELT, _V_LATE, 3.0, 5, 1.0),
        (_W, _W_FELT, _W_LATE, 4.0, 4, -1.0),
    ):
        _lags(moves, driven, felt, now, dt / noise.lag_s)
        lag_s = lengths * span_m / (math.pi * speed)
        _lags(moves, driven, late, felt, dt / lag_s)
        by_states[rate, felt] = sign * noise.gradients / (speed * lag_s)
        by_states[rate, late] = -by_states[rate, felt]
    return by_states, moves, driven, keep


def _lags(moves: Array, driven: Array, late: int, now: int, part: float) -> None:
    """A state follows another with a lag of which a sample is a part, on straight lines between samples; in place."""
    stays = math.exp(-part)
    end = 1.0 - (1.0 - stays) / part
    moves[late] = end * moves[now]
    moves[late, now] += 1.0 - stays - end
    moves[late, late] += stays
    driven[late] = end * driven[now]


def fastest_rad_s(linear: LinearModel, dt_s: float) -> float:
    """Size of the fastest eigenvalue of the motion."""
    values = np.linalg.eigvals(linear.transition[:STATES, :STATES])
    moving = values[np.abs(values) > 1e-9]  # a state that is followed has none
    return float(np.abs(np.log(moving)).max(initial=0.0)) / dt_s
