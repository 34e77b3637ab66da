"""Diagnosis of a flight: misfit, causes, extended model, gain."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from wingwatch.aircraft import Aircraft, FlightCondition
from wingwatch.diagnosis.answerable import not_judged
from wingwatch.diagnosis.candidate import FreeParameter, Subject
from wingwatch.diagnosis.causes import candidates
from wingwatch.diagnosis.evaluation import evaluate
from wingwatch.diagnosis.evidence import SIMULATION_ERROR
from wingwatch.diagnosis.extension import extended
from wingwatch.diagnosis.fit import Solution, fit, own_fitted
from wingwatch.diagnosis.gain import gain_of, misfits
from wingwatch.diagnosis.linear_aircraft import concise
from wingwatch.diagnosis.measured import OUTPUTS, DiagnosisError
from wingwatch.diagnosis.misfit import Replayed, noise_variance, replayed
from wingwatch.diagnosis.missing_terms import missing_terms
from wingwatch.diagnosis.noise import first_noise
from wingwatch.diagnosis.notes import another_aircraft, note_on_silence, notes_of, rest_in_words
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError, model_at, prepare
from wingwatch.diagnosis.result import Cause, Diagnosis, Gain, MissingTerm, ParameterEstimate
from wingwatch.diagnosis.search import Search, Tried, quiet, search
from wingwatch.diagnosis.separable import not_separable
from wingwatch.diagnosis.separating import separating_manoeuvre
from wingwatch.diagnosis.subject import subject_of
from wingwatch.diagnosis.traces import traces_of
from wingwatch.telemetry import SampleBlock

__all__ = ["diagnose"]

Array = NDArray[np.float64]

WINDOWS_S = (8.0, 5.0, 3.0)
"""Lengths of windows: the first in which the simulation stays near the flight."""

SYMBOLS: tuple[str, ...] = (
    "z_w", "z_q", "z_eta", "m_w", "m_q", "m_eta", "y_v", "y_p", "y_r", "y_xi", "y_zeta",
    "l_v", "l_p", "l_r", "l_xi", "l_zeta", "n_v", "n_p", "n_r", "n_xi", "n_zeta",
)  # fmt: skip


def _silent(what: str, part: float) -> None:
    """No progress."""


def diagnose(
    flight: SampleBlock,
    aircraft: Aircraft,
    *,
    kinds: Mapping[str, str] | None = None,
    validate: SampleBlock | None = None,
    validate_kinds: Mapping[str, str] | None = None,
    source: str = "",
    progress: Callable[[str, float], None] | None = None,
) -> Diagnosis:
    """What the simulation of an aircraft gets wrong against a measured flight, why, and what mending it gains.

    Args:
        flight: samples; airspeed, rates, accelerometers, attitude, altitude and the three surfaces are needed.
        aircraft: its file, with mass, geometry and coefficients or derivatives at conditions.
        kinds: ``command`` for surface columns that are commands; others are measured positions.
        validate: another flight of the same aircraft, to measure the gain on; else windows left out.
        validate_kinds: ``kinds`` of that flight, those of the first if not given.
        source: the flight's name, for the report.
        progress: called with what is being done, and which part is done (0 to 1).

    Raises:
        DiagnosisError: a flight or an aircraft file that cannot be diagnosed; the sentence says why.

    Example:
        >>> from wingwatch.aircraft import load_aircraft
        >>> from wingwatch.simulation import Scenario, doublet_schedule, parse_effect, simulate
        >>> aerosonde = load_aircraft("aerosonde")
        >>> inputs = (doublet_schedule(aerosonde, aerosonde.envelope.cruise),)
        >>> hidden = (parse_effect("elevator_effectiveness:0.3@0"),)
        >>> flown = simulate(Scenario(aerosonde, manoeuvres=inputs, effects=hidden), 20.0)
        >>> diagnose(flown, aerosonde).causes[0].name
        'elevator_effectiveness'
    """
    report = progress or _silent
    report("reading the flight", 0.0)
    flights = [(flight, kinds or {})]
    if validate is not None:
        flights.append((validate, flights[0][1] if validate_kinds is None else validate_kinds))
    with threadpool_limits(1):
        for window_s in WINDOWS_S:
            subjects = [subject_of(block, aircraft, its, window_s) for block, its in flights]
            try:
                if (found := _in_windows(subjects, source, report, window_s == WINDOWS_S[-1])) is not None:
                    return found
            except RunsAwayError:
                continue
    raise DiagnosisError(
        f"the simulation of aircraft {aircraft.name} diverges from the flight within {WINDOWS_S[-1]:g} s; "
        "check that the file is of this aircraft, and the units and signs of the channel map"
    )


def _in_windows(
    subjects: Sequence[Subject], source: str, report: Callable[[str, float], None], shortest: bool
) -> Diagnosis | None:
    """The diagnosis of the first subject, judged on the second if there is one; None where it asks for shorter windows.

    Raises:
        RunsAwayError: the simulation leaves the flight so far that its numbers end.
    """
    problem, point = _begun(subjects[0])
    if not shortest and not _stays_near(problem, point):
        return None
    active = _most_active(problem)
    found = search(problem.part(active), point.part(active), candidates(subjects[0]), report)
    report("looking for missing terms", 0.88)
    searched, last = problem.part(active), found.last
    terms, silent = missing_terms(searched, last), not_judged(searched, last)
    if len(active) < len(problem.windows):
        found = _over(problem, point, found)
    report("measuring the gain", 0.9)
    other = _begun(subjects[1]) if len(subjects) > 1 else None
    made = _assembled(source, problem, found, terms, other)
    return replace(made, not_judged=silent, notes=(*made.notes, *note_on_silence(silent)))


MOST_S = 96.0
"""Of flight in which causes are looked for: windows in which the surfaces move most. The gain is measured on all."""


def _most_active(problem: Problem) -> list[int]:
    """Windows for the search, in the order of their time."""
    moved = []
    for i in problem.inputs:
        surfaces = np.where(np.isfinite(i.flown), i.flown, i.commands)
        moved.append(surfaces.std(axis=0))
    usual = np.maximum(np.mean(moved, axis=0), 1e-9)
    order = np.argsort([-float((m / usual).sum()) for m in moved], kind="stable")
    seconds = np.cumsum(
        [(problem.windows[w].stop - problem.windows[w].start) * problem.inputs[w].dt for w in order]
    )
    return sorted(int(w) for w in order[: max(1, int(np.searchsorted(seconds, MOST_S, side="right")))])


def _over(problem: Problem, point: Point, found: Search) -> Search:
    """What was found in some windows, over all of them."""

    def whole(solution: Solution) -> Solution:
        at = solution.point
        everywhere = replace(point, causes=at.causes, values=at.values, noise=at.noise)
        return replace(solution, point=own_fitted(problem, everywhere))

    return replace(found, stated=whole(found.stated), last=whole(found.last))


_ATTITUDE_AND_RATES = (1, 2, 3, 7, 8)


def _stays_near(problem: Problem, point: Point) -> bool:
    """Whether rates and attitude stay nearer to the flight than it moves itself, in the median of them."""
    flown, ratios = replayed(problem, point), []
    for k in set(_ATTITUDE_AND_RATES) & set(problem.compared):
        off = sum(float(((a - b) ** 2).sum()) for a, b in flown.pairs(k))
        moved = sum(float(((a - a.mean()) ** 2).sum()) for a, _ in flown.pairs(k))
        ratios.append(off / moved if moved > 0.0 else 0.0)
    return bool(np.median(ratios) < 1.0)


def _begun(subject: Subject) -> tuple[Problem, Point]:
    """Windows, with moderate noise to begin with."""
    speed = subject.flight.airspeed_m_s
    moderate = np.array([0.02 * speed] * 3 + [0.05, 0.2, 0.2, 0.5])
    return prepare(subject, replace(first_noise(subject), gusts=moderate))


def _assembled(
    source: str,
    problem: Problem,
    found: Search,
    terms: tuple[MissingTerm, ...],
    other: tuple[Problem, Point] | None,
) -> Diagnosis:
    """Search and gain as a diagnosis."""
    subject = problem.subject
    before, after = replayed(problem, found.stated.point), replayed(problem, found.last.point)
    noise = noise_variance(problem, found.last.point)
    causes = tuple(_cause(problem, found, i, noise) for i, one in enumerate(found.found) if one.matters)
    gain = _gain(problem, found, noise, other) if causes else None
    model = extended(subject, found.last.point, _errors(found)) if gain is not None and gain.pays else None
    unexplained = _unexplained(problem, found)
    return Diagnosis(
        source=source,
        aircraft=subject.stated,
        misfit=misfits(before, noise, problem.compared),
        causes=causes,
        ranking=_ranking(found),
        unexplained_fraction=unexplained,
        unexplained=rest_in_words(found, terms, unexplained),
        gain=gain,
        not_separable=not_separable(subject),
        notes=notes_of(subject, found, gain, model),
        model=model,
        derivatives=_derivatives(problem, found),
        traces=traces_of(problem, before, after, found.last.point),
        seconds=subject.flight.seconds,
        windows=len(problem.windows),
        missing_terms=terms,
        another_aircraft=another_aircraft(subject, misfits(after, noise, problem.compared)),
    )


def _errors(found: Search) -> tuple[Array, ...]:
    """Standard errors of the causes in the last model, cause by cause, with ``SIMULATION_ERROR``."""
    errors, at, out = np.sqrt(np.diagonal(found.last.covariance)), 0, []
    for values in found.last.point.values:
        out.append(np.hypot(errors[at : at + len(values)], SIMULATION_ERROR * np.abs(values)))
        at += len(values)
    return tuple(out)


def _cause(problem: Problem, found: Search, i: int, noise: Array) -> Cause:
    """One that was taken, with its parameters as the last model has them."""
    one, candidate = found.found[i], found.last.point.causes[i]
    values, errors = found.last.point.values[i], _errors(found)[i]
    return Cause(
        name=candidate.name,
        target=candidate.target,
        parameters={
            p.name: _reported(p, float(v), float(e))
            for p, v, e in zip(candidate.parameters, values, errors, strict=True)
        },
        channels=_channels(problem, found, i, noise),
        probability=_probability(one.best, one.tried),
        gain=one.best.gain,
        held_out_gain=one.held_out,
        indistinguishable_from=tuple(t.candidate.label for t in one.alike),
        separating_manoeuvre=separating_manoeuvre(
            problem, found.last.point, i, [t.candidate for t in one.alike]
        )
        if one.alike
        else "",
        text=candidate.sentence(values),
        set_probability=sum(_probability(t, one.tried) for t in (one.best, *one.alike)),
    )


def _reported(parameter: FreeParameter, value: float, error: float) -> ParameterEstimate:
    """In the unit that is reported, the error by its derivative."""
    if parameter.inverse and value != 0.0:
        value, error = 1.0 / value, error / value**2
    return ParameterEstimate(value, error, parameter.unit)


def _probability(one: Tried, tried: Sequence[Tried]) -> float:
    """Of a cause among those that were fitted, and none."""
    evidence = np.array([0.0, *(t.evidence for t in tried)])
    most = float(evidence.max())
    return float(np.exp(one.evidence - most) / np.exp(evidence - most).sum())


@np.errstate(all="ignore")  # without the cause the simulation may run away
def _channels(problem: Problem, found: Search, i: int, noise: Array) -> tuple[str, ...]:
    """Outputs whose misfit grows without the cause, most first."""
    point = found.last.point
    without = replace(
        point,
        causes=point.causes[:i] + point.causes[i + 1 :],
        values=point.values[:i] + point.values[i + 1 :],
    )
    whole, less = replayed(problem, point), replayed(problem, without)
    grown: dict[str, float] = {}
    for k in problem.compared:
        square = [sum(float(((a - b) ** 2).sum()) for a, b in flown.pairs(k)) for flown in (whole, less)]
        readings = sum(len(a) for a, _ in whole.pairs(k))
        grown[OUTPUTS[k]] = (square[1] - square[0]) / max(readings * float(noise[k]), 1e-300)
    most = max(grown.values(), default=0.0)
    order = sorted(grown, key=lambda name: -grown[name])
    return tuple(name for name in order if grown[name] > max(0.1 * most, 0.0))


def _ranking(found: Search) -> tuple[tuple[str, float, float], ...]:
    """Of the first round: label, gain, probability."""
    tried = next((one.tried for one in found.found if one.matters), found.rest)
    return tuple((t.candidate.label, t.gain, _probability(t, tried)) for t in tried)


def _gain(problem: Problem, found: Search, noise: Array, other: tuple[Problem, Point] | None) -> Gain:
    """On another flight, else on windows that the causes were not fitted to."""
    if other is not None:
        its, point = other
        stated = own_fitted(its, replace(point, noise=found.last.point.noise))
        mended = replace(stated, causes=found.last.point.causes, values=found.last.point.values)
        return gain_of(replayed(its, stated), replayed(its, mended), noise, its.compared, "another flight")
    windows = range(len(problem.windows))
    before, after = Replayed([], []), Replayed([], [])
    for part in (0, 1):
        kept = [w for w in windows if w % 2 == part] or list(windows)
        left = [w for w in windows if w % 2 != part]
        if not left:
            continue
        values = fit(problem.part(kept), found.last.point.part(kept), 4).point.values
        its = problem.part(left)
        before.extend(replayed(its, found.stated.point.part(left)))
        after.extend(replayed(its, replace(found.last.point.part(left), values=values)))
    return gain_of(before, after, noise, problem.compared, "windows left out")


def _unexplained(problem: Problem, found: Search) -> float:
    """Part of the squared, weighted misfit beyond noise that is left, with sensors as stated and the air as found."""
    noise = quiet(problem, found.last.point.noise)
    left = []
    for point in (found.stated.point, found.last.point):
        evaluation = evaluate(problem, own_fitted(problem, replace(point, noise=noise)))
        square = sum(float(b[:, 0, 0].sum()) for b in evaluation.blocks)
        left.append(max(square - evaluation.readings, 0.0))
    chance = 5.0 * np.sqrt(2.0 * evaluation.readings)
    if left[0] < chance:
        return 0.0
    return float(min(1.0, left[1] / left[0])) if left[1] > chance else 0.0


def _derivatives(problem: Problem, found: Search) -> Mapping[str, tuple[float, float]]:
    """Concise derivatives of both models at the flight's mean condition."""
    flight = problem.subject.flight
    speed, alpha = (
        flight.airspeed_m_s,
        float(np.mean(problem.centres[:, 2] / problem.centres[:, 0])),
    )
    at = FlightCondition(
        speed,
        float(np.nanmean(flight.altitude_m)),
        float(np.nanmean(flight.density_kg_m3)),
        angle_of_attack_rad=alpha,
    )
    before = concise(problem.subject.model.row, at, SYMBOLS)
    after = concise(model_at(problem, found.last.point).row, at, SYMBOLS)
    both = {s: (float(a), float(b)) for s, a, b in zip(SYMBOLS, before, after, strict=True)}
    stated = problem.subject.stated
    if stated.coefficients is not None:
        return both
    known = {symbol for condition in stated.conditions for symbol in condition.derivatives}
    return {symbol: values for symbol, values in both.items() if symbol in known or values[0] != values[1]}
