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
from wingwatch.diagnosis.causes import of_motion
from wingwatch.diagnosis.change.competing import competing, reference_errors, reference_spread
from wingwatch.diagnosis.change.gaussian import Belief, met
from wingwatch.diagnosis.change.hypothesis import Fitted, Reference, fitted, likelihood
from wingwatch.diagnosis.change.parts import LEAST_AFTER_S, LEAST_BEFORE_S, cut, part_of
from wingwatch.diagnosis.change.result import ChangeDiagnosis
from wingwatch.diagnosis.change.screening import Promise, Screened, screen, screen_again
from wingwatch.diagnosis.change.weighing import weighed
from wingwatch.diagnosis.evaluation import evaluate, reduce
from wingwatch.diagnosis.evidence import BEYOND_DOUBT
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
_MOST_FITTED, _MOST_BY_THE_FIRST, _WITHIN = 4, 1, 12.0
"""Causes that are fitted, by the noise fitted without a cause and by that of the time before, and how much less than
the best one they may promise."""
_NEAR, _MOST_NEAR = 30.0, 3
"""Of log-evidence, within which noise must be the same; and how many fits are looked at so."""
_ANY = 10.0
"""Of the least that matters, a standard deviation of a change of any kind."""
_REFERENCE_ROUNDS, _REFERENCE_PASSES, _NOISE_PASSES = 3, 3, 6


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
        A change is one against the time before (``tests/diagnosis/test_diagnosis_change.py`` has one that is answered):

        >>> from wingwatch.aircraft import load_aircraft
        >>> from wingwatch.simulation import Scenario, simulate
        >>> aerosonde = load_aircraft("aerosonde")
        >>> try:
        ...     diagnose_change(simulate(Scenario(aerosonde), 20.0), aerosonde, 5.0)
        ... except DiagnosisError as problem:
        ...     print(problem)
        there are 5 s of flight before the onset; a diagnosis needs 20 s
    """
    report = progress or (lambda what, part: None)
    with threadpool_limits(1):
        for window_s in WINDOWS_S:
            with suppress(RunsAwayError):
                subject = subject_of(flight, aircraft, kinds or {}, window_s)
                return _diagnosed(subject, onset_s, asked, window_s, report)
    raise DiagnosisError(
        f"the simulation of aircraft {aircraft.name} diverges from the flight within {WINDOWS_S[-1]:g} s; check that "
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
    early_s = max(asked_s - EARLIER_S, began_s + LEAST_BEFORE_S + 2.0 * _GUARD_S)
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
    total_odds = sum(p.cause.odds for p in screened.promises)
    made = weighed(problem, found, onset_s, screened.onsets, total_odds)
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
    for _ in range(_REFERENCE_ROUNDS):
        point = fit_noise(problem, fit(problem, point, _REFERENCE_PASSES).point, _NOISE_PASSES)
    solution = fit(problem, point, _REFERENCE_PASSES)
    least = np.array([e.parameters[0].least for e in errors])
    prior = Belief(np.zeros(len(errors)), np.diag(spread**-2.0))
    reduced = reduce(problem, solution.point, solution.evaluation)
    inflated = inflation(reduced, slice(None))
    belief = met(likelihood(reduced, solution.point.theta, inflated), prior).belief
    wide = np.maximum(spread, _ANY * least)
    constant = np.array([not of_motion(e) for e in errors])
    reference = Reference(tuple(errors), belief, least, wide, constant, inflated)
    return _Learned(reference, solution.point.noise)


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
    report("fitting no cause", 0.4)
    nothing = fitted(problem, point, reference, None, reference.belief.mean, point.noise)
    air = nothing.point.noise
    report("fitting a change of any kind", 0.5)
    found = [nothing, fitted(problem, point, reference, None, nothing.point.theta, air, any_change=True)]
    again = screen_again(problem, nothing.point, reference, [p.cause for p in screened.promises])
    chosen = _short_list(screened, again, asked)
    for number, promise in enumerate(chosen):
        report(f"fitting {promise.cause.label}", 0.55 + 0.35 * number / len(chosen))
        begin = np.concatenate([reference.belief.mean, promise.values])
        with suppress(RunsAwayError):
            found.append(fitted(problem, point, reference, promise.cause, begin, air))
    return _by_the_best_noise(problem, point, reference, found)


def _by_the_best_noise(
    problem: Problem, point: Point, reference: Reference, found: Sequence[Fitted]
) -> list[Fitted]:
    """Fits among which the answer lies, fitted again from the noise at which the best one ended, where that is better.

    A likelihood of noise has more than one maximum, and a few passes do not reach it; neither is evidence of a cause.
    """
    evidence = [f.meeting.log_evidence for f in found]
    best = int(np.argmax(evidence))
    near = [k for k, e in enumerate(evidence) if e > evidence[best] - _NEAR]
    if evidence[best] - evidence[0] < BEYOND_DOUBT or len(near) == 1:
        return list(found)
    air, out = found[best].point.noise, list(found)
    for k in sorted(near, key=lambda k: -evidence[k])[:_MOST_NEAR]:
        with suppress(RunsAwayError):
            again = fitted(
                problem, replace(point, noise=air), reference, found[k].cause, found[k].point.theta, air,
                any_change=k == 1,
            )  # fmt: skip
            out[k] = max(found[k], again, key=lambda f: f.meeting.log_evidence)
    return out


def _short_list(screened: Screened, again: Sequence[Promise], asked: Sequence[str]) -> list[Promise]:
    """Those that promise most by the noise fitted without a cause, then by that of the time before, then those that are
    asked for."""
    chosen: dict[str, Promise] = {}
    for promises, most in ((again, _MOST_FITTED), (screened.promises, _MOST_BY_THE_FIRST)):
        best = promises[0].log_evidence if promises else 0.0
        for p in promises[:most]:
            if p.log_evidence > best - _WITHIN:
                chosen.setdefault(p.cause.label, p)
    for name in asked:
        if all(p.cause.name != name for p in chosen.values()):
            chosen |= {p.cause.label: p for p in [q for q in again if q.cause.name == name][:1]}
    return list(chosen.values())
