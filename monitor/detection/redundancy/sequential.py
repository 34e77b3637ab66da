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
from scipy.special import log_ndtr

from wingwatch.monitor.detection.redundancy.evidence import Changes
from wingwatch.monitor.detection.redundancy.hypotheses import Hypothesis
from wingwatch.monitor.detection.redundancy.layout import RELATIONS, ROUGH
from wingwatch.monitor.detection.redundancy.likelihood import likelihoods, most_gained

__all__ = ["Contest", "Finding", "Ranked", "rank", "smallest_seen"]

Array = NDArray[np.float64]

VARIANCE_FREEDOM = 10.0
"""nu: within seconds the air may become rougher or calmer, its variance by about a factor of 1.5."""
UNKNOWN_WEIGHT = 0.001
"""Share of the prior probability that something changed which no hypothesis describes."""
_CAUSES, _UNKNOWN = 40.0, 3.0
REPEATED = 3.0
"""Nats by which a frozen reading is likelier, each time it repeats as often as it did before at most: the longest of
exp(3) runs of a geometric distribution is three times its mean."""
_LOG_ROUGHER = float(np.log(0.1))
"""Of the probability that at an onset the air became rougher."""
_LOG_TOGETHER = float(np.log(0.01))
"""Of the probability that at an onset all that varies in a healthy aircraft began to vary together: the air changed."""


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


class Contest:
    """Hypotheses against one another, by the evidence of all relations.

    Args:
        changes: of all rows, by onset.
        floors: what parameters may change by in a healthy aircraft, (rows, COLUMNS).
    """

    def __init__(self, changes: Changes, floors: Array) -> None:
        gained = most_gained(
            changes.information,
            changes.vector,
            changes.square,
            changes.samples,
            changes.at_rest,
            VARIANCE_FREEDOM,
        )
        gained[:, len(RELATIONS) :] += _LOG_ROUGHER
        rows = np.tile(np.arange(len(RELATIONS)), (len(gained), 1))
        has = ROUGH >= 0
        rougher = gained[:, ROUGH[has]] > gained[:, : len(RELATIONS)][:, has]
        rows[:, has] = np.where(rougher, ROUGH[has], rows[:, has])
        onsets = np.arange(len(rows))[:, None]
        self._changes = Changes(*(np.ascontiguousarray(part[onsets, rows]) for part in changes))
        self._changes.at_rest[rows >= len(RELATIONS)] += _LOG_ROUGHER
        self._floors = floors
        varied = _varied(changes, floors)
        varied[:, len(RELATIONS) :] += _LOG_ROUGHER
        calm = varied[:, : len(RELATIONS)].copy()
        calm[:, has] = np.logaddexp(calm[:, has], varied[:, ROUGH[has]])
        self._varied = calm
        self._log_null = np.logaddexp(np.log(0.5), np.log(0.5) - np.log(len(calm)) + _log_sum(calm, 0))
        # what varied at an earlier onset, up to this one
        earlier = np.tril(np.ones((len(calm), len(calm))), -1)[:, :, None]
        apart = np.where(earlier > 0.0, calm[None] - calm[:, None], -np.inf)
        self._before = np.logaddexp(np.log(0.5), np.log(0.5) - np.log(len(calm)) + _log_sum(apart, 1))
        best = np.take_along_axis(gained, rows, axis=1)
        self._most = np.maximum(best + self._before - self._log_null, 0.0).max(axis=0)

    @property
    def together(self) -> float:
        """Log of the Bayes factor that relations began to vary at one onset, each or no more than usual, and nothing is
        at fault."""
        by_it = self._varied + self._before - self._log_null
        return float(_log_sum(np.logaddexp(by_it, 0.0).sum(axis=1) - by_it.shape[1] * np.log(2.0), 0))

    def could_gain(self, hypothesis: Hypothesis) -> float:
        """Nats that its relations could gain at most, whatever had changed."""
        return float(sum(self._most[i] for i in hypothesis.effects))

    def judged(self, hypothesis: Hypothesis) -> Ranked:
        """Its Bayes factor.

        In each relation something may have varied before, too; where it does no more than nothing that may have been at
        another onset. Relations that do not prove it count no more than those that do.
        """
        relations = np.array(list(hypothesis.effects))
        by_relation, size, curvature = _likelihoods(self._changes, self._floors, hypothesis)
        fixed = hypothesis.size_std == 0.0
        own, null = by_relation.T, self._log_null[relations]
        by_it = own + self._before[:, relations] - null
        logs = np.logaddexp(by_it, np.minimum(own - self._varied[:, relations], 0.0)) - np.log(2.0)
        proves = np.array([e.proves for e in hypothesis.effects.values()])
        total, error = logs[:, proves].sum(axis=1), np.zeros(len(size))
        total += np.minimum(logs[:, ~proves].sum(axis=1), np.maximum(total, 0.0))
        if not fixed:
            prior = hypothesis.size_std**-2.0
            error = 1.0 / np.sqrt(curvature)
            total += np.log(error) + 0.5 * np.log(prior) - 0.5 * size**2 * prior
            if not hypothesis.signed:
                total += np.log(2.0) + log_ndtr(size / error)
        onset = int(np.argmax(total))
        return Ranked(hypothesis, float(_log_sum(total, 0)), onset, float(size[onset]), float(error[onset]))


