"""Which term the simulation lacks: what is left, regressed on products and powers of states and controls, and lags.

A term adds size times a signal z(t) to one aerodynamic coefficient. Its effect on the innovations is the response of
the filter of equation (1) to what z does to forces and moments: linear, so all terms are tried at once. Beside each the
causes and every coefficient are free, so no term stands for a linear one.
docs/methods/diagnosis.md, section 6.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from wingwatch.aircraft import SURFACES
from wingwatch.diagnosis.answerable import shown_by, symbol_of
from wingwatch.diagnosis.causes import coefficients_of
from wingwatch.diagnosis.evaluation import evaluate, reduce
from wingwatch.diagnosis.evidence import ALIKE, BEYOND_DOUBT
from wingwatch.diagnosis.fit import Solution, inflation
from wingwatch.diagnosis.innovations import Filter, Path
from wingwatch.diagnosis.linear_model import STATES, WIDTH, by_coefficients
from wingwatch.diagnosis.problem import Problem, model_at
from wingwatch.diagnosis.replay import BIAS, SCALE, without_delays
from wingwatch.diagnosis.result import MissingTerm
from wingwatch.kernels.decorators import compiled

__all__ = ["missing_terms"]

Array = NDArray[np.float64]

_COEFFICIENTS = ("CL", "CY", "Cl", "Cm", "Cn")
"""In the order of ``by_coefficients``."""
_ALONG = ("angle of attack", "pitch rate", "elevator")
_ACROSS = ("sideslip", "roll rate", "yaw rate", "aileron", "rudder")
_LAGS_S = (0.1, 0.5)
_EQUATION = {"CL": "z", "CY": "y", "Cl": "l", "Cm": "m", "Cn": "n"}
_BY = {
    "angle of attack": "w", "pitch rate": "q", "elevator": "eta",
    "sideslip": "v", "roll rate": "p", "yaw rate": "r", "aileron": "xi", "rudder": "zeta",
}  # fmt: skip
"""Letters of a derivative's symbol."""


@dataclass(frozen=True, slots=True)
class _Term:
    """A signal in one coefficient.

    Attributes:
        coefficient: place in ``_COEFFICIENTS``; name: of the signal.
        course: over all windows, of unit root mean square about its mean: as followed, which moves the aircraft from
            then on, and as followed a sample before, which is in the same sample's outputs: these show a gust that what
            is followed then knows; (samples, 2).
        unit: what ``course`` was divided by.
        slopes: derivatives of the same coefficient by the signals in it.
    """

    coefficient: int
    name: str
    course: Array
    unit: float
    slopes: tuple[str, ...]


def missing_terms(problem: Problem, solution: Solution) -> tuple[MissingTerm, ...]:
    """Terms that what is left follows beyond doubt, the best first, with those that cannot be distinguished from it."""
    point, model = solution.point, model_at(problem, solution.point)
    measured, sensors = without_delays(problem.subject.flight, model), model.sensors
    followed: dict[int, Array] = {}

    def keep(w: int, filtering: Filter, path: Path) -> Array:
        window, used = problem.windows[w], list(problem.used)
        its = measured[window.start : window.stop].copy()
        # a reading less what is its sensor's in the innovation
        its[:, used] -= path.innovations * (point.noise.sensors[used] / path.deviation) ** 2
        its = (its - sensors[:, BIAS]) / (1.0 + sensors[:, SCALE])
        followed[w] = np.stack([its, its[np.maximum(np.arange(len(its)) - 1, 0)]], axis=-1)
        return np.zeros((*path.innovations.shape, 0))

    evaluate(problem, point, own=solution.evaluation.own, columns=keep)
    terms = _terms(problem, followed)
    if not terms:
        return ()
    courses = np.stack([t.course for t in terms], axis=1)
    ends = np.cumsum([0, *(w.stop - w.start for w in problem.windows)])
    place = np.array([t.coefficient for t in terms])

    def columns(w: int, filtering: Filter, path: Path) -> Array:
        by_state, by_output = by_coefficients(model, problem.centres[w], point.trims[w], problem.inputs[w])
        by_state[list(problem.subject.followed)] = 0.0
        out = np.zeros((*path.innovations.shape, len(terms)))
        _respond(
            filtering.linear.transition, filtering.output, filtering.gain, path.seen,
            np.ascontiguousarray(by_state[:, place]), np.ascontiguousarray(by_output[list(problem.used)][:, place]),
            np.ascontiguousarray(courses[ends[w] : ends[w + 1]]), out,
        )  # fmt: skip
        out[:, : filtering.given] = 0.0
        return out

    coefficients = coefficients_of(problem.subject)
    evaluation = evaluate(problem, point, coefficients, own=solution.evaluation.own, columns=columns)
    reduced = reduce(problem, point, evaluation)
    known = point.theta.size + len(coefficients)
    inflated = inflation(reduced, slice(0, known))
    prior = [p.spread**-2.0 for c in point.causes for p in c.parameters]
    prior += [c.parameters[0].spread ** -2.0 for c in coefficients]
    h, g = reduced.information / inflated, reduced.score / inflated
    h[np.arange(known), np.arange(known)] += np.array(prior)
    across = np.linalg.solve(h[:known, :known], h[:known, known:])
    score = g[known:] - across.T @ g[:known]
    information = np.diagonal(h)[known:] - np.einsum("ij,ij->j", h[:known, known:], across)
    informed = information > 1e-6 * np.diagonal(h)[known:]  # else it is a linear term
    gain = np.where(informed, 0.5 * score**2 / np.where(informed, information, 1.0), 0.0)
    slope_gain = shown_by(np.diagonal(reduced.information)[point.theta.size : known] / inflated)
    silent = {symbol_of(c) for c, g in zip(coefficients, slope_gain, strict=True) if not g > BEYOND_DOUBT}
    gain[[i for i, term in enumerate(terms) if silent & set(term.slopes)]] = (
        0.0  # nor does it determine the curvature
    )
    blocks = sum(len(b) for b in evaluation.blocks)
    evidence = gain - 0.5 * math.log(max(blocks, 2)) - math.log(len(terms))
    order = [int(i) for i in np.argsort(-gain) if evidence[i] > BEYOND_DOUBT and gain[i] > gain.max() - ALIKE]
    return tuple(
        MissingTerm(
            _COEFFICIENTS[terms[i].coefficient], terms[i].name, float(score[i] / information[i] / terms[i].unit),
            float(information[i] ** -0.5 / terms[i].unit), float(gain[i]),
        )
        for i in order
    )  # fmt: skip


