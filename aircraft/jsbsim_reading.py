"""An aircraft file from a JSBSim aircraft: its coefficients by differences of JSBSim's own forces at a level trim."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.aircraft.aerodynamics import aspect_ratio
from wingwatch.aircraft.aircraft_file import Aircraft
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.coefficients import (
    Coefficients,
    DirectionalCoefficients,
    DragCoefficients,
    LiftCoefficients,
    PitchCoefficients,
)
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.jsbsim_model import FT, SLUG, JsbsimError, JsbsimModel

__all__ = ["JsbsimTrim", "jsbsim_aircraft", "polar"]

Array = NDArray[np.float64]

_STEP_RAD = 2e-3
"""Half of a central difference, rad: a tenth of a degree, within the segments of tables and well over rounding."""
_LEFT = 1e-5
"""Of acceleration in m/s2 and rad/s2 that a trim may leave."""
_NO_RESPONSE = 1e-6
_PUSH = 0.5
"""Of the weight."""
_NONE = np.zeros(6)
_OWN_MOMENT = {"elevator": 4, "aileron": 3, "rudder": 5}
OSWALD = 0.8
_OSWALD_RANGE = (0.2, 1.5)
_Put = Callable[[float], tuple[Array, float]]


@dataclass(frozen=True, slots=True)
class JsbsimTrim:
    """Level flight as JSBSim has it: angle of attack and elevator (its own sign) in rad, thrust in N."""

    angle_of_attack_rad: float
    elevator_rad: float
    thrust_n: float


def jsbsim_aircraft(path: Path, name: str, condition: FlightCondition) -> tuple[Aircraft, list[str]]:
    """A JSBSim aircraft as its tangent at a level trim.

    Args:
        path: its XML file.
        name: the new file's.
        condition: airspeed and altitude of the trim.

    Returns:
        The aircraft (mass, geometry, [coefficients] about its centre of gravity, body axes), and what was assumed.

    Raises:
        JsbsimError: JSBSim is not installed, does not load the file, or finds no level flight there.
    """
    model = JsbsimModel(path)
    at = _trim(model, condition)
    geometry = model.geometry
    slopes = _Slopes(model, condition, at)
    columns = slopes.columns()
    if not columns["elevator"][4]:
        raise JsbsimError(
            f"{path}: no moment depends on fcs/elevator-pos-rad, -deg or -norm; add the elevator"
        )
    eta = at.elevator_rad * slopes.elevator_sign
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    _check_lift(path, slopes.base, columns["alpha"], at.angle_of_attack_rad)
    coefficients = _coefficients(slopes.base, columns, at.angle_of_attack_rad, eta, aspect)
    notes = [*model.notes, *slopes.notes]
    aircraft = Aircraft(format=1, name=name, geometry=geometry, mass=model.mass, coefficients=coefficients)
    return aircraft, notes


def _level(condition: FlightCondition, alpha: float) -> Array:
    speed = condition.airspeed_true_m_s
    return np.array([speed * math.cos(alpha), 0.0, speed * math.sin(alpha), 0.0, 0.0, 0.0])


def _trim(model: JsbsimModel, condition: FlightCondition) -> JsbsimTrim:
    weight = model.mass.mass_kg * GRAVITY_M_S2

    def left(x: Array) -> Array:
        alpha, elevator, thrust = (float(v) for v in x)
        surfaces = np.array([elevator, 0.0, 0.0])
        _, rates = model.put(_level(condition, alpha), condition.altitude_m, surfaces, thrust * weight)
        return np.array(rates[[0, 2, 4]])

    for start in (0.03, 0.1, 0.0):
        found = scipy.optimize.root(left, np.array([start, 0.0, 0.1]), tol=1e-12, options={"eps": 1e-6}).x
        if (
            float(np.abs(left(found)).max()) < _LEFT
            and abs(float(found[0])) < 0.5
            and abs(float(found[1])) < 0.8
        ):
            return JsbsimTrim(float(found[0]), float(found[1]), float(found[2]) * weight)
    raise JsbsimError(
        f"JSBSim finds no level flight of this aircraft at {condition.airspeed_true_m_s:g} m/s and "
        f"{condition.altitude_m:g} m; choose another --airspeed or --altitude"
    )


class _Slopes:
    """Central differences of force and moment coefficients about a trim.

    alphadot is what JSBSim makes of the accelerations of each state. A push along z changes it and nothing else that
    the air feels: that difference is the derivative by alphadot, and it is taken out of the others.
    """

    def __init__(self, model: JsbsimModel, condition: FlightCondition, at: JsbsimTrim) -> None:
        self.notes: list[str] = []
        self.elevator_sign = 1.0
        self._model, self._condition, self._at, self._geometry = model, condition, at, model.geometry
        self._weight_n = model.mass.mass_kg * GRAVITY_M_S2
        self._base = self._forces()[0]

    def _forces(
        self, motion: Array = _NONE, surfaces: Array = _NONE[:3], push_n: float = 0.0
    ) -> tuple[Array, float]:
        """CX CY CZ Cl Cm Cn and alphadot c/2V, with increments to the trim."""
        at, g, condition = self._at, self._geometry, self._condition
        level = _level(condition, at.angle_of_attack_rad) + motion
        deflections = np.array([at.elevator_rad, 0.0, 0.0]) + surfaces
        found, rates = self._model.put(level, condition.altitude_m, deflections, at.thrust_n, push_n)
        speed = float(np.linalg.norm(level[:3]))
        # density as JSBSim has it, so that coefficients are the file's own
        pressure_area = (
            0.5 * self._model["atmosphere/rho-slugs_ft3"] * SLUG / FT**3 * speed**2 * g.wing_area_m2
        )
        lengths = np.array([1.0, 1.0, 1.0, g.span_m, g.mean_chord_m, g.span_m])
        u, w = level[0], level[2]
        alphadot = (u * rates[2] - w * rates[0]) / (u * u + w * w)
        return found / (pressure_area * lengths), float(alphadot * g.mean_chord_m / (2.0 * speed))

    def _slope(self, put: _Put, step: float) -> tuple[Array, float]:
        """d(coefficients) and d(alphadot c/2V) per unit of a step."""
        high, low = put(step), put(-step)
        return (high[0] - low[0]) / (2.0 * step), (high[1] - low[1]) / (2.0 * step)

    def columns(self) -> dict[str, Array]:
        """d(CX CY CZ Cl Cm Cn) by alpha, beta, p, q, r and alphadot in their units, and by the surfaces in ours."""
        g, speed, alpha, h = (
            self._geometry, self._condition.airspeed_true_m_s, self._at.angle_of_attack_rad, _STEP_RAD,
        )  # fmt: skip
        by_push, unsteady = self._slope(lambda s: self._forces(push_n=s * self._weight_n), _PUSH)
        by_alphadot = by_push / unsteady

        def steady(put: _Put, step: float = h) -> Array:
            slope, alphadot = self._slope(put, step)
            return slope - alphadot * by_alphadot

        def turned(step: float) -> Array:
            return _level(self._condition, alpha + step) - _level(self._condition, alpha)

        def sideways(step: float) -> Array:
            level = _level(self._condition, alpha)
            along: Array = level * (math.cos(step) - 1.0)
            along[1] = speed * math.sin(step)
            return along

        def spinning(index: int, length: float) -> Array:
            along = np.zeros(6)
            along[3 + index] = 2.0 * speed / length
            return steady(lambda s: self._forces(s * along))

        def deflected(index: int) -> Array:
            return steady(lambda s: self._forces(surfaces=np.eye(3)[index] * s))

        out = {"alphadot": by_alphadot, "alpha": steady(lambda s: self._forces(turned(s)))}
        out["beta"] = steady(lambda s: self._forces(sideways(s)))
        for i, (axis, length) in enumerate(zip("pqr", (g.span_m, g.mean_chord_m, g.span_m), strict=True)):
            out[axis] = spinning(i, length)
        for i, (surface, row) in enumerate(_OWN_MOMENT.items()):
            column = deflected(i)
            out[surface] = -column if column[row] > 0.0 else column
            self._say(surface, float(column[row]))
            if surface == "elevator" and column[row] > 0.0:
                self.elevator_sign = -1.0
        return out

    def _say(self, surface: str, response: float) -> None:
        if abs(response) < _NO_RESPONSE:
            self.notes.append(f"nothing answers the {surface}: its coefficients are 0")
        elif response > 0.0:
            self.notes.append(
                f"the {surface}'s sign is turned: here a positive deflection gives a negative response"
            )

    @property
    def base(self) -> Array:
        """CX CY CZ Cl Cm Cn of the trim."""
        return self._base


def _check_lift(path: Path, base: Array, by_alpha: Array, alpha: float) -> None:
    """Refuse a trim beyond the stall."""
    cos, sin = math.cos(alpha), math.sin(alpha)
    slope = by_alpha[0] * sin - by_alpha[2] * cos + base[0] * cos + base[2] * sin
    if not slope > 0.0:
        raise JsbsimError(
            f"{path}: level flight there is at {math.degrees(alpha):.3g} degrees, where lift no longer grows with the "
            "angle of attack; choose a higher --airspeed"
        )


def _coefficients(base: Array, by: dict[str, Array], alpha: float, eta: float, aspect: float) -> Coefficients:
    """[coefficients] whose tangent at a trim has these values and columns."""
    cos, sin = math.cos(alpha), math.sin(alpha)

    def lift(v: Array) -> float:
        return float(v[0] * sin - v[2] * cos)

    def drag(v: Array) -> float:
        return float(-v[0] * cos - v[2] * sin)

    # The axes turn with the angle of attack: d(X sin - Z cos) has X cos + Z sin = -D beside the slopes, the drag L.
    slope = lift(by["alpha"]) - drag(base)
    elevator = lift(by["elevator"])
    CL = LiftCoefficients(
        zero=lift(base) - slope * alpha - elevator * eta, alpha=slope, q=lift(by["q"]), alphadot=lift(by["alphadot"]),
        elevator=elevator,
    )  # fmt: skip
    pitch = {key: float(by[key][4]) for key in ("alpha", "q", "alphadot", "elevator")}
    zero = float(base[4]) - pitch["alpha"] * alpha - pitch["elevator"] * eta
    CY, Cl, Cn = (
        DirectionalCoefficients(**{key: float(by[key][i]) for key in ("beta", "p", "r", "aileron", "rudder")})
        for i in (1, 3, 5)
    )
    straight = CL.zero + CL.alpha * alpha
    CD = polar(drag(base), drag(by["alpha"]) + lift(base), straight, CL.alpha, aspect)
    return Coefficients(
        force_axes="stability", CL=CL, CD=CD, CY=CY, Cl=Cl, Cm=PitchCoefficients(zero=zero, **pitch), Cn=Cn
    )


def polar(drag: float, slope: float, lift: float, lift_slope: float, aspect: float) -> DragCoefficients:
    """A parabola with a drag coefficient and its slope by angle of attack at a lift coefficient.

    Its minimum is at no lift where that leaves an Oswald factor that wings have; else the factor is ``OSWALD`` and
    the minimum is where the slope wants it.
    """
    if lift * slope * lift_slope > 0.0:
        oswald = 2.0 * lift * lift_slope / (math.pi * aspect * slope)
        if _OSWALD_RANGE[0] <= oswald <= _OSWALD_RANGE[1]:
            least = drag - lift**2 / (math.pi * oswald * aspect)
            if least > 0.0:
                return DragCoefficients(min=least, oswald=oswald)
    beside = slope * math.pi * OSWALD * aspect / (2.0 * lift_slope)
    least = drag - beside**2 / (math.pi * OSWALD * aspect)
    if least > 0.0:
        return DragCoefficients(min=least, CL_at_min=lift - beside, oswald=OSWALD)
    return DragCoefficients(min=max(0.0, drag), CL_at_min=lift, oswald=OSWALD)
