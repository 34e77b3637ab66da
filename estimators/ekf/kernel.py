"""Compiled extended Kalman filter: predict, correct, adapt and forget, for a batch of vehicles.

Derivation: ``docs/methods/kalman_filter.md``. Nothing allocates per sample: what a step needs is in ``Scratch``.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.estimators.ekf.covariance import correct, predict
from wingwatch.estimators.ekf.inputs import (
    echo_after,
    echo_before,
    heard_by,
    input_noise_into,
    track_inputs,
)
from wingwatch.estimators.ekf.model import accelerometer, transition_into
from wingwatch.estimators.ekf.noise import (
    LEAST,
    NOISE_TAIL,
    adapt_accelerometer,
    adapt_unrest,
    difference_variance,
    process_noise_into,
    sensor_noise,
    trim_drift_into,
)
from wingwatch.estimators.kernels.hot import hot, lean, part, sizes
from wingwatch.estimators.kernels.intersample import course
from wingwatch.estimators.kernels.levels import LEVELS, advance_level, start_level
from wingwatch.estimators.signals import CONDITION_COLUMNS, MAX_GAP_S

__all__ = [
    "SETTLE_S",
    "WARM_UP",
    "Fixed",
    "air_decay",
    "learn_after",
    "learn_before",
    "run_again",
    "step_inputs",
    "update_all",
]

Array = NDArray[np.float64]

WARM_UP = 10
"""Samples that only set the states and the first noise levels."""

CONDITION_S = 5.0
"""Time over which the angle of attack is averaged that estimates are reported at."""

SETTLE_S = 5.0
"""Time in which only noise levels are learned where gusts have to be told from the vane's own noise."""


class Fixed(NamedTuple):
    """What stays as it is for a filter, as ``update_all`` takes it."""

    servo_s: Array
    input_variance: Array
    lever: Array
    exponents: Array
    reference: Array
    longitudinal: bool
    roll: bool
    use_accelerometer: bool
    settings: Array
    gust_m: Array
    direction: Array


class Scratch(NamedTuple):
    """Where a step works; one for all vehicles. Names as in the functions that use them."""

    over: Array
    bend: Array
    at_end: Array
    scale: Array
    forward: Array
    rest: Array
    decay: Array
    after: Array
    jacobian: Array
    a: Array
    aerodynamic: Array
    a2: Array
    a3: Array
    series: Array
    b: Array
    lasting: Array
    process: Array
    uw: Array
    drift: Array
    top: Array
    row: Array
    variance: Array
    excess: Array
    measured: NDArray[np.bool_]
    gains: Array
    pushes: Array
    roots: Array
    spread: Array


@njit(cache=True)
def _scratch(ns, nu, gusts):  # type: ignore[no-untyped-def]
    nx, k = ns + gusts, ns * (ns + nu)
    nz, readings = nx + k + ns, (ns + 2) // 2 * 2
    return Scratch(
        np.empty(nu), np.empty((2, nu)), np.empty(nu), np.empty(k), np.empty(ns), np.empty(ns), np.empty(gusts),
        np.empty(nz), np.empty((nx, nz)), np.empty((ns, ns)), np.empty((ns, ns)), np.empty((ns, ns)),
        np.empty((ns, ns)), np.empty((ns, ns)),
        np.empty((2, ns)), np.empty(2), np.empty((nx, nx)), np.empty((2, nx)), np.empty(ns), np.empty((nx, nz)),
        np.empty(nz), np.empty(ns + 1), np.empty(ns + 1), np.empty(ns + 1, dtype=np.bool_),
        np.zeros((readings, nz)), np.zeros(readings), np.zeros(readings), np.empty(nx),
    )  # fmt: skip


@njit(cache=True)
def step_inputs(new, old, older, servo_s, reference, exponents, longitudinal, roll, by_accelerometer, ns, nu):  # type: ignore[no-untyped-def]
    """What a step needs besides the state: see ``_step_inputs_into``."""
    over, bend, at_end = np.empty(nu), np.empty((2, nu)), np.empty(nu)
    scale, forward, rest = np.empty(ns * (ns + nu)), np.empty(ns), np.empty(ns)
    kappa = _step_inputs_into(
        new, old, older, servo_s, reference, exponents, longitudinal, roll, by_accelerometer, ns, nu, over, bend,
        at_end, scale, forward, rest,
    )  # fmt: skip
    return over, bend, at_end, scale, forward, kappa, rest


