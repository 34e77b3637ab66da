"""The library's Twin Otter and the simulated ice on it, beside the form they were published in."""

import math

import numpy as np
import pytest
import simulation_outside as outside
from published_twin_otter import CLEAN, PublishedTwinOtter

from wingwatch.aircraft import (
    ICING_FACTORS,
    ConstantThrust,
    FlightCondition,
    IcingKind,
    aspect_ratio,
    body_coefficients,
    load_aircraft,
)
from wingwatch.simulation import Icing, trim

AIRCRAFT = load_aircraft("twinotter")
KINDS: tuple[IcingKind, ...] = ("all", "wing", "tail")


def test_lift_and_drag_give_the_published_body_forces_back_over_the_stated_range() -> None:
    c, geometry = AIRCRAFT.need_coefficients("the test"), AIRCRAFT.need_geometry("the test")
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    alpha = np.linspace(-0.05, 0.12, 171)
    ours = np.array([(k.CX.real, k.CZ.real) for k in (body_coefficients(c, aspect, float(a)) for a in alpha)])
    forward = CLEAN["CX0"] + CLEAN["CXalpha"] * alpha + CLEAN["CXalpha2"] * alpha**2
    assert np.abs(ours[:, 0] - forward).max() < 1.0e-4
    assert np.abs(ours[:, 1] - CLEAN["CZ0"] - CLEAN["CZalpha"] * alpha).max() < 7.0e-4
    slope = np.gradient(ours[:, 1], alpha)[1:-1]
    assert np.abs(slope / CLEAN["CZalpha"] - 1.0).max() < 0.006


def test_level_flight_over_the_envelope_stays_within_the_fits_range() -> None:
    envelope = AIRCRAFT.envelope
    assert envelope is not None
    for speed in envelope.airspeed_true_m_s:
        for altitude in envelope.altitude_m:
            point = trim(AIRCRAFT, FlightCondition(speed, altitude))
            assert -0.05 < point.angle_of_attack_rad < 0.12


@pytest.mark.parametrize("kind", KINDS)
def test_clean_derivatives_are_the_published_forms(kind: IcingKind) -> None:
    for symbol, c in outside.compare_ice(kind).items():
        # y_p is W, as good as the trim's angle of attack: 0.0007 of lift over 5.6 in 0.0275 rad
        limit = 0.0007 / 5.6 / 0.0275 if symbol == "y_p" else 0.002
        assert c.ours == pytest.approx(c.published, rel=limit, abs=1e-12), symbol


@pytest.mark.parametrize("kind", KINDS)
def test_ice_changes_every_derivative_by_the_published_percentage(kind: IcingKind) -> None:
    for symbol, c in outside.compare_ice(kind).items():
        if symbol == "y_xi":  # nothing there to change
            continue
        # The published CZ is free of drag; ours turns iced drag into z_w: its whole growth, 44 % of 0.0488, over 5.66.
        drag = (
            100.0
            * outside.REFERENCE_SEVERITY
            * ICING_FACTORS[kind]["CX0"]
            * -CLEAN["CX0"]
            / -CLEAN["CZalpha"]
        )
        # y_p is W again: that of an aircraft that must fly at a larger angle of attack
        limit = {"z_w": 1.2 * drag, "y_p": 1.0}.get(symbol, 0.02)
        assert c.ours_percent == pytest.approx(c.published_percent, abs=limit), symbol


@pytest.mark.parametrize(
    "symbol", ["z_eta", "m_w", "m_q", "m_eta", "y_v", "y_zeta", "l_xi", "l_zeta", "n_zeta"]
)
def test_what_hangs_on_one_coefficient_changes_by_its_factor(symbol: str) -> None:
    for kind in KINDS:
        c = outside.compare_ice(kind)[symbol]
        assert c.ours_percent == pytest.approx(c.factor_percent, abs=0.1)


def test_modes_clean_and_iced_are_those_of_the_published_form() -> None:
    modes = outside.twin_otter_modes()
    for state in ("clean", "iced"):
        for name, published in modes[f"published form, {state}"].items():
            assert modes[f"ours, {state}"][name] == pytest.approx(published, rel=0.005)
    theirs = modes["JSBSim's DHC-6, same mass"]["short_period"]
    assert modes["ours, clean"]["short_period"] == pytest.approx(theirs, rel=0.06)


def test_iced_flight_needs_the_published_thrust_but_for_the_polar() -> None:
    condition = outside.cruise(AIRCRAFT)
    published = [
        PublishedTwinOtter(AIRCRAFT, s).trim(condition)[2] for s in (0.0, outside.REFERENCE_SEVERITY)
    ]
    propulsion = AIRCRAFT.propulsion
    assert isinstance(propulsion, ConstantThrust)
    effects = ((), (Icing(outside.REFERENCE_SEVERITY),))
    ours = [trim(AIRCRAFT, condition, effects=e).throttle * propulsion.thrust_max_n for e in effects]
    assert ours[0] == pytest.approx(published[0], rel=1e-3)
    assert ours[1] == pytest.approx(published[1], rel=0.02)
    assert math.isclose(ours[1] / ours[0], 1.38, abs_tol=0.01)
