"""Announced mass and centre of gravity: what is expected and kept, what happens in flight, what is not believed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fleet_hall import AEROSONDE, FakeStore, Hall
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    STRUCTURES,
    FlightCondition,
    ModeStructure,
    Provenance,
    affine,
    at_loading,
    linearised_at,
    linearised_derivatives,
    trim,
    trimmed,
)
from wingwatch.baselines import Cell, CellMemory, Envelope, Expectation, Reference, apriori_envelope
from wingwatch.monitor import AlertAction, AlertState, VehicleMemory, VehicleState
from wingwatch.monitor.fleet.member.loading import Loading, loading_of
from wingwatch.simulation import CgShift, MassInertia, Scenario, doublet_schedule, linearise, simulate
from wingwatch.telemetry import AircraftMessage, SampleBlock

Array = NDArray[np.float64]

MASS_KG = AEROSONDE.need_mass("the test").mass_kg
CRUISE = FlightCondition(25.0, 1000.0)
HEAVIER, AFT_M = 0.25, 0.02
EFFECTS = (MassInertia(HEAVIER, target="payload"), CgShift(AFT_M))
LOADED_KG = (1.0 + HEAVIER) * MASS_KG


def announcement(mass_kg: float | None = None, cg_shift_m: float | None = None) -> AircraftMessage:
    return AircraftMessage(aircraft="aerosonde", mass_kg=mass_kg, cg_shift_m=cg_shift_m)


def identified(structure: ModeStructure) -> Envelope:
    """The file's own loading, known from flights to 2 %."""
    points = []
    for airspeed in (21.0, 24.0, 27.0, 30.0):
        at = trimmed(AEROSONDE, FlightCondition(airspeed, 1000.0))
        found = linearised_derivatives(AEROSONDE, at, structure)
        value = np.array([found[s] for s in structure.derivatives])
        spread = np.diag((0.02 * np.abs(value) + 1e-3) ** 2)
        points.append(Expectation(structure, value, spread, Provenance.IDENTIFIED, at, "flights of the type"))
    return Envelope(AEROSONDE, structure, points)


ENVELOPES = {s.name: identified(s) for s in (SHORT_PERIOD, LATERAL)}


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    """Doublets of an aircraft that is a quarter heavier and has its centre of gravity a tenth of the chord aft."""
    schedule = doublet_schedule(AEROSONDE, CRUISE, np.deg2rad(2.0))
    return simulate(Scenario(AEROSONDE, manoeuvres=(schedule,), effects=EFFECTS, seed=3), 120.0)


def test_an_announced_loading_raises_no_alert_and_one_kept_secret_does(flight: SampleBlock) -> None:
    alerts = {}
    loaded: dict[str, Any] = {"mass_kg": LOADED_KG, "cg_shift_m": AFT_M}
    for name, said in (("secret", {}), ("announced", loaded)):
        hall = Hall(store=FakeStore(envelopes=ENVELOPES))
        hall.announce(**said)
        hall.fly(flight, 0, 120)
        alerts[name] = hall.fleet.alerts()
        view = hall.view()
        assert view.state is (VehicleState.DEGRADED if name == "secret" else VehicleState.HEALTHY)
    assert alerts["announced"] == []
    assert len(alerts["secret"]) == 1
    assert view.mass_kg == LOADED_KG
    assert view.cg_shift_m == pytest.approx(AFT_M)
    assert f"{LOADED_KG:.4g} kg, centre of gravity +0.020 m aft" in view.basis_text


