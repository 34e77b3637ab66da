"""JSBSim as a peer: one of its bundled aircraft, flown by JSBSim itself and expressed in our aircraft file.

Everything about the aircraft is read from JSBSim's installation at run time. What the aircraft file has no word for
is taken off the bundled description before it is loaded: engine and fuel (a force along x body through the centre of
gravity takes their place), the flight control system (surfaces are set directly), the pilot as a point mass.
Aerodynamics, mass, inertias and the point that forces act at stay as bundled.
"""

import math
import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jsbsim
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from wingwatch.aircraft import GRAVITY_M_S2, FlightCondition, Mass

os.environ.setdefault("JSBSIM_DEBUG", "0")  # it greets on standard output otherwise

__all__ = ["Peer", "PeerTrim", "bundled"]

FT, SLUG, LBF = 0.3048, 14.59390293720636, 4.4482216152605
_FLAT_EARTH_M = 6.371e9
"""Radius of a still earth, 1000 times the real one: no curvature, no fall of gravity with height."""
_TAKEN_OFF = ("propulsion", "flight_control", "system", "autopilot", "output", "input", "external_reactions")
_ADAMS_BASHFORTH_2 = 3
"""JSBSim's number of that integrator."""
_PASSES = 4
"""Evaluations until alphadot, which JSBSim takes from the pass before, has settled: each leaves a hundredth."""


def bundled(name: str, mass: Mass | None = None, without: Sequence[str] = ()) -> ET.Element:
    """The description of a bundled aircraft without what ``_TAKEN_OFF`` and the module say, on request with another
    mass and without some of its aerodynamic terms."""
    tree = ET.parse(Path(jsbsim.get_default_root_dir()) / "aircraft" / name / f"{name}.xml").getroot()
    for tag in _TAKEN_OFF:
        for element in tree.findall(tag):
            tree.remove(element)
    balance = tree.find("mass_balance")
    assert balance is not None
    for element in balance.findall("pointmass"):
        balance.remove(element)
    centre = balance.find("location[@name='CG']")
    assert centre is not None
    if mass is not None:
        _replace_mass(balance, mass)
    for axis in tree.findall("aerodynamics/axis"):
        for function in axis.findall("function"):
            if function.get("name") in without:
                axis.remove(function)
    control = ET.SubElement(tree, "flight_control", {"name": "none"})
    named = {(p.text or "").strip() for p in tree.iter("property")} | {
        (v.text or "").strip() for v in tree.iter("independentVar")
    }
    for absent in sorted(
        n for n in named if n.startswith("systems/")
    ):  # of a system that was taken off: zero
        ET.SubElement(control, "property", {"value": "0"}).text = absent
    force = ET.SubElement(
        ET.SubElement(tree, "external_reactions"), "force", {"name": "thrust", "frame": "BODY"}
    )
    place = ET.SubElement(force, "location", {"unit": centre.get("unit", "IN")})
    direction = ET.SubElement(force, "direction")
    for letter, along in zip("xyz", (1.0, 0.0, 0.0), strict=True):
        ET.SubElement(place, letter).text = centre.findtext(letter)
        ET.SubElement(direction, letter).text = str(along)
    return tree


def _replace_mass(balance: ET.Element, mass: Mass) -> None:
    balance.set("negated_crossproduct_inertia", "true")
    for tag in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz", "emptywt"):
        for element in balance.findall(tag):
            balance.remove(element)
    ET.SubElement(balance, "emptywt", {"unit": "KG"}).text = str(mass.mass_kg)
    for tag, value in (
        ("ixx", mass.inertia_x_kg_m2),
        ("iyy", mass.inertia_y_kg_m2),
        ("izz", mass.inertia_z_kg_m2),
        ("ixz", -mass.inertia_xz_kg_m2),
    ):
        ET.SubElement(balance, tag, {"unit": "KG*M2"}).text = str(value)


@dataclass(frozen=True, slots=True)
class PeerTrim:
    """Steady level flight as JSBSim's own accelerations have it.

    Attributes:
        angle_of_attack_rad: there.
        elevator_rad: there.
        thrust_n: there.
    """

    angle_of_attack_rad: float
    elevator_rad: float
    thrust_n: float


