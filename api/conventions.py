"""Derivatives in another convention, values and standard errors, through ``wingwatch.aircraft``."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from typing import Any

from wingwatch.aircraft import (
    Aircraft,
    Convention,
    FlightCondition,
    at_loading,
    convert,
    convert_standard_errors,
    display_name,
    unit,
)
from wingwatch.aircraft.structures import MODEL_STRUCTURES, ModeStructure
from wingwatch.api.encoding import quantity
from wingwatch.api.problems import ProblemError
from wingwatch.monitor.views import VehicleView

__all__ = ["convert_estimators", "convert_modes"]

_CONDITION = ("airspeed_true_m_s", "altitude_m", "air_density_kg_m3", "angle_of_attack_rad")
_Change = Callable[..., dict[str, float]]
_CHANGES: Mapping[str, _Change] = {
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
    """``convert_modes`` for a vehicle, as it is loaded.

    Raises:
        ProblemError: 422 where aircraft or condition are not known or do not suffice.
    """
    if vehicle.aircraft is None:
        raise _unconvertible(vehicle, "it has not announced its aircraft; ask for convention=concise")
    try:
        known = at_loading(aircraft(vehicle.aircraft), vehicle.mass_kg, vehicle.cg_shift_m)
        configuration = vehicle.configuration or "clean"
        return convert_modes(estimators, known, target, latest=vehicle.condition, configuration=configuration)
    except ValueError as error:
        raise _unconvertible(vehicle, str(error)) from error


def _unconvertible(vehicle: VehicleView, why: str) -> ProblemError:
    return ProblemError(
        HTTPStatus.UNPROCESSABLE_ENTITY,
        f"The derivatives of vehicle '{vehicle.vehicle}' cannot be converted: {why}.",
    )


def convert_modes(
    estimators: Mapping[str, Any],
    aircraft: Aircraft,
    target: Convention,
    *,
    latest: Mapping[str, float | None] | None = None,
    configuration: str = "clean",
) -> dict[str, Any]:
    """Every mode's concise derivatives in the target convention, under their concise symbols as keys.

    A derivative's entry gets the convention's ``unit`` and ``name``. A standard error is carried by the conversion's
    linear part; where that mixes two derivatives (the roll and yaw moments through the product of inertia) their errors
    are taken as independent. An ``interval_95`` keeps its width in standard errors.

    Args:
        estimators: modes by estimator and structure, as the contract's ``estimate`` object has them.
        aircraft: as it is loaded; needs [geometry] and [mass].
        target: the convention.
        latest: flight condition of modes that state none of their own (key ``condition``).
        configuration: of the aircraft.

    Raises:
        ValueError: a condition is not known, or the aircraft's file does not suffice; one sentence.
    """
    return {
        estimator: {
            name: _mode(
                mode, MODEL_STRUCTURES[name], _condition(mode, latest or {}, configuration), target, aircraft
            )
            for name, mode in modes.items()
        }
        for estimator, modes in estimators.items()
    }


def _condition(
    mode: Mapping[str, Any], latest: Mapping[str, float | None], configuration: str
) -> FlightCondition:
    condition: Mapping[str, float | None] = mode.get("condition") or latest
    if any(quantity(condition.get(key)) is None for key in _CONDITION[:2]):
        condition = latest
    airspeed, altitude, density, alpha = (quantity(condition.get(key)) for key in _CONDITION)
    if airspeed is None or altitude is None:
        raise ValueError("its airspeed or altitude is not known yet; ask for convention=concise")
    return FlightCondition(
        airspeed_true_m_s=airspeed,
        altitude_m=altitude,
        air_density_kg_m3=math.nan if density is None else density,
        configuration=configuration,
        angle_of_attack_rad=alpha or 0.0,
    )


def _mode(
    mode: Mapping[str, Any],
    structure: ModeStructure,
    condition: FlightCondition,
    target: Convention,
    aircraft: Aircraft,
) -> dict[str, Any]:
    derivatives = {symbol: dict(entry) for symbol, entry in mode["derivatives"].items()}
    widths = {symbol: _width(entry) for symbol, entry in derivatives.items() if "interval_95" in entry}
    for key, change in _CHANGES.items():
        change_here = partial(
            change,
            aircraft=aircraft,
            condition=condition,
            structure=structure,
            source=Convention.CONCISE,
            target=target,
        )
        known = {s: float(e[key]) for s, e in derivatives.items() if quantity(e.get(key)) is not None}
        changed = _changed(known, structure, change_here)
        for symbol, entry in derivatives.items():
            if key in entry:
                entry[key] = quantity(changed.get(symbol))
    for symbol, entry in derivatives.items():
        entry["unit"] = unit(symbol, target)
        entry["name"] = display_name(symbol, target)
        if symbol in widths:
            value, error = (math.nan if entry[k] is None else entry[k] for k in ("value", "standard_error"))
            entry["interval_95"] = [value - widths[symbol] * error, value + widths[symbol] * error]
    return {**mode, "derivatives": derivatives}


def _width(entry: Mapping[str, Any]) -> float:
    """Half of an interval in standard errors; NaN where either is not known."""
    low, high = entry["interval_95"]
    error = entry["standard_error"]
    return float(0.5 * (high - low) / error) if math.isfinite(error) and error > 0.0 else math.nan


def _changed(known: Mapping[str, float], structure: ModeStructure, change: _Change) -> dict[str, float]:
    """What is known, converted; left out is what rests on an unknown: two stand-ins for that one disagree."""
    if not known:
        return {}
    if len(known) == len(structure.derivatives):
        return change(known)
    first, second = (change({**dict.fromkeys(structure.derivatives, x), **known}) for x in (0.0, 1.0))
    return {symbol: first[symbol] for symbol in known if first[symbol] == second[symbol]}
