"""The model of the extended Kalman filter: one step of states and parameters, and what is measured.

Augmented state: the mode's states, its referred aerodynamic derivatives, one constant per equation (trim). The
states follow dx/dt = A x + B u + c kappa + rest, A and B from the derivatives at the present dynamic pressure
ratio kappa, with the forward speed added to its own columns; over one step the right-hand side is integrated
through the series of the matrix exponential, dt (I + A dt/2 + (A dt)^2/6 + (A dt)^3/24), and the sensitivity to
a derivative is taken at the middle of the step. Both engines run these functions.
"""

import numpy as np
from numba import njit

__all__ = ["measure", "transition"]


@njit(cache=True)
def _matrices(z, scale, forward, u, kappa, rest, first, ns, nu, a, b):  # type: ignore[no-untyped-def]
    """A (with forward speed) and the part of dx/dt that does not depend on x; aerodynamics from row ``first`` on."""
    nd = ns + nu
    for k in range(first, ns):
        b[k] = z[ns + ns * nd + k] * kappa
        for j in range(ns):
            a[k, j] = z[ns + k * nd + j] * scale[k * nd + j]
        for j in range(nu):
            b[k] += z[ns + k * nd + ns + j] * scale[k * nd + ns + j] * u[j]
    for j in range(ns):
        a[0, j] += forward[j]
    b[0] += rest


@njit(cache=True)
def transition(z, dt, scale, forward, u, kappa, rest, by_accelerometer, ns, nu):  # type: ignore[no-untyped-def]
    """One step.

    Args:
        z: augmented state, shape (ns + k + ns,).
        dt: step in s.
        scale: referred to present derivatives, shape (k,).
        forward: kinematic part of the first equation per state, m/s.
        u: inputs over the step, shape (nu,).
        kappa: dynamic pressure over that of the reference.
        rest: acceleration of the first state not due to the states: gravity, products and, where
            ``by_accelerometer``, the measured specific force, m/s2.
        by_accelerometer: the first state is carried by kinematics alone, so that gusts and vane errors do
            not pass for aerodynamics; its derivatives are then seen by the accelerometer only.

    Returns:
        the state after the step, and the rows of the Jacobian that belong to the mode's states
        (ns, ns + k + ns); the other rows are the identity.
    """
    nd, nz = ns + nu, z.size
    a = np.zeros((ns, ns))
    b = np.zeros(ns)
    first = 1 if by_accelerometer else 0
    _matrices(z, scale, forward, u, kappa, rest, first, ns, nu, a, b)
    a *= dt
    identity = np.eye(ns)
    a2 = a @ a
    series = identity + a / 2.0 + a2 / 6.0 + (a2 @ a) / 24.0
    x = z[:ns]
    rate = np.zeros(ns)
    for k in range(ns):
        rate[k] = b[k] * dt
        for j in range(ns):
            rate[k] += a[k, j] * x[j]
    after = z.copy()
    after[:ns] = x + series @ rate
    jacobian = np.zeros((ns, nz))
    jacobian[:, :ns] = identity + series @ a
    for row in range(ns):
        for k in range(first, ns):
            gain = dt * series[row, k]
            for j in range(ns):
                jacobian[row, ns + k * nd + j] = gain * scale[k * nd + j] * 0.5 * (x[j] + after[j])
            for j in range(nu):
                jacobian[row, ns + k * nd + ns + j] = gain * scale[k * nd + ns + j] * u[j]
            jacobian[row, ns + ns * nd + k] = gain * kappa
    return after, jacobian


@njit(cache=True)
def measure(z, scale, u, kappa, lever, ns, nu):  # type: ignore[no-untyped-def]
    """Expected measurements: the states, then the accelerometer at its place.

    The accelerometer reads the first equation's aerodynamics less ``lever`` times the angular accelerations
    (thesis equations 7.1 and 7.3).

    Returns:
        expected (ns + 1,), Jacobian (ns + 1, nz).
    """
    nd, nz = ns + nu, z.size
    expected = np.zeros(ns + 1)
    jacobian = np.zeros((ns + 1, nz))
    for j in range(ns):
        expected[j] = z[j]
        jacobian[j, j] = 1.0
    for k in range(ns):
        share = 1.0 if k == 0 else -lever[k]
        if share == 0.0:
            continue
        for j in range(ns):
            value = z[ns + k * nd + j] * scale[k * nd + j]
            expected[ns] += share * value * z[j]
            jacobian[ns, j] += share * value
            jacobian[ns, ns + k * nd + j] = share * scale[k * nd + j] * z[j]
        for j in range(nu):
            factor = share * scale[k * nd + ns + j] * u[j]
            expected[ns] += factor * z[ns + k * nd + ns + j]
            jacobian[ns, ns + k * nd + ns + j] = factor
        expected[ns] += share * z[ns + ns * nd + k] * kappa
        jacobian[ns, ns + ns * nd + k] = share * kappa
    return expected, jacobian
