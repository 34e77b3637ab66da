"""The bank of one-pole filters of the recursive Fourier estimator, compiled; exact between samples.

Derivation and symbols: ``docs/estimators.md`` section 2. Nothing here allocates.
"""

import numpy as np
from numba import njit

__all__ = ["advance_bank"]


@njit(cache=True)
def _coefficients(omega, dt, exponential, linear_old, linear_new, held):  # type: ignore[no-untyped-def]
    """One-pole coefficients of a step: exact for a signal linear between samples, and for a held one."""
    for f in range(omega.size):
        s = 1j * omega[f]
        z = s * dt
        e = np.exp(z)
        whole = (e - 1.0) / s
        new = (e - 1.0 - z) / (s * s * dt)
        exponential[f], linear_new[f], linear_old[f], held[f] = e, new, whole - new, whole


@njit(cache=True)
def advance_bank(  # type: ignore[no-untyped-def]
    omega, bank, decay, step, coefficients, old, new, before, hold_always, elapsed, ns, nu, force
):
    """Advance the bank of one vehicle by one sample.

    Channels of ``bank`` (frequencies, channels): states, force, inputs, constant, dynamic pressure, ramp.
    An input is held between samples if its channel is a command, or where a position repeats exactly
    (a step of a held signal); else it is linear like the states.

    Args:
        decay: exp(j omega T) of the block so far, shape (frequencies,), advanced in place.
        step: shape (1,), time step that ``coefficients`` (4, frequencies) were made for.
        old, new: signal rows at the two ends of the step; before: the row before ``old`` (inputs only).
        elapsed: time since the block began, at ``old``.
    """
    dt = new[0] - old[0]
    e, c0, c1, h = coefficients[0], coefficients[1], coefficients[2], coefficients[3]
    if abs(dt - step[0]) > 1e-6 * dt:
        _coefficients(omega, dt, e, c0, c1, h)
        step[0] = dt
    ratio = 2 + ns + nu + 1
    first = ns + 1
    for f in range(omega.size):
        row = bank[f]
        ef, of, nf, hf = e[f], c0[f], c1[f], h[f]
        for j in range(ns):
            row[j] = ef * row[j] + of * old[1 + j] + nf * new[1 + j]
        row[ns] = ef * row[ns] + of * old[force] + nf * new[force]
        for j in range(nu):
            a, b = old[2 + ns + j], new[2 + ns + j]
            if hold_always[j] or a == before[2 + ns + j]:
                row[first + j] = ef * row[first + j] + hf * a
            else:
                row[first + j] = ef * row[first + j] + of * a + nf * b
        c = first + nu
        row[c] = ef * row[c] + hf
        row[c + 1] = ef * row[c + 1] + of * (old[ratio] - 1.0) + nf * (new[ratio] - 1.0)
        row[c + 2] = ef * row[c + 2] + of * elapsed + nf * (elapsed + dt)
        decay[f] *= ef
