"""Every finding of ``check_file`` is found where it is built in, and nothing is found in published aircraft."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from wingwatch.aircraft import (
    Aircraft,
    ConditionEntry,
    FlightCondition,
    Mass,
    check_file,
    library_names,
    load_aircraft,
)

HERON = Path(__file__).parents[2] / "docs" / "tutorial" / "heron.toml"
AEROSONDE = load_aircraft("aerosonde")
JETSTREAM = load_aircraft("jetstream31")


@pytest.mark.parametrize("name", [*library_names(), HERON], ids=str)
def test_nothing_is_implausible_in_published_aircraft(name: str | Path) -> None:
    found = check_file(load_aircraft(name))
    assert found.usable
    assert [f.text for f in found.findings] == []


def coefficient(**values: float) -> Aircraft:
    c = AEROSONDE.need_coefficients("a test")
    for name, value in values.items():
        c = c.with_value(name, value)
    return AEROSONDE.model_copy(update={"coefficients": c})


def scaled(name: str, factor: float) -> Aircraft:
    return coefficient(**{name: factor * dict(AEROSONDE.need_coefficients("a test").items())[name]})


def part(table: str, **values: Any) -> Aircraft:
    inner = getattr(AEROSONDE, table).model_copy(update=values)
    return AEROSONDE.model_copy(update={table: inner})


def stated(index: int = 0, **values: Any) -> Aircraft:
    """The Jetstream with other derivatives (value and standard error) or another airspeed."""
    entry: ConditionEntry = JETSTREAM.conditions[index]
    airspeed = values.pop("airspeed_true_m_s", entry.airspeed_true_m_s)
    moved = {
        symbol: entry.derivatives[symbol].model_copy(update={"value": value[0], "standard_error": value[1]})
        for symbol, value in values.items()
    }
    entry = entry.model_copy(
        update={"derivatives": {**entry.derivatives, **moved}, "airspeed_true_m_s": airspeed}
    )
    return JETSTREAM.model_copy(update={"conditions": (entry,)})


def propulsion(**values: Any) -> Aircraft:
    assert AEROSONDE.propulsion is not None
    return AEROSONDE.model_copy(update={"propulsion": AEROSONDE.propulsion.model_copy(update=values)})


def surely() -> Aircraft:
    errors = {"default": 0.0}
    c = AEROSONDE.need_coefficients("a test")
    c = c.model_copy(update={"relative_standard_error": errors, "standard_error_floor": errors})
    return AEROSONDE.model_copy(update={"coefficients": c})


def flown(cruise: float, low: float, high: float) -> Aircraft:
    return part("envelope", cruise_airspeed_true_m_s=cruise, airspeed_true_m_s=(low, high))


def slowly_rolling() -> Aircraft:
    """A roll mode that nothing else is coupled to, of 20 s."""
    mass = AEROSONDE.need_mass("a test").model_copy(update={"inertia_xz_kg_m2": 0.0})
    c = coefficient(Cl_p=-0.0012, Cl_beta=-1e-6, Cl_r=0.0, Cn_p=0.0)
    return c.model_copy(update={"mass": mass})


def travel(rad: float) -> Aircraft:
    elevator = AEROSONDE.actuators.elevator
    assert elevator is not None
    return part("actuators", elevator=elevator.model_copy(update={"position_limit_rad": rad}))


CASES: dict[str, tuple[Callable[[], Aircraft], str, str]] = {
    "span halved": (lambda: part("geometry", span_m=0.7), "aspect_ratio", "half of it"),
    "chord in cm": (lambda: part("geometry", mean_chord_m=19.0), "mean_chord", "all in m"),
    "tail in dm2": (lambda: part("geometry", tail_area_m2=10.0), "tail_area", "give m2"),
    "inertia impossible": (lambda: part("mass", inertia_z_kg_m2=3.0), "inertia_triangle", "no body has"),
    "mass in g": (lambda: part("mass", mass_kg=11000.0), "wing_loading", "not g or lb"),
    "roll inertia in lb ft2": (
        lambda: part("mass", inertia_x_kg_m2=0.8244 / 0.0421401), "radius_of_gyration_x", "looks like lb ft2",
    ),
    "pitch inertia in kg cm2": (
        lambda: part("mass", inertia_y_kg_m2=11350.0), "radius_of_gyration_y", "looks like kg cm2",
    ),
    "yaw inertia in kg cm2": (
        lambda: part("mass", inertia_z_kg_m2=17590.0), "radius_of_gyration_z", "looks like kg cm2",
    ),
    "travel in degrees": (lambda: travel(22.5), "surface_travel", "not degrees"),
    "noise in degrees": (
        lambda: part("sensors", noise_std={"roll_rad": 0.5}), "sensor_noise", "not degrees",
    ),
    "nothing expected": (
        lambda: Aircraft(format=1, name="empty"), "nothing_expected", "neither [coefficients] nor [[conditions]]",
    ),
    "unstable in pitch": (lambda: coefficient(Cm_alpha=0.4), "sign_of_Cm_alpha", "diverges in pitch"),
    "balanced behind the neutral point": (lambda: part("mass", cg_shift_m=0.15), "static_margin", "neutral point"),
    "unstable in yaw": (lambda: scaled("Cn_beta", -1.0), "sign_of_Cn_beta", "away from the wind"),
    "anhedral": (lambda: scaled("Cl_beta", -1.0), "sign_of_Cl_beta", "anhedral"),
    "side force": (lambda: scaled("CY_beta", -1.0), "sign_of_CY_beta", "from the left"),
    "undamped roll": (lambda: scaled("Cl_p", -1.0), "sign_of_Cl_p", "not damped"),
    "undamped pitch": (lambda: scaled("Cm_q", -1.0), "sign_of_Cm_q", "not damped"),
    "undamped yaw": (lambda: scaled("Cn_r", -1.0), "sign_of_Cn_r", "not damped"),
    "elevator turned": (lambda: scaled("Cm_elevator", -1.0), "sign_of_Cm_elevator", "turn the signs"),
    "aileron turned": (lambda: scaled("Cl_aileron", -1.0), "sign_of_Cl_aileron", "turn the signs"),
    "rudder turned": (lambda: scaled("Cn_rudder", -1.0), "sign_of_Cn_rudder", "turn the signs"),
    "lift slope per degree": (
        lambda: scaled("CL_alpha", 1.0 / math.degrees(1.0)), "lift_slope", "per degree, 5.61 per rad",
    ),
    "elevator per degree": (
        lambda: scaled("Cm_elevator", 1.0 / math.degrees(1.0)), "size_of_Cm_elevator", "it is -0.99 per rad",
    ),
    "damping times 57.3": (lambda: scaled("Cl_p", 57.3), "size_of_Cl_p", "converted twice"),
    "pitch damping of no tail": (lambda: coefficient(Cm_q=-1.2), "size_of_Cm_q", "without a tail"),
    "weak one huge": (lambda: coefficient(Cn_aileron=3.0), "size_of_Cn_aileron", "converted twice"),
    "errors of nothing": (surely, "standard_error", "an honest error"),
    "too slow": (lambda: flown(20.0, 14.0, 35.0), "envelope_stall", "raise it"),
    "slower than any flight": (
        lambda: flown(5.0, 5.0, 35.0), "level_flight", "no level",
    ),
    "too fast": (lambda: flown(200.0, 20.0, 300.0), "lift_coefficient", "airspeed in m/s"),
    "at its stall": (lambda: coefficient(CL_zero=-1.2), "stall_margin", "CL.zero"),
    "trim beyond travel": (lambda: coefficient(Cm_zero=1.2), "trim_elevator", "Cm.zero"),
    "no thrust": (lambda: propulsion(voltage_max_v=8.0), "trim_thrust", "no throttle"),
    "undamped short period": (
        lambda: coefficient(Cm_alpha=-60.0, CL_elevator=0.0, Cm_zero=3.0), "short_period_damping", "Cm.q",
    ),
    "undamped Dutch roll": (lambda: coefficient(Cn_r=0.2), "dutch_roll_damping", "Cn.r"),
    "slow roll": (slowly_rolling, "roll_time", "Cl.p"),
    "spiral": (lambda: coefficient(Cl_r=3.0), "spiral_doubling", "sooner than is usual"),
    "roots": (lambda: coefficient(Cn_beta=-0.3), "roots", "unlike an aeroplane's"),
    "stated sign": (lambda: stated(m_q=(1.5, 0.4)), "sign_of_m_q", "undamped"),
    "stated surface": (lambda: stated(n_zeta=(9.0, 2.7)), "sign_of_n_zeta", "derivatives by rudder"),
    "airspeed in kt": (lambda: stated(airspeed_true_m_s=170.0), "kinematic_part", "in m/s"),
    "stated error": (lambda: stated(m_q=(-1.547, 0.0001)), "standard_error", "an honest error"),
    "divergence of stated derivatives": (
        lambda: stated(m_w=(0.4, 0.1)), "short_period_divergence", "diverges in pitch",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_is_built_in_is_found(case: str) -> None:
    make, check, words = CASES[case]
    found = {f.check: f for f in check_file(make()).findings}
    assert check in found, found.keys()
    finding = found[check]
    assert words in finding.text
    assert "\n" not in finding.text
    assert not finding.low <= finding.value <= finding.high
    assert (finding.standing == "refusal") == (
        check in ("inertia_triangle", "nothing_expected", "level_flight")
    )


def test_a_file_without_an_envelope_says_what_was_not_looked_at() -> None:
    bare = AEROSONDE.model_copy(update={"envelope": None})
    assert any("--airspeed" in text for text in check_file(bare).not_checked)
    assert check_file(bare, FlightCondition(25.0, 1000.0)).not_checked == ()


def test_slugs_and_slug_feet_together_are_noticed_by_the_lift_coefficient() -> None:
    mass = AEROSONDE.need_mass("a test")
    inertias = {
        f"inertia_{axes}_kg_m2": getattr(mass, f"inertia_{axes}_kg_m2") / 1.35582 for axes in ("x", "y", "z")
    }
    moved = Mass(mass_kg=mass.mass_kg / 14.5939, **inertias)
    found = {f.check for f in check_file(AEROSONDE.model_copy(update={"mass": moved})).findings}
    assert "lift_coefficient" in found