def rank(
    changes: Changes, floors: Array, repeated: Array, hypotheses: Sequence[Hypothesis], least: float = 10.0
) -> Finding:
    """The hypotheses by their evidence.

    Args:
        changes: of all rows, by onset.
        floors: what parameters may change by in a healthy aircraft, (rows, COLUMNS).
        repeated: how often each relation's own reading has repeated by now over how often it did before, at most.
        hypotheses: those that compete.
        least: hypotheses whose relations together could not gain so many nats, whatever had changed, are left out.
    """
    contest = Contest(changes, floors)
    ranked = [contest.judged(h) for h in hypotheses if h.effects and contest.could_gain(h) > least]
    last = len(changes.square) - 1
    ranked += [
        Ranked(hypothesis, float(REPEATED * repeated[hypothesis.repeated]), last, 1.0, 0.0)
        for hypothesis in hypotheses
        if hypothesis.repeated is not None and repeated[hypothesis.repeated] > 1.0
    ]
    if not ranked:
        return Finding(-np.inf, (), ())
    logs = np.array([r.log_factor for r in ranked]) + _log_weights([r.hypothesis for r in ranked])
    total = float(_log_sum(logs, 0))
    healthy = float(np.logaddexp(0.0, _LOG_TOGETHER + contest.together))
    order = np.argsort(-logs)
    return Finding(total - healthy, [ranked[i] for i in order], np.exp(logs[order] - total).tolist())


def _log_sum(logs: Array, axis: int) -> Array:
    """Log of the sum of exponentials along an axis; scipy's costs twenty times as much on a dozen numbers."""
    most = np.maximum(logs.max(axis=axis, keepdims=True), -1e300)
    return np.asarray(np.log(np.exp(logs - most).sum(axis=axis) + 1e-300) + most.squeeze(axis))


def _log_weights(hypotheses: Sequence[Hypothesis]) -> Array:
    unknown = np.array([h.cause == "unknown" for h in hypotheses])
    return np.log(np.where(unknown, UNKNOWN_WEIGHT / _UNKNOWN, (1.0 - UNKNOWN_WEIGHT) / _CAUSES))


def _varied(changes: Changes, floors: Array) -> Array:
    """(5) with m = 0 by onset and row: what varies in a healthy aircraft has changed within its floors."""
    rows, nothing = np.arange(changes.vector.shape[1]), np.zeros(changes.vector.shape[1:])
    found = likelihoods(
        _evidence(changes), (rows, nothing), (floors, nothing), 0.0, 0.0, (0.0, 0.0), VARIANCE_FREEDOM
    )
    return np.asarray(found[0].T)


def _likelihoods(changes: Changes, floors: Array, hypothesis: Hypothesis) -> tuple[Array, Array, Array]:
    """(5) of a hypothesis: by relation and onset; its size and the precision of that by onset."""
    relations, effects = np.array(list(hypothesis.effects)), hypothesis.effects.values()
    directions = np.array([e.direction for e in effects])
    varying = np.hypot(floors[relations], [e.free for e in effects]), np.array([e.by_size for e in effects])
    fixed, usual = hypothesis.size_std == 0.0, hypothesis.size_std or 1.0
    prior = 0.0 if fixed else usual**-2.0
    limits = (1.0, 1.0) if fixed else (-np.inf if hypothesis.signed else 0.0, np.inf)
    logs, size, precision = likelihoods(
        _evidence(changes), (relations, directions), varying, usual, prior, limits, VARIANCE_FREEDOM
    )
    return logs, size, precision


def _evidence(changes: Changes) -> tuple[Array, ...]:
    return changes.information, changes.vector, changes.square, changes.samples, changes.at_rest


def smallest_seen(
    changes: Changes, floors: Array, hypotheses: Sequence[Hypothesis], log_threshold: float
) -> list[float | None]:
    """By hypothesis the smallest size that the segments since the first onset would have shown, None where no size.

    That is the one whose expected gain passes the threshold. Sizes are in the unit of each hypothesis; ``floors``:
    (rows, columns).
    """
    found: list[float | None] = []
    for hypothesis in hypotheses:
        total = 0.0
        for i, effect in hypothesis.effects.items():
            std = np.hypot(floors[i], effect.varying(0.5 * hypothesis.size_std))
            moved = changes.information[0, i] @ effect.direction
            within = np.eye(len(std)) + std[:, None] * changes.information[0, i] * std
            along = std * moved
            total += float(effect.direction @ moved - along @ np.linalg.solve(within, along))
        needed = 2.0 * (log_threshold - float(_log_weights([hypothesis])[0]))
        found.append(float(np.sqrt(needed / total)) if total > 1e-9 * needed else None)
    return found
