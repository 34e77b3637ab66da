"""The 3-2-1-1."""

import math
from dataclasses import dataclass

from wingwatch.aircraft import DUTCH_ROLL, SHORT_PERIOD, Aircraft, FlightCondition
from wingwatch.aircraft.excitation import mode_frequency_rad_s, step_3211_s
from wingwatch.simulation.manoeuvres.rows import Surface, check_segment, step_row

__all__ = ["ThreeTwoOneOne", "three_two_one_one_schedule"]

_UNITS = 7.0


@dataclass(frozen=True, slots=True)
class ThreeTwoOneOne:
    """Steps of alternating sign, three, two, one and one units wide, on one surface.

    Attributes:
        surface: elevator, aileron or rudder.
        amplitude_rad: deflection of the first step.
        step_s: one unit (``step_3211_s``).
        start_s: when.
        period_s: from one to the next; infinite for a single one.

    Raises:
        ValueError: as ``check_segment``.
    """

    surface: Surface
    amplitude_rad: float
    step_s: float
    start_s: float
    period_s: float = math.inf

    def __post_init__(self) -> None:
        check_segment(self.surface, self.amplitude_rad, self.start_s, _UNITS * self.step_s, self.period_s)

    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows for the kernel."""
        ends = tuple(self.step_s * units for units in (3.0, 5.0, 6.0, _UNITS))
        a = self.amplitude_rad
        return (step_row(self.surface, self.start_s, self.period_s, ends, (a, -a, a, -a)),)


def three_two_one_one_schedule(
    aircraft: Aircraft,
    condition: FlightCondition,
    amplitude_rad: float = math.radians(2.0),
    *,
    period_s: float = 30.0,
    spacing_s: float = 8.0,
    start_s: float = 5.0,
) -> tuple[ThreeTwoOneOne, ...]:
    """A 3-2-1-1 on elevator, aileron and rudder in turn, over and over, each as wide as its mode wants (equation 4.3a).

    The elevator's is for the short period; rudder and aileron take the Dutch roll's.

    Raises:
        AircraftDataError, TrimError: as ``linearised_derivatives``.
        ValueError: a mode without natural frequency there, or a round longer than the period.
    """
    short, dutch = (
        step_3211_s(mode_frequency_rad_s(aircraft, condition, mode)) for mode in (SHORT_PERIOD, DUTCH_ROLL)
    )
    surfaces: tuple[tuple[Surface, float], ...] = (("elevator", short), ("aileron", dutch), ("rudder", dutch))
    return tuple(
        ThreeTwoOneOne(surface, amplitude_rad, step, start_s + i * spacing_s, period_s)
        for i, (surface, step) in enumerate(surfaces)
    )
