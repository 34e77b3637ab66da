"""Derivatives in another convention, values and standard errors, through ``wingwatch.aircraft``."""

import math
from collections.abc import Callable, Mapping
from http import HTTPStatus
from typing import Any

from wingwatch.aircraft import (
    Aircraft,
    Convention,
    FlightCondition,
    convert,
    convert_standard_errors,
    display_name,
    unit,
)
from wingwatch.aircraft.structures import STRUCTURES, ModeStructure
from wingwatch.api.encoding import quantity
from wingwatch.api.problems import ProblemError
from wingwatch.monitor.views import VehicleView

__all__ = ["convert_estimators"]

_CHANGES = {
    "value": convert,
    "standard_error": convert_standard_errors,
    "expected": convert,
    "expected_standard_error": convert_standard_errors,
}


def convert_estimators(
    estimators: Mapping[str, Any],
    vehicle: VehicleView,
    target: Convention,
    aircraft: Callable[[str], Aircraft],
) -> dict[str, Any]:
    """Every mode's concise derivatives in the target convention, under their concise symbols as keys.

    The flight condition is the estimate's own (key ``condition`` of the mode) or the vehicle's latest. A
    standard error is carried by the conversion's linear part; where that mixes two derivatives (the roll and
    yaw moments through the product of inertia) their errors are taken as independent.

    Raises:
        ProblemError: 422 where aircraft or condition are not known or do not suffice.
    """
    if vehicle.aircraft is None:
        raise _unconvertible(vehicle, "it has not announced its aircraft; ask for convention=concise")
    try:
        known = aircraft(vehicle.aircraft)
        return {
            estimator: {
                name: _mode(mode, STRUCTURES[name], vehicle, target, known) for name, mode in modes.items()
            }
            for estimator, modes in estimators.items()
        }
    except ValueError as error:
        raise _unconvertible(vehicle, str(error)) from error


def _unconvertible(vehicle: VehicleView, why: str) -> ProblemError:
    return ProblemError(
        HTTPStatus.UNPROCESSABLE_ENTITY,
        f"The derivatives of vehicle '{vehicle.vehicle}' cannot be converted: {why}.",
    )


def _condition(mode: Mapping[str, Any], vehicle: VehicleView) -> FlightCondition:
    condition: Mapping[str, float] = mode.get("condition") or vehicle.condition
    missing = [key for key in ("airspeed_true_m_s", "altitude_m") if condition.get(key) is None]
    if missing:
        raise ValueError(f"its {' and '.join(missing)} is not known yet")
    alpha = condition.get("angle_of_attack_rad", 0.0)
    return FlightCondition(
        airspeed_true_m_s=condition["airspeed_true_m_s"],
        altitude_m=condition["altitude_m"],
        air_density_kg_m3=condition.get("air_density_kg_m3", math.nan),
        configuration=vehicle.configuration or "clean",
        angle_of_attack_rad=alpha if math.isfinite(alpha) else 0.0,
    )


def _mode(
    mode: Mapping[str, Any],
    structure: ModeStructure,
    vehicle: VehicleView,
    target: Convention,
    aircraft: Aircraft,
) -> dict[str, Any]:
    condition = _condition(mode, vehicle)
    derivatives = {symbol: dict(entry) for symbol, entry in mode["derivatives"].items()}
    for key, change in _CHANGES.items():
        present = [symbol for symbol, entry in derivatives.items() if key in entry]
        if not present:
            continue
        before = {s: _number(derivatives.get(s, {}).get(key)) for s in structure.derivatives}
        after = change(
            before,
            aircraft=aircraft,
            condition=condition,
            structure=structure,
            source=Convention.CONCISE,
            target=target,
        )
        for symbol in present:
            derivatives[symbol][key] = quantity(after[symbol])
    for symbol, entry in derivatives.items():
        entry["unit"] = unit(symbol, target)
        entry["name"] = display_name(symbol, target)
    return {**mode, "derivatives": derivatives}


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
