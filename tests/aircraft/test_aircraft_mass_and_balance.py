"""Another mass and centre of gravity: on paper what the simulation's own linearisation gives."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    LONGITUDINAL,
    SHORT_PERIOD,
    STRUCTURES,
    Aircraft,
    AircraftDataError,
    ConditionEntry,
    DerivativeEntry,
    FlightCondition,
    ModeStructure,
    Provenance,
    affine,
    american_map,
    at_loading,
    carried,
    linearised_at,
    linearised_derivatives,
    load_aircraft,
    trim,
)
from wingwatch.simulation import CgShift, MassInertia, linearise


def without_elevator_drag(name: str) -> Aircraft:
    """The short period on paper leaves the elevator's drag out of z_eta, which is no matter of the loading."""
    aircraft = load_aircraft(name)
    c = aircraft.need_coefficients("the test")
    return aircraft.model_copy(update={"coefficients": c.with_value("CD_elevator", 0.0)})


AEROSONDE, TWIN_OTTER = without_elevator_drag("aerosonde"), without_elevator_drag("twinotter")
"""The second has alphadot terms and large [mass] inertia_xz_kg_m2."""
PLACES = ((AEROSONDE, FlightCondition(25.0, 1000.0)), (TWIN_OTTER, FlightCondition(80.0, 1500.0)))
LOADINGS = ((1.3, 0.0), (1.0, 0.1), (1.0, -0.15), (0.8, 0.1))
"""Mass over the file's, and shift aft in mean chords."""


def loaded(aircraft: Aircraft, ratio: float, chords: float) -> tuple[Aircraft, float]:
    shift_m = chords * aircraft.need_geometry("the test").mean_chord_m
    return at_loading(aircraft, ratio * aircraft.need_mass("the test").mass_kg, shift_m), shift_m


@pytest.mark.parametrize("structure", [SHORT_PERIOD, LONGITUDINAL, LATERAL, DUTCH_ROLL], ids=lambda s: s.name)
@pytest.mark.parametrize(("ratio", "chords"), LOADINGS)
@pytest.mark.parametrize(("aircraft", "condition"), PLACES, ids=["aerosonde", "twinotter"])
def test_derivatives_are_those_of_the_simulation(
    aircraft: Aircraft, condition: FlightCondition, ratio: float, chords: float, structure: ModeStructure
) -> None:
    moved, shift_m = loaded(aircraft, ratio, chords)
    on_paper = linearised_derivatives(moved, condition, structure)
    effects = (MassInertia(ratio - 1.0, target="payload"), CgShift(shift_m))  # inertia stays the file's
    assert on_paper == pytest.approx(linearise(aircraft, condition, structure, effects), rel=1e-6, abs=1e-7)
    assert on_paper == pytest.approx(linearise(moved, condition, structure), rel=1e-6, abs=1e-7)
    before = linearised_derivatives(aircraft, condition, structure)
    by_mass, by_place = ("y_v", "n_v") if structure in (LATERAL, DUTCH_ROLL) else ("z_w", "m_w")
    changed = by_place if ratio == 1.0 else by_mass
    assert abs(on_paper[changed] / before[changed] - 1.0) > 0.05


