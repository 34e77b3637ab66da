"""A servo whose rate is limited more than the file says; fitted is one over the limit, so that 0 is none."""

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
        commands = subject.flight.commands[:, j]
        if not np.isfinite(commands).any():
            continue
        fastest = (
            float(np.nanmax(np.abs(np.diff(subject.flight.outputs[:, 11 + j])), initial=0.0))
            / subject.flight.dt_s
        )
        slow = 1.0 / max(fastest, 0.2)
        added = FreeParameter("rate_limit_rad_s", "rad/s", slow, 2.0, 0.05, 0.0, 100.0, inverse=True)
        found.append(
            Candidate(
                "actuator_rate_limit", surface, (added,), _Limited(surface),
                f"the {surface}'s servo moves no faster than one radian in {{0:.2f}} s", _Mended(surface),
            )
        )  # fmt: skip
    return found


class _Limited:
    def __init__(self, surface: str) -> None:
        self.column = INDEX[f"{surface}_rate_limit"]

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        if v[0] > 0.0:
            model.row[self.column] = min(model.row[self.column], 1.0 / v[0])


class _Mended:
    def __init__(self, surface: str) -> None:
        self.surface = surface

    def __call__(self, aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
        """The actuator with the new limit."""
        stated = getattr(aircraft.actuators, self.surface)
        if stated is None or v[0] <= 0.0:
            return None
        actuator = stated.model_dump() | {"rate_limit_rad_s": 1.0 / float(v[0])}
        return updated(aircraft, actuators=aircraft.actuators.model_dump() | {self.surface: actuator})
