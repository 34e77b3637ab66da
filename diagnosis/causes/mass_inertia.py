"""A mass that is not what the file says, its inertia alike."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, scale, updated

__all__ = ["candidates"]

_FACTORS = dict.fromkeys(
    ("mass_kg", "inertia_x", "inertia_y", "inertia_z", "inertia_xz", "inertia_xy", "inertia_yz"), 1.0
)
_RATIO = FreeParameter("change", "", 0.02, 0.2, 0.02, -0.7, 3.0)


def candidates(subject: Subject) -> list[Candidate]:
    """Where the file states a mass."""
    if subject.stated.mass is None:
        return []
    return [
        Candidate(
            "mass_inertia", "", (_RATIO,), lambda model, v: scale(model, _FACTORS, v[0]),
            "mass and moments of inertia differ from the simulation's by {0:+.0%}, or thrust and all coefficients by "
            "the inverse: motion shows their ratio alone",
            _mend, 2.0,
        )
    ]  # fmt: skip


def _mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
    mass = aircraft.mass
    if mass is None:
        return None
    stated = mass.model_dump()
    changed = {name: value * (1.0 + float(v[0])) for name, value in stated.items() if name != "cg_shift_m"}
    return updated(aircraft, mass=stated | changed)
