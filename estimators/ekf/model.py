"""The model of the extended Kalman filter: one step of states and parameters, and what is measured.

Augmented state: the mode's states x; the gust states (see below); the referred aerodynamic derivatives; one constant
per equation (trim). The states follow dx/dt = A x + B u + c kappa + rest, A and B from the derivatives at the present
dynamic pressure ratio kappa, with the forward speed added to its own columns; over one step the right-hand side
is integrated through the series of the matrix exponential, dt (I + A dt/2 + (A dt)^2/6 + (A dt)^3/24), and the
sensitivity to a derivative is taken at the middle of the step. Both engines run these functions.

The gust states are first-order processes with the time that the span takes to pass (MIL-F-8785C 3.7.5):

- an angular acceleration of the first rate by gusts that no vane sees. Where roll is a state it is what the roll rate
  of the air does, -l_p p_g, and the other equations answer to it as n_p / l_p. That ratio is as the derivatives are
  expected beforehand until l_p is known (``relinearise``), then as they are. As a product of two unknowns, l_p and p_g,
  the acceleration would bias both;
- the gust-induced pitch or yaw rate that belongs to the gust seen by the vane, q_g = -w_g'/V or r_g = v_g'/V.

The aerodynamics know only the rate relative to it. What it does beside what the derivatives by the rate say is a gust
state of every equation too (from PATH on), with a standard deviation of the derivative's natural size: taken as exact,
it would carry information about these derivatives that nobody has.
"""

import numpy as np

from wingwatch.estimators.ekf.sample import Transition
from wingwatch.estimators.ekf.state import ACCELERATION, PATH, TURN
from wingwatch.kernels.decorators import helper, hot, whole

__all__ = [
    "LEAST_DAMPING",
    "acceleration_state",
    "accelerometer",
    "gust_decay",
    "gust_turn",
    "measure",
    "transition",
    "transition_into",
]


NOTHING_LEFT = 1e-12
"""Of what decays within a step: it has passed at once."""


LEAST_DAMPING = 0.25
"""Damping of rolling, over what is expected, that is divided by: less is no number yet."""


LEAST_PART = 1e-9
"""Of a step that the exponential's series is taken of: a derivative that is no number ends the halving, too."""


@hot
def acceleration_state(ns, k):  # type: ignore[no-untyped-def]
    """Place (a scalar) in the augmented state of equation k's unmeasured acceleration, where that has one."""
    if k == 1:
        return ns + ACCELERATION
    return ns + PATH + ns + (0 if k == 0 else k - 1)


@hot
def mean_decay(decay):  # type: ignore[no-untyped-def]
    """Mean over a step of what decays to ``decay`` of itself in it, from 0 to 1."""
    if decay < NOTHING_LEFT:
        return 0.0
    if decay > 0.99:
        return 0.5 * (1.0 + decay)
    return (decay - 1.0) / np.log(decay)


@hot
def gust_turn(model):  # type: ignore[no-untyped-def]
    """Rate of the air that a gust's unit step makes, a scalar in 1/m: pitch +, yaw -, smoothed over the span; 0 without
    one."""
    if model.sizes.gusts == 0:
        return 0.0
    turn = 1.0 / model.gust_length_m[TURN]
    return turn if model.longitudinal else -turn


@hot
def gust_decay(model, dt_s, airspeed_m_s, out):  # type: ignore[no-untyped-def]
    """Of the gust states over a step, into ``out`` (ng,)."""
    for g in range(model.sizes.gusts):
        if model.gust_length_m[g] > 0.0:
            out[g] = np.exp(-dt_s * airspeed_m_s / model.gust_length_m[g])
        else:
            out[g] = np.exp(-dt_s / model.memory_s)


@hot
def _mean_gust(model, z, lasting):  # type: ignore[no-untyped-def]
    """Mean over a step of the air's rate."""
    if model.sizes.gusts == 0:
        return 0.0
    return lasting[TURN] * z[model.sizes.states + TURN]


