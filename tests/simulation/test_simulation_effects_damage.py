"""Lost wings and moved masses, held to strips, rods and points that are added up one by one."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.aircraft import (
    GRAVITY_M_S2,
    SHORT_PERIOD,
    FlightCondition,
    body_coefficients,
    load_aircraft,
)
from wingwatch.simulation import (
    CgShift,
    Effect,
    MassInertia,
    ThrustEffect,
    WingDamage,
    linearise,
    trim,
)
from wingwatch.simulation.effects import parameters_under
from wingwatch.simulation.effects.wing_damage import (
    AILERON_INNER_END,
    WING_SHARE_OF_DRAG_MIN,
    WING_SHARE_OF_MASS,
)
from wingwatch.simulation.layout import PARAMETERS, parameter_row

AEROSONDE = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0)
SPAN, AREA, CHORD = 2.8956, 0.55, 0.18994
STRIPS = 2000
"""Boundaries at tenths of the semi-span fall between strips; the middle rule errs by 1/(3 STRIPS^2) in y^2."""


def under(*effects: Effect) -> dict[str, float]:
    row = parameters_under(AEROSONDE, CONDITION, effects, 0.0)
    return dict(zip(PARAMETERS, row.tolist(), strict=True))


CLEAN = dict(zip(PARAMETERS, parameter_row(AEROSONDE).tolist(), strict=True))
LEVEL_CL = CLEAN["mass_kg"] * GRAVITY_M_S2 / (CONDITION.dynamic_pressure_pa * AREA)
LEVEL_ALPHA = (LEVEL_CL - CLEAN["CL_zero"]) / CLEAN["CL_alpha"]
INDUCED = 1.0 / (math.pi * CLEAN["CD_oswald"] * SPAN**2 / AREA)


@dataclass(frozen=True)
class Strips:
    """A wing of strips, without those of the lost part."""

    fraction: float = 0.0
    side: float = 1.0

    @property
    def y(self) -> NDArray[np.float64]:
        y = (np.arange(STRIPS) + 0.5) / STRIPS * SPAN - 0.5 * SPAN
        return y[self.side * y < 0.5 * SPAN * (1.0 - self.fraction)]

    def coefficients(
        self,
        alpha: float = LEVEL_ALPHA,
        roll_rate: float = 0.0,
        yaw_rate: float = 0.0,
        beta: float = 0.0,
        aileron: float = 0.0,
    ) -> dict[str, float]:
        """CL, CD (of the wing), Cl and Cn; rates times b/2V, dihedral 1, the aileron's lift slope 1."""
        eta = self.y / (0.5 * SPAN)
        local = alpha + roll_rate * eta + beta * np.sign(eta)
        pressure = (1.0 - yaw_rate * eta) ** 2
        lift = pressure * (CLEAN["CL_zero"] + CLEAN["CL_alpha"] * local)
        lift = lift + aileron * np.sign(eta) * (np.abs(eta) > AILERON_INNER_END)
        drag = (
            WING_SHARE_OF_DRAG_MIN * CLEAN["CD_min"]
            + INDUCED * (CLEAN["CL_zero"] + CLEAN["CL_alpha"] * alpha) ** 2
        )
        return {
            "CL": lift.sum() / STRIPS,
            "CD": (pressure * drag).sum() / STRIPS,
            "Cl": -(lift * eta).sum() / (2 * STRIPS),
            "Cn": (pressure * drag * eta).sum() / (2 * STRIPS),
        }

    def slope(self, table: str, **by: float) -> float:
        """d(table)/d(what is named), by central differences of the size given."""
        (name, step), base = next(iter(by.items())), LEVEL_ALPHA if "alpha" in by else 0.0
        sides = [self.coefficients(**{name: base + sign * step})[table] for sign in (1.0, -1.0)]
        return (sides[0] - sides[1]) / (2.0 * step)


