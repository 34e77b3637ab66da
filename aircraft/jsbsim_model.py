"""A JSBSim aircraft's aerodynamics, mass and geometry, asked of JSBSim itself: forces and moments at chosen states.

What stands between a pilot and the air is taken off the description before it is loaded: engines (a force along x body
through the centre of gravity takes their place), flight control system, gear, systems. Everything in <aerodynamics>
(tables, functions, products, hysteresis) is worked out by JSBSim. Mass, inertias and centre of gravity are those of the
whole description with its fuel, where JSBSim can load that.
"""

import io
import math
import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.aircraft_file import Geometry, Mass

__all__ = ["FT", "SLUG", "JsbsimError", "JsbsimModel"]

Array = NDArray[np.float64]

FT, SLUG, LBF, INCH = 0.3048, 14.59390293720636, 4.4482216152605, 0.0254
_KEPT = ("metrics", "mass_balance", "aerodynamics", "fileheader")
_PASSES = 4
"""Evaluations until alphadot, which JSBSim takes from the pass before, has settled."""
_MOST_BYTES = 20_000_000
_NAME = "wingwatch"
_SURFACES = ("elevator", "left-aileron", "right-aileron", "rudder")
_TRAVEL_RAD = 0.35
"""Of a surface whose travel the description does not say: what a normalised position of 1 is taken for."""


class JsbsimError(ValueError):
    """A JSBSim description that cannot be used; one sentence."""


@contextmanager
def _quiet() -> Iterator[None]:
    """JSBSim says what it dislikes on Python's standard output and error; here it is silent."""
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        yield


def _engine() -> Any:
    os.environ.setdefault("JSBSIM_DEBUG", "0")  # it greets on standard output otherwise
    try:
        import jsbsim
    except ImportError:
        raise JsbsimError(
            "reading a JSBSim aircraft needs JSBSim itself, which is not installed; "
            "install wingwatch with its extra jsbsim"
        ) from None
    return jsbsim


