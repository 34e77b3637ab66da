"""Where a surface is between two readings, beside a servo flown in fine steps."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.estimators.kernels.intersample import Servos, means_of_rows, servos_of, surface_means

SERVO_S = 1.0 / (2.0 * np.pi * 8.0)
FRAME_HZ = 50.0
FINE = 200
Array = NDArray[np.float64]


def flown(commands: Array, frames: int) -> tuple[Array, Array, Array, Array]:
    """A servo with ``commands``, one a frame, read every so many ``frames``.

    Returns:
        of every step readings at both ends (steps + 1,), how far the command is ahead of them, and the two means.
    """
    t = (np.arange(FINE) + 0.5) / FINE / FRAME_HZ
    at, surface = np.zeros(commands.size + 1), np.empty((commands.size, FINE))
    for k, commanded in enumerate(commands):
        surface[k] = commanded + (at[k] - commanded) * np.exp(-t / SERVO_S)
        at[k + 1] = commanded + (at[k] - commanded) * np.exp(-1.0 / (FRAME_HZ * SERVO_S))
    readings = at[:-1:frames]
    ahead = commands[::frames] - readings
    off = surface.reshape(-1, frames * FINE)[: readings.size] - readings[:, None]
    share = (np.arange(frames * FINE) + 0.5) / (frames * FINE)
    return readings, ahead, off.mean(axis=1), (off * (0.5 - share)).mean(axis=1)


def means(readings: Array, ahead: Array, frames: int, variance: float = 0.0) -> Array:
    """``SurfaceMeans`` of every step but the first and the last, (steps, 4)."""
    change = np.diff(readings)
    return np.array([
        surface_means(frames / FRAME_HZ, SERVO_S, variance, change[k - 1], change[k], ahead[k], ahead[k + 1])
        for k in range(1, change.size)
    ])  # fmt: skip


def walk(frames: int, steps: int = 4000) -> Array:
    return np.asarray(0.01 * np.cumsum(np.random.default_rng(4).standard_normal(frames * steps)))


def doublets(frames: int) -> Array:
    """Commands that change seldom, at any frame."""
    rng, command, now = np.random.default_rng(5), np.zeros(frames * 400), 0.0
    for k in range(command.size):
        if rng.random() < 0.05:
            now = float(rng.choice([-0.035, 0.0, 0.035]))
        command[k] = now
    return command


@pytest.mark.parametrize("commands", [walk, doublets])
def test_where_commands_at_both_ends_are_known_two_in_a_step_are_known_exactly(commands: object) -> None:
    readings, ahead, mean, early = flown(commands(2), 2)  # type: ignore[operator]
    found = means(readings, ahead, 2)
    exact = found[:, 3] < 1e-15
    assert exact.mean() > (0.4 if commands is walk else 0.95), (
        "two commands that undo each other look like a fault"
    )
    np.testing.assert_allclose(found[exact, 0], mean[1:-1][exact], atol=1e-6)
    np.testing.assert_allclose(found[exact, 1], early[1:-1][exact], atol=1e-6)


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("frames", [2, 3, 5])
def test_what_is_not_known_of_a_random_walk_is_as_large_as_it_is_said(frames: int, known: bool) -> None:
    readings, ahead, mean, _ = flown(walk(frames), frames)
    found = means(readings, ahead if known else np.zeros(ahead.size), frames)
    error = found[:, 0] - mean[1:-1]
    even = 0.5 * np.diff(readings)[1:] - mean[1:-1]
    assert np.mean(error**2) < (0.6 if known else 1.0) * np.mean(even**2)
    assert np.mean(found[:, 3]) == pytest.approx(np.mean(error**2), rel=0.15)


def test_a_surface_that_stays_where_it_is_does_not_move_with_its_command() -> None:
    commands = doublets(2)
    readings = np.full(commands.size // 2, 0.01)
    found = means(readings, commands[::2] - readings, 2)
    np.testing.assert_array_equal(
        found, np.column_stack([np.zeros((len(found), 2)), found[:, 2], np.zeros(len(found))])
    )


def test_a_surface_whose_servo_is_not_known_goes_evenly() -> None:
    commanded = surface_means(0.05, np.inf, 0.0, 0.01, 0.02, 0.03, 0.01)
    assert commanded == pytest.approx((0.01, -0.02 / 12.0, 0.5, 0.0))


def test_noise_of_a_reading_is_no_command() -> None:
    """A surface that comes to rest, its command at rest: only noise speaks against the servo."""
    rng, std = np.random.default_rng(6), 1e-3
    readings, ahead, mean, _ = flown(doublets(2), 2)
    noisy = readings + std * rng.standard_normal(readings.size)
    off = readings - noisy
    blind = means(noisy, ahead + off, 2)[:, 0] - mean[1:-1] - off[1:-1]
    aware = means(noisy, ahead + off, 2, std * std)[:, 0] - mean[1:-1] - off[1:-1]
    assert np.mean(aware**2) < 0.7 * np.mean(blind**2)
    assert np.sqrt(np.mean(aware**2)) < 1.5 * std


@pytest.mark.parametrize("step_s", [0.0025, 0.01, 0.02])
@pytest.mark.parametrize("change", [0.01, 0.03, 0.045, -0.06, 0.2, -1.0])
def test_a_surface_at_its_rate_limit_goes_evenly_and_then_as_its_servo_does(
    change: float, step_s: float
) -> None:
    """Beside fine steps of dx/dt = (command - x) / T, at most 2.6 rad/s; the command steps with the reading."""
    rate, fine = 2.6, 40_000
    moved, t = np.zeros(fine + 1), step_s / fine
    for k in range(fine):
        moved[k + 1] = moved[k] + t * np.clip((change - moved[k]) / SERVO_S, -rate, rate)
    middle, share = 0.5 * (moved[1:] + moved[:-1]), (np.arange(fine) + 0.5) / fine
    rows = np.zeros((3, 14))
    rows[:, 0], rows[2, 4] = [-step_s, 0.0, step_s], moved[-1]
    servos = servos_of((SERVO_S,), (rate,), (False,))
    found = means_of_rows(rows[2], rows[1], rows[0], 0, 4, servos, np.zeros(1))
    assert found.mean == pytest.approx(middle.mean(), rel=1e-3)
    assert found.early == pytest.approx(np.mean((0.5 - share) * middle), rel=1e-3)
    assert found.variance == 0.0


def test_a_rate_limit_belongs_to_a_servo_that_is_known() -> None:
    found = servos_of((0.02, 0.0, 0.02, 0.02), (2.0, 2.0, 2.0, 0.0), (False, False, True, False))
    np.testing.assert_array_equal(found.time_s, [0.02, np.inf, 0.0, 0.02])
    np.testing.assert_array_equal(found.rate_rad_s, [2.0, np.inf, np.inf, np.inf])
    assert isinstance(servos_of((), (), (False,)), Servos)
