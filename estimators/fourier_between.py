"""What signals do between their samples, beyond the line that the bank of the Fourier form draws; compiled.

Derivation and symbols: ``docs/estimators.md`` section 2. States bend as the equations of motion say, a surface moves as
its servo does. Both are corrections of second order in the time step, so present derivatives are good enough for them.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.ekf_inputs import course

__all__ = ["between_samples"]


@njit(cache=True)
def between_samples(  # type: ignore[no-untyped-def]
    omega, transforms, phase, start, end, dt, servo_s, theta, scale, forward, lever, by_accelerometer, ns, nu
):
    """Transforms of a block whose states and surfaces move between samples as the aircraft does.

    A line from sample to sample misses -dt^2 / 12 x'' of a curve, and x'' = A x' + B u', with the u' of surfaces that
    move, not of those that jump. A servo is ahead of the line by a share of dt.

    Args:
        transforms: (frequencies, channels) of ``block_transforms``, the jumps of held inputs last; phase: e^{s T}.
        start, end: signal rows at the ends of the block.
        dt: mean time step, s.
        servo_s: (nu,) time constants of servos, infinite where unknown, 0 for a command.
        theta, scale, forward, lever, by_accelerometer: as for ``block_equations``.

    Returns:
        (frequencies, channels): new transforms, the channels of jumps left as they are.
    """
    nd = ns + nu
    out = transforms.copy()
    rate = np.zeros(nd, dtype=np.complex128)
    missed = np.zeros(nd, dtype=np.complex128)
    early, bend = np.zeros(nu), np.zeros(nu)
    for j in range(nu):
        if 0.0 < servo_s[j] < np.inf:
            mean, moment = course(dt, servo_s[j], False)
            early[j], bend[j] = mean - 0.5, moment + 1.0 / 12.0
    for f in range(omega.size):
        s = 1j * omega[f]
        for j in range(ns):
            rate[j] = s * transforms[f, j] + end[1 + j] - phase[f] * start[1 + j]
        for j in range(nu):
            rate[ns + j] = 0.0
            if servo_s[j] > 0.0:
                moved = end[2 + ns + j] - phase[f] * start[2 + ns + j]
                rate[ns + j] = s * transforms[f, ns + 1 + j] + moved - transforms[f, nd + 4 + j]
            missed[ns + j] = dt * (early[j] + s * dt * bend[j]) * rate[ns + j]
            out[f, ns + 1 + j] += missed[ns + j]
        for k in range(ns):
            curve = 0.0 + 0.0j
            for j in range(nd):
                curve += theta[k * nd + j] * scale[k * nd + j] * rate[j]
            if k == 0:
                for j in range(ns):
                    curve += forward[j] * rate[j]
            missed[k] = -dt * dt / 12.0 * curve
            out[f, k] += missed[k]
        if by_accelerometer:
            for j in range(nd):
                out[f, ns] += theta[j] * scale[j] * missed[j]
            for j in range(1, ns):
                out[f, ns] -= lever[j] * s * missed[j]
        else:
            for j in range(ns):
                out[f, ns] += forward[j] * missed[j]
    return out
