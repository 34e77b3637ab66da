"""An input given by its samples, designed or recorded: each is held until the next."""

import math
from dataclasses import dataclass
from itertools import groupby

from wingwatch.simulation.manoeuvres.rows import STEPS, Surface, check_segment, step_row

__all__ = ["Sampled"]


@dataclass(frozen=True, slots=True)
class Sampled:
    """Deflections of one surface over time, once.

    Attributes:
        surface: elevator, aileron or rudder.
        time_s: of each sample since the flight's start, ascending; the last one is held for ``hold_s``.
        deflections_rad: from trim, one a sample.
        hold_s: time that the last sample is held.

    Raises:
        ValueError: not one deflection a sample, times that do not ascend, or as ``check_segment``.
    """

    surface: Surface
    time_s: tuple[float, ...]
    deflections_rad: tuple[float, ...]
    hold_s: float

    def __post_init__(self) -> None:
        if not len(self.time_s) == len(self.deflections_rad) > 0:
            raise ValueError(
                f"an input of {self.surface} has {len(self.time_s)} times and {len(self.deflections_rad)} deflections; "
                "give one deflection a time"
            )
        largest = max(self.deflections_rad, key=abs)
        if not all(map(math.isfinite, self.deflections_rad)):
            largest = math.nan
        ascending = all(b > a for a, b in zip(self.time_s, self.time_s[1:], strict=False))
        if not ascending:
            raise ValueError(
                f"times of an input of {self.surface} do not ascend; sort them and leave out repeats"
            )
        length_s = self.time_s[-1] - self.time_s[0] + self.hold_s
        check_segment(self.surface, largest, self.time_s[0], length_s, math.inf)

    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows for the kernel: equal samples that follow one another are one step, and rest at trim takes no row."""
        ends = (*self.time_s[1:], self.time_s[-1] + self.hold_s)
        samples = zip(self.time_s, ends, self.deflections_rad, strict=True)
        steps = []
        for value, same in groupby(samples, key=lambda one: one[2]):
            found = list(same)
            steps.append((found[0][0], found[-1][1], value))
        rows = []
        for first in range(0, len(steps), STEPS):
            some = steps[first : first + STEPS]
            start = some[0][0]
            if any(value for _, _, value in some):
                ends_s = [end - start for _, end, _ in some]
                rows.append(step_row(self.surface, start, math.inf, ends_s, [value for _, _, value in some]))
        return tuple(rows)
