"""Response of a mode over one manoeuvre with its sensitivities, exact between samples, compiled.

Over a step the scales are constant (mean of its ends) and the forcing moves on a line or is held, so that
dx/dt = A x + f(t) has the solution x(t) = sum of c_n (t / dt)^n with

    c_0 = x,   c_1 = dt (A c_0 + f_0),   c_2 = dt/2 (A c_1 + f_1 - f_0),   c_(n+1) = dt/(n+1) A c_n,

the series of the matrix exponential, summed until a term is below rounding. Sensitivities follow by
differentiating the recursion, so they are those of the very numbers that come out.
"""

import numpy as np
from numba import njit

__all__ = ["respond"]

_TERMS = 80
_ROUNDING = 1e-16


@njit(cache=True)
def _terms(a, dt):  # type: ignore[no-untyped-def]
    """How many terms of the series until they drown in rounding."""
    norm = 0.0
    for i in range(a.shape[0]):
        row = 0.0
        for j in range(a.shape[1]):
            row += abs(a[i, j])
        norm = max(norm, row)
    size, count = 1.0, 2
    while count < _TERMS and size > _ROUNDING:
        size *= norm * dt / count
        count += 1
    return count


@njit(cache=True)
def _fill(theta, known, stability, control, a, b):  # type: ignore[no-untyped-def]
    """A and B at the present scales; rows without derivatives are the known ones alone."""
    ns, nu = a.shape[0], b.shape[1]
    width = ns + nu
    for i in range(ns):
        for j in range(ns):
            a[i, j] = known[i, j]
    for i in range(theta.size // width):
        for j in range(ns):
            a[i, j] += theta[i * width + j] * stability
        for j in range(nu):
            b[i, j] = theta[i * width + ns + j] * control


@njit(cache=True)
def _step(x, sens, a, dt, first, change, stability, drives, drive_changes, neq, width, terms):  # type: ignore[no-untyped-def]
    """x and its sensitivities advance by one step in place.

    ``first`` and ``change`` are the forcing at the step's start and its change, (states,); ``drives`` what each
    parameter of an equation beyond the states multiplies (inputs, then constants), the same for every equation.
    """
    ns, parameters = sens.shape
    nu_and_constants = drives.size
    c, s = x.copy(), sens.copy()
    nu = width - ns
    for n in range(terms):
        gain = dt / (n + 1.0)
        new = np.zeros(ns)
        for i in range(ns):
            total = 0.0
            for j in range(ns):
                total += a[i, j] * c[j]
            if n == 0:
                total += first[i]
            elif n == 1:
                total += change[i]
            new[i] = total * gain
        fresh = np.zeros((ns, parameters))
        for i in range(ns):
            for j in range(ns):
                coefficient = a[i, j] * gain
                for p in range(parameters):
                    fresh[i, p] += coefficient * s[j, p]
        for i in range(neq):
            for j in range(ns):
                fresh[i, i * width + j] += gain * stability * c[j]
            if n < 2:
                for d in range(nu_and_constants):
                    amount = drives[d] if n == 0 else drive_changes[d]
                    if d < nu:
                        fresh[i, i * width + ns + d] += gain * amount
                    else:
                        fresh[i, neq * width + (d - nu) * neq + i] += gain * amount
        c, s = new, fresh
        x += c
        sens += s


@njit(cache=True)
def _reading(  # type: ignore[no-untyped-def]
    row, x, sens, a, theta, bias, place_of_bias, drives, constants, stability, lever, rest, neq, width, dy
):
    """An accelerometer's reading and, into ``dy``, its sensitivity: the aerodynamics and trim of equation ``row``, the
    sensor's own bias, less the lever times the accelerations."""
    ns, parameters = sens.shape
    nu = width - ns
    reading = bias
    dy[:] = 0.0
    dy[place_of_bias] = 1.0
    for i in range(neq):
        own = i == row
        weight = (1.0 if own else 0.0) - lever[i]
        if weight == 0.0:
            continue
        for j in range(ns):
            aerodynamic = theta[i * width + j] * stability
            coefficient = aerodynamic if own else a[i, j]
            reading += weight * coefficient * x[j]
            dy[i * width + j] += weight * stability * x[j]
            for p in range(parameters):
                dy[p] += weight * coefficient * sens[j, p]
        for j in range(nu):
            reading += weight * theta[i * width + ns + j] * drives[j]
            dy[i * width + ns + j] += weight * drives[j]
        if not own:
            reading += weight * rest[i]
        for d in range(nu, drives.size):
            place = (d - nu) * neq + i
            reading += weight * constants[place] * drives[d]
            dy[neq * width + place] += weight * drives[d]
    return reading


@njit(cache=True)
def respond(  # type: ignore[no-untyped-def]
    theta, own, drifting, forces, lever, time_s, inputs, held, known, rest, stability, control, pressure, out,
    sensitivity,
):  # fmt: skip
    """Outputs of one manoeuvre and their sensitivities.

    Args:
        theta: referred aerodynamic derivatives, equation by equation, (k,).
        own: this manoeuvre's: constants (equations,), drifts over the manoeuvre likewise where ``drifting``, initial
            state (states,), and the bias of each accelerometer (forces,).
        forces: equations whose accelerometer is modelled, (forces,) integers.
        lever: (equations, states) of the accelerometers, m.
        time_s, inputs, held, known, rest, stability, control, pressure: as in ``Manoeuvre``, ``held`` by step.
        out: (n, states + forces), filled: the states, then the accelerometers.
        sensitivity: (n, states + forces, k + own), filled.
    """
    n, nu = inputs.shape
    ns = known.shape[1]
    width = ns + nu
    neq = theta.size // width
    extra = 2 if drifting else 1
    parameters = sensitivity.shape[2]
    initial = theta.size + extra * neq
    constants = own[: extra * neq]
    x = own[extra * neq : extra * neq + ns].copy()
    sens = np.zeros((ns, parameters))
    for i in range(ns):
        sens[i, initial + i] = 1.0
    a, b = np.zeros((ns, ns)), np.zeros((ns, nu))
    drives, ends = np.zeros(nu + extra), np.zeros(nu + extra)
    first, change = np.zeros(ns), np.zeros(ns)
    middle, span = 0.5 * (time_s[0] + time_s[n - 1]), time_s[n - 1] - time_s[0]
    biases = extra * neq + ns
    for k in range(n):
        _fill(theta, known[k], stability[k], control[k], a, b)
        for j in range(nu):
            drives[j] = control[k] * inputs[k, j]
        drives[nu] = pressure[k]
        if drifting:
            drives[nu + 1] = pressure[k] * (time_s[k] - middle) / span
        for i in range(ns):
            out[k, i] = x[i]
        sensitivity[k, :ns] = sens
        for f in range(forces.size):
            out[k, ns + f] = _reading(
                forces[f], x, sens, a, theta, own[biases + f], theta.size + biases + f, drives, constants,
                stability[k], lever[forces[f]], rest[k], neq, width, sensitivity[k, ns + f],
            )  # fmt: skip
        if k == n - 1:
            break
        dt = time_s[k + 1] - time_s[k]
        scale = 0.5 * (stability[k] + stability[k + 1])
        _fill(theta, 0.5 * (known[k] + known[k + 1]), scale, 0.5 * (control[k] + control[k + 1]), a, b)
        for j in range(nu):
            ends[j] = control[k + 1] * (inputs[k, j] if held[k, j] else inputs[k + 1, j])
        ends[nu] = pressure[k + 1]
        if drifting:
            ends[nu + 1] = pressure[k + 1] * (time_s[k + 1] - middle) / span
        for i in range(ns):
            first[i], change[i] = rest[k, i], rest[k + 1, i] - rest[k, i]
        for i in range(neq):
            for j in range(nu):
                first[i] += theta[i * width + ns + j] * drives[j]
                change[i] += theta[i * width + ns + j] * (ends[j] - drives[j])
            for d in range(extra):
                first[i] += constants[d * neq + i] * drives[nu + d]
                change[i] += constants[d * neq + i] * (ends[nu + d] - drives[nu + d])
        _step(x, sens, a, dt, first, change, scale, drives, ends - drives, neq, width, _terms(a, dt))
