"""Play between servo and surface that the file does not have."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, updated
from wingwatch.diagnosis.measured import SURFACES
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_PLAY = FreeParameter("play_rad", "rad", 0.003, 0.02, 0.002, 0.0, 0.5)


def candidates(subject: Subject) -> list[Candidate]:
    """Where the command is known."""
    return [
        Candidate(
            "actuator_backlash", column.removesuffix("_rad"), (_PLAY,), _Play(column.removesuffix("_rad")),
            f"between the {column.removesuffix('_rad')}'s servo and its surface is a play of {{0:.4f}} rad",
            _Mended(column.removesuffix("_rad")),
        )
        for j, column in enumerate(SURFACES)
        if np.isfinite(subject.flight.commands[:, j]).any()
    ]  # fmt: skip


class _Play:
    def __init__(self, surface: str) -> None:
        self.column = INDEX[f"{surface}_backlash"]

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        model.row[self.column] += v[0]


class _Mended:
    def __init__(self, surface: str) -> None:
        self.surface = surface

    def __call__(self, aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
        """The actuator with the play."""
        stated = getattr(aircraft.actuators, self.surface)
        if stated is None:
            return None
        actuator = stated.model_dump() | {"backlash_rad": stated.backlash_rad + float(v[0])}
        return updated(aircraft, actuators=aircraft.actuators.model_dump() | {self.surface: actuator})