class JsbsimModel:
    """One description, loaded.

    Args:
        path: the aircraft's XML file (``<fdm_config>``).

    Attributes:
        notes: what was assumed, one sentence each.

    Raises:
        JsbsimError: JSBSim is not installed, or the file is none that it loads.
    """

    def __init__(self, path: Path) -> None:
        self.notes: list[str] = []
        self._path, self._jsbsim = path, _engine()
        tree = _parsed(path)
        self._travel = {surface: _travel(tree, surface) for surface in _SURFACES}
        whole = self._whole(path)
        stripped = self._stripped(tree, whole)
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / _NAME).mkdir()
            ET.ElementTree(stripped).write(Path(folder) / _NAME / f"{_NAME}.xml")
            fdm = self._jsbsim.FGFDMExec(None)
            fdm.set_debug_level(0)
            fdm.set_aircraft_path(folder)
            with _quiet():
                loaded = _loads(fdm, _NAME)
            if not loaded:
                raise JsbsimError(
                    f"{path}: JSBSim does not load its <metrics>, <mass_balance> and <aerodynamics>; "
                    "run JSBSim on the file to see its own message"
                )
        self._fdm = fdm

    def _whole(self, path: Path) -> Mapping[str, float] | None:
        """Mass properties of the whole description with its fuel, None where JSBSim does not load it."""
        fdm = self._jsbsim.FGFDMExec(None)
        fdm.set_debug_level(0)
        folder = path.resolve().parent
        engines = folder / "Engines"
        if not engines.is_dir():
            engines = Path(self._jsbsim.get_default_root_dir()) / "engine"
        with tempfile.TemporaryDirectory() as temporary, _quiet():
            _beside(path, Path(temporary) / path.stem)
            fdm.set_aircraft_path(temporary)
            fdm.set_engine_path(str(engines))
            loaded = _loads(fdm, path.stem)
        if not loaded:
            self.notes.append(
                "mass, inertias and centre of gravity are without fuel: JSBSim does not load the whole file"
            )
            return None
        names = (
            "mass-slugs",
            "ixx-slugs_ft2",
            "iyy-slugs_ft2",
            "izz-slugs_ft2",
            "ixz-slugs_ft2",
            "cg-x-in",
            "cg-z-in",
        )
        return {name: float(fdm.get_property_value(f"inertia/{name}")) for name in names}

    def _stripped(self, tree: ET.Element, whole: Mapping[str, float] | None) -> ET.Element:
        out = ET.Element("fdm_config", {**tree.attrib, "name": _NAME})
        for tag in _KEPT:
            for element in tree.findall(tag):
                out.append(element)
        for tag in ("metrics", "mass_balance", "aerodynamics"):
            if out.find(tag) is None:
                raise JsbsimError(f"{self._path} has no <{tag}>; give the aircraft's own XML file")
        balance = out.find("mass_balance")
        assert balance is not None
        if whole is not None:
            _set_mass(balance, whole)
        centre = balance.find("location[@name='CG']")
        if centre is None:
            raise JsbsimError(f"{self._path}: its <mass_balance> has no location named CG; state one")
        ET.SubElement(out, "ground_reactions")
        control = ET.SubElement(out, "flight_control", {"name": "none"})
        for absent in sorted(self._unknown(out)):
            ET.SubElement(control, "property", {"value": "0"}).text = absent
        forces = ET.SubElement(out, "external_reactions")
        for name, axis in (("thrust", "x"), ("push", "z")):
            force = ET.SubElement(forces, "force", {"name": name, "frame": "BODY"})
            place = ET.SubElement(force, "location", {"unit": centre.get("unit", "IN")})
            direction = ET.SubElement(force, "direction")
            for letter in "xyz":
                ET.SubElement(place, letter).text = centre.findtext(letter)
                ET.SubElement(direction, letter).text = "1" if letter == axis else "0"
        return out

    def _unknown(self, tree: ET.Element) -> set[str]:
        """Properties that the aerodynamics ask for and only what was taken off would set."""
        fdm = self._jsbsim.FGFDMExec(None)
        fdm.set_debug_level(0)
        manager = fdm.get_property_manager()
        names = {
            (e.text or "").strip() for tag in ("property", "independentVar", "p") for e in tree.iter(tag)
        }
        made = {f.get("name", "") for f in tree.iter("function")}
        names = {n.lstrip("-") for n in names if n} - made
        unknown = {n for n in names if not manager.hasNode(n)}
        for name in sorted(unknown):
            self.notes.append(f"{name} is taken as 0: a system sets it that is left out")
        return unknown

    def __getitem__(self, name: str) -> float:
        return float(self._fdm.get_property_value(name))

    @property
    def geometry(self) -> Geometry:
        """Reference dimensions; the tail's where the description states them."""

        def positive(name: str, unit: float) -> float | None:
            value = self[f"metrics/{name}"] * unit
            return value if value > 0.0 else None

        area, span, chord = positive("Sw-sqft", FT**2), positive("bw-ft", FT), positive("cbarw-ft", FT)
        if area is None or span is None or chord is None:
            raise JsbsimError(
                f"{self._path}: <metrics> states no wingarea, wingspan or chord; state all three"
            )
        return Geometry(
            wing_area_m2=area, span_m=span, mean_chord_m=chord, tail_area_m2=positive("Sh-sqft", FT**2),
            tail_arm_m=positive("lh-ft", FT), fin_area_m2=positive("Sv-sqft", FT**2), fin_arm_m=positive("lv-ft", FT),
        )  # fmt: skip

    @property
    def mass(self) -> Mass:
        """Mass and moments of inertia about the centre of gravity; raises JsbsimError where one is not stated."""
        x, y, z, xz = (self[f"inertia/i{axes}-slugs_ft2"] * SLUG * FT**2 for axes in ("xx", "yy", "zz", "xz"))
        mass = self["inertia/mass-slugs"] * SLUG
        if not min(x, y, z, mass) > 0.0:
            raise JsbsimError(
                f"{self._path}: <mass_balance> states no emptywt or no ixx, iyy, izz; state all four"
            )
        return Mass(
            mass_kg=mass, inertia_x_kg_m2=x, inertia_y_kg_m2=y, inertia_z_kg_m2=z,
            inertia_xz_kg_m2=-xz,  # JSBSim keeps the tensor's element
        )  # fmt: skip

    def _set_surfaces(self, elevator: float, aileron: float, rudder: float) -> None:
        angles = {"elevator": elevator, "left-aileron": -aileron, "right-aileron": aileron, "rudder": rudder}
        for surface, angle in angles.items():
            for form, value in (
                ("rad", angle), ("deg", math.degrees(angle)), ("norm", angle / self._travel[surface]),
            ):  # fmt: skip
                self._fdm.set_property_value(f"fcs/{surface}-pos-{form}", value)
        self._fdm.set_property_value("fcs/aileron-pos-rad", aileron)

    def put(
        self, motion: Array, altitude_m: float, surfaces: Array, thrust_n: float, push_n: float = 0.0
    ) -> tuple[Array, Array]:
        """JSBSim at one state, wings level, pitch attitude as the angle of attack, time held still.

        Args:
            motion: u, v, w in m/s and p, q, r in rad/s, shape (6,).
            altitude_m: above the sea.
            surfaces: elevator, aileron, rudder as JSBSim counts them, rad, shape (3,).
            thrust_n: along x body, through the centre of gravity.
            push_n: along z body, through the centre of gravity.

        Returns:
            Aerodynamic forces in N and moments about the centre of gravity in N m, body axes, shape (6,); accelerations
            of u, v, w in m/s2 and of p, q, r in rad/s2, shape (6,).
        """
        fdm = self._fdm
        for axis, value in zip("uvw", motion[:3].tolist(), strict=True):
            fdm.set_property_value(f"ic/{axis}-fps", value / FT)
        for axis, value in zip("pqr", motion[3:].tolist(), strict=True):
            fdm.set_property_value(f"ic/{axis}-rad_sec", value)
        for angle, value in (("theta", math.atan2(motion[2], motion[0])), ("phi", 0.0), ("psi-true", 0.0)):
            fdm.set_property_value(f"ic/{angle}-rad", value)
        fdm.set_property_value("ic/h-sl-ft", altitude_m / FT)
        self._set_surfaces(*surfaces.tolist())
        fdm.set_property_value("external_reactions/thrust/magnitude", thrust_n / LBF)
        fdm.set_property_value("external_reactions/push/magnitude", push_n / LBF)
        fdm.run_ic()
        self._set_surfaces(*surfaces.tolist())
        fdm.suspend_integration()
        for _ in range(_PASSES):
            fdm.run()
        fdm.resume_integration()
        forces = [self[f"forces/fb{a}-aero-lbs"] * LBF for a in "xyz"]
        moments = [self[f"moments/{a}-aero-lbsft"] * LBF * FT for a in "lmn"]
        rates = [self[f"accelerations/{a}dot-ft_sec2"] * FT for a in "uvw"]
        rates += [self[f"accelerations/{a}dot-rad_sec2"] for a in "pqr"]
        return np.array(forces + moments), np.array(rates)


