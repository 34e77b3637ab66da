"""Loss of the outer part of one wing: lift, damping, aileron, drag, mass and centre of gravity.

Strip model: a rectangular wing of span b and area S whose strips all have the lift slope CL_alpha, each meeting the
air at alpha + p y/V with the speed V - r y (y to the right). The fraction f of one semi-span is gone, s = +1 on the
right and -1 on the left. With k1 = 1 - (1 - f)^2 and k2 = 1 - (1 - f)^3, the lost strips had these shares of the
whole wing's

- area: f/2, so CL_zero, CL_alpha and CL_at_min of the polar keep 1 - f/2;
- first moment of the area, from one side: b S k1/8, so the lift that is left rolls the aircraft towards the damage
  (losing the right wing: positive): Cl_zero += s CL_zero k1/8, Cl_alpha += s CL_alpha k1/8; the drag that is left
  yaws it away from the damage: Cn_zero + Cn_alpha alpha -= s CD_wing(alpha) k1/8;
- absolute first moment: k1/2, so Cl_beta keeps 1 - k1/2 (taken as the wing's dihedral);
- second moment: k2/2, so Cl_p, Cl_r and Cn_p keep 1 - k2/2 (taken as the wing's, the fin's share neglected), and
  Cn_r loses the wing's own yaw damping -CD_wing/3 in that proportion;
- aileron, over the outer part of each semi-span: its own area and first moment, half of it a side.

CD_wing(alpha) is the wing's share of CD_min plus the induced drag, both spread evenly, taken straight about the
angle of attack of level flight. Induced drag of the shorter span b (1 - f/2) at the same lift is larger by (1 -
f/2)^-2: the polar's lift line keeps 1 - f/2, so CD_oswald keeps (1 - f/2)^2. The lost strips' mass is that of their
area, their centre abeam the reference point: centre of gravity and inertia follow (``mass_change``).

Left out, for the model of the flight has no such terms: lift due to roll rate and sideslip of the wing that is not
alike left and right, lift due to the one aileron that is left. Strips overrate the tip of a real wing, whose load
falls off there. Assumptions without a source, stated as constants below: shares of mass and drag, place of the
aileron.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.simulation.effects.effect import Effect, Parameters
from wingwatch.simulation.effects.mass_change import add_mass

__all__ = ["WingDamage"]

WING_SHARE_OF_MASS = 0.2
WING_SHARE_OF_DRAG_MIN = 0.4
AILERON_INNER_END, AILERON_OUTER_END = 0.6, 1.0
"""In fractions of the semi-span, from the root."""


@dataclass(frozen=True, slots=True)
class WingDamage(Effect):
    """``size`` is the fraction of one semi-span that is lost, from the tip; ``target`` says which."""

    name: ClassVar[str] = "wing_damage"
    size_max: ClassVar[float] = 1.0
    size_meaning: ClassVar[str] = "the fraction of the semi-span that is lost"
    targets: ClassVar[tuple[str, ...]] = ("left", "right")

    def apply(self, parameters: Parameters, severity: float) -> None:
        """As the module derives."""
        side = 1.0 if self.target == "right" else -1.0
        _drag_and_asymmetry(parameters, severity, side)
        first, second = 1.0 - (1.0 - severity) ** 2, 1.0 - (1.0 - severity) ** 3
        parameters.scale({"CL_zero": -0.5, "CL_alpha": -0.5, "CD_CL_at_min": -0.5}, severity)
        parameters.scale({"CD_oswald": -1.0}, 1.0 - (1.0 - 0.5 * severity) ** 2)
        parameters.scale({"Cl_beta": -0.5}, first)
        parameters.scale({"Cl_p": -0.5, "Cl_r": -0.5, "Cn_p": -0.5}, second)
        _aileron(parameters, severity)
        _mass(parameters, severity, side)


def _drag_and_asymmetry(p: Parameters, fraction: float, side: float) -> None:
    """Rolling and yawing moments and drag of the lost strips, from the parameters of the whole wing."""
    first, second = 1.0 - (1.0 - fraction) ** 2, 1.0 - (1.0 - fraction) ** 3
    pressure_area = p.condition.dynamic_pressure_pa * p["area_m2"]
    lift = p["mass_kg"] * GRAVITY_M_S2 / pressure_area - p["CD_CL_at_min"]
    alpha = (lift + p["CD_CL_at_min"] - p["CL_zero"]) / p["CL_alpha"]
    induced = 1.0 / (math.pi * p["CD_oswald"] * p["span_m"] ** 2 / p["area_m2"])
    drag_min = WING_SHARE_OF_DRAG_MIN * p["CD_min"]
    drag, slope = drag_min + induced * lift * lift, 2.0 * induced * lift * p["CL_alpha"]
    for name, of_whole_wing in (
        ("Cl_zero", p["CL_zero"]), ("Cl_alpha", p["CL_alpha"]),
        ("Cn_zero", -(drag - slope * alpha)), ("Cn_alpha", -slope),
    ):  # fmt: skip
        p[name] += side * of_whole_wing * first / 8.0
    p["CD_min"] -= 0.5 * fraction * drag_min
    p["Cn_r"] += drag / 3.0 * 0.5 * second


def _aileron(p: Parameters, fraction: float) -> None:
    """Half of what the lost part of one aileron had of the two."""
    from_root = max(AILERON_INNER_END, min(AILERON_OUTER_END, 1.0 - fraction))
    area = (AILERON_OUTER_END - from_root) / (AILERON_OUTER_END - AILERON_INNER_END)
    moment = (AILERON_OUTER_END**2 - from_root**2) / (AILERON_OUTER_END**2 - AILERON_INNER_END**2)
    p.scale({"CD_aileron": -0.5}, area)
    p.scale({"CY_aileron": -0.5, "Cl_aileron": -0.5, "Cn_aileron": -0.5}, moment)


def _mass(p: Parameters, fraction: float, side: float) -> None:
    """The lost strip is a rod along y, from (1 - f) b/2 to b/2."""
    mass = 0.5 * fraction * WING_SHARE_OF_MASS * p["mass_kg"]
    length = 0.5 * fraction * p["span_m"]
    place = np.array([0.0, side * 0.5 * (1.0 - 0.5 * fraction) * p["span_m"], 0.0])
    add_mass(p, -mass, place, -mass * length * length / 12.0 * np.diag([1.0, 0.0, 1.0]))
