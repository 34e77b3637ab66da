"""Thrust that pitches the aircraft more or less than in the simulation."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, updated
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]


def candidates(subject: Subject) -> list[Candidate]:
    """Where thrust is simulated."""
    if not subject.throttle_known:
        return []
    chord = subject.aircraft.need_geometry("diagnosis").mean_chord_m
    lower = FreeParameter("line_lower_m", "m", 0.02 * chord, 0.2 * chord, 0.02 * chord, -10.0, 10.0)
    return [
        Candidate(
            "thrust_effect",
            "",
            (lower,),
            _change,
            "the thrust line lies {0:.3f} m [lower|higher] than in the simulation",
            _mend,
        )
    ]


def _change(model: Model, v: NDArray[np.float64]) -> None:
    model.row[INDEX["thrust_line_z_m"]] += v[0]


def _mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
    p = aircraft.propulsion
    if p is None:
        return None
    moved = p.model_dump() | {"thrust_line_z_m": p.thrust_line_z_m + float(v[0])}
    return updated(aircraft, propulsion=moved)
