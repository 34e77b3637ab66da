"""Inertia coupling as a known input: six-degree-of-freedom flight in which ailerons and rudder move beside the
elevator."""

import math
from dataclasses import replace

import numpy as np
import pytest
from estimator_plants import PITCH, REFERENCE, noisy_batch
from numpy.typing import NDArray
from simulated_flights import cruise_of, flight_form, truth_of
from whole_flights import SOLVE

from wingwatch.aircraft import (
    LATERAL,
    ROLL,
    SHORT_PERIOD,
    Aircraft,
    ModeStructure,
    load_aircraft,
)
from wingwatch.aircraft.structures import LONGITUDINAL
from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    Estimate,
    FlightForm,
    InertiaCoupling,
    SignalConfig,
    SignalLayout,
    Signals,
    flight_manoeuvres,
    in_form,
    inertia_coupling,
)
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.simulation.layout import parameter_row
from wingwatch.simulation.prepared import working_row
from wingwatch.simulation.rigid_body import _spin_up
from wingwatch.telemetry import SampleBlock, complete

Array = NDArray[np.float64]


def coupled_aircraft() -> Aircraft:
    """The Aerosonde with four times its product of inertia: in a roll the pitch coupling is as strong as m_q q."""
    plain = load_aircraft("aerosonde")
    assert plain.mass is not None
    return plain.model_copy(update={"mass": plain.mass.model_copy(update={"inertia_xz_kg_m2": 0.5})})


AIRCRAFT = coupled_aircraft()
CRUISE = cruise_of(AIRCRAFT)
INERTIA = inertia_coupling(AIRCRAFT)


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    """80 s without sensor noise; 2 degrees of elevator, 5 of aileron and 2 of rudder 0.6 s after each other."""
    one = doublet_schedule(load_aircraft("aerosonde"), CRUISE)
    amplitudes = (math.radians(2.0), math.radians(5.0), math.radians(2.0))
    schedule = replace(one, amplitudes_rad=amplitudes, spacing_s=0.6)
    fleet = FleetSimulation([Scenario(AIRCRAFT, manoeuvres=(schedule,), noise=False, seed=3)])
    return complete(SampleBlock(fleet.step(4000)[0]))


def form_of(inertia: InertiaCoupling | None) -> FlightForm:
    return flight_form(AIRCRAFT, CRUISE, inertia, window_s=20.0)


def pitch_damping_error(estimate: Estimate) -> float:
    """Relative error of m_q against the linearisation at the condition that the estimate is reported at."""
    at = SHORT_PERIOD.derivatives.index("m_q")
    return float(estimate.value[at] / truth_of(AIRCRAFT, estimate)[at]) - 1.0


def spin_up_of(block: SampleBlock) -> Array:
    """The simulation's own angular acceleration without any moment, at the rates that were flown, (samples, 3)."""
    row = working_row(parameter_row(AIRCRAFT))
    names = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
    rates = np.column_stack([block.column(name) for name in names])
    return np.array([_spin_up(row, p, q, r, 0.0, 0.0, 0.0) for p, q, r in rates])


@pytest.mark.parametrize("structure", [SHORT_PERIOD, LATERAL], ids=lambda s: str(s.name))
def test_the_moment_column_is_the_simulations_own_coupling(
    flight: SampleBlock, structure: ModeStructure
) -> None:
    signals = Signals(SignalConfig(structure, inertia=INERTIA))
    rows = signals.update(signals.init(1), flight.values[None])[0]
    places = ["pqr".index(s) for s in structure.states[1:]]
    want = spin_up_of(flight)[:, places]
    assert np.abs(want).max() > 0.03, "the flight has no coupling to speak of"
    np.testing.assert_allclose(
        rows[:, signals.config.layout.known_moments : signals.config.layout.ahead], want, atol=1e-12
    )


@pytest.mark.parametrize(("structure", "row", "axis"), [(LONGITUDINAL, 2, 1), (ROLL, 0, 0), (LATERAL, 2, 2)])
def test_manoeuvres_of_every_structure_know_it(
    flight: SampleBlock, structure: ModeStructure, row: int, axis: int
) -> None:
    want = spin_up_of(flight)[:, axis]
    parts = flight_manoeuvres(structure, form_of(INERTIA), [flight])
    np.testing.assert_allclose(np.concatenate([m.rest[:, row] for m in parts]), want, atol=1e-12)
    for manoeuvre in flight_manoeuvres(structure, form_of(None), [flight]):
        assert (manoeuvre.rest[:, row] == 0.0).all()


@pytest.mark.parametrize("name", SOLVE)
def test_pitch_damping_is_right_though_ailerons_and_rudder_move(flight: SampleBlock, name: str) -> None:
    """Without the moments of inertia m_q comes out a fifth too small; with them within 2 %."""
    errors = {}
    for inertia in (INERTIA, None):
        parts = flight_manoeuvres(SHORT_PERIOD, form_of(inertia), [flight])
        errors[inertia] = pitch_damping_error(in_form(*SOLVE[name](parts), SHORT_PERIOD)[0])
    assert abs(errors[INERTIA]) < 0.02
    assert errors[None] < -0.15


def test_the_filters_pitch_damping_is_right_too(flight: SampleBlock) -> None:
    prior = 0.8 * PITCH.aerodynamic
    reference = (CRUISE.airspeed_true_m_s, CRUISE.air_density_kg_m3)
    errors = {}
    for inertia in (INERTIA, None):
        signals = Signals(
            SignalConfig(
                SHORT_PERIOD, reference_airspeed_m_s=reference[0], reference_density_kg_m3=reference[1],
                inertia=inertia,
            )
        )  # fmt: skip
        rows = signals.update(signals.init(1), flight.values[None])
        config = EkfConfig(
            SHORT_PERIOD, prior, np.abs(PITCH.aerodynamic), reference, servo_s=(1.0 / (2.0 * np.pi * 8.0),)
        )
        kalman = EkfEstimator(config)
        state = kalman.init(1)
        for start in range(0, rows.shape[1], 25):
            kalman.update(state, rows[:, start : start + 25])
            kalman.solve(state)
        errors[inertia] = pitch_damping_error(kalman.estimate(state))
    assert abs(errors[INERTIA]) < 0.02
    assert abs(errors[None]) > 0.10


def test_both_engines_take_the_known_moment_alike() -> None:
    """With an accelerometer ahead of the centre of gravity, which reads it too."""
    rows = noisy_batch(PITCH, 12.0, 1)
    layout, rng = SignalLayout(2, 1), np.random.default_rng(5)
    rows[..., layout.known_moments] = np.cumsum(0.05 * rng.standard_normal(rows.shape[1]))
    found = []
    for engine in ("compiled", "filterpy"):
        config = EkfConfig(
            SHORT_PERIOD, 0.8 * PITCH.aerodynamic, np.abs(PITCH.aerodynamic), REFERENCE, engine=engine,
            imu_position_m=(0.3, 0.0, 0.0),
        )  # fmt: skip
        kalman = EkfEstimator(config)
        state = kalman.init(1)
        for start in range(0, rows.shape[1], 25):
            kalman.update(state, rows[:, start : start + 25])
            kalman.solve(state)
        found.append(kalman.estimate(state))
    # By the stated error: z_eta is a fifth of its own from nothing.
    assert (np.abs(found[0].value - found[1].value) < 1e-9 * found[1].standard_error).all()
    np.testing.assert_allclose(found[0].standard_error, found[1].standard_error, rtol=1e-9)
