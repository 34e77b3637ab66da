"""Plans: everything from the seed, one random stream a quantity."""

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
from study_flights import small_grid

from wingwatch.aircraft import SHORT_PERIOD, load_aircraft
from wingwatch.simulation.effects.icing import LINEAR_FACTORS
from wingwatch.studies import KINDS, FlightPlan, Grid, Kind, draw_plan, load_fleet, load_grid
from wingwatch.studies.drawn_icing import drawn_icing
from wingwatch.studies.expectation import Expectations
from wingwatch.studies.fault_names import PARTS, part_of
from wingwatch.studies.watched_flight import scenario_of


def plans(kind: Kind, grid: Grid, count: int) -> list[FlightPlan]:
    fleet = load_fleet(grid)
    return [draw_plan(kind, grid, seed, fleet) for seed in range(count)]


def test_one_seed_is_one_plan_and_another_is_another() -> None:
    grid = load_grid("icing", None)
    first, again = plans("icing", grid, 20), plans("icing", grid, 20)
    assert first == again
    assert len({plan.as_json() for plan in first}) == 20
    assert json.loads(first[0].as_json())["seed"] == 0


def test_another_choice_of_one_quantity_leaves_the_others(tmp_path: Path) -> None:
    still = plans("icing", small_grid(tmp_path), 30)
    rough = plans(
        "icing", small_grid(tmp_path, more="").model_copy(update={"turbulence": {"severe": 1.0}}), 30
    )
    changed = {
        name
        for a, b in zip(still, rough, strict=True)
        for name, value in asdict(a).items()
        if value != asdict(b)[name]
    }
    assert changed == {"turbulence", "air"}


def test_the_order_of_choices_makes_no_difference() -> None:
    grid = load_grid("icing", None)
    turned = {
        name: dict(reversed(list(getattr(grid, name).items()))) for name in ("turbulence", "excitation")
    }
    assert plans("icing", grid.model_copy(update=turned), 30) == plans("icing", grid, 30)


def test_every_word_of_the_default_grids_is_drawn_and_can_be_flown() -> None:
    for kind in KINDS:
        grid = load_grid(kind, None)
        fleet = load_fleet(grid)
        drawn = [draw_plan(kind, grid, seed, fleet) for seed in range(200)]
        for name in ("excitation", "turbulence", "sensors", "surfaces", "expectation", "aircraft", "route"):
            assert {getattr(plan, name) for plan in drawn} == set(getattr(grid, name))
        assert {plan.effect for plan in drawn} >= {entry.name for entry in grid.effects}
        for plan in drawn[:5]:
            scenario_of(plan, fleet[plan.aircraft])


def test_sizes_are_drawn_as_their_range_says(tmp_path: Path) -> None:
    more = """
[[effects]]
name = "sensor_bias"
target = "pitch_rate_rad_s"
size = { low = 0.004, high = 0.03, logarithmic = true, either_sign = true }
"""
    drawn = np.array([p.severity for p in plans("sensor", small_grid(tmp_path, "sensor", more), 400)])
    assert 0.004 <= np.abs(drawn).min() < 0.0045
    assert 0.028 < np.abs(drawn).max() <= 0.03
    assert 0.4 < np.mean(drawn > 0.0) < 0.6
    assert abs(np.median(np.log(np.abs(drawn))) - 0.5 * math.log(0.004 * 0.03)) < 0.2


def test_a_sensor_at_fault_is_one_that_the_flight_has() -> None:
    grid = load_grid("sensor", None).model_copy(update={"sensors": {"vanes": 1.0, "no_vanes": 9.0}})
    drawn = plans("sensor", grid, 200)
    vanes = [p for p in drawn if part_of(p.effect, p.target) in PARTS["vanes"]]
    assert len(vanes) > 10
    assert {p.sensors for p in vanes} == {"vanes"}
    assert {p.sensors for p in drawn if p not in vanes} == {"vanes", "no_vanes"}
    blind = plans("sensor", grid.model_copy(update={"sensors": {"no_vanes": 1.0}}), 200)
    assert {p.sensors for p in blind} == {"no_vanes"}
    assert not {part_of(p.effect, p.target) for p in blind} & set(PARTS["vanes"])


def test_a_surface_stuck_where_it_is_has_no_size_and_can_be_flown() -> None:
    grid = load_grid("damage", None)
    fleet = load_fleet(grid)
    stuck = next(p for p in plans("damage", grid, 60) if p.severity is not None and math.isnan(p.severity))
    assert stuck.effect == "surface_stuck"
    assert json.loads(stuck.as_json())["severity"] is None
    assert scenario_of(stuck, fleet[stuck.aircraft]).effects[0].word == "here"


def test_icing_factors_are_drawn_about_the_published_ones() -> None:
    grid = load_grid("icing", None)
    drawn = [p for p in plans("icing", grid, 300) if p.target == "all"]
    values = np.array([list(p.icing_factors.values()) for p in drawn])
    assert 0.7 <= values.min() < 0.75
    assert 1.25 < values.max() <= 1.3
    assert np.all(np.abs(values.mean(axis=0) - 1.0) < 0.08)
    effect = drawn_icing(0.2, 10.0, 0.0, "all", {"CL_alpha": 1.2})
    factors = dict(effect.factors)
    assert factors["CL_alpha"] == 1.2 * LINEAR_FACTORS["all"]["CL_alpha"]
    assert factors["Cm_q"] == LINEAR_FACTORS["all"]["Cm_q"]


def test_drawn_expectations_err_as_the_file_states() -> None:
    aircraft = load_aircraft("aerosonde")
    expectations = Expectations(aircraft, (SHORT_PERIOD,))
    exact = expectations.exact()[SHORT_PERIOD.name]
    names = [name for name, _ in aircraft.need_coefficients("a test").items()]
    square = np.zeros_like(exact.points[0].value)
    for name in names:  # one standard error of each, added as squares, is the file's own error
        moved = expectations.drawn({name: 1.0})[SHORT_PERIOD.name]
        square += (moved.points[0].value - exact.points[0].value) ** 2
    np.testing.assert_allclose(square, np.diagonal(exact.points[0].covariance), rtol=1e-9)
    np.testing.assert_array_equal(
        expectations.drawn({})[SHORT_PERIOD.name].points[3].value, exact.points[3].value
    )