@hot
def _path_size(model, scale, k):  # type: ignore[no-untyped-def]
    """Natural size of equation k's derivative by the last rate, the unit of its path."""
    last = (k + 1) * model.sizes.states + k * model.sizes.inputs - 1
    return model.prior_std[last] * scale[last]


@hot
def _path(model, z, scale, k):  # type: ignore[no-untyped-def]
    """What equation k makes of the air's rate beside what its derivative says."""
    return _path_size(model, scale, k) * z[model.sizes.states + PATH + k] if model.sizes.gusts > 0 else 0.0


@hot
def _damping(model, z, step):  # type: ignore[no-untyped-def]
    """Derivative of roll acceleration by roll rate, 1/s, where it may be divided by; else 0."""
    c = model.sizes.states + model.sizes.inputs + 1
    value = z[model.sizes.dynamic + c]
    return value * step.scale[c] if step.rolling and value < LEAST_DAMPING * model.prior_value[c] else 0.0


@hot
def _direction(model, z, step, k):  # type: ignore[no-untyped-def]
    """What equation k makes of the angular acceleration by air, over what the first rate's does."""
    damping = _damping(model, z, step) if model.roll and k != 1 else 0.0
    if damping == 0.0:
        return step.direction[k]
    c = k * (model.sizes.states + model.sizes.inputs) + 1
    return z[model.sizes.dynamic + c] * step.scale[c] / damping


@hot
def _add_direction(model, z, step, k, acceleration, row):  # type: ignore[no-untyped-def]
    """Adds to ``row`` (nz,) the sensitivity of ``_direction`` to the derivatives, times ``acceleration``."""
    damping = _damping(model, z, step) if model.roll and k != 1 else 0.0
    if damping == 0.0:
        return
    nd, first, scale = model.sizes.states + model.sizes.inputs, model.sizes.dynamic, step.scale
    row[first + k * nd + 1] += acceleration / damping * scale[k * nd + 1]
    row[first + nd + 1] -= acceleration / damping * _direction(model, z, step, k) * scale[nd + 1]


@hot
def _rates(model, z, step, work):  # type: ignore[no-untyped-def]
    """A and the part of dx/dt that does not depend on x."""
    ns, nu, gusts, nx = model.sizes.states, model.sizes.inputs, model.sizes.gusts, model.sizes.dynamic
    nd, scale, a, lasting = ns + nu, step.scale, work.system, work.mean_decay
    gust_rate = _mean_gust(model, z, lasting)
    for k in range(ns):
        work.early_rate[k] = 0.0
        total = z[nx + ns * nd + k] * step.pressure_ratio
        for j in range(ns):
            a[k, j] = z[nx + k * nd + j] * scale[k * nd + j]
        total -= (a[k, ns - 1] + _path(model, z, scale, k)) * gust_rate
        for j in range(nu):
            control = z[nx + k * nd + ns + j] * scale[k * nd + ns + j]
            total += control * step.inputs[j]
            work.early_rate[k] += control * step.early[j]
        if gusts > 0:
            total += _direction(model, z, step, k) * z[ns + ACCELERATION] * lasting[ACCELERATION]
            if model.roll and k != 1:
                total += z[acceleration_state(ns, k)] * lasting[ACCELERATION]
        work.rate[k] = total + step.rest[k]


@hot
def _multiply(a, b, n, out):  # type: ignore[no-untyped-def]
    for k in range(n):
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += a[k, m] * b[m, j]
            out[k, j] = total


