"""Static derivatives from trimmed segments, against exact trims; straight lines with errors in both coordinates."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.diagnosis.static_derivatives import (
    StaticDerivatives,
    static_derivatives,
    static_margin,
    straight_line,
)
from wingwatch.simulation import CgShift, FleetSimulation, Route, Scenario, Waypoint, linearise, trim
from wingwatch.telemetry import SampleBlock
from wingwatch.telemetry.conditioning import SteadySegment, steady_segments

AIRCRAFT = load_aircraft("aerosonde")
MASS = AIRCRAFT.need_mass("this test")
AREA = AIRCRAFT.need_geometry("this test").wing_area_m2
CHORD = AIRCRAFT.need_geometry("this test").mean_chord_m
SPEEDS = (25.0, 20.5, 23.0, 26.0, 29.0, 22.0)


def flown(shift_m: float, seeds: int) -> list[StaticDerivatives]:
    legs = tuple(Waypoint(600.0 * (i + 1), 0.0, 1000.0, v) for i, v in enumerate(SPEEDS))
    effects = (CgShift(shift_m),) if shift_m else ()
    scenarios = [
        Scenario(AIRCRAFT, seed=s, route=Route(legs, loops=False), effects=effects) for s in range(seeds)
    ]
    blocks = [SampleBlock(v) for v in FleetSimulation(scenarios).step(50 * 145)]
    return [static_derivatives(steady_segments(block), MASS.mass_kg, AREA) for block in blocks]


def test_ratios_of_static_derivatives_from_a_flight_at_several_airspeeds() -> None:
    points = [trim(AIRCRAFT, FlightCondition(v, 1000.0)) for v in SPEEDS]
    alpha = np.array([p.angle_of_attack_rad for p in points])
    slope, at_zero = np.polyfit(alpha, [p.elevator_rad for p in points], 1)
    misses = []
    for found in flown(0.0, 5):
        assert found.segments >= 5
        for parameter, truth in ((found.elevator_slope, slope), (found.elevator_at_zero, at_zero)):
            assert parameter.observable
            assert abs(parameter.value - truth) < 3.0 * parameter.standard_error
        misses.append((found.elevator_slope.value - slope) / found.elevator_slope.standard_error)
        assert found.elevator_slope.standard_error < 0.02 * abs(slope)
        at = linearise(AIRCRAFT, FlightCondition(found.airspeed_m_s, 1000.0), SHORT_PERIOD)
        # the concise ratio has w = V sin(alpha): cos(alpha) of a tenth of a radian is 0.5 % from one
        assert found.moment_ratio.value == pytest.approx(
            at["m_w"] / at["m_eta"],
            abs=3.0 * found.moment_ratio.standard_error + 0.01 * at["m_w"] / at["m_eta"],
        )
    # stated errors count slow motion as well, so they may be up to three times what chance makes
    assert np.sum(np.square(misses)) > chi2.ppf(0.001, len(misses)) / 9.0


def test_the_static_margin_is_the_aircraft_s_and_falls_as_the_centre_moves_aft() -> None:
    coefficients = AIRCRAFT.need_coefficients("this test")
    shifts = (-0.02, 0.0, 0.02)
    found = [flown(shift, 1)[0] for shift in shifts]
    margins = [static_margin(f, coefficients.Cm.elevator, 0.0) for f in found]
    # the trimmed normal force has the elevator's part in it, 0.13 / 5.61 of a lift that the elevator follows by -2.8
    share = abs(found[1].elevator_slope.value) * coefficients.CL.elevator / coefficients.CL.alpha
    truth = -coefficients.Cm.alpha / coefficients.CL.alpha
    assert margins[1].value == pytest.approx(truth, rel=share + 0.02)
    # moved aft, the margin falls by the shift in chords
    fall = margins[0].value - margins[2].value
    error = math.hypot(margins[0].standard_error, margins[2].standard_error)
    assert abs(fall - 0.04 / CHORD) < 3.0 * error + share * 0.04 / CHORD


def test_flight_at_one_airspeed_tells_no_slope() -> None:
    block = SampleBlock(FleetSimulation([Scenario(AIRCRAFT, seed=3)]).step(50 * 60)[0])
    found = static_derivatives(steady_segments(block), MASS.mass_kg, AREA)
    assert found.segments >= 3
    assert not found.elevator_slope.observable
    assert "angles of attack differ" in found.elevator_slope.reason
    assert not static_margin(found, -1.0, 0.1).observable
    assert not static_derivatives([], MASS.mass_kg, AREA).moment_ratio.observable


def test_bad_input_is_named() -> None:
    segment = SteadySegment(5.0, 9.0, {"angle_of_attack_rad": 0.1}, {"angle_of_attack_rad": 0.001})
    with pytest.raises(ValueError, match="segment at 5 s has no elevator_rad"):
        static_derivatives([segment], MASS.mass_kg, AREA)
    with pytest.raises(ValueError, match="mass_kg is 0"):
        static_derivatives([], 0.0, AREA)


def test_a_line_with_errors_in_both_coordinates_is_not_flattened() -> None:
    rng = np.random.default_rng(7)
    x = np.linspace(-1.0, 1.0, 12)
    x_error, y_error = np.full(12, 0.2), np.full(12, 0.1)
    misses, plain = [], []
    for _ in range(400):
        read_x, read_y = x + x_error * rng.normal(size=12), 0.5 - 2.0 * x + y_error * rng.normal(size=12)
        line = straight_line(read_x, read_y, x_error, y_error)
        misses.append((line.slope + 2.0) / math.sqrt(line.covariance[1, 1]))
        plain.append(float(np.polyfit(read_x, read_y, 1)[0]))
    assert np.mean(plain) > -1.9
    assert (
        abs(np.mean(misses)) < 4.0 / math.sqrt(400.0) + 0.1
    )  # a bias of second order, a tenth of an error, is left
    assert np.mean(np.abs(misses) < 1.96) > 0.92
