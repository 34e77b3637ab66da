"""Compiled extended Kalman filter: predict, correct and adapt, sample by sample, for a batch of vehicles.

Derivation in ``docs/methods/kalman_filter.md``. Nothing here allocates per sample: a step is computed in the
``Workspace``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.adaptation import (
    Prediction,
    Residuals,
    adapt_noise_inline,
    adapt_vane,
    first_noise,
    inertial_motion,
    learn_noise,
)
from wingwatch.estimators.ekf.coherence import follow_coherence_inline, forget_motion
from wingwatch.estimators.ekf.covariance import correct, predict
from wingwatch.estimators.ekf.inputs import (
    correct_input_errors,
    input_error_effect,
    input_noise_into,
    predict_input_errors,
    track_readings,
)
from wingwatch.estimators.ekf.model import acceleration_state, accelerometer, gust_decay, transition_into
from wingwatch.estimators.ekf.moment_level import follow_moment_levels_inline, forget_moment_levels
from wingwatch.estimators.ekf.noise import PATH_STD, process_noise_into, trim_drift_into
from wingwatch.estimators.ekf.sample import (
    Drive,
    Gains,
    Posterior,
    Readings,
    Sample,
    Step,
    Transition,
    Workspace,
)
from wingwatch.estimators.ekf.state import (
    ACCELERATION,
    AIRSPEED,
    ALPHA,
    CONDITION_ALPHA,
    DENSITY,
    EARLIER,
    ESTIMATED,
    NEWEST,
    PATH,
    PRESSURE_RATIO,
    TIME,
    VANE,
    EkfState,
    Model,
    running,
    sizes_of,
)
from wingwatch.estimators.kernels.intersample import means_of_rows
from wingwatch.estimators.kernels.levels import start_level
from wingwatch.estimators.kernels.reading_noise import forget_readings
from wingwatch.estimators.lanes import Lanes, all_lanes
from wingwatch.estimators.signals import CONDITION_COLUMNS
from wingwatch.kernels.by_address import ByAddress
from wingwatch.kernels.decorators import hot, lean, part, sizes, whole, whole_entry
from wingwatch.telemetry import MAX_GAP_S

__all__ = [
    "SETTLE_S",
    "WARM_UP",
    "Notes",
    "Runner",
    "notes_of",
    "step_of",
    "track_condition",
]

Array = NDArray[np.float64]

WARM_UP = 10
"""Samples that only set the states and the first noise variances."""

CONDITION_S = 5.0
"""Time over which the angle of attack is averaged that estimates are reported at."""

SETTLE_S = 5.0
"""Time in which only noise is learned where gusts have to be separated from the vane's own noise."""


class Notes(NamedTuple):
    """What the filter has at each of some solutions (axis s) of a run."""

    z: Array
    """(s, nz)."""
    cov: Array
    """(s, nz, nz)."""
    moments: Array
    """(s, ns + nu, 4): as ``EkfState.moments``."""
    error_information: Array
    """(s, nu, ns, ns): of ``InputErrors``."""


_sizes_of = part(sizes_of)


@part
def _drive(ns, nu, gusts):  # type: ignore[no-untyped-def]
    return Drive(
        np.empty(nu), np.empty(nu), np.empty(nu), np.empty(nu), np.empty(nu), np.empty(ns * (ns + nu)), np.empty(ns),
        np.empty(ns), np.empty(gusts),
    )  # fmt: skip


@part
def _step_on(drive, sample, rolling, direction, kinematic):  # type: ignore[no-untyped-def]
    """The step of a sample on the arrays of ``drive``, which ``_fill_step`` fills."""
    return Step(
        sample.dt_s, sample.new[kinematic + PRESSURE_RATIO], max(sample.new[kinematic + AIRSPEED], 1.0),
        sample.inertial, rolling, direction, drive.inputs, drive.early, drive.newest_fraction, drive.course_variance,
        drive.inputs_end, drive.scale, drive.forward, drive.rest, drive.decay,
    )  # fmt: skip


