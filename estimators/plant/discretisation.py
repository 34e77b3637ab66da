"""A linear system with white process noise from one sample to the next, compiled.

For dx/dt = A x + B f + n, n white of intensity W, f on a line from f_0 to f_1 over the step,

    x_1 = F x_0 + G_0 f_0 + G_1 f_1 + noise of covariance Q,
    F = e^(A h),   G_0 + G_1 = sum A^n h^(n+1) / (n+1)! B,   G_1 = sum A^n h^(n+1) / (n+2)! B,
    Q = integral of e^(A s) W e^(A' s) ds,   whose Taylor terms obey  Q_(n+1) = h / (n+1) (A Q_n + Q_n A').

The series are summed for a step short enough that ||A|| h <= 1/2; two steps are put together until h is reached.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import compiled, helper

__all__ = ["discretise", "discretise_levels", "stationary_covariance"]

Array = NDArray[np.float64]

_TERMS = 14
"""(1/2)^14 / 14! is 7e-16: rounding."""

_DOUBLINGS = 40
"""2^40 steps: a hundred years at 50 Hz."""


@helper
def _times(factor, a, b, out):  # type: ignore[no-untyped-def]
    """``factor`` a b, into ``out``: matrices so small are sooner multiplied than handed to a library."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = 0.0
        for c in range(a.shape[1]):
            size = factor * a[i, c]
            for j in range(b.shape[1] if size != 0.0 else 0):
                out[i, j] += size * b[c, j]


@helper
def _add(factor, b, out):  # type: ignore[no-untyped-def]
    """``factor`` b onto ``out``."""
    for i in range(b.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] += factor * b[i, j]


@helper
def _around(f, p, work, out):  # type: ignore[no-untyped-def]
    """F P F' of a symmetric P, into ``out``."""
    _times(1.0, f, p, work)
    for i in range(f.shape[0]):
        for j in range(i + 1):
            total = 0.0
            for c in range(f.shape[0]):
                total += work[i, c] * f[j, c]
            out[i, j] = total
            out[j, i] = total


@helper
def discretise(a, b, w, h):  # type: ignore[no-untyped-def]
    """One step of length h.

    Args:
        a: dynamics, (n, n); b: of the inputs, (n, m); w: noise intensity, (n, n).
        h: step, s.

    Returns:
        F (n, n), G_0 and G_1 (n, m), Q (n, n).
    """
    n, m = b.shape
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(a[i, j])
        norm = max(norm, row)
    halvings = 0
    while norm * h > 0.5:
        h *= 0.5
        halvings += 1
    f, q, work, turned = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    early, late, moved = np.zeros((n, m)), np.zeros((n, m)), np.zeros((n, m))
    power, noise, drift = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, m))
    for i in range(n):
        f[i, i] = power[i, i] = 1.0
    _add(h, w, noise)
    _add(h, b, drift)
    for k in range(1, _TERMS + 1):
        _add(1.0 - 1.0 / (k + 1.0), drift, early)
        _add(1.0 / (k + 1.0), drift, late)
        _add(1.0, noise, q)
        _times(h / k, a, power, work)
        power, work = work, power
        _add(1.0, power, f)
        _times(h / (k + 1.0), a, drift, moved)
        drift, moved = moved, drift
        _times(h / (k + 1.0), a, noise, turned)
        for i in range(n):
            for j in range(n):
                noise[i, j] = turned[i, j] + turned[j, i]
    for _ in range(halvings):
        # over both halves the line passes its middle
        _times(0.5, f, late, moved)
        _add(0.5, early, moved)
        _times(1.0, f, early, drift)
        for i in range(n):
            for j in range(m):
                early[i, j] = drift[i, j] + moved[i, j]
                late[i, j] += moved[i, j]
        _around(f, q, work, turned)
        _add(1.0, turned, q)
        _times(1.0, f, f, work)
        f, work = work, f
    return f, early, late, q


@compiled()
def discretise_levels(a, b, w, h):  # type: ignore[no-untyped-def]
    """``discretise`` of several A, (levels, n, n), whose inputs drive the first states alone, b (driven, m); h in s.

    Returns:
        F (levels, n, n), G_0 and G_1 (levels, driven, m), Q (levels, n, n).
    """
    levels, n, (driven, m) = a.shape[0], a.shape[1], b.shape
    f, q, into = np.zeros((levels, n, n)), np.zeros((levels, n, n)), np.zeros((n, m))
    early, late = np.zeros((levels, driven, m)), np.zeros((levels, driven, m))
    _add(1.0, b, into)
    for k in range(levels):
        one = discretise(a[k], into, w, h)
        _add(1.0, one[0], f[k])
        _add(1.0, one[3], q[k])
        _add(1.0, one[1][:driven], early[k])
        _add(1.0, one[2][:driven], late[k])
    return f, early, late, q


@compiled()
def stationary_covariance(f, q):  # type: ignore[no-untyped-def]
    """P = F P F' + Q of a stable F, by doubling the number of steps: (n, n)."""
    n = f.shape[0]
    p, power = np.zeros((n, n)), np.zeros((n, n))
    work, added = np.zeros((n, n)), np.zeros((n, n))
    _add(1.0, q, p)
    _add(1.0, f, power)
    for _ in range(_DOUBLINGS):
        _around(power, p, work, added)
        _add(1.0, added, p)
        most = largest = 0.0
        for i in range(n):
            for j in range(n):
                most, largest = max(most, abs(added[i, j])), max(largest, abs(p[i, j]))
        if most <= 1e-16 * largest:
            break
        _times(1.0, power, power, work)
        power, work = work, power
    return p
