"""The envelope that an aircraft's file alone gives, before any flight."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from wingwatch.aircraft import (
    GRAVITY_M_S2,
    Aircraft,
    AircraftDataError,
    ConditionEntry,
    FlightCondition,
    ModeStructure,
    Provenance,
    TrimError,
    derivative_standard_errors,
    isa_density_kg_m3,
    linearised_at,
    trim,
)
from wingwatch.baselines.expectation import DECLARED, MEASURED, WEAKEST_FIRST, Envelope, Expectation

__all__ = ["apriori_envelope"]

GRID_AIRSPEEDS = 9
"""Airspeeds of the grid, in geometric steps; decision 0011 says what interpolation between them costs."""

GRID_ALTITUDES = 3
"""Altitudes of the grid, in equal steps."""

CRUISE_LIFT_COEFFICIENT = 0.5
"""Trim lift coefficient taken for cruise where the file states no envelope."""

DEFAULT_AIRSPEED_RATIOS = (0.75, 1.4)
"""Airspeed limits over cruise airspeed where the file states no envelope."""

DEFAULT_ALTITUDES_M = (0.0, 4000.0)
"""Altitude limits where the file states no envelope."""


def apriori_envelope(aircraft: Aircraft, structure: ModeStructure, configuration: str = "clean") -> Envelope:
    """What the aircraft's file says of one structure.

    From the ``[[conditions]]`` that state all of the structure's derivatives, if there are any; else from
    ``[coefficients]``, linearised on a grid over the file's ``[envelope]`` (or over default limits); else an
    envelope without points, whose lookups say what the file lacks. Of ``[[conditions]]`` at one point, as a diagnosis
    adds them, those of the strongest provenance count. Grid airspeeds too slow for level flight
    at some altitude of the grid are left out, which narrows the envelope.

    Raises:
        ValueError: two of the ``[[conditions]]`` of one provenance stand at the same point.
    """
    entries = _strongest(aircraft.entries(structure, configuration))
    points: Sequence[Expectation]
    if entries:
        points = [
            Expectation(
                structure,
                np.array([e.derivatives[s].value for s in structure.derivatives]),
                np.diag([e.derivatives[s].standard_error ** 2 for s in structure.derivatives]),
                e.provenance,
                e.condition,
                e.source or f"[[conditions]] of aircraft {aircraft.name}",
            )
            for e in entries
        ]
        return Envelope(aircraft, structure, points, configuration=configuration, neighbourhood=MEASURED)
    try:
        points = _grid_points(_Grid(aircraft, aircraft.model_dump_json(), structure, configuration))
        absent = f"aircraft {aircraft.name} has no level flight anywhere in its envelope; correct its file"
    except AircraftDataError as error:
        points = ()
        absent = (
            f"aircraft {aircraft.name} states no [[conditions]] with all derivatives of {structure.name} "
            f"in configuration {configuration!r}, and cannot do without them: {error}"
        )
    return Envelope(
        aircraft, structure, points, configuration=configuration, neighbourhood=DECLARED, absent=absent
    )


def _strongest(entries: Sequence[ConditionEntry]) -> list[ConditionEntry]:
    """Of the entries at each point those of the strongest provenance, in their order."""
    strongest: dict[tuple[float, float], int] = {}
    for e in entries:
        point, strength = (e.airspeed_true_m_s, e.altitude_m), WEAKEST_FIRST.index(e.provenance)
        strongest[point] = max(strength, strongest.get(point, 0))
    return [
        e
        for e in entries
        if WEAKEST_FIRST.index(e.provenance) == strongest[e.airspeed_true_m_s, e.altitude_m]
    ]


@dataclass(frozen=True, slots=True)
class _Grid:
    """What a grid depends on; ``file`` is the aircraft's text, by which grids are compared."""

    aircraft: Aircraft = field(compare=False)
    file: str
    structure: ModeStructure
    configuration: str


@lru_cache(maxsize=64)  # a third of a second each, and every monitor of an aircraft asks for the same ones
def _grid_points(grid: _Grid) -> tuple[Expectation, ...]:
    aircraft, structure, configuration = grid.aircraft, grid.structure, grid.configuration
    (v_low, v_high), (h_low, h_high) = _limits(aircraft)
    altitudes = np.linspace(h_low, h_high, GRID_ALTITUDES)
    points: list[Expectation] = []
    for airspeed in np.geomspace(v_low, v_high, GRID_AIRSPEEDS):
        try:
            points += [
                _linearised(
                    aircraft,
                    structure,
                    FlightCondition(float(airspeed), float(h), configuration=configuration),
                )
                for h in altitudes
            ]
        except TrimError:
            continue
    return tuple(points)


def _linearised(aircraft: Aircraft, structure: ModeStructure, condition: FlightCondition) -> Expectation:
    at = trim(aircraft, condition)
    values = linearised_at(aircraft, condition, structure, at)
    errors = derivative_standard_errors(aircraft, condition, structure, at)
    return Expectation(
        structure,
        np.array([values[s] for s in structure.derivatives]),
        np.diag([errors[s] ** 2 for s in structure.derivatives]),
        Provenance.A_PRIORI,
        replace(condition, angle_of_attack_rad=at.angle_of_attack_rad),
        f"[coefficients] of aircraft {aircraft.name}, linearised at level trim",
    )


def _limits(aircraft: Aircraft) -> tuple[tuple[float, float], tuple[float, float]]:
    """(lowest, highest) airspeed and altitude."""
    if aircraft.envelope is not None:
        return aircraft.envelope.airspeed_true_m_s, aircraft.envelope.altitude_m
    purpose = "the default envelope"
    area = aircraft.need_geometry(purpose).wing_area_m2
    weight_n = aircraft.need_mass(purpose).mass_kg * GRAVITY_M_S2
    middle_m = math.fsum(DEFAULT_ALTITUDES_M) / 2.0
    density = float(isa_density_kg_m3(middle_m))
    cruise_m_s = math.sqrt(2.0 * weight_n / (density * area * CRUISE_LIFT_COEFFICIENT))
    low, high = DEFAULT_AIRSPEED_RATIOS
    return (low * cruise_m_s, high * cruise_m_s), DEFAULT_ALTITUDES_M
