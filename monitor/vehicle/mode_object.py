"""The contract's object of one mode by one estimator, live and of a whole flight."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wingwatch.aircraft import MODEL_DERIVATIVES, ModeQuantity
from wingwatch.baselines import Expectation
from wingwatch.estimators import Estimate

__all__ = ["mode_object"]

_CONDITION = ("airspeed_true_m_s", "altitude_m", "air_density_kg_m3", "angle_of_attack_rad")


def mode_object(
    estimate: Estimate, expected: Expectation | None, quantities: Sequence[ModeQuantity]
) -> dict[str, Any]:
    """Outcome, condition, derivatives with units beside what is expected, frequency and damping of the fastest mode.

    Args:
        estimate: of one structure.
        expected: at its condition; None where there is none.
        quantities: of its modes (``aircraft.mode_quantities``), fastest first.
    """
    error = estimate.standard_error
    rows: dict[str, dict[str, Any]] = {}
    for k, symbol in enumerate(estimate.structure.derivatives):
        rows[symbol] = {
            "value": float(estimate.value[k]),
            "standard_error": float(error[k]),
            "unit": MODEL_DERIVATIVES[symbol].unit,
            "outcome": str(estimate.outcomes[k]),
        }
        if expected is not None:
            rows[symbol]["expected"] = float(expected.value[k])
            rows[symbol]["expected_standard_error"] = float(expected.standard_error[k])
    first = {q.name: (q.value, q.standard_error) for q in reversed(quantities)}
    frequency = first.get("natural_frequency_rad_s", (np.nan, np.nan))
    damping = first.get("damping_ratio", (np.nan, np.nan))
    return {
        "outcome": str(estimate.outcome),
        "reason": estimate.reason,
        "confounded": [list(names) for names in estimate.confounded],
        "condition": dict(zip(_CONDITION, estimate.condition, strict=True)),
        "derivatives": rows,
        "natural_frequency_rad_s": frequency[0],
        "natural_frequency_rad_s_standard_error": frequency[1],
        "damping_ratio": damping[0],
        "damping_ratio_standard_error": damping[1],
    }