@hot
def _step_inputs_into(  # type: ignore[no-untyped-def]
    new, old, older, servo_s, reference, exponents, longitudinal, roll, by_accelerometer, ns, nu, over, bend, at_end,
    scale, forward, rest,
):  # fmt: skip
    """Into ``over`` the inputs' mean over the step, into ``bend`` (2, nu) how early they come and the newer reading's
    share in the mean (``intersample.course``), then inputs at the end, scale, forward and rest; returns kappa."""
    kinematic, dt = 2 + ns + nu, new[0] - old[0]
    for j in range(nu):
        c = 2 + ns + j
        at_end[j] = new[c]
        mean, early = course(dt, servo_s[j], old[c] == older[c])
        over[j] = old[c] + mean * (new[c] - old[c])
        bend[0, j], bend[1, j] = early * (new[c] - old[c]), mean
    kappa, speed, density = new[kinematic + 1], new[kinematic + 2], new[kinematic + 3]
    pressure = density * speed / (reference[0] * reference[1])
    for k in range(ns):
        for c in range(ns + nu):
            scale[k * (ns + nu) + c] = pressure if exponents[c] == 1.0 else kappa
    alpha = new[kinematic + 5]
    if not np.isfinite(alpha):
        alpha = 0.0
    forward[:] = 0.0
    forward[ns - 1] = speed * np.cos(alpha) * (1.0 if longitudinal else -1.0)
    if roll:
        forward[1] = speed * np.sin(alpha)
    rest[0] = 0.5 * (old[kinematic] + new[kinematic])
    if by_accelerometer:
        rest[0] += 0.5 * (old[1 + ns] + new[1 + ns])
    known_moments = kinematic + CONDITION_COLUMNS
    for j in range(1, ns):
        rest[0] -= forward[j] * 0.5 * (old[1 + j] + new[1 + j])
        rest[j] = 0.5 * (old[known_moments + j - 1] + new[known_moments + j - 1])
    return kappa


@njit(cache=True)
def air_decay(gust_m, speed, dt):  # type: ignore[no-untyped-def]
    """How much of the air's unrest outlasts a step, by the lengths that the span smooths it over (m)."""
    return np.exp(-dt * max(speed, 1.0) / gust_m)


@hot
def learn_before(  # type: ignore[no-untyped-def]
    noise, lags, level, stated, new, old, older, z, after, dt, adapt_s, known, kinematic, carried, ns
):
    """Noise levels that need no filter: the sensors', and the gust that the vane sees against inertial motion.

    ``after`` is what the filter foresees after ``z``, ``known`` the number of samples that the means rest on; returns
    the weight of a sample in them.
    """
    rate = max(dt / adapt_s, 1.0 / (known + 1.0))
    motion = 0.0
    if carried:
        force = 1 + ns
        motion = 0.5 * dt * (new[force] + new[kinematic] + old[force] + old[kinematic])
    sensor_noise(noise, lags, stated, new, old, older, motion, z, after, rate, carried, ns)
    if carried:
        index = advance_level(level, new[1], motion, dt, adapt_s)
        gain = level[0, index]
        noise[ns + 1] = gain * gain / (1.0 - gain) * noise[0]
    return rate


@njit(cache=True)
def learn_after(  # type: ignore[no-untyped-def]
    noise,
    slow,
    z,
    cov,
    before,
    spread,
    row,
    excess,
    swing,
    heard,
    decay,
    rate,
    carried,
    use_accelerometer,
    ns,
    gusts,
):
    """Noise levels that the filter's own corrections tell: the accelerometer's equation and the unrest.

    Args:
        noise, slow: levels and slow sums, advanced.
        z, cov: after correction; before: z before it; spread: the variances before it, (nx,).
        heard: variance that the inputs' reading errors add to the accelerometer's equation.
        row, excess: the accelerometer's Jacobian, and reading less expectation.
    """
    residual = excess - row @ (z - before)
    explained = row @ (cov @ row)
    _learn_from_corrections(
        noise, slow, z, cov, before, spread, residual, explained, swing, heard, decay, rate, carried, use_accelerometer,
        ns, gusts,
    )  # fmt: skip


