"""The same recursion with ``filterpy.kalman.ExtendedKalmanFilter`` doing prediction and correction, one vehicle after
the other: the reference of the compiled one."""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from wingwatch.estimators.ekf.adaptation import (
    Prediction,
    Residuals,
    adapt_noise,
    inertial_motion,
    learn_noise,
)
from wingwatch.estimators.ekf.coherence import follow_coherence
from wingwatch.estimators.ekf.covariance import correct
from wingwatch.estimators.ekf.inputs import (
    correct_input_errors,
    input_noise,
    predict_input_errors,
    track_readings,
)
from wingwatch.estimators.ekf.model import measure, transition
from wingwatch.estimators.ekf.moment_level import follow_moment_levels
from wingwatch.estimators.ekf.noise import process_noise, trim_drift
from wingwatch.estimators.ekf.recursion import (
    SETTLE_S,
    WARM_UP,
    Runner,
    step_of,
    track_condition,
)
from wingwatch.estimators.ekf.sample import Gains, Posterior, Readings, Sample
from wingwatch.estimators.ekf.state import (
    ALPHA,
    EARLIER,
    ESTIMATED,
    NEWEST,
    TIME,
    VANE,
    EkfState,
    Model,
    one_vehicle,
    put_vehicle,
    running,
)
from wingwatch.estimators.lanes import Lanes, all_lanes
from wingwatch.estimators.signals import CONDITION_COLUMNS
from wingwatch.telemetry import MAX_GAP_S

__all__ = ["update_all"]

Array = NDArray[np.float64]


def update_all(model: Model, state: EkfState, signals: Array, lanes: Lanes) -> None:
    """Run all samples of some vehicles, (vehicles, samples, columns)."""
    for rows, i, count in zip(signals, lanes.place.tolist(), lanes.counts.tolist(), strict=True):
        for new in rows[:count]:
            if np.isfinite(new[: model.sizes.kinematic + ALPHA]).all():
                _take(model, state, i, new)


def _take(model: Model, state: EkfState, i: int, new: Array) -> None:
    """One signal row; start, restart and warm-up are no filtering and are shared with the compiled engine."""
    ns, kinematic = model.sizes.states, model.sizes.kinematic
    old, older = state.rows[i, NEWEST].copy(), state.rows[i, EARLIER].copy()
    dt = float(new[TIME] - old[TIME])
    inertial = bool(model.use_accelerometer and new[kinematic + VANE] == 1.0 and old[kinematic + VANE] == 1.0)
    samples = int(state.samples[i]) + 1
    settled = samples > WARM_UP and not (inertial and samples * dt < SETTLE_S)
    if not 0.0 < dt <= MAX_GAP_S or not settled or not np.isfinite(older[TIME]):
        one = one_vehicle(state, i)
        Runner(model).update(one, np.ascontiguousarray(new)[None, None], all_lanes(1, 1))
        put_vehicle(state, [i], one)
        return
    state.samples[i] = samples
    state.settling[i] = False
    motion = float(inertial_motion(new, old, dt, ns, kinematic)) if inertial else 0.0
    _filter(model, state, i, Sample(new, old, older, dt, inertial, motion))
    state.rows[i, EARLIER] = old
    state.rows[i, NEWEST] = new
    track_condition(state.condition[i], new, kinematic, dt)
    track_readings(state.moments[i], new, ns, model.sizes.inputs)


def _filter(model: Model, state: EkfState, i: int, sample: Sample) -> None:
    """``recursion._step`` by filterpy."""
    ns, nx, noise, new = model.sizes.states, model.sizes.dynamic, state.noise, sample.new
    step = step_of(model, sample, bool(state.ratios[i] == ESTIMATED), state.direction[i])
    moved = transition(model, state.z[i], step)
    after, jacobian = moved.after, moved.jacobian
    rate = max(sample.dt_s / model.adapt_s, 1.0 / (float(state.samples[i]) + 1.0))
    learn_noise(model, noise, state.memory, i, sample, state.z[i], after, rate)
    process = np.zeros((after.size, after.size))
    process[:nx, :nx] = process_noise(model, noise, i, jacobian, step)
    predicted, rows = measure(model, after, step)
    course = step.course_variance
    added = float(input_noise(model, jacobian, rows[ns], after, noise.inputs[i], course, process[:nx, :nx]))
    process[-ns:, -ns:] = np.diag(trim_drift(model, noise, i, step))
    measured = np.ones(ns + 1, dtype=bool)
    measured[0] = new[model.sizes.kinematic + VANE] == 1.0
    measured[ns] = model.use_accelerometer
    kalman = _Filter(after, state.cov[i], jacobian, process, int(measured.sum()))
    kalman.predict()
    reading = new[1 : 2 + ns].copy()
    known = model.sizes.kinematic + CONDITION_COLUMNS
    reading[ns] += model.lever_m[1:] @ new[known : known + ns - 1]
    prediction = Prediction(after, np.diagonal(kalman.P)[:nx].copy())
    force = float(predicted[ns] - after[-ns] * step.pressure_ratio)
    variance = noise.reading[i].copy()
    variance[ns] += noise.gain[i] * force**2 + added
    readings = Readings(variance, reading - predicted, rows[ns], measured)
    gains = _gains(model, kalman.P, readings)
    _follow_input_errors(model, state, i, jacobian, step.newest_fraction, (readings, gains))
    kalman.R = np.diag(variance[measured])
    kalman.update(reading[measured], lambda _: rows[measured], lambda _: predicted[measured])
    state.z[i], state.cov[i] = kalman.x, 0.5 * (kalman.P + kalman.P.T)
    posterior = Posterior(state.z[i], state.cov[i])
    residual = float(reading[ns] - predicted[ns] - rows[ns] @ (posterior.z - after))
    explained = float(rows[ns] @ posterior.cov @ rows[ns])
    residuals = Residuals(residual, explained, force, added, float(new[1] - posterior.z[0]))
    adapt_noise(model, noise, i, posterior, prediction, step, residuals, rate)
    square = np.empty((ns + 1, ns + 1))
    follow_moment_levels(model, running(state), i, step, jacobian, (readings, gains), rate, square)
    follow_coherence(model, state.coherence, i, state.z[i], step, gains)


def _gains(model: Model, predicted: Array, readings: Readings) -> Gains:
    """Of measurements taken one by one; the innovations come with them."""
    size, m = readings.row.size, (model.sizes.states + 2) // 2 * 2
    gains = Gains(np.zeros((m, size)), np.zeros(m), np.zeros(m))
    correct(model, Posterior(np.zeros(size), 0.5 * (predicted + predicted.T)), readings, gains)
    return gains


def _follow_input_errors(
    model: Model, state: EkfState, i: int, jacobian: Array, newest_fraction: Array,
    measured: tuple[Readings, Gains],
) -> None:  # fmt: skip
    work = np.empty(model.sizes.dynamic)
    predict_input_errors(model, state.input_errors, i, jacobian, newest_fraction, work)
    correct_input_errors(model, state.input_errors, i, *measured, work)


class _Filter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy carries no types
    """filterpy's filter with the state's prediction handed in instead of F x."""

    def __init__(
        self, after: Array, covariance: Array, jacobian: Array, process: Array, readings: int
    ) -> None:
        super().__init__(dim_x=after.size, dim_z=readings)
        self.x, self.P, self.Q = after.copy(), covariance.copy(), process
        self.F = np.eye(after.size)
        self.F[: jacobian.shape[0]] = jacobian

    def predict_x(self, u: float = 0) -> None:
        """The state has been predicted by the model already."""