@whole
def step_of(model, sample, rolling, direction):  # type: ignore[no-untyped-def]
    """What drives the model over the step of a ``Sample``; the rest as in ``Step``."""
    drive = _drive(model.sizes.states, model.sizes.inputs, model.sizes.gusts)
    step = _step_on(drive, sample, rolling, direction, model.sizes.kinematic)
    _fill_step(model, sample, step)
    return step


@hot
def _fill_step(model, sample, step):  # type: ignore[no-untyped-def]
    """Into the arrays of ``step`` what its sample says."""
    ns, nu, kinematic = model.sizes.states, model.sizes.inputs, model.sizes.kinematic
    new, old = sample.new, sample.old
    for j in range(nu):
        c = 2 + ns + j
        means = means_of_rows(new, old, sample.older, j, 2 + ns, model.servos, model.input_variance)
        step.inputs_end[j], step.inputs[j] = new[c], old[c] + means.mean
        step.early[j], step.newest_fraction[j], step.course_variance[j] = (
            means.early,
            means.newest,
            means.variance,
        )
    speed = new[kinematic + AIRSPEED]
    pressure = (
        new[kinematic + DENSITY] * speed / (model.reference_airspeed_m_s * model.reference_density_kg_m3)
    )
    for k in range(ns):
        for c in range(ns + nu):
            step.scale[k * (ns + nu) + c] = pressure if c < ns else step.pressure_ratio
    alpha = new[kinematic + ALPHA]
    if not np.isfinite(alpha):
        alpha = 0.0
    forward, rest = step.forward, step.rest
    forward[:] = 0.0
    forward[ns - 1] = speed * np.cos(alpha) * (1.0 if model.longitudinal else -1.0)
    if model.roll:
        forward[1] = speed * np.sin(alpha)
    rest[0] = 0.5 * (old[kinematic] + new[kinematic])
    known_moments = kinematic + CONDITION_COLUMNS
    for j in range(1, ns):
        rest[0] -= forward[j] * 0.5 * (old[1 + j] + new[1 + j])
        rest[j] = 0.5 * (old[known_moments + j - 1] + new[known_moments + j - 1])
    if model.sizes.gusts > 0:
        gust_decay(model, step.dt_s, step.airspeed_m_s, step.decay)


@hot
def _restart(model, posterior, noise, i, new, dt):  # type: ignore[no-untyped-def]
    """States as measured; the derivatives keep what is known of them.

    The air is calm but for unmeasured accelerations, which are what they are at any time, given steps of ``dt``.
    """
    ns, z, cov = model.sizes.states, posterior.z, posterior.cov
    for k in range(model.sizes.dynamic):
        z[k] = new[1 + k] if k < ns else 0.0
        for c in range(z.size):
            cov[k, c] = 0.0
            cov[c, k] = 0.0
    for k in range(ns):
        cov[k, k] = noise.reading[i, k]
    if model.sizes.gusts > 0 and 0.0 < dt <= MAX_GAP_S:
        passing = max(new[model.sizes.kinematic + AIRSPEED], 1.0) / model.gust_length_m[ACCELERATION]
        for k in range(ns):
            if not (model.roll or k == 1):
                continue
            c = acceleration_state(ns, k)
            cov[c, c] = noise.unmeasured[i, k] / -np.expm1(-2.0 * dt * passing)
    for g in range(PATH, PATH + ns if model.sizes.gusts > 0 else PATH):
        cov[ns + g, ns + g] = PATH_STD * PATH_STD


