"""The bank of one-pole filters of the recursive Fourier estimator, compiled; exact between samples.

Derivation: ``docs/methods/fourier.md`` section 5. Nothing here allocates per sample. Real and imaginary parts
lie apart and frequencies side by side, so that the processor takes several of them at once.
"""

import math

import numpy as np

from wingwatch.estimators.fourier.state import BEFORE, LAST, TIME
from wingwatch.estimators.kernels.intersample import means_of_rows
from wingwatch.kernels.decorators import hot, lean

__all__ = [
    "CONSTANT",
    "FIRST_READING",
    "FIRST_TURN",
    "LAST_READING",
    "LAST_TURN",
    "NUISANCE",
    "PRESSURE",
    "RAMP",
    "TURN_LAG",
    "TURN_SIZE",
    "VANE_LEAD",
    "advance_bank",
    "advance_linear",
    "bank_channels",
    "block_transforms",
]

NUISANCE = 10
"""Nuisance columns of every row, beside states and inputs."""

(
    CONSTANT,
    PRESSURE,
    RAMP,
    LAST_READING,
    FIRST_READING,
    LAST_TURN,
    FIRST_TURN,
    TURN_SIZE,
    TURN_LAG,
    VANE_LEAD,
) = range(NUISANCE)
"""Constant, dynamic pressure, ramp; error of reading the last and the first sample; gust-induced pitch or yaw rate at
the last and the first sample; and what the measured gust may do beside what is expected of it: turn the air more or
less, with another time constant, and reach the vane earlier or later."""


@lean
def bank_channels(ns, nu):  # type: ignore[no-untyped-def]
    """Channels that are filtered: states, accelerometer, inputs, dynamic pressure, and of each input its jumps, or what
    its line misses."""
    return ns + 2 * nu + 2


@lean
def _coefficients(omega, dt, out):  # type: ignore[no-untyped-def]
    """One-pole coefficients of a step: exact for a signal linear between samples, and for a held one.

    Rows of ``out`` (8, bins), real and imaginary parts: exponential; gain of the old sample and of the new
    one; gain of a held one.
    """
    for f in range(omega.size):
        s = 1j * omega[f]
        z = s * dt
        e = np.exp(z)
        whole = (e - 1.0) / s
        new = (e - 1.0 - z) / (s * s * dt)
        old = whole - new
        out[0, f], out[1, f] = e.real, e.imag
        out[2, f], out[3, f] = old.real, old.imag
        out[4, f], out[5, f] = new.real, new.imag
        out[6, f], out[7, f] = whole.real, whole.imag


@hot
def advance_linear(real, imag, c, old, new):  # type: ignore[no-untyped-def]
    """One channel at all frequencies, linear from ``old`` to ``new``."""
    e_real, e_imag, a_real, a_imag, b_real, b_imag = c[0], c[1], c[2], c[3], c[4], c[5]
    for f in range(real.size):
        x, y = real[f], imag[f]
        real[f] = e_real[f] * x - e_imag[f] * y + a_real[f] * old + b_real[f] * new
        imag[f] = e_real[f] * y + e_imag[f] * x + a_imag[f] * old + b_imag[f] * new


@hot
def _held(real, imag, c, value):  # type: ignore[no-untyped-def]
    """One channel at all frequencies, at ``value`` throughout."""
    e_real, e_imag, h_real, h_imag = c[0], c[1], c[6], c[7]
    for f in range(real.size):
        x, y = real[f], imag[f]
        real[f] = e_real[f] * x - e_imag[f] * y + h_real[f] * value
        imag[f] = e_real[f] * y + e_imag[f] * x + h_imag[f] * value


@hot
def _jumped(real, imag, c, jump):  # type: ignore[no-untyped-def]
    """Jumps of one channel at all frequencies, one of size ``jump`` at the new sample."""
    if jump == 0.0 and real[0] == 0.0 and imag[0] == 0.0:
        return
    e_real, e_imag = c[0], c[1]
    for f in range(real.size):
        x, y = real[f], imag[f]
        real[f] = e_real[f] * x - e_imag[f] * y + jump
        imag[f] = e_real[f] * y + e_imag[f] * x