@hot
def _learn_from_corrections(  # type: ignore[no-untyped-def]
    noise,
    slow,
    z,
    cov,
    before,
    spread,
    residual,
    explained,
    swing,
    heard,
    decay,
    rate,
    carried,
    use_accelerometer,
    ns,
    gusts,
):
    """``learn_after`` where the accelerometer's residual and its variance due to the state are known."""
    if use_accelerometer:
        adapt_accelerometer(noise, residual * residual + explained, swing, heard, rate, ns)
    if not carried:
        noise[ns + 1], slow[0] = adapt_unrest(
            noise[ns + 1], slow[0], z[0] - before[0], spread[0], cov[0, 0], 1.0, rate
        )
        noise[ns + 1] = max(noise[ns + 1], 1e-4 * LEAST)
    if gusts > 0:
        noise[ns + 2], slow[1] = adapt_unrest(
            noise[ns + 2], slow[1], z[ns] - before[ns], spread[ns], cov[ns, ns], decay[0], rate
        )
        noise[ns + 2] = max(noise[ns + 2], LEAST)


@hot
def _restart(z, cov, noise, new, ns, nx):  # type: ignore[no-untyped-def]
    """States as measured and calm air; the derivatives keep what is known of them."""
    for k in range(nx):
        z[k] = new[1 + k] if k < ns else 0.0
        for c in range(z.size):
            cov[k, c] = 0.0
            cov[c, k] = 0.0
    for k in range(ns):
        cov[k, k] = noise[k]


@hot
def _first_levels(noise, lags, roughness, count, dt, carried, ns):  # type: ignore[no-untyped-def]
    """Levels that the filter starts from: all of the accelerometer's roughness is noise, the air is as restless as the
    first rate's second differences say."""
    noise[ns] = max(roughness / (6.0 * max(count - 2.0, 1.0)), LEAST)
    if not carried:
        noise[ns + 1] = 1e-4 * noise[0]
    restless = max(difference_variance(lags[1, 2]) - 6.0 * noise[1], 0.01 * noise[1])
    noise[ns + 2] = restless / (dt * dt)


@hot
def track_condition(condition, new, kinematic, dt):  # type: ignore[no-untyped-def]
    """Where the estimate is reported: as measured now, but the angle of attack is that of the last seconds' mean."""
    alpha, fresh = condition[4], new[kinematic + 5]
    for j in range(4):
        condition[j] = new[kinematic + 1 + j]
    condition[4] = fresh
    if np.isfinite(alpha) and np.isfinite(fresh) and 0.0 < dt <= MAX_GAP_S:
        condition[4] = alpha + (1.0 - np.exp(-dt / CONDITION_S)) * (fresh - alpha)


@part
def _step(  # type: ignore[no-untyped-def]
    z, cov, noise, lags, level, slow, new, old, older, dt, echo, counts, settings, servo_s, input_variance,
    lever, exponents, reference, gust_m, direction, longitudinal, roll, use_accelerometer, carried, first_time, s, ns,
    nu, gusts,
):  # fmt: skip
    """One sample of one vehicle: predict, correct, learn the noise; ``s`` is scratch.

    What needs no filter is learned only the ``first_time`` that a sample is run.
    """
    kinematic, nx = 2 + ns + nu, ns + gusts
    nz = nx + ns * (ns + nu) + ns
    kappa = _step_inputs_into(
        new, old, older, servo_s, reference, exponents, longitudinal, roll, carried, ns, nu, s.over, s.bend, s.at_end,
        s.scale, s.forward, s.rest,
    )  # fmt: skip
    speed = max(new[kinematic + 2], 1.0)
    for g in range(gusts):
        s.decay[g] = np.exp(-dt * speed / gust_m[g])
    transition_into(
        z, dt, s.scale, s.forward, s.over, s.bend[0], kappa, s.rest, s.decay, direction, carried, ns, nu, gusts, s.a,
        s.aerodynamic, s.a2, s.a3, s.series, s.b, s.lasting, s.after, s.jacobian,
    )  # fmt: skip
    rate = dt / settings[0]
    if first_time:
        rate = learn_before(
            noise, lags, level, settings[2:], new, old, older, z, s.after, dt, settings[0], counts[0], kinematic,
            carried, ns,
        )  # fmt: skip
    trim_drift_into(noise, dt, settings[1], carried, ns, s.drift)
    process_noise_into(noise, s.jacobian, dt, speed, s.decay, longitudinal, ns, gusts, s.uw, s.process)
    input_noise_into(s.jacobian, z, input_variance, ns, nu, gusts, s.spread, s.process)
    echo_before(echo, counts[2], s.jacobian, s.bend[1], input_variance, ns, nu, gusts, s.spread)
    predict(cov, s.process, s.jacobian, s.drift, s.top, ns, nx, nz)
    for c in range(nz):
        z[c] = s.after[c]
    for a in range(nx):
        s.spread[a] = cov[a, a]
    expected = accelerometer(z, s.scale, s.at_end, kappa, lever, direction, ns, nu, gusts, s.row)
    swing = expected - z[nz - ns] * kappa
    heard = 0.0
    for j in range(nu):
        heard += heard_by(s.row, z, input_variance, j, ns, nu) ** 2
    for j in range(ns + 1):
        s.excess[j] = new[1 + j] - (z[j] if j < ns else expected)
        s.variance[j] = noise[j]
        s.measured[j] = True
    for j in range(1, ns):  # an accelerometer away from the c.g. reads less lever times these too
        s.excess[ns] += lever[j] * new[kinematic + CONDITION_COLUMNS + j - 1]
    s.variance[ns] += noise[noise.size - NOISE_TAIL] * swing * swing + heard
    s.measured[0] = new[kinematic + 6] == 1.0
    s.measured[ns] = use_accelerometer
    residual, explained = correct(
        z, cov, s.variance, s.excess, s.row, s.measured, ns, nz, s.gains, s.pushes, s.roots
    )
    counts[2] = echo_after(
        echo, counts[2], s.row, s.measured, s.gains, s.roots, input_variance, ns, nu, gusts, s.uw[0]
    )
    _learn_from_corrections(
        noise, slow, z, cov, s.after, s.spread, residual, explained, swing, heard, s.decay, rate, carried,
        use_accelerometer, ns, gusts,
    )  # fmt: skip


