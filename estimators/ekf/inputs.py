"""What the inputs do between readings, and what the errors of their readings do to the filter; compiled.

A reading m of an input is off by a white error n. The filter predicts with m, so the same n is in the innovation,
through the control derivatives B, and in its sensitivity to B: the product of the two has the mean -n^2 B, and B would
come out too small, by the share of noise in what the filter takes for the input's motion. So:

- the effect of n on states and accelerometer belongs to their variances;
- while an input rests within its noise, what is learned of its derivatives is taken back (``solve``);
- else the information N that n alone pretends is taken out again. A least-squares solution with the true regressors is
  (M - N)^-1 h where one with noisy ones is M^-1 h. N is the energy that one error sends into the weighted innovations,
  summed over all of them. The filter's gains change slowly, so one error in ``ECHO`` steps is followed.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.kernels.hot import hot

__all__ = [
    "ECHO",
    "echo_after",
    "echo_before",
    "heard_by",
    "input_noise",
    "input_noise_into",
    "pretended",
    "track_inputs",
]

ECHO = 40
"""Steps for which the effect of one reading error is followed."""


@hot
def track_inputs(moments, new, first, nu):  # type: ignore[no-untyped-def]
    """Sum and sum of squares of each input since the last solution, about its first reading; see ``EkfState``."""
    for j in range(nu):
        if moments[j, 0] == 0.0:
            moments[j, 3] = new[first + j]
        off = new[first + j] - moments[j, 3]
        moments[j, 0] += 1.0
        moments[j, 1] += off
        moments[j, 2] += off * off


@hot
def heard_by(row, z, variance, j, ns, nu):  # type: ignore[no-untyped-def]
    """Effect of one standard error of input ``j``'s reading, as ``row`` (nz,) of the Jacobian answers.

    Controls, as the trim constants, go with dynamic pressure, so an input acts as its own part of each constant.
    """
    nz, nd = row.size, ns + nu
    effect = 0.0
    for k in range(ns):
        effect += row[nz - ns + k] * z[nz - ns - ns * nd + k * nd + ns + j]
    return effect * np.sqrt(variance[j])


@hot
def input_noise_into(jacobian, z, variance, ns, nu, gusts, effect, q):  # type: ignore[no-untyped-def]
    """What the reading errors of the inputs add to ``q`` of ``process_noise_into``; scratch ``effect`` (nx,).

    An error is in the means of two steps, its shares adding up to one: over more than a step it acts as one whole.
    """
    nx = ns + gusts
    for j in range(nu):
        if variance[j] > 0.0:
            for a in range(nx):
                effect[a] = heard_by(jacobian[a], z, variance, j, ns, nu)
            for a in range(nx):
                for b in range(nx):
                    q[a, b] += effect[a] * effect[b]


@njit(cache=True)
def input_noise(jacobian, row, z, variance, ns, nu, gusts, q):  # type: ignore[no-untyped-def]
    """``input_noise_into``; returns what the same errors add to the variance of the accelerometer's ``row``."""
    input_noise_into(jacobian, z, variance, ns, nu, gusts, np.empty(ns + gusts), q)
    heard = 0.0
    for j in range(nu):
        heard += heard_by(row, z, variance, j, ns, nu) ** 2
    return heard


@hot
def echo_before(echo, age, jacobian, mean, variance, ns, nu, gusts, work):  # type: ignore[no-untyped-def]
    """Carries the echo of a reading error over a step's prediction.

    Args:
        echo: (nu, nx + 2 ns, ns), advanced: for each input the effect of a unit error on each state, if the input acted
            in equation r alone; below it the energy gathered so far, and that of the last whole echo, both (ns, ns).
        age: steps that it has been followed for; at 0 a new one begins.
        jacobian: of the step, (nx, nz).
        mean: of ``course``, (nu,): the newer reading's share in the step.
        work: scratch, (nx,).
    """
    nx, nz = ns + gusts, jacobian.shape[1]
    for j in range(nu):
        if variance[j] == 0.0:
            continue
        share = mean[j] if age == 0 else (1.0 - mean[j] if age == 1 else 0.0)
        for r in range(ns):
            if age == 0:
                for a in range(nx + ns):
                    echo[j, a, r] = 0.0
            for a in range(nx):
                total = share * jacobian[a, nz - ns + r]
                for b in range(nx):
                    total += jacobian[a, b] * echo[j, b, r]
                work[a] = total
            for a in range(nx):
                echo[j, a, r] = work[a]


@hot
def echo_after(echo, age, row, measured, gains, roots, variance, ns, nu, gusts, work):  # type: ignore[no-untyped-def]
    """Gathers the echo's energy in the whitened innovations and corrects it as the states were; returns its age.

    ``row, measured, gains, roots`` as in ``covariance.correct``; ``work`` is scratch (at least ns).
    """
    nx, nz = ns + gusts, row.size
    for j in range(nu):
        if variance[j] == 0.0:
            continue
        for m in range(ns + 1):
            if not measured[m]:
                continue
            for r in range(ns):
                seen = echo[j, m, r] if m < ns else (row[nz - ns + r] if age == 0 else 0.0)
                if m == ns:
                    for a in range(nx):
                        seen += row[a] * echo[j, a, r]
                work[r] = seen * roots[m]
            for r in range(ns):
                for a in range(nx):
                    echo[j, a, r] -= gains[m, a] * work[r]
                for c in range(ns):
                    echo[j, nx + c, r] += work[c] * work[r]
    if age + 1 < ECHO:
        return age + 1
    for j in range(nu):
        for c in range(ns):
            for r in range(ns):
                echo[j, nx + ns + c, r] = echo[j, nx + c, r]
    return 0


@njit(cache=True)
def pretended(echo, moments, variance, resting, ns, less):  # type: ignore[no-untyped-def]
    """Information that reading errors pretended since the last solution, into ``less`` (k, k); none if at rest."""
    nu = variance.size
    nd, top = ns + nu, echo.shape[1] - ns
    less[:] = 0.0
    for j in range(nu):
        if not resting[j]:
            for a in range(ns):
                for b in range(ns):
                    power = moments[j, 0] * variance[j] * echo[j, top + a, b]
                    less[a * nd + ns + j, b * nd + ns + j] = power
