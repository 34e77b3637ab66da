"""The published coefficient sets of the Aerosonde, beside the derivatives that the thesis prints for its own.

Set A is that of Unmanned Dynamics' AeroSim (aerosondecfg, revision 1.0 of 2002-05-13), from which the thesis's model
was made (its footnote 18; Whidborne 2007). It states two fuel states and, unlike its descendants, points: forces act
at x = 0.1425 m, z = 0 from the propeller's hub (x forward, z down), the centre of gravity lies at (0.156, 0.079) empty
and (0.159, 0.090) full. Set B is Beard and McLain's electric variant as the library pins it, set C the one of their
first edition (2012).
"""

from collections.abc import Mapping

import numpy as np
from reference_point import about_centre_of_gravity

from wingwatch.aircraft import (
    DUTCH_ROLL,
    GRAVITY_M_S2,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    Coefficients,
    ConstantThrust,
    DirectionalCoefficients,
    DragCoefficients,
    FlightCondition,
    Geometry,
    LiftCoefficients,
    Mass,
    PitchCoefficients,
    linearised_derivatives,
    load_aircraft,
    natural_frequency_and_damping,
    state_matrix,
    trim,
)

__all__ = [
    "CONDITION",
    "FUEL_SHARE",
    "THESIS",
    "THESIS_MODES",
    "aerosim",
    "derivatives_and_modes",
    "variants",
]

CONDITION = FlightCondition(25.0, 1000.0)

THESIS: Mapping[str, float] = {
    "z_w": -4.139, "z_q": 24.33, "z_eta": -2.361, "m_w": -4.289, "m_q": -6.035, "m_eta": -32.54,
    "y_v": -0.643, "y_r": -25.02, "y_zeta": 3.517, "n_v": 0.684, "n_r": -1.043, "n_zeta": -22.10,
}  # fmt: skip
"""Jameson 2013, tables 7.2 and 7.7, column of the linearised simulation; units of the concise derivatives."""

THESIS_MODES: Mapping[str, tuple[float, float]] = {
    "short period": (11.373, 0.4473),
    "Dutch roll": (5.977, 0.2139),
}
"""Natural frequency in rad/s and damping ratio as printed there (tables 7.6 and 7.11)."""

SET_A = Coefficients(
    force_axes="wind",
    CL=LiftCoefficients(zero=0.23, alpha=5.6106, q=7.9543, alphadot=1.9724, elevator=0.13),
    CD=DragCoefficients(
        min=0.0434, CL_at_min=0.23, oswald=0.75, elevator=0.0135, aileron=0.0302, rudder=0.0303
    ),
    CY=DirectionalCoefficients(beta=-0.83, aileron=-0.075, rudder=0.1914),
    Cl=DirectionalCoefficients(beta=-0.13, p=-0.5051, r=0.2519, aileron=-0.1695, rudder=0.0024),
    Cm=PitchCoefficients(zero=0.135, alpha=-2.7397, q=-38.2067, alphadot=-10.3796, elevator=-0.9918),
    Cn=DirectionalCoefficients(beta=0.0726, p=-0.069, r=-0.0946, aileron=0.0108, rudder=-0.0693),
)
SET_C = Coefficients(
    force_axes="stability",
    CL=LiftCoefficients(zero=0.28, alpha=3.45, elevator=-0.36),
    CD=DragCoefficients(min=0.0437, oswald=0.9),
    CY=DirectionalCoefficients(beta=-0.98, rudder=-0.17),
    Cl=DirectionalCoefficients(beta=-0.12, p=-0.26, r=0.14, aileron=-0.08, rudder=0.105),
    Cm=PitchCoefficients(zero=-0.02338, alpha=-0.38, q=-3.6, elevator=-0.5),
    Cn=DirectionalCoefficients(beta=0.25, p=0.022, r=-0.35, aileron=-0.06, rudder=-0.032),
)
"""Aileron signs turned to ours; the rest as printed."""

_EMPTY = np.array([8.5, 0.7795, 1.122, 1.752, 0.1211, 0.156, 0.079])
_FULL = np.array([13.5, 0.8244, 1.135, 1.759, 0.1204, 0.159, 0.090])
"""Mass, inertias x, y, z, xz, and the centre of gravity's x and z."""
_FORCES_AT_X_M = 0.1425

FUEL_SHARE = 0.38
"""Of the thesis's Aerosonde, which prints no mass: its y_zeta needs q S CY_rudder / y_zeta = 10.4 kg."""