@hot
def _series(a, ns, a2, a3, out):  # type: ignore[no-untyped-def]
    """phi = (e^A - 1)/A by I + A/2 + A^2/6 + A^3/24 into ``out``; a2 and a3 are workspace.

    Beyond one the series does not converge in four terms. It is that of a part G of A then, and phi(2 G) is phi(G)
    (2 + G phi(G)) / 2.
    """
    largest = 0.0
    for k in range(ns):
        largest = max(largest, abs(a[k, k]))
    part = 1.0
    while largest * part > 1.0 and part > LEAST_PART:
        part *= 0.5
    _multiply(a, a, ns, a2)
    _multiply(a2, a, ns, a3)
    for k in range(ns):
        for j in range(ns):
            out[k, j] = part * (a[k, j] / 2.0 + part * (a2[k, j] / 6.0 + part * a3[k, j] / 24.0))
        out[k, k] += 1.0
    while part < 1.0:
        _multiply(a, out, ns, a2)
        for k in range(ns):
            for j in range(ns):
                a2[k, j] *= 0.5 * part
            a2[k, k] += 1.0
        _multiply(out, a2, ns, a3)
        for k in range(ns):
            for j in range(ns):
                out[k, j] = a3[k, j]
        part *= 2.0


@helper
def transition(model, z, step):  # type: ignore[no-untyped-def]
    """One step of the augmented state ``z`` (nz,), as a ``Transition``."""
    ns, nx = model.sizes.states, model.sizes.dynamic
    square = (ns, ns)
    work = Transition(
        np.empty(z.size), np.empty((nx, z.size)), np.empty(square), np.empty(square), np.empty(square),
        np.empty(square), np.empty(square), np.empty(ns), np.empty(ns), np.empty(model.sizes.gusts),
    )  # fmt: skip
    transition_into(model, z, step, work)
    return work


@hot
def transition_into(model, z, step, work):  # type: ignore[no-untyped-def]
    """``transition`` into ``work``, without allocating."""
    ns, nu, gusts, nx = model.sizes.states, model.sizes.inputs, model.sizes.gusts, model.sizes.dynamic
    nd, dt = ns + nu, step.dt_s
    a, after, jacobian, series, lasting = (
        work.system, work.after, work.jacobian, work.series, work.mean_decay,
    )  # fmt: skip
    if gusts > 0:
        lasting[ACCELERATION], lasting[TURN] = (
            mean_decay(step.decay[ACCELERATION]),
            mean_decay(step.decay[TURN]),
        )
    _rates(model, z, step, work)
    for k in range(ns):
        for j in range(ns):
            work.aerodynamic[k, j] = a[k, j] * dt
            a[k, j] = work.aerodynamic[k, j] + (step.forward[j] * dt if k == 0 else 0.0)
    _series(a, ns, work.squared, work.cubed, series)
    for k in range(ns):
        work.rate[k] *= dt
        for j in range(ns):
            work.rate[k] += a[k, j] * (z[j] + dt * work.early_rate[j])
    for c in range(nx + ns * nd + ns):
        after[c] = z[c]
    for k in range(ns):
        for j in range(ns):
            after[k] += series[k, j] * work.rate[j]
    for g in range(gusts):
        after[ns + g] *= step.decay[g]
    jacobian[:] = 0.0
    _sensitivity_to_states(model, z, step, work)
    gust_rate = _mean_gust(model, z, lasting)
    for k in range(ns):
        for j in range(nd):
            factor = (
                step.inputs[j - ns]
                if j >= ns
                else 0.5 * (z[j] + after[j]) - (gust_rate if j == ns - 1 else 0.0)
            )
            factor *= dt * step.scale[k * nd + j]
            early = step.early[j - ns] * dt * step.scale[k * nd + j] if j >= ns else 0.0
            for row in range(ns):
                jacobian[row, nx + k * nd + j] = series[row, k] * factor + work.squared[row, k] * early
        for row in range(ns):
            jacobian[row, nx + ns * nd + k] = dt * series[row, k] * step.pressure_ratio
    if gusts > 0:
        moment = lasting[ACCELERATION] * z[ns + ACCELERATION]
        for row in range(ns):
            for k in range(ns):
                _add_direction(model, z, step, k, dt * series[row, k] * moment, jacobian[row])


