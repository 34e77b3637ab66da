"""The extended aircraft file: every cause that has a place in it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, ConditionEntry, DerivativeEntry
from wingwatch.diagnosis.candidate import Subject, updated
from wingwatch.diagnosis.linear_aircraft import concise, entry_near
from wingwatch.diagnosis.problem import Point
from wingwatch.diagnosis.replay import Model

__all__ = ["extended"]

Array = NDArray[np.float64]


def extended(subject: Subject, point: Point, errors: Sequence[Array]) -> Aircraft | None:
    """The aircraft file with the causes of a point in it; None where it has a place for none of them."""
    mended, any_place = subject.stated, False
    left, before = list(zip(point.causes, point.values, strict=True)), -1
    while (
        len(left) != before
    ):  # one may have a place only once another is in: early against a group that is late
        waiting, before, left = left, len(left), []
        for cause, values in waiting:
            changed = cause.mend(mended, values)
            if changed is None:
                left.append((cause, values))
            else:
                mended, any_place = changed, True
    if subject.aircraft.coefficients is None:
        entry = _identified(subject, point, errors)
        if entry is not None:
            conditions = (*mended.conditions, entry)
            mended, any_place = mended.model_copy(update={"conditions": conditions}), True
    return mended if any_place else None


def _identified(subject: Subject, point: Point, errors: Sequence[Array]) -> ConditionEntry | None:
    """The stated condition with the derivatives of the mended model; None where these are as before."""
    speed = subject.flight.airspeed_m_s
    stated = entry_near(subject.aircraft, speed)
    if stated is None:
        return None
    model = subject.model.copy()
    for cause, values in zip(point.causes, point.values, strict=True):
        cause.change(model, values)
    symbols = tuple(stated.derivatives)
    at = replace(stated.condition)
    before, after = concise(subject.model.row, at, symbols), concise(model.row, at, symbols)
    if np.allclose(before, after, rtol=1e-6):
        return None
    spread = _spread(subject, point, errors, symbols)
    found = {
        s: DerivativeEntry(
            value=stated.derivatives[s].value + float(a - b),
            standard_error=float(e) if e > 0.0 else stated.derivatives[s].standard_error,
        )
        for s, a, b, e in zip(symbols, after, before, spread, strict=True)
    }
    entry: ConditionEntry = updated(
        stated, provenance="identified", source="wingwatch diagnose", derivatives=found
    )
    return entry


def _spread(subject: Subject, point: Point, errors: Sequence[Array], symbols: tuple[str, ...]) -> Array:
    """Standard errors of the derivatives by those of the causes' parameters, each alone."""
    entry = entry_near(subject.aircraft, subject.flight.airspeed_m_s)
    at = replace(entry.condition) if entry is not None else None
    square = np.zeros(len(symbols))
    if at is None:
        return square

    def at_values(i: int, values: Array) -> Array:
        model: Model = subject.model.copy()
        for j, cause in enumerate(point.causes):
            cause.change(model, values if j == i else point.values[j])
        return concise(model.row, at, symbols)

    for i, (values, error) in enumerate(zip(point.values, errors, strict=True)):
        for k in range(len(values)):
            step = np.eye(len(values))[k] * error[k]
            square += (0.5 * (at_values(i, values + step) - at_values(i, values - step))) ** 2
    return np.sqrt(square)
