"""The online filter on plants whose truth is known: coverage, silence in quiet flight, batches, holes and gaps."""

import copy
import pickle
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from reference_plant import PLANTS
from scipy.stats import binom
from situation_cases import CONDITIONS, SITUATIONS
from situation_plants import Flight, Situation, fly_situation

from wingwatch.aircraft import LATERAL, PHUGOID, SHORT_PERIOD
from wingwatch.estimators import Estimate, FilterConfig, FilterEstimator, FilterState, Outcome
from wingwatch.estimators.filter_error.lanes import Lanes, build_lanes
from wingwatch.estimators.filter_error.model import FilterModel

Array = NDArray[np.float64]

PITCH, YAW = PLANTS
EVERY_S = 0.5


def estimator_of(flight: Flight, **changes: Any) -> FilterEstimator:
    k = flight.known
    config = FilterConfig(
        k.plant.structure, k.start, k.natural, k.reference, held=(True,), use_accelerometer=k.accelerometer,
        input_noise_std=(k.surface_noise_rad,), span_m=k.span_m,
    )  # fmt: skip
    return FilterEstimator(replace(config, **changes))


def run(estimator: FilterEstimator, batch: Array, pieces: tuple[int, ...] = (25,)) -> FilterState:
    """Rows (vehicles, samples, columns), solved each 25 samples, updated with pieces of these lengths in turn."""
    state = estimator.init(len(batch))
    return resume(estimator, state, batch, pieces)


def resume(
    estimator: FilterEstimator, state: FilterState, batch: Array, pieces: tuple[int, ...] = (25,)
) -> FilterState:
    turn = 0
    for start in range(0, batch.shape[1], 25):
        block, at = batch[:, start : start + 25], 0
        while at < block.shape[1]:
            length = pieces[turn % len(pieces)]
            estimator.update(state, block[:, at : at + length])
            at, turn = at + length, turn + 1
        estimator.solve(state)
    return state


def flown(situation: Situation, seeds: int, seconds: float, plant: Any = PITCH) -> list[Estimate]:
    flights = [fly_situation(plant, situation, seed, seconds) for seed in range(seeds)]
    found = []
    for flight in flights:
        estimator = estimator_of(flight)
        found.append(estimator.estimate(run(estimator, flight.rows[None])))
    return found


def arrays(value: Any) -> list[Array]:
    """All arrays of nested tuples."""
    return [a for part in value for a in arrays(part)] if isinstance(value, tuple) else [value]


def assert_same(one: FilterState, other: FilterState) -> None:
    for a, b in zip(arrays(one), arrays(other), strict=True):
        np.testing.assert_array_equal(a, b)


def is_covered(estimates: list[Estimate], truth: tuple[float, ...]) -> bool:
    """Not fewer than a 95 % interval has in 999 of 1,000 cases; six correlated errors count as two."""
    hit = [np.abs(e.value - np.array(truth)) <= 1.959964 * e.standard_error for e in estimates]
    count = np.size(hit) // 3
    return float(np.mean(hit)) >= float(binom.ppf(0.001, count, 0.95)) / count


@pytest.mark.parametrize("plant", PLANTS, ids=["short_period", "dutch_roll"])
def test_a_doublet_is_enough_and_the_interval_holds(plant: Any) -> None:
    found = flown(CONDITIONS["record"], 4, 12.0, plant)
    assert is_covered(found, plant.truth)
    assert sum(o is Outcome.CONVERGED for e in found for o in e.outcomes) >= 0.8 * 24


@pytest.mark.parametrize(
    "name",
    ["moderate, autopilot, each 10 s", "unknown moment, autopilot, each 10 s", "light, open, each 5 s"],
)
def test_intervals_hold_in_rough_air_and_with_unmeasured_moments(name: str) -> None:
    found = flown(SITUATIONS[name], 3, 24.0)
    assert is_covered(found, PITCH.truth)
    assert sum(o is Outcome.CONVERGED for e in found for o in e.outcomes) >= 0.8 * 18


def test_gusts_that_begin_amid_a_flight_teach_nothing_wrong() -> None:
    found = flown(SITUATIONS["gust from 30 s, autopilot"], 2, 40.0)
    assert is_covered(found, PITCH.truth)


