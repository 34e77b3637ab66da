"""How fast the estimators forgot a flight, said as a time constant and as a factor a sample."""

import math
from typing import Any

import numpy as np

from wingwatch.cli.arguments.values import ENDLESS_S
from wingwatch.telemetry import FlightTable

__all__ = ["forgetting_object"]


def forgetting_object(memory_s: float, flight: FlightTable) -> dict[str, Any]:
    """For JSON, with a sentence; ``time_constant_s`` is None where nothing is forgotten.

    The factor is that of the flight's own samples, exp(-step / time constant).
    """
    steps = np.diff(flight.block.time_s)
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    step_s = float(np.median(steps)) if steps.size else math.nan
    if memory_s >= ENDLESS_S:
        return {
            "time_constant_s": None,
            "factor": 1.0,
            "rate_hz": 1.0 / step_s,
            "text": "nothing is forgotten",
        }
    factor = math.exp(-step_s / memory_s)
    return {
        "time_constant_s": memory_s,
        "factor": factor,
        "rate_hz": 1.0 / step_s,
        "text": f"forgotten with a time constant of {memory_s:.4g} s: {factor:.5f} a sample at {1.0 / step_s:.4g} Hz",
    }