@pytest.mark.parametrize("structure", STRUCTURES.values(), ids=lambda s: s.name)
@pytest.mark.parametrize(("ratio", "chords"), LOADINGS)
@pytest.mark.parametrize(("aircraft", "condition"), PLACES, ids=["aerosonde", "twinotter"])
def test_stated_derivatives_are_carried_to_the_same_angle_of_attack(
    aircraft: Aircraft, condition: FlightCondition, ratio: float, chords: float, structure: ModeStructure
) -> None:
    moved, _ = loaded(aircraft, ratio, chords)
    steady = trim(aircraft, condition)
    here = replace(condition, angle_of_attack_rad=steady.angle_of_attack_rad)
    stated = linearised_at(aircraft, condition, structure, steady)
    value = np.array([stated[s] for s in structure.derivatives])
    covariance = np.diag((0.1 * value) ** 2)
    got, spread, there = carried(value, covariance, structure, here, (aircraft, moved))
    assert there.airspeed_true_m_s == pytest.approx(condition.airspeed_true_m_s * math.sqrt(ratio))
    assert there.angle_of_attack_rad == here.angle_of_attack_rad
    wanted = linearised_at(moved, there, structure, steady)
    assert got == pytest.approx([wanted[s] for s in structure.derivatives], rel=1e-9, abs=1e-9)
    back, spread_back, _ = carried(got, spread, structure, there, (moved, aircraft))
    assert back == pytest.approx(value, rel=1e-9, abs=1e-9)
    assert spread_back == pytest.approx(covariance, rel=1e-6, abs=1e-9 * covariance.max())
    # the same in the coordinates that what flights teach is kept in
    matrix, offset = american_map(structure, here, (aircraft, moved))
    (scale, shift), (new_scale, new_shift) = (
        affine(structure, aircraft, here),
        affine(structure, moved, there),
    )
    assert matrix @ ((value - shift) / scale) + offset == pytest.approx(
        (got - new_shift) / new_scale, rel=1e-9
    )


def test_a_mass_alone_leaves_the_coefficients_alone() -> None:
    here = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.05)
    for structure in STRUCTURES.values():
        matrix, offset = american_map(structure, here, (AEROSONDE, loaded(AEROSONDE, 1.3, 0.0)[0]))
        assert matrix == pytest.approx(np.eye(len(offset)), abs=1e-12)
        assert offset == pytest.approx(np.zeros(len(offset)), abs=1e-12)


def test_stated_conditions_sensors_and_what_stays() -> None:
    def entry(structure: ModeStructure) -> ConditionEntry:
        values = linearised_derivatives(AEROSONDE, FlightCondition(25.0, 1000.0), structure)
        return ConditionEntry(
            airspeed_true_m_s=25.0, altitude_m=1000.0, provenance=Provenance.IDENTIFIED,
            angle_of_attack_rad=trim(AEROSONDE, FlightCondition(25.0, 1000.0)).angle_of_attack_rad,
            derivatives={k: DerivativeEntry(value=v, standard_error=0.1 * abs(v) + 1e-3) for k, v in values.items()},
        )  # fmt: skip

    some = entry(SHORT_PERIOD).model_copy(
        update={"derivatives": {"m_q": DerivativeEntry(value=-6, standard_error=1)}}
    )
    aircraft = AEROSONDE.model_copy(update={"conditions": (entry(SHORT_PERIOD), entry(LATERAL), some)})
    moved = at_loading(aircraft, 1.2 * AEROSONDE.need_mass("the test").mass_kg, 0.01)
    at = FlightCondition(25.0 * math.sqrt(1.2), 1000.0)
    for stated, structure in zip(moved.conditions, (SHORT_PERIOD, LATERAL), strict=False):
        assert stated.airspeed_true_m_s == pytest.approx(at.airspeed_true_m_s)
        wanted = linearised_at(moved, at, structure, trim(AEROSONDE, FlightCondition(25.0, 1000.0)))
        found = {symbol: d.value for symbol, d in stated.derivatives.items()}
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    assert moved.conditions[2].derivatives == {}
    assert moved.sensors.vane_position_m[0] == pytest.approx(aircraft.sensors.vane_position_m[0] + 0.01)
    assert moved.sensors.imu_position_m[0] == pytest.approx(aircraft.sensors.imu_position_m[0] + 0.01)
    assert moved.need_mass("the test").inertia_y_kg_m2 == aircraft.need_mass("the test").inertia_y_kg_m2


def test_nothing_changes_without_a_change_and_nothing_is_guessed() -> None:
    assert at_loading(AEROSONDE, None, None) is AEROSONDE
    assert at_loading(AEROSONDE, AEROSONDE.need_mass("the test").mass_kg, 0.0) is AEROSONDE
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="give a positive mass"):
            at_loading(AEROSONDE, bad, None)
    with pytest.raises(ValueError, match="finite shift"):
        at_loading(AEROSONDE, None, math.nan)
    for table in ("mass", "geometry"):
        with pytest.raises(AircraftDataError, match=rf"\[{table}\]"):
            at_loading(AEROSONDE.model_copy(update={table: None}), 12.0, None)