def _parsed(path: Path) -> ET.Element:
    """The description, with parts that stand in files of their own put in."""
    tree = _xml(path)
    if tree.tag != "fdm_config":
        raise JsbsimError(
            f"{path} is <{tree.tag}>, not JSBSim's <fdm_config>; give the aircraft's own XML file"
        )
    for i, element in enumerate(list(tree)):
        other = element.get("file")
        if other and element.tag in _KEPT:
            inner = path.parent / other
            inner = inner if inner.suffix else inner.with_suffix(".xml")
            tree[i] = _xml(inner)
    return tree


def _xml(path: Path) -> ET.Element:
    try:
        with path.open("rb") as stream:
            raw = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise JsbsimError(f"{path} cannot be read: {(error.strerror or 'no such file').lower()}") from None
    if len(raw) > _MOST_BYTES:
        raise JsbsimError(
            f"{path} has more than {_MOST_BYTES} bytes, which no JSBSim aircraft has; give its own XML"
        )
    if b"<!ENTITY" in raw:
        raise JsbsimError(f"{path} declares entities, which are not read; remove them")
    try:
        return ET.fromstring(raw)
    except ET.ParseError as error:
        raise JsbsimError(f"{path} is not XML: {error}; give JSBSim's aircraft file") from None


def _beside(path: Path, folder: Path) -> None:
    """The description without what it writes or listens to, in a new folder with links to what stands beside it."""
    tree = _xml(path)
    for tag in ("output", "input"):
        for element in tree.findall(tag):
            tree.remove(element)
    folder.mkdir()
    for other in path.resolve().parent.iterdir():
        if other.name != path.name:
            (folder / other.name).symlink_to(other)
    ET.ElementTree(tree).write(folder / path.name)


def _loads(fdm: Any, name: str) -> bool:
    """Whether JSBSim loads an aircraft of its path and puts it at its initial conditions."""
    try:
        return bool(fdm.load_model(name)) and bool(fdm.run_ic())
    except Exception:  # JSBSim's own classes, one for each way a file can be wrong
        return False


def _travel(tree: ET.Element, surface: str) -> float:
    """What a normalised position of 1 means, rad: the largest end of a <range> that ends in that surface's position."""
    best = 0.0
    for component in tree.iter():
        output = (component.findtext("output") or "").strip()
        span = component.find("range")
        if span is None or not output.startswith(f"fcs/{surface}-pos"):
            continue
        ends = [span.findtext(end) or "0" for end in ("min", "max")]
        try:
            size = max(abs(float(end)) for end in ends)
        except ValueError:
            continue
        best = max(best, math.radians(size) if output.endswith("-deg") else size)
    return best if 0.0 < best < 1.6 else _TRAVEL_RAD


def _set_mass(balance: ET.Element, whole: Mapping[str, float]) -> None:
    for tag in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz", "emptywt", "pointmass", "location"):
        for element in balance.findall(tag):
            balance.remove(element)
    balance.set("negated_crossproduct_inertia", "true")
    for axes in ("xx", "yy", "zz", "xz"):
        ET.SubElement(balance, f"i{axes}", {"unit": "SLUG*FT2"}).text = repr(whole[f"i{axes}-slugs_ft2"])
    ET.SubElement(balance, "emptywt", {"unit": "KG"}).text = repr(whole["mass-slugs"] * SLUG)
    centre = ET.SubElement(balance, "location", {"name": "CG", "unit": "IN"})
    for letter, value in (("x", whole["cg-x-in"]), ("y", 0.0), ("z", whole["cg-z-in"])):
        ET.SubElement(centre, letter).text = repr(value)
