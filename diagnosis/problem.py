"""A flight cut into windows, ready to be fitted; and a point: causes in the model, trims and noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.linear_model import (
    LinearModel,
    MeanMotion,
    Noise,
    fastest_rad_s,
    linear_model,
    mean_motion,
)
from wingwatch.diagnosis.measured import FORCE_X, LEAD_S, Window, finite_mean
from wingwatch.diagnosis.replay import TRIMS, Inputs, Model, inputs_of, measured_start
from wingwatch.diagnosis.trims import measured_trims

__all__ = ["WORKERS", "Point", "Problem", "RunsAwayError", "lead_of", "linear_at", "model_at", "prepare"]

Array = NDArray[np.float64]

WORKERS = 2
_LARGEST_PRODUCT = 0.4
"""Of the fastest eigenvalue and a step of integration."""


class RunsAwayError(ArithmeticError):
    """A simulation that leaves the flight so far that its numbers end."""


@dataclass(frozen=True, slots=True)
class Problem:
    """A flight cut into windows, ready to be fitted.

    Attributes:
        subject: aircraft, flight, model as stated.
        windows: of the flight.
        inputs: of each window.
        groups: which windows share equation (1), by the first of them, (windows,).
        centres: mean motion of each window's group, (windows, 8); means: the same, ready for differences.
        starts: as the first samples of each have them, (windows, 8).
        trims: as mean forces and moments of each have them, (windows, 6).
        free_trims: which of ``TRIMS`` each window has of its own.
        used: outputs that count.
    """

    subject: Subject
    windows: tuple[Window, ...]
    inputs: tuple[Inputs, ...]
    groups: tuple[int, ...]
    centres: Array
    means: tuple[MeanMotion, ...]
    starts: Array
    free_trims: tuple[int, ...]
    used: tuple[int, ...]
    trims: Array

    @property
    def compared(self) -> tuple[int, ...]:
        """Outputs that are simulated."""
        return self.used[self.subject.given :]

    def part(self, windows: Sequence[int]) -> "Problem":
        """Some of the windows."""
        return replace(
            self,
            inputs=tuple(self.inputs[w] for w in windows),
            windows=tuple(self.windows[w] for w in windows),
            groups=tuple([self.groups[v] for v in windows].index(self.groups[w]) for w in windows),
            centres=self.centres[list(windows)],
            means=tuple(self.means[w] for w in windows),
            starts=self.starts[list(windows)],
            trims=self.trims[list(windows)],
        )


@dataclass(frozen=True, slots=True)
class Point:
    """A model, what each window has of its own, and noise.

    Attributes:
        causes: candidates that are in the model; values: of each one's parameters.
        trims: of each window, (windows, 6).
        noise: standard deviations.
    """

    causes: tuple[Candidate, ...]
    values: tuple[Array, ...]
    trims: Array
    noise: Noise

    def part(self, windows: Sequence[int]) -> "Point":
        """For some of the windows."""
        return replace(self, trims=self.trims[list(windows)])

    @property
    def theta(self) -> Array:
        """All parameters, one after another."""
        return np.concatenate([np.zeros(0), *self.values])


_SHOWS_IN = (2, 1, 3, 4, 5, 0)
"""The place in ``START`` of the motion that each of ``TRIMS`` shows in; where it is followed nothing tells the trim."""


def prepare(subject: Subject, noise: Noise) -> tuple[Problem, Point]:
    """Windows and what each starts from, as measured."""
    flight, row = subject.flight, subject.model.row
    unknown = (
        *(() if subject.trims_known else range(5)),
        *(() if subject.throttle_known or subject.given else (5,)),
    )
    free = tuple(k for k in unknown if _SHOWS_IN[k] not in subject.followed)
    inputs, centres, starts = [], [], []
    for window in flight.windows:
        start = measured_start(flight, window, row)
        mean = finite_mean(flight.outputs[window.start : window.stop])
        velocity = start[:3] * mean[0] / max(float(np.linalg.norm(start[:3])), 1.0)
        starts.append(start)
        centres.append(np.array([*velocity, 0.0, 0.0, 0.0, mean[7], mean[8]]))
        inputs.append(inputs_of(flight, window, 4, subject.throttle_known, subject.followed))
    count = len(starts)
    groups = _groups(np.array(centres), np.array([i.density for i in inputs]))
    centres = [
        np.mean([c for c, g in zip(centres, groups, strict=True) if g == group], axis=0) for group in groups
    ]
    trims = np.zeros((count, len(TRIMS)))
    if unknown:
        found = [measured_trims(flight, w, row, i) for w, i in zip(flight.windows, inputs, strict=True)]
        trims[:, list(unknown)] = np.array(found)[:, list(unknown)]
    means = tuple(mean_motion(centre, i) for centre, i in zip(centres, inputs, strict=True))
    problem = Problem(
        subject, flight.windows, tuple(inputs), groups, np.array(centres), means, np.array(starts), free,
        _used(subject), trims,
    )  # fmt: skip
    point = Point((), (), trims.copy(), noise)
    steps = [_steps(linear_at(problem, w, subject.model, noise), i.dt) for w, i in enumerate(inputs)]
    inputs = [i._replace(steps=n) for i, n in zip(inputs, steps, strict=True)]
    means = tuple(m._replace(inputs=m.inputs._replace(steps=n)) for m, n in zip(means, steps, strict=True))
    return replace(problem, inputs=tuple(inputs), means=means), point


_SEEN_IN = {3: (1, 12), 6: (7,), 1: (5, 10), 5: (3, 13), 4: (2, 11), 7: (8,), 2: (6, 9), 0: (0, 4)}
"""Outputs that a state of ``START`` shows in, which say nothing of the simulation where it is followed."""


def _used(subject: Subject) -> tuple[int, ...]:
    """Outputs that count, first what is given."""
    hidden = {k for j in subject.followed for k in _SEEN_IN[j]}
    first = [FORCE_X][: subject.given]
    return (*first, *(k for k in subject.flight.compared if k not in hidden and k not in first))


_ALIKE = np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 0.6, 0.3])
"""Motion within which the gains of one equation (1) do: velocities in parts of the speed, rad/s, rad."""
_ALIKE_DENSITY = 0.1


def _groups(centres: Array, densities: Array) -> tuple[int, ...]:
    """For each window the first one whose mean motion is alike."""
    groups: list[int] = []
    for w, centre in enumerate(centres):
        reach = _ALIKE * np.where(np.arange(8) < 3, np.linalg.norm(centre[:3]), 1.0)
        first = [
            g for g in dict.fromkeys(groups)
            if (np.abs(centres[g] - centre) < reach).all() and abs(densities[g] / densities[w] - 1.0) < _ALIKE_DENSITY
        ]  # fmt: skip
        groups.append(first[0] if first else w)
    return tuple(groups)


def _steps(linear: LinearModel, dt_s: float) -> int:
    """Steps of integration in a sample."""
    return min(max(1, int(np.ceil(fastest_rad_s(linear, dt_s) * dt_s / _LARGEST_PRODUCT))), 50)


def linear_at(problem: Problem, w: int, model: Model, noise: Noise) -> LinearModel:
    """Equation (1) of a model in a window."""
    span_m = problem.subject.aircraft.need_geometry("diagnosis").span_m
    linear = linear_model(model, problem.means[w], problem.trims[w], span_m, noise)
    return linear.without(problem.subject.followed)


def model_at(problem: Problem, point: Point) -> Model:
    """The simulation with the causes of a point."""
    model = problem.subject.model.copy()
    for cause, values in zip(point.causes, point.values, strict=True):
        cause.change(model, values)
    return model


def lead_of(problem: Problem, w: int) -> int:
    """Samples of a window that do not count."""
    return round(LEAD_S / problem.inputs[w].dt)