@pytest.mark.parametrize("structure", [SHORT_PERIOD, LATERAL, DUTCH_ROLL], ids=lambda s: s.name)
def test_the_file_is_expected_as_the_simulation_flies_it(structure: ModeStructure) -> None:
    loading = loading_of(AEROSONDE, announcement(LOADED_KG, AFT_M))
    at = trimmed(loading.aircraft, CRUISE)
    found = apriori_envelope(loading.aircraft, structure).lookup(at)
    assert isinstance(found, Expectation)
    truth = linearise(AEROSONDE, CRUISE, structure, EFFECTS)
    off = {s: found.value[k] - truth[s] for k, s in enumerate(structure.derivatives)}
    # 25 m/s lies between two airspeeds of the grid: what interpolation costs is in the standard error
    assert all(abs(off[s]) < 0.1 * found.standard_error[k] for k, s in enumerate(structure.derivatives))
    stated = apriori_envelope(AEROSONDE, structure).lookup(trimmed(AEROSONDE, CRUISE))
    assert isinstance(stated, Expectation)
    row, by_loading = ("z_w", "m_w") if structure is SHORT_PERIOD else ("y_v", "n_v")
    for symbol in (row, by_loading):
        k = structure.derivatives.index(symbol)
        assert abs(stated.value[k] - truth[symbol]) > 20.0 * abs(off[symbol])


def test_entries_of_the_database_are_expected_at_the_loading_and_their_errors_grow_away_from_it() -> None:
    loading = loading_of(AEROSONDE, announcement(LOADED_KG, AFT_M))
    moved = loading.recalled(VehicleMemory(envelopes=ENVELOPES)).envelopes
    for name, envelope in moved.items():
        structure = STRUCTURES[name]
        found = envelope.lookup(trimmed(loading.aircraft, FlightCondition(27.0, 1000.0)))
        assert isinstance(found, Expectation)
        assert found.provenance is Provenance.IDENTIFIED
        truth = linearise(AEROSONDE, FlightCondition(27.0, 1000.0), structure, EFFECTS)
        z = (found.value - [truth[s] for s in structure.derivatives]) / found.standard_error
        assert np.abs(z).max() < 1.0


def coordinates(loading: Loading, structure: ModeStructure, at: FlightCondition) -> Array:
    """True derivatives at a trim of the file's loading, in the coordinates that flights teach in."""
    steady = trim(AEROSONDE, CRUISE)
    found = linearised_at(loading.aircraft, at, structure, steady)
    scale, offset = affine(
        structure, loading.aircraft, replace(at, angle_of_attack_rad=steady.angle_of_attack_rad)
    )
    return (np.array([found[s] for s in structure.derivatives]) - offset) / scale


def taught(value: Array, blocks: int = 8) -> Reference:
    information = np.diag((0.01 * np.abs(value) + 1e-4) ** -2.0)
    return Reference(information, information @ value, blocks, 10.0 * blocks)


@pytest.mark.parametrize("structure", STRUCTURES.values(), ids=lambda s: s.name)
def test_what_one_loading_taught_serves_at_another(structure: ModeStructure) -> None:
    before = loading_of(AEROSONDE, announcement(0.8 * MASS_KG, -0.01))
    now = loading_of(AEROSONDE, announcement(LOADED_KG, AFT_M))
    learned = taught(coordinates(before, structure, CRUISE))
    kept = before.kept({structure.name: learned})
    cell = (structure.name, Cell(23, 1))
    kept_cell = before.kept_cells({cell: learned})[cell]
    memory = now.recalled(VehicleMemory(kept, cells={cell: CellMemory(kept_cell, 7.0)}))
    for reference in (memory.references[structure.name], memory.cells[cell].reference):
        found = reference.estimate()
        assert found is not None
        assert found[0] == pytest.approx(coordinates(now, structure, CRUISE), rel=1e-6, abs=1e-6)
        assert (reference.blocks, reference.seconds) == (learned.blocks, learned.seconds)
    assert memory.cells[cell].age_s == 7.0
    back = now.kept(memory.references)[structure.name]
    assert back.information == pytest.approx(kept[structure.name].information, rel=1e-9)
    assert back.vector == pytest.approx(kept[structure.name].vector, rel=1e-9)


