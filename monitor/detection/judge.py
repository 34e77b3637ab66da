"""The judge: a sequential test over blocks, for every onset and every cause, and what an alert is made of.

For each possible onset among the blocks remembered, the Bayes factor of "changed by this cause since then" against "no
change" is formed, by the evidence of each estimator; the mean of both, summed over onsets, is the Shiryaev-Roberts
statistic. Without a change a Bayes factor has expectation one, so the statistic minus the number of blocks is a
martingale and the mean number of blocks to a false alert is at least the threshold, whatever the excitation: quiet
blocks have a factor of one and are evidence neither for a change nor against one. The derivation stands in
``docs/methods/detection.md``.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from wingwatch.aircraft import FlightCondition, ModeStructure
from wingwatch.baselines import Expectation, Reference, posteriors
from wingwatch.estimators import BlockEvidence
from wingwatch.monitor.detection.blocks import (
    EKF,
    FOURIER,
    BlockView,
    Evidence,
    ModeBlock,
    sums_of,
    which_have_blocks,
)
from wingwatch.monitor.detection.causes import CAUSES, UNEXPLAINED, Cause
from wingwatch.monitor.detection.comparison import (
    Along,
    Change,
    Coordinates,
    along,
    bias_of,
    blurred,
    change_since,
    informative_part,
    log_bayes_any,
    log_bayes_direction,
    natural_size,
)
from wingwatch.monitor.detection.judge_state import JudgeConfig, JudgeState, Verdict
from wingwatch.monitor.estimation.mode_solution import ModeSolution

__all__ = ["Judge", "largest_change"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]


APRIORI_DISCOUNT = 100.0
"""A-priori numbers are no evidence of a change: in the test their standard errors count ten times as large, so a change
is always one against flights, the vehicle's own or those that identified the type. That holds also once its own flights
have founded a reference: directions that they hardly excited would else be judged by the numbers alone."""


class Judge:
    """Tests one aircraft type's blocks; the state is one vehicle's.

    Args:
        coordinates: of the structures compared.
        config: see ``JudgeConfig``.
    """

    def __init__(self, coordinates: Mapping[str, Coordinates], config: JudgeConfig | None = None) -> None:
        self.coordinates = coordinates
        self.config = config or JudgeConfig()

    def init(self, references: Mapping[str, Reference], founded: bool) -> JudgeState:
        """State at the start, with what earlier flights taught.

        ``founded``: the expectation rests on more than a-priori numbers.
        """
        learned = {
            name: references.get(name) or Reference.empty(len(c.structure.derivatives))
            for name, c in self.coordinates.items()
        }
        own = all(r.blocks >= self.config.founded_blocks for r in learned.values())
        by_filter = {name: Reference.empty(r.vector.size) for name, r in learned.items()}
        return JudgeState(learned, by_filter, identified=founded, founded=founded or (own and bool(learned)))

    def adopt(self, state: JudgeState, references: Mapping[str, Reference], founded: bool) -> None:
        """Take in what earlier flights taught, which could not be read at the start; ``init`` says what is what."""
        for name, learned in references.items():
            if name in state.references and learned.vector.shape == state.references[name].vector.shape:
                state.references[name] = learned.plus(state.references[name])
        own = all(r.blocks >= self.config.founded_blocks for r in state.references.values())
        state.identified = founded
        state.founded = state.founded or founded or (own and bool(state.references))

    def renew(self, state: JudgeState, references: Mapping[str, Reference], founded: bool) -> None:
        """What earlier flights taught was changed by a person: it takes the place of what was taken in.

        What this flight has taught so far is in it, for that is stored as it is learned; blocks that are remembered
        still join it later. Where something was taken back, what the filter has learned in this flight goes, too.
        """
        for name, known in state.references.items():
            kept = references.get(name)
            if kept is None or kept.vector.shape != known.vector.shape:
                kept = Reference.empty(known.vector.size)
            if kept.blocks < known.blocks:
                state.by_filter[name] = Reference.empty(known.vector.size)
            state.references[name] = kept
        own = all(r.blocks >= self.config.founded_blocks for r in state.references.values())
        state.identified = founded
        state.founded = founded or (own and bool(state.references))
        state.contradictions.clear()

    def mode_block(
        self,
        mode: ModeSolution,
        evidence: BlockEvidence,
        expectation: Expectation,
        condition: FlightCondition,
    ) -> ModeBlock:
        """A structure's evidence, of both estimators, and expectation brought to common coordinates."""
        at = self.coordinates[mode.structure.name].at(condition)
        expected, covariance = at.from_concise(expectation.value, expectation.covariance)
        natural = natural_size(expected, covariance)
        model_variance = (self.config.model_error * natural) ** 2
        found = at.of_evidence(evidence.information, evidence.vector)
        bias = at.slope * evidence.bias
        by_fourier = blurred(*found, bias, model_variance)
        by_filter = (np.zeros_like(found[0]), np.zeros_like(bias), np.zeros_like(bias))
        if mode.gained is not None and mode.filter_says_something:
            gained = at.of_evidence(*mode.gained)
            by_filter = blurred(*informative_part(*gained, natural), by_filter[2], model_variance)
        if (
            mode.reconstructed
        ):  # the Fourier estimator takes the velocity's noise for its own: the filter alone is valid
            by_fourier = by_filter
        both = Evidence(*(np.stack(parts) for parts in zip(by_fourier, by_filter, strict=True)))
        return ModeBlock(both, expected, covariance, mode.rough)

    def consider(self, state: JudgeState, block: BlockView, alarmed_onset_s: float | None) -> Verdict | None:
        """Take in a block; returns what the test says, or None while there is nothing to compare with.

        Args:
            alarmed_onset_s: onset of the alert in force: later blocks never join the reference.
        """
        state.blocks.append(block)
        state.rough.update(name for name, mode in block.modes.items() if mode.rough)
        if block.informative:
            state.informative += 1
        verdict = self._verdict(state)
        if len(state.blocks) > self.config.remembered_blocks:
            self._absorb(state, alarmed_onset_s, verdict)
        self._check_expectation(state, verdict)
        return verdict

    def _absorb(self, state: JudgeState, alarmed_onset_s: float | None, verdict: Verdict | None) -> None:
        """The oldest block joins the reference, unless it may be part of a change."""
        oldest = state.blocks.pop(0)
        if alarmed_onset_s is not None and oldest.end_s > alarmed_onset_s:
            return
        suspicious = verdict is not None and verdict.log_statistic > 0.5 * self.config.log_threshold
        if suspicious and alarmed_onset_s is None and verdict is not None and verdict.onset <= _first(state):
            return  # also where the first block cannot be judged: the change may be older than what is remembered
        for name, mode in oldest.modes.items():
            for estimator, learned in ((FOURIER, state.references), (EKF, state.by_filter)):
                information, vector = mode.evidence.information[estimator], mode.evidence.vector[estimator]
                if name in learned and np.trace(information) > 0.0:
                    learned[name] = learned[name].add(information, vector, self.config.block_s)
        if all(r.blocks >= self.config.founded_blocks for r in state.references.values()):
            state.founded = True

    def _check_expectation(self, state: JudgeState, verdict: Verdict | None) -> None:
        """Flights that contradict an a-priori expectation take its weight away; nothing is called damage."""
        calm = verdict is None or verdict.log_statistic < 0.5 * self.config.log_threshold
        if state.identified or not calm:
            return
        for name, coordinates in self.coordinates.items():
            if name in state.contradictions or name in state.rough:
                continue
            information, vector = self.before(state, name, max(0, len(state.blocks) - 2))
            modes = [b.modes[name] for b in state.blocks if name in b.modes]
            if not modes:
                continue
            natural = natural_size(modes[-1].expected, modes[-1].expected_covariance)
            error = self.config.model_error * natural
            bias = bias_of(information, np.sum([m.evidence.bias[FOURIER] for m in modes], axis=0))
            change = change_since(
                modes[-1].expected, modes[-1].expected_covariance, information, vector,
                np.diag(error**2) + np.outer(bias, bias), natural,
            )  # fmt: skip
            freedom = float(
                np.linalg.matrix_rank(change.precision, tol=1e-9 * np.trace(change.precision) + 1e-300)
            )
            distance = float(change.score @ np.linalg.pinv(change.precision, hermitian=True) @ change.score)
            if freedom and chdtrc(freedom, distance) < self.config.contradiction:
                state.contradictions[name] = _named(coordinates.structure, change)

    def expected(
        self, states: Sequence[JudgeState], name: str, prior: Array, covariance: Array
    ) -> tuple[Array, Array]:
        """Expectations after the own flights of m vehicles, (m, k) and (m, k, k), in the judge's coordinates."""
        doubted = np.array([[[name in state.contradictions]] for state in states])
        references = [state.references[name] for state in states]
        return posteriors(
            prior,
            np.where(doubted, covariance * APRIORI_DISCOUNT, covariance),
            np.stack([r.information for r in references]),
            np.stack([r.vector for r in references]),
        )

    def before(
        self, state: JudgeState, name: str, onset: int, estimator: int = FOURIER
    ) -> tuple[Array, Array]:
        """Information (k, k) and vector (k,) of the vehicle's own flight before a block and of earlier flights, by an
        estimator."""
        reference = (state.references if estimator == FOURIER else state.by_filter)[name]
        information, vector = reference.information.copy(), reference.vector.copy()
        for block in state.blocks[:onset]:
            if name in block.modes:
                information += block.modes[name].evidence.information[estimator]
                vector += block.modes[name].evidence.vector[estimator]
        return information, vector

    def _changes_of_all(
        self, state: JudgeState, onsets: Places, healthy: Places
    ) -> tuple[dict[str, Change], Flags]:
        """The changes of all structures that have a block since the first onset, and which have one since each of them,
        (structures, m)."""
        present = which_have_blocks(state.blocks, self.coordinates, onsets)
        names = [name for name, seen in zip(self.coordinates, present, strict=True) if seen[0]]
        return {name: self._changes(state, name, onsets, healthy) for name in names}, present[present[:, 0]]

    def _changes(self, state: JudgeState, name: str, onsets: Places, healthy: Places) -> Change:
        """The change of a structure since each of several onsets, against everything before a block of each, by the
        evidence of each estimator: axes (m, 2).

        Args:
            onsets: index of the first changed block, (m,); those after the structure's last block say nothing.
            healthy: index of the block before which all is healthy, (m,).
        """
        before, since, latest = sums_of(state.blocks, name)
        prior = latest.expected_covariance * (1.0 if state.identified else APRIORI_DISCOUNT)
        references = state.references[name], state.by_filter[name]
        information = np.stack([r.information for r in references]) + before.information[healthy]
        vector = np.stack([r.vector for r in references]) + before.vector[healthy]
        known = np.asarray(np.linalg.inv(prior), dtype=np.float64)
        covariance = np.asarray(np.linalg.inv(known + information), dtype=np.float64)
        covariance = np.asarray(0.5 * (covariance + np.swapaxes(covariance, -1, -2)), dtype=np.float64)
        mean = _times(covariance, known @ latest.expected + vector)
        window = since.information[onsets]
        bias = bias_of(window, since.bias[onsets]) - _times(covariance, before.bias[healthy])
        natural = np.broadcast_to(natural_size(latest.expected, latest.expected_covariance), mean.shape)
        return change_since(
            mean, covariance, window, since.vector[onsets], bias[..., :, None] * bias[..., None, :], natural
        )

    def recent(
        self, state: JudgeState, cause: Cause, onset_s: float, blocks: int, condition: FlightCondition
    ) -> tuple[float, float, float] | None:
        """Log Bayes factor, size and standard error of a cause over the latest informative blocks alone.

        The reference is what came before ``onset_s``. None while there are not yet that many blocks since.
        """
        after = _informative_since(state, onset_s)
        if len(after) <= blocks:
            return None
        onset, healthy = np.array([after[-blocks]]), np.array([after[0]])
        changes, present = self._changes_of_all(state, onset, healthy)
        if cause is UNEXPLAINED:
            factors = _anything(changes, present)[0]
            leading = int(np.argmax(factors))
            size, error = largest_change({name: change.at((0, leading)) for name, change in changes.items()})
        else:
            found = [values[0, 0] for values in self._directed(changes, (cause,), condition)]
            factors = found[0]
            leading = int(np.argmax(factors))
            size, error = (float(values[leading]) for values in found[1:])
        return float(_of_either(factors)), size, error

    def smallest_seen(self, state: JudgeState) -> dict[str, float | None]:
        """By cause the smallest size whose expected Bayes factor alone would have passed the threshold, had it begun at
        the best of the remembered onsets; None where no size would have."""
        onsets = np.arange(_first(state), len(state.blocks))
        if not onsets.size:
            return dict.fromkeys((cause.name for cause in CAUSES), None)
        changes, _ = self._changes_of_all(state, onsets, onsets)
        condition = state.blocks[-1].condition
        directions = {name: self.directions(name, CAUSES, c.mean, condition) for name, c in changes.items()}
        along_it = _along(changes, directions, {name: np.zeros_like(d) for name, d in directions.items()})
        found: dict[str, float | None] = {}
        for cause, weight in zip(CAUSES, along_it.precision.max(axis=(1, 2)), strict=True):
            # the mean over both estimators, and that over the pattern and what deviates from it, cost a factor of four
            needed = 2.0 * (self.config.log_threshold - np.log(cause.weight) + np.log(4.0))
            found[cause.name] = float(np.sqrt(needed / weight)) if weight > 0.0 else None
        return found

    def forget_change(self, state: JudgeState, onset_s: float, blocks: int) -> None:
        """A change is over: its blocks leave, so they are neither evidence again nor join the reference.

        What came before ``onset_s`` stays, and from the latest ``blocks`` informative ones on, which agree with it;
        where there are fewer, none since is known to.
        """
        informative = _informative_since(state, onset_s)
        resumed = informative[-blocks] if len(informative) >= blocks else len(state.blocks)
        state.blocks[:] = [b for k, b in enumerate(state.blocks) if b.end_s <= onset_s or k >= resumed]

    def forget_since(self, state: JudgeState, onset_s: float) -> None:
        """What came after this stamp leaves, and what came before it stays."""
        state.blocks[:] = [b for b in state.blocks if b.end_s <= onset_s]

    def _verdict(self, state: JudgeState) -> Verdict | None:
        onsets = np.arange(_first(state), len(state.blocks))
        if not onsets.size:
            return None
        hypotheses = (*CAUSES, UNEXPLAINED)
        condition = state.blocks[-1].condition
        changes, present = self._changes_of_all(state, onsets, onsets)
        directed, sizes, errors = self._directed(changes, CAUSES, condition)
        of_each = np.array([*directed, _anything(changes, present)])
        weights = np.log([h.weight for h in hypotheses])
        total = float(np.logaddexp.reduce(_of_either(of_each) + weights[:, None], axis=None))
        pooled = weights + np.logaddexp.reduce(of_each, axis=1).mean(axis=-1)
        probabilities = np.exp(pooled - np.logaddexp.reduce(pooled))
        best = int(np.argmax(probabilities))
        column = int(np.argmax(of_each[best].mean(axis=-1)))
        leading = int(np.argmax(of_each[best, column]))
        onset = int(onsets[column])
        cause = hypotheses[best]
        seen = [n for n, has_blocks in zip(changes, present, strict=True) if has_blocks[column]]
        known, other = ({n: changes[n].at((column, e)) for n in seen} for e in (leading, 1 - leading))
        if cause is UNEXPLAINED:
            size, error = largest_change(known)
        else:
            size, error = float(sizes[best, column, leading]), float(errors[best, column, leading])
        earlier = state.blocks[onset - 1].end_s if onset else state.blocks[0].end_s - self.config.block_s
        factor = float(of_each[best, column, 1 - leading])
        confirmed = self._confirmed(other, cause, size, factor, condition)
        return Verdict(
            total, cause, float(probabilities[best]), float(probabilities[-1]), onset, earlier, size, error, known,
            confirmed,
        )  # fmt: skip

    def directions(
        self, name: str, causes: Sequence[Cause], mean: Array, condition: FlightCondition
    ) -> Array:
        """Each cause's direction at a mean (..., k) in the judge's coordinates, (causes, ..., k)."""
        c = self.coordinates[name]
        at = c.at(condition)
        concise = at.scale * mean + at.offset
        found = [cause.direction(c.structure, concise, c.aircraft, condition) for cause in causes]
        return np.array(found) / at.scale

    def _directed(
        self, changes: Mapping[str, Change], causes: Sequence[Cause], condition: FlightCondition
    ) -> tuple[Array, Array, Array]:
        """Bayes factor, size and its error of each cause since each onset, over all structures together, each
        (causes, m, 2).

        No real ice or damage follows its pattern exactly: with even odds a cause either does, or moves every
        derivative of the structures it acts on off the pattern in proportion to its size. The integral over those
        deviations is exact. The size given is that of the likelier case, its error always that of the second: a pattern
        taken from another aircraft is never known to be exact.
        """
        size_std = np.array([cause.size_std for cause in causes])[:, None, None]
        directions = {name: self.directions(name, causes, c.mean, condition) for name, c in changes.items()}
        on_it = _along(changes, directions, {name: np.zeros_like(d) for name, d in directions.items()})
        exact, size, _ = log_bayes_direction(on_it.score, on_it.precision, size_std)
        deviations = {}
        for name, direction in directions.items():
            deviation = size[..., None] * np.hypot(
                self.config.off_pattern * direction,
                self.config.off_natural / size_std[..., None] * changes[name].natural,
            )
            deviation[~direction.any(axis=-1)] = 0.0
            deviations[name] = deviation
        loose = _along(changes, directions, deviations)
        off_it, loose_size, loose_error = log_bayes_direction(loose.score, loose.precision, size_std)
        off_it = off_it + loose.log_factor
        return (
            np.logaddexp(exact, off_it) - np.log(2.0),
            np.where(off_it > exact, loose_size, size),
            loose_error,
        )

    def _confirmed(
        self,
        other: Mapping[str, Change],
        cause: Cause,
        size: float,
        factor: float,
        condition: FlightCondition,
    ) -> bool:
        """Whether the other estimator finds the change, too: along a cause's direction at least half its size, or where
        it is in no known pattern odds for it, ``factor`` their logarithm; one that has learned nothing abstains."""
        if cause is UNEXPLAINED:
            return factor > 0.0 or not any(c.precision.any() for c in other.values())
        directions = {n: self.directions(n, (cause,), c.mean, condition) for n, c in other.items()}
        found = _along(other, directions, {n: np.zeros_like(d) for n, d in directions.items()})
        return bool(found.precision[0] <= 0.0 or found.score[0] >= 0.5 * size * found.precision[0])


