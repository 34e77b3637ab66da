"""From fits to an answer: probabilities, what is decided, what cannot be distinguished."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.change.hypothesis import ANY_CHANGE_ODDS, Fitted
from wingwatch.diagnosis.change.result import ChangeDiagnosis, Explanation, Outcome
from wingwatch.diagnosis.evidence import BEYOND_DOUBT, SIMULATION_ERROR
from wingwatch.diagnosis.problem import Point, Problem, model_at
from wingwatch.diagnosis.result import ParameterEstimate
from wingwatch.diagnosis.separating import separating_manoeuvre

__all__ = ["weighed"]

_DECIDED = 0.95
"""Probability from which on a cause is decided."""
_NO_PART = ("icing", "wing_damage")
"""Causes whose targets are kinds of one cause, not parts of the aircraft."""


def weighed(
    problem: Problem, found: Sequence[Fitted], onset_s: float, onsets: int, total_odds: float
) -> ChangeDiagnosis:
    """The answer.

    Nothing has happened where there is no cause, or one whose size does not matter. Causes share their prior odds, and
    the best onset was chosen of several.

    Args:
        problem: windows since the onset.
        found: none first, then a change of any kind, then causes.
        onset_s: since when.
        onsets: how many were tried.
        total_odds: of all causes that compete.
    """
    log_odds = np.array([-math.inf if f.cause is None else math.log(f.cause.odds) for f in found])
    log_odds -= math.log(total_odds * onsets)
    small = logsumexp(log_odds + np.array([f.too_small for f in found]))
    log_odds[:2] = 0.0, math.log(ANY_CHANGE_ODDS / onsets)
    whole = log_odds + np.array([f.meeting.log_evidence for f in found])
    nothing = np.logaddexp(whole[0], small)
    evidence = np.array([nothing, *whole[1:]]) - nothing
    probability = np.exp(evidence - logsumexp(evidence))
    explanations, places = _by_part(found, evidence, probability)
    outcome = _outcome(explanations, found, places, evidence, probability)
    made = ChangeDiagnosis(
        outcome, onset_s, onset_s, explanations, float(probability[1]), float(probability[0])
    )
    if outcome is not Outcome.NOT_SEPARABLE or len(made.possible) < 2:
        return made
    rivals = [found[places[k]].cause for k in range(1, len(made.possible))]
    text = _manoeuvre(problem, found[places[0]], [r for r in rivals if r is not None])
    return replace(made, separating_manoeuvre=text)


def _outcome(
    explanations: Sequence[Explanation],
    found: Sequence[Fitted],
    places: Sequence[int],
    evidence: np.ndarray,
    probability: np.ndarray,
) -> Outcome:
    if float(evidence[1:].max()) < BEYOND_DOUBT:
        return Outcome.NOTHING
    if not explanations or probability[1] > 0.5:
        return Outcome.NO_KNOWN_CAUSE
    best = found[places[0]]
    if not _matters(best):
        return Outcome.NOTHING
    return Outcome.DECIDED if explanations[0].probability >= _DECIDED else Outcome.NOT_SEPARABLE


def _matters(best: Fitted) -> bool:
    assert best.cause is not None
    least = np.array([p.least for p in best.cause.parameters])
    return bool((np.abs(best.values) >= least).any())


def _by_part(
    found: Sequence[Fitted], evidence: np.ndarray, probability: np.ndarray
) -> tuple[tuple[Explanation, ...], list[int]]:
    """One explanation a cause and part, most probable first, and the place of its best fit."""
    groups: dict[tuple[str, str], list[int]] = {}
    for place, fit in enumerate(found):
        if fit.cause is not None:
            groups.setdefault(_part(fit.cause), []).append(place)
    made = []
    for places in groups.values():
        best = max(places, key=lambda k: evidence[k])
        made.append(
            (_explanation(found[best], float(evidence[best]), float(probability[places].sum())), best)
        )
    made.sort(key=lambda pair: -pair[0].probability)
    return tuple(e for e, _ in made), [k for _, k in made]


def _part(cause: Candidate) -> tuple[str, str]:
    return cause.name, "" if cause.name in _NO_PART else cause.target


def _explanation(fit: Fitted, evidence: float, probability: float) -> Explanation:
    cause, values = fit.cause, fit.values
    assert cause is not None
    errors = np.hypot(fit.errors, SIMULATION_ERROR * np.abs(values))
    size, error, unit = float(values[0]), float(errors[0]), cause.parameters[0].unit
    if cause.name == "surface_stuck":
        size, error, unit = 1.0, 0.0, ""
    parameters = {
        p.name: ParameterEstimate(float(v), float(e), p.unit)
        for p, v, e in zip(cause.parameters, values, errors, strict=True)
    }
    return Explanation(
        cause.name, cause.target, parameters, size, error, unit, evidence, probability, cause.sentence(values)
    )


def _manoeuvre(problem: Problem, best: Fitted, rivals: Sequence[Candidate]) -> str:
    """What would tell them apart, the errors of the reference held."""
    point, cause = best.point, best.cause
    assert cause is not None
    errors = replace(point, causes=point.causes[:-1], values=point.values[:-1])
    subject = replace(problem.subject, model=model_at(problem, errors))
    at = Point((cause,), (best.values,), point.trims, point.noise)
    return separating_manoeuvre(replace(problem, subject=subject), at, 0, rivals)
