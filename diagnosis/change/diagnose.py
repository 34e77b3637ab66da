"""Diagnosis of a change: which cause, since which onset, of what size, against the time before.

1. The time before the onset is fitted: errors of all coefficients and sensors, noise, and how far scores scatter.
2. Onset and causes are screened (``screening``).
3. The most promising causes, none, and a change of any kind are fitted to the time since the onset (``hypothesis``).

docs/methods/diagnosis.md, section 10.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.change.competing import competing, reference_errors, reference_spread
from wingwatch.diagnosis.change.gaussian import Belief, met
from wingwatch.diagnosis.change.hypothesis import Fitted, Reference, fitted, likelihood
from wingwatch.diagnosis.change.parts import LEAST_AFTER_S, LEAST_BEFORE_S, cut, part_of
from wingwatch.diagnosis.change.result import ChangeDiagnosis
from wingwatch.diagnosis.change.screening import Promise, Screened, screen
from wingwatch.diagnosis.change.weighing import weighed
from wingwatch.diagnosis.evaluation import evaluate, reduce
from wingwatch.diagnosis.fit import fit, inflation
from wingwatch.diagnosis.linear_model import Noise
from wingwatch.diagnosis.measured import DiagnosisError
from wingwatch.diagnosis.noise import first_noise, fit_noise, likeliest_level
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError
from wingwatch.diagnosis.subject import subject_of
from wingwatch.telemetry import SampleBlock

__all__ = ["diagnose_change"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

WINDOWS_S = (8.0, 4.0)
"""Lengths of windows: the first by which the simulation stays with the flight."""
BEFORE_S, SINCE_S = 45.0, 60.0
"""Of flight before the onset and since that is used, at most: the latest before, the first since."""
EARLIER_S, LATER_S = 12.0, 8.0
"""How far the onset may be from the one that is asked for."""
_GUARD_S = 1.0
"""Either side of the onset that is left out: it is known to a block of two seconds."""
_MOST_FITTED, _WITHIN = 5, 25.0
"""Causes that are fitted, and how much less than the best one they may promise."""
_ANY = 10.0
"""Of the least that matters, a standard deviation of a change of any kind."""
_REFERENCE_PASSES, _NOISE_PASSES = 2, 5


def diagnose_change(
    flight: SampleBlock,
    aircraft: Aircraft,
    onset_s: float,
    *,
    kinds: Mapping[str, str] | None = None,
    asked: Sequence[str] = (),
    progress: Progress | None = None,
) -> ChangeDiagnosis:
    """What explains a change since an onset, the time before it being the reference.

    Args:
        flight: samples; airspeed, rates, accelerometers, attitude, altitude and the three surfaces are needed.
        aircraft: its file.
        onset_s: time stamp about which the change began.
        kinds: ``command`` for surface columns that are commands; others are measured positions.
        asked: names of causes that are fitted whatever they promise: those of the alert.
        progress: called with what is being done, and which part is done (0 to 1).

    Raises:
        DiagnosisError: the flight cannot be diagnosed; the sentence says why.

    Example:
        >>> from wingwatch.aircraft import load_aircraft
        >>> from wingwatch.simulation import Scenario, doublet_schedule, parse_effect, simulate
        >>> aerosonde = load_aircraft("aerosonde")
        >>> inputs = (doublet_schedule(aerosonde, aerosonde.envelope.cruise),)
        >>> hidden = (parse_effect("elevator_effectiveness:0.4@30"),)
        >>> flown = simulate(Scenario(aerosonde, manoeuvres=inputs, effects=hidden), 50.0)
        >>> diagnose_change(flown, aerosonde, 31.0).explanations[0].cause
        'elevator_effectiveness'
    """
    report = progress or (lambda what, part: None)
    with threadpool_limits(1):
        for window_s in WINDOWS_S:
            with suppress(RunsAwayError):
                subject = subject_of(flight, aircraft, kinds or {}, window_s)
                return _diagnosed(subject, onset_s, asked, window_s, report)
    raise DiagnosisError(
        f"the simulation of aircraft {aircraft.name} runs away from the flight within {WINDOWS_S[-1]:g} s: check that "
        "the file is of this aircraft, and its units and signs"
    )


@dataclass(frozen=True, slots=True)
class _Learned:
    """The time before: the model's errors, and the noise."""

    reference: Reference
    noise: Noise


def _diagnosed(
    subject: Subject, asked_s: float, asked: Sequence[str], window_s: float, report: Progress
) -> ChangeDiagnosis:
    first_s, last_s = asked_s - BEFORE_S, asked_s + LATER_S + SINCE_S
    began_s = max(first_s, float(subject.flight.time_s[0]))
    early_s = max(asked_s - EARLIER_S, began_s + LEAST_BEFORE_S)
    report("the time before the change", 0.05)
    learned = _learned(subject, first_s, min(early_s, asked_s), window_s)
    report("causes and onsets", 0.3)
    screened = _screened(subject, learned, (min(early_s, asked_s), asked_s), last_s, window_s)
    onset_s = screened.onset_s
    parts = cut(subject, learned.noise, onset_s - _GUARD_S, onset_s + _GUARD_S, (first_s, last_s), window_s)
    reference = _reminded(*parts.before, learned.reference)
    problem, point = parts.after
    found = _fits(problem, point, reference, screened, asked, report)
    report("weighing", 0.9)
    made = weighed(problem, reference, found, onset_s)
    return replace(
        made, asked_s=asked_s, inflation=reference.inflation,
        before_s=parts.before[0].subject.flight.seconds, after_s=problem.subject.flight.seconds,
    )  # fmt: skip


