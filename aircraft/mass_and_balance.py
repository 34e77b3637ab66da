"""An aircraft at another mass and centre of gravity than its file states; moments of inertia stay the file's.

Three things follow. [coefficients] are linearised at the new trim and about the new centre (``linearised_at``). Sensors
have their distances from the new centre. Derivatives that are stated outright are carried over (``carried``): an
aircraft of mass m' at V sqrt(m'/m) has the lift coefficient and the angle of attack of mass m at V, hence the same
coefficients; their moments and motions go to the new centre (``about_centre``).
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.aircraft_file import Aircraft, ConditionEntry, DerivativeEntry
from wingwatch.aircraft.centre_of_gravity import about_centre
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.conventions import Convention, affine, convert
from wingwatch.aircraft.structures import DUTCH_ROLL, STRUCTURES, ModeStructure

__all__ = ["american_map", "at_loading", "carried"]

Array = NDArray[np.float64]

_PURPOSE = "another mass or centre of gravity"


def at_loading(aircraft: Aircraft, mass_kg: float | None, cg_shift_m: float | None) -> Aircraft:
    """The aircraft at another mass and with its centre of gravity moved.

    Args:
        aircraft: as its file has it.
        mass_kg: of the whole aircraft; None for the file's.
        cg_shift_m: m aft of the file's centre of gravity; None for no shift.

    Returns:
        The same aircraft where nothing changes. Else its [[conditions]] are carried over structure by structure; those
        that state no structure's derivatives in full lose them.

    Raises:
        AircraftDataError: the file lacks [mass] or [geometry].
        ValueError: a mass that is not positive, or a shift that is not finite.
    """
    shift = cg_shift_m or 0.0
    if shift == 0.0 and (mass_kg is None or (aircraft.mass is not None and mass_kg == aircraft.mass.mass_kg)):
        return aircraft
    stated = aircraft.need_mass(_PURPOSE)
    aircraft.need_geometry(_PURPOSE)
    mass = stated.mass_kg if mass_kg is None else mass_kg
    if not (0.0 < mass < math.inf and math.isfinite(shift)):
        raise ValueError(f"mass_kg is {mass} and cg_shift_m {shift}; give a positive mass and a finite shift")
    table = stated.model_copy(update={"mass_kg": mass, "cg_shift_m": stated.cg_shift_m + shift})
    s = aircraft.sensors
    places = {
        name: (place[0] + shift, place[1], place[2])
        for name, place in {"imu_position_m": s.imu_position_m, "vane_position_m": s.vane_position_m}.items()
    }
    moved = aircraft.model_copy(update={"mass": table, "sensors": s.model_copy(update=places)})
    entries = tuple(_entry(entry, aircraft, moved) for entry in aircraft.conditions)
    return moved.model_copy(update={"conditions": entries})


def _entry(entry: ConditionEntry, aircraft: Aircraft, moved: Aircraft) -> ConditionEntry:
    derivatives: dict[str, DerivativeEntry] = {}
    at = entry.condition
    for structure in STRUCTURES.values():
        if not entry.covers(structure):
            continue
        stated = [entry.derivatives[s] for s in structure.derivatives]
        covariance = np.diag([d.standard_error**2 for d in stated])
        value, spread, at = carried(
            np.array([d.value for d in stated]), covariance, structure, entry.condition, (aircraft, moved)
        )
        derivatives |= {
            symbol: DerivativeEntry(value=float(value[k]), standard_error=math.sqrt(spread[k, k]))
            for k, symbol in enumerate(structure.derivatives)
        }
    return entry.model_copy(update={"derivatives": derivatives, "airspeed_true_m_s": at.airspeed_true_m_s})


def carried(
    value: Array,
    covariance: Array,
    structure: ModeStructure,
    condition: FlightCondition,
    loadings: tuple[Aircraft, Aircraft],
) -> tuple[Array, Array, FlightCondition]:
    """Concise derivatives of one loading as those of another, at the airspeed that gives the same angle of attack.

    Args:
        value: (k,), in the order of ``structure.derivatives``.
        covariance: (k, k).
        structure: one of ``STRUCTURES``.
        condition: of the values.
        loadings: the aircraft as the values have it, and as they are wanted.

    Returns:
        Value, covariance and condition at the second loading; its airspeed is sqrt(m'/m) times the first's.

    Raises:
        AircraftDataError: the file lacks [mass] or [geometry].
    """
    matrix, offset, there = _concise_map(structure, condition, loadings)
    spread = matrix @ covariance @ matrix.T
    return matrix @ value + offset, 0.5 * (spread + spread.T), there


def american_map(
    structure: ModeStructure, condition: FlightCondition, loadings: tuple[Aircraft, Aircraft]
) -> tuple[Array, Array]:
    """(matrix (k, k), offset (k,)) that bring effective American coordinates (``affine``) of one loading to another's.

    Without alphadot terms they are the same at every condition; with them they hold about this one.

    Raises:
        AircraftDataError: the file lacks [mass] or [geometry].
    """
    matrix, offset, there = _concise_map(structure, condition, loadings)
    scale, shift = affine(structure, loadings[0], condition)
    new_scale, new_shift = affine(structure, loadings[1], there)
    return matrix * (scale / new_scale[:, None]), (matrix @ shift + offset - new_shift) / new_scale


def _concise_map(
    structure: ModeStructure, condition: FlightCondition, loadings: tuple[Aircraft, Aircraft]
) -> tuple[Array, Array, FlightCondition]:
    """Matrix and offset of the way from one loading's concise derivatives to the other's, and the latter's condition.

    The way is affine: what becomes of zero and of unit steps says all of it.
    """
    before, after = loadings
    ratio = after.need_mass(_PURPOSE).mass_kg / before.need_mass(_PURPOSE).mass_kg
    there = replace(condition, airspeed_true_m_s=condition.airspeed_true_m_s * math.sqrt(ratio))
    aft_m = after.cg_shift_m - before.cg_shift_m
    plain, forces, concise = Convention.AMERICAN, Convention.DIMENSIONAL, Convention.CONCISE

    def over(values: Array) -> Array:
        def converted(
            given: Mapping[str, float],
            loading: Aircraft,
            at: FlightCondition,
            source: Convention,
            target: Convention,
        ) -> dict[str, float]:
            return convert(
                given, aircraft=loading, condition=at, structure=structure, source=source, target=target
            )

        given = dict(zip(structure.derivatives, values.tolist(), strict=True))
        coefficients = converted(given, before, condition, concise, plain)
        dimensional = converted(coefficients, before, there, plain, forces)
        moved = about_centre(dimensional, structure, aft_m, _yaw_gain(structure, after))
        return np.array(list(converted(moved, after, there, forces, concise).values()))

    size = len(structure.derivatives)
    offset = over(np.zeros(size))
    return np.column_stack([over(step) - offset for step in np.eye(size)]), offset, there


def _yaw_gain(structure: ModeStructure, aircraft: Aircraft) -> float:
    """How much of a yawing moment there is in the Dutch roll's effective one (``affine``)."""
    if structure != DUTCH_ROLL:
        return 1.0
    mass = aircraft.need_mass(_PURPOSE)
    both = mass.inertia_x_kg_m2 * mass.inertia_z_kg_m2
    return both / (both - mass.inertia_xz_kg_m2**2)
