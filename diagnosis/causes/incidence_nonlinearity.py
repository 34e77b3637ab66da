"""Lift and pitching moment that are curved over the angle of attack, where the file's are straight."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_SLOPE = FreeParameter("change_of_slope", "1/rad", 0.5, 5.0, 0.5, -50.0, 50.0)
_TABLES = {"": ("CL", "Cm"), "lift": ("CL",), "pitch": ("Cm",)}


def candidates(subject: Subject) -> list[Candidate]:
    """Of lift and pitching moment together, and of each."""
    reference = _mean_alpha(subject)
    return [
        Candidate(
            "incidence_nonlinearity", target, (_SLOPE,), _Bend(tables, reference),
            f"{' and '.join(tables)} bend with the angle of attack: slope changes by {{0:+.1f}} of itself per rad "
            f"about {reference:.3f} rad", odds=0.3 if target else 1.0,
        )
        for target, tables in _TABLES.items()
    ]  # fmt: skip


class _Bend:
    """Quadratic terms about a reference, slope and value there unchanged."""

    def __init__(self, tables: tuple[str, ...], reference: float) -> None:
        self.tables, self.reference = tables, reference

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        model.row[INDEX["alpha_reference"]] = self.reference
        for table in self.tables:
            model.row[INDEX[f"{table}_alpha_square"]] += 0.5 * v[0] * model.row[INDEX[f"{table}_alpha"]]


def _mean_alpha(subject: Subject) -> float:
    alpha = subject.flight.outputs[:, 9]
    return float(np.nanmean(alpha)) if np.isfinite(alpha).any() else 0.0
