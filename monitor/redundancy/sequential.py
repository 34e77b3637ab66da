"""The sequential test over onsets and hypotheses, by the evidence of all relations together.

In units of its variance before the onset a relation's noise has precision lambda, known beforehand as if from nu
samples: rougher air explains a large residual, too. With K, y, Q of (3) and (4), n samples since the onset, a fault of
size m in the direction a, and w ~ N(0, W) what varies in a healthy aircraft, delta = m a + w, the log-likelihood is

    Q(m, w) = Q - 2 y'delta + delta'K delta
    t(Q) = ln Gamma((nu + n)/2) - ln Gamma(nu/2) - n/2 ln(nu/2) - (nu + n)/2 ln(1 + Q/nu)
    ln L = t(Q(m, w)) - w'W^-1 w/2 - ln det(I + lambda K W)/2                                                   (5)

against noise as it was last and nothing changed (``Changes.at_rest``), at the mode of m and w. That is the mode of a
Gaussian with lambda = (nu + n)/(nu + Q(m, w)): a few steps of one after the other. W does not grow with the noise.
Directions that a hypothesis leaves free are part of its W. m is integrated over by Laplace's method.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, log_ndtr, logsumexp

from wingwatch.monitor.redundancy.evidence import Changes
from wingwatch.monitor.redundancy.hypotheses import Hypothesis

__all__ = ["Finding", "Ranked", "rank", "smallest_seen"]

Array = NDArray[np.float64]

VARIANCE_FREEDOM = 10.0
"""nu: within seconds the air may become rougher or calmer, its variance by about a factor of 1.5."""
UNKNOWN_WEIGHT = 0.001
"""Share of the prior probability that something changed which no hypothesis describes."""
_CAUSES, _UNKNOWN = 40.0, 3.0
REPEATED = 3.0
"""Nats by which a frozen reading is likelier, each time it repeats as often as it did before at most: the longest of
exp(3) runs of a geometric distribution is three times its mean."""
_STEPS = 6


class Ranked(NamedTuple):
    """One hypothesis after the latest segment.

    ``log_factor``: log of its Bayes factor summed over onsets; ``onset``: number of the likeliest onset; ``size`` and
    ``standard_error`` there.
    """

    hypothesis: Hypothesis
    log_factor: float
    onset: int
    size: float
    standard_error: float


class Finding(NamedTuple):
    """What the test says.

    ``log_statistic``: of the Shiryaev-Roberts statistic; ``ranked``: hypotheses, likeliest first; ``probabilities``: of
    each, given that something changed.
    """

    log_statistic: float
    ranked: Sequence[Ranked]
    probabilities: Sequence[float]


class _Variation(NamedTuple):
    """W^(1/2) K W^(1/2) = U diag(``spread``) U', ``axes`` = U'W^(1/2), ``pull`` = U'W^(1/2) y; by onset (m, ...)."""

    spread: Array
    axes: Array
    pull: Array


class _Part(NamedTuple):
    """One relation's part in a hypothesis, by onset: a'y, a'Ka, U'W^(1/2)Ka, and what (5) needs besides."""

    pulled: Array
    total: Array
    across: Array
    variation: _Variation
    square: Array
    samples: Array
    at_rest: Array


