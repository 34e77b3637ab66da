"""Cells of the envelope, and what is still known of one after a time away."""

import numpy as np
import pytest

from wingwatch.baselines import Cell, CellMemory, Reference, aged, cell_of, joined

NATURAL = np.array([1.0, 4.0])
DAY_S = 86_400.0


def known(scale: float = 1.0, seconds: float = 100.0) -> Reference:
    information = scale * np.array([[3.0, 0.4], [0.4, 0.5]])
    return Reference.empty(2).add(information, information @ np.array([2.0, -1.0]), seconds)


def test_two_conditions_of_a_cell_are_within_what_a_baseline_is_carried() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        airspeed, altitude = rng.uniform(10.0, 60.0), rng.uniform(-300.0, 8000.0)
        other = airspeed * rng.uniform(0.7, 1.4), altitude + rng.uniform(-1500.0, 1500.0)
        if cell_of(airspeed, altitude) == cell_of(*other):
            assert 1.0 / 1.15 <= other[0] / airspeed <= 1.15
            assert abs(other[1] - altitude) <= 1000.0


def test_a_flight_along_an_edge_stays_in_its_cell() -> None:
    edge = 1.15**23.5
    present = cell_of(0.99 * edge, 1000.0)
    assert cell_of(1.01 * edge, 1000.0) != present
    assert cell_of(1.01 * edge, 1000.0, present) == present
    assert cell_of(1.1 * edge, 1000.0, present) == Cell(24, 1)
    assert cell_of(0.99 * edge, 2400.0, present) == Cell(23, 2)


@pytest.mark.parametrize(("airspeed", "altitude"), [(0.0, 0.0), (-3.0, 0.0), (np.nan, 0.0), (20.0, np.inf)])
def test_there_is_no_cell_without_a_condition(airspeed: float, altitude: float) -> None:
    with pytest.raises(ValueError, match="no cell"):
        cell_of(airspeed, altitude)


@pytest.mark.parametrize("days", [0.0, 1.0, 30.0])
def test_age_adds_its_variance_to_what_was_known(days: float) -> None:
    memory = known()
    after = aged(CellMemory(memory, days * DAY_S), NATURAL)
    gained = np.diag((0.03**2 + 0.05**2 * days) * NATURAL**2)
    expected = np.linalg.inv(memory.information) + gained
    np.testing.assert_allclose(np.linalg.inv(after.information), expected, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.solve(after.information, after.vector), [2.0, -1.0], rtol=1e-9)


def test_what_was_never_excited_stays_unknown() -> None:
    memory = Reference.empty(2).add(np.diag([5.0, 0.0]), np.array([1.0, 0.0]), 10.0)
    after = aged(CellMemory(memory, 0.0), NATURAL)
    np.testing.assert_allclose(after.information[1], 0.0, atol=1e-12)


def test_a_cell_remembers_about_ten_minutes_of_what_informed() -> None:
    memory = Reference.empty(2)
    for _ in range(3600):
        memory = joined(memory, np.eye(2), np.ones(2), 10.0)
    assert memory.blocks == 3600
    np.testing.assert_allclose(memory.information, np.eye(2) / (1.0 - np.exp(-10.0 / 600.0)), rtol=1e-9)
