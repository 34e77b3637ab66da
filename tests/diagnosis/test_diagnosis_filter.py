"""Gains of a window's filter, and what changes a filter alone, against plain numpy."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import load_aircraft
from wingwatch.diagnosis.innovations import Filter, Mask, Path, kalman_filter, sensitivities
from wingwatch.diagnosis.linear_model import LinearModel, Noise
from wingwatch.diagnosis.noise import first_noise
from wingwatch.diagnosis.problem import Point, Problem, linear_at, prepare
from wingwatch.diagnosis.subject import subject_of
from wingwatch.diagnosis.windows import all_seen, fly_filtered
from wingwatch.simulation import Scenario, doublet_schedule, simulate

Array = NDArray[np.float64]


@cache
def problem() -> tuple[Problem, Point]:
    aircraft = load_aircraft("aerosonde")
    inputs = (doublet_schedule(aircraft, Scenario(aircraft).condition, spacing_s=3.0, start_s=2.0),)
    block = simulate(Scenario(aircraft, manoeuvres=inputs, turbulence="light", seed=5), 12.0)
    subject = subject_of(block, aircraft, {})
    return prepare(
        subject, replace(first_noise(subject), gusts=np.array([0.5, 0.5, 0.5, 0.05, 0.2, 0.2, 0.5]))
    )


def plain(linear: LinearModel, noise: Noise, used: tuple[int, ...], seen: Mask) -> tuple[Array, Array]:
    """Gains and deviations, one output after another (Anderson and Moore 1979, section 6.2)."""
    process, p = linear.covariances(noise)
    gain, deviation = np.zeros((*seen.shape, len(p))), np.ones(seen.shape)
    for t in range(len(seen)):
        for k in np.flatnonzero(seen[t]):
            h = linear.output[used[k]]
            s = h @ p @ h + noise.sensors[used[k]] ** 2
            gain[t, k], deviation[t, k] = p @ h / s, np.sqrt(s)
            p = p - np.outer(p @ h, p @ h) / s
        p = linear.transition @ p @ linear.transition.T + process
    return gain, deviation


def test_gains_are_those_of_a_plain_kalman_filter_where_readings_miss_and_where_none_does() -> None:
    its, point = problem()
    linear, seen = linear_at(its, 0, its.subject.model, point.noise), all_seen(its, 0)[:60].copy()
    for missing in (False, True):
        seen[30:40, 1] &= not missing
        found = kalman_filter(linear, point.noise, its.used, seen)
        gain, deviation = plain(linear, point.noise, its.used, seen)
        np.testing.assert_allclose(found.gain, gain[: len(found.gain)], rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(found.deviation, deviation[: len(found.gain)], rtol=1e-9)


def differentiated(base: Filter, other: Filter, path: Path, step: float) -> Array:
    """What a filter changes of the innovations of a path, output by output, (samples, used)."""
    f, h = base.linear.transition, base.output
    by_f, by_h = (other.linear.transition - f) / step, (other.output - h) / step
    by_gain, x = (other.gain - base.gain) / step, np.zeros(len(f))
    column = np.zeros(path.innovations.shape)
    for t in range(len(column)):
        at = min(t, len(base.gain) - 1)
        for k in np.flatnonzero(path.seen[t]):
            column[t, k] = -by_h[k] @ path.before[t, k] - h[k] @ x
            x = x + base.gain[at, k] * column[t, k] + by_gain[at, k] * path.innovations[t, k]
        x = f @ x + by_f @ path.after[t]
    return column


def test_what_changes_a_filter_alone_is_the_same_for_versions_and_windows_side_by_side() -> None:
    its, point = problem()
    model, seen, step = its.subject.model, all_seen(its, 0), 1e-3
    noise, measured = point.noise, its.subject.flight.outputs
    louder = noise.sensors * np.where(np.arange(len(noise.sensors)) == 2, np.exp(step), 1.0)
    noises = [replace(noise, sensors=louder), replace(noise, gradients=noise.gradients * np.exp(step))]
    linear = [linear_at(its, 0, model, one) for one in noises]
    base = kalman_filter(linear_at(its, 0, model, noise), noise, its.used, seen)
    path = fly_filtered(its, 0, model, point.trims[0], base, measured, air_too=True)
    short = Path(
        path.innovations[:100], path.deviation[:100], path.seen[:100], path.before[:100], path.after[:100]
    )
    versions = list(zip(linear, noises, strict=True))
    spreads, found = sensitivities(base, seen, versions, step, [path, short])
    for v, version in enumerate(versions):
        other = kalman_filter(*version, its.used, seen, base)
        said = np.log(other.deviation / base.deviation) / step
        np.testing.assert_allclose(spreads[..., v], said, rtol=1e-7, atol=1e-9)
        column = differentiated(base, other, path, step)
        for columns in found:
            np.testing.assert_allclose(columns[..., v], column[: len(columns)], rtol=1e-6, atol=1e-8)
