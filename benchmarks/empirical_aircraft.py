"""How well dimensions alone tell an aircraft's coefficients: the errors of `wingwatch aircraft new`.

    .venv/bin/python benchmarks/empirical_aircraft.py [--json] [--flights 0]

Reference aircraft: those of the library with coefficients (one Aerosonde), and straight-winged ones that come with
JSBSim whose coefficients are their own, linearised at a lift coefficient of 0.45 (``jsbsim_reading``). Left out are
JSBSim's jets with swept wings and what its generator Aeromatic has filled in (no side force by rudder, Cl_p of -0.4
for all), which is empirical itself. A coefficient that a set has as 0 is not modelled there and does not count.

Prints, for ``wingwatch.aircraft.empirical``: means of what no formula gives; root mean square of truth over formula
less one, with the tail stated and without; scatter of coefficients about their means; for an aircraft made like
another, root mean square of what two aircraft differ by. Then the Aerosonde beside a file from its dimensions:
derivatives outside their 95 % intervals, and alerts of healthy flights monitored with that file (``--flights``).
"""

import argparse
import contextlib
import io
import json
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import jsbsim
import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import (
    GRAVITY_M_S2,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    Dimensions,
    FlightCondition,
    Geometry,
    aircraft_toml,
    derivative_standard_errors,
    empirical,
    empirical_aircraft,
    linearised_derivatives,
    load_aircraft,
    trim,
)
from wingwatch.aircraft.jsbsim_model import JsbsimModel
from wingwatch.aircraft.jsbsim_reading import jsbsim_aircraft
from wingwatch.aircraft.plausible_file import radii_of_gyration
from wingwatch.cli.main import main as main_command

LIBRARY = ("aerosonde", "twinotter", "ultrastick25e")
BUNDLED = ("c172p", "c182", "c310", "J3Cub", "L17", "pa28", "pc7", "SGS", "T37", "fokker50")
Z_95 = 1.96
CRUISE = FlightCondition(25.0, 1000.0)
LIFT_COEFFICIENT = 0.45
ALTITUDE_M = 1000.0
LEAST = 1e-6
"""Rounding of differences: what is smaller is 0."""
MEANS = (
    "CL_zero", "CD_min", "CD_oswald", "CY_p", "CY_aileron", "Cl_beta", "Cl_aileron", "Cl_rudder", "Cn_aileron",
)  # fmt: skip
"""What no formula gives."""
WEAK = ("Cl_beta", "CL_zero", "CY_p", "CY_aileron", "Cl_r", "Cl_rudder", "Cn_p", "Cn_aileron", "CL_elevator")
"""Of either sign or next to nothing in some aircraft: their errors are absolute."""
SKIPPED = ("CL_alphadot", "Cm_alphadot", "Cm_zero", "CD_CL_at_min", "CD_elevator", "CD_aileron", "CD_rudder")
"""Not modelled in most sets, or a matter of the trim."""


@dataclass(frozen=True)
class Known:
    """An aircraft whose coefficients are known, and its lift coefficient there."""

    name: str
    aircraft: Aircraft
    lift_coefficient: float

    @property
    def geometry(self) -> Geometry:
        """Of the aircraft."""
        return self.aircraft.need_geometry("the comparison")

    @property
    def truth(self) -> dict[str, float]:
        """Its coefficients by name."""
        return dict(self.aircraft.need_coefficients("the comparison").items())


def bundled_path(name: str) -> Path:
    return Path(jsbsim.get_default_root_dir()) / "aircraft" / name / f"{name}.xml"


@cache
def known() -> tuple[Known, ...]:
    """The reference aircraft."""
    out = []
    for name in LIBRARY:
        aircraft = load_aircraft(name)
        if name == "twinotter":  # tail and fin as JSBSim's own has them
            tail = JsbsimModel(bundled_path("DHC6")).geometry.model_dump(
                exclude={"wing_area_m2", "span_m", "mean_chord_m"}
            )
            geometry = aircraft.need_geometry("").model_copy(update=tail)
            aircraft = aircraft.model_copy(update={"geometry": geometry})
        cruise = aircraft.envelope.cruise if aircraft.envelope else FlightCondition(25.0, ALTITUDE_M)
        out.append(Known(name, aircraft, trim(aircraft, cruise).lift_coefficient))
    for name in BUNDLED:
        model = JsbsimModel(bundled_path(name))
        weight, area = model.mass.mass_kg * GRAVITY_M_S2, model.geometry.wing_area_m2
        density = FlightCondition(1.0, ALTITUDE_M).air_density_kg_m3
        speed = math.sqrt(2.0 * weight / (density * area * LIFT_COEFFICIENT))
        condition = FlightCondition(speed, ALTITUDE_M)
        out.append(
            Known(name, jsbsim_aircraft(bundled_path(name), name.lower(), condition)[0], LIFT_COEFFICIENT)
        )
    return tuple(out)


