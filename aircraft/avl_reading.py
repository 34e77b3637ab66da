"""An aircraft file's geometry and coefficients from a run case of AVL: body axes, per rad, signs as here."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from wingwatch.aircraft.aerodynamics import aspect_ratio
from wingwatch.aircraft.aircraft_file import Geometry
from wingwatch.aircraft.avl_file import AvlError, AvlRun
from wingwatch.aircraft.coefficients import (
    Coefficients,
    DirectionalCoefficients,
    DragCoefficients,
    LiftCoefficients,
    PitchCoefficients,
)
from wingwatch.aircraft.empirical import TYPICAL

__all__ = ["AvlAircraft", "avl_coefficients"]

_OWN_MOMENT: Mapping[str, str] = {"elevator": "Cm", "aileron": "Cl", "rudder": "Cn"}
_BEGINNINGS: Mapping[str, tuple[str, ...]] = {"elevator": ("elev",), "aileron": ("ail",), "rudder": ("rud",)}
_PER_RAD = math.degrees(1.0)
_LEAST_DRAG = 0.005
"""Profile drag below which none was given to AVL: a laminar section has as much."""


@dataclass(frozen=True, slots=True)
class AvlAircraft:
    """What a run case says of an aircraft.

    Attributes:
        geometry: Sref, Bref, Cref in m.
        coefficients: about AVL's reference point, body axes.
        lift_coefficient: of the run case.
        reference_x_m: Xref, aft of AVL's origin.
        notes: what was assumed.
    """

    geometry: Geometry
    coefficients: Coefficients
    lift_coefficient: float
    reference_x_m: float
    notes: tuple[str, ...]


def avl_coefficients(run: AvlRun, length_unit_m: float, surfaces: Mapping[str, str]) -> AvlAircraft:
    """Geometry and coefficients of a run case.

    Args:
        run: the case.
        length_unit_m: of the .avl file.
        surfaces: control variable by surface (``elevator``: ``flap2``); what is not named is found by its name.

    Raises:
        AvlError: no control variable is an elevator, or a named one is not there.
    """
    v, alpha = run.values, math.radians(run.values["Alpha"])
    geometry = Geometry(
        wing_area_m2=v["Sref"] * length_unit_m**2,
        span_m=v["Bref"] * length_unit_m,
        mean_chord_m=v["Cref"] * length_unit_m,
    )
    notes = list(run.notes)
    columns, elevator_rad = _surfaces(run, surfaces, notes)
    notes.append("derivatives by surfaces are per degree of deflection: gains of 1 in the .avl file")
    lift, pitch = columns["elevator"]["CL"], columns["elevator"]["Cm"]
    CL = LiftCoefficients(
        zero=v["CLtot"] - v["CLa"] * alpha - lift * elevator_rad, alpha=v["CLa"], q=v["CLq"], elevator=lift
    )
    Cm = PitchCoefficients(
        zero=v["Cmtot"] - v["Cma"] * alpha - pitch * elevator_rad, alpha=v["Cma"], q=v["Cmq"], elevator=pitch
    )
    CY, Cl, Cn = _turned(run, alpha, columns)
    CD = _drag(v, aspect_ratio(geometry.span_m, geometry.wing_area_m2), notes)
    coefficients = Coefficients(force_axes="stability", CL=CL, CD=CD, CY=CY, Cl=Cl, Cm=Cm, Cn=Cn)
    return AvlAircraft(geometry, coefficients, v["CLtot"], v["Xref"] * length_unit_m, tuple(notes))


def _surfaces(
    run: AvlRun, named: Mapping[str, str], notes: list[str]
) -> tuple[dict[str, dict[str, float]], float]:
    """Derivatives per rad by surface, signs turned to ours, and the elevator's deflection, rad."""
    out: dict[str, dict[str, float]] = {}
    elevator_rad = 0.0
    for surface, own in _OWN_MOMENT.items():
        variable = _variable(run, surface, named)
        if variable is None:
            notes.append(f"no control variable is the {surface}: its coefficients are 0")
            out[surface] = dict.fromkeys(("CL", "CY", "Cl", "Cm", "Cn"), 0.0)
            continue
        sign = -1.0 if run.by_control(own, variable) > 0.0 else 1.0
        if sign < 0.0:
            notes.append(
                f"the sign of {variable} is turned: here a positive {surface} gives a negative response"
            )
        out[surface] = {
            row: sign * _PER_RAD * run.by_control(row, variable) for row in ("CL", "CY", "Cl", "Cm", "Cn")
        }
        if surface == "elevator":
            elevator_rad = sign * math.radians(run.deflections[variable])
    return out, elevator_rad


def _variable(run: AvlRun, surface: str, named: Mapping[str, str]) -> str | None:
    there = ", ".join(run.controls) or "none"
    if surface in named:
        if named[surface] not in run.controls:
            raise AvlError(f"--control {surface}={named[surface]}: the file's control variables are {there}")
        return named[surface]
    for name in run.controls:
        lowered = name.lower()
        if lowered.startswith(_BEGINNINGS[surface]) and not lowered.startswith("elevon"):
            return name
    if surface == "elevator":
        raise AvlError(
            f"no control variable is called elevator; say which with --control elevator=NAME of {there}"
        )
    return None


def _turned(
    run: AvlRun, alpha: float, columns: Mapping[str, Mapping[str, float]]
) -> tuple[DirectionalCoefficients, DirectionalCoefficients, DirectionalCoefficients]:
    """CY, Cl, Cn in body axes: both the moments and the rates are turned by the angle of attack.

    With p' = p cos + r sin and r' = r cos - p sin: Cl = Cl' cos - Cn' sin and Cn = Cn' cos + Cl' sin.
    """
    cos, sin = math.cos(alpha), math.sin(alpha)
    rows: dict[str, dict[str, float]] = {}
    for row in ("CY", "Cl", "Cn"):
        by_p, by_r = run.values[f"{row}p"], run.values[f"{row}r"]
        rows[row] = {
            "beta": run.values[f"{row}b"],
            "p": by_p * cos - by_r * sin,
            "r": by_r * cos + by_p * sin,
        }
        rows[row] |= {surface: columns[surface][row] for surface in ("aileron", "rudder")}
    roll, yaw = rows["Cl"], rows["Cn"]
    return (
        DirectionalCoefficients(**rows["CY"]),
        DirectionalCoefficients(**{key: roll[key] * cos - yaw[key] * sin for key in roll}),
        DirectionalCoefficients(**{key: yaw[key] * cos + roll[key] * sin for key in roll}),
    )


def _drag(v: Mapping[str, float], aspect: float, notes: list[str]) -> DragCoefficients:
    """The polar through the run case's drag with AVL's span efficiency; a typical profile drag where AVL had none."""
    efficiency = v.get("e", math.nan)
    if not 0.1 <= efficiency <= 1.5:
        efficiency = TYPICAL["CD_oswald"]
        notes.append(f"the span efficiency is none; {efficiency:g} is taken")
    least = v["CDtot"] - v["CLtot"] ** 2 / (math.pi * efficiency * aspect)
    if least < _LEAST_DRAG:
        least = TYPICAL["CD_min"]
        notes.append(f"AVL was given no profile drag; CD.min is a typical {least:g}")
    return DragCoefficients(min=least, oswald=efficiency)