def rank(
    changes: Changes, floors: Array, repeated: Array, hypotheses: Sequence[Hypothesis], least: float = 10.0
) -> Finding:
    """The hypotheses by their evidence.

    Args:
        changes: of all relations, by onset.
        floors: what parameters may change by in a healthy aircraft, (relations, COLUMNS).
        repeated: how often each relation's own reading has repeated by now over how often it did before, at most.
        hypotheses: those that compete.
        least: hypotheses whose relations together could not gain so many nats, whatever had changed, are left out.
    """
    variation = _variation(changes.information, changes.vector, floors)
    nothing = np.zeros(changes.vector.shape)
    by_variation = _log_likelihoods([_part_of(changes, nothing, variation)], None)[0].sum(axis=0)
    log_null = np.logaddexp(
        np.log(0.5), np.log(0.5) - np.log(len(by_variation)) + logsumexp(by_variation, axis=0)
    )
    values, vectors = np.linalg.eigh(changes.information)
    along = (np.swapaxes(vectors, -1, -2) @ changes.vector[..., None])[..., 0]
    seen = values > 1e-9 * values[..., -1:] + 1e-300
    most = np.sum(np.where(seen, along**2 / np.where(seen, values, 1.0), 0.0), axis=-1)
    gain = _student(np.maximum(changes.square - most, 0.0), changes.samples) + changes.at_rest
    most_of_each = np.maximum(gain - log_null, 0.0).max(axis=0)
    ranked = [
        _ranked(hypothesis, changes, floors, variation, by_variation, log_null)
        for hypothesis in hypotheses
        if sum(most_of_each[i] for i in hypothesis.effects) > least
    ]
    last = len(changes.square) - 1
    ranked += [
        Ranked(hypothesis, float(REPEATED * repeated[hypothesis.repeated]), last, 1.0, 0.0)
        for hypothesis in hypotheses
        if hypothesis.repeated is not None and repeated[hypothesis.repeated] > 1.0
    ]
    if not ranked:
        return Finding(-np.inf, (), ())
    logs = np.array([r.log_factor for r in ranked]) + _log_weights([r.hypothesis for r in ranked])
    total = float(logsumexp(logs))
    order = np.argsort(-logs)
    return Finding(total, [ranked[i] for i in order], np.exp(logs[order] - total).tolist())


def _log_weights(hypotheses: Sequence[Hypothesis]) -> Array:
    unknown = np.array([h.cause == "unknown" for h in hypotheses])
    return np.log(np.where(unknown, UNKNOWN_WEIGHT / _UNKNOWN, (1.0 - UNKNOWN_WEIGHT) / _CAUSES))


def _variation(information: Array, vector: Array, std: Array) -> _Variation:
    spread, axes = np.linalg.eigh(std[..., :, None] * information * std[..., None, :])
    axes = np.swapaxes(axes, -1, -2) * std[..., None, :]
    return _Variation(np.maximum(spread, 0.0), axes, (axes @ vector[..., None])[..., 0])


def _part_of(changes: Changes, direction: Array, variation: _Variation) -> _Part:
    """All relations at once, a direction for each (m, relations, columns)."""
    moved = (changes.information @ direction[..., None])[..., 0]
    return _Part(
        np.sum(direction * changes.vector, axis=-1), np.sum(direction * moved, axis=-1),
        (variation.axes @ moved[..., None])[..., 0], variation, changes.square, changes.samples,
        changes.at_rest,
    )  # fmt: skip


def _parts(hypothesis: Hypothesis, changes: Changes, floors: Array, variation: _Variation) -> list[_Part]:
    parts = []
    for i, effect in hypothesis.effects.items():
        own = Changes(*(part[:, i] for part in changes))
        of_it = _Variation(*(part[:, i] for part in variation))
        if effect.free.any():
            of_it = _variation(own.information, own.vector, np.hypot(floors[i], effect.free))
        parts.append(_part_of(own, np.broadcast_to(effect.direction, own.vector.shape), of_it))
    return parts


