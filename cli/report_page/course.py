"""Derivatives and frequencies over a flight, at instants that a picture can show."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import ModeStructure
from wingwatch.diagnosis.predicted_motion import Derivatives
from wingwatch.estimators import offsets, referred_scale
from wingwatch.monitor import Report, VehicleMonitor

__all__ = ["ESTIMATOR_NAMES", "IN_SENTENCES", "Course", "ModeCourse"]

Array = NDArray[np.float64]

ESTIMATOR_NAMES = {"fourier": "Fourier", "ekf": "filter"}
"""Of tables."""

IN_SENTENCES = {"fourier": "Fourier estimator", "ekf": "filter"}
INSTANTS = 300
"""At most so many of a flight."""


@dataclass(slots=True)
class ModeCourse:
    """One mode by one estimator over time.

    Attributes:
        objects: the contract's object of the mode at each instant.
        conditions: of the estimates, as ``Estimate`` has them.
    """

    structure: ModeStructure
    time_s: list[float] = field(default_factory=list)
    conditions: list[tuple[float, float, float, float]] = field(default_factory=list)
    objects: list[Mapping[str, Any]] = field(default_factory=list)

    def derivative(self, symbol: str, key: str) -> Array:
        """One number of a derivative over time; NaN where it is not known."""
        rows = (one["derivatives"][symbol].get(key) for one in self.objects)
        return np.array([np.nan if value is None else value for value in rows], dtype=np.float64)

    @property
    def usual_condition(self) -> tuple[float, float, float, float]:
        """Median condition of the estimates, as ``Estimate`` has it."""
        known = np.array(self.conditions)
        known = known[np.isfinite(known[:, :3]).all(axis=1)]
        airspeed, altitude, density, alpha = np.median(known, axis=0) if len(known) else np.full(4, np.nan)
        return float(airspeed), float(altitude), float(density), float(alpha)

    def referred(self, symbol: str, condition: tuple[float, float, float, float]) -> dict[str, Array]:
        """Numbers of a derivative over time as they would be at one condition: its changes are then the aircraft's."""
        airspeed, _, density, alpha = condition
        place = self.structure.derivatives.index(symbol)
        at = np.array(self.conditions)
        scale = referred_scale(self.structure, at[:, 0], at[:, 2], (airspeed, density))[:, place]
        moved = offsets(self.structure, at[:, 0], at[:, 3])[:, place]
        there = float(offsets(self.structure, airspeed, alpha)[place])
        found = {}
        for key in ("value", "expected"):
            found[key] = (self.derivative(symbol, key) - moved) / scale + there
            error = "standard_error" if key == "value" else "expected_standard_error"
            found[error] = self.derivative(symbol, error) / scale
        return found

    def outcomes(self, symbol: str) -> list[str]:
        """Of a derivative over time."""
        return [str(one["derivatives"][symbol]["outcome"]) for one in self.objects]

    def quantity(self, key: str) -> Array:
        """Frequency or damping of the fastest mode over time."""
        return np.array([np.nan if one[key] is None else one[key] for one in self.objects], dtype=np.float64)


class Course:
    """Listens to a flight being watched.

    Args:
        duration_s: of the flight, which decides how far apart instants are.

    Attributes:
        modes: by structure and estimator.
    """

    def __init__(self, duration_s: float) -> None:
        self._step_s = max(duration_s / INSTANTS, 0.0)
        self._taken_s = float("-inf")
        self.modes: dict[str, dict[str, ModeCourse]] = {}

    def __call__(self, monitor: VehicleMonitor, report: Report) -> None:
        """Take the estimates of a piece's last solution, where it is time."""
        for solution in report.solutions:
            since = solution.time_s - self._taken_s
            if 0.0 <= since < self._step_s:  # before it only on another clock
                continue
            self._taken_s = solution.time_s
            for name, mode in solution.modes.items():
                for estimate in mode.estimates:
                    courses = self.modes.setdefault(name, {})
                    course = courses.setdefault(estimate.estimator, ModeCourse(estimate.structure))
                    course.time_s.append(solution.time_s)
                    course.conditions.append(estimate.condition)
                    course.objects.append(monitor.mode_object(estimate))

    def known(self, structure: ModeStructure, at_s: float) -> Derivatives | None:
        """Derivatives at an instant, of the estimator that knows more of them; what it does not know as expected."""
        best: tuple[int, Derivatives] | None = None
        for name, course in self.modes.get(structure.name, {}).items():
            k = int(np.searchsorted(np.array(course.time_s), at_s))
            k = min(k, len(course.time_s) - 1)
            rows = course.objects[k]["derivatives"]
            shown = [row["outcome"] in ("converged", "settling") for row in rows.values()]
            condition = course.conditions[k]
            if not any(shown) or not np.isfinite(condition[:3]).all():
                continue
            expected = np.array([_number(row.get("expected")) for row in rows.values()])
            value = np.array([_number(row["value"]) for row in rows.values()])
            value = np.where(np.array(shown) & np.isfinite(value), value, expected)
            if best is None or sum(shown) > best[0]:
                best = sum(shown), Derivatives(value, expected, name, condition)
        return None if best is None else best[1]


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
