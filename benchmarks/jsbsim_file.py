"""A bundled aircraft of JSBSim in our aircraft file: aerodynamics, mass and reference point as JSBSim reads them."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np
from jsbsim_peer import FT, Peer, PeerTrim
from reference_point import about_centre_of_gravity

from wingwatch.aircraft import (
    Aircraft,
    Coefficients,
    ConstantThrust,
    DirectionalCoefficients,
    DragCoefficients,
    Geometry,
    LiftCoefficients,
    PitchCoefficients,
)

__all__ = ["peer_aircraft"]

INCH = 0.0254
_SCALES = (
    "aero/qbar-psf",
    "metrics/Sw-sqft",
    "metrics/bw-ft",
    "metrics/cbarw-ft",
    "aero/bi2vel",
    "aero/ci2vel",
)
_REGRESSORS: Mapping[str, str] = {
    "aero/alpha-rad": "alpha", "aero/beta-rad": "beta", "aero/alphadot-rad_sec": "alphadot",
    "velocities/p-rad_sec": "p", "velocities/q-rad_sec": "q", "velocities/r-rad_sec": "r",
    "velocities/p-aero-rad_sec": "p", "velocities/q-aero-rad_sec": "q", "velocities/r-aero-rad_sec": "r",
    "fcs/elevator-pos-rad": "elevator", "fcs/left-aileron-pos-rad": "left_aileron", "fcs/rudder-pos-rad": "rudder",
    "fcs/mag-elevator-pos-rad": "elevator_size", "aero/mag-beta-rad": "beta_size", "aero/cl-squared": "lift_squared",
}  # fmt: skip
"""What a term of the bundled aerodynamics is proportional to, by JSBSim's property."""


class _Aerodynamics:
    """A bundled description's aerodynamic terms, by axis and by what they are proportional to."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        tree = peer.description.find("aerodynamics")
        assert tree is not None
        self._functions = {f.get("name", ""): f for f in tree.findall("function")}
        self._terms: list[tuple[str, str, ET.Element]] = []
        for axis in tree.findall("axis"):
            self._terms += [(axis.get("name", ""), self._regressor(f), f) for f in axis.findall("function")]

    def _regressor(self, function: ET.Element) -> str:
        """The regressor of a function, ``none`` for a term of its own; functions are products."""
        product = function.find("product")
        if product is None or any(e.tag not in ("property", "value", "table") for e in product):
            raise ValueError(
                f"JSBSim's {self._peer.name}: {function.get('name')} is no product of properties, values and tables"
            )
        found = [_REGRESSORS[p] for p in _properties(product) if p in _REGRESSORS]
        if len(found) > 1:
            raise ValueError(
                f"JSBSim's {self._peer.name}: {function.get('name')} has several regressors, {found}"
            )
        return found[0] if found else "none"

    def _factor(self, element: ET.Element, alpha: float) -> float:
        """Product of what does not scale and is no regressor."""
        total = 1.0
        for part in element.iter():
            if part.tag == "value":
                total *= float(part.text or "")
            elif part.tag == "table":
                total *= self._table(part, alpha)
            elif part.tag == "property" and part.text is not None:
                name = part.text.strip()
                if name in self._functions:
                    total *= self._factor(self._functions[name], alpha)
                elif name not in _REGRESSORS and name not in _SCALES:
                    total *= self._peer[name]
        return total

    def _table(self, table: ET.Element, alpha: float) -> float:
        variables = [(v.text or "").strip() for v in table.findall("independentVar")]
        if len(variables) != 1:
            raise ValueError(
                f"JSBSim's {self._peer.name} has a table of {' and '.join(variables)}; "
                "choose an aircraft whose tables have one variable"
            )
        at = alpha if variables[0] == "aero/alpha-rad" else self._peer[variables[0]]
        numbers = [float(x) for x in (table.findtext("tableData") or "").split()]
        return float(np.interp(at, numbers[::2], numbers[1::2]))

    def value(self, axis: str, regressor: str, alpha: float) -> float:
        """Sum of an axis's terms with a regressor at an angle of attack, per unit of the regressor."""
        return math.fsum(self._factor(f, alpha) for a, r, f in self._terms if (a, r) == (axis, regressor))

    def static(self, axis: str, alpha: float) -> float:
        """Everything on an axis that depends on the angle of attack alone."""
        return self.value(axis, "none", alpha) + self.value(axis, "alpha", alpha) * alpha


