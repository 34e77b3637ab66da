"""The manoeuvre that would tell causes apart that a flight does not.

Each manoeuvre of ``design_input`` is flown by the diagnosed model from the flight's own steady motion. With the
information H of a cause c and its rival r there, the rival at its best leaves

    evidence = 1/2 theta_c' (H_cc - H_cr H_rr^-1 H_rc) theta_c                                                 (8)

of log-likelihood to the cause. docs/methods/diagnosis.md, section 5.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, SURFACES, FlightCondition
from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.evaluation import evaluate, reduce
from wingwatch.diagnosis.evidence import ALIKE
from wingwatch.diagnosis.linear_aircraft import concise
from wingwatch.diagnosis.measured import OUTPUTS, Window
from wingwatch.diagnosis.problem import Point, Problem, model_at
from wingwatch.diagnosis.replay import inputs_of
from wingwatch.diagnosis.windows import open_loop
from wingwatch.input_design import InputDesign, SurfaceTarget, design_input, surface_targets

__all__ = ["separating_manoeuvre"]

Array = NDArray[np.float64]

_KINDS = ("doublet", "3211", "multisine")
_LENGTH_S = 12.0
_LEAD_S = 1.0
_AMPLITUDE_RAD = math.radians(3.0)
_BAND_HZ = (0.2, 2.0)
_MOST_TIMES = 20


def separating_manoeuvre(problem: Problem, point: Point, cause: int, rivals: Sequence[Candidate]) -> str:
    """Which manoeuvre tells a cause from its rivals soonest, in words; empty where none does.

    Args:
        problem: the flight.
        point: the diagnosed model.
        cause: which of the point's causes.
        rivals: what the flight does not distinguish it from.
    """
    best, least = None, 0.0
    for design in _designs(problem, point):
        evidence = min(_evidence(problem, point, cause, rival, design) for rival in rivals)
        if evidence > least:
            best, least = design, evidence
    if best is None or least * _MOST_TIMES < ALIKE:
        return ""
    return _in_words(best, math.ceil(ALIKE / least))


def _in_words(design: InputDesign, times: int) -> str:
    surfaces = " and ".join(design.surfaces)
    if design.kind == "multisine":
        what = f"a multisine of {math.degrees(_AMPLITUDE_RAD):.0f} degrees on the {surfaces}"
    else:
        name = {"doublet": "doublet", "3211": "3-2-1-1"}[design.kind]
        step_s = design.widths_s[0]
        what = (
            f"a {name} of {math.degrees(_AMPLITUDE_RAD):.0f} degrees on the {surfaces}, {step_s:.2g} s a step"
        )
    often = "once" if times == 1 else f"{times} times"
    return f"{what}, {_LENGTH_S:.0f} s in all, flown {often} tells them apart with odds of 20 to 1."


def _designs(problem: Problem, point: Point) -> Iterator[InputDesign]:
    """Each kind on each surface that has a mode here, and multisines on the surfaces of a mode together."""
    flight = problem.subject.flight
    at = FlightCondition(
        flight.airspeed_m_s, float(np.nanmean(flight.altitude_m)), float(np.mean(flight.density_kg_m3))
    )
    row, rate_hz = model_at(problem, point).row, 1.0 / flight.dt_s
    for structure in (SHORT_PERIOD, LATERAL):
        symbols = structure.derivatives
        derivatives = dict(zip(symbols, map(float, concise(row, at, symbols)), strict=True))
        try:
            targets = surface_targets(structure, derivatives, _BAND_HZ, _AMPLITUDE_RAD)
        except ValueError:
            continue  # no mode to excite: nothing is known of its surfaces' widths
        for kind in _KINDS:
            groups: list[tuple[SurfaceTarget, ...]] = [(t,) for t in targets]
            if kind == "multisine":
                groups = [targets]
            for group in groups:
                try:
                    yield design_input(kind, group, _LENGTH_S - _LEAD_S, rate_hz)
                except ValueError:
                    continue  # too fast for these samples, or too long


@np.errstate(all="ignore")  # a model that leaves the steady motion says nothing
def _evidence(problem: Problem, point: Point, cause: int, rival: Candidate, design: InputDesign) -> float:
    """Equation (8)."""
    flown, there = _flown(problem, point, design)
    others = [i for i in range(len(point.causes)) if i != cause]
    less = replace(
        there, causes=tuple(point.causes[i] for i in others), values=tuple(point.values[i] for i in others)
    )
    candidates = (point.causes[cause], rival)
    h = reduce(flown, less, evaluate(flown, less, candidates)).information
    if not np.isfinite(h).all():
        return 0.0
    first = less.theta.size
    mine, its = slice(first, first + len(point.values[cause])), slice(first + len(point.values[cause]), None)
    rest = np.r_[np.arange(first), np.arange(its.start, len(h))]
    # what neither the rival nor the other causes can imitate
    own = h[mine, mine] - h[mine][:, rest] @ np.linalg.pinv(h[np.ix_(rest, rest)]) @ h[rest][:, mine]
    value = point.values[cause]
    return 0.5 * float(value @ own @ value)


def _flown(problem: Problem, point: Point, design: InputDesign) -> tuple[Problem, Point]:
    """One window that begins in the flight's own steady motion, flown by the diagnosed model, and the point there."""
    subject, flight = problem.subject, problem.subject.flight
    w = int(np.argmin(np.abs(problem.centres[:, 6])))
    its, lead = problem.windows[w], round(_LEAD_S / flight.dt_s)
    count = lead + len(design.inputs_rad)
    added = np.zeros((count, 3))
    for surface, column in zip(design.surfaces, design.inputs_rad.T, strict=True):
        added[lead:, SURFACES.index(surface)] = column
    rows = slice(its.start, its.stop)

    def steady(column: Array) -> Array:
        return np.asarray(np.repeat(column[rows].mean(axis=0, keepdims=True), count, axis=0))

    centre = problem.centres[w]
    longer = replace(
        flight, time_s=np.linspace(0.0, (count - 1) * flight.dt_s, count), outputs=np.zeros((count, len(OUTPUTS))),
        flown=steady(flight.flown) + added, commands=steady(flight.commands) + added, throttle=steady(flight.throttle),
        density_kg_m3=steady(flight.density_kg_m3), altitude_m=steady(flight.altitude_m), windows=(Window(0, count),),
    )  # fmt: skip
    inputs = inputs_of(longer, longer.windows[0], problem.inputs[w].steps, subject.throttle_known)
    one = replace(
        problem.part([w]), windows=longer.windows, inputs=(inputs,), starts=centre[None],
        subject=replace(subject, flight=longer),
    )  # fmt: skip
    here = point.part([w])
    read = open_loop(one, 0, model_at(problem, point), centre[None], here.trims)[0]
    read[:, [k for k in range(read.shape[1]) if k not in problem.used]] = np.nan
    measured = replace(longer, outputs=read)
    inputs = inputs_of(measured, measured.windows[0], inputs.steps, subject.throttle_known, subject.followed)
    return replace(one, inputs=(inputs,), subject=replace(subject, flight=measured)), here