@hot
def _complete(row, columns):  # type: ignore[no-untyped-def]
    finite = True
    for j in range(columns):
        finite = finite and np.isfinite(row[j])
    return finite


@hot
def _warm_up(  # type: ignore[no-untyped-def]
    z,
    cov,
    noise,
    lags,
    level,
    roughness,
    new,
    old,
    older,
    dt,
    count,
    settings,
    kinematic,
    carried,
    settled,
    ns,
    nx,
):
    """A sample that only sets the states and the first noise levels."""
    if np.isfinite(older[0]) and not settled:
        learn_before(
            noise, lags, level, settings[2:], new, old, older, z, z, dt, settings[0], count - 2.0, kinematic, carried,
            ns,
        )  # fmt: skip
        bend = new[1 + ns] - 2.0 * old[1 + ns] + older[1 + ns]
        roughness[0] += bend * bend
        _first_levels(noise, lags, roughness[0], count, dt, carried, ns)
    _restart(z, cov, noise, new, ns, nx)


@lean
def _update(  # type: ignore[no-untyped-def]
    known_sizes, signals, f, z, cov, noise, lags, level, slow, old, older, roughness, condition, moments, echo, counts,
    first_time, s,
):  # fmt: skip
    """Run all samples of one vehicle; ``old``, ``older`` are its last rows, ``f`` is ``Fixed``, ``s`` ``Scratch``."""
    ns, nu, gusts = len(known_sizes[0]), len(known_sizes[1]), len(known_sizes[2])
    nx = ns + gusts
    kinematic = 2 + ns + nu
    for k in range(signals.shape[0]):
        new = signals[k]
        if not _complete(new, kinematic + 5):
            continue
        dt = new[0] - old[0]
        if not (0.0 < dt <= MAX_GAP_S):
            _restart(z, cov, noise, new, ns, nx)
            start_level(level, new[1])
            counts[2] = 0
            older[:] = np.nan
        else:
            counts[0] += 1
            carried = f.use_accelerometer and new[kinematic + 6] == 1.0 and old[kinematic + 6] == 1.0
            settled = counts[0] > WARM_UP and not (first_time and carried and counts[0] * dt < SETTLE_S)
            if settled and np.isfinite(older[0]):
                _step(
                    z, cov, noise, lags, level, slow, new, old, older, dt, echo, counts, f.settings, f.servo_s,
                    f.input_variance, f.lever, f.exponents, f.reference, f.gust_m, f.direction, f.longitudinal,
                    f.roll, f.use_accelerometer, carried, first_time, s, ns, nu, gusts,
                )  # fmt: skip
            else:
                _warm_up(
                    z, cov, noise, lags, level, roughness, new, old, older, dt, counts[0], f.settings, kinematic,
                    carried, settled, ns, nx,
                )  # fmt: skip
            for c in range(new.size):
                older[c] = old[c]
        for c in range(new.size):
            old[c] = new[c]
        track_condition(condition, new, kinematic, dt)
        track_inputs(moments, new, 2 + ns, nu)