@pytest.mark.parametrize("name", ["quiet", "quiet, surface noise", "unknown moment, surface at rest"])
def test_quiet_flight_leaves_the_prior(name: str) -> None:
    flight = fly_situation(PITCH, {**SITUATIONS, **CONDITIONS}[name], 1, 30.0)
    estimator = estimator_of(flight)
    estimate = estimator.estimate(run(estimator, flight.rows[None]))
    assert set(estimate.outcomes) == {Outcome.NOT_OBSERVABLE}
    assert (estimate.standard_error > 2.9 * flight.known.natural).all()
    assert (
        np.abs(estimate.value - [0.0, 25.0, 0.0, 0.0, 0.0, 0.0] - flight.known.start) < flight.known.natural
    ).all()


def test_gusts_are_kept_where_there_are_gusts_only() -> None:
    for name, expected in (("still, open, each 5 s", 0), ("moderate, open, each 5 s", 1)):
        flight = fly_situation(PITCH, SITUATIONS[name], 0, 15.0)
        estimator = estimator_of(flight)
        assert estimator.judged(run(estimator, flight.rows[None]), 0)[0] == expected, name


def test_vehicles_do_not_see_one_another() -> None:
    flights = [fly_situation(PITCH, SITUATIONS["moderate, autopilot, each 10 s"], s, 15.0) for s in range(2)]
    batch = np.stack([f.rows for f in flights])
    estimator = estimator_of(flights[0])
    together = run(estimator, batch)
    backwards = run(estimator, batch[::-1])
    for i in range(2):
        alone = run(estimator, batch[i : i + 1])
        for a, b, c in zip(arrays(together), arrays(alone), arrays(backwards), strict=True):
            np.testing.assert_array_equal(a[i], b[0])
            np.testing.assert_array_equal(a[i], c[1 - i])


def test_pieces_are_the_whole_and_saved_is_uninterrupted() -> None:
    flight = fly_situation(PITCH, SITUATIONS["light, open, each 5 s"], 0, 15.0)
    batch = flight.rows[None]
    estimator = estimator_of(flight)
    whole = run(estimator, batch)
    assert_same(whole, run(estimator, batch, (1,)))
    assert_same(whole, run(estimator, batch, (7, 1, 3)))
    half = run(estimator, batch[:, :525])
    kept = pickle.loads(pickle.dumps(half))
    resume(estimator, copy.deepcopy(half), batch[:, 525:])
    assert_same(whole, resume(estimator_of(flight), kept, batch[:, 525:]))


def test_rows_with_a_hole_are_as_if_they_had_never_been() -> None:
    flight = fly_situation(PITCH, CONDITIONS["record"], 0, 12.0)
    holed, rows = flight.rows.copy(), np.array([40, 41, 120, 333, 500])
    holed[rows, np.array([1, 2, 3, 4, 5])] = np.nan
    estimator = estimator_of(flight)
    a, b = estimator.init(1), estimator.init(1)
    estimator.update(a, holed[None])
    estimator.update(b, np.delete(flight.rows, rows, axis=0)[None])
    estimator.solve(a)
    estimator.solve(b)
    assert_same(a, b)
    estimate = estimator.estimate(run(estimator, holed[None]))
    assert is_covered([estimate], PITCH.truth)
    assert estimate.outcome is Outcome.CONVERGED


@pytest.mark.parametrize("jump_s", [3.0, -100.0], ids=["gap", "time going back"])
def test_nothing_is_bridged_over_a_gap(jump_s: float) -> None:
    """The record goes on amid a doublet with other constants: what was known is kept, the jump teaches nothing."""
    flight = fly_situation(PITCH, SITUATIONS["still, open, each 5 s"], 0, 24.0)
    rows = flight.rows.copy()
    second = rows[605:].copy()
    second[:, 0] += jump_s
    second[:, 1] += 0.5
    estimator = estimator_of(flight)
    state = run(estimator, rows[None, :600])
    before = np.diagonal(estimator.judged(state, 0)[2])[:6].copy()
    state = resume(estimator, state, second[None])
    assert (np.diagonal(estimator.judged(state, 0)[2])[:6] < 1.02 * before).all()
    after = estimator.estimate(state)
    assert is_covered([after], PITCH.truth)
    assert after.time_s == second[-1, 0]


def test_short_data_say_nothing() -> None:
    flight = fly_situation(PITCH, SITUATIONS["quiet"], 0, 12.0)
    estimator = estimator_of(flight)
    for samples in (0, 1, 2, 12, 95):
        estimate = estimator.estimate(run(estimator, flight.rows[None, :samples]))
        assert set(estimate.outcomes) == {Outcome.NOT_OBSERVABLE}, samples
        assert estimate.reason