def typical() -> dict[str, float]:
    """Means of what no formula gives; the static margin's too."""
    means = {}
    for name in MEANS:
        values = [k.truth[name] for k in known() if abs(k.truth[name]) > LEAST]
        means[name] = float(np.mean(values))
    margins = [-k.truth["Cm_alpha"] / k.truth["CL_alpha"] for k in known()]
    return {**means, "static_margin": float(np.mean(margins))}


def typical_tail() -> dict[str, float]:
    """Mean tail and fin area over the wing's, and arm over the span, of those that state them."""
    stated = [k.geometry for k in known() if empirical.has_tail(k.geometry)]
    return {
        "tail_area": float(np.mean([(g.tail_area_m2 or 0.0) / g.wing_area_m2 for g in stated])),
        "fin_area": float(np.mean([(g.fin_area_m2 or 0.0) / g.wing_area_m2 for g in stated])),
        "arm": float(np.mean([(g.tail_arm_m or 0.0) / g.span_m for g in stated])),
    }


def radii() -> dict[str, float]:
    """Mean radii of gyration over the span."""
    every = [radii_of_gyration(k.aircraft.need_mass(""), k.geometry.span_m) for k in known()]
    return dict(zip("xyz", np.mean(every, axis=0).tolist(), strict=True))


def inertia_errors() -> dict[str, float]:
    """Root mean square of said over true moment of inertia less one: moments over inertias err by that."""
    every = [radii_of_gyration(k.aircraft.need_mass(""), k.geometry.span_m) for k in known()]
    said = np.array([empirical.RADII_OVER_SPAN[axis] for axis in "xyz"])
    missed = (said / np.array(every)) ** 2 - 1.0
    return dict(zip("xyz", np.sqrt(np.mean(missed**2, axis=0)).tolist(), strict=True))


def inertia_likeness() -> dict[str, float]:
    """Root mean square over all pairs of what moments of inertia over mass and span squared differ by."""
    every = np.array([radii_of_gyration(k.aircraft.need_mass(""), k.geometry.span_m) for k in known()])
    pairs = np.array([(a / b) ** 2 - 1.0 for i, a in enumerate(every) for k, b in enumerate(every) if i != k])
    return dict(zip("xyz", np.sqrt(np.mean(pairs**2, axis=0)).tolist(), strict=True))


def bare(geometry: Geometry) -> Geometry:
    return Geometry(
        wing_area_m2=geometry.wing_area_m2, span_m=geometry.span_m, mean_chord_m=geometry.mean_chord_m
    )


def ratios(with_tail: bool) -> dict[str, list[float]]:
    """Truth over formula by coefficient, an aircraft each."""
    found: dict[str, list[float]] = {}
    for one in known():
        if with_tail and not empirical.has_tail(one.geometry):
            continue
        geometry = one.geometry if with_tail else bare(one.geometry)
        said = empirical.empirical_values(geometry, one.lift_coefficient)
        for name, value in said.items():
            if name not in (*MEANS, *WEAK, *SKIPPED) and abs(one.truth[name]) > LEAST:
                found.setdefault(name, []).append(one.truth[name] / value)
    return found


def formula_errors(with_tail: bool) -> dict[str, float]:
    """Root mean square of truth over formula less one, by coefficient."""
    every = sorted(ratios(with_tail).items())
    return {name: math.sqrt(float(np.mean((np.array(r) - 1.0) ** 2))) for name, r in every}


def covered(with_tail: bool) -> tuple[int, int]:
    """How many of the coefficients lie within 1.96 of those errors, linear as an aircraft file has them."""
    every, errors = ratios(with_tail), formula_errors(with_tail)
    inside = [abs(r - 1.0) <= 1.96 * errors[name] for name, found in every.items() for r in found]
    return sum(inside), len(inside)


def absolute_errors() -> dict[str, float]:
    """Root mean square of truth less what the module says, of means and weak coefficients."""
    out = {}
    for name in sorted({*MEANS, *WEAK}):
        missed = []
        for one in known():
            if abs(one.truth[name]) <= LEAST:
                continue
            said = empirical.empirical_values(bare(one.geometry), one.lift_coefficient)
            missed.append(one.truth[name] - said[name])
        out[name] = math.sqrt(float(np.sum(np.square(missed))) / (len(missed) - 1))
    return out


def likeness(differ: Callable[[float, float], float], names: Sequence[str]) -> dict[str, float]:
    """Root mean square over all pairs of what two aircraft differ by."""
    out = {}
    for name in sorted(names):
        values = [k.truth[name] for k in known() if abs(k.truth[name]) > LEAST]
        pairs = [differ(a, b) for i, a in enumerate(values) for k, b in enumerate(values) if i != k]
        out[name] = math.sqrt(float(np.mean(np.square(pairs))))
    return out