@njit(cache=True)
def _update_all(  # type: ignore[no-untyped-def]
    known_sizes, signals, ends, first_time, noted_z, noted_cov, noted_moments, noted_echo, servo_s, input_variance,
    lever, exponents, reference, longitudinal, roll, use_accelerometer, settings, gust_m, direction, z, cov, noise,
    lags, levels, slow, rows, roughness, condition, moments, echo, counts,
):  # fmt: skip
    """Runs the rows before each of ``ends`` in turn; notes what the filter has then, as far as there is room."""
    scratch = _scratch(len(known_sizes[0]), len(known_sizes[1]), len(known_sizes[2]))
    fixed = Fixed(
        servo_s, input_variance, lever, exponents, reference, longitudinal, roll, use_accelerometer, settings, gust_m,
        direction,
    )  # fmt: skip
    for i in range(signals.shape[0]):
        begin = 0
        for s in range(ends.size):
            _update(
                known_sizes, signals[i, begin : ends[s]], fixed, z[i], cov[i], noise[i], lags[i], levels[i], slow[i],
                rows[i, 0], rows[i, 1], roughness[i], condition[i], moments[i], echo[i], counts[i], first_time, scratch,
            )  # fmt: skip
            begin = ends[s]
            if s < noted_z.shape[0]:
                noted_z[s], noted_cov[s], noted_moments[s], noted_echo[s] = z[i], cov[i], moments[i], echo[i]
                moments[i] = 0.0


def _notes(solutions: int, nz: int, echo: tuple[int, ...]) -> tuple[Array, Array, Array, Array]:
    """Room for z, cov, moments and echo at so many solutions; ``echo`` is the shape of one vehicle's."""
    return (
        np.empty((solutions, nz)), np.empty((solutions, nz, nz)), np.empty((solutions, echo[0], 4)),
        np.empty((solutions, *echo)),
    )  # fmt: skip


def run_again(
    known_sizes: tuple[tuple[int, ...], ...], signals: Array, ends: NDArray[np.int64], fixed: Fixed, z: Array,
    cov: Array, noise: Array, slow: Array, rows: Array, echo: Array, counts: NDArray[np.int64],
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    """Runs rows of one vehicle that have been run before: the sensors' noise levels and the gust's are known.

    The others go on being learned from where they are.

    Args:
        known_sizes: of ``hot.sizes``: states, inputs, states of the air.
        signals: (rows, columns).
        ends: rows before each solution, rising, (solutions,).
        fixed: of the filter.
        z, cov, noise, slow, rows, echo, counts: as in ``EkfState``, of one vehicle, advanced in place.

    Returns:
        z, cov, moments since the solution before and echo at each solution.
    """
    ns, nu = len(known_sizes[0]), len(known_sizes[1])
    noted = _notes(ends.size, z.size, echo.shape)
    _update_all(
        known_sizes, signals[None], ends, False, *noted, *fixed, z[None], cov[None], noise[None], np.zeros((1, ns, 5)),
        np.zeros((1, 4, LEVELS)), slow[None], rows[None], np.zeros((1, 1)), np.zeros((1, 5)), np.zeros((1, nu, 4)),
        echo[None], counts[None],
    )  # fmt: skip
    return noted


def update_all(
    signals: Array, fixed: Fixed, z: Array, cov: Array, noise: Array, lags: Array, levels: Array, slow: Array,
    rows: Array, roughness: Array, condition: Array, moments: Array, echo: Array, counts: NDArray[np.int64],
) -> None:  # fmt: skip
    """Run all samples of all vehicles; arrays lead with the vehicle axis and are advanced in place.

    Args:
        signals: shape (vehicles, samples, columns).
        fixed: of the filter.
        z, ..., counts: of ``EkfState``.
    """
    _update_all(
        sizes(fixed.lever.size, fixed.servo_s.size, fixed.gust_m.size), signals, np.array([signals.shape[1]]), True,
        *_notes(0, z.shape[1], echo.shape[1:]), *fixed, z, cov, noise, lags, levels, slow, rows, roughness, condition,
        moments, echo, counts,
    )  # fmt: skip
