"""Of a flight's estimates, the derivative that is furthest from what is expected."""

from collections.abc import Mapping
from math import hypot, isfinite
from typing import Any

__all__ = ["furthest"]


def furthest(result: Mapping[str, Any]) -> tuple[float, str]:
    """By how many standard errors, estimate's and expectation's together, and a line that says it.

    Args:
        result: the JSON object of ``estimate``, or one with an ``error``.

    Returns:
        The distance, 0 where nothing was estimated, and the line.
    """
    if "error" in result:
        return 0.0, str(result["error"]).removeprefix(f"{result['flight']}: ")
    worst, text = -1.0, ""
    outcomes: dict[str, str] = {}
    for estimator, modes in result["estimators"].items():
        for structure, mode in modes.items():
            outcomes.setdefault(structure, str(mode["outcome"]).replace("_", " "))
            for symbol, row in mode["derivatives"].items():
                z = _distance(row)
                if z > worst:
                    worst = z
                    expected = f"expected {row['expected']:.4g} ± {row['expected_standard_error']:.2g}"
                    found = f"{row.get('name', symbol)} {row['value']:.4g} ± {row['standard_error']:.2g}"
                    text = f"{found} by {estimator}, {expected}, {z:.1f} standard errors"
    states = ", ".join(f"{name} {outcome}" for name, outcome in outcomes.items())
    return max(worst, 0.0), f"{text}; {states}" if text else states


def _distance(row: Mapping[str, Any]) -> float:
    """Standard errors between an estimate and its expectation; -1 where one of them is not known."""
    numbers = [row.get(key) for key in ("value", "standard_error", "expected", "expected_standard_error")]
    if row["outcome"] not in ("converged", "settling") or not all(
        n is not None and isfinite(n) for n in numbers
    ):
        return -1.0
    value, error, expected, expected_error = (float(n) for n in numbers if n is not None)
    together = hypot(error, expected_error)
    return abs(value - expected) / together if together > 0.0 else -1.0
