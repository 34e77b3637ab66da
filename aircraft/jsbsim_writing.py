"""An aircraft file as a JSBSim aircraft: mass, geometry and <aerodynamics> that mean the same.

Lift, drag and side force are JSBSim's wind axes, moments about AERORP, surfaces ``fcs/elevator-pos-rad``,
``fcs/left-aileron-pos-rad`` (minus our aileron) and ``fcs/rudder-pos-rad``, moved by the usual commands. Thrust is an
external force along x body whose size is ``external_reactions/thrust/magnitude``, lbf: an aircraft file's engine is not
JSBSim's. Units are feet, slugs and pounds: JSBSim converts others by rounded factors (1e-4).
"""

import math
import xml.etree.ElementTree as ET

import numpy as np

from wingwatch.aircraft.aerodynamics import aspect_ratio, lift_coefficient
from wingwatch.aircraft.aircraft_file import Aircraft
from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.jsbsim_model import FT, SLUG

__all__ = ["jsbsim_xml"]

POUND = 0.45359237

_PURPOSE = "a JSBSim aircraft"
_TRAVEL_RAD = 0.35
"""Of a surface whose position limit the file does not state: what a command of 1 gives."""
_FORCE = ("aero/qbar-psf", "metrics/Sw-sqft")
_RATES = {
    "q": ("aero/ci2vel", "velocities/q-aero-rad_sec"),
    "alphadot": ("aero/ci2vel", "aero/alphadot-rad_sec"),
    "p": ("aero/bi2vel", "velocities/p-aero-rad_sec"),
    "r": ("aero/bi2vel", "velocities/r-aero-rad_sec"),
    "alpha": ("aero/alpha-rad",),
    "beta": ("aero/beta-rad",),
    "elevator": ("fcs/elevator-pos-rad",),
    "aileron": ("fcs/left-aileron-pos-rad",),
    "rudder": ("fcs/rudder-pos-rad",),
}
"""What a coefficient is multiplied with; the aileron's sign is turned."""
_STALL_ALPHAS = np.linspace(-1.0, 1.0, 101)


def jsbsim_xml(aircraft: Aircraft, source: str = "") -> str:
    """The text of a JSBSim aircraft's XML file.

    A stall blend becomes a table of lift by angle of attack, straight between points 0.02 rad apart.

    Args:
        aircraft: states [coefficients], [geometry] and [mass].
        source: a line for the file's header.

    Raises:
        AircraftDataError: one of these is missing.
    """
    c = aircraft.need_coefficients(_PURPOSE)
    root = ET.Element("fdm_config", {"name": aircraft.name, "version": "2.0", "release": "BETA"})
    header = ET.SubElement(root, "fileheader")
    ET.SubElement(header, "description").text = " ".join(f"{source} {aircraft.description}".split())
    _metrics(root, aircraft)
    _balance(root, aircraft)
    ET.SubElement(root, "ground_reactions")
    _controls(root, aircraft)
    _thrust(root, aircraft.cg_shift_m)
    aerodynamics = ET.SubElement(root, "aerodynamics")
    _drag(aerodynamics, aircraft, c)
    _lift(aerodynamics, c)
    _side(aerodynamics, c)
    for axis, table, length in (("ROLL", "Cl", "bw"), ("PITCH", "Cm", "cbarw"), ("YAW", "Cn", "bw")):
        into = ET.SubElement(aerodynamics, "axis", {"name": axis})
        for key, value in getattr(c, table):
            _term(into, f"{table}_{key}", key, value, (*_FORCE, f"metrics/{length}-ft"))
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _point(parent: ET.Element, name: str, x: float) -> None:
    """A location; JSBSim's structural axes point aft and up."""
    place = ET.SubElement(parent, "location", {"name": name, "unit": "FT"})
    for letter, value in zip("xyz", (x / FT, 0.0, 0.0), strict=True):
        ET.SubElement(place, letter).text = repr(value)


def _metrics(root: ET.Element, aircraft: Aircraft) -> None:
    g = aircraft.need_geometry(_PURPOSE)
    metrics = ET.SubElement(root, "metrics")
    for tag, unit, value in (
        ("wingarea", "FT2", g.wing_area_m2), ("wingspan", "FT", g.span_m), ("chord", "FT", g.mean_chord_m),
        ("htailarea", "FT2", g.tail_area_m2), ("htailarm", "FT", g.tail_arm_m), ("vtailarea", "FT2", g.fin_area_m2),
        ("vtailarm", "FT", g.fin_arm_m),
    ):  # fmt: skip
        if value is not None:
            ET.SubElement(metrics, tag, {"unit": unit}).text = repr(value / (FT if unit == "FT" else FT**2))
    for name in ("AERORP", "EYEPOINT", "VRP"):
        _point(metrics, name, 0.0)


def _balance(root: ET.Element, aircraft: Aircraft) -> None:
    m = aircraft.need_mass(_PURPOSE)
    balance = ET.SubElement(root, "mass_balance", {"negated_crossproduct_inertia": "true"})
    for tag, value in (
        ("ixx", m.inertia_x_kg_m2), ("iyy", m.inertia_y_kg_m2), ("izz", m.inertia_z_kg_m2),
        ("ixz", -m.inertia_xz_kg_m2),
    ):  # fmt: skip
        ET.SubElement(balance, tag, {"unit": "SLUG*FT2"}).text = repr(value / (SLUG * FT**2))
    ET.SubElement(balance, "emptywt", {"unit": "LBS"}).text = repr(m.mass_kg / POUND)
    _point(balance, "CG", m.cg_shift_m)