@lean
def advance_bank(omega, servos, input_variance, filters, bank, rows, new, ns):  # type: ignore[no-untyped-def]
    """Advance the bank of one vehicle by one sample.

    An input is held between samples if its channel is a command, or where a position whose servo is unknown repeats
    exactly (a step of a held signal); else it is linear like the states. What the line misses of a servo goes into
    the channel of jumps, as the line that has the same mean and first moment.

    Args:
        servos: ``Servos``.
        input_variance: (inputs,) of their readings.
        filters: ``Filters``, made anew where the time step has changed.
        bank: (channels, 2, bins), advanced: states, accelerometer, inputs, dynamic pressure, and jumps of inputs that
            are positions, or what their lines miss.
        rows: of ``Block``; of the row before the last only the inputs are read.
        new: signal row at the end of the step.
        ns: number of states.
    """
    servo_s = servos.time_s
    old, before, nu = rows[LAST], rows[BEFORE], servo_s.size
    coefficients, step = filters.coefficients, filters.step
    dt = new[TIME] - old[TIME]
    if abs(dt - step[0]) > 1e-6 * dt:
        _coefficients(omega, dt, coefficients)
        step[0] = dt
    for j in range(ns):
        advance_linear(bank[j, 0], bank[j, 1], coefficients, old[1 + j], new[1 + j])
    advance_linear(bank[ns, 0], bank[ns, 1], coefficients, old[1 + ns], new[1 + ns])
    for j in range(nu):
        a, b = old[2 + ns + j], new[2 + ns + j]
        row, beside = bank[ns + 1 + j], bank[ns + nu + 2 + j]
        if servo_s[j] == 0.0:
            _held(row[0], row[1], coefficients, a)
        elif a == before[2 + ns + j] and servo_s[j] == np.inf:
            _held(row[0], row[1], coefficients, a)
            _jumped(beside[0], beside[1], coefficients, b - a)
        else:
            advance_linear(row[0], row[1], coefficients, a, b)
            if servo_s[j] == np.inf:
                _jumped(beside[0], beside[1], coefficients, 0.0)
            else:
                means = means_of_rows(new, old, before, j, 2 + ns, servos, input_variance)
                level, slope = means.mean - 0.5 * (b - a), 6.0 * means.early + 0.5 * (b - a)
                advance_linear(beside[0], beside[1], coefficients, level + slope, level - slope)
    ratio = 2 + ns + nu + 1
    advance_linear(
        bank[ns + 1 + nu, 0], bank[ns + 1 + nu, 1], coefficients, old[ratio] - 1.0, new[ratio] - 1.0
    )


@lean
def block_transforms(omega, bank, span, turn_s, ns, nu, out, phase):  # type: ignore[no-untyped-def]
    """Transforms of a block of ``span`` seconds into ``out`` (ns + 2 nu + 1 + NUISANCE or more, 2, bins).

    Channels: states, accelerometer, inputs, nuisance columns, jumps of inputs, then what else the bank has. Constant
    and ramp need no samples: (e^{sT} - 1)/s and (e^{sT} - 1 - sT)/s^2. An error of the last or first reading goes into
    the transform of a rate; a turn rate there is smoothed over the span (``turn_s``, s). ``phase`` becomes e^{sT},
    (2, bins).
    """
    first = ns + 1 + nu
    for j in range(bank.shape[0]):
        row = j if j < first else (first + PRESSURE if j == first else j + NUISANCE - 1)
        for part in range(2):
            for f in range(omega.size):
                out[row, part, f] = bank[j, part, f]
    for f in range(omega.size):
        angle = omega[f] * span
        cos, sin = math.cos(angle), math.sin(angle)
        phase[0, f], phase[1, f] = cos, sin
        out[first + CONSTANT, 0, f], out[first + CONSTANT, 1, f] = sin / omega[f], (1.0 - cos) / omega[f]
        out[first + RAMP, 0, f] = (1.0 - cos) / (omega[f] * omega[f])
        out[first + RAMP, 1, f] = (angle - sin) / (omega[f] * omega[f])
        out[first + LAST_READING, 0, f], out[first + LAST_READING, 1, f] = 1.0, 0.0
        out[first + FIRST_READING, 0, f], out[first + FIRST_READING, 1, f] = cos, sin
        lag = omega[f] * turn_s
        gain = 1.0 / (1.0 + lag * lag)
        out[first + LAST_TURN, 0, f], out[first + LAST_TURN, 1, f] = gain, -lag * gain
        for part in range(2):
            for c in range(TURN_SIZE, NUISANCE):
                out[first + c, part, f] = 0.0  # of the gust: ``present_regressors``
        out[first + FIRST_TURN, 0, f] = gain * (cos + lag * sin)
        out[first + FIRST_TURN, 1, f] = gain * (sin - lag * cos)