def tables() -> dict[str, Mapping[str, float]]:
    """Everything that ``wingwatch.aircraft.empirical`` has from here."""
    strong = list(formula_errors(False)) + [n for n in MEANS if n not in WEAK]
    return {
        "TYPICAL": typical(),
        "TYPICAL_TAIL": typical_tail(),
        "RADII_OVER_SPAN": radii(),
        "INERTIA_ERRORS": inertia_errors(),
        "LIKENESS_INERTIA_ERRORS": inertia_likeness(),
        "ERRORS_BY_TAIL[True]": formula_errors(True),
        "ERRORS_BY_TAIL[False]": formula_errors(False),
        "TYPICAL_ERRORS": absolute_errors(),
        "LIKENESS_ERRORS": likeness(lambda a, b: a / b - 1.0, strong),
        "LIKENESS_FLOORS": likeness(lambda a, b: a - b, WEAK),
    }


def from_dimensions(with_inertias: bool) -> Aircraft:
    """The Aerosonde as a file from its span, area, chord and mass, on request with its moments of inertia."""
    aircraft = load_aircraft("aerosonde")
    mass = aircraft.need_mass("a comparison")
    stated = (mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2)
    inertias = stated if with_inertias else (None, None, None, None)
    geometry = aircraft.need_geometry("a comparison")
    known = Dimensions("empirical", geometry, mass.mass_kg, inertias, CRUISE.airspeed_true_m_s, ALTITUDE_M)
    return empirical_aircraft(known)


def aerosonde_scores(with_inertias: bool) -> dict[str, float]:
    """True less said over the stated error, by derivative of the short period and the lateral motion.

    y_p is left out: it is the trim's own w, which every flight measures.
    """
    aircraft, made = load_aircraft("aerosonde"), from_dimensions(with_inertias)
    out: dict[str, float] = {}
    for structure in (SHORT_PERIOD, LATERAL):
        truth, said = (linearised_derivatives(a, CRUISE, structure) for a in (aircraft, made))
        errors = derivative_standard_errors(made, CRUISE, structure)
        out |= {s: (truth[s] - said[s]) / errors[s] for s in structure.derivatives if s != "y_p"}
    return out


def alerts(aircraft: Aircraft, turbulence: str, seed: int) -> list[str]:
    """Texts of the alerts of 150 s of healthy flight of the true Aerosonde, monitored with an aircraft file."""
    with tempfile.TemporaryDirectory() as folder:
        file, flight = Path(folder) / "a.toml", Path(folder) / "flight.parquet"
        file.write_text(aircraft_toml(aircraft))
        fly = ["simulate", "--aircraft", "aerosonde", "--seconds", "150", "--seed", str(seed), "--json"]
        spoken = io.StringIO()
        with contextlib.redirect_stdout(io.StringIO()):
            main_command([*fly, "--turbulence", turbulence, "--out", str(flight)])
        with contextlib.redirect_stdout(spoken):
            main_command(["monitor", str(flight), "--aircraft", str(file), "--json"])
    return [alert["text"] for alert in json.loads(spoken.getvalue())["alerts"]]


def rounded(values: Mapping[str, float]) -> dict[str, float]:
    """To two digits, as the module has them."""
    return {name: float(f"{value:.2g}") for name, value in values.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description="Errors of coefficients from dimensions.")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    parser.add_argument(
        "--flights", type=int, default=0, help="monitored flights of the Aerosonde, of each air"
    )
    chosen = parser.parse_args()
    # Errors are of the means that stand in the module: after a change of those, run it twice.
    found = {name: rounded(values) for name, values in tables().items()}
    if chosen.json:
        print(json.dumps(found))
        return 0
    print(f"{len(known())} aircraft: {', '.join(k.name for k in known())}")
    for with_tail in (True, False):
        inside, of = covered(with_tail)
        print(f"tail {'stated' if with_tail else 'not stated'}: {inside} of {of} inside their 95 % interval")
    for name, values in found.items():
        print(f"{name} = {{")
        for key, value in values.items():
            print(f'    "{key}": {value:g},')
        print("}")
    for with_inertias in (False, True):
        scores = aerosonde_scores(with_inertias)
        beyond = {s: round(z, 1) for s, z in scores.items() if abs(z) > Z_95}
        words = "stated" if with_inertias else "by radii of gyration"
        inside = len(scores) - len(beyond)
        print(f"Aerosonde, inertias {words}: {inside} of {len(scores)} inside 95 %, beyond: {beyond}")
        for air in ("none", "light", "moderate"):
            raised = [alerts(from_dimensions(with_inertias), air, seed) for seed in range(chosen.flights)]
            if raised:
                some = sum(map(bool, raised))
                print(f"  {some} of {len(raised)} healthy flights in air {air} with an alert: {raised}")
    return 0


if __name__ == "__main__":
    run_benchmark(main)
