"""Excitations as the kernel has them: one row a segment, added up over a flight's segments.

A segment is what one surface does over a length of time, once or over and over: steps, a sum of sines, or a sweep.
"""

import math
from collections.abc import Sequence
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import helper
from wingwatch.simulation.layout import SURFACES

__all__ = [
    "EXCITATION_COLUMNS",
    "Segments",
    "Surface",
    "check_segment",
    "excitation",
    "excitation_rows",
    "sine_rows",
    "step_row",
    "sweep_row",
]

Surface = Literal["elevator", "aileron", "rudder"]

_KIND, _SURFACE, _START, _LENGTH, _PERIOD, _BODY = range(6)
_STEPS, _SINES, _LINEAR_SWEEP, _LOGARITHMIC_SWEEP = 0.0, 1.0, 2.0, 3.0
STEPS = 4
HARMONICS = 8
"""Steps, and harmonics, that one row holds; a sum of more sines takes more rows."""

_COEFFICIENTS = _BODY + 4
EXCITATION_COLUMNS = _COEFFICIENTS + 2 * HARMONICS
"""Kind, surface, start, length, period (infinite for once), then by kind: four ends since the start and four
deflections; or angular frequency of the period, first harmonic, distance of the harmonics, their number, and a cosine
and a sine amplitude for each; or amplitude, first angular frequency, its rate in rad/s2 or in 1/s."""


class Segments(Protocol):
    """A manoeuvre: what it does, as rows."""

    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows of at most ``EXCITATION_COLUMNS`` numbers; what lacks is zero."""
        ...


def check_segment(
    surface: str, amplitude_rad: float, start_s: float, length_s: float, period_s: float
) -> None:
    """What holds for every manoeuvre.

    Raises:
        ValueError: an unknown surface, an amplitude of pi/2 or more, a start before 0, a length that is not positive, a
            period shorter than the length.
    """
    if surface not in SURFACES:
        raise ValueError(f"manoeuvre on surface {surface!r}; give one of {', '.join(SURFACES)}")
    if not (math.isfinite(amplitude_rad) and abs(amplitude_rad) < math.pi / 2):
        raise ValueError(f"manoeuvre on {surface} has amplitude {amplitude_rad} rad; give less than pi/2")
    if not (math.isfinite(start_s) and start_s >= 0.0):
        raise ValueError(f"manoeuvre on {surface} starts at {start_s} s; give a time from 0")
    if not (math.isfinite(length_s) and length_s > 0.0):
        raise ValueError(f"manoeuvre on {surface} lasts {length_s} s; give a positive time")
    if not period_s >= length_s * (1.0 - 1e-12):
        raise ValueError(
            f"manoeuvre on {surface} repeats after {period_s} s but lasts {length_s:g} s; give a longer period"
        )


def step_row(
    surface: str, start_s: float, period_s: float, ends_s: Sequence[float], deflections_rad: Sequence[float]
) -> tuple[float, ...]:
    """Steps one after another, at most ``STEPS``; ``ends_s`` since the start."""
    spare = STEPS - len(ends_s)
    ends, deflections = (*ends_s, *([ends_s[-1]] * spare)), (*deflections_rad, *([0.0] * spare))
    return (_STEPS, float(SURFACES.index(surface)), start_s, ends_s[-1], period_s, *ends, *deflections)


def sine_rows(
    surface: str,
    start_s: float,
    length_s: float,
    period_s: float,
    harmonics: Sequence[int],
    phasors: Sequence[complex],
) -> tuple[tuple[float, ...], ...]:
    """A sum of |c| sin(2 pi k t / length_s + arg c) over harmonics k, ascending, with phasors c in rad."""
    step = math.gcd(*(k - harmonics[0] for k in harmonics[1:])) if len(harmonics) > 1 else 1
    wanted = dict(zip(harmonics, phasors, strict=True))
    dense = range(harmonics[0], harmonics[-1] + 1, step)
    out = []
    for first in range(0, len(dense), HARMONICS):
        some = dense[first : first + HARMONICS]
        pairs = [part for k in some for part in (wanted.get(k, 0j).imag, wanted.get(k, 0j).real)]
        head = (_SINES, float(SURFACES.index(surface)), start_s, length_s, period_s)
        out.append((*head, 2.0 * math.pi / length_s, float(some[0]), float(step), float(len(some)), *pairs))
    return tuple(out)


def sweep_row(
    surface: str,
    start_s: float,
    length_s: float,
    period_s: float,
    amplitude_rad: float,
    first_rad_s: float,
    rate: float,
    logarithmic: bool,
) -> tuple[float, ...]:
    """A sine whose frequency is first + rate t (rate in rad/s2) or first exp(rate t) (rate in 1/s)."""
    kind = _LOGARITHMIC_SWEEP if logarithmic else _LINEAR_SWEEP
    head = (kind, float(SURFACES.index(surface)), start_s, length_s, period_s)
    return (*head, amplitude_rad, first_rad_s, rate)


def excitation_rows(manoeuvres: Sequence[Segments]) -> NDArray[np.float64]:
    """All segments of a flight, shape (n, EXCITATION_COLUMNS)."""
    rows = [row for manoeuvre in manoeuvres for row in manoeuvre.rows()]
    out = np.zeros((len(rows), EXCITATION_COLUMNS))
    for i, row in enumerate(rows):
        out[i, : len(row)] = row
    return out


@helper
def _sines(row, since):  # type: ignore[no-untyped-def]
    """The sum of a row's sines: a polynomial in exp(i step omega t) by Horner's rule, so two sines and two cosines."""
    turn = row[_BODY] * since
    n = int(row[_BODY + 3])
    step_cos, step_sin = math.cos(turn * row[_BODY + 2]), math.sin(turn * row[_BODY + 2])
    # real and imaginary part of the sum of (b - i a) z^j, of a cos + b sin the harmonics' own form
    real, imaginary = 0.0, 0.0
    for j in range(n - 1, -1, -1):
        a, b = row[_COEFFICIENTS + 2 * j], row[_COEFFICIENTS + 2 * j + 1]
        real, imaginary = (
            real * step_cos - imaginary * step_sin + b,
            real * step_sin + imaginary * step_cos + a,
        )
    first = turn * row[_BODY + 1]
    return imaginary * math.cos(first) + real * math.sin(first)


@helper
def excitation(rows, count, time_s, out):  # type: ignore[no-untyped-def]
    """Sum of the deflections of ``rows[:count]`` at a time, by surface in rad, into ``out`` (3,)."""
    out[0], out[1], out[2] = 0.0, 0.0, 0.0
    for i in range(count):
        row = rows[i]
        since = time_s - row[_START]
        if since < 0.0:
            continue
        if since >= row[_PERIOD]:
            since -= row[_PERIOD] * math.floor(since / row[_PERIOD])
        if since >= row[_LENGTH]:
            continue
        kind, surface = row[_KIND], int(row[_SURFACE])
        if kind == _STEPS:
            for j in range(STEPS):
                if since < row[_BODY + j]:
                    out[surface] += row[_BODY + STEPS + j]
                    break
        elif kind == _SINES:
            out[surface] += _sines(row, since)
        elif kind == _LINEAR_SWEEP:
            phase = (row[_BODY + 1] + 0.5 * row[_BODY + 2] * since) * since
            out[surface] += row[_BODY] * math.sin(phase)
        else:
            rate = row[_BODY + 2]
            out[surface] += row[_BODY] * math.sin(row[_BODY + 1] * math.expm1(rate * since) / rate)
