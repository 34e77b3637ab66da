"""A servo that is slower than the file says."""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, updated
from wingwatch.diagnosis.measured import SURFACES
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]


def candidates(subject: Subject) -> list[Candidate]:
    """Where the command is known."""
    found = []
    for j, column in enumerate(SURFACES):
        surface = column.removesuffix("_rad")
        if not np.isfinite(subject.flight.commands[:, j]).any():
            continue
        stated_s = 1.0 / float(subject.model.row[INDEX[f"{surface}_bandwidth"]])
        added = FreeParameter("added_time_constant_s", "s", 0.003, 0.1, 0.005, -0.8 * stated_s, 2.0)
        found.append(
            Candidate(
                "actuator_lag", surface, (added,), _Slower(surface),
                f"the {surface}'s servo follows {{0:.3f}} s [later|sooner] than the file says (time constant "
                f"{stated_s:.3f} s)", _Mended(surface), 2.0,
            )
        )  # fmt: skip
    return found


class _Slower:
    def __init__(self, surface: str) -> None:
        self.column = INDEX[f"{surface}_bandwidth"]

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        constant_s = max(1.0 / model.row[self.column] + v[0], 1e-4)
        model.row[self.column] = 1.0 / constant_s


class _Mended:
    def __init__(self, surface: str) -> None:
        self.surface = surface

    def __call__(self, aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
        """The actuator with the new bandwidth."""
        stated = getattr(aircraft.actuators, self.surface)
        before_s = 0.0 if stated is None else 1.0 / (2.0 * math.pi * stated.bandwidth_hz)
        bandwidth = {"bandwidth_hz": 1.0 / (2.0 * math.pi * max(before_s + float(v[0]), 1e-4))}
        actuator = bandwidth if stated is None else stated.model_dump() | bandwidth
        actuators = aircraft.actuators.model_dump() | {self.surface: actuator}
        return updated(aircraft, actuators=actuators)
