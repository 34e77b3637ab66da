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
from wingwatch.monitor.detection.redundancy.layout import COLUMNS, PARAMETERS_OF_ROW, ROUGH
from wingwatch.monitor.detection.redundancy.likelihood import contest, expected_gains, likelihoods

__all__ = ["Contest", "Finding", "Ranked", "Visible", "rank"]

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
        evidence = changes.information, changes.vector, changes.square, changes.samples, changes.at_rest
        self._floors = floors
        self._evidence, self._varied, self._before, self._null, self._most = contest(
            evidence, (PARAMETERS_OF_ROW, ROUGH), floors, VARIANCE_FREEDOM, _LOG_ROUGHER
        )

    @property
    def together(self) -> float:
        """Log of the Bayes factor, in nats, that relations began to vary at one onset, each or no more than usual, and
        nothing is at fault."""
        by_it = self._varied + self._before - self._null
        return float(_log_sum(np.logaddexp(by_it, 0.0).sum(axis=1) - by_it.shape[1] * np.log(2.0), 0))

    def could_gain(self, hypothesis: Hypothesis) -> float:
        """Nats that its relations could gain at most, whatever had changed."""
        return float(self._most[hypothesis.parts.relations].sum())

    def judged(self, hypothesis: Hypothesis) -> Ranked:
        """Its Bayes factor.

        In each relation something may have varied before, too; where it does no more than nothing that may have been at
        another onset. Relations that do not prove it count no more than those that do.
        """
        parts = hypothesis.parts
        by_relation, size, curvature = likelihoods(
            self._evidence,
            parts[:5],
            self._floors,
            (hypothesis.size_std, hypothesis.signed),
            VARIANCE_FREEDOM,
        )
        own, relations = by_relation.T, parts.relations
        by_it = own + self._before[:, relations] - self._null[relations]
        logs = np.logaddexp(by_it, np.minimum(own - self._varied[:, relations], 0.0)) - np.log(2.0)
        total, error = logs[:, parts.proves].sum(axis=1), np.zeros(len(size))
        total += np.minimum(logs[:, ~parts.proves].sum(axis=1), np.maximum(total, 0.0))
        if hypothesis.size_std > 0.0:
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
    unknown = np.array([h.cause == "unknown" for h in hypotheses], dtype=np.bool_)
    return np.log(np.where(unknown, UNKNOWN_WEIGHT / _UNKNOWN, (1.0 - UNKNOWN_WEIGHT) / _CAUSES))


class Visible:
    """Which sizes of some hypotheses segments would have shown.

    Args:
        hypotheses: by relations that it has, each at half its usual size.
    """

    def __init__(self, hypotheses: Sequence[Hypothesis]) -> None:
        parts = [h.parts for h in hypotheses]
        rows = [
            (h, one, k) for h, one in zip(hypotheses, parts, strict=True) for k in range(len(one.relations))
        ]
        self._begins = np.cumsum([0, *(len(one.relations) for one in parts)])
        self._parts = (
            np.array([one.relations[k] for _, one, k in rows], dtype=np.int64),
            np.array([one.parameters[k] for _, one, k in rows], dtype=np.int64),
            np.array([one.directions[k] for _, one, k in rows]).reshape(-1, COLUMNS),
        )
        varying = [np.hypot(one.free[k], 0.5 * h.size_std * one.by_size[k]) for h, one, k in rows]
        self._varying = np.array(varying).reshape(-1, COLUMNS)
        self._log_weights = _log_weights(hypotheses)

    def smallest(self, changes: Changes, floors: Array, log_threshold: float) -> list[float | None]:
        """By hypothesis the smallest size that the segments since the first onset would have shown, None where no size.

        That is the one whose expected gain passes the threshold. Sizes are in the unit of each hypothesis; ``floors``:
        (rows, columns).
        """
        gains = expected_gains(changes.information[0], floors, self._begins, self._parts, self._varying)
        needed = 2.0 * (log_threshold - self._log_weights)
        return [
            float(np.sqrt(n / gain)) if gain > 1e-9 * n else None
            for gain, n in zip(gains, needed, strict=True)
        ]
