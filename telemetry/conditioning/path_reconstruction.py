"""Flight-path reconstruction: what the sensors must err by for their readings to be one rigid body's motion.

Gyros and accelerometers carry the motion, attitude, airspeed, vanes and altitude correct it, and the sensors'
errors are constant states of an extended Kalman filter (filterpy), so their final estimates use the whole flight.
Further passes are linearised about the flight smoothed by the pass before, always from the same prior: Gauss-Newton's
steps to the most likely flight (iterated extended Kalman smoother; Bell, SIAM J. Optimization 4, 1994). Linearised
about its own noisy state, the filter believes to see what only noise shows: errors came out up to 2.4 times too small.

What no channel of the flight table sees: the ground. So horizontal wind is not observable. Attitudes are taken as
true but for noise: a tilt of the attitude reference cannot be distinguished from biases of the accelerometers.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.parameter import Parameter
from wingwatch.telemetry.conditioning.path_model import ERRORS, MOTION, READINGS, PathModel, smoothed
from wingwatch.telemetry.conditioning.positions import at_centre
from wingwatch.telemetry.sample import CHANNEL_INDEX, MAX_GAP_S, SampleBlock

if TYPE_CHECKING:
    from wingwatch.telemetry.conditioning.path_filter import PathFilter

__all__ = ["PathConfig", "ReconstructedPath", "reconstruct_path"]

Array = NDArray[np.float64]

INPUTS = (
    "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s",
    "specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2",
)  # fmt: skip

_PRIOR_STD: Mapping[str, float] = {
    "rad/s": 0.05,
    "m/s2": 1.0,
    "": 0.2,
    "m/s": 2.0,
    "rad": 0.1,
}
_PASSES = 3
"""The filter by itself, then twice about what was smoothed; a fourth changes nothing that counts."""

_SPOILT: Mapping[str, int] = {
    "scale of airspeed_true_m_s": 0,
    "bias of airspeed_true_m_s": 0,
    "scale of sideslip_rad": 1,
    "scale of angle_of_attack_rad": 2,
}
"""Errors that a gust (of u, v or w) hides: the aircraft's answer to it goes with it, as a wrong scale would. They are
then free, so that the other errors allow for them, and not reported."""

_NO_GUST = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class PathConfig:
    """What is supposed.

    Attributes:
        vane_position_m: (x, y, z) of the vane from the centre of gravity, body axes.
        imu_position_m: of the accelerometers.
        noise_std: of channels as the aircraft file states it; what it does not name is taken from the readings'
            second differences, which count all that moves quickly as noise.
        prior_std: of sensor errors by the names of ``ERRORS``; else 0.05 rad/s, 1 m/s2, 0.1 rad, 2 m/s, 20 %, and
            0.3 m/s of rising air. 0 takes an error as absent.
        gust_std_m_s: standard deviation of the gusts u, v, w (``turbulence_intensity``).
        gust_length_m: over which they hold together.
    """

    vane_position_m: tuple[float, float, float] = _NO_GUST
    imu_position_m: tuple[float, float, float] = _NO_GUST
    noise_std: Mapping[str, float] = field(default_factory=dict)
    prior_std: Mapping[str, float] = field(default_factory=dict)
    gust_std_m_s: tuple[float, float, float] = _NO_GUST
    gust_length_m: float = 533.4

    def __post_init__(self) -> None:
        known = {name for name, _ in ERRORS}
        for name, std in self.prior_std.items():
            if name not in known:
                raise ValueError(
                    f"prior_std of {name!r} is not known; give one of {', '.join(sorted(known))}"
                )
            if not (math.isfinite(std) and std >= 0.0):
                raise ValueError(f"prior_std of {name} is {std}; give a standard deviation from 0")
        if min(self.gust_std_m_s) < 0.0 or not self.gust_length_m > 0.0:
            raise ValueError(
                f"gusts of {self.gust_std_m_s} m/s over {self.gust_length_m} m: give numbers from 0 over a length"
            )

    def prior(self, name: str, unit: str) -> float:
        """Standard deviation supposed of one error."""
        return self.prior_std.get(name, 0.3 if name == "rising air" else _PRIOR_STD[unit])


@dataclass(frozen=True, slots=True)
class ReconstructedPath:
    """The flight as one rigid body's motion.

    Attributes:
        parameters: sensor errors by name, with the air's rise; observable where the flight alone, with nothing
            supposed before, tells it better than the prior.
        confounded: pairs of names that the flight hardly tells apart (correlation over 0.95).
        covariance: of all parameters, shape (k, k), in the order of ``parameters``.
        fit: by channel the root mean square of what is left over what was expected: 1 for a compatible flight.
        states: roll, pitch, heading, U, V, W, altitude, shape (samples, 7), smoothed; NaN where
            a sample was not used.
    """

    parameters: tuple[Parameter, ...]
    confounded: tuple[tuple[str, str], ...]
    covariance: Array
    fit: Mapping[str, float]
    states: Array

    @property
    def compatible(self) -> bool:
        """Whether no channel is left with more than one and a half times what its noise explains."""
        return all(ratio < 1.5 for ratio in self.fit.values())


def reconstruct_path(block: SampleBlock, config: PathConfig | None = None) -> ReconstructedPath:
    """Sensor errors with their standard errors, and the path that goes with them.

    Args:
        block: samples, aligned (``delays.align``). Angular rates, specific forces, roll, pitch, airspeed and
            altitude are needed; heading and vanes used where present.
        config: what is supposed.

    Raises:
        ValueError: a needed channel is missing or fewer than 64 samples have all needed ones.
    """
    c = PathConfig() if config is None else config
    needed = (*INPUTS, "roll_rad", "pitch_rad", "airspeed_true_m_s", "altitude_m")
    if absent := [name for name in needed if name not in block.present]:
        raise ValueError(f"the flight has no {absent[0]}: a path needs {', '.join(needed)}")
    moved = at_centre(block, c.vane_position_m, c.imu_position_m)
    rows = np.flatnonzero(np.isfinite(moved.values[:, [CHANNEL_INDEX[n] for n in needed]]).all(axis=1))
    if rows.size < 64:
        raise ValueError(f"{rows.size} samples have all of {', '.join(needed)}: at least 64 are needed")
    run = _Run(SampleBlock(moved.values[rows]), c)
    last = run.forward(None)
    for _ in range(_PASSES - 1):
        last = run.forward(run.backward(last))
    states = np.full((len(block), 7), np.nan)
    states[rows] = run.backward(last)[:, :7]
    return _result(run, last, states)


@dataclass(frozen=True, slots=True)
class _Pass:
    """What a pass leaves at every sample, with the Jacobian and noise of the step to it; and how well it fitted."""

    state: Array
    covariance: Array
    predicted: Array
    jacobian: Array
    process: Array
    squared: Array
    expected: Array


class _Run:
    """One flight's arrays and the filter's passes over them."""

    def __init__(self, block: SampleBlock, config: PathConfig) -> None:
        self.time_s = block.time_s
        self.inputs = np.stack([block.column(n) for n in INPUTS], axis=1)
        self.readings = np.stack([block.column(n) for n in READINGS], axis=1)
        for j in (0, 2):
            there = np.isfinite(self.readings[:, j])
            self.readings[there, j] = np.unwrap(self.readings[there, j])
        present = np.asarray(np.isfinite(self.readings).any(axis=0))
        self.prior = np.array([config.prior(name, unit) for name, unit in ERRORS])
        self.prior[8:10] *= present[4]
        self.prior[10:12] *= present[5]
        self.spoilt = [
            i
            for i, (name, _) in enumerate(ERRORS)
            if name in _SPOILT and self.prior[i] > 0.0 and config.gust_std_m_s[_SPOILT[name]] > 0.0
        ]
        said = config.noise_std
        self.input_power = np.array(
            [_input_power(said, n, x) for n, x in zip(INPUTS, self.inputs.T, strict=True)]
        )
        self.power = np.array(
            [_noise(said, n, x) ** 2 for n, x in zip(READINGS, self.readings.T, strict=True)]
        )
        speed = max(float(np.nanmedian(self.readings[:, 3])), 1.0)
        # above V / L Dryden's spectrum across the path is 3/2 of the first-order one, and there it disturbs
        self.gust = np.array(config.gust_std_m_s) * np.sqrt([1.0, 1.5, 1.5])
        self.model = PathModel(np.full(3, config.gust_length_m / speed), speed)
        angles = np.where(present[:3], 100.0 * self.power[:3], 0.0)
        air = np.full(3, 0.01 * speed**2) + 9.0 * self.gust**2
        self.motion_power = np.concatenate([angles, air, [100.0 * self.power[6]], self.gust**2])

    def forward(self, about: Array | None) -> _Pass:
        """The filter over the flight, linearised about states (samples, states), or about its own where None."""
        from wingwatch.telemetry.conditioning.path_filter import PathFilter  # see there

        n, width = len(self.time_s), MOTION + len(ERRORS)
        kalman = PathFilter(dim_x=width, dim_z=len(READINGS))
        kalman.x = np.concatenate([self._motion(0), np.zeros(len(ERRORS))])
        kalman.P = np.diag(np.concatenate([self.motion_power, self.prior**2]))
        state, predicted = np.empty((n, width)), np.empty((n, width))
        covariance, jacobian = np.empty((n, width, width)), np.zeros((n, width, width))
        process = np.zeros((n, MOTION, MOTION))
        squared, expected = np.zeros(len(READINGS)), np.zeros(len(READINGS))
        for k in range(n):
            if k > 0:
                self._predict(kalman, k, None if about is None else about[k - 1])
            predicted[k], jacobian[k] = kalman.x, kalman.F
            if k > 0:
                process[k] = kalman.Q[:MOTION, :MOTION]
            there = np.isfinite(self.readings[k])
            if there.any():
                point = kalman.x.copy() if about is None else about[k]
                self._correct(kalman, point, self.readings[k], there, squared, expected)
            state[k], covariance[k] = kalman.x, kalman.P
        return _Pass(state, covariance, predicted, jacobian, process, squared, expected)

    def backward(self, done: _Pass) -> Array:
        """States by the whole flight, shape (samples, states) (Rauch, Tung and Striebel 1965)."""
        active = np.flatnonzero(np.concatenate([self.motion_power, self.prior]) > 0.0)
        smooth: Array = smoothed(
            done.state, done.predicted, done.covariance, done.jacobian, done.process, active
        )
        return smooth

    def _motion(self, k: int) -> Array:
        roll, pitch, heading, speed, alpha, beta, altitude = np.nan_to_num(self.readings[k])
        ahead = speed * math.cos(beta)
        air = [ahead * math.cos(alpha), speed * math.sin(beta), ahead * math.sin(alpha)]
        return np.array([roll, pitch, heading, *air, altitude, 0.0, 0.0, 0.0])

    def _step_s(self, k: int) -> float | None:
        """Time since the sample before, None over a gap."""
        dt = float(self.time_s[k] - self.time_s[k - 1])
        return dt if 0.0 < dt <= MAX_GAP_S else None

    def _process(self, jacobian: Array, k: int) -> Array:
        """What a step adds to the covariance; over a gap the motion is as unknown as at the start."""
        dt = self._step_s(k)
        if dt is not None:
            return self.model.process(jacobian, self.input_power, self.gust, dt)
        power = np.zeros_like(jacobian)
        power[range(MOTION), range(MOTION)] = self.motion_power
        return power

    def _predict(self, kalman: "PathFilter", k: int, about: Array | None) -> None:
        dt = self._step_s(k)
        if dt is None:
            kalman.F = np.diag((np.arange(kalman.x.size) >= MOTION).astype(np.float64))
            kalman.predicted = np.concatenate([self._motion(k), kalman.x[MOTION:]])
        else:
            point = kalman.x if about is None else about
            moved, kalman.F = self.model.step_jacobian(point, 0.5 * (self.inputs[k] + self.inputs[k - 1]), dt)
            kalman.predicted = moved + kalman.F @ (kalman.x - point)
        kalman.Q = self._process(kalman.F, k)
        kalman.predict()

    def _correct(
        self,
        kalman: "PathFilter",
        point: Array,
        reading: Array,
        there: NDArray[np.bool_],
        squared: Array,
        expected: Array,
    ) -> None:
        at_point, whole = self.model.readings_jacobian(point)
        jacobian = whole[there]
        said = at_point[there] + jacobian @ (kalman.x - point)
        kalman.R = np.diag(self.power[there])
        kalman.update(reading[there], lambda _: jacobian, lambda _: said)
        squared[there] += kalman.y**2 / np.diagonal(kalman.S)
        expected[there] += 1.0


def _noise(stated: Mapping[str, float], name: str, values: Array) -> float:
    """Stated noise, else from second differences, whose variance is six times that of white noise."""
    if name in stated and stated[name] > 0.0:
        return stated[name]
    twice = np.diff(values[np.isfinite(values)], 2)
    return max(float(np.sqrt(np.mean(twice**2) / 6.0)) if twice.size else 1.0, 1e-6)


def _input_power(stated: Mapping[str, float], name: str, values: Array) -> float:
    """Variance of the mean of two readings about the mean over the step between them: noise, and what is between.

    Rough air moves an accelerometer as a random walk; of variance Q a step it leaves Q / 12 (a Brownian bridge's mean).
    Second differences have 2 Q + 6 R, and next to nothing of what moves smoothly.
    """
    power = _noise(stated, name, values) ** 2
    twice = np.diff(values, 2)
    rough = float(np.mean(twice**2)) if twice.size else 0.0
    return power + max(rough - 6.0 * power, 0.0) / 24.0


def _without_prior(covariance: Array, prior: Array) -> Array:
    """Standard errors from the flight alone, shape (k,): the prior's information taken out of the covariance's.

    Infinite where, with all the others as little known, nothing is left.
    """
    free = np.flatnonzero(prior > 0.0)
    scaled = covariance[np.ix_(free, free)] / np.outer(prior[free], prior[free])
    share, axes = np.linalg.eigh(scaled)
    # along an axis the flight's information over the prior's is 1 / share - 1
    gained = np.maximum(1.0 / np.clip(share, 1e-300, None) - 1.0, 1e-9)
    alone = np.zeros(prior.size)
    alone[free] = prior[free] * np.sqrt(np.sum(axes**2 / gained, axis=1))
    return alone


def _result(run: _Run, last: _Pass, states: Array) -> ReconstructedPath:
    value, covariance = last.state[-1, MOTION:], last.covariance[-1, MOTION:, MOTION:]
    error = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    free = [i for i in range(len(ERRORS)) if run.prior[i] > 0.0 or i in run.spoilt]
    alone = _without_prior(covariance, run.prior)
    parameters = []
    for i in free:
        name, unit = ERRORS[i]
        observable, reason = True, ""
        if i in run.spoilt:
            observable, reason = (
                False,
                "in rough air the aircraft responds to the gusts that the sensor measures",
            )
            parameters.append(Parameter(name, math.nan, math.inf, unit, observable, reason))
            continue
        if not alone[i] < run.prior[i]:
            observable, reason = False, "the flight alone holds less information on it than the prior"
        parameters.append(Parameter(name, float(value[i]), float(error[i]), unit, observable, reason))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance / np.outer(error, error)
    confounded = tuple(
        (ERRORS[i][0], ERRORS[j][0]) for i in free for j in free if i < j and abs(correlation[i, j]) > 0.95
    )
    fit = {
        name: float(math.sqrt(last.squared[j] / last.expected[j]))
        for j, name in enumerate(READINGS)
        if last.expected[j] > 0.0
    }
    return ReconstructedPath(tuple(parameters), confounded, covariance[np.ix_(free, free)], fit, states)