def test_a_start_at_motion_that_grows_is_left() -> None:
    """What is expected beforehand may be an aircraft that diverges."""
    flight = fly_situation(PITCH, CONDITIONS["record"], 0, 12.0)
    start = flight.known.start.copy()
    start[3] = -0.5 * start[3]
    estimator = estimator_of(flight, prior_value=start)
    estimate = estimator.estimate(run(estimator, flight.rows[None]))
    assert is_covered([estimate], PITCH.truth)


@pytest.mark.parametrize("broken", [np.nan, -1.0])
def test_a_filter_that_is_lost_starts_anew(broken: float) -> None:
    flight = fly_situation(PITCH, SITUATIONS["still, open, each 5 s"], 0, 24.0)
    estimator = estimator_of(flight)
    state = run(estimator, flight.rows[None, :600])
    state.filters.arrival[0, :] = broken * np.eye(state.filters.arrival.shape[-1])
    state.filters.sums.information[0] *= broken
    state = resume(estimator, state, flight.rows[None, 600:])
    estimate = estimator.estimate(state)
    assert is_covered([estimate], PITCH.truth)
    assert estimate.outcome is Outcome.CONVERGED


def test_what_it_cannot_do_is_said() -> None:
    flight = fly_situation(PITCH, CONDITIONS["record"], 0, 5.0)
    with pytest.raises(ValueError, match="vane"):
        estimator_of(flight, measures_velocity=False)
    with pytest.raises(ValueError, match="other states"):
        estimator_of(flight, structure=PHUGOID)
    with pytest.raises(ValueError, match="held"):
        estimator_of(flight, held=(True, False))
    rows = flight.rows[None].copy()
    rows[:, :, estimator_of(flight).signals.kinematic + 6] = 0.0
    with pytest.raises(ValueError, match="no vane measured"):
        run(estimator_of(flight), rows)


@pytest.mark.parametrize("ahead_m", [0.0, 0.3])
@pytest.mark.parametrize("structure", [SHORT_PERIOD, YAW.structure, LATERAL], ids=lambda s: s.name)
def test_lanes_are_the_filters_of_whole_flights(structure: Any, ahead_m: float) -> None:
    """Two programs of one model: the compiled one against that of ``filter_error``."""
    rng = np.random.default_rng(1)
    k, ns = len(structure.derivatives), len(structure.states)
    natural = rng.uniform(0.5, 5.0, k)
    config = FilterConfig(
        structure, -natural, natural, (25.0, 1.1), vane_ahead_m=ahead_m, imu_position_m=(0.2, 0.1, -0.1)
    )
    estimator = FilterEstimator(config)
    setup, at = estimator._fixed.setup, estimator.layout
    p = np.concatenate([0.3 * rng.standard_normal(at.size), np.zeros(at.channels)])
    memory: list[Any] = [np.zeros(a.shape[2:], dtype=a.dtype) for a in estimator.init(1).filters.lanes]
    lanes = Lanes(*memory)
    turning = np.array([{"q": 24.0, "r": -24.0}.get(s, 0.0) for s in structure.states])
    lanes.level[:] = 0.9, *turning
    floor = np.full(at.channels, 1e-3)
    build_lanes(setup, np.array([0.02, 25.0, *floor, *np.zeros(len(structure.inputs))]), p, lanes)
    lever = np.zeros((ns, ns))
    lever[0] = setup.lever
    model = FilterModel(at, natural, np.array([0]), lever, ahead_m, setup.rolling_m / 25.0)
    known = np.zeros((ns, ns))
    known[0] = turning
    window: Any = SimpleNamespace(
        levels=np.array([0.9]),
        level=np.zeros(1, dtype=np.int64),
        airspeed_m_s=25.0,
        known=known,
        dt=0.02,
        floor=floor,
    )
    for lane in (0, 3, at.copy.start + 1, at.gust + 1):
        moved = p[: at.size].copy()
        if lane:
            moved[lane - 1] += setup.step[lane - 1]
        system = model.system(moved, window)
        tight: Any = {"rtol": 1e-9, "atol": 1e-12}
        np.testing.assert_allclose(lanes.transition[..., lane], system.transition[0], **tight)
        np.testing.assert_allclose(lanes.noise[..., lane], system.noise[0], **tight)
        np.testing.assert_allclose(lanes.output[..., lane], system.output[0], **tight)
        np.testing.assert_allclose(lanes.variance[..., lane], system.variance, **tight)
        np.testing.assert_allclose(lanes.early[..., lane], system.early[0, :ns], **tight)
        np.testing.assert_allclose(lanes.late[..., lane], system.late[0, :ns], **tight)
