"""Actuators against their own equations, and what is wrong with them against its definition."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.aircraft import load_aircraft
from wingwatch.simulation.actuators import actuator_position, move_surfaces, servo_decay
from wingwatch.simulation.layout import INDEX, parameter_row
from wingwatch.simulation.rigid_body import ELEVATOR, SETTING_WIDTH

Array = NDArray[np.float64]
HALF_STEP = 0.005
CLEAN = parameter_row(load_aircraft("aerosonde"))
"""8 Hz, with rate and position limits."""


class Surfaces:
    """The three surfaces of an aircraft under changed parameters, stepped with commands to the elevator."""

    def __init__(self, at: float = 0.0, **changes: float) -> None:
        self.row = CLEAN.copy()
        for name, value in changes.items():
            self.row[INDEX[f"elevator_{name}"]] = value
        self.servo, self.surface = np.full(3, at), np.full(3, at)
        self.setting, self.decay = np.zeros(SETTING_WIDTH), np.zeros(3)
        servo_decay(self.row, HALF_STEP, self.decay)

    def flown_by(self, command: float, steps: int = 1) -> Array:
        """Elevator at start, middle and end of each step, shape (3 steps,)."""
        out = []
        for _ in range(steps):
            commands = np.array([command, 0.0, 0.0])
            move_surfaces(self.row, self.setting, self.servo, self.surface, commands, self.decay, HALF_STEP)
            out += [self.setting[ELEVATOR + 3 * stage] for stage in range(3)]
        return np.array(out)


@pytest.mark.parametrize("target", [0.05, -0.3, 0.4])
@pytest.mark.parametrize("after", [0.0, 0.01, 0.08, 0.5])
def test_a_servo_follows_its_equation(target: float, after: float) -> None:
    bandwidth, rate_limit, start = 50.0, 3.5, 0.1
    x, steps = start, 20_000
    for _ in range(steps):
        x += after / steps * max(-rate_limit, min(rate_limit, bandwidth * (target - x)))
    # Euler's method errs by half a step of the largest curvature: rate_limit x bandwidth x after x (after / steps) / 2
    worst = 0.5 * rate_limit * bandwidth * after * after / steps + 1e-12
    assert actuator_position(start, target, bandwidth, rate_limit, after) == pytest.approx(x, abs=worst)


def test_an_ideal_servo_is_where_it_is_told() -> None:
    assert actuator_position(0.1, 0.3, math.inf, math.inf, 0.0) == 0.3
    assert actuator_position(0.1, 0.5, math.inf, 2.0, 0.01) == pytest.approx(0.12, abs=1e-15)
    ideal = Surfaces(0.1, bandwidth=math.inf, rate_limit=math.inf, limit=0.4)
    assert ideal.flown_by(0.3).tolist() == [0.3] * 3
    assert ideal.flown_by(0.5).tolist() == [0.4] * 3


def test_half_a_step_twice_is_a_step() -> None:
    once = actuator_position(0.0, 0.3, 50.0, 3.5, 0.12)
    half = actuator_position(0.0, 0.3, 50.0, 3.5, 0.06)
    assert actuator_position(half, 0.3, 50.0, 3.5, 0.06) == pytest.approx(once, rel=1e-12)


@pytest.mark.parametrize("command", [0.02, 0.3])
def test_a_surface_is_its_servo_in_closed_form(command: float) -> None:
    """Within the rate limit and beyond it, at start, middle and end of every step."""
    flown = Surfaces().flown_by(command, 12)
    bandwidth, rate_limit = CLEAN[INDEX["elevator_bandwidth"]], CLEAN[INDEX["elevator_rate_limit"]]
    times = [(2 * step + stage) * HALF_STEP for step in range(12) for stage in range(3)]
    wanted = [actuator_position(0.0, command, bandwidth, rate_limit, t) for t in times]
    assert flown == pytest.approx(wanted, rel=1e-12)


def test_the_position_limit_holds_command_and_offset_together() -> None:
    limit = CLEAN[INDEX["elevator_limit"]]
    assert Surfaces(offset=0.1).flown_by(limit - 0.05, 200)[-1] == pytest.approx(limit, abs=1e-12)
    assert Surfaces(offset=0.1).flown_by(-0.2, 200)[-1] == pytest.approx(-0.1, abs=1e-12)


def test_a_servo_does_not_answer_within_its_dead_band() -> None:
    surfaces = Surfaces(dead_band=0.04)
    assert np.all(surfaces.flown_by(0.0199, 50) == 0.0)
    # beyond it, it goes to where the error is half the dead band
    assert surfaces.flown_by(0.1, 200)[-1] == pytest.approx(0.08, abs=1e-12)
    assert np.all(surfaces.flown_by(0.0601, 50) == pytest.approx(0.08, abs=1e-12))
    assert surfaces.flown_by(0.0, 200)[-1] == pytest.approx(0.02, abs=1e-12)


def test_play_is_a_loop_as_wide_as_it_is_stated() -> None:
    surfaces, play = Surfaces(backlash=0.04), 0.04
    up = surfaces.flown_by(0.2, 200)[-1]
    assert up == pytest.approx(0.2 - 0.5 * play, abs=1e-9)
    back = surfaces.flown_by(0.2 - 0.99 * play, 200)
    assert np.all(back == up)  # the servo crosses its play, the surface stands
    assert surfaces.flown_by(0.2 - 1.5 * play, 200)[-1] == pytest.approx(0.2 - play, abs=1e-9)


def test_a_hardover_runs_at_the_rate_limit_and_stays() -> None:
    place, rate = 0.3, CLEAN[INDEX["elevator_rate_limit"]]
    surfaces = Surfaces(0.05, stuck=1.0, stuck_at=place)
    flown = surfaces.flown_by(-0.1, 40)
    times = np.array([(2 * step + stage) * HALF_STEP for step in range(40) for stage in range(3)])
    assert flown == pytest.approx(np.minimum(place, 0.05 + rate * times), abs=1e-12)


def test_a_surface_stuck_where_it_is_stays_there() -> None:
    surfaces = Surfaces(0.05)
    here = surfaces.flown_by(0.2, 2)[-1]
    surfaces.row[INDEX["elevator_stuck"]], surfaces.row[INDEX["elevator_stuck_at"]] = 1.0, math.nan
    assert np.all(surfaces.flown_by(-0.3, 50) == here)


def test_what_befalls_one_surface_leaves_the_others() -> None:
    surfaces = Surfaces(stuck=1.0, stuck_at=0.2, backlash=0.1)
    command = np.array([0.0, 0.05, -0.05])
    for _ in range(300):
        move_surfaces(
            surfaces.row,
            surfaces.setting,
            surfaces.servo,
            surfaces.surface,
            command,
            surfaces.decay,
            HALF_STEP,
        )
    assert surfaces.surface == pytest.approx([0.2, 0.05, -0.05], abs=1e-9)