@hot
def track_condition(condition, new, kinematic, dt):  # type: ignore[no-untyped-def]
    """Where the estimate is reported: as measured now, but the angle of attack is that of the last seconds' mean."""
    alpha, fresh = condition[CONDITION_ALPHA], new[kinematic + ALPHA]
    for j in range(CONDITION_ALPHA):
        condition[j] = new[kinematic + PRESSURE_RATIO + j]
    condition[CONDITION_ALPHA] = fresh
    if np.isfinite(alpha) and np.isfinite(fresh) and 0.0 < dt <= MAX_GAP_S:
        condition[CONDITION_ALPHA] = alpha + (1.0 - np.exp(-dt / CONDITION_S)) * (fresh - alpha)


@part
def _take_readings(model, noise, i, sample, z, step, readings):  # type: ignore[no-untyped-def]
    """What is measured after a predicted step, with variances and innovations; returns the predicted specific force
    and the variance that the inputs' reading errors add to it."""
    ns, kinematic, new = model.sizes.states, model.sizes.kinematic, sample.new
    predicted = accelerometer(model, z, step, readings.row)
    force = predicted - z[model.sizes.augmented - ns] * step.pressure_ratio
    added = 0.0
    for j in range(model.sizes.inputs):
        added += input_error_effect(model, readings.row, z, j, noise.inputs[i, j]) ** 2
    for j in range(ns + 1):
        readings.innovation[j] = new[1 + j] - (z[j] if j < ns else predicted)
        readings.variance[j] = noise.reading[i, j]
        readings.measured[j] = True
    for j in range(1, ns):  # an accelerometer away from the c.g. reads less lever times these too
        readings.innovation[ns] += model.lever_m[j] * new[kinematic + CONDITION_COLUMNS + j - 1]
    readings.variance[ns] += noise.gain[i] * force * force + added
    readings.measured[0] = new[kinematic + VANE] == 1.0
    readings.measured[ns] = model.use_accelerometer
    return force, added


@part
def _step(model, state, i, sample, first_time, space):  # type: ignore[no-untyped-def]
    """One sample of one vehicle: predict, correct, learn the noise.

    What needs no filter is learned only the ``first_time`` that a sample is run.
    """
    noise, z, cov, transition = state.noise, state.z[i], state.cov[i], space.transition
    after, jacobian, readings = transition.after, transition.jacobian, space.readings
    rolling = state.ratios[i] == ESTIMATED
    step = _step_on(space.drive, sample, rolling, state.direction[i], model.sizes.kinematic)
    _fill_step(model, sample, step)
    transition_into(model, z, step, transition)
    rate = sample.dt_s / model.adapt_s
    if first_time:
        rate = max(rate, 1.0 / (state.samples[i] + 1.0))
        learn_noise(model, noise, state.memory, i, sample, z, after, rate)
    trim_drift_into(model, noise, i, step, space.drift)
    process_noise_into(model, noise, i, jacobian, step, space.sources, space.process)
    input_noise_into(model, jacobian, z, noise.inputs[i], step.course_variance, space.variance, space.process)
    predict_input_errors(model, state.input_errors, i, jacobian, step.newest_fraction, space.variance)
    predict(model, cov, space.process, jacobian, space.drift, space.product)
    for c in range(model.sizes.augmented):
        z[c] = after[c]
    for a in range(model.sizes.dynamic):
        space.variance[a] = cov[a, a]
    predicted, added = _take_readings(model, noise, i, sample, z, step, readings)
    posterior = Posterior(z, cov)
    residual, explained = correct(model, posterior, readings, space.gains)
    correct_input_errors(model, state.input_errors, i, readings, space.gains, space.sources[0])
    residuals = Residuals(residual, explained, predicted, added, sample.new[1] - z[0])
    prediction = Prediction(after, space.variance)
    if first_time:
        adapt_vane(noise, i, posterior, step, residuals, rate)
    adapt_noise_inline(model, noise, i, posterior, prediction, step, residuals, rate)
    follow_moment_levels_inline(model, state, i, step, jacobian, (readings, space.gains), rate, space.square)
    if first_time:
        follow_coherence_inline(model, state.coherence, i, z, step, space.gains)


