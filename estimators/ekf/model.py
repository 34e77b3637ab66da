"""The model of the extended Kalman filter: one step of states and parameters, and what is measured.

Augmented state: the mode's states x; the air's unrest (see below); the referred aerodynamic derivatives; one constant
per equation (trim). The states follow dx/dt = A x + B u + c kappa + rest, A and B from the derivatives at the present
dynamic pressure ratio kappa, with the forward speed added to its own columns; over one step the right-hand side
is integrated through the series of the matrix exponential, dt (I + A dt/2 + (A dt)^2/6 + (A dt)^3/24), and the
sensitivity to a derivative is taken at the middle of the step. Both engines run these functions.

The air's unrest, all of it first-order processes with the time that the span takes to pass (MIL-F-8785C 3.7.5):

- unrest that no vane sees: an angular acceleration of the first rate, and of the others in a fixed ratio to it. Where
  roll is a state it is what the roll rate of the air does, -l_p p_g and -n_p p_g, and the ratio is n_p / l_p; as a
  product of two unknowns, l_p and p_g, it would bias both;
- turning air: the angular rate that belongs to the gust seen by the vane, q_g = -w_g'/V or r_g = v_g'/V.

The aerodynamics know only the rate relative to it.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.kernels.hot import hot

__all__ = ["accelerometer", "measure", "transition", "transition_into"]


@hot
def _rates(z, scale, u, bend, kappa, rest, lasting, direction, first, ns, nu, gusts, a, b, bent):  # type: ignore[no-untyped-def]
    """A and the part of dx/dt that does not depend on x; aerodynamics from row ``first`` on. ``bent``: B bend."""
    nd, nx = ns + nu, ns + gusts
    turning = z[ns + 1] * lasting[1] if gusts > 0 else 0.0
    for k in range(ns):
        b[k] = bent[k] = 0.0
        for j in range(ns):
            a[k, j] = 0.0
    for k in range(first, ns):
        total = z[nx + ns * nd + k] * kappa
        for j in range(ns):
            a[k, j] = z[nx + k * nd + j] * scale[k * nd + j]
        total -= a[k, ns - 1] * turning
        for j in range(nu):
            control = z[nx + k * nd + ns + j] * scale[k * nd + ns + j]
            total += control * u[j]
            bent[k] += control * bend[j]
        if gusts > 0:
            total += direction[k] * z[ns] * lasting[0]
        b[k] = total
    for k in range(ns):
        b[k] += rest[k]


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
    """I + A/2 + A^2/6 + A^3/24 into ``out``; A^2 and A^3 into theirs."""
    _multiply(a, a, ns, a2)
    _multiply(a2, a, ns, a3)
    for k in range(ns):
        for j in range(ns):
            out[k, j] = a[k, j] / 2.0 + a2[k, j] / 6.0 + a3[k, j] / 24.0
        out[k, k] += 1.0


@njit(cache=True)
def transition(  # type: ignore[no-untyped-def]
    z, dt, scale, forward, u, bend, kappa, rest, decay, direction, by_accelerometer, ns, nu, gusts
):
    """One step.

    Args:
        z: augmented state, shape (nx + k + ns,), nx = ns + gusts.
        dt: step in s.
        scale: referred to present derivatives, shape (k,).
        forward: kinematic part of the first equation per state, m/s.
        u: mean of the inputs over the step, shape (nu,).
        bend: how much earlier than even their course over the step is: the mean of (1/2 - t/dt) u, shape (nu,).
        kappa: dynamic pressure over that of the reference.
        rest: acceleration of each state that is due neither to the states nor to the air, shape (ns,): of the first
            gravity, products and, where ``by_accelerometer``, the measured specific force, m/s2; of the rates inertia
            coupling, rad/s2.
        decay: of the air's unrest over the step, shape (gusts,).
        direction: how each equation answers to the unrest, over how the first rate's does, (ns,).
        by_accelerometer: the first state is carried by kinematics alone, so that gusts and vane errors do
            not pass for aerodynamics; its derivatives are then seen by the accelerometer only.
        ns, nu, gusts: numbers of states, inputs and states of the air, 2 or 0.

    Returns:
        the state after the step, and the rows of the Jacobian that belong to the states and the air's unrest
        (nx, nx + k + ns); the other rows are the identity.
    """
    after, jacobian = np.empty(z.size), np.empty((ns + gusts, z.size))
    squares = np.empty((5, ns, ns))
    transition_into(
        z, dt, scale, forward, u, bend, kappa, rest, decay, direction, by_accelerometer, ns, nu, gusts,
        squares[0], squares[1], squares[2], squares[3], squares[4], np.empty((2, ns)), np.empty(2), after, jacobian,
    )  # fmt: skip
    return after, jacobian


@hot
def transition_into(  # type: ignore[no-untyped-def]
    z, dt, scale, forward, u, bend, kappa, rest, decay, direction, by_accelerometer, ns, nu, gusts, a, aerodynamic,
    a2, a3, series, b, lasting, after, jacobian,
):  # fmt: skip
    """``transition`` into ``after`` and ``jacobian``, without allocating.

    Scratch: ``a, aerodynamic, a2, a3, series`` (ns, ns), ``b`` (2, ns), ``lasting`` (2,).
    """
    nd, nx = ns + nu, ns + gusts
    first = 1 if by_accelerometer else 0
    for g in range(gusts):
        lasting[g] = 0.5 * (1.0 + decay[g])
    rate, bent = b[0], b[1]
    _rates(z, scale, u, bend, kappa, rest, lasting, direction, first, ns, nu, gusts, a, rate, bent)
    for k in range(ns):
        for j in range(ns):
            aerodynamic[k, j] = a[k, j] * dt
            a[k, j] = aerodynamic[k, j] + (forward[j] * dt if k == 0 else 0.0)
    _series(a, ns, a2, a3, series)
    for k in range(ns):
        rate[k] *= dt
        for j in range(ns):
            rate[k] += a[k, j] * (z[j] + dt * bent[j])
    for c in range(nx + ns * nd + ns):
        after[c] = z[c]
    for k in range(ns):
        for j in range(ns):
            after[k] += series[k, j] * rate[j]
    for g in range(gusts):
        after[ns + g] *= decay[g]
    jacobian[:] = 0.0
    _sensitivity_to_states(
        a, aerodynamic, a2, series, dt, decay, lasting, direction, first, ns, gusts, jacobian
    )
    turning = z[ns + 1] * lasting[1] if gusts > 0 else 0.0
    for k in range(first, ns):
        for j in range(nd):
            factor = u[j - ns] if j >= ns else 0.5 * (z[j] + after[j]) - (turning if j == ns - 1 else 0.0)
            factor *= dt * scale[k * nd + j]
            early = bend[j - ns] * dt * scale[k * nd + j] if j >= ns else 0.0
            for row in range(ns):
                jacobian[row, nx + k * nd + j] = series[row, k] * factor + a2[row, k] * early
        for row in range(ns):
            jacobian[row, nx + ns * nd + k] = dt * series[row, k] * kappa


@hot
def _sensitivity_to_states(  # type: ignore[no-untyped-def]
    a, aerodynamic, product, series, dt, decay, lasting, direction, first, ns, gusts, jacobian
):
    """The Jacobian's columns of the states and of the air's unrest; ``product`` is scratch (ns, ns)."""
    _multiply(series, a, ns, product)
    for row in range(ns):
        for j in range(ns):
            jacobian[row, j] = product[row, j]
        jacobian[row, row] += 1.0
    if gusts > 0:
        for row in range(ns):
            strength = answer = 0.0
            for k in range(first, ns):
                strength += series[row, k] * direction[k]
                answer += series[row, k] * aerodynamic[k, ns - 1]
            jacobian[row, ns] = strength * dt * lasting[0]
            jacobian[row, ns + 1] = -answer * lasting[1]
    for g in range(gusts):
        jacobian[ns + g, ns + g] = decay[g]


@njit(cache=True)
def measure(z, scale, u, kappa, lever, direction, ns, nu, gusts):  # type: ignore[no-untyped-def]
    """Expected measurements: the states, then the accelerometer at its place.

    Returns:
        expected (ns + 1,), Jacobian (ns + 1, nz).
    """
    expected = np.zeros(ns + 1)
    jacobian = np.zeros((ns + 1, z.size))
    for j in range(ns):
        expected[j] = z[j]
        jacobian[j, j] = 1.0
    expected[ns] = accelerometer(z, scale, u, kappa, lever, direction, ns, nu, gusts, jacobian[ns])
    return expected, jacobian


@hot
def accelerometer(z, scale, u, kappa, lever, direction, ns, nu, gusts, row):  # type: ignore[no-untyped-def]
    """Expected reading of the accelerometer at its place; its sensitivity to the state goes into ``row`` (nz,).

    It reads the first equation's aerodynamics less ``lever`` times the angular accelerations (thesis equations 7.1
    and 7.3).
    """
    nd, nx = ns + nu, ns + gusts
    turning = z[ns + 1] if gusts > 0 else 0.0
    row[:] = 0.0
    expected = 0.0
    for k in range(ns):
        share = 1.0 if k == 0 else -lever[k]
        if share == 0.0:
            continue
        for j in range(ns):
            value = share * z[nx + k * nd + j] * scale[k * nd + j]
            relative = z[j] - (turning if j == ns - 1 else 0.0)
            expected += value * relative
            row[j] += value
            row[nx + k * nd + j] = share * scale[k * nd + j] * relative
            if gusts > 0 and j == ns - 1:
                row[ns + 1] -= value
        for j in range(nu):
            factor = share * scale[k * nd + ns + j] * u[j]
            expected += factor * z[nx + k * nd + ns + j]
            row[nx + k * nd + ns + j] = factor
        if gusts > 0:
            expected += share * direction[k] * z[ns]
            row[ns] += share * direction[k]
        expected += share * z[nx + ns * nd + k] * kappa
        row[nx + ns * nd + k] = share * kappa
    return expected