def test_without_an_announcement_nothing_is_touched() -> None:
    loading = loading_of(AEROSONDE, announcement())
    memory = VehicleMemory({"short_period": taught(np.ones(6))}, ENVELOPES)
    assert loading.aircraft is AEROSONDE
    assert loading.recalled(memory) is memory
    assert loading.kept(memory.references) is memory.references
    assert loading.text == ""


@pytest.mark.parametrize(
    ("said", "counted", "sentence"),
    [
        ({"mass_kg": 0.0}, "unused_mass", "The announced mass of 0 kg is not used"),
        ({"mass_kg": 10.0 * MASS_KG}, "unused_mass", f"the file's {MASS_KG:g} kg count"),
        ({"cg_shift_m": 0.2}, "unused_cg_shift", "more than 0.095 m from it"),
        ({"cg_shift_m": -0.2}, "unused_cg_shift", "-0.2 m aft of the file's, is not used"),
    ],
)
def test_what_no_aircraft_can_be_is_counted_reported_and_not_used(
    flight: SampleBlock, said: dict[str, Any], counted: str, sentence: str
) -> None:
    hall = Hall()
    hall.announce(**said)
    hall.announce(**said)  # the same again is no news
    hall.fly(flight, 0, 2)
    view = hall.view()
    assert view.counts[counted] == 1
    assert sentence in view.basis_text
    assert (view.mass_kg, view.cg_shift_m) == (MASS_KG, 0.0)


def test_half_of_an_announcement_may_be_right() -> None:
    loading = loading_of(AEROSONDE, announcement(0.0, 0.01))
    assert list(loading.unused) == ["unused_mass"]
    assert loading.aircraft == at_loading(AEROSONDE, None, 0.01)


def test_a_file_without_mass_cannot_be_loaded() -> None:
    bare = AEROSONDE.model_copy(update={"mass": None})
    loading = loading_of(bare, announcement(12.0, 0.01))
    assert loading.aircraft is bare
    assert list(loading.unused) == ["unused_mass", "unused_cg_shift"]
    assert "[mass] and [geometry]" in loading.text


def test_a_new_loading_in_flight_begins_anew_and_a_small_one_does_not(flight: SampleBlock) -> None:
    hall = Hall()
    hall.announce(mass_kg=LOADED_KG, cg_shift_m=AFT_M)
    hall.fly(flight, 0, 20)
    before = hall.view().counts["accepted"]
    hall.announce(
        mass_kg=0.985 * LOADED_KG, cg_shift_m=AFT_M + 0.0005
    )  # 1.5 % burnt, a quarter of a percent of chord
    hall.fly(flight, 20, 22)
    assert hall.view().counts["accepted"] > before
    assert hall.view().mass_kg == LOADED_KG
    hall.announce(mass_kg=0.975 * LOADED_KG, cg_shift_m=AFT_M)
    hall.fly(flight, 22, 24)
    view = hall.view()
    assert view.counts["accepted"] < before
    assert view.mass_kg == 0.975 * LOADED_KG
    assert hall.store.asked == [("aerosonde", "clean")] * 2  # what earlier flights taught is read again


def test_an_alert_in_force_is_not_ended_by_an_announcement(flight: SampleBlock) -> None:
    hall = Hall(store=FakeStore(envelopes=ENVELOPES))
    hall.announce()
    hall.fly(flight, 0, 100)
    assert hall.view().state is VehicleState.DEGRADED
    hall.announce(mass_kg=LOADED_KG, cg_shift_m=AFT_M)
    hall.fly(flight, 100, 102)
    view = hall.view()
    assert view.state is VehicleState.DEGRADED
    assert view.mass_kg == MASS_KG
    assert "counts once its alert is cleared" in view.basis_text
    cleared = hall.fleet.act_on_alert(view.active_alerts[0], AlertAction.CLEAR, "pilot", "was the payload")
    assert cleared is not None
    assert cleared.state is AlertState.CLEARED
    hall.fly(flight, 102, 104)
    assert hall.view().mass_kg == LOADED_KG
    assert hall.view().state is not VehicleState.DEGRADED
