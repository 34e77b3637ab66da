"""The frequency sweep, linear and logarithmic."""

import math
from dataclasses import dataclass

from wingwatch.aircraft.excitation import SweepKind, sweep_end_s, sweep_phase_rad, sweep_rate
from wingwatch.simulation.manoeuvres.rows import Surface, check_segment, sweep_row

__all__ = ["Sweep", "SweepKind"]


@dataclass(frozen=True, slots=True)
class Sweep:
    """A sine of rising or falling frequency on one surface.

    Linear: omega = omega_1 + (omega_2 - omega_1) t / T (thesis equation 4.4b). Logarithmic: omega = omega_1 (omega_2 /
    omega_1)^(t / T), which spends the same time in every octave (the thesis's equation 4.4c nears this by constants).
    It ends at its last crossing of zero within T, so that the surface is not let go from a deflection.

    Attributes:
        surface: elevator, aileron or rudder.
        amplitude_rad: of the sine.
        band_hz: frequency at the start and at the end.
        length_s: T.
        start_s: when.
        kind: linear or logarithmic.
        period_s: from one sweep to the next; infinite for a single one.

    Raises:
        ValueError: frequencies that are not positive or equal, less than a whole cycle, an unknown kind, or as
            ``check_segment``.
    """

    surface: Surface
    amplitude_rad: float
    band_hz: tuple[float, float]
    length_s: float
    start_s: float
    kind: SweepKind = "linear"
    period_s: float = math.inf

    def __post_init__(self) -> None:
        check_segment(self.surface, self.amplitude_rad, self.start_s, self.length_s, self.period_s)
        if self.kind not in ("linear", "logarithmic"):
            raise ValueError(f"a sweep of kind {self.kind!r}; give linear or logarithmic")
        first, last = self.band_hz
        if not (0.0 < first < math.inf and 0.0 < last < math.inf and first != last):
            raise ValueError(
                f"a sweep on {self.surface} goes from {first} to {last} Hz; give two different positive frequencies"
            )
        if sweep_phase_rad(self.kind, self.band_hz, self.length_s, self.length_s) < 2.0 * math.pi:
            raise ValueError(
                f"a sweep on {self.surface} from {first:g} to {last:g} Hz lasts {self.length_s:g} s, "
                "less than a whole cycle; make it longer"
            )

    @property
    def ends_s(self) -> float:
        """Time from the start to the last crossing of zero."""
        return sweep_end_s(self.kind, self.band_hz, self.length_s)

    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows for the kernel."""
        return (
            sweep_row(
                self.surface, self.start_s, self.ends_s, self.period_s, self.amplitude_rad,
                2.0 * math.pi * self.band_hz[0],
                sweep_rate(self.kind, self.band_hz, self.length_s), self.kind == "logarithmic",
            ),
        )  # fmt: skip