def _ranked(
    hypothesis: Hypothesis,
    changes: Changes,
    floors: Array,
    variation: _Variation,
    by_variation: Array,
    log_null: Array,
) -> Ranked:
    """A relation for which the hypothesis does no more than nothing at all may have varied at another onset."""
    parts = _parts(hypothesis, changes, floors, variation)
    prior = hypothesis.size_std**-2.0 if hypothesis.size_std > 0.0 else None
    by_relation, size, curvature = _log_likelihoods(
        parts, 1.0 if prior is None else prior, fixed=prior is None
    )
    error, logs = np.zeros(len(size)), np.zeros(len(size))
    for i, own in zip(hypothesis.effects, by_relation, strict=True):
        logs += np.logaddexp(own - log_null[i], np.minimum(own - by_variation[:, i], 0.0)) - np.log(2.0)
    if prior is not None:
        error = 1.0 / np.sqrt(curvature)
        logs = logs - 0.5 * size**2 * prior + 0.5 * np.log(prior) + np.log(error)
        if not hypothesis.signed:
            logs = logs + np.log(2.0) + log_ndtr(size / error)
            size = np.maximum(size, 0.0)
    onset = int(np.argmax(logs))
    return Ranked(hypothesis, float(logsumexp(logs)), onset, float(size[onset]), float(error[onset]))


def _student(square: Array, samples: Array) -> Array:
    """t(Q) of (5)."""
    nu = VARIANCE_FREEDOM
    constant = gammaln(0.5 * (nu + samples)) - gammaln(0.5 * nu) - 0.5 * samples * np.log(0.5 * nu)
    return np.asarray(constant - 0.5 * (nu + samples) * np.log1p(square / nu))


def _log_likelihoods(
    parts: Sequence[_Part], prior: float | None, fixed: bool = False
) -> tuple[Array, Array, Array]:
    """(5) of each part at the mode of the size (parts, m, ...), the size, and its precision (m, ...).

    Args:
        parts: of one hypothesis.
        prior: precision of the size beforehand; None where there is none and the size is 0.
        fixed: the size is 1.
    """
    nu = VARIANCE_FREEDOM
    size = np.ones(parts[0].square.shape) if fixed else np.zeros(parts[0].square.shape)
    precision = [np.ones(p.square.shape) for p in parts]
    curvature = np.zeros(size.shape)
    for _ in range(_STEPS):
        if prior is not None and not fixed:
            curvature, pulled = np.full(size.shape, prior), np.zeros(size.shape)
            for p, by in zip(parts, precision, strict=True):
                held = by[..., None] / (1.0 + by[..., None] * p.variation.spread)
                curvature += by * (p.total - np.sum(p.across * held * p.across, axis=-1))
                pulled += by * (p.pulled - np.sum(p.across * held * p.variation.pull, axis=-1))
            size = pulled / curvature
        logs = np.zeros((len(parts), *size.shape))
        for k, (p, by) in enumerate(zip(parts, precision, strict=True)):
            left = p.variation.pull - size[..., None] * p.across
            varied = by[..., None] * left / (1.0 + by[..., None] * p.variation.spread)
            square = p.square + size * (size * p.total - 2.0 * p.pulled)
            square = square + np.sum(varied * (p.variation.spread * varied - 2.0 * left), axis=-1)
            square = np.maximum(square, 0.0)
            precision[k] = (nu + p.samples) / (nu + square)
            logs[k] = _student(square, p.samples) + p.at_rest
            logs[k] -= 0.5 * np.sum(varied**2 + np.log1p(by[..., None] * p.variation.spread), axis=-1)
    return logs, size, curvature


def smallest_seen(
    changes: Changes, floors: Array, hypotheses: Sequence[Hypothesis], log_threshold: float
) -> list[float | None]:
    """By hypothesis the smallest size that the segments since the first onset would have shown, None where no size.

    That is the one whose gain, as it is expected, passes the threshold.
    """
    first = Changes(*(part[:1] for part in changes))
    variation = _variation(first.information, first.vector, floors)
    found: list[float | None] = []
    for hypothesis in hypotheses:
        total = 0.0
        for p in _parts(hypothesis, first, floors, variation):
            total += float((p.total - np.sum(p.across**2 / (1.0 + p.variation.spread), axis=-1))[0])
        needed = 2.0 * (log_threshold - float(_log_weights([hypothesis])[0]))
        found.append(float(np.sqrt(needed / total)) if total > 0.0 else None)
    return found
