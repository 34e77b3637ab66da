"""What the history of estimates gives for pictures: flights, and their estimates as columns of numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["FlightRecord", "HistoryColumns", "HistoryKey"]

Array = NDArray[np.float64]

HistoryKey = tuple[int, float, str, str]
"""Flight, time, estimator and structure of an estimate."""


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """One flight of a vehicle, as far as its estimates are kept.

    Attributes:
        id: a later flight of the vehicle has a higher one.
        first_time_s, last_time_s: vehicle's clock, of its first and its last estimate.
        began_at_s, last_at_s: seconds since 1970-01-01 UTC; the first is None where it is not known.
        estimates: how many are kept, of one mode by one estimator each.
    """

    id: int
    aircraft: str
    configuration: str
    first_time_s: float
    last_time_s: float
    began_at_s: float | None
    last_at_s: float
    estimates: int


@dataclass(frozen=True, slots=True)
class HistoryColumns:
    """Estimates of one structure by one estimator in one flight, by time.

    Attributes:
        time_s: (n,), ascending.
        value, standard_error: (n, k), in the order of the structure's derivatives; NaN and infinite where nothing is
            known.
        condition: (n, 4), airspeed_true_m_s, altitude_m, air_density_kg_m3 and angle_of_attack_rad.
        outcomes: of the mode, n of them.
    """

    flight: int
    aircraft: str
    configuration: str
    structure: str
    estimator: str
    time_s: Array
    value: Array
    standard_error: Array
    condition: Array
    outcomes: Sequence[str]
