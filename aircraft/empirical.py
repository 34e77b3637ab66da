"""Coefficients from an aircraft's dimensions: empirical formulas (thesis tables B.1, B.2), errors as measured.

The thesis prints British dimensionless derivatives (rates by c/V and b/V); an aircraft file has American ones (c/2V and
b/2V), so rate derivatives are doubled (thesis table B.5). With V_T = S_T l_T / (S c) and V_F = S_F l_F / (S b):

| thesis | here |
|---|---|
| Z_w = -C_D - dC_L/dalpha | CL_alpha = a |
| Z_q = -V_T a1, Z_eta = -S_T/S a2 | CL_q = 2 V_T a1, CL_elevator = S_T/S a2 |
| M_w = -a K_n | Cm_alpha = -a K_n |
| M_q = -V_T a1 l_T/c, M_eta = -V_T a2 | Cm_q = -2 V_T a1 l_T/c, Cm_elevator = -V_T a2 |
| Y_v = S_B/S y_B - S_F/S a1F | CY_beta = -S_F/S a1F, without the body's part |
| Y_r = V_F a1F, N_v = V_F a1F | CY_r = 2 V_F a1F, Cn_beta = V_F a1F |
| N_r = -V_F a1F l_F/b | Cn_r = -2 V_F a1F l_F/b |
| Y_zeta = S_F/S a2R, N_zeta = -V_F a2R | CY_rudder = S_F/S a2R, Cn_rudder = -V_F a2R |

Table B.1 prints dC_L/dV and S_F where Cook, from whom it is, has dC_L/dalpha and S_T. The tables have no rolling
moment: Cl_p, Cl_r and Cn_p are lifting-line theory's of an elliptic wing (-a(A/2)/8, CL/4, -CL/8); what neither gives
is the mean of ``TYPICAL``. Alphadot terms are the tail's rate terms times the downwash slope 2 a / (pi A)
(Cook, appendix 8).

Every number in capitals that no formula gives is a mean over aircraft whose coefficients are known, and every error
their scatter about what this module says of them, as ``benchmarks/empirical_aircraft.py`` prints
(docs/decisions/0095-errors-of-empirical-derivatives.md).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from wingwatch.aircraft.aerodynamics import aspect_ratio
from wingwatch.aircraft.aircraft_file import Geometry
from wingwatch.aircraft.coefficients import (
    Coefficients,
    DirectionalCoefficients,
    DragCoefficients,
    LiftCoefficients,
    PitchCoefficients,
)
from wingwatch.aircraft.uncertainty import (
    HANDBOOK_RELATIVE_STANDARD_ERROR,
    HANDBOOK_STANDARD_ERROR_FLOOR,
    coefficient_standard_error,
)

__all__ = [
    "ERRORS_BY_TAIL",
    "INERTIA_ERRORS",
    "LIKENESS_ERRORS",
    "LIKENESS_FLOORS",
    "LIKENESS_INERTIA_ERRORS",
    "RADII_OVER_SPAN",
    "TYPICAL",
    "TYPICAL_ERRORS",
    "TYPICAL_TAIL",
    "empirical_coefficients",
    "empirical_values",
    "has_tail",
    "to_digits",
    "wing_lift_slope",
    "with_inertia_errors",
    "with_tied_errors",
]

_TAIL_ASPECT, _FIN_ASPECT = 4.0, 1.5
_FLAP_FRACTION = 0.35
"""Assumed: aspect ratios of tail and fin, and the chord of elevator and rudder over theirs. What is wrong with these
is in the measured errors."""

TYPICAL: Mapping[str, float] = {
    "CL_zero": 0.32,
    "CD_min": 0.047,
    "CD_oswald": 0.68,
    "CY_p": -0.055,
    "CY_aileron": -0.015,
    "Cl_beta": -0.082,
    "Cl_aileron": -0.18,
    "Cl_rudder": 0.0097,
    "Cn_aileron": 0.011,
    "static_margin": 0.27,
}
TYPICAL_TAIL: Mapping[str, float] = {
    "tail_area": 0.15,
    "fin_area": 0.11,
    "arm": 0.41,
}
TYPICAL_ERRORS: Mapping[str, float] = {
    "CD_min": 0.02,
    "CD_oswald": 0.26,
    "CL_elevator": 0.41,
    "CL_zero": 0.15,
    "CY_aileron": 0.085,
    "CY_p": 0.074,
    "Cl_aileron": 0.066,
    "Cl_beta": 0.04,
    "Cl_r": 0.096,
    "Cl_rudder": 0.013,
    "Cn_aileron": 0.018,
    "Cn_p": 0.067,
}
ERRORS_BY_TAIL: Mapping[bool, Mapping[str, float]] = {
    True: {
        "CL_alpha": 0.2,
        "CL_q": 1.2,
        "CY_beta": 1.3,
        "CY_r": 0.39,
        "CY_rudder": 0.53,
        "Cl_p": 0.2,
        "Cm_alpha": 0.45,
        "Cm_elevator": 0.39,
        "Cm_q": 3,
        "Cn_beta": 0.34,
        "Cn_r": 1.1,
        "Cn_rudder": 0.59,
    },
    False: {
        "CL_alpha": 0.19,
        "CL_q": 1.3,
        "CY_beta": 1.4,
        "CY_r": 0.53,
        "CY_rudder": 0.29,
        "Cl_p": 0.2,
        "Cm_alpha": 0.49,
        "Cm_elevator": 0.38,
        "Cm_q": 2.5,
        "Cn_beta": 0.41,
        "Cn_r": 1.1,
        "Cn_rudder": 0.63,
    },
}
LIKENESS_ERRORS: Mapping[str, float] = {
    "CD_min": 0.85,
    "CD_oswald": 0.78,
    "CL_alpha": 0.33,
    "CL_q": 1.2,
    "CY_beta": 0.83,
    "CY_r": 0.55,
    "CY_rudder": 0.43,
    "Cl_aileron": 0.57,
    "Cl_p": 0.21,
    "Cm_alpha": 0.95,
    "Cm_elevator": 0.57,
    "Cm_q": 2,
    "Cn_beta": 1.5,
    "Cn_r": 1.6,
    "Cn_rudder": 0.84,
}
LIKENESS_FLOORS: Mapping[str, float] = {
    "CL_elevator": 0.55,
    "CL_zero": 0.21,
    "CY_aileron": 0.12,
    "CY_p": 0.1,
    "Cl_beta": 0.057,
    "Cl_r": 0.14,
    "Cl_rudder": 0.018,
    "Cn_aileron": 0.026,
    "Cn_p": 0.098,
}
INERTIA_ERRORS: Mapping[str, float] = {
    "x": 0.7,
    "y": 0.44,
    "z": 0.57,
}
LIKENESS_INERTIA_ERRORS: Mapping[str, float] = {
    "x": 1.6,
    "y": 0.89,
    "z": 1,
}
RADII_OVER_SPAN: Mapping[str, float] = {
    "x": 0.15,
    "y": 0.14,
    "z": 0.21,
}


def wing_lift_slope(aspect: float) -> float:
    """Lift slope per rad of a straight wing by aspect ratio: 2 pi A / (2 + sqrt(A^2 + 4)) (Helmbold's equation)."""
    return 2.0 * math.pi * aspect / (2.0 + math.sqrt(aspect**2 + 4.0))


def to_digits(value: float) -> float:
    """To four digits, more than any of these is known to."""
    return float(f"{value:.4g}")


def _flap_effectiveness(fraction: float) -> float:
    """Change of incidence per flap angle by the flap's fraction of the chord, thin-aerofoil theory (Glauert)."""
    return 2.0 / math.pi * (math.sqrt(fraction * (1.0 - fraction)) + math.asin(math.sqrt(fraction)))


_TIED: Mapping[str, str] = {"CL_alphadot": "CL_q", "Cm_alphadot": "Cm_q", "Cm_zero": "Cm_alpha"}
"""Coefficients that are another's times what is known well."""
_REST = 0.5
"""Relative error of what nothing here speaks of, as in ``uncertainty``."""


def with_tied_errors(relative: Mapping[str, float]) -> dict[str, float]:
    """The table of relative errors of an aircraft file: those given, those of what follows from them, and the rest."""
    tied = {name: relative[of] for name, of in _TIED.items()}
    return {"default": _REST, **dict.fromkeys(TYPICAL_ERRORS, 0.0), **tied, **relative}


_AXIS: Mapping[str, str] = {"Cl": "x", "Cm": "y", "Cn": "z"}


def with_inertia_errors(coefficients: Coefficients, errors: Mapping[str, float]) -> Coefficients:
    """The moments' errors with those of the moments of inertia, which they stand for too (``uncertainty``).

    Args:
        coefficients: with their own errors, those of ``uncertainty`` where they state none.
        errors: relative, of the moments of inertia about x, y, z; an axis that is stated is absent.
    """
    relative = dict(coefficients.relative_standard_error or HANDBOOK_RELATIVE_STANDARD_ERROR)
    floor = dict(coefficients.standard_error_floor or HANDBOOK_STANDARD_ERROR_FLOOR)
    for name, value in coefficients.items():
        error = errors.get(_AXIS.get(name.split("_", 1)[0], ""))
        if error is None or value == 0.0:
            continue
        own = coefficient_standard_error(coefficients, name)
        total = math.hypot(own, error * value, error * own)  # of a product of two that err independently
        if name in floor:
            floor[name] = to_digits(total)
        else:
            relative[name] = to_digits(total / abs(value))
    return coefficients.model_copy(
        update={"relative_standard_error": relative, "standard_error_floor": floor}
    )


@dataclass(frozen=True, slots=True)
class _Tail:
    """Areas over the wing's, arm of the tail over the chord, of the fin over the span."""

    area: float
    arm: float
    fin_area: float
    fin_arm: float


def _tail(geometry: Geometry) -> _Tail:
    """The stated tail; what is not stated as on a typical aircraft, and the fin's arm as the tail's."""
    g, typical = geometry, TYPICAL_TAIL
    area, fin_area = (
        typical[key] if value is None else value / g.wing_area_m2
        for key, value in (("tail_area", g.tail_area_m2), ("fin_area", g.fin_area_m2))
    )
    arm_m = g.fin_arm_m if g.tail_arm_m is None else g.tail_arm_m
    arm_m = typical["arm"] * g.span_m if arm_m is None else arm_m
    fin_m = arm_m if g.fin_arm_m is None else g.fin_arm_m
    return _Tail(area, arm_m / g.mean_chord_m, fin_area, fin_m / g.span_m)


def has_tail(geometry: Geometry) -> bool:
    """Whether tail and fin are stated, with an arm."""
    g = geometry
    return None not in (g.tail_area_m2, g.fin_area_m2) and not (g.tail_arm_m is None and g.fin_arm_m is None)


def empirical_values(
    geometry: Geometry, lift_coefficient: float, static_margin: float | None = None
) -> dict[str, float]:
    """Coefficients by name (``Cm_q``), those of ``TYPICAL`` among them, without the zeros that the trim sets.

    Args:
        geometry: wing, and tail and fin where they are known.
        lift_coefficient: of level flight.
        static_margin: neutral point behind the centre of gravity over the mean chord; typical if None.
    """
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    tail, a = _tail(geometry), wing_lift_slope(aspect)
    a1, a1f, tau = (
        wing_lift_slope(_TAIL_ASPECT),
        wing_lift_slope(_FIN_ASPECT),
        _flap_effectiveness(_FLAP_FRACTION),
    )
    volume, fin_volume = tail.area * tail.arm, tail.fin_area * tail.fin_arm
    downwash = 2.0 * a / (math.pi * aspect)
    margin = TYPICAL["static_margin"] if static_margin is None else static_margin
    lift_q, pitch_q = 2.0 * volume * a1, -2.0 * volume * a1 * tail.arm
    return {
        **{key: value for key, value in TYPICAL.items() if key != "static_margin"},
        "CL_alpha": a,
        "CL_q": lift_q,
        "CL_alphadot": lift_q * downwash,
        "CL_elevator": tail.area * a1 * tau,
        "Cm_alpha": -a * margin,
        "Cm_q": pitch_q,
        "Cm_alphadot": pitch_q * downwash,
        "Cm_elevator": -volume * a1 * tau,
        "CY_beta": -tail.fin_area * a1f,
        "CY_r": 2.0 * fin_volume * a1f,
        "CY_rudder": tail.fin_area * a1f * tau,
        "Cl_p": -wing_lift_slope(0.5 * aspect) / 8.0,
        "Cl_r": lift_coefficient / 4.0,
        "Cn_beta": fin_volume * a1f,
        "Cn_p": -lift_coefficient / 8.0,
        "Cn_r": -2.0 * fin_volume * a1f * tail.fin_arm,
        "Cn_rudder": -fin_volume * a1f * tau,
    }


def empirical_coefficients(
    geometry: Geometry, lift_coefficient: float, static_margin: float | None = None
) -> Coefficients:
    """[coefficients] with their errors; the elevator is neutral in level flight at the lift coefficient.

    Args:
        geometry: wing, and tail and fin where they are known.
        lift_coefficient: of level flight.
        static_margin: neutral point behind the centre of gravity over the mean chord; typical if None.
    """
    values = empirical_values(geometry, lift_coefficient, static_margin)
    alpha = (lift_coefficient - values["CL_zero"]) / values["CL_alpha"]
    values["Cm_zero"] = -values["Cm_alpha"] * alpha
    tables: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        table, key = name.split("_", 1)
        tables.setdefault(table, {})[key] = to_digits(value)
    relative = dict(ERRORS_BY_TAIL[has_tail(geometry)])
    if static_margin is not None:
        relative["Cm_alpha"] = relative["CL_alpha"]
    return Coefficients(
        force_axes="stability",
        CL=LiftCoefficients(**tables["CL"]),
        CD=DragCoefficients(**tables["CD"]),
        CY=DirectionalCoefficients(**tables["CY"]),
        Cl=DirectionalCoefficients(**tables["Cl"]),
        Cm=PitchCoefficients(**tables["Cm"]),
        Cn=DirectionalCoefficients(**tables["Cn"]),
        relative_standard_error=with_tied_errors(relative),
        standard_error_floor={"default": 0.0, **TYPICAL_ERRORS},
    )
