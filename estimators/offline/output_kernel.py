"""Response of a mode over one manoeuvre with its sensitivities, exact between samples, compiled.

Over a step the scales are constant (mean of its ends) and the forcing moves on a line or is held, so that
dx/dt = A x + f(t) has the solution x(t) = sum of c_n (t / dt)^n with

    c_0 = x,   c_1 = dt (A c_0 + f_0),   c_2 = dt/2 (A c_1 + f_1 - f_0),   c_(n+1) = dt/(n+1) A c_n,

the series of the matrix exponential, summed until a term is below rounding. Sensitivities follow by
differentiating the recursion, so they are those of the very numbers that come out.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import compiled, helper

__all__ = ["Accelerometers", "Record", "respond"]

Array = NDArray[np.float64]

_TERMS = 80
_ROUNDING = 1e-16


class Record(NamedTuple):
    """What a manoeuvre prescribes at each of its n samples, as ``Manoeuvre`` has it."""

    time_s: Array
    """(n,)."""
    inputs: Array
    """(n, inputs)."""
    held: NDArray[np.bool_]
    """(n - 1, inputs): whether an input is held over a step."""
    known: Array
    """(n, states, states): the known part of A."""
    rest: Array
    """(n, states): known rates that no state is a factor of."""
    stability: Array
    """(n,): scale of the stability derivatives."""
    control: Array
    """(n,): that of the control derivatives."""
    pressure: Array
    """(n,): that of the trim constants."""


class Accelerometers(NamedTuple):
    """The accelerometers that are modelled."""

    rows: NDArray[np.int64]
    """(accelerometers,): equation of each."""
    lever_m: Array
    """(equations, states)."""


class _Model(NamedTuple):
    """The model at one sample; parameters stand equation by equation, trim constants behind all of them."""

    a: Array
    """(states, states)."""
    theta: Array
    """Referred aerodynamic derivatives, (k,)."""
    constants: Array
    """Trim constants and drifts, equation by equation."""
    drives: Array
    """(inputs + trims,): what the parameters of an equation beyond the states multiply."""
    rest: Array
    """(states,)."""
    stability: float
    equations: int
    width: int
    """Derivatives an equation."""


class _Step(NamedTuple):
    """The model from one sample to the next."""

    a: Array
    """(states, states)."""
    dt: float
    first: Array
    """(states,): the forcing at the start."""
    change: Array
    """(states,): of the forcing."""
    stability: float
    drives: Array
    """(inputs + trims,): what each parameter of an equation beyond the states multiplies, the same for every one."""
    drive_changes: Array
    equations: int
    width: int


@helper
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


@helper
def _fill(theta, known, stability, width, a):  # type: ignore[no-untyped-def]
    """A at the present scale; rows without derivatives are the known ones alone."""
    ns = a.shape[0]
    for i in range(ns):
        for j in range(ns):
            a[i, j] = known[i, j]
    for i in range(theta.size // width):
        for j in range(ns):
            a[i, j] += theta[i * width + j] * stability


@helper
def _advance(x, sens, step):  # type: ignore[no-untyped-def]
    """x (states,) and its sensitivities (states, parameters) advance by one ``_Step`` in place."""
    a, neq, width = step.a, step.equations, step.width
    ns, parameters = sens.shape
    nu_and_constants = step.drives.size
    c, s = x.copy(), sens.copy()
    nu = width - ns
    for n in range(_terms(a, step.dt)):
        gain = step.dt / (n + 1.0)
        new = np.zeros(ns)
        for i in range(ns):
            total = 0.0
            for j in range(ns):
                total += a[i, j] * c[j]
            if n == 0:
                total += step.first[i]
            elif n == 1:
                total += step.change[i]
            new[i] = total * gain
        fresh = np.zeros((ns, parameters))
        for i in range(ns):
            for j in range(ns):
                coefficient = a[i, j] * gain
                for p in range(parameters):
                    fresh[i, p] += coefficient * s[j, p]
        for i in range(neq):
            for j in range(ns):
                fresh[i, i * width + j] += gain * step.stability * c[j]
            if n < 2:
                for d in range(nu_and_constants):
                    amount = step.drives[d] if n == 0 else step.drive_changes[d]
                    if d < nu:
                        fresh[i, i * width + ns + d] += gain * amount
                    else:
                        fresh[i, neq * width + (d - nu) * neq + i] += gain * amount
        c, s = new, fresh
        x += c
        sens += s


@helper
def _reading(model, row, lever_m, bias, x, sens, dy):  # type: ignore[no-untyped-def]
    """An accelerometer's reading and, added to ``dy``, its sensitivity to all but its bias: the aerodynamics and trim
    of equation ``row`` and the bias, less the lever (equations,) times the accelerations."""
    a, theta, drives, neq, width = model.a, model.theta, model.drives, model.equations, model.width
    stability = model.stability
    ns, parameters = sens.shape
    nu = width - ns
    reading = bias
    for i in range(neq):
        own = i == row
        weight = (1.0 if own else 0.0) - lever_m[i]
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
            reading += weight * model.rest[i]
        for d in range(nu, drives.size):
            place = (d - nu) * neq + i
            reading += weight * model.constants[place] * drives[d]
            dy[neq * width + place] += weight * drives[d]
    return reading


@compiled()
def respond(theta, own, drifting, accelerometers, record, out, sensitivity):  # type: ignore[no-untyped-def]
    """Outputs of one manoeuvre and their sensitivities.

    Args:
        theta: referred aerodynamic derivatives, equation by equation, (k,).
        own: this manoeuvre's: constants (equations,), drifts over the manoeuvre likewise where ``drifting``, initial
            state (states,), and the bias of each accelerometer.
        drifting: whether trim constants move on a line.
        accelerometers: ``Accelerometers``.
        record: ``Record``.
        out: (n, states + accelerometers), filled: the states, then the accelerometers.
        sensitivity: (n, states + accelerometers, k + own), filled.
    """
    time_s, inputs, stability, control = record.time_s, record.inputs, record.stability, record.control
    known, rest, pressure = record.known, record.rest, record.pressure
    n, nu = inputs.shape
    ns = known.shape[1]
    width = ns + nu
    neq = theta.size // width
    extra = 2 if drifting else 1
    initial = theta.size + extra * neq
    constants = own[: extra * neq]
    x = own[extra * neq : extra * neq + ns].copy()
    sens = np.zeros((ns, sensitivity.shape[2]))
    for i in range(ns):
        sens[i, initial + i] = 1.0
    a, drives, ends = np.zeros((ns, ns)), np.zeros(nu + extra), np.zeros(nu + extra)
    first, change = np.zeros(ns), np.zeros(ns)
    middle, span = 0.5 * (time_s[0] + time_s[n - 1]), time_s[n - 1] - time_s[0]
    biases = extra * neq + ns
    for k in range(n):
        _fill(theta, known[k], stability[k], width, a)
        for j in range(nu):
            drives[j] = control[k] * inputs[k, j]
        drives[nu] = pressure[k]
        if drifting:
            drives[nu + 1] = pressure[k] * (time_s[k] - middle) / span
        sensitivity[k, ns:] = 0.0
        for i in range(ns):
            out[k, i] = x[i]
            for j in range(sens.shape[1]):
                sensitivity[k, i, j] = sens[i, j]
        model = _Model(a, theta, constants, drives, rest[k], stability[k], neq, width)
        for f in range(accelerometers.rows.size):
            row, dy = accelerometers.rows[f], sensitivity[k, ns + f]
            dy[theta.size + biases + f] = 1.0
            out[k, ns + f] = _reading(model, row, accelerometers.lever_m[row], own[biases + f], x, sens, dy)
        if k == n - 1:
            break
        scale = 0.5 * (stability[k] + stability[k + 1])
        _fill(theta, 0.5 * (known[k] + known[k + 1]), scale, width, a)
        for j in range(nu):
            ends[j] = control[k + 1] * (inputs[k, j] if record.held[k, j] else inputs[k + 1, j])
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
        dt = time_s[k + 1] - time_s[k]
        _advance(x, sens, _Step(a, dt, first, change, scale, drives, ends - drives, neq, width))