def _of_either(factors: Array) -> Array:
    """Log of the mean Bayes factor of both estimators, their axis last: each has expectation one without a change."""
    return np.asarray(np.logaddexp.reduce(factors, axis=-1) - np.log(factors.shape[-1]))


def _times(matrix: Array, vector: Array) -> Array:
    """Products of matrices (..., k, k) and vectors (..., k)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _along(
    changes: Mapping[str, Change], directions: Mapping[str, Array], spreads: Mapping[str, Array]
) -> Along:
    """``along`` over all structures together."""
    parts = [along(change, directions[name], spreads[name]) for name, change in changes.items()]
    return Along(*(np.sum(values, axis=0) for values in zip(*parts, strict=True)))


def _anything(changes: Mapping[str, Change], present: Flags) -> Array:
    """Bayes factor of a change in no pattern since each onset, (m, 2): in one structure, in another, or in all.

    Args:
        present: which structures have a block since each onset, (structures, m).
    """
    singles = np.array([log_bayes_any(c, UNEXPLAINED.size_std * c.natural) for c in changes.values()])
    seen = present[:, :, None]
    options = np.where(seen, singles, -np.inf)
    several = seen.sum(axis=0) > 1
    together = np.where(several, np.where(seen, singles, 0.0).sum(axis=0), -np.inf)
    return np.asarray(np.logaddexp.reduce([*options, together], axis=0) - np.log(seen.sum(axis=0) + several))


def _first(state: JudgeState) -> int:
    """The first block that may be judged: without a foundation the oldest one is what others are compared with."""
    return 0 if state.founded else 1


def _informative_since(state: JudgeState, onset_s: float) -> list[int]:
    """Indices of the remembered blocks since an onset in which anything was excited."""
    return [k for k, b in enumerate(state.blocks) if b.end_s > onset_s and b.informative]


def largest_change(changes: Mapping[str, Change]) -> tuple[float, float]:
    """Largest relative change of a single derivative that is seen at all, with its standard error."""
    best = (0.0, 0.0, 0.0)
    for change in changes.values():
        for a in range(change.mean.size):
            w = change.precision[a, a]
            if w <= 0.0 or change.mean[a] == 0.0:
                continue
            size, error = change.score[a] / w / abs(change.mean[a]), 1.0 / np.sqrt(w) / abs(change.mean[a])
            z = abs(size) / error
            if z > best[0]:
                best = (z, abs(size), error)
    return best[1], best[2]


def _named(structure: ModeStructure, change: Change, most: int = 4) -> tuple[str, ...]:
    """Derivatives that differ most, in standard errors, worst first."""
    diagonal = np.diagonal(change.precision)
    z = np.where(diagonal > 0.0, change.score / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 0.0)
    order: Sequence[int] = np.argsort(-np.abs(z)).tolist()
    return tuple(structure.derivatives[a] for a in order[:most] if abs(z[a]) > 3.0)
