"""From derivatives to matrices: ``dx/dt = A x + B u`` of any structure, with what is known of it beforehand.

Derivatives are found by estimation; kinematics and gravity are not. Angles are Euler angles, as a flight table has
them, so d(phi)/dt = p + r tan(Theta), d(psi)/dt = r / cos(Theta) and gravity acts through phi alone. Thesis 3.18
writes d(phi)/dt = p, d(psi)/dt = r and a y_psi: the same system in the integrals of p and r, alike at Theta = 0.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.aircraft_file import Aircraft
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.conventions import longitudinal_mass_matrix
from wingwatch.aircraft.structures import ModeStructure

__all__ = ["KnownTerms", "change_form", "form_scale", "known_terms", "state_space"]

_MOTION_OF_ANGLE = {"alpha": "w", "beta": "v"}


@dataclass(frozen=True, slots=True)
class KnownTerms:
    """What is known of a structure's A without any estimate.

    Attributes:
        matrix: shape (n, n), n = all states: kinematic rows and gravity's columns, else zeros.
        row_scale: shape (equations,): d(state)/dt over the equation's acceleration; 1 but for alpha and beta.
    """

    matrix: NDArray[np.float64]
    row_scale: NDArray[np.float64]


def known_terms(
    structure: ModeStructure,
    condition: FlightCondition | None = None,
    aircraft: Aircraft | None = None,
    climb_rad: float = 0.0,
) -> KnownTerms:
    """Kinematics, gravity and the scale from accelerations to rates of alpha and beta, wings level.

    Pitch attitude is angle of attack plus climb. x_theta = -g cos(Theta), z_theta = -g sin(Theta), y_phi =
    g cos(Theta) (thesis 3.15, 3.16); alphadot terms mix the first two (``longitudinal_mass_matrix``).

    Args:
        structure: the mode's structure.
        condition: airspeed and angle of attack count; needed by structures with attitudes, alpha or beta.
        aircraft: only what it says of alphadot and mass is used; without one there is no alphadot.
        climb_rad: angle of the path above the horizon.

    Raises:
        ValueError: the condition is needed and absent.
    """
    n = len(structure.all_states)
    matrix, scale = np.zeros((n, n)), np.ones(len(structure.equations))
    angles = [s for s in structure.states if s in _MOTION_OF_ANGLE]
    if not angles and not structure.attitudes:
        return KnownTerms(matrix, scale)
    if condition is None:
        raise ValueError(
            f"the matrices of {structure.name} depend on airspeed and angle of attack; give the flight condition"
        )
    for angle in angles:
        scale[structure.states.index(angle)] = 1.0 / _velocity_of(angle, condition)
    place = {state: i for i, state in enumerate(structure.all_states)}
    pitch = condition.angle_of_attack_rad + climb_rad
    for attitude in structure.attitudes:
        row = place[attitude]
        if attitude == "theta":
            matrix[row, place["q"]] = 1.0
            matrix[: len(structure.equations), row] = _pitch_gravity(condition, aircraft, pitch)
        elif attitude == "phi":
            matrix[row, place["p"]], matrix[row, place["r"]] = 1.0, math.tan(pitch)
            matrix[place["v"], row] = GRAVITY_M_S2 * math.cos(pitch)
        else:
            matrix[row, place["r"]] = 1.0 / math.cos(pitch)
    return KnownTerms(matrix, scale)


def _pitch_gravity(
    condition: FlightCondition, aircraft: Aircraft | None, pitch: float
) -> NDArray[np.float64]:
    """(x_theta, z_theta, m_theta)."""
    gravity = -GRAVITY_M_S2 * np.array([math.cos(pitch), math.sin(pitch), 0.0])
    if aircraft is None or aircraft.mass is None:
        return gravity
    weight = aircraft.mass.mass_kg * gravity
    return np.asarray(
        np.linalg.solve(longitudinal_mass_matrix(aircraft, condition), weight), dtype=np.float64
    )


def state_space(
    structure: ModeStructure,
    derivatives: Mapping[str, float],
    condition: FlightCondition | None = None,
    aircraft: Aircraft | None = None,
    climb_rad: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B of ``dx/dt = A x + B u``, x the structure's ``all_states``, u its inputs, from concise derivatives.

    Returns:
        (A, B) of shapes (n, n) and (n, inputs); units of the states (m/s, rad, rad/s).

    Raises:
        KeyError: a derivative of the structure is absent.
        ValueError: as ``known_terms``.
    """
    known = known_terms(structure, condition, aircraft, climb_rad)
    k, e = len(structure.states), len(structure.equations)
    rows = np.array(
        [[derivatives[f"{row}_{c}"] for c in structure.regressors] for row in structure.equations]
    )
    rows = rows * known.row_scale[:, None]
    a, b = known.matrix.copy(), np.zeros((len(structure.all_states), len(structure.inputs)))
    a[:e, :k] += rows[:, :k]
    b[:e] = rows[:, k:]
    return a, b


def _velocity_of(angle: str, condition: FlightCondition) -> float:
    """m/s of w or v that a radian of alpha or beta is: at constant u, d(w)/d(alpha) = V / cos(alpha); at beta = 0,
    d(v)/d(beta) = V."""
    speed = condition.airspeed_true_m_s
    return speed / math.cos(condition.angle_of_attack_rad) if angle == "alpha" else speed


def form_scale(
    source: ModeStructure, target: ModeStructure, condition: FlightCondition
) -> NDArray[np.float64]:
    """What each derivative is multiplied by when w becomes alpha, v becomes beta, or back; shape (k,).

    The equations stay the accelerations that they are, so z_alpha = V / cos(alpha) z_w in m/s2 per rad, z_q and z_eta
    stay, and both forms have the same roots. A covariance C becomes ``scale[:, None] * C * scale``.

    Raises:
        ValueError: the two structures are not forms of one another.
    """
    plain = [tuple(_MOTION_OF_ANGLE.get(s, s) for s in x.states) for x in (source, target)]
    if plain[0] != plain[1] or (source.inputs, source.equations) != (target.inputs, target.equations):
        raise ValueError(
            f"{source.name} is no form of {target.name}: they differ in more than w for alpha or v for beta"
        )
    columns = [
        1.0
        if old == new
        else (_velocity_of(new, condition) if new in _MOTION_OF_ANGLE else 1.0 / _velocity_of(old, condition))
        for old, new in zip(source.regressors, target.regressors, strict=True)
    ]
    return np.array(columns * len(source.equations))


def change_form(
    values: Mapping[str, float], source: ModeStructure, target: ModeStructure, condition: FlightCondition
) -> dict[str, float]:
    """Concise derivatives (or standard errors) of one structure as those of its form with angles, or back.

    Raises:
        KeyError: a derivative of ``source`` is absent.
        ValueError: as ``form_scale``.
    """
    scale = form_scale(source, target, condition).tolist()
    return {
        new: values[old] * factor
        for old, new, factor in zip(source.derivatives, target.derivatives, scale, strict=True)
    }