@part
def _warm_up(model, state, i, sample, settled):  # type: ignore[no-untyped-def]
    """A sample that only sets the states and the first noise variances."""
    z, ns, samples = state.z[i], model.sizes.states, state.samples[i]
    if np.isfinite(sample.older[TIME]) and not settled:
        rate = max(sample.dt_s / model.adapt_s, 1.0 / (samples - 1.0))
        stated = model.stated_variance[
            0
        ]  # no residual has shown it yet: else as much as the differences allow
        state.noise.reading[i, 0] = stated if stated > 0.0 else np.inf
        learn_noise(model, state.noise, state.memory, i, sample, z, z, rate)
        second = sample.new[1 + ns] - 2.0 * sample.old[1 + ns] + sample.older[1 + ns]
        state.memory.roughness[i] += second * second
        first_noise(model, state.noise, state.memory, i, sample, samples)
    _restart(model, Posterior(z, state.cov[i]), state.noise, i, sample.new, sample.dt_s)


@part
def _take(model, state, i, new, first_time, space):  # type: ignore[no-untyped-def]
    """One signal row of one vehicle."""
    kinematic, old, older = model.sizes.kinematic, state.rows[i, NEWEST], state.rows[i, EARLIER]
    dt = new[TIME] - old[TIME]
    if not (0.0 < dt <= MAX_GAP_S):
        _restart(model, Posterior(state.z[i], state.cov[i]), state.noise, i, new, old[TIME] - older[TIME])
        start_level(state.memory.levels[i], new[1])
        forget_moment_levels(state.moment_level, i)
        forget_motion(state.coherence, i)
        for j in range(state.memory.readings.shape[1]):
            forget_readings(state.memory.readings[i, j])
        state.input_errors.age[i] = 0
        older[:] = np.nan
    else:
        state.samples[i] += 1
        inertial = model.use_accelerometer and new[kinematic + VANE] == 1.0 and old[kinematic + VANE] == 1.0
        settling = first_time and inertial and state.samples[i] * dt < SETTLE_S
        settled = state.samples[i] > WARM_UP and not settling
        state.settling[i] = not settled
        motion = inertial_motion(new, old, dt, model.sizes.states, kinematic) if inertial else 0.0
        sample = Sample(new, old, older, dt, inertial, motion)
        if settled and np.isfinite(older[TIME]):
            _step(model, state, i, sample, first_time, space)
        else:
            _warm_up(model, state, i, sample, settled)
        for c in range(new.size):
            older[c] = old[c]
    for c in range(new.size):
        old[c] = new[c]
    track_condition(state.condition[i], new, kinematic, dt)
    track_readings(state.moments[i], new, model.sizes.states, model.sizes.inputs)


@part
def _note(state, i, s, notes):  # type: ignore[no-untyped-def]
    """What the filter has now becomes note ``s``; moments begin anew."""
    for a in range(notes.z.shape[1]):
        notes.z[s, a] = state.z[i, a]
        for b in range(notes.z.shape[1]):
            notes.cov[s, a, b] = state.cov[i, a, b]
    ns, information = notes.error_information.shape[2], state.input_errors.information[i]
    for j in range(notes.moments.shape[1]):
        for c in range(notes.moments.shape[2]):
            notes.moments[s, j, c] = state.moments[i, j, c]
    for j in range(notes.error_information.shape[1]):
        for a in range(ns):
            for b in range(ns):
                notes.error_information[s, j, a, b] = information[j, a, b]
    state.moments[i] = 0.0


