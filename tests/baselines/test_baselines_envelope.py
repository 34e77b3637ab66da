"""An envelope is exact at its points, honest between them, and silent outside."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    STRUCTURES,
    Aircraft,
    Convention,
    FlightCondition,
    ModeStructure,
    Provenance,
    affine,
    derivative_standard_errors,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.baselines import (
    DECLARED,
    MEASURED,
    UNSCALED,
    Envelope,
    Expectation,
    Neighbourhood,
    OutOfEnvelope,
    Reference,
    american,
    apriori_envelope,
    concise,
    empirical,
)
from wingwatch.baselines.expectation import CARRY_SHARE, LIFT_PROPORTIONAL

Array = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)
ROUNDING = 64 * EPS
"""A dozen multiplications and one subtraction each way."""

AEROSONDE = load_aircraft("aerosonde")
ULTRASTICK = load_aircraft("ultrastick25e")
JETSTREAM = load_aircraft("jetstream31")
MODES = list(STRUCTURES.values())


def covariance(rng: np.random.Generator, k: int) -> Array:
    root = rng.normal(size=(k, k))
    return np.asarray(root @ root.T)


def entry(
    airspeed: float,
    altitude: float,
    value: Array | None = None,
    *,
    seed: int = 0,
    structure: ModeStructure = SHORT_PERIOD,
    provenance: Provenance = Provenance.IDENTIFIED,
    source: str = "flight",
) -> Expectation:
    """An entry with American coefficients ``value`` (random where none are given)."""
    rng = np.random.default_rng(seed)
    k = len(structure.derivatives)
    condition = FlightCondition(airspeed, altitude)
    coefficients = rng.normal(size=k) if value is None else value
    theta, p = concise(coefficients, covariance(rng, k), structure, AEROSONDE, condition)
    return Expectation(structure, theta, 0.5 * (p + p.T), provenance, condition, source)


def coefficients_at(envelope: Envelope, airspeed: float, altitude: float) -> Array:
    found = expected(envelope, airspeed, altitude)
    value, _ = american(found.value, found.covariance, envelope.structure, envelope.aircraft, found.condition)
    return value


def expected(envelope: Envelope, airspeed: float, altitude: float) -> Expectation:
    found = envelope.lookup(FlightCondition(airspeed, altitude))
    assert isinstance(found, Expectation), found
    return found


def refusal(envelope: Envelope, condition: FlightCondition) -> str:
    found = envelope.lookup(condition)
    assert isinstance(found, OutOfEnvelope)
    assert "\n" not in found.reason
    return found.reason


LAYOUTS = {
    "point": [(25.0, 1000.0)],
    "airspeeds": [(20.0, 1000.0), (24.0, 1000.0), (31.0, 1000.0)],
    "altitudes": [(25.0, 0.0), (25.0, 3000.0)],
    "grid": [(v, h) for v in (20.0, 24.0, 31.0) for h in (0.0, 500.0, 3000.0)],
    "oblique line": [(20.0, 0.0), (24.0, 500.0), (28.0, 1000.0)],
    "scattered": [(20.0, 0.0), (24.0, 2000.0), (30.0, 100.0), (33.0, 1500.0), (27.0, 700.0)],
}


def laid_out(name: str, **options: object) -> Envelope:
    points = [entry(v, h, seed=i) for i, (v, h) in enumerate(LAYOUTS[name])]
    return Envelope(AEROSONDE, SHORT_PERIOD, points, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", LAYOUTS)
def test_an_envelope_is_exact_at_its_points(name: str) -> None:
    envelope = laid_out(name)
    for point in envelope.points:
        found = envelope.lookup(point.condition)
        assert isinstance(found, Expectation)
        assert found.value == pytest.approx(point.value, rel=ROUNDING, abs=ROUNDING * 30.0)
        size = np.outer(point.standard_error, point.standard_error)
        assert np.all(np.abs(found.covariance - point.covariance) <= 4 * ROUNDING * size)


@pytest.mark.parametrize("name", LAYOUTS)
@settings(max_examples=50, deadline=None)
@given(data=st.data())
def test_a_covariance_is_symmetric_and_semidefinite_everywhere(name: str, data: st.DataObject) -> None:
    envelope = laid_out(name)
    v = data.draw(st.floats(15.0, 40.0))
    h = data.draw(st.floats(-1200.0, 4200.0))
    found = envelope.lookup(FlightCondition(v, h))
    if isinstance(found, OutOfEnvelope):
        return
    assert np.array_equal(found.covariance, found.covariance.T)
    scale = found.standard_error
    assert np.linalg.eigvalsh(found.covariance / np.outer(scale, scale))[0] >= -ROUNDING


@pytest.mark.parametrize("name", ["airspeeds", "grid", "oblique line", "scattered"])
@settings(max_examples=50, deadline=None)
@given(share=st.floats(0.0, 1.0), pair=st.tuples(st.integers(0, 4), st.integers(0, 4)))
def test_coefficients_stay_between_those_of_the_points(
    name: str, share: float, pair: tuple[int, int]
) -> None:
    envelope = laid_out(name)
    places = LAYOUTS[name]
    (v0, h0), (v1, h1) = (places[i % len(places)] for i in pair)
    found = coefficients_at(envelope, v0 + share * (v1 - v0), h0 + share * (h1 - h0))
    known = np.array([
        american(p.value, p.covariance, SHORT_PERIOD, AEROSONDE, p.condition)[0] for p in envelope.points
    ])  # fmt: skip
    slack = 1e-10 * np.abs(known).max()  # z_q and its 25 m/s offset cancel down to a coefficient of about 1
    assert np.all(found >= known.min(axis=0) - slack)
    assert np.all(found <= known.max(axis=0) + slack)


def test_coefficients_go_straight_from_point_to_point() -> None:
    k = len(SHORT_PERIOD.derivatives)
    low, high = np.zeros(k), np.arange(1.0, k + 1.0)
    envelope = Envelope(AEROSONDE, SHORT_PERIOD, [entry(20.0, 0.0, low), entry(30.0, 0.0, high)])
    for share in (0.0, 0.25, 0.5, 0.9, 1.0):
        assert coefficients_at(envelope, 20.0 + 10.0 * share, 0.0) == pytest.approx(
            share * high, abs=1e-10 * k
        )


def test_a_grid_is_bilinear() -> None:
    k = len(SHORT_PERIOD.derivatives)
    ones = np.ones(k)
    corners = {(20.0, 0.0): 1.0, (30.0, 0.0): 2.0, (20.0, 1000.0): 4.0, (30.0, 1000.0): 8.0}
    points = [entry(v, h, f * ones) for (v, h), f in corners.items()]
    found = coefficients_at(Envelope(AEROSONDE, SHORT_PERIOD, points), 22.0, 750.0)
    by_hand = 0.25 * (0.8 * 1.0 + 0.2 * 2.0) + 0.75 * (0.8 * 4.0 + 0.2 * 8.0)
    assert found == pytest.approx(by_hand * ones, abs=1e-10)


def test_a_triangle_is_linear() -> None:
    k = len(SHORT_PERIOD.derivatives)

    def plane(v: float, h: float) -> Array:
        return np.full(k, 1.0 + 0.1 * v - 0.002 * h)

    envelope = Envelope(AEROSONDE, SHORT_PERIOD, [entry(v, h, plane(v, h)) for v, h in LAYOUTS["scattered"]])
    for v, h in ((24.0, 1000.0), (29.0, 600.0), (28.5, 1000.0)):
        assert coefficients_at(envelope, v, h) == pytest.approx(plane(v, h), abs=1e-9)


def test_the_variance_between_points_bounds_any_correlation_of_theirs() -> None:
    a, b = entry(20.0, 0.0, seed=1), entry(30.0, 0.0, seed=2)
    middle = FlightCondition(25.0, 0.0)
    found = Envelope(AEROSONDE, SHORT_PERIOD, [a, b]).lookup(middle)
    assert isinstance(found, Expectation)
    _, between = american(found.value, found.covariance, SHORT_PERIOD, AEROSONDE, middle)
    (_, ca), (_, cb) = (american(p.value, p.covariance, SHORT_PERIOD, AEROSONDE, p.condition) for p in (a, b))
    ea, eb = np.sqrt(np.diagonal(ca)), np.sqrt(np.diagonal(cb))
    assert np.diagonal(between) == pytest.approx(0.5 * (ea**2 + eb**2), rel=ROUNDING)
    for correlation in (-1.0, 0.0, 1.0):
        true = 0.25 * (ea**2 + eb**2 + 2.0 * correlation * ea * eb)
        assert np.all(np.diagonal(between) >= true * (1.0 - ROUNDING))


def test_curvature_between_three_points_is_part_of_the_standard_error() -> None:
    k = len(SHORT_PERIOD.derivatives)
    tiny = 1e-12 * np.eye(k)

    def parabola(v: float) -> Expectation:
        condition = FlightCondition(v, 0.0)
        theta, p = concise(np.full(k, 0.01 * v**2), tiny, SHORT_PERIOD, AEROSONDE, condition)
        return Expectation(SHORT_PERIOD, theta, p, Provenance.IDENTIFIED, condition, "")

    envelope = Envelope(AEROSONDE, SHORT_PERIOD, [parabola(v) for v in (20.0, 24.0, 30.0)])
    for v in (21.0, 22.0, 27.0, 29.5):
        found = expected(envelope, v, 0.0)
        value, p = american(found.value, found.covariance, SHORT_PERIOD, AEROSONDE, found.condition)
        missed = np.abs(value - 0.01 * v**2)
        assert np.sqrt(np.diagonal(p)) == pytest.approx(missed, rel=1e-6)


@pytest.mark.parametrize("name", ["point", "airspeeds", "altitudes", "grid", "oblique line", "scattered"])
def test_the_neighbourhood_of_the_points_ends_where_it_says(name: str) -> None:
    envelope = laid_out(name)
    places = np.array(LAYOUTS[name])
    v, h = (float(x) for x in places[np.argmax(places[:, 0])])
    assert expected(envelope, 1.149 * v, h)
    assert "outside the baseline of short_period" in refusal(envelope, FlightCondition(1.151 * v, h))
    v, h = (float(x) for x in places[np.argmax(places[:, 1])])
    assert expected(envelope, v, h + 999.0)
    reason = refusal(envelope, FlightCondition(v, h + 1001.0))
    assert reason == (
        f"{v:.4g} m/s at {h + 1001:.0f} m is outside the baseline of short_period, "
        f"which covers {envelope.limits}; it is not extrapolated"
    )


def test_coefficients_are_held_in_the_neighbourhood_and_not_extrapolated() -> None:
    envelope = laid_out("grid")
    edge = coefficients_at(envelope, 31.0, 3000.0)
    beyond = coefficients_at(envelope, 1.1 * 31.0, 3800.0)
    assert beyond == pytest.approx(edge, abs=1e-10)


def test_carrying_an_entry_away_costs_standard_error() -> None:
    k = len(LATERAL.derivatives)
    point = entry(25.0, 1000.0, structure=LATERAL, seed=4)
    envelope = Envelope(AEROSONDE, LATERAL, [point])
    value, p0 = american(point.value, point.covariance, LATERAL, AEROSONDE, point.condition)
    found = expected(envelope, 25.0 / 1.1, 1000.0)
    _, p = american(found.value, found.covariance, LATERAL, AEROSONDE, found.condition)
    lift_change = 1.1**2 - 1.0
    share = np.array([1.0 if s in LIFT_PROPORTIONAL else CARRY_SHARE for s in LATERAL.derivatives])
    assert np.diagonal(p) - np.diagonal(p0) == pytest.approx(
        (share * lift_change * value) ** 2, rel=1e-9, abs=ROUNDING * np.diagonal(p0).max()
    )
    assert k == len(share)


@pytest.mark.parametrize("structure", MODES)
@pytest.mark.parametrize("aircraft", [AEROSONDE, ULTRASTICK])
def test_the_share_for_carrying_covers_what_the_library_loses(
    aircraft: Aircraft, structure: ModeStructure
) -> None:
    assert aircraft.envelope is not None
    cruise = trimmed(aircraft, aircraft.envelope.cruise)
    envelope = Envelope(aircraft, structure, [linearised(aircraft, structure, cruise)])
    for dv in (-0.15, 0.0, 0.15):
        for dh in (-1000.0, 0.0, 1000.0):
            there = trimmed(
                aircraft,
                FlightCondition(cruise.airspeed_true_m_s * (1 + dv), cruise.altitude_m + dh),
            )
            found = envelope.lookup(there)
            assert isinstance(found, Expectation)
            truth = linearised(aircraft, structure, there)
            _, offset = affine(structure, aircraft, there, Convention.AMERICAN)
            lift_change = abs(cruise.dynamic_pressure_pa / there.dynamic_pressure_pa - 1.0)
            allowed = CARRY_SHARE * lift_change * np.abs(truth.value - offset)
            allowed += ROUNDING * np.abs(truth.value) + elevator_drag_step(aircraft, structure, cruise, there)
            assert np.all(np.abs(found.value - truth.value) <= allowed)


def elevator_drag_step(
    aircraft: Aircraft, structure: ModeStructure, a: FlightCondition, b: FlightCondition
) -> Array:
    """What z_eta jumps by where the trimmed elevator changes sign between a and b: drag goes with |elevator|.

    CZ_eta holds -sign(elevator) CD_elevator sin(alpha), which no interpolation follows.
    """
    assert aircraft.coefficients is not None
    scale, _ = affine(structure, aircraft, b, Convention.AMERICAN)
    sines = abs(np.sin(a.angle_of_attack_rad)) + abs(np.sin(b.angle_of_attack_rad))
    step = np.abs(scale) * aircraft.coefficients.CD.elevator * sines
    return np.where(np.array(structure.derivatives) == "z_eta", step, 0.0)


def linearised(aircraft: Aircraft, structure: ModeStructure, condition: FlightCondition) -> Expectation:
    values = linearised_derivatives(aircraft, condition, structure)
    errors = derivative_standard_errors(aircraft, condition, structure)
    return Expectation(
        structure,
        np.array([values[s] for s in structure.derivatives]),
        np.diag([errors[s] ** 2 for s in structure.derivatives]),
        Provenance.A_PRIORI,
        condition,
        "",
    )


@pytest.mark.parametrize("structure", MODES)
@pytest.mark.parametrize("aircraft", [AEROSONDE, ULTRASTICK])
def test_the_file_s_coefficients_are_met_between_the_grid_s_points(
    aircraft: Aircraft, structure: ModeStructure
) -> None:
    assert aircraft.envelope is not None
    (v0, v1), (h0, h1) = aircraft.envelope.airspeed_true_m_s, aircraft.envelope.altitude_m
    envelope = apriori_envelope(aircraft, structure)
    rng = np.random.default_rng(3)
    for a, b in rng.uniform(size=(20, 2)):
        there = trimmed(aircraft, FlightCondition(float(v0 + a * (v1 - v0)), float(h0 + b * (h1 - h0))))
        found, truth = envelope.lookup(there), linearised(aircraft, structure, there)
        assert isinstance(found, Expectation)
        # decision 0011: interpolation may cost a hundredth of the standard error, no more
        allowed = 0.01 * truth.standard_error + elevator_drag_step(aircraft, structure, there, there)
        assert np.all(np.abs(found.value - truth.value) <= allowed)
        assert found.standard_error == pytest.approx(truth.standard_error, rel=0.01)
        assert found.provenance is Provenance.A_PRIORI
        assert found.condition == there
        assert aircraft.name in found.source


def test_a_file_is_linearised_once_and_every_change_of_it_anew() -> None:
    at = FlightCondition(25.0, 1000.0)
    first, again = (apriori_envelope(AEROSONDE.model_copy(), SHORT_PERIOD) for _ in range(2))
    assert all(a is b for a, b in zip(first.points, again.points, strict=True))
    assert AEROSONDE.coefficients is not None
    weaker = AEROSONDE.coefficients.with_value("Cm_elevator", 0.5 * AEROSONDE.coefficients.Cm.elevator)
    changed = apriori_envelope(AEROSONDE.model_copy(update={"coefficients": weaker}), SHORT_PERIOD)
    truth, found = first.lookup(at), changed.lookup(at)
    assert isinstance(truth, Expectation)
    assert isinstance(found, Expectation)
    m_eta = SHORT_PERIOD.derivatives.index("m_eta")
    assert found.value[m_eta] == pytest.approx(0.5 * truth.value[m_eta], rel=0.01)


@pytest.mark.parametrize("aircraft", [AEROSONDE, ULTRASTICK])
def test_the_file_s_limits_are_hard(aircraft: Aircraft) -> None:
    assert aircraft.envelope is not None
    (v0, v1), (h0, h1) = aircraft.envelope.airspeed_true_m_s, aircraft.envelope.altitude_m
    envelope = apriori_envelope(aircraft, SHORT_PERIOD)
    for v, h in ((v0, h0), (v0, h1), (v1, h0), (v1, h1)):
        assert isinstance(envelope.lookup(FlightCondition(v, h)), Expectation)
    for v, h in ((v0 - 0.01, h0), (v1 + 0.01, h0), (v0, h0 - 1.0), (v0, h1 + 1.0)):
        assert f"covers {v0:.4g} to {v1:.4g} m/s" in refusal(envelope, FlightCondition(v, h))


def test_the_angle_of_attack_of_level_flight_is_known_without_a_vane() -> None:
    envelope = apriori_envelope(AEROSONDE, LATERAL)
    there = trimmed(AEROSONDE, FlightCondition(26.3, 1200.0))
    alpha = envelope.angle_of_attack_rad(26.3, 1200.0)
    assert alpha == pytest.approx(there.angle_of_attack_rad, abs=np.radians(0.1))
    assert envelope.angle_of_attack_rad(100.0, 1200.0) is None


def test_a_file_without_envelope_gets_the_default_one() -> None:
    bare = AEROSONDE.model_copy(update={"envelope": None})
    envelope = apriori_envelope(bare, SHORT_PERIOD)
    # lift coefficient 0.5 at 2000 m: sqrt(2 * 11 * 9.80665 / (1.00649 * 0.55 * 0.5)) = 27.92 m/s
    assert envelope.limits == "20.94 to 39.09 m/s and 0 to 4000 m"
    assert isinstance(envelope.lookup(FlightCondition(25.0, 1000.0)), Expectation)


def test_airspeeds_too_slow_for_level_flight_narrow_the_envelope() -> None:
    assert AEROSONDE.envelope is not None
    slow = AEROSONDE.model_copy(
        update={"envelope": AEROSONDE.envelope.model_copy(update={"airspeed_true_m_s": (5.0, 35.0)})}
    )
    envelope = apriori_envelope(slow, SHORT_PERIOD)
    assert "is outside the baseline" in refusal(envelope, FlightCondition(6.0, 0.0))
    assert isinstance(envelope.lookup(FlightCondition(30.0, 0.0)), Expectation)


def test_stated_conditions_come_before_coefficients() -> None:
    stated = JETSTREAM.conditions[0].model_copy(update={"airspeed_true_m_s": 25.0, "altitude_m": 0.0})
    both = AEROSONDE.model_copy(update={"conditions": (stated,)})
    envelope = apriori_envelope(both, SHORT_PERIOD)
    found = expected(envelope, 25.0, 0.0)
    assert found.value == pytest.approx([stated.derivatives[s].value for s in SHORT_PERIOD.derivatives])
    assert found.provenance is Provenance.A_PRIORI
    assert "ESDU 67003a" in found.source
    assert envelope.neighbourhood == MEASURED
    assert apriori_envelope(both, LATERAL).neighbourhood == DECLARED


@pytest.mark.parametrize("structure", [SHORT_PERIOD, DUTCH_ROLL])
def test_an_aircraft_without_geometry_has_its_own_neighbourhood_only(structure: ModeStructure) -> None:
    envelope = apriori_envelope(JETSTREAM, structure)
    stated = JETSTREAM.conditions[0]
    assert envelope.neighbourhood == UNSCALED
    at = expected(envelope, 87.4, 1853.0)
    assert at.value.tolist() == [stated.derivatives[s].value for s in structure.derivatives]
    assert at.standard_error == pytest.approx(
        [stated.derivatives[s].standard_error for s in structure.derivatives], rel=ROUNDING
    )
    assert "not scaled to this airspeed and density" in at.source
    assert "jetstream31 states no [" in at.source
    near = expected(envelope, 1.04 * 87.4, 1853.0)
    assert near.value.tolist() == at.value.tolist()
    grown = near.standard_error**2 - at.standard_error**2
    assert grown == pytest.approx(((1.04**2 - 1.0) * at.value) ** 2, rel=1e-9)
    for v, h in ((1.06 * 87.4, 1853.0), (0.94 * 87.4, 1853.0), (87.4, 2400.0), (87.4, 1300.0)):
        assert "covers 83.03 to 91.77 m/s and 1353 to 2353 m" in refusal(envelope, FlightCondition(v, h))


def test_a_structure_the_file_says_nothing_of_is_refused_with_what_it_lacks() -> None:
    reason = refusal(apriori_envelope(JETSTREAM, LATERAL), FlightCondition(87.4, 1853.0))
    assert "jetstream31 states no [[conditions]] with all derivatives of lateral" in reason
    flaps = apriori_envelope(AEROSONDE, SHORT_PERIOD, "flaps")
    assert "in configuration 'flaps'" in refusal(flaps, FlightCondition(25.0, 0.0, configuration="flaps"))
    assert flaps.limits == "nowhere"
    assert flaps.angle_of_attack_rad(25.0, 0.0) is None


def test_another_configuration_is_refused() -> None:
    reason = refusal(laid_out("point"), FlightCondition(25.0, 1000.0, configuration="flaps"))
    assert "is for configuration 'clean', but the aircraft flies in 'flaps'" in reason


def test_the_weakest_provenance_and_every_source_used_are_told() -> None:
    points = [
        entry(20.0, 0.0, provenance=Provenance.IDENTIFIED, source="flight 7"),
        entry(25.0, 0.0, provenance=Provenance.EMPIRICAL, source="handbook"),
        entry(30.0, 0.0, provenance=Provenance.A_PRIORI, source="panel method"),
    ]
    envelope = Envelope(AEROSONDE, SHORT_PERIOD, points)
    left = expected(envelope, 22.0, 0.0)
    assert (left.provenance, left.source) == (Provenance.EMPIRICAL, "flight 7; handbook")
    assert expected(envelope, 20.0, 0.0).provenance is Provenance.IDENTIFIED
    assert expected(envelope, 26.0, 0.0).provenance is Provenance.A_PRIORI


def test_two_entries_at_one_point_are_refused() -> None:
    with pytest.raises(ValueError, match="two entries at the same airspeed and altitude"):
        Envelope(AEROSONDE, SHORT_PERIOD, [entry(20.0, 0.0), entry(20.0, 0.0, seed=2)])


def test_an_entry_of_another_structure_or_configuration_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot hold an entry of dutch_roll"):
        Envelope(AEROSONDE, SHORT_PERIOD, [entry(20.0, 0.0, structure=DUTCH_ROLL)])
    point = entry(20.0, 0.0)
    flaps = replace(point, condition=replace(point.condition, configuration="flaps"))
    with pytest.raises(ValueError, match="'clean' cannot hold an entry of short_period in configuration 'fl"):
        Envelope(AEROSONDE, SHORT_PERIOD, [flaps])


def test_an_expectation_of_the_wrong_size_or_of_nan_is_refused() -> None:
    point = entry(20.0, 0.0)
    with pytest.raises(ValueError, match=r"has shapes \(6,\) and \(6, 6\), got \(5,\)"):
        replace(point, value=np.zeros(5))
    with pytest.raises(ValueError, match="must be finite"):
        replace(point, value=np.full(6, np.nan))


def test_a_neighbourhood_of_negative_size_is_refused() -> None:
    with pytest.raises(ValueError, match="a neighbourhood is 0 to 1 of the airspeed"):
        Neighbourhood(-0.1, 0.0)


def test_flights_turn_an_a_priori_expectation_empirical() -> None:
    envelope = apriori_envelope(AEROSONDE, SHORT_PERIOD)
    before = expected(envelope, 25.0, 1000.0)
    assert empirical(before, Reference.empty(6), AEROSONDE) is before
    taught, _ = american(before.value * 1.1, before.covariance, SHORT_PERIOD, AEROSONDE, before.condition)
    _, spread = american(before.value, before.covariance, SHORT_PERIOD, AEROSONDE, before.condition)
    information = 1e6 * np.linalg.inv(spread)
    reference = Reference.empty(6).add(information, information @ taught, 90.0)
    after = empirical(before, reference, AEROSONDE)
    assert after.provenance is Provenance.EMPIRICAL
    assert "90 s of this aircraft's own flights" in after.source
    # a million to one: the value moves by all but 1e-6 of the way, the standard error shrinks 1000-fold
    assert after.value == pytest.approx(before.value * 1.1, rel=1e-6)
    assert after.standard_error == pytest.approx(before.standard_error / 1000.0, rel=1e-6)


def test_what_flights_taught_at_one_airspeed_holds_at_another() -> None:
    envelope = apriori_envelope(AEROSONDE, SHORT_PERIOD)
    slow, fast = expected(envelope, 22.0, 500.0), expected(envelope, 32.0, 3000.0)
    coefficients, spread = american(slow.value, slow.covariance, SHORT_PERIOD, AEROSONDE, slow.condition)
    information = 1e8 * np.linalg.inv(spread)
    reference = Reference.empty(6).add(information, information @ (1.2 * coefficients), 60.0)
    after = empirical(fast, reference, AEROSONDE)
    carried, _ = american(after.value, after.covariance, SHORT_PERIOD, AEROSONDE, fast.condition)
    assert carried == pytest.approx(1.2 * coefficients, rel=1e-5)


def test_an_identified_expectation_stays_identified() -> None:
    point = entry(25.0, 0.0)
    taught = empirical(point, Reference.empty(6).add(np.eye(6), np.zeros(6), 1.0), AEROSONDE)
    assert taught.provenance is Provenance.IDENTIFIED


def test_expectations_need_no_database_library() -> None:
    code = (
        "import sys; from wingwatch.baselines import Envelope, apriori_envelope;"
        "print(sorted(m for m in ('sqlalchemy', 'alembic') if m in sys.modules))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


@pytest.mark.parametrize("kind", ["grid", "triangles", "line", "one", "unscaled", "none"])
def test_many_conditions_are_looked_up_at_once_each_as_if_alone(kind: str) -> None:
    """To the bit: what is expected of a vehicle must not depend on who else is looked at."""
    rng = np.random.default_rng(11)
    places = {
        "triangles": [(20.0, 0.0), (30.0, 100.0), (24.0, 2000.0), (33.0, 1900.0)],
        "line": [(20.0, 0.0), (25.0, 1000.0), (30.0, 2000.0)],
        "one": [(25.0, 1000.0)],
        "none": [],
    }
    if kind == "grid":
        envelope = apriori_envelope(AEROSONDE, LATERAL)
    elif kind == "unscaled":
        bare = AEROSONDE.model_copy(update={"geometry": None})
        envelope = Envelope(bare, SHORT_PERIOD, [entry(20.0, 0.0), entry(30.0, 1000.0, seed=1)])
    else:
        entries = [entry(v, h, seed=i) for i, (v, h) in enumerate(places[kind])]
        envelope = Envelope(AEROSONDE, SHORT_PERIOD, entries)
    conditions = [
        FlightCondition(v, h, configuration="flaps" if i == 7 else "clean", angle_of_attack_rad=alpha)
        for i, (v, h, alpha) in enumerate(rng.uniform((15.0, -500.0, -0.1), (40.0, 4000.0, 0.2), (40, 3)))
    ]
    conditions += [p.condition for p in envelope.points[:3]]
    value, spread = envelope.values_at(conditions)
    answered = 0
    for k, condition in enumerate(conditions):
        found = envelope.lookup(condition)
        if isinstance(found, OutOfEnvelope):
            assert np.isnan(value[k]).all()
            assert np.isnan(spread[k]).all()
        else:
            assert value[k].tobytes() == found.value.tobytes()
            assert spread[k].tobytes() == found.covariance.tobytes()
            answered += 1
    assert (answered > 0) == (kind != "none")
    assert answered < len(conditions)
