"""A surface that stands beside its command, or whose reading does."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject
from wingwatch.diagnosis.measured import COMMANDS, SURFACES
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_OFFSET = FreeParameter("offset_rad", "rad", 0.002, 0.05, 0.003, -1.0, 1.0)


def candidates(subject: Subject) -> list[Candidate]:
    """Where the command is known."""
    flight = subject.flight
    return [
        Candidate(
            "surface_offset", surface.removesuffix("_rad"), (_OFFSET,), _Offset(surface.removesuffix("_rad")),
            f"the {surface.removesuffix('_rad')} stands {{0:+.4f}} rad beside its command", odds=2.0,
        )
        for j, surface in enumerate(SURFACES)
        if np.isfinite(flight.commands[:, j]).any() and COMMANDS[j]
    ]  # fmt: skip


class _Offset:
    def __init__(self, surface: str) -> None:
        self.column = INDEX[f"{surface}_offset"]

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        model.row[self.column] += v[0]