@lean
def _run(lengths, given, state, given_rows, ends, first_time, notes, space):  # type: ignore[no-untyped-def]
    """``_update_all`` in a workspace; the sizes in ``lengths`` take the place of those in the model."""
    model = Model(
        _sizes_of(len(lengths[0]), len(lengths[1]), len(lengths[2])), given.longitudinal, given.roll,
        given.use_accelerometer, given.adapt_s, given.trim_corner_rad_s, given.memory_s, given.stale_s,
        given.reference_airspeed_m_s, given.reference_density_kg_m3, given.stated_variance, given.input_variance,
        given.servos, given.lever_m, given.gust_length_m, given.gust_direction, given.prior_value, given.prior_std,
    )  # fmt: skip
    signals, lanes = given_rows
    for m in range(lanes.place.size):
        i, begin = lanes.place[m], 0
        for s in range(ends.size):
            for k in range(begin, min(ends[s], lanes.counts[m])):
                new = signals[m, k]
                complete = True
                for c in range(model.sizes.kinematic + ALPHA):
                    complete = complete and np.isfinite(new[c])
                if complete:
                    _take(model, state, i, new, first_time, space)
            begin = ends[s]
            if s < notes.z.shape[0]:
                _note(state, i, s, notes)


@whole_entry
def _update_all(lengths, model, state, rows, ends, first_time, notes):  # type: ignore[no-untyped-def]
    ns, nx, nz = model.sizes.states, model.sizes.dynamic, model.sizes.augmented
    square, readings = (ns, ns), (ns + 2) // 2 * 2
    space = Workspace(
        _drive(ns, model.sizes.inputs, model.sizes.gusts),
        Transition(
            np.empty(nz), np.empty((nx, nz)), np.empty(square), np.empty(square), np.empty(square), np.empty(square),
            np.empty(square), np.empty(ns), np.empty(ns), np.empty(model.sizes.gusts),
        ),
        np.empty((nx, nx)), np.empty((2, nx)), np.empty(ns), np.empty((nx, nz)),
        Readings(np.empty(ns + 1), np.empty(ns + 1), np.empty(nz), np.empty(ns + 1, dtype=np.bool_)),
        Gains(np.zeros((readings, nz)), np.zeros(readings), np.zeros(readings)),
        np.empty(nx), np.empty((ns + 1, ns + 1)),
    )  # fmt: skip
    _run(lengths, model, state, rows, ends, first_time, notes, space)


def notes_of(model: Model, solutions: int) -> Notes:
    """Room for so many solutions."""
    ns, nu, nz = model.sizes.states, model.sizes.inputs, model.sizes.augmented
    return Notes(
        np.empty((solutions, nz)), np.empty((solutions, nz, nz)), np.empty((solutions, ns + nu, 4)),
        np.empty((solutions, nu, ns, ns)),
    )  # fmt: skip


class Runner:
    """Runs rows through one filter; for kernels its model and its state are described once.

    Args:
        model: of the filter.
    """

    def __init__(self, model: Model) -> None:
        self._lengths = sizes(model.sizes.states, model.sizes.inputs, model.sizes.gusts)
        self._model, self._no_notes = ByAddress(model), notes_of(model, 0)
        self._state: EkfState | None = None
        self._running: ByAddress | None = None

    def update(self, state: EkfState, signals: Array, lanes: Lanes) -> None:
        """Run all samples of some vehicles, (vehicles, samples, columns)."""
        if self._state is not state:
            self._state, self._running = state, ByAddress(running(state))
        ends = np.array([signals.shape[1]])
        rows = signals, lanes
        _update_all(self._lengths, self._model, self._running, rows, ends, True, self._no_notes)

    def again(self, run: ByAddress, signals: Array, ends: NDArray[np.int64], notes: Notes) -> None:
        """Run rows of one vehicle that have been run before: the noise of sensors and vane is known.

        The other variances go on being learned from where they are.

        Args:
            run: ``Running`` of one vehicle, advanced in place.
            signals: (rows, columns).
            ends: rows before each solution, rising, (solutions,).
            notes: filled with what the filter has at each solution; for as many at least.
        """
        rows = signals[None], all_lanes(1, len(signals))
        _update_all(self._lengths, self._model, run, rows, ends, False, notes)
