"""Level flight and modes that an aircraft file implies, held to what aeroplanes do."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from wingwatch.aircraft.aircraft_file import Aircraft, AircraftDataError
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.linearisation import Trim, TrimError, linearised_at, trim
from wingwatch.aircraft.modes import ModeQuantity, mode_quantities
from wingwatch.aircraft.plausible_finding import FileFinding
from wingwatch.aircraft.structures import (
    DUTCH_ROLL,
    LATERAL,
    LATERAL_FULL,
    LONGITUDINAL,
    SHORT_PERIOD,
    ModeStructure,
)
from wingwatch.aircraft.thrust import thrust_slopes

__all__ = ["flight_findings"]

_MOST_LIFT = 1.4
"""Lift coefficient beyond which a wing without flaps is at its stall (sections reach 1.2 to 1.7: Abbott and von
Doenhoff, Theory of Wing Sections, chapter 7)."""
_LEAST_LIFT = 0.1
"""Below that lift coefficient cruise is three times as fast as the stall and more."""
_MOST_ALPHA_RAD = math.radians(15.0)
_STALL_FRACTION = 0.8
_SHORT_PERIOD_DAMPING = (0.15, 2.0)
_LEAST_DUTCH_ROLL_DAMPING = 0.02
_LEAST_DOUBLING_S = {"spiral": 4.0, "phugoid": 55.0}
_MOST_ROLL_TIME_S = 10.0
"""MIL-F-8785C, paragraphs 3.2.1.2, 3.2.2.1.2, 3.3.1.1 to 3.3.1.3: of its levels the loosest that has a figure."""


def flight_findings(
    aircraft: Aircraft, condition: FlightCondition | None
) -> tuple[list[FileFinding], list[str]]:
    """Findings, and what could not be looked at with what is missing."""
    found = [f for i in range(len(aircraft.conditions)) for f in _stated_modes(aircraft, i)]
    if aircraft.coefficients is None:
        return found, [] if aircraft.conditions else [
            "level flight and modes: the file has no [coefficients]"
        ]
    at = condition or (None if aircraft.envelope is None else aircraft.envelope.cruise)
    if at is None:
        return found, ["level flight and modes: the file has no [envelope]; give --airspeed"]
    try:
        point = trim(aircraft, at)
    except AircraftDataError as error:
        return found, [f"level flight and modes: {error}"]
    except TrimError as error:
        text = f"no level flight at {at.airspeed_true_m_s:g} m/s: {error}"
        need = FileFinding(
            "level_flight", "envelope", at.airspeed_true_m_s, "m/s", math.nan, math.nan, "refusal", text
        )
        return [*found, need], []
    found += _level(aircraft, at, point)
    try:
        found += _coefficient_modes(aircraft, at, point)
    except TrimError as error:
        text = str(error)
        found.append(
            FileFinding(
                "level_flight", "propulsion", point.thrust_n, "N", math.nan, math.nan, "warning", text
            )
        )
    if condition is None and aircraft.envelope is not None:
        found += _slowest(aircraft, at)
    return found, []


def _level(aircraft: Aircraft, at: FlightCondition, point: Trim) -> Iterator[FileFinding]:
    where = f"at {at.airspeed_true_m_s:.4g} m/s and {at.altitude_m:.4g} m"
    do = "is the airspeed in m/s, the mass in kg, the wing area in m2?"
    usual = (_LEAST_LIFT, _MOST_LIFT)
    yield from _some(
        FileFinding.outside(
            "lift_coefficient", f"lift coefficient {where}", point.lift_coefficient, usual, do
        )
    )
    stall = None if aircraft.coefficients is None else aircraft.coefficients.stall
    limit = _MOST_ALPHA_RAD if stall is None else min(_MOST_ALPHA_RAD, _STALL_FRACTION * stall.angle_rad)
    do = (
        "the wing is at its stall, or CL.zero is about another axis; fly faster or check CL.zero and CL.alpha"
    )
    usual = (-_MOST_ALPHA_RAD, limit)
    key = f"angle of attack {where}"
    yield from _some(FileFinding.outside("stall_margin", key, point.angle_of_attack_rad, usual, do, "rad"))
    elevator = aircraft.actuators.elevator
    if elevator is not None and elevator.position_limit_rad is not None:
        most = elevator.position_limit_rad
        do = "more than its travel; check Cm.zero, Cm.alpha and Cm.elevator"
        key = f"elevator in level flight {where}"
        yield from _some(
            FileFinding.outside("trim_elevator", key, point.elevator_rad, (-most, most), do, "rad")
        )
    if aircraft.propulsion is not None:
        slopes = thrust_slopes(
            aircraft.propulsion, point.thrust_n, at.airspeed_true_m_s, at.air_density_kg_m3
        )
        if slopes is None:
            text = (
                f"level flight {where} needs a thrust of {point.thrust_n:.4g} N, which no throttle of 0 to 1 gives: "
                "check [propulsion] and CD"
            )
            key = "propulsion"
            yield FileFinding("trim_thrust", key, point.thrust_n, "N", math.nan, math.nan, "warning", text)


def _slowest(aircraft: Aircraft, at: FlightCondition) -> Iterator[FileFinding]:
    """The low end of [envelope]."""
    envelope = aircraft.envelope
    if envelope is None:
        return
    slow = FlightCondition(envelope.airspeed_true_m_s[0], at.altitude_m)
    do = "the slow end of [envelope] is at or below the stall; raise it"
    key = f"lift coefficient at the envelope's {slow.airspeed_true_m_s:g} m/s"
    try:
        lift = trim(aircraft, slow).lift_coefficient
    except TrimError as error:
        yield FileFinding(
            "envelope_stall", key, math.nan, "", -math.inf, _MOST_LIFT, "warning", f"{error}; {do}"
        )
        return
    yield from _some(FileFinding.outside("envelope_stall", key, lift, (-math.inf, _MOST_LIFT), do))


def _coefficient_modes(aircraft: Aircraft, at: FlightCondition, point: Trim) -> Iterator[FileFinding]:
    here = replace(at, angle_of_attack_rad=point.angle_of_attack_rad)
    for structure in (LONGITUDINAL, LATERAL_FULL):
        values = linearised_at(aircraft, at, structure, point)
        yield from _modes(structure, values, here, aircraft, "")


def _stated_modes(aircraft: Aircraft, index: int) -> Iterator[FileFinding]:
    entry = aircraft.conditions[index]
    structures = [s for s in (SHORT_PERIOD, LATERAL) if entry.covers(s)]
    if LATERAL not in structures and entry.covers(DUTCH_ROLL):
        structures.append(DUTCH_ROLL)
    for structure in structures:
        values = {s: d.value for s, d in entry.derivatives.items()}
        yield from _modes(structure, values, entry.condition, aircraft, f"conditions.{index}: ")


def _modes(
    structure: ModeStructure, values: dict[str, float], here: FlightCondition, aircraft: Aircraft, prefix: str
) -> Iterator[FileFinding]:
    size = len(structure.derivatives)
    quantities = mode_quantities(structure, values, np.zeros((size, size)), here, aircraft)
    expected = (*structure.oscillations, *structure.subsidences)
    if any(q.mode not in expected for q in quantities):
        shown = ", ".join(
            f"{q.mode} {q.value:.3g} {q.unit}".strip() for q in quantities if q.name == "time_constant_s"
        )
        text = (
            f"{prefix}{structure.name} has roots unlike an aeroplane's ({shown}): check signs and inertias of its "
            "derivatives"
        )
        yield FileFinding("roots", structure.name, math.nan, "", math.nan, math.nan, "warning", text)
        return
    for quantity in quantities:
        yield from _some(_mode(quantity, prefix))


def _mode(q: ModeQuantity, prefix: str) -> FileFinding | None:
    key = f"{prefix}{q.mode.replace('_', ' ')} {q.name.removesuffix('_s').replace('_', ' ')}"
    if q.mode == "short_period" and q.name == "natural_frequency_rad_s" and math.isnan(q.value):
        text = (
            f"{key} does not exist: the aircraft diverges in pitch; check Cm.alpha and the centre of gravity"
        )
        return FileFinding("short_period_divergence", key, q.value, q.unit, 0.0, math.inf, "warning", text)
    if q.mode == "short_period" and q.name == "damping_ratio":
        do = "check Cm.q, CL.alpha and inertia_y_kg_m2"
        return FileFinding.outside("short_period_damping", key, q.value, _SHORT_PERIOD_DAMPING, do)
    if q.mode == "dutch_roll" and q.name == "damping_ratio":
        do = "check Cn.r, CY.beta, Cl.beta and inertia_z_kg_m2"
        return FileFinding.outside(
            "dutch_roll_damping", key, q.value, (_LEAST_DUTCH_ROLL_DAMPING, math.inf), do
        )
    if q.mode == "roll" and q.name == "time_constant_s":
        do = "check Cl.p and inertia_x_kg_m2"
        return FileFinding.outside("roll_time", key, q.value, (0.0, _MOST_ROLL_TIME_S), do, "s")
    if q.mode in _LEAST_DOUBLING_S and q.name == "time_constant_s" and q.value < 0.0:
        do = "it diverges sooner than is usual; check " + (
            "Cl.beta, Cl.r and Cn.r" if q.mode == "spiral" else "CD and Cm.alpha"
        )
        doubling = -q.value * math.log(2.0)
        key = f"{prefix}{q.mode} time to double"
        return FileFinding.outside(
            f"{q.mode}_doubling", key, doubling, (_LEAST_DOUBLING_S[q.mode], math.inf), do, "s"
        )
    return None


def _some(finding: FileFinding | None) -> Iterator[FileFinding]:
    if finding is not None:
        yield finding