def _terms(problem: Problem, followed: Mapping[int, Array]) -> list[_Term]:
    """Products, powers and lags: of an even number of what moves the aircraft across in CL and Cm, odd in the rest."""
    found: list[_Term] = []
    signals = _signals(problem, followed)
    along = [name for name in _ALONG if name in signals]
    across = [name for name in _ACROSS if name in signals]
    dt_s = problem.subject.flight.dt_s
    for j, coefficient in enumerate(_COEFFICIENTS):
        if coefficient in ("CL", "Cm"):
            own, pairs = along, [*_pairs(along), *_pairs(across)]
        else:
            own, pairs = across, [(a, b) for a in along for b in across]
        courses: dict[str, tuple[Array, tuple[str, ...]]] = {
            f"{a} x {b}" if a != b else f"{a} squared": (signals[a] * signals[b], (a, b)) for a, b in pairs
        }
        for name in own:
            x, it = signals[name], (name,)
            if coefficient not in ("CL", "Cm"):
                courses[f"{name} x its size"] = x * np.abs(x), it
            courses[f"{name} cubed"] = x**3, it
            courses |= {f"{name}, {lag:g} s late": (_late(x, lag / dt_s), it) for lag in _LAGS_S}
        for name, (course, signals_in_it) in courses.items():
            off = course - course[:, 0].mean()
            unit = float(np.sqrt(np.mean(off[:, 0] ** 2)))
            slopes = tuple(f"{_EQUATION[coefficient]}_{_BY[s]}" for s in signals_in_it if s in own)
            if unit > 1e-9:
                found.append(_Term(j, name, off / unit, unit, slopes))
    return found


def _pairs(names: Sequence[str]) -> list[tuple[str, str]]:
    return [(a, b) for i, a in enumerate(names) for b in names[i:]]


def _late(x: Array, samples: float) -> Array:
    """A signal behind a lag of first order, by the samples before: at the same sample a gust is in all outputs."""
    stays = math.exp(-1.0 / samples)
    late = lfilter([0.0, 1.0 - stays], [1.0, -stays], x[:, 0] - x[0, 0]) + x[0, 0]
    return np.stack([late, late], axis=-1)


def _signals(problem: Problem, followed: Mapping[int, Array]) -> Mapping[str, Array]:
    """Angles about their means, rates over speed as coefficients have them, surfaces about their means: (samples, 2).

    Motion is as the filter follows it: the noise of a vane would make every coefficient too small.
    """
    subject, flight = problem.subject, problem.subject.flight
    geometry = subject.aircraft.need_geometry("diagnosis")
    outputs = np.concatenate([followed[w] for w in range(len(problem.windows))])
    over = {"roll rate": geometry.span_m, "pitch rate": geometry.mean_chord_m, "yaw rate": geometry.span_m}
    length = 2.0 * flight.airspeed_m_s
    found = {name: outputs[:, k] * arm / length for k, (name, arm) in enumerate(over.items(), 1)}
    found |= {"angle of attack": outputs[:, 9], "sideslip": outputs[:, 10]}
    for j, name in enumerate(SURFACES):
        flown = np.where(np.isfinite(flight.flown[:, j]), flight.flown[:, j], flight.commands[:, j])
        column = np.concatenate([flown[w.start : w.stop] for w in problem.windows])
        found[name] = np.stack([column, column], axis=-1)
    return {
        name: np.nan_to_num(both - np.nanmean(both[:, 0]))
        for name, both in found.items()
        if np.isfinite(both[:, 0]).any()
    }


@compiled(error_model="numpy", nogil=True)
def _respond(f, h, gains, seen, by_state, by_output, courses, out):  # type: ignore[no-untyped-def]
    """What terms take from the innovations, (samples, used, terms), into ``out``."""
    samples, outputs, width = out.shape
    x = np.zeros((WIDTH, width))
    for t in range(samples):
        at = min(t, gains.shape[0] - 1)
        for k in range(outputs):
            if not seen[t, k]:
                continue
            e = out[t, k]
            for c in range(width):
                e[c] = by_output[k, c] * courses[t, c, 1]
            for i in range(WIDTH):
                if h[k, i] != 0.0:
                    for c in range(width):
                        e[c] += h[k, i] * x[i, c]
            for i in range(WIDTH):
                for c in range(width):
                    x[i, c] -= gains[at, k, i] * e[c]
        x = f @ x
        for i in range(STATES):
            for c in range(width):
                x[i, c] += by_state[i, c] * courses[t, c, 0]