def _learned(subject: Subject, first_s: float, last_s: float, window_s: float) -> _Learned:
    """Errors and noise of the time before."""
    speed = subject.flight.airspeed_m_s
    moderate = np.array([0.02 * speed] * 3 + [0.05, 0.2, 0.2, 0.5])
    part = part_of(subject, replace(first_noise(subject), gusts=moderate), first_s, last_s, window_s)
    seconds = 0.0 if part is None else part[0].subject.flight.seconds
    if part is None or seconds < LEAST_BEFORE_S - 1.0:
        raise DiagnosisError(
            f"there are {seconds:.0f} s of flight before the onset; a diagnosis needs {LEAST_BEFORE_S:.0f} s"
        )
    problem, point = part
    errors = reference_errors(subject)
    spread = reference_spread(subject, errors)
    errors = [_with_spread(e, s) for e, s in zip(errors, spread, strict=True)]
    point = likeliest_level(problem, point)
    point = replace(point, causes=tuple(errors), values=tuple(np.zeros(1) for _ in errors))
    point = fit_noise(problem, fit(problem, point, _REFERENCE_PASSES).point, _NOISE_PASSES)
    solution = fit(problem, point, _REFERENCE_PASSES)
    least = np.array([e.parameters[0].least for e in errors])
    prior = Belief(np.zeros(len(errors)), np.diag(spread**-2.0))
    reduced = reduce(problem, solution.point, solution.evaluation)
    inflated = inflation(reduced, slice(None))
    belief = met(likelihood(reduced, solution.point.theta, inflated), prior).belief
    wide = np.maximum(spread, _ANY * least)
    return _Learned(Reference(tuple(errors), belief, least, wide, inflated), solution.point.noise)


def _with_spread(error: Candidate, spread: float) -> Candidate:
    return replace(error, parameters=(replace(error.parameters[0], spread=float(spread)),))


def _screened(
    subject: Subject, learned: _Learned, onsets_s: tuple[float, float], last_s: float, window_s: float
) -> Screened:
    later_s = min(onsets_s[1] + LATER_S, float(subject.flight.time_s[-1]) - LEAST_AFTER_S - 2.0 * _GUARD_S)
    part = part_of(subject, learned.noise, onsets_s[0], last_s, window_s)
    if part is None or later_s < onsets_s[0]:
        raise DiagnosisError(
            f"there is too little flight since the onset; a diagnosis needs {LEAST_AFTER_S:.0f} s"
        )
    return screen(*part, learned.reference, competing(subject), (onsets_s[0], later_s))


def _reminded(problem: Problem, point: Point, reference: Reference) -> Reference:
    """The reference by all windows before the onset, by one more step."""
    mean = reference.belief.mean
    at = replace(point, causes=reference.errors, values=tuple(np.atleast_1d(v) for v in mean))
    reduced = reduce(problem, at, evaluate(problem, at))
    spread = np.array([e.parameters[0].spread for e in reference.errors])
    prior = Belief(np.zeros(len(mean)), np.diag(spread**-2.0))
    return replace(reference, belief=met(likelihood(reduced, mean, reference.inflation), prior).belief)


def _fits(
    problem: Problem,
    point: Point,
    reference: Reference,
    screened: Screened,
    asked: Sequence[str],
    report: Progress,
) -> list[Fitted]:
    """None first, then a change of any kind, then causes."""
    mean, empty = reference.belief.mean, np.zeros(0)
    tried: list[tuple[Candidate | None, Array, bool]] = [(None, empty, False), (None, empty, True)]
    tried += [(p.cause, p.values, False) for p in _short_list(screened, asked)]
    found: list[Fitted] = []
    for number, (cause, values, any_change) in enumerate(tried):
        report(f"fitting {'no cause' if cause is None else cause.label}", 0.4 + 0.5 * number / len(tried))
        begin = np.concatenate([mean, values])
        try:
            found.append(fitted(problem, point, reference, cause, begin, any_change=any_change))
        except RunsAwayError:
            if cause is None:
                raise
    return found


def _short_list(screened: Screened, asked: Sequence[str]) -> list[Promise]:
    """Those that promise most, and those that are asked for."""
    least = screened.nothing
    if screened.promises:
        least = max(least, screened.promises[0].log_evidence - _WITHIN)
    chosen = [p for p in screened.promises[:_MOST_FITTED] if p.log_evidence > least]
    for name in asked:
        if all(p.cause.name != name for p in chosen):
            chosen += [p for p in screened.promises if p.cause.name == name][:1]
    return chosen