def _mass(mass_kg: float, x: float, y: float, z: float, xz: float) -> Mass:
    return Mass(mass_kg=mass_kg, inertia_x_kg_m2=x, inertia_y_kg_m2=y, inertia_z_kg_m2=z, inertia_xz_kg_m2=xz)


def aerosim(fuel_share: float, at_centre_of_gravity: bool = True) -> Aircraft:
    """Set A with a share of its fuel, everything linear in it.

    Args:
        fuel_share: 0 empty to 1 full.
        at_centre_of_gravity: whether the forces' point is honoured (tangent at 25 m/s, 1000 m), or taken to be the
            centre of gravity as its descendants do.
    """
    state = _EMPTY + fuel_share * (_FULL - _EMPTY)
    x, z = state[5:]
    plain = Aircraft(
        format=1,
        name="aerosonde-a",
        geometry=Geometry(wing_area_m2=0.55, span_m=2.8956, mean_chord_m=0.189941),
        mass=_mass(*state[:5].tolist()),
        coefficients=SET_A,
        propulsion=ConstantThrust(
            kind="constant_thrust",
            thrust_max_n=27.0,
            thrust_line_z_m=-float(z) if at_centre_of_gravity else 0.0,
        ),
    )
    if not at_centre_of_gravity:
        return plain
    moved = plain
    for _ in range(20):  # trim and tangent belong together; each round leaves a hundredth of the rest
        at = trim(moved, CONDITION)
        point = (_FORCES_AT_X_M - float(x), -float(z))
        moved = about_centre_of_gravity(plain, point, at.angle_of_attack_rad, at.elevator_rad)
    return moved


def variants() -> dict[str, Aircraft]:
    """Every published set and reading of it, by a short name."""
    b = load_aircraft("aerosonde")
    coefficients = b.need_coefficients("the comparison")

    def reading(**changes: float) -> Aircraft:
        changed = coefficients
        for name, value in changes.items():
            changed = changed.with_value(name, value)
        return b.model_copy(update={"coefficients": changed})

    return {
        "A empty 8.5 kg, forces at the c.g.": aerosim(0.0, False),
        "A full 13.5 kg, forces at the c.g.": aerosim(1.0, False),
        "A 10.4 kg, forces at the c.g.": aerosim(FUEL_SHARE, False),
        "A 10.4 kg, forces where stated": aerosim(FUEL_SHARE),
        "library aerosonde-a": load_aircraft("aerosonde-a"),
        "library aerosonde (B)": b,
        "B with CY_beta -0.98": reading(CY_beta=-0.98),
        "B with Cn_p +0.069": reading(Cn_p=0.069),
        "B with Cl_r 0.045": reading(Cl_r=0.045),
        "B with Cm_zero 0.0135": reading(Cm_zero=0.0135),
        "B with CD_min 0": reading(CD_min=0.0),
        "C (2012) 13.5 kg": b.model_copy(
            update={"coefficients": SET_C, "mass": _mass(13.5, 0.8244, 1.135, 1.759, 0.1204)}
        ),
    }


def derivatives_and_modes(
    aircraft: Aircraft, condition: FlightCondition = CONDITION
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """The twelve concise derivatives of short period and Dutch roll; natural frequency and damping of the short
    period, of the two-state Dutch roll and of the full lateral motion with roll and bank."""
    short, dutch, lateral = (
        linearised_derivatives(aircraft, condition, s) for s in (SHORT_PERIOD, DUTCH_ROLL, LATERAL)
    )
    alpha = trim(aircraft, condition).angle_of_attack_rad
    full = np.zeros((4, 4))
    full[:3, :3] = state_matrix(LATERAL, lateral)
    full[0, 3] = GRAVITY_M_S2 * np.cos(alpha)
    full[3, 1:3] = 1.0, np.tan(alpha)
    roots = np.linalg.eigvals(full)
    pair = complex(roots[np.argmax(roots.imag)])
    modes = {
        "short period": natural_frequency_and_damping(SHORT_PERIOD, state_matrix(SHORT_PERIOD, short)),
        "Dutch roll, two states": natural_frequency_and_damping(DUTCH_ROLL, state_matrix(DUTCH_ROLL, dutch)),
        "Dutch roll": (abs(pair), -pair.real / abs(pair)),
    }
    return short | dutch, modes