def close(value: float) -> object:
    """Within the strips' middle rule."""
    return pytest.approx(value, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("fraction", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("target", ["left", "right"])
def test_a_lost_wing_tip_is_what_strips_add_up_to(target: str, fraction: float) -> None:
    after = under(WingDamage(fraction, target=target))
    whole, left_over = Strips(), Strips(fraction, 1.0 if target == "right" else -1.0)

    def ratio(table: str, **by: float) -> float:
        return left_over.slope(table, **by) / whole.slope(table, **by)

    assert after["CL_alpha"] / CLEAN["CL_alpha"] == close(ratio("CL", alpha=1e-4))
    assert after["CL_zero"] / CLEAN["CL_zero"] == close(1.0 - fraction / 2.0)
    assert after["Cl_alpha"] == close(left_over.slope("Cl", alpha=1e-4))
    at_level = after["Cl_zero"] + after["Cl_alpha"] * LEVEL_ALPHA
    assert at_level == close(left_over.coefficients()["Cl"])
    yaw = after["Cn_zero"] + after["Cn_alpha"] * LEVEL_ALPHA
    assert yaw == close(left_over.coefficients()["Cn"])
    assert after["Cn_alpha"] == close(left_over.slope("Cn", alpha=1e-4))
    assert after["Cl_beta"] / CLEAN["Cl_beta"] == close(ratio("Cl", beta=1e-4))
    for name in ("Cl_p", "Cn_p"):
        assert after[name] / CLEAN[name] == close(ratio("Cl", roll_rate=1e-4)), name
    assert after["Cl_r"] / CLEAN["Cl_r"] == close(ratio("Cl", yaw_rate=1e-4))
    change = left_over.slope("Cn", yaw_rate=1e-4) - whole.slope("Cn", yaw_rate=1e-4)
    assert after["Cn_r"] - CLEAN["Cn_r"] == close(change)
    for name in ("CY_aileron", "Cl_aileron", "Cn_aileron"):
        assert after[name] / CLEAN[name] == close(ratio("Cl", aileron=1e-4)), name


@pytest.mark.parametrize("fraction", [0.1, 0.3, 0.7])
def test_drag_after_the_loss_of_a_wing_tip(fraction: float) -> None:
    after = under(WingDamage(fraction, target="left"))
    lost = 0.5 * fraction * WING_SHARE_OF_DRAG_MIN * CLEAN["CD_min"]
    assert CLEAN["CD_min"] - after["CD_min"] == pytest.approx(lost)

    def induced(row: dict[str, float], lift: float) -> float:
        return lift**2 / (math.pi * row["CD_oswald"] * SPAN**2 / AREA)

    shorter = SPAN * (1.0 - 0.5 * fraction)
    by_span = LEVEL_CL**2 * AREA / (math.pi * CLEAN["CD_oswald"] * shorter**2)
    assert induced(after, LEVEL_CL) == pytest.approx(by_span)


def test_the_lost_wing_decides_the_side_and_nothing_else() -> None:
    left, right = under(WingDamage(0.3, target="left")), under(WingDamage(0.3, target="right"))
    mirrored = {"Cl_zero", "Cl_alpha", "Cn_zero", "Cn_alpha", "cg_y_m"}
    for name in PARAMETERS:
        assert left[name] == pytest.approx(-right[name] if name in mirrored else right[name], abs=1e-15), name
    assert right["Cl_alpha"] > 0.0  # the right wing drops
    assert right["Cn_zero"] + right["Cn_alpha"] * LEVEL_ALPHA < 0.0  # and the nose goes to the left
    assert right["cg_y_m"] < 0.0


def tensor(row: dict[str, float]) -> NDArray[np.float64]:
    x, y, z, xz, xy, yz = (row[f"inertia_{axes}"] for axes in ("x", "y", "z", "xz", "xy", "yz"))
    return np.array([[x, -xy, -xz], [-xy, y, -yz], [-xz, -yz, z]])


def without(
    row: dict[str, float], points: NDArray[np.float64], masses: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Mass, centre and tensor of a body from which points are taken, by sums about the reference point."""

    def about_origin(mass: float, r: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(mass * (r @ r * np.eye(3) - np.outer(r, r)))

    mass, centre = row["mass_kg"], np.array([row[f"cg_{axis}_m"] for axis in "xyz"])
    total = tensor(row) + about_origin(mass, centre)
    for r, m in zip(points, masses, strict=True):
        total = total - about_origin(m, r)
    left = mass - masses.sum()
    new = (mass * centre - masses @ points) / left
    return left, new, total - about_origin(left, new)


def assert_is(row: dict[str, float], body: tuple[float, NDArray[np.float64], NDArray[np.float64]]) -> None:
    assert row["mass_kg"] == pytest.approx(body[0], rel=1e-12)
    np.testing.assert_allclose([row[f"cg_{axis}_m"] for axis in "xyz"], body[1], atol=1e-12)
    np.testing.assert_allclose(tensor(row), body[2], atol=1e-8)


def test_the_lost_wing_tip_takes_its_mass_with_it() -> None:
    fraction, pieces = 0.4, 20000
    mass = 0.5 * fraction * WING_SHARE_OF_MASS * CLEAN["mass_kg"]
    y = 0.5 * SPAN * (1.0 - fraction * (np.arange(pieces) + 0.5) / pieces)
    points = np.stack([0.0 * y, y, 0.0 * y], axis=1)
    shifted = under(CgShift(0.02))
    row = under(CgShift(0.02), WingDamage(fraction, target="right"))
    assert_is(row, without(shifted, points, np.full(pieces, mass / pieces)))
    assert row["inertia_xy"] != 0.0


def test_a_dropped_payload_takes_centre_and_inertia_with_it() -> None:
    row = under(MassInertia(-0.1, target="payload,0.2,-0.4,0.1"))
    assert_is(row, without(CLEAN, np.array([[0.2, -0.4, 0.1]]), np.array([1.1])))


def test_two_payloads_come_and_go() -> None:
    place = "payload,0.1,0.5,-0.2"
    row = under(MassInertia(0.25, target=place), MassInertia(-0.2, target=place))
    for name in PARAMETERS:
        assert row[name] == pytest.approx(CLEAN[name], abs=1e-12), name


def test_a_shift_of_the_centre_of_gravity_changes_pitch_stiffness_by_lift_slope_times_shift() -> None:
    shift, mass = 0.02, AEROSONDE.mass
    assert mass is not None
    effects = (CgShift(shift),)
    after = linearise(AEROSONDE, CONDITION, SHORT_PERIOD, effects)
    alpha = trim(AEROSONDE, CONDITION, effects=effects).angle_of_attack_rad
    pressure = CONDITION.dynamic_pressure_pa * AREA
    # M about the reference point = shift times normal force, which carries the weight; d/dw at constant u
    about_reference = -shift * mass.mass_kg * GRAVITY_M_S2 * math.cos(alpha) / (pressure * CHORD)
    reference = (
        pressure
        * CHORD
        / 25.0
        * (CLEAN["Cm_alpha"] * math.cos(alpha) + 2.0 * math.sin(alpha) * about_reference)
    )
    exact = (reference - shift * mass.mass_kg * after["z_w"]) / mass.inertia_y_kg_m2
    assert after["m_w"] == pytest.approx(exact, rel=1e-6)
    stiffness = mass.inertia_y_kg_m2 * after["m_w"] * 25.0 / (pressure * CHORD)
    # beside the textbook: drag in the normal force, cos(alpha) and the speed's share, CD/CL_alpha + alpha terms
    textbook = CLEAN["Cm_alpha"] + CLEAN["CL_alpha"] * shift / CHORD
    assert stiffness == pytest.approx(textbook, abs=0.04 * CLEAN["CL_alpha"] * shift / CHORD + 0.01)


def test_a_thrust_line_below_the_centre_of_gravity_pitches_up_by_thrust_times_distance() -> None:
    below, coefficients, mass = 0.05, AEROSONDE.coefficients, AEROSONDE.mass
    assert coefficients is not None
    assert mass is not None
    point = trim(AEROSONDE, CONDITION, effects=(ThrustEffect(below),))
    alpha, surfaces = point.angle_of_attack_rad, (point.elevator_rad, 0.0, 0.0)
    c = body_coefficients(coefficients, SPAN**2 / AREA, alpha, surfaces=surfaces)
    pressure = CONDITION.dynamic_pressure_pa * AREA
    thrust = mass.mass_kg * GRAVITY_M_S2 * math.sin(alpha) - pressure * c.CX.real
    assert thrust > 5.0
    assert pressure * CHORD * c.Cm.real == pytest.approx(-thrust * below, rel=1e-6)
