"""The doublet, alone and on a schedule over several surfaces."""

import math
from dataclasses import dataclass

from wingwatch.aircraft import DUTCH_ROLL, SHORT_PERIOD, Aircraft, FlightCondition
from wingwatch.aircraft.excitation import doublet_pulse_s, mode_frequency_rad_s
from wingwatch.simulation.manoeuvres.rows import Surface, check_segment, step_row

__all__ = ["Doublet", "DoubletSchedule", "doublet_schedule"]


@dataclass(frozen=True, slots=True)
class Doublet:
    """One pulse up and one down on one surface.

    Attributes:
        surface: elevator, aileron or rudder.
        amplitude_rad: deflection of the first pulse; the second has the opposite sign.
        pulse_s: width of each pulse (``doublet_pulse_s``).
        start_s: when.
        period_s: from one doublet to the next; infinite for a single one.

    Raises:
        ValueError: as ``check_segment``.
    """

    surface: Surface
    amplitude_rad: float
    pulse_s: float
    start_s: float
    period_s: float = math.inf

    def __post_init__(self) -> None:
        check_segment(self.surface, self.amplitude_rad, self.start_s, 2.0 * self.pulse_s, self.period_s)

    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows for the kernel."""
        ends, a = (self.pulse_s, 2.0 * self.pulse_s), self.amplitude_rad
        return (step_row(self.surface, self.start_s, self.period_s, ends, (a, -a)),)


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

    Raises:
        ValueError: not one of each a surface, a round longer than the period, or as ``Doublet``.
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
        round_s = self.spacing_s * (len(self.surfaces) - 1) + 2.0 * self.pulses_s[-1]
        if not (self.spacing_s >= 0.0 and self.period_s >= round_s and math.isfinite(self.period_s)):
            raise ValueError(
                f"a doublet schedule has period {self.period_s} s and spacing {self.spacing_s} s; one round takes "
                f"{round_s:g} s, give a period of at least that"
            )
        self.doublets()

    def doublets(self) -> tuple[Doublet, ...]:
        """One a surface, each repeated with the schedule's period."""
        columns = zip(self.surfaces, self.amplitudes_rad, self.pulses_s, strict=True)
        return tuple(
            Doublet(surface, amplitude, pulse, self.start_s + i * self.spacing_s, self.period_s)
            for i, (surface, amplitude, pulse) in enumerate(columns)
        )

    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows for the kernel."""
        return tuple(row for doublet in self.doublets() for row in doublet.rows())


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
    pulses = [
        doublet_pulse_s(mode_frequency_rad_s(aircraft, condition, mode))
        for mode in (SHORT_PERIOD, DUTCH_ROLL)
    ]
    return DoubletSchedule(
        ("elevator", "aileron", "rudder"),
        (amplitude_rad,) * 3,
        (pulses[0], pulses[1], pulses[1]),
        period_s,
        spacing_s,
        start_s,
    )
