"""The multisine: sums of sines, each surface with harmonics of its own, so that all may move at once.

Harmonics of one period are orthogonal over it, and no two surfaces share one: effects can be distinguished although
they act together (Klein and Morelli, Aircraft System Identification, section 9.4). Phases make the peak low for
the power (``wingwatch.aircraft.excitation``).
"""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from wingwatch.aircraft import DUTCH_ROLL, LATERAL, SHORT_PERIOD, Aircraft, ModeStructure, analysis_band_hz
from wingwatch.aircraft.excitation import (
    deal_harmonics,
    low_peak_phases_rad,
    relative_peak_factor,
    sample_wave,
)
from wingwatch.simulation.manoeuvres.rows import Surface, check_segment, sine_rows

__all__ = ["Multisine", "multisine"]

_MODE_BEHIND: Mapping[str, ModeStructure] = {
    "elevator": SHORT_PERIOD,
    "aileron": LATERAL,
    "rudder": DUTCH_ROLL,
}


@dataclass(frozen=True, slots=True)
class Multisine:
    """Sums of equal sines on one or more surfaces, over one period of the lowest frequency, 1 / length_s.

    Attributes:
        surfaces: which move.
        amplitudes_rad: largest deflection, one a surface.
        harmonics: of each surface, ascending multiples of 1 / length_s.
        phases_rad: of each harmonic, sine at the start.
        length_s: one period.
        start_s: when.
        period_s: from one start to the next: ``length_s`` for no pause, infinite for once.

    Raises:
        ValueError: not one of each a surface, harmonics that do not ascend from 1 or that two surfaces share, or as
            ``check_segment``.
    """

    surfaces: tuple[Surface, ...]
    amplitudes_rad: tuple[float, ...]
    harmonics: tuple[tuple[int, ...], ...]
    phases_rad: tuple[tuple[float, ...], ...]
    length_s: float
    start_s: float
    period_s: float = math.inf

    def __post_init__(self) -> None:
        parts = (self.surfaces, self.amplitudes_rad, self.harmonics, self.phases_rad)
        if len({len(p) for p in parts}) != 1 or not self.surfaces:
            raise ValueError(
                f"a multisine has {len(self.surfaces)} surfaces, {len(self.amplitudes_rad)} amplitudes, "
                f"{len(self.harmonics)} lists of harmonics and {len(self.phases_rad)} of phases; "
                "give one of each a surface"
            )
        for surface, amplitude, ks, phases in zip(*parts, strict=True):
            check_segment(surface, amplitude, self.start_s, self.length_s, self.period_s)
            if not (len(ks) == len(phases) > 0 and ks[0] >= 1 and all(a < b for a, b in pairwise(ks))):
                raise ValueError(
                    f"a multisine on {surface} has harmonics {list(ks)} and {len(phases)} phases; "
                    "give whole numbers from 1, ascending, and a phase for each"
                )
        shared = sorted(k for k in set().union(*self.harmonics) if sum(k in ks for ks in self.harmonics) > 1)
        if shared:
            raise ValueError(
                f"a multisine has harmonics {shared} on two surfaces, which could not be distinguished; share them out"
            )

    @property
    def relative_peak_factors(self) -> tuple[float, ...]:
        """Of each surface (``relative_peak_factor``)."""
        return tuple(
            relative_peak_factor(ks, phases)
            for ks, phases in zip(self.harmonics, self.phases_rad, strict=True)
        )

    def rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows for the kernel."""
        out: list[tuple[float, ...]] = []
        parts = zip(self.surfaces, self.amplitudes_rad, self.harmonics, self.phases_rad, strict=True)
        for surface, amplitude, ks, phases in parts:
            each = amplitude / float(np.abs(sample_wave(ks, phases)).max())
            phasors = [cmath.rect(each, phase) for phase in phases]
            out += sine_rows(surface, self.start_s, self.length_s, self.period_s, ks, phasors)
        return tuple(out)


@lru_cache(maxsize=256)
def _phases_rad(harmonics: tuple[int, ...]) -> tuple[float, ...]:
    """The search takes a second or more, and every flight of a type asks for the same."""
    return tuple(low_peak_phases_rad(harmonics).tolist())


def multisine(
    aircraft: Aircraft,
    amplitude_rad: float = math.radians(2.0),
    *,
    surfaces: tuple[Surface, ...] = ("elevator", "aileron", "rudder"),
    band_hz: tuple[float, float] | None = None,
    length_s: float = 10.0,
    start_s: float = 5.0,
    period_s: float | None = None,
) -> Multisine:
    """A multisine with the harmonics of a band dealt out to the surfaces in turn.

    Args:
        aircraft: its mode bands (``Aircraft.band_hz``) limit each surface: short period for the elevator, Dutch roll
            for the rudder, lateral for the aileron.
        amplitude_rad: largest deflection of every surface.
        surfaces: which move.
        band_hz: one band for all in place of the modes'.
        length_s: one period; its inverse is the distance of the harmonics.
        start_s: when.
        period_s: from one start to the next; ``length_s``, without a pause, where nothing is given.

    Raises:
        AircraftDataError: neither bands nor anything to derive them from.
        ValueError: a band without a harmonic for some surface; else as ``Multisine``.
    """
    for surface in surfaces:
        check_segment(surface, amplitude_rad, start_s, length_s, math.inf)
    bands = [analysis_band_hz(aircraft, _MODE_BEHIND[s]) if band_hz is None else band_hz for s in surfaces]
    dealt = deal_harmonics(surfaces, bands, length_s)
    return Multisine(
        surfaces,
        (amplitude_rad,) * len(surfaces),
        dealt,
        tuple(_phases_rad(ks) for ks in dealt),
        length_s,
        start_s,
        length_s if period_s is None else period_s,
    )