@hot
def _sensitivity_to_states(model, z, step, work):  # type: ignore[no-untyped-def]
    """The Jacobian's columns of states and gust states; ``work.squared`` becomes the series times A."""
    ns, gusts = model.sizes.states, model.sizes.gusts
    series, jacobian, lasting = work.series, work.jacobian, work.mean_decay
    _multiply(series, work.system, ns, work.squared)
    for row in range(ns):
        for j in range(ns):
            jacobian[row, j] = work.squared[row, j]
        jacobian[row, row] += 1.0
    if gusts > 0:
        gust_rate = _mean_gust(model, z, lasting)
        for row in range(ns):
            strength = answer = 0.0
            for k in range(ns):
                strength += series[row, k] * _direction(model, z, step, k)
                answer += series[row, k] * (
                    work.aerodynamic[k, ns - 1] + step.dt_s * _path(model, z, step.scale, k)
                )
                path = step.dt_s * _path_size(model, step.scale, k) * gust_rate
                jacobian[row, ns + PATH + k] = -series[row, k] * path
            jacobian[row, ns + ACCELERATION] = strength * step.dt_s * lasting[ACCELERATION]
            jacobian[row, ns + TURN] = -answer * lasting[TURN]
            for k in range(ns):
                if model.roll and k != 1:
                    direct = series[row, k] * step.dt_s * lasting[ACCELERATION]
                    jacobian[row, acceleration_state(ns, k)] = direct
    for g in range(gusts):
        jacobian[ns + g, ns + g] = step.decay[g]


@whole
def measure(model, z, step):  # type: ignore[no-untyped-def]
    """Predicted measurements: the states, then the accelerometer at its place.

    Returns:
        predicted (ns + 1,), Jacobian (ns + 1, nz).
    """
    ns = model.sizes.states
    predicted = np.zeros(ns + 1)
    jacobian = np.zeros((ns + 1, z.size))
    for j in range(ns):
        predicted[j] = z[j]
        jacobian[j, j] = 1.0
    predicted[ns] = accelerometer(model, z, step, jacobian[ns])
    return predicted, jacobian


@hot
def accelerometer(model, z, step, row):  # type: ignore[no-untyped-def]
    """Predicted reading of the accelerometer at its place; its sensitivity to the state goes into ``row`` (nz,).

    It reads the first equation's aerodynamics less the lever times the angular accelerations (thesis equations 7.1
    and 7.3).
    """
    ns, nu, gusts, nx = model.sizes.states, model.sizes.inputs, model.sizes.gusts, model.sizes.dynamic
    nd, scale = ns + nu, step.scale
    gust_rate = z[ns + TURN] if gusts > 0 else 0.0
    row[:] = 0.0
    predicted = 0.0
    for k in range(ns):
        weight = 1.0 if k == 0 else -model.lever_m[k]
        if weight == 0.0:
            continue
        for j in range(ns):
            value = weight * z[nx + k * nd + j] * scale[k * nd + j]
            relative = z[j] - (gust_rate if j == ns - 1 else 0.0)
            predicted += value * relative
            row[j] += value
            row[nx + k * nd + j] += weight * scale[k * nd + j] * relative
            if gusts > 0 and j == ns - 1:
                path = weight * _path(model, z, scale, k)
                predicted -= path * gust_rate
                row[ns + TURN] -= value + path
                row[ns + PATH + k] -= weight * _path_size(model, scale, k) * gust_rate
        for j in range(nu):
            factor = weight * scale[k * nd + ns + j] * step.inputs_end[j]
            predicted += factor * z[nx + k * nd + ns + j]
            row[nx + k * nd + ns + j] = factor
        if gusts > 0:
            direction = weight * _direction(model, z, step, k)
            predicted += direction * z[ns + ACCELERATION]
            row[ns + ACCELERATION] += direction
            _add_direction(model, z, step, k, weight * z[ns + ACCELERATION], row)
            if model.roll and k != 1:
                predicted += weight * z[acceleration_state(ns, k)]
                row[acceleration_state(ns, k)] += weight
        predicted += weight * z[nx + ns * nd + k] * step.pressure_ratio
        row[nx + ns * nd + k] = weight * step.pressure_ratio
    return predicted
