"""A channel that reads in proportion too much; airspeed and vanes have names of their own."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, output_index
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.replay import SCALE, Model
from wingwatch.diagnosis.summary import display

__all__ = ["candidates", "too_large"]

_RATIO = FreeParameter("scale_error", "", 0.01, 0.1, 0.01, -0.9, 3.0)


def candidates(subject: Subject) -> list[Candidate]:
    """Each measured channel of rates, forces and attitude."""
    return [
        too_large("sensor_scale", name, name, f"{display(name).name} reads {{0:.1%}} too [much|little]")
        for name in OUTPUTS[1:9]
        if subject.measures(name)
    ]


def too_large(cause: str, target: str, channel: str, says: str) -> Candidate:
    """A scale error of a channel, under the cause's own name."""
    column = output_index(channel)

    def change(model: Model, v: NDArray[np.float64]) -> None:
        model.sensors[column, SCALE] += v[0]

    return Candidate(cause, target, (_RATIO,), change, says)
