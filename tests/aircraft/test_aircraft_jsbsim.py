"""Aircraft files to JSBSim and back, and what JSBSim makes of them: signs and units are those of both."""

import math
from pathlib import Path

import numpy as np
import pytest

from wingwatch.aircraft import FlightCondition, jsbsim_aircraft, jsbsim_xml, load_aircraft, trim
from wingwatch.aircraft.jsbsim_model import JsbsimModel

CONDITIONS = {
    "aerosonde": FlightCondition(25.0, 1000.0),
    "aerosonde-a": FlightCondition(25.0, 1000.0),
    "twinotter": FlightCondition(65.0, 1500.0),
    "ultrastick25e": FlightCondition(17.0, 300.0),
}


def written(name: str, folder: Path) -> Path:
    path = folder / name / f"{name}.xml"
    path.parent.mkdir()
    path.write_text(jsbsim_xml(load_aircraft(name)))
    return path


@pytest.mark.parametrize("name", CONDITIONS)
def test_what_jsbsim_feels_of_a_written_aircraft_is_what_the_file_says(name: str, tmp_path: Path) -> None:
    """Force axes, reference point, alphadot and every sign: read back by differences of JSBSim's own forces."""
    aircraft, condition = load_aircraft(name), CONDITIONS[name]
    back, notes = jsbsim_aircraft(written(name, tmp_path), name, condition)
    assert notes == []
    mass, said = back.need_mass("a test"), aircraft.need_mass("a test")
    for key in ("mass_kg", "inertia_x_kg_m2", "inertia_y_kg_m2", "inertia_z_kg_m2", "inertia_xz_kg_m2"):
        assert getattr(mass, key) == pytest.approx(getattr(said, key), rel=1e-6), key
    geometry = aircraft.need_geometry("a test")
    assert back.need_geometry("a test").mean_chord_m == pytest.approx(geometry.mean_chord_m)
    c, read = aircraft.need_coefficients("a test"), back.need_coefficients("a test")
    at = trim(aircraft, condition)
    side = c.CY.beta - (
        at.drag_coefficient if c.force_axes == "wind" else 0.0
    )  # stability axes leave drag out
    expected = {**dict(c.items()), "CY_beta": side}
    for key, value in read.items():
        if key.startswith("CD_") or key.endswith("_zero"):
            continue
        assert value == pytest.approx(expected[key], rel=2e-3, abs=2e-4), key
    again = trim(back, condition)
    assert again.angle_of_attack_rad == pytest.approx(at.angle_of_attack_rad, abs=1e-3)
    assert again.elevator_rad == pytest.approx(at.elevator_rad, abs=2e-3)
    assert again.drag_coefficient == pytest.approx(at.drag_coefficient, rel=0.01)


def test_a_positive_deflection_gives_a_negative_response_in_jsbsim(tmp_path: Path) -> None:
    model = JsbsimModel(written("aerosonde", tmp_path))
    level = np.array([25.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    still = model.put(level, 1000.0, np.zeros(3), 10.0)[0]
    for i, moment in enumerate((4, 3, 5)):
        assert model.put(level, 1000.0, 0.1 * np.eye(3)[i], 10.0)[0][moment] < still[moment]
    assert math.isclose(model["inertia/mass-slugs"] * 14.59390293720636, 11.0, rel_tol=1e-6)
