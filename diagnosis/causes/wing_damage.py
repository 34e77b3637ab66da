"""Loss of the outer part of one wing, by strips of a rectangular wing.

With the fraction f of a semi-span gone, k1 = 1 - (1 - f)^2, k2 = 1 - (1 - f)^3, s = 1 on the right and -1 on the left:

- lift keeps 1 - f/2, dihedral's moment 1 - k1/2, roll damping 1 - k2/2;
- the lift that is left rolls towards the damage, Cl += s CL k1/8, the drag that is left yaws away from it,
  Cn -= s CD_wing k1/8; CD_wing is straight about the angle of attack of the flight;
- the polar keeps 1 - f/2 of CL at least drag, (1 - f/2)^2 of Oswald's factor, and loses f/2 of the wing's least drag;
- the aileron on that side, which reaches from ``_AILERON_FROM`` to the tip, loses its own area and first moment;
- the strip's mass goes from where it was: centre of gravity and inertia follow.

Shares of mass and drag and the place of the aileron are assumed: no aircraft file states them.
"""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, scale
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_LOST = FreeParameter("fraction_of_semi_span_lost", "", 0.01, 0.2, 0.02, 0.0, 0.9)
_OF_MASS, _OF_LEAST_DRAG, _AILERON_FROM = 0.2, 0.4, 0.6
"""Shares of a wing, and the part of the semi-span that is inside of the aileron."""


def candidates(subject: Subject) -> list[Candidate]:
    """Right and left."""
    row, flight = subject.model.row, subject.flight
    pressure = 0.5 * float(np.nanmean(flight.density_kg_m3)) * flight.airspeed_m_s**2
    lift = row[INDEX["mass_kg"]] * GRAVITY_M_S2 / (pressure * row[INDEX["area_m2"]])
    return [
        Candidate(
            "wing_damage", side, (_LOST,), _Loss(sign, float(lift)),
            f"the outer {{0:.0%}} of the {side} wing's semi-span is lost", odds=0.5,
        )
        for side, sign in (("right", 1.0), ("left", -1.0))
    ]  # fmt: skip


class _Loss:
    def __init__(self, sign: float, lift: float) -> None:
        self.sign, self.lift = sign, lift

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        lost = float(v[0])
        first, second = 1.0 - (1.0 - lost) ** 2, 1.0 - (1.0 - lost) ** 3
        row, (drag, zero, slope) = model.row, self._drag(model)
        whole = {
            "Cl_zero": row[INDEX["CL_zero"]],
            "Cl_alpha": row[INDEX["CL_alpha"]],
            "Cn_zero": -zero,
            "Cn_alpha": -slope,
        }
        for name, of_wing in whole.items():
            row[INDEX[name]] += self.sign * of_wing * first / 8.0
        row[INDEX["CD_min"]] *= 1.0 - 0.5 * lost * _OF_LEAST_DRAG
        row[INDEX["Cn_r"]] += drag / 6.0 * second
        scale(model, {"CL_zero": -0.5, "CL_alpha": -0.5, "CD_CL_at_min": -0.5}, lost)
        scale(model, {"CD_oswald": -1.0}, lost - 0.25 * lost**2)
        scale(model, {"Cl_beta": -0.5}, first)
        scale(model, {"Cl_p": -0.5, "Cl_r": -0.5, "Cn_p": -0.5}, second)
        inside = max(_AILERON_FROM, 1.0 - lost)
        scale(model, {"CD_aileron": -0.5}, (1.0 - inside) / (1.0 - _AILERON_FROM))
        moment = (1.0 - inside**2) / (1.0 - _AILERON_FROM**2)
        scale(model, {"CY_aileron": -0.5, "Cl_aileron": -0.5, "Cn_aileron": -0.5}, moment)
        self._lose_mass(model, lost)

    def _drag(self, model: Model) -> tuple[float, float, float]:
        """Drag coefficient of the whole wing: in the flight; at no angle of attack, on the line about the flight's; and
        its slope by the angle of attack."""
        row = model.row
        induced = row[INDEX["area_m2"]] / (math.pi * row[INDEX["CD_oswald"]] * row[INDEX["span_m"]] ** 2)
        lift = self.lift - row[INDEX["CD_CL_at_min"]]
        drag = _OF_LEAST_DRAG * row[INDEX["CD_min"]] + induced * lift**2
        by_lift = 2.0 * induced * lift
        zero = drag - by_lift * (self.lift - row[INDEX["CL_zero"]])
        return float(drag), float(zero), float(by_lift * row[INDEX["CL_alpha"]])

    def _lose_mass(self, model: Model, lost: float) -> None:
        """A rod along y, from (1 - f) b/2 to b/2, abeam the reference point."""
        row = model.row
        before, span_m = float(row[INDEX["mass_kg"]]), float(row[INDEX["span_m"]])
        gone = 0.5 * lost * _OF_MASS * before
        after = before - gone
        centre = np.array([row[INDEX[f"cg_{axis}_m"]] for axis in "xyz"])
        arm = np.array([0.0, self.sign * 0.5 * span_m * (1.0 - 0.5 * lost), 0.0]) - centre
        about = gone * before / after  # parallel axes, from the centre before to the one after
        own = gone * (0.5 * lost * span_m) ** 2 / 12.0
        x, y, z = arm
        row[INDEX["inertia_x"]] -= about * (y * y + z * z) + own
        row[INDEX["inertia_y"]] -= about * (x * x + z * z)
        row[INDEX["inertia_z"]] -= about * (x * x + y * y) + own
        for pair, product in (("xy", x * y), ("xz", x * z), ("yz", y * z)):
            row[INDEX[f"inertia_{pair}"]] -= about * product
        row[INDEX["mass_kg"]] = after
        for axis, moved in zip("xyz", centre - gone / after * arm, strict=True):
            row[INDEX[f"cg_{axis}_m"]] = moved
