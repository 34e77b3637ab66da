"""What signals do between their samples, beyond the line that the bank of the Fourier estimator draws; compiled.

Derivation and symbols: ``docs/methods/fourier.md`` section 6. States curve as the equations of motion say, a surface
moves as its servo does. Both are corrections of second order in the time step: present derivatives are good enough.
"""

import math

from wingwatch.estimators.fourier.bank import NUISANCE, TURN_SIZE
from wingwatch.estimators.fourier.state import LAST, START
from wingwatch.kernels.decorators import lean

__all__ = ["between_samples", "rate_of", "turned_between_samples"]


@lean
def rate_of(omega, transform, phase, start, end, out):  # type: ignore[no-untyped-def]
    """Transform of a signal's rate, s X + x(T) - e^{s T} x(0), exact; real and imaginary part, (2, bins)."""
    real, imaginary, x, y = out[0], out[1], transform[0], transform[1]
    for f in range(omega.size):
        real[f] = end - phase[0, f] * start - omega[f] * y[f]
        imaginary[f] = omega[f] * x[f] - phase[1, f] * start


@lean
def _add(factor, source, target):  # type: ignore[no-untyped-def]
    """target += factor source, (2, bins)."""
    for part in range(2):
        from_, to = source[part], target[part]
        for f in range(to.size):
            to[f] += factor * from_[f]


@lean
def _add_rate(omega, transform, target):  # type: ignore[no-untyped-def]
    """target += the transform of the rate of what is nothing at both ends."""
    for f in range(omega.size):
        target[0, f] -= omega[f] * transform[1, f]
        target[1, f] += omega[f] * transform[0, f]


@lean
def _add_half_step(omega, dt, jumps, target):  # type: ignore[no-untyped-def]
    """target += what a line from sample to sample is short of a signal that jumps at the later one.

    A line that ends in a jump of one has, before the jump, t / dt that the held signal has not:
    (e^{s dt} - 1 - s dt) / (s^2 dt).
    """
    real, imaginary, x, y = target[0], target[1], jumps[0], jumps[1]
    if x[0] == 0.0 and y[0] == 0.0:
        return
    for f in range(omega.size):
        angle = omega[f] * dt
        a = -dt * (1.0 - math.cos(angle)) / (angle * angle)
        b = -dt * (angle - math.sin(angle)) / (angle * angle)
        real[f] += a * x[f] - b * y[f]
        imaginary[f] += a * y[f] + b * x[f]


@lean
def between_samples(model, rows, dt, theta, scale, forward, transforms):  # type: ignore[no-untyped-def]
    """Transforms of a block whose states and surfaces move between samples as the aircraft does.

    A line from sample to sample misses -dt^2 / 12 x'' of a curve, and x'' = A x' + B u', with the u' of surfaces that
    move, not of those that jump. A servo is ahead of the line by a fraction of dt. The accelerometer feels states and
    surfaces at once: what their lines miss its own line misses, and a jump of a held input is a ramp in it.

    Args:
        rows: of ``Block``.
        dt: mean time step, s.
        theta, scale: (k,) referred derivatives, and what makes them present ones.
        forward: (states,) what the kinematic term has of each state, m/s.
        transforms: ``Transforms`` with lines and phase; the regressors become the new transforms, the channels of
            jumps, or of what a servo's lines miss, left as they are.
    """
    omega, servo_s, lever = model.omega, model.servos.time_s, model.lever
    lines, phase, out = transforms.lines, transforms.phase, transforms.regressors
    rate, missed = transforms.rates, transforms.missed
    start, end = rows[START], rows[LAST]
    ns, nu = lever.size, servo_s.size
    nd = ns + nu
    for j in range(lines.shape[0]):
        for part in range(2):
            for f in range(omega.size):
                out[j, part, f] = lines[j, part, f]
    missed[:, :, :] = 0.0
    for j in range(ns):
        rate_of(omega, lines[j], phase, start[1 + j], end[1 + j], rate[j])
    for j in range(nu):
        own = ns + j
        rate_of(omega, lines[own + 1], phase, start[2 + own], end[2 + own], rate[own])
        if servo_s[j] == 0.0:
            _add_half_step(omega, dt, rate[own], missed[own])
            rate[own] = 0.0
        elif servo_s[j] == math.inf:
            jumps = lines[nd + 1 + NUISANCE + j]
            _add_half_step(omega, dt, jumps, missed[own])
            _add(-1.0, jumps, rate[own])
        else:
            _add(1.0, lines[nd + 1 + NUISANCE + j], missed[own])
            _add_rate(omega, missed[own], rate[own])
            _add(1.0, missed[own], out[own + 1])
    for k in range(ns):
        for j in range(nd):
            slope = theta[k * nd + j] * scale[k * nd + j]
            if k == 0 and j < ns:
                slope += forward[j]
            _add(-dt * dt / 12.0 * slope, rate[j], missed[k])
        _add(1.0, missed[k], out[k])
    term = lines.shape[0] - ns
    for j in range(ns):
        _add(forward[j], missed[j], out[term])
    for j in range(nd):
        slope = theta[j] * scale[j]
        for k in range(1, ns):
            slope -= lever[k] * theta[k * nd + j] * scale[k * nd + j]
        _add(slope, missed[j], out[ns])


@lean
def turned_between_samples(omega, dt, plant, air, transforms):  # type: ignore[no-untyped-def]
    """What lines miss because the air turns between samples as well, (docs (25a)).

    With a rate of the gust that is even over a step, the turn rate of the air is behind a lag of its time constant. A
    state misses -dt^2 / 12 x_n times the rate of -q_g, and the accelerometer's line misses what q_g itself does.

    Args:
        dt: mean time step, s.
        plant, air: of ``noise``.
        transforms: regressors and response of ``air.present_regressors``; the response in place.
    """
    response = transforms.response
    ns, nd = plant.derivatives.shape
    if response.shape[0] == ns or air.turn == 0.0:
        return
    gust = transforms.regressors[nd + 1 + TURN_SIZE]
    for f in range(omega.size):
        s, turned = 1j * omega[f], air.turn * complex(gust[0, f], gust[1, f])
        bent = -dt * dt / 12.0 * s * s * turned
        felt = dt * dt / 12.0 * s / air.turn_s * turned
        for k in range(ns):
            missed = plant.derivatives[k, ns - 1] * (felt if k == 0 else bent)
            response[k, 0, f] += missed.real
            response[k, 1, f] += missed.imag
        missed = plant.derivatives[0, ns - 1] * (bent - felt)
        response[ns, 0, f] += missed.real
        response[ns, 1, f] += missed.imag
