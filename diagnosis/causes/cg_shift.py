"""A centre of gravity that is not where the file's coefficients take it."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject
from wingwatch.diagnosis.coefficients import with_added
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]


def candidates(subject: Subject) -> list[Candidate]:
    """Always tried."""
    chord = subject.aircraft.need_geometry("diagnosis").mean_chord_m
    shift = FreeParameter("shift_aft_m", "m", 0.01 * chord, 0.1 * chord, 0.01 * chord, -chord, chord)
    return [
        Candidate(
            "cg_shift", "", (shift,), _change, "the centre of gravity is {0:+.3f} m aft of where the simulation has it",
            _mend, 2.0,
        )
    ]  # fmt: skip


def _change(model: Model, v: NDArray[np.float64]) -> None:
    model.row[INDEX["cg_x_m"]] -= v[0]


def _mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
    """Moments about the new centre: forces keep their places (small angles)."""
    c, g = aircraft.coefficients, aircraft.geometry
    if c is None or g is None:
        return None
    pitch, yaw = float(v[0]) / g.mean_chord_m, float(v[0]) / g.span_m
    moved = {
        f"Cm_{name}": pitch * getattr(c.CL, name) for name in ("zero", "alpha", "q", "alphadot", "elevator")
    }
    moved |= {f"Cn_{name}": yaw * getattr(c.CY, name) for name in ("beta", "p", "r", "aileron", "rudder")}
    return with_added(aircraft, moved)
