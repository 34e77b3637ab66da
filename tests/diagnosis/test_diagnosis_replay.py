"""Replay and innovations: a perfect simulation leaves sensor noise, a wrong one does not."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.aircraft import STRUCTURES, FlightCondition, load_aircraft
from wingwatch.diagnosis import noise as noise_levels
from wingwatch.diagnosis import search
from wingwatch.diagnosis.candidate import INDEX, FreeParameter, Subject
from wingwatch.diagnosis.causes import candidates
from wingwatch.diagnosis.diagnose import _reported
from wingwatch.diagnosis.evaluation import evaluate, reduce
from wingwatch.diagnosis.extension import extended
from wingwatch.diagnosis.fit import Solution, fit
from wingwatch.diagnosis.innovations import Filter, Path, kalman_filter
from wingwatch.diagnosis.linear_aircraft import concise, row_of_derivatives
from wingwatch.diagnosis.linear_model import STATES, WIDTH
from wingwatch.diagnosis.measured import OUTPUTS, DiagnosisError, measure
from wingwatch.diagnosis.misfit import replayed
from wingwatch.diagnosis.noise import first_noise, fit_noise
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError, linear_at, prepare
from wingwatch.diagnosis.replay import (
    DELAY,
    TRIMS,
    Model,
    body_state,
    fly_window,
    move,
    read_sensors,
    ready,
    with_trims,
    without_delays,
    work_space,
)
from wingwatch.diagnosis.small_errors import SmallErrors
from wingwatch.diagnosis.subject import subject_of
from wingwatch.diagnosis.windows import all_seen, fly_filtered, open_loop
from wingwatch.simulation import Scenario, doublet_schedule, linearise, parse_effect, simulate
from wingwatch.simulation.effects.effect import Parameters
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

Array = NDArray[np.float64]

AEROSONDE = load_aircraft("aerosonde")
CRUISE = FlightCondition(25.0, 1000.0)


@cache
def flown(noise: bool = True, seconds: float = 20.0) -> SampleBlock:
    inputs = (doublet_schedule(AEROSONDE, CRUISE, spacing_s=3.0, start_s=2.0),)
    return simulate(Scenario(AEROSONDE, manoeuvres=inputs, noise=noise, seed=5), seconds)


def problem_of(block: SampleBlock) -> tuple[Subject, Problem, Point]:
    subject = subject_of(block, AEROSONDE, {})
    problem, point = prepare(subject, first_noise(subject))
    return subject, problem, point


def test_a_replay_of_a_clean_flight_follows_it() -> None:
    _, problem, point = problem_of(flown(noise=False))
    both = replayed(problem, fit(problem, point).point)
    for name in ("pitch_rate_rad_s", "roll_rate_rad_s", "yaw_rate_rad_s", "specific_force_z_m_s2"):
        k = OUTPUTS.index(name)
        off = np.concatenate([a - b for a, b in both.pairs(k)])
        moved = np.concatenate([a - a.mean() for a, _ in both.pairs(k)])
        assert np.std(off) < 0.01 * np.std(moved), name


def test_innovations_of_a_right_simulation_are_the_sensors_noise() -> None:
    subject, problem, point = problem_of(flown())
    point = fit_noise(problem, fit(problem, point).point)
    fitted = point.noise.sensors[list(problem.used)] / subject.flight.noise_std[list(problem.used)]
    np.testing.assert_allclose(fitted[:11], 1.0, atol=0.12)  # 1000 samples: 2 %, and stated noise is exact
    assert (fitted[11:] < 0.2).all()  # servos are as stated: what positions lack is their sensors' noise
    evaluation = evaluate(problem, point)
    square = sum(float(b[:, 0, 0].sum()) for b in evaluation.blocks)
    assert square / evaluation.readings == pytest.approx(1.0, abs=0.04)


def test_innovations_of_a_right_simulation_in_gusts_are_white_where_its_open_loop_is_not() -> None:
    inputs = (doublet_schedule(AEROSONDE, CRUISE, spacing_s=3.0, start_s=2.0),)
    block = simulate(Scenario(AEROSONDE, manoeuvres=inputs, turbulence="moderate", seed=5), 40.0)
    subject, problem, point = problem_of(block)
    point = search.settled(problem, point).point
    evaluation = evaluate(problem, point)
    square = sum(float(b[:, 0, 0].sum()) for b in evaluation.blocks)
    assert square / evaluation.readings == pytest.approx(1.0, abs=0.04)
    stated = subject.flight.noise_std
    np.testing.assert_allclose((point.noise.sensors / stated)[[0, 1, 2, 3, 7, 8, 9, 10]], 1.0, atol=0.2)
    off = np.concatenate([a - b for a, b in replayed(problem, point).pairs(2)])
    assert np.std(off) > 3.0 * stated[2]


def test_equation_1_predicts_what_a_small_change_of_the_start_does() -> None:
    subject, problem, point = problem_of(flown(noise=False))
    linear = linear_at(problem, 0, subject.model, point.noise)
    for j, size in ((2, 0.05), (3, 0.01), (4, 0.01), (5, 0.01)):
        starts = np.tile(problem.starts[0], (2, 1))
        starts[1, j] += size
        usual, moved = open_loop(problem, 0, subject.model, starts, np.tile(point.trims[0], (2, 1)))
        change = (moved - usual)[:50]
        x = np.zeros(len(linear.transition))
        x[j] = size
        said = []
        for _ in change:
            said.append(linear.output @ x)
            x = linear.transition @ x
        k = int(np.argmax(np.abs(change).max(axis=0) / subject.flight.noise_std))
        np.testing.assert_allclose(np.array(said)[:, k], change[:, k], atol=0.03 * np.abs(change[:, k]).max())


@pytest.mark.parametrize("state", [2, 7, 8, 10])
def test_what_disturbs_moves_the_simulation_as_equation_1_says(state: int) -> None:
    subject, problem, point = problem_of(flown(noise=False))
    linear = linear_at(problem, 0, subject.model, point.noise)
    course = np.zeros((100, WIDTH))
    course[0, STATES + state] = 1e-3  # w, p, pitch acceleration, noise of the elevator's sensor
    for t in range(1, len(course)):
        course[t] = linear.transition @ course[t - 1]
    blown = course @ linear.disturbance.T

    def flies(air: Array) -> Array:
        inputs, c = problem.inputs[0], with_trims(subject.model.row, point.trims[0])
        work, out = work_space(inputs.steps), np.empty((len(air), len(OUTPUTS)))
        x = body_state(problem.starts[0], inputs.altitude)
        ready(c, inputs, work)
        for t in range(len(air)):
            read_sensors(c, x, inputs, t, work, air[t], out[t])
            move(c, x, inputs, t, work, air[t], air[min(t + 1, len(air) - 1)])
        return out

    change, said = flies(blown) - flies(np.zeros_like(blown)), course @ linear.output.T
    for k in range(1, 7):
        size = np.abs(change[:, k]).max()
        if size > 0.01 * subject.flight.noise_std[k]:
            np.testing.assert_allclose(said[:, k], change[:, k], atol=0.06 * size)


def test_thrust_that_is_not_known_is_no_side_force() -> None:
    """Drag turns with the flow; what a window has of its own instead of thrust must not."""
    bare = AEROSONDE.model_copy(update={"propulsion": None})
    subject = subject_of(flown(noise=False), bare, {})
    problem, point = prepare(subject, first_noise(subject))
    assert TRIMS[5] == "thrust_to_weight"
    assert 5 in problem.free_trims
    trims = np.tile(point.trims[0], (2, 1))
    trims[1, 5] += 0.05
    starts = np.tile(problem.starts[0], (2, 1))
    starts[:, 1] = 2.0  # sideslip
    change = np.diff(open_loop(problem, 0, subject.model, starts, trims), axis=0)[0, 0]
    throttle = problem.inputs[0].throttle  # thrust of a window's own follows it, about its mean
    assert throttle.mean() == pytest.approx(1.0)
    assert change[4] == pytest.approx(0.05 * throttle[0] * 9.80665, rel=1e-6)
    assert abs(change[5]) < 1e-9
    assert abs(change[6]) < 1e-9


@pytest.mark.parametrize(("lost", "matters"), [(0.3, True), (0.002, False)])
def test_a_cause_that_changes_next_to_nothing_does_not_matter(lost: float, matters: bool) -> None:
    subject, problem, point = problem_of(flown())
    weak = next(c for c in candidates(subject) if c.label == "elevator_effectiveness")
    solution = fit(problem, point)
    point = replace(solution.point, causes=(weak,), values=(np.array([lost]),))
    assert search._matters(problem, replace(solution, point=point)) is matters


def test_a_delay_matters_though_it_changes_nothing_that_is_simulated() -> None:
    subject, problem, point = problem_of(flown())
    late = next(c for c in candidates(subject) if c.label == "sensor_delay[pitch_rate_rad_s]")
    solution = fit(problem, point)
    for delay_s, matters in ((0.05, True), (0.0005, False)):
        delayed = replace(solution.point, causes=(late,), values=(np.array([delay_s]),))
        assert search._matters(problem, replace(solution, point=delayed)) is matters


def test_a_change_below_the_noise_of_its_sensor_does_not_matter() -> None:
    subject, problem, point = problem_of(flown())
    late = next(c for c in candidates(subject) if c.label == "sensor_delay[pitch_rate_rad_s]")
    solution = fit(problem, point)
    for louder, matters in ((1.0, True), (1000.0, False)):
        noise = replace(solution.point.noise, sensors=louder * solution.point.noise.sensors)
        delayed = replace(solution.point, causes=(late,), values=(np.array([0.05]),), noise=noise)
        assert search._matters(problem, replace(solution, point=delayed)) is matters


@pytest.mark.parametrize(
    ("squares", "most"),
    [
        ([], 0.0),
        ([4.0], 4.0),
        ([1.0, 5.0, 3.0, 0.0], 4.0),
        ([0.0, math.nan, 0.0], math.inf),
        ([math.inf], math.inf),
    ],
)
def test_where_an_output_changes_most(squares: list[float], most: float) -> None:
    assert search._largest_mean(np.array(squares), 2) == most


def test_fits_that_may_be_best_are_settled_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    subject, problem, point = problem_of(flown())
    causes = [
        c for c in candidates(subject) if c.label in ("elevator_effectiveness", "pitch_damping", "cg_shift")
    ]
    here = fit(problem, replace(point, causes=(causes[0],), values=(np.zeros(1),)))
    points = [replace(here.point, causes=(cause,)) for cause in causes]
    fits = [
        replace(here, point=p, cost=here.cost - gain)
        for p, gain in zip(points, (100.0, 40.0, 20.0), strict=True)
    ]
    anew: list[str] = []

    def better(_: Problem, point: Point) -> Solution:
        anew.append(point.causes[-1].label)
        return replace(here, point=point, cost=here.cost - 150.0)

    monkeypatch.setattr(search, "settled_anew", better)
    gains = [t.gain for t in search._at_their_best(problem, here, fits)]
    assert anew == [c.label for c in causes[:2]]
    assert gains == pytest.approx([150.0, 150.0, 20.0])


@pytest.mark.parametrize("name", ["aerosonde", "twinotter"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_loss_of_a_wing_that_is_looked_for_is_the_one_that_is_simulated(name: str, side: str) -> None:
    aircraft = load_aircraft(name)
    assert aircraft.envelope is not None
    at = aircraft.envelope.cruise
    inputs = (doublet_schedule(aircraft, at, spacing_s=3.0, start_s=2.0),)
    block = simulate(Scenario(aircraft, at.airspeed_true_m_s, at.altitude_m, inputs), 12.0)
    subject = subject_of(block, aircraft, {})
    lost = next(c for c in candidates(subject) if c.label == f"wing_damage[{side}]")
    for size in (0.0, 0.1, 0.5):
        looked_for, simulated = subject.model.copy(), subject.model.row.copy()
        lost.change(looked_for, np.array([size]))
        effect = parse_effect(f"wing_damage[{side}]:{size or 0.1}@0")
        effect.apply(Parameters(aircraft, at, simulated), size)
        np.testing.assert_allclose(looked_for.row, simulated, rtol=0.02, atol=1e-5)
        assert np.array_equal(looked_for.row, subject.model.row, equal_nan=True) == (size == 0.0)


def test_a_fit_begins_at_the_noise_that_is_likeliest_of_a_few() -> None:
    for air in ("none", "moderate"):
        inputs = (doublet_schedule(AEROSONDE, CRUISE, spacing_s=3.0, start_s=2.0),)
        _, problem, point = problem_of(
            simulate(Scenario(AEROSONDE, manoeuvres=inputs, turbulence=air, seed=5), 20.0)
        )
        gusts = noise_levels.likeliest_level(problem, point).noise.gusts
        speed = CRUISE.airspeed_true_m_s
        assert (gusts[1] > 0.01 * speed) == (air == "moderate"), air


@pytest.mark.parametrize("all_of_them", [False, True])
def test_a_noise_from_which_the_simulation_runs_away_is_passed_over(
    monkeypatch: pytest.MonkeyPatch, all_of_them: bool
) -> None:
    _, problem, point = problem_of(flown())
    usual = fly_filtered
    chosen = noise_levels.likeliest_level(problem, point).noise

    def runs_away(
        problem: Problem, w: int, model: Model, trims: Array, filtering: Filter, read: Array
    ) -> Path:
        path = usual(problem, w, model, trims, filtering, read)
        here = filtering.deviation[-1]
        away = all_of_them or np.allclose(here, deviation, rtol=1e-9)
        return path._replace(innovations=np.full_like(path.innovations, np.nan)) if away else path

    linear = linear_at(problem, 0, problem.subject.model, chosen)
    deviation = kalman_filter(linear, chosen, problem.used, all_seen(problem, 0)).deviation[-1]
    monkeypatch.setattr(noise_levels, "fly_filtered", runs_away)
    if all_of_them:
        with pytest.raises(RunsAwayError):
            noise_levels.likeliest_level(problem, point)
    else:
        other = noise_levels.likeliest_level(problem, point).noise
        assert not np.array_equal(other.gusts, chosen.gusts)


def test_a_state_that_is_followed_moves_on_a_straight_line_between_samples() -> None:
    subject, problem, point = problem_of(flown(noise=False))
    inputs, count = problem.inputs[0], 100
    follow = np.full_like(inputs.follow, np.nan)
    follow[:, 3] = 0.5 * inputs.dt * np.arange(len(follow))  # roll rate
    follow[:, 4:6] = follow[:, 7] = 0.0
    start = body_state(np.array([25.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), inputs.altitude)
    out, row = np.empty((1, len(inputs.flown), len(OUTPUTS))), subject.model.row.copy()
    row[[i for name, i in INDEX.items() if name.startswith("Cl_")]] = 0.0  # no equation for what is followed
    fly_window(
        row[None],
        start[None],
        point.trims[:1],
        inputs._replace(follow=follow),
        np.full(len(inputs.flown), np.nan),
        out,
    )
    time_s = inputs.dt * np.arange(count)
    np.testing.assert_allclose(out[0, :count, 7], 0.25 * time_s**2, rtol=0.005)  # held: 1 % short


def test_a_derivative_is_known_to_a_percent_at_best_though_the_residual_shows_no_error() -> None:
    along = np.random.default_rng(12).standard_normal((400, 3))
    along[:, 1] = (
        3.0 * along[:, 0] + 0.01 * along[:, 1]
    )  # a coefficient that does what the cause does, three times
    found = SmallErrors(np.zeros(3), along.T @ along, 1, np.array([False, True]))
    assert found.beside(1.0).covariance[0, 0] == pytest.approx(1.0 / (along[:, 0] @ along[:, 0]))
    known = found.beside(1.0, least=0.2)
    assert known.levels == (0.2, 0.0)
    assert np.sqrt(known.covariance[0, 0]) == pytest.approx(3.0 * 0.2, rel=0.05)


def test_small_errors_of_everything_widen_an_interval_as_far_as_they_move_the_cause() -> None:
    rng = np.random.default_rng(11)
    along = rng.standard_normal((400, 13))  # by a cause, and by twelve coefficients that resemble it
    along[:, 1:] += 0.5 * along[:, :1]
    along /= 2.0
    constant = np.arange(12) >= 9
    for size in (0.0, 0.5):
        inside = alone = none = 0
        for _ in range(200):
            errors = size * rng.standard_normal(12) * ~constant
            residual = along[:, 1:] @ errors + rng.standard_normal(400)
            found = SmallErrors(along.T @ residual, along.T @ along, 1, constant)
            beside = found.beside(1.0)
            inside += bool(abs(beside.step[0]) < 1.96 * np.sqrt(beside.covariance[0, 0]))
            plain = float(along[:, 0] @ residual / (along[:, 0] @ along[:, 0]))
            alone += bool(abs(plain) < 1.96 * float(along[:, 0] @ along[:, 0]) ** -0.5)
            none += bool(beside.levels[0] < 0.1)
        assert 180 <= inside <= 198, size
        if size:
            assert alone < 100
            assert none == 0
        else:
            assert none > 150


def test_a_rate_limit_is_reported_as_a_limit() -> None:
    parameter = FreeParameter("rate_limit_rad_s", "rad/s", 0.1, 1.0, 0.1, inverse=True)
    said = _reported(parameter, 4.0, 0.4)
    assert said.value == pytest.approx(0.25)
    assert said.standard_error == pytest.approx(0.025)
    assert said.unit == "rad/s"


def test_the_gradient_is_that_of_the_cost() -> None:
    subject, problem, point = problem_of(flown())
    point = fit(problem, point).point
    chosen = [
        c for c in candidates(subject) if c.label in ("pitch_damping", "sensor_bias[angle_of_attack_rad]")
    ]
    point = replace(point, causes=tuple(chosen), values=tuple(np.zeros(1) for _ in chosen))
    here = evaluate(problem, point)
    score = reduce(problem, point, here).score
    for i, step in enumerate((1e-3, 1e-5)):
        cost = []
        for side in (-1.0, 1.0):
            values = tuple(np.array([side * step]) if j == i else np.zeros(1) for j in range(2))
            there = evaluate(problem, replace(point, values=values), weights=here.deviations)
            cost.append(reduce(problem, replace(point, values=values), there).cost)
        assert (cost[0] - cost[1]) / (2.0 * step) == pytest.approx(
            score[i], rel=0.02, abs=0.02 * abs(score).max()
        )


def test_a_delay_is_a_shift_that_keeps_the_noise() -> None:
    subject, _, _ = problem_of(flown())
    sensors = np.zeros((len(OUTPUTS), 3))
    k = OUTPUTS.index("pitch_rate_rad_s")
    sensors[k, DELAY] = 2.5 * subject.flight.dt_s
    moved = without_delays(subject.flight, Model(subject.model.row, sensors))[:, k]
    inner = slice(50, -50)
    assert np.std(np.diff(moved[inner], 3)) == pytest.approx(
        np.std(np.diff(subject.flight.outputs[inner, k], 3)), rel=0.05
    )
    sensors[k, DELAY] = 3.0 * subject.flight.dt_s
    whole = without_delays(subject.flight, Model(subject.model.row, sensors))[:, k]
    np.testing.assert_allclose(whole[100:-100], subject.flight.outputs[103:-97, k], atol=2e-3)


def test_derivatives_alone_make_an_aircraft_that_has_them() -> None:
    table = {s: v for name in ("short_period", "lateral") for s, v in _linearised(name).items()}
    entry = {
        "airspeed_true_m_s": 25.0, "altitude_m": 1000.0, "provenance": "a-priori", "angle_of_attack_rad": 0.05,
        "derivatives": {s: {"value": v, "standard_error": 1.0} for s, v in table.items()},
    }  # fmt: skip
    whole = AEROSONDE.model_dump() | {"coefficients": None, "conditions": [entry]}
    bare = type(AEROSONDE).model_validate(whole)
    row = row_of_derivatives(bare, bare.conditions[0])
    found = concise(row, bare.conditions[0].condition, tuple(table))
    np.testing.assert_allclose(found, list(table.values()), rtol=1e-6, atol=1e-6)


def _linearised(name: str) -> dict[str, float]:
    return linearise(AEROSONDE, CRUISE, STRUCTURES[name])


def test_information_of_two_windows_is_the_sum_of_theirs() -> None:
    _, problem, point = problem_of(flown())
    further = candidates(problem.subject)[:5]
    both = reduce(problem, point, evaluate(problem, point, further)).information
    parts = [
        reduce(
            problem.part([w]), point.part([w]), evaluate(problem.part([w]), point.part([w]), further)
        ).information
        for w in range(len(problem.windows))
    ]
    np.testing.assert_allclose(sum(parts), both, rtol=0.02, atol=1e-3 * np.abs(both).max())


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("short", "needs 10 s"),
        ("no pitch rate", "has no pitch_rate_rad_s"),
        ("no rudder", "neither rudder_rad nor rudder_command_rad"),
    ],
)
def test_a_flight_that_cannot_be_replayed_is_refused_in_one_sentence(change: str, sentence: str) -> None:
    values = flown().values.copy()
    if change == "short":
        values = values[:300]
    elif change == "no pitch rate":
        values[:, CHANNEL_INDEX["pitch_rate_rad_s"]] = math.nan
    else:
        values[:, [CHANNEL_INDEX["rudder_rad"], CHANNEL_INDEX["rudder_command_rad"]]] = math.nan
    with pytest.raises(DiagnosisError, match=sentence):
        measure(SampleBlock(values), AEROSONDE, {})


@pytest.mark.parametrize("table", ["mass", "geometry"])
def test_an_aircraft_that_cannot_be_flown_is_refused_in_one_sentence(table: str) -> None:
    bare = AEROSONDE.model_copy(update={table: None})
    with pytest.raises(DiagnosisError, match=f"states no .{table}."):
        subject_of(flown(), bare, {})
    nothing = AEROSONDE.model_copy(update={"coefficients": None, "conditions": ()})
    with pytest.raises(DiagnosisError, match="nothing to simulate"):
        subject_of(flown(), nothing, {})


def test_a_sensor_that_is_early_among_late_ones_has_a_place_in_the_file() -> None:
    subject, _, point = problem_of(flown())
    named = {c.label: c for c in candidates(subject)}
    causes = (named["sensor_delay[roll_rate_rad_s]"], named["sensor_delay[inertial]"])
    late = replace(point, causes=causes, values=(np.array([-0.01]), np.array([0.04])))
    mended = extended(subject, late, (np.array([1e-3]), np.array([1e-3])))
    assert mended is not None
    before, after = AEROSONDE.sensors.delay_s, mended.sensors.delay_s
    assert after["roll_rate_rad_s"] == pytest.approx(before.get("roll_rate_rad_s", 0.0) + 0.03)
    assert after["pitch_rate_rad_s"] == pytest.approx(before.get("pitch_rate_rad_s", 0.0) + 0.04)
