"""A channel that reads a constant too much."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, output_index
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.replay import BIAS, Model
from wingwatch.diagnosis.summary import display

__all__ = ["candidates"]

_GRAVITY_VARIES_M_S2 = 0.027
"""Normal gravity at sea level is 9.780 m/s2 on the equator and 9.832 m/s2 at the poles: so far from the standard."""
_SIZES = {"m_s": 1.0, "rad_s": 0.02, "m_s2": 0.3, "rad": 0.02}


def candidates(subject: Subject) -> list[Candidate]:
    """Each measured channel but vanes where steady forces and moments are each window's own, which show as such.

    An accelerometer's bias does not, nor an attitude's: gravity is known, as far as it is the same everywhere.
    """
    known = OUTPUTS[:11] if subject.trims_known else OUTPUTS[:9]
    return [_biased(name, subject) for name in known if subject.measures(name)]


def _biased(name: str, subject: Subject) -> Candidate:
    ending = next(e for e in ("m_s2", "rad_s", "m_s", "rad") if name.endswith(f"_{e}"))
    unit, size = ending.replace("_", "/"), _SIZES[ending]
    column = output_index(name)
    noise = float(subject.flight.noise_std[column])

    def change(model: Model, v: NDArray[np.float64]) -> None:
        model.sensors[column, BIAS] += v[0]

    least = max(0.02 * size, 0.3 * noise, _GRAVITY_VARIES_M_S2 if name == "specific_force_z_m_s2" else 0.0)
    parameter = FreeParameter("bias", unit, 0.1 * size, size, least)
    return Candidate(
        "sensor_bias",
        name,
        (parameter,),
        change,
        f"{display(name).name} reads {{0:.4g}} {unit} too [much|little]",
    )