class Peer:
    """A bundled aircraft loaded into JSBSim, ``description`` as it was loaded.

    Args:
        name: of the folder it is bundled in.
        flat_earth: a still earth without curvature as in our equations; False for JSBSim's own, which turns.
        rate_hz: of its integration.
        mass: in place of the bundled one.
        without: aerodynamic terms to leave out, by JSBSim's name.
        change: alters the description before it is loaded.
        second_order: integrates rotations by Adams and Bashforth's second order, not by the bundled Euler step, which
            makes a roll mode of 10 rad/s 2 % too slow at 250 Hz or 0.5 % at 1000 Hz.
    """

    def __init__(
        self,
        name: str,
        *,
        flat_earth: bool = True,
        rate_hz: float = 500.0,
        mass: Mass | None = None,
        without: Sequence[str] = (),
        change: Callable[[ET.Element], None] | None = None,
        second_order: bool = False,
    ) -> None:
        self.name = name
        self.description = bundled(name, mass, without)
        if change is not None:
            change(self.description)
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / name).mkdir()
            ET.ElementTree(self.description).write(Path(folder) / name / f"{name}.xml")
            self.fdm = jsbsim.FGFDMExec(None)
            self.fdm.set_debug_level(0)
            self.fdm.set_aircraft_path(folder)
            if flat_earth:
                planet = Path(folder) / "planet.xml"
                planet.write_text(
                    f'<planet><semimajor_axis unit="M">{_FLAT_EARTH_M}</semimajor_axis>'
                    f'<semiminor_axis unit="M">{_FLAT_EARTH_M}</semiminor_axis><rotation_rate>0</rotation_rate>'
                    f'<GM unit="M3/SEC2">{GRAVITY_M_S2 * _FLAT_EARTH_M**2}</GM><J2>0</J2></planet>'
                )
                self.fdm.load_planet(str(planet), False)
            if not self.fdm.load_model(name):
                raise ValueError(
                    f"JSBSim cannot load its aircraft {name!r}; choose another of its bundled ones"
                )
        self.fdm.set_dt(1.0 / rate_hz)
        if second_order:
            for rotation in ("rate", "position"):
                self[f"simulation/integrator/{rotation}/rotational"] = _ADAMS_BASHFORTH_2

    def __getitem__(self, name: str) -> float:
        return float(self.fdm.get_property_value(name))

    def __setitem__(self, name: str, value: float) -> None:
        self.fdm.set_property_value(name, float(value))

    @property
    def mass(self) -> Mass:
        """Mass and moments of inertia as JSBSim has them."""
        x, y, z, xz = (self[f"inertia/i{axes}-slugs_ft2"] * SLUG * FT**2 for axes in ("xx", "yy", "zz", "xz"))
        return Mass(
            mass_kg=self["inertia/mass-slugs"] * SLUG, inertia_x_kg_m2=x, inertia_y_kg_m2=y, inertia_z_kg_m2=z,
            inertia_xz_kg_m2=-xz,  # JSBSim keeps the tensor's element
        )  # fmt: skip

    def set_controls(self, surfaces_rad: Sequence[float], thrust_n: float) -> None:
        """Elevator, aileron and rudder (signs of the flight table) and thrust."""
        elevator, aileron, rudder = surfaces_rad
        self["fcs/elevator-pos-rad"] = elevator
        self["fcs/left-aileron-pos-rad"] = -aileron
        self["fcs/right-aileron-pos-rad"] = aileron
        self["fcs/rudder-pos-rad"] = rudder
        self["external_reactions/thrust/magnitude"] = thrust_n / LBF

    def start(
        self,
        motion: Sequence[float],
        pitch_rad: float,
        altitude_m: float,
        surfaces_rad: Sequence[float],
        thrust_n: float,
    ) -> None:
        """Put it somewhere: ``motion`` is u, v, w in m/s and p, q, r in rad/s; heading north, wings level."""
        for axis, value in zip("uvw", motion[:3], strict=True):
            self[f"ic/{axis}-fps"] = value / FT
        for axis, value in zip("pqr", motion[3:], strict=True):
            self[f"ic/{axis}-rad_sec"] = value
        self["ic/theta-rad"], self["ic/phi-rad"], self["ic/psi-true-rad"] = pitch_rad, 0.0, 0.0
        self["ic/h-sl-ft"] = altitude_m / FT
        self.set_controls(surfaces_rad, thrust_n)
        self.fdm.run_ic()
        self.settle()

    def settle(self) -> None:
        """Forces of this instant and of these deflections, time held still."""
        self.fdm.suspend_integration()
        for _ in range(_PASSES):
            self.fdm.run()
        self.fdm.resume_integration()

    def accelerations(self) -> NDArray[np.float64]:
        """du/dt, dv/dt, dw/dt in m/s2 and dp/dt, dq/dt, dr/dt in rad/s2 at this instant, shape (6,)."""
        linear = [self[f"accelerations/{axis}dot-ft_sec2"] * FT for axis in "uvw"]
        return np.array(linear + [self[f"accelerations/{axis}dot-rad_sec2"] for axis in "pqr"])

    def _level(self, condition: FlightCondition, at: PeerTrim) -> NDArray[np.float64]:
        speed, alpha = condition.airspeed_true_m_s, at.angle_of_attack_rad
        return np.array([speed * math.cos(alpha), 0.0, speed * math.sin(alpha), 0.0, 0.0, 0.0])

    def _start_level(self, condition: FlightCondition, at: PeerTrim) -> None:
        surfaces = (at.elevator_rad, 0.0, 0.0)
        motion = self._level(condition, at).tolist()
        self.start(motion, at.angle_of_attack_rad, condition.altitude_m, surfaces, at.thrust_n)

    def trim(self, condition: FlightCondition) -> PeerTrim:
        """Angle of attack, elevator and thrust at which JSBSim's du/dt, dw/dt and dq/dt vanish."""
        weight = self["inertia/mass-slugs"] * SLUG * GRAVITY_M_S2

        def left(x: NDArray[np.float64]) -> NDArray[np.float64]:
            at = PeerTrim(float(x[0]), float(x[1]), float(x[2]) * weight)
            self._start_level(condition, at)
            return self.accelerations()[[0, 2, 4]]

        x = root(left, np.array([0.03, 0.0, 0.1]), tol=1e-12, options={"eps": 1e-7}).x
        if not float(np.abs(left(x)).max()) < 1e-7:
            raise ValueError(
                f"JSBSim's {self.name} has no level flight at {condition}; choose another airspeed"
            )
        return PeerTrim(float(x[0]), float(x[1]), float(x[2]) * weight)

    def concise(self, condition: FlightCondition, at: PeerTrim, step: float = 1e-4) -> dict[str, float]:
        """Every concise derivative of body axes (``z_w`` to ``n_zeta``) by central differences of its accelerations.

        ``step`` is in rad for surfaces and rates, and in m/s 100 times as much.
        """
        columns = ("u", "v", "w", "p", "q", "r", "eta", "xi", "zeta")
        out: dict[str, float] = {}
        for i, column in enumerate(columns):
            width = step * (100.0 if i < 3 else 1.0)
            sides = []
            for sign in (1.0, -1.0):
                motion, surfaces = self._level(condition, at), np.array([at.elevator_rad, 0.0, 0.0])
                (motion if i < 6 else surfaces)[i % 6] += sign * width
                self.start(
                    motion.tolist(),
                    at.angle_of_attack_rad,
                    condition.altitude_m,
                    surfaces.tolist(),
                    at.thrust_n,
                )
                sides.append(self.accelerations())
            slope = (sides[0] - sides[1]) / (2.0 * width)
            out |= {f"{row}_{column}": float(slope[j]) for j, row in enumerate("xyzlmn")}
        return out

    def fly(
        self, condition: FlightCondition, at: PeerTrim, surfaces_rad: NDArray[np.float64], rate_hz: float
    ) -> NDArray[np.float64]:
        """u, v, w, p, q, r, roll, pitch at each of the deflections' instants, shape (n, 8).

        Args:
            condition: where it starts, trimmed.
            at: that trim; thrust stays.
            surfaces_rad: deflections added to the trim, each held over one period of ``rate_hz``, shape (n, 3).
            rate_hz: JSBSim's own rate is a multiple of it.
        """
        elevator = np.array([at.elevator_rad, 0.0, 0.0])
        self._start_level(condition, at)
        steps = round(1.0 / (rate_hz * self.fdm.get_delta_t()))
        out = np.empty((len(surfaces_rad), 8))
        for i, deflection in enumerate(surfaces_rad):
            out[i] = (
                *(self[f"velocities/{axis}-fps"] * FT for axis in "uvw"),
                *(self[f"velocities/{axis}-rad_sec"] for axis in "pqr"),
                self["attitude/phi-rad"],
                self["attitude/theta-rad"],
            )
            self.set_controls((elevator + deflection).tolist(), at.thrust_n)
            self.settle()  # else JSBSim integrates the last step's forces first, and all deflections come a step late
            for _ in range(steps):
                self.fdm.run()
        return out

    def minute_s(self, condition: FlightCondition, at: PeerTrim, clock: Callable[[], float]) -> float:
        """What a minute of trimmed flight takes by a clock, one call of JSBSim a step."""
        self._start_level(condition, at)
        steps = round(60.0 / self.fdm.get_delta_t())
        start = clock()
        for _ in range(steps):
            self.fdm.run()
        return clock() - start
