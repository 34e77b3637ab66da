"""Excitations added on top of what the autopilot commands: doublets, 3-2-1-1, and doublets on a schedule."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    linearised_derivatives,
    natural_frequency_and_damping,
    state_matrix,
)
from wingwatch.simulation.layout import SURFACES

__all__ = [
    "Doublet",
    "DoubletSchedule",
    "Manoeuvre",
    "ThreeTwoOneOne",
    "doublet_pulse_s",
    "doublet_schedule",
    "step_3211_s",
]

Surface = Literal["elevator", "aileron", "rudder"]

PULSE_COLUMNS = 3 + 2 * 4
"""Surface, start, period (infinite for once), four ends since the start, four deflections."""


def doublet_pulse_s(natural_frequency_rad_s: float) -> float:
    """Width of one pulse of a doublet that excites a mode: 2.3 / omega_n (thesis equation 4.2)."""
    return 2.3 / natural_frequency_rad_s


def step_3211_s(natural_frequency_rad_s: float) -> float:
    """Width of the single step of a 3-2-1-1 that excites a mode: 1.6 / omega_n (thesis equation 4.3a)."""
    return 1.6 / natural_frequency_rad_s


def _check(surface: str, amplitude_rad: float, width_s: float, start_s: float) -> None:
    if surface not in SURFACES:
        raise ValueError(f"manoeuvre on surface {surface!r}; give one of {', '.join(SURFACES)}")
    if not (math.isfinite(amplitude_rad) and abs(amplitude_rad) < math.pi / 2):
        raise ValueError(f"manoeuvre on {surface} has amplitude {amplitude_rad} rad; give less than pi/2")
    if not (math.isfinite(width_s) and width_s > 0.0):
        raise ValueError(f"manoeuvre on {surface} has pulses of {width_s} s; give a positive width")
    if not (math.isfinite(start_s) and start_s >= 0.0):
        raise ValueError(f"manoeuvre on {surface} starts at {start_s} s; give a time from 0")


def _doublet_row(
    surface: str, amplitude: float, pulse: float, start: float, period: float
) -> tuple[float, ...]:
    ends = (pulse, 2.0 * pulse, 2.0 * pulse, 2.0 * pulse)
    return (float(SURFACES.index(surface)), start, period, *ends, amplitude, -amplitude, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Doublet:
    """One pulse up and one down on one surface.

    Attributes:
        surface: elevator, aileron or rudder.
        amplitude_rad: deflection of the first pulse; the second has the opposite sign.
        pulse_s: width of each pulse (``doublet_pulse_s``).
        start_s: when.
    """

    surface: Surface
    amplitude_rad: float
    pulse_s: float
    start_s: float

    def __post_init__(self) -> None:
        _check(self.surface, self.amplitude_rad, self.pulse_s, self.start_s)

    def pulses(self) -> tuple[tuple[float, ...], ...]:
        """Rows of ``PULSE_COLUMNS``."""
        return (_doublet_row(self.surface, self.amplitude_rad, self.pulse_s, self.start_s, math.inf),)


@dataclass(frozen=True, slots=True)
class ThreeTwoOneOne:
    """Steps of alternating sign, three, two, one and one units wide, on one surface.

    Attributes:
        surface: elevator, aileron or rudder.
        amplitude_rad: deflection of the first step.
        step_s: one unit (``step_3211_s``).
        start_s: when.
    """

    surface: Surface
    amplitude_rad: float
    step_s: float
    start_s: float

    def __post_init__(self) -> None:
        _check(self.surface, self.amplitude_rad, self.step_s, self.start_s)

    def pulses(self) -> tuple[tuple[float, ...], ...]:
        """Rows of ``PULSE_COLUMNS``."""
        ends = tuple(self.step_s * units for units in (3.0, 5.0, 6.0, 7.0))
        a = self.amplitude_rad
        return ((float(SURFACES.index(self.surface)), self.start_s, math.inf, *ends, a, -a, a, -a),)


@dataclass(frozen=True, slots=True)
class DoubletSchedule:
    """Doublets on several surfaces one after another, over and over.

    Attributes:
        surfaces: in their order.
        amplitudes_rad: one a surface.
        pulses_s: width of each pulse, one a surface.
        period_s: from one round to the next.
        spacing_s: from one surface to the next.
        start_s: of the first round.
    """

    surfaces: tuple[Surface, ...]
    amplitudes_rad: tuple[float, ...]
    pulses_s: tuple[float, ...]
    period_s: float = 20.0
    spacing_s: float = 4.0
    start_s: float = 5.0

    def __post_init__(self) -> None:
        if not len(self.surfaces) == len(self.amplitudes_rad) == len(self.pulses_s) > 0:
            raise ValueError(
                f"a doublet schedule has {len(self.surfaces)} surfaces, {len(self.amplitudes_rad)} amplitudes and "
                f"{len(self.pulses_s)} pulse widths; give one of each a surface"
            )
        for surface, amplitude, pulse in zip(self.surfaces, self.amplitudes_rad, self.pulses_s, strict=True):
            _check(surface, amplitude, pulse, self.start_s)
        round_s = self.spacing_s * (len(self.surfaces) - 1) + 2.0 * self.pulses_s[-1]
        if not (self.spacing_s >= 0.0 and self.period_s >= round_s and math.isfinite(self.period_s)):
            raise ValueError(
                f"a doublet schedule has period {self.period_s} s and spacing {self.spacing_s} s; one round takes "
                f"{round_s:g} s, give a period of at least that"
            )

    def pulses(self) -> tuple[tuple[float, ...], ...]:
        """Rows of ``PULSE_COLUMNS``."""
        columns = zip(self.surfaces, self.amplitudes_rad, self.pulses_s, strict=True)
        return tuple(
            _doublet_row(surface, amplitude, pulse, self.start_s + i * self.spacing_s, self.period_s)
            for i, (surface, amplitude, pulse) in enumerate(columns)
        )


Manoeuvre = Doublet | ThreeTwoOneOne | DoubletSchedule


def doublet_schedule(
    aircraft: Aircraft,
    condition: FlightCondition,
    amplitude_rad: float = math.radians(2.0),
    *,
    period_s: float = 20.0,
    spacing_s: float = 4.0,
    start_s: float = 5.0,
) -> DoubletSchedule:
    """Elevator, aileron and rudder doublets, each as wide as its mode wants (thesis equation 4.2).

    The elevator's is for the short period, the rudder's for the Dutch roll; the aileron takes the rudder's, which is
    long against the roll mode, so that roll rate reaches its steady value. Two degrees are the thesis's (section 7.3).

    Raises:
        AircraftDataError, TrimError: as ``linearised_derivatives``.
        ValueError: a mode without natural frequency there.
    """
    widths = []
    for structure in (SHORT_PERIOD, DUTCH_ROLL):
        matrix = state_matrix(structure, linearised_derivatives(aircraft, condition, structure))
        frequency, _ = natural_frequency_and_damping(structure, matrix)
        if math.isnan(frequency):
            raise ValueError(
                f"{structure.name} of {aircraft.name} has no natural frequency at {condition.airspeed_true_m_s:g} m/s; "
                "give pulse widths by hand"
            )
        widths.append(doublet_pulse_s(frequency))
    pulses = (widths[0], widths[1], widths[1])
    return DoubletSchedule(
        ("elevator", "aileron", "rudder"), (amplitude_rad,) * 3, pulses, period_s, spacing_s, start_s
    )


def pulse_rows(manoeuvres: Sequence[Manoeuvre]) -> NDArray[np.float64]:
    """All pulses of a flight, shape (n, PULSE_COLUMNS)."""
    rows = [row for manoeuvre in manoeuvres for row in manoeuvre.pulses()]
    return np.array(rows, dtype=np.float64).reshape(len(rows), PULSE_COLUMNS)


@njit(cache=True, error_model="numpy")
def excitation(pulses, count, time_s, out):  # type: ignore[no-untyped-def]
    """Sum of the deflections of ``pulses[:count]`` at a time, by surface, into ``out`` (3,)."""
    out[0], out[1], out[2] = 0.0, 0.0, 0.0
    for i in range(count):
        row = pulses[i]
        since = time_s - row[1]
        if since < 0.0:
            continue
        if not math.isinf(row[2]):
            since -= row[2] * math.floor(since / row[2])
        for j in range(4):
            if since < row[3 + j]:
                out[int(row[0])] += row[7 + j]
                break
