"""Forces and moments that an aircraft file's coefficients stand for, in body axes.

This is the meaning of the file. The simulation's compiled step and the linearisation are held to it by tests.
"""

import math
from typing import NamedTuple

import numpy as np

from wingwatch.aircraft.coefficients import Coefficients, StallBlend

__all__ = ["BodyCoefficients", "aspect_ratio", "body_coefficients", "drag_coefficient", "lift_coefficient"]

Number = float | complex
"""A float, or a complex number on the way through a complex-step derivative."""


class BodyCoefficients(NamedTuple):
    """Force and moment coefficients in body axes, American convention."""

    CX: Number
    CY: Number
    CZ: Number
    Cl: Number
    Cm: Number
    Cn: Number


def aspect_ratio(span_m: float, wing_area_m2: float) -> float:
    """Span squared over wing area."""
    return span_m**2 / wing_area_m2


def _size(x: Number) -> Number:
    """|x| by the real part's sign, so that it may be differentiated by a complex step."""
    return -x if x.real < 0.0 else x


def _flat_plate_share(alpha: Number, stall: StallBlend) -> Number:
    """σ of the stall blend in the overflow-free product form 1 - (1 - s(α - α0)) (1 - s(-α - α0))."""

    def logistic(x: Number) -> Number:
        if x.real >= 0.0:
            return 1.0 / (1.0 + np.exp(-x))  # type: ignore[no-any-return]
        grown = np.exp(x)
        return grown / (1.0 + grown)  # type: ignore[no-any-return]

    up = logistic(stall.sharpness * (alpha - stall.angle_rad))
    down = logistic(stall.sharpness * (-alpha - stall.angle_rad))
    return up + down - up * down


def lift_coefficient(
    c: Coefficients, alpha: Number, q_hat: Number = 0.0, alphadot_hat: Number = 0.0, elevator: Number = 0.0
) -> Number:
    """CL at an angle of attack, rates in units of 2V/c, elevator in rad (see ``LiftCoefficients``)."""
    lift = c.CL.zero + c.CL.alpha * alpha
    if c.stall is not None:
        plate = 2.0 * (1.0 if alpha.real >= 0.0 else -1.0) * np.sin(alpha) ** 2 * np.cos(alpha)
        share = _flat_plate_share(alpha, c.stall)
        lift = (1.0 - share) * lift + share * plate
    return lift + c.CL.q * q_hat + c.CL.alphadot * alphadot_hat + c.CL.elevator * elevator


def drag_coefficient(
    c: Coefficients,
    aspect: float,
    alpha: Number,
    elevator: Number = 0.0,
    aileron: Number = 0.0,
    rudder: Number = 0.0,
) -> Number:
    """CD by the polar of ``DragCoefficients``; ``aspect`` is span squared over area."""
    line = c.CL.zero + c.CL.alpha * alpha
    polar = c.CD.min + (line - c.CD.CL_at_min) ** 2 / (math.pi * c.CD.oswald * aspect)
    return (
        polar + c.CD.elevator * _size(elevator) + c.CD.aileron * _size(aileron) + c.CD.rudder * _size(rudder)
    )


def body_coefficients(
    c: Coefficients,
    aspect: float,
    alpha: Number,
    beta: Number = 0.0,
    rates: tuple[Number, Number, Number] = (0.0, 0.0, 0.0),
    surfaces: tuple[Number, Number, Number] = (0.0, 0.0, 0.0),
    alphadot_hat: Number = 0.0,
) -> BodyCoefficients:
    """All six coefficients in body axes.

    Args:
        c: the coefficient set.
        aspect: aspect ratio of the wing.
        alpha: angle of attack, rad.
        beta: sideslip, rad.
        rates: (p b/2V, q c/2V, r b/2V).
        surfaces: (elevator, aileron, rudder), rad.
        alphadot_hat: dα/dt c/2V.
    """
    p, q, r = rates
    elevator, aileron, rudder = surfaces
    lift = lift_coefficient(c, alpha, q, alphadot_hat, elevator)
    drag = drag_coefficient(c, aspect, alpha, elevator, aileron, rudder)
    side, roll, yaw = (
        t.beta * beta + t.p * p + t.r * r + t.aileron * aileron + t.rudder * rudder
        for t in (c.CY, c.Cl, c.Cn)
    )
    pitch = (
        c.Cm.zero + c.Cm.alpha * alpha + c.Cm.q * q + c.Cm.alphadot * alphadot_hat + c.Cm.elevator * elevator
    )
    along, across = (-drag, side)
    if c.force_axes == "wind":
        along = -drag * np.cos(beta) - side * np.sin(beta)
        across = -drag * np.sin(beta) + side * np.cos(beta)
    cos, sin = np.cos(alpha), np.sin(alpha)
    return BodyCoefficients(along * cos + lift * sin, across, along * sin - lift * cos, roll, pitch, yaw)
