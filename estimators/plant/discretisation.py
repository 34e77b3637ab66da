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
        norm = max(norm, np.sum(np.abs(a[i])))
    halvings = 0
    while norm * h > 0.5:
        h *= 0.5
        halvings += 1
    f, q = np.eye(n), np.zeros((n, n))
    whole, late = np.zeros((n, m)), np.zeros((n, m))
    power, drift, noise = np.eye(n), b * h, w * h
    for k in range(1, _TERMS + 1):
        whole += drift
        late += drift / (k + 1.0)
        q += noise
        power = (a @ power) * (h / k)
        f += power
        drift = (a @ drift) * (h / (k + 1.0))
        turned = a @ noise
        noise = (turned + turned.T) * (h / (k + 1.0))
    early = whole - late
    for _ in range(halvings):
        middle = 0.5 * (f @ late + early)
        early = f @ early + middle
        late = middle + late
        q = f @ q @ f.T + q
        f = f @ f
    return f, early, late, 0.5 * (q + q.T)


@compiled()
def discretise_levels(a, b, w, h):  # type: ignore[no-untyped-def]
    """``discretise`` of several A, (levels, n, n), whose inputs drive the first states alone, b (driven, m); h in s.

    Returns:
        F (levels, n, n), G_0 and G_1 (levels, driven, m), Q (levels, n, n).
    """
    levels, n, (driven, m) = a.shape[0], a.shape[1], b.shape
    f, q = np.empty((levels, n, n)), np.empty((levels, n, n))
    early, late = np.empty((levels, driven, m)), np.empty((levels, driven, m))
    into = np.zeros((n, m))
    into[:driven] = b
    for k in range(levels):
        f[k], first, last, q[k] = discretise(a[k], into, w, h)
        early[k], late[k] = first[:driven], last[:driven]
    return f, early, late, q


@compiled()
def stationary_covariance(f, q):  # type: ignore[no-untyped-def]
    """P = F P F' + Q of a stable F, by doubling the number of steps: (n, n)."""
    p, power = q.copy(), f.copy()
    for _ in range(_DOUBLINGS):
        added = power @ p @ power.T
        p = p + 0.5 * (added + added.T)
        if np.max(np.abs(added)) <= 1e-16 * np.max(np.abs(p)):
            break
        power = power @ power
    return p