def _controls(root: ET.Element, aircraft: Aircraft) -> None:
    control = ET.SubElement(root, "flight_control", {"name": aircraft.name})
    channel = ET.SubElement(control, "channel", {"name": "surfaces"})
    for surface, command, sign in (
        ("elevator", "elevator", 1.0), ("left-aileron", "aileron", 1.0), ("right-aileron", "aileron", -1.0),
        ("rudder", "rudder", 1.0),
    ):  # fmt: skip
        actuator = getattr(aircraft.actuators, command)
        travel = _TRAVEL_RAD if actuator is None else actuator.position_limit_rad or _TRAVEL_RAD
        gain = ET.SubElement(channel, "pure_gain", {"name": f"fcs/{surface}-servo"})
        ET.SubElement(gain, "input").text = f"fcs/{command}-cmd-norm"
        ET.SubElement(gain, "gain").text = repr(sign * travel)
        ET.SubElement(gain, "output").text = f"fcs/{surface}-pos-rad"


def _thrust(root: ET.Element, cg_m: float) -> None:
    force = ET.SubElement(
        ET.SubElement(root, "external_reactions"), "force", {"name": "thrust", "frame": "BODY"}
    )
    place, direction = ET.SubElement(force, "location", {"unit": "FT"}), ET.SubElement(force, "direction")
    for letter, at, along in zip("xyz", (cg_m / FT, 0.0, 0.0), ("1", "0", "0"), strict=True):
        ET.SubElement(place, letter).text = repr(at)
        ET.SubElement(direction, letter).text = along


def _product(parent: ET.Element, properties: tuple[str, ...], value: float | None = None) -> ET.Element:
    product = ET.SubElement(parent, "product")
    for name in properties:
        ET.SubElement(product, "property").text = name
    if value is not None:
        ET.SubElement(product, "value").text = repr(value)
    return product


def _term(parent: ET.Element, name: str, key: str, value: float, scales: tuple[str, ...]) -> None:
    """One coefficient times what it is proportional to; nothing where it is 0."""
    if value == 0.0:
        return
    turned = -value if key == "aileron" else value
    function = ET.SubElement(parent, "function", {"name": f"aero/force/{name}"})
    _product(function, (*scales, *_RATES.get(key, ())), turned)


def _drag(aerodynamics: ET.Element, aircraft: Aircraft, c: Coefficients) -> None:
    """The polar as a function of its own (the side force needs it, too), and drag's axis."""
    g = aircraft.need_geometry(_PURPOSE)
    induced = 1.0 / (math.pi * c.CD.oswald * aspect_ratio(g.span_m, g.wing_area_m2))
    function = ET.SubElement(aerodynamics, "function", {"name": "aero/coefficient/CD"})
    total = ET.SubElement(function, "sum")
    ET.SubElement(total, "value").text = repr(c.CD.min)
    parabola = ET.SubElement(total, "product")
    ET.SubElement(parabola, "value").text = repr(induced)
    power = ET.SubElement(parabola, "pow")
    line = ET.SubElement(power, "sum")
    ET.SubElement(line, "value").text = repr(c.CL.zero - c.CD.CL_at_min)
    _product(line, ("aero/alpha-rad",), c.CL.alpha)
    ET.SubElement(power, "value").text = "2"
    for surface in ("elevator", "aileron", "rudder"):
        value = getattr(c.CD, surface)
        if value:
            product = ET.SubElement(total, "product")
            ET.SubElement(product, "value").text = repr(value)
            size = ET.SubElement(product, "abs")
            ET.SubElement(size, "property").text = _RATES[surface][0]
    axis = ET.SubElement(aerodynamics, "axis", {"name": "DRAG"})
    _product(ET.SubElement(axis, "function", {"name": "aero/force/CD"}), (*_FORCE, "aero/coefficient/CD"))


def _lift(aerodynamics: ET.Element, c: Coefficients) -> None:
    axis = ET.SubElement(aerodynamics, "axis", {"name": "LIFT"})
    if c.stall is None:
        _term(axis, "CL_zero", "zero", c.CL.zero, _FORCE)
        _term(axis, "CL_alpha", "alpha", c.CL.alpha, _FORCE)
    else:
        product = _product(ET.SubElement(axis, "function", {"name": "aero/force/CL_static"}), _FORCE)
        table = ET.SubElement(product, "table")
        ET.SubElement(table, "independentVar").text = "aero/alpha-rad"
        rows = [f"{float(a)!r} {float(lift_coefficient(c, float(a)).real)!r}" for a in _STALL_ALPHAS]
        ET.SubElement(table, "tableData").text = "\n" + "\n".join(rows) + "\n"
    for key in ("q", "alphadot", "elevator"):
        _term(axis, f"CL_{key}", key, getattr(c.CL, key), _FORCE)


def _side(aerodynamics: ET.Element, c: Coefficients) -> None:
    """Side force along the wind's y; that of stability axes is along y body, so drag's share is added."""
    axis = ET.SubElement(aerodynamics, "axis", {"name": "SIDE"})
    for key, value in c.CY:
        _term(axis, f"CY_{key}", key, value, _FORCE)
    if c.force_axes == "stability":
        properties = (*_FORCE, "aero/coefficient/CD", "aero/beta-rad")
        _product(ET.SubElement(axis, "function", {"name": "aero/force/CY_drag"}), properties)