def _properties(element: ET.Element) -> list[str]:
    return [(p.text or "").strip() for p in element.findall("property")]


_SLOPE_STEP_RAD = 1e-6
"""Far inside any segment of a table."""


def peer_aircraft(peer: Peer, at: PeerTrim) -> Aircraft:
    """A bundled aircraft as an aircraft file: tables by their tangent at a trim, forces at the bundled reference point.

    Raises:
        ValueError: aerodynamics of another form than products of constants and tables.
    """
    a, alpha = _Aerodynamics(peer), at.angle_of_attack_rad
    area, span, chord = (
        peer["metrics/Sw-sqft"] * FT**2,
        peer["metrics/bw-ft"] * FT,
        peer["metrics/cbarw-ft"] * FT,
    )

    def slope(axis: str) -> float:
        return (a.static(axis, alpha + _SLOPE_STEP_RAD) - a.static(axis, alpha - _SLOPE_STEP_RAD)) / (
            2.0 * _SLOPE_STEP_RAD
        )

    def zero(axis: str) -> float:
        return a.static(axis, alpha) - slope(axis) * alpha

    def directional(axis: str) -> DirectionalCoefficients:
        by = {name: a.value(axis, name, alpha) for name in ("beta", "p", "r", "rudder")}
        return DirectionalCoefficients(**by, aileron=-a.value(axis, "left_aileron", alpha))

    lift = LiftCoefficients(
        zero=zero("LIFT"), alpha=slope("LIFT"), q=a.value("LIFT", "q", alpha),
        alphadot=a.value("LIFT", "alphadot", alpha), elevator=a.value("LIFT", "elevator", alpha),
    )  # fmt: skip
    pitch = PitchCoefficients(
        zero=zero("PITCH"), alpha=slope("PITCH"), q=a.value("PITCH", "q", alpha),
        alphadot=a.value("PITCH", "alphadot", alpha), elevator=a.value("PITCH", "elevator", alpha),
    )  # fmt: skip
    drag = _polar(a, at, lift, span**2 / area, slope("DRAG"))
    file = Aircraft(
        format=1,
        name=peer.name.lower(),
        geometry=Geometry(wing_area_m2=area, span_m=span, mean_chord_m=chord),
        mass=peer.mass,
        coefficients=Coefficients(
            force_axes="wind", CL=lift, CD=drag, CY=directional("SIDE"), Cl=directional("ROLL"), Cm=pitch,
            Cn=directional("YAW"),
        ),
        propulsion=ConstantThrust(kind="constant_thrust", thrust_max_n=2.0 * at.thrust_n),
    )  # fmt: skip
    # JSBSim's structural axes point aft and up.
    point = tuple((peer[f"inertia/cg-{k}-in"] - peer[f"metrics/aero-rp-{k}-in"]) * INCH for k in "xz")
    return about_centre_of_gravity(file, (point[0], point[1]), alpha, at.elevator_rad)


def _polar(
    a: _Aerodynamics, at: PeerTrim, lift: LiftCoefficients, aspect: float, slope: float
) -> DragCoefficients:
    """The polar that has the bundled drag's value and its slopes by angle of attack and elevator at a trim.

    ``CL_at_min`` is minus the elevator's lift, so that the parabola's argument is all of the lift, which JSBSim's own
    parabola (``aero/cl-squared``) squares.
    """
    alpha, eta = at.angle_of_attack_rad, at.elevator_rad
    total = lift.zero + lift.alpha * alpha + lift.elevator * eta
    parabola = a.value("DRAG", "lift_squared", alpha)
    by_alpha = slope + 2.0 * parabola * total * lift.alpha
    by_elevator = a.value("DRAG", "elevator_size", alpha)
    by_elevator += 2.0 * parabola * total * lift.elevator * math.copysign(1.0, eta)
    per_square = by_alpha / (2.0 * total * lift.alpha)
    value = a.static("DRAG", alpha) + parabola * total**2 + a.value("DRAG", "elevator_size", alpha) * abs(eta)
    return DragCoefficients(
        min=value - per_square * total**2 - by_elevator * abs(eta),
        CL_at_min=-lift.elevator * eta,
        oswald=1.0 / (math.pi * aspect * per_square),
        elevator=by_elevator,
    )
