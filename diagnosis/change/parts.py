"""A flight cut at an onset: windows before and windows since."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from wingwatch.diagnosis.candidate import Subject
from wingwatch.diagnosis.linear_model import Noise
from wingwatch.diagnosis.measured import SHORTEST_S, DiagnosisError, Window
from wingwatch.diagnosis.problem import Point, Problem, prepare

__all__ = ["LEAST_AFTER_S", "LEAST_BEFORE_S", "Parts", "cut", "part_of"]

LEAST_BEFORE_S, LEAST_AFTER_S = 20.0, 6.0
"""Of flight before the onset, for it is the reference, and since."""


@dataclass(frozen=True, slots=True)
class Parts:
    """Time before an onset and since, each with the point that its windows start from."""

    before: tuple[Problem, Point]
    after: tuple[Problem, Point]


def part_of(
    subject: Subject, noise: Noise, first_s: float, last_s: float, window_s: float
) -> tuple[Problem, Point] | None:
    """Windows between two times; None where there are none.

    Args:
        subject: of the whole flight.
        noise: to begin with.
        first_s, last_s: time stamps.
        window_s: length of a window.
    """
    windows = _windows(subject, first_s, last_s, window_s)
    if not windows:
        return None
    return prepare(replace(subject, flight=replace(subject.flight, windows=windows)), noise)


def cut(
    subject: Subject,
    noise: Noise,
    before_s: float,
    since_s: float,
    span_s: tuple[float, float],
    window_s: float,
) -> Parts:
    """Windows from the first time of ``span_s`` to ``before_s``, and from ``since_s`` to its last.

    Raises:
        DiagnosisError: too little flight before or since.
    """
    found = []
    for least_s, first_s, last_s, where in (
        (LEAST_BEFORE_S, span_s[0], before_s, "before"), (LEAST_AFTER_S, since_s, span_s[1], "since"),
    ):  # fmt: skip
        part = part_of(subject, noise, first_s, last_s, window_s)
        seconds = 0.0 if part is None else part[0].subject.flight.seconds
        if part is None or seconds < least_s:
            raise DiagnosisError(
                f"there are {seconds:.0f} s of flight {where} the onset; a diagnosis needs {least_s:.0f} s"
            )
        found.append(part)
    return Parts(*found)


def _windows(subject: Subject, first_s: float, last_s: float, window_s: float) -> tuple[Window, ...]:
    flight, found = subject.flight, []
    for start, stop in _spans(flight.windows):
        a = max(start, int(np.searchsorted(flight.time_s, first_s)))
        b = min(stop, int(np.searchsorted(flight.time_s, last_s, side="right")))
        if (b - a) * flight.dt_s < SHORTEST_S:
            continue
        count = max(1, round((b - a) * flight.dt_s / window_s))
        cuts = np.linspace(a, b, count + 1).round().astype(int)
        found += [Window(int(x), int(y)) for x, y in itertools.pairwise(cuts)]
    return tuple(found)


def _spans(windows: tuple[Window, ...]) -> list[tuple[int, int]]:
    """Windows that follow one another without a gap, joined."""
    spans: list[tuple[int, int]] = []
    for window in windows:
        if spans and spans[-1][1] == window.start:
            spans[-1] = (spans[-1][0], window.stop)
        else:
            spans.append((window.start, window.stop))
    return spans
