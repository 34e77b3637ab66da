"""Coefficients that give stated derivatives: what a condition of an aircraft file means in [coefficients]."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wingwatch.aircraft.aircraft_file import Aircraft, AircraftDataError, ConditionEntry
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.empirical import empirical_coefficients
from wingwatch.aircraft.linearisation import Trim, linearised_at, trim
from wingwatch.aircraft.structures import DUTCH_ROLL, LATERAL, SHORT_PERIOD, ModeStructure

__all__ = ["with_stated_derivatives"]

_ROWS: Mapping[str, str] = {"z": "CL", "m": "Cm", "y": "CY", "l": "Cl", "n": "Cn"}
_COLUMNS: Mapping[str, str] = {
    "w": "alpha", "q": "q", "eta": "elevator", "v": "beta", "p": "p", "r": "r", "xi": "aileron", "zeta": "rudder",
}  # fmt: skip
_ROUNDS = 3
"""Derivatives are affine in the coefficients but for drag, which follows the lift line: two rounds are at rounding."""


def with_stated_derivatives(aircraft: Aircraft, entry: ConditionEntry) -> Aircraft:
    """The aircraft with [coefficients] whose linearisation at an entry's condition has the entry's derivatives.

    Coefficients that the entry's structures do not speak of (drag, alphadot) keep; the trim keeps, too. A file without
    [coefficients] starts from the empirical ones of its dimensions.

    Args:
        aircraft: states [geometry] and [mass].
        entry: one of its conditions, with all derivatives of the short period, the lateral motion or the Dutch roll.

    Raises:
        AircraftDataError: [geometry] or [mass] is missing, or the entry states no structure in full.
        TrimError: there is no level flight there.
    """
    structures = [s for s in (SHORT_PERIOD, LATERAL) if entry.covers(s)]
    if LATERAL not in structures and entry.covers(DUTCH_ROLL):
        structures.append(DUTCH_ROLL)
    if not structures:
        raise AircraftDataError(
            f"the condition at {entry.airspeed_true_m_s:g} m/s of aircraft {aircraft.name} states no structure in full;"
            " state all derivatives of short_period, lateral or dutch_roll"
        )
    condition = replace(entry.condition, configuration="clean")
    if aircraft.coefficients is None:
        aircraft = _with_empirical(aircraft, condition)
    at = trim(aircraft, condition)
    for structure in structures:
        for _ in range(_ROUNDS):
            aircraft = _nearer(aircraft, condition, structure, at, entry)
    return aircraft


def _with_empirical(aircraft: Aircraft, condition: FlightCondition) -> Aircraft:
    purpose = "derivatives as coefficients"
    geometry, mass = aircraft.need_geometry(purpose), aircraft.need_mass(purpose)
    lift = mass.mass_kg * GRAVITY_M_S2 / (condition.dynamic_pressure_pa * geometry.wing_area_m2)
    made = empirical_coefficients(geometry, lift)
    alpha = condition.angle_of_attack_rad
    zero = made.CL.model_copy(update={"zero": lift - made.CL.alpha * alpha})
    pitch = made.Cm.model_copy(update={"zero": -made.Cm.alpha * alpha})
    return aircraft.model_copy(update={"coefficients": made.model_copy(update={"CL": zero, "Cm": pitch})})


def _moved(c: Coefficients, name: str, value: float, at: Trim) -> Coefficients:
    """With one coefficient replaced, and lift and pitching moment of the trim as they were."""
    old = dict(c.items())
    table, key = name.split("_", 1)
    arm = {"alpha": at.angle_of_attack_rad, "elevator": at.elevator_rad}.get(key, 0.0)
    c = c.with_value(name, value)
    if table in ("CL", "Cm") and arm:
        zero = f"{table}_zero"
        c = c.with_value(zero, old[zero] + (old[name] - value) * arm)
    return c


def _nearer(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure, at: Trim, entry: ConditionEntry
) -> Aircraft:
    """One Newton step of the coefficients towards the stated derivatives."""
    c = aircraft.need_coefficients("derivatives as coefficients")
    names = [f"{_ROWS[s[0]]}_{_COLUMNS[s.split('_')[1]]}" for s in structure.derivatives]

    def derivatives(coefficients: Coefficients) -> np.ndarray:
        moved = aircraft.model_copy(update={"coefficients": coefficients})
        return np.array(list(linearised_at(moved, condition, structure, at).values()))

    now, values = derivatives(c), dict(c.items())
    slopes = np.column_stack([derivatives(_moved(c, n, values[n] + 1.0, at)) - now for n in names])
    wanted = np.array([entry.derivatives[s].value for s in structure.derivatives])
    for name, step in zip(names, np.linalg.solve(slopes, wanted - now).tolist(), strict=True):
        if not math.isfinite(step):
            raise AircraftDataError(
                f"the derivatives of {structure.name} have no coefficients; check [geometry] and [mass]"
            )
        c = _moved(c, name, values[name] + step, at)
    return aircraft.model_copy(update={"coefficients": c})
