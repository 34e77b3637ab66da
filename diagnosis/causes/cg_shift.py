"""A centre of gravity that is not where the file's coefficients take it."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, at_loading
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]


def candidates(subject: Subject) -> list[Candidate]:
    """Always tried."""
    chord = subject.aircraft.need_geometry("diagnosis").mean_chord_m
    shift = FreeParameter("shift_aft_m", "m", 0.01 * chord, 0.1 * chord, 0.01 * chord, -chord, chord)
    return [
        Candidate(
            "cg_shift", "", (shift,), _change,
            "the centre of gravity is {0:.3f} m [aft|forward] of where the simulation has it", _mend, 2.0,
        )
    ]  # fmt: skip


def _change(model: Model, v: NDArray[np.float64]) -> None:
    model.row[INDEX["cg_x_m"]] -= v[0]


def _mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
    """The same aircraft about the new centre, where its file says enough."""
    if aircraft.mass is None or aircraft.geometry is None:
        return None
    return at_loading(aircraft, None, float(v[0]))
