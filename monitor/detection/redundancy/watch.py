"""One vehicle's relations, second by second: samples in, what the test says out.

A relation in which an alert is in force says nothing else. Once the alert has settled, the relation and those that use
the same channel learn anew: from then on they show what changes against the fault, its end among it.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.detection.redundancy.airframe_hypotheses import hypotheses_of
from wingwatch.monitor.detection.redundancy.evidence import Changes, Reference, changes_since, scored
from wingwatch.monitor.detection.redundancy.hypotheses import USED_BY, Hypothesis, recovery_from
from wingwatch.monitor.detection.redundancy.layout import (
    AIRSPEED,
    ALPHA,
    BETA,
    COLUMNS,
    EAST,
    FLOORS,
    FLOW,
    GUST_FELT,
    GUSTY,
    LIFT,
    NORTH,
    PRIORS,
    RELATIONS,
    ROLLING,
    ROUGH,
    ROWS,
)
from wingwatch.monitor.detection.redundancy.samples import (
    CHANGES,
    DRIFT,
    END_S,
    GOING,
    MOST_REPEATS,
    PRODUCTS,
    REPEATS,
    SEGMENT_S,
    SHORT_S,
    SQUARE,
    START_S,
    Memory,
    Segment,
    new_memory,
    new_segment,
    new_work,
    take_samples,
)
from wingwatch.monitor.detection.redundancy.segments import MOST_SEGMENTS, Segments
from wingwatch.monitor.detection.redundancy.sequential import Finding, Visible, rank
from wingwatch.monitor.detection.redundancy.set_up import changed, least_drift, model_of
from wingwatch.telemetry import SampleBlock

__all__ = ["LOG_THRESHOLD", "RedundancyState", "RedundancyWatch", "Second", "KnownFault"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FALSE_ALERT_INTERVAL_H = 1000.0
LOG_THRESHOLD = float(np.log(FALSE_ALERT_INTERVAL_H * 3600.0 / SEGMENT_S))
"""Of the Shiryaev-Roberts statistic: segments in the false alert interval."""
TUNING_S, AIRFRAME_TUNING_S, LEARNING_S = 10.0, 30.0, 20.0
"""At first relations' drifts find their values and nothing is learned, longer of forces and moments, for which
coefficients go by how gusts are filtered; then nothing is tested while they learn."""
_SINGLE = 6
"""Segments that stay as they are; older ones are joined by twos until they are ``_LONGEST_S`` long."""
_LONGEST_S = 5.0
LEAST_CHANGES = 100.0
"""Changes of a reading from which it is known how long it may repeat."""
LEAST_REPEATED = 3.0
"""Times that any reading may repeat."""
_LOOK_S = 2.0
_STARTLED, _STARTLED_S = 4.0, 5.0
"""The test is made every ``_LOOK_S``, and after each segment for a while once a sample has begun a segment, or a
segment's score is so many times its mean square."""
_SURPRISE = 4.5
"""Standard deviations of an innovation that begins a segment."""
_SCATTER_S = 60.0
"""Memory of how segments' scores scatter."""
_COMES_AND_GOES = 0.3
"""Part of what a coefficient seems to be off the file that may change within a minute."""
_DRIFT_GAIN, _TUNING_GAIN = 1.0, 3.0
_DRIFTS = (1e-5, 1e4)
"""A relation's drift follows the correlation of its innovations with those one sample before, between these limits and
rougher air has at least that of moderate gusts (``least_drift``) and ``_ROUGHER`` times the present one."""
_ROUGHER = 6.0
_COLOURED = 1e3
"""Most drift of moments: the sampled gusts of a moment stay correlated with those one sample before."""
_N, _ROWS = len(RELATIONS), len(ROWS)
_FLOW = list(FLOW)
_SAME_GUSTS = [AIRSPEED, NORTH, EAST]
"""The gusts along the path move all of them: where all are there, each says half of what it would alone."""
_VANES_OF = [ALPHA, ALPHA, BETA, BETA]
_VANES = [ALPHA, int(ROUGH[ALPHA]), BETA, int(ROUGH[BETA])]
"""Relations of the vanes, and their rows."""
_FLOORS, _PRIORS, _GUST_FELT = (table[list(ROWS)] for table in (FLOORS, PRIORS, GUST_FELT))
"""By row."""
_MOST_SHOWN = 256
"""Sets of relations that show nothing for a while: of that many it is kept what competes then."""
_TELLS_AIR = np.isin(np.arange(_N), _FLOW)
_FEELS_AIR = np.array(ROWS) >= LIFT
"""Rows whose errors are white from sample to sample, not over ten seconds: in air rougher than moderate their segments'
scores scatter at least as many times more as the gusts' variance is."""


@dataclass(slots=True)
class KnownFault:
    """A fault that an alert is in force for.

    Attributes:
        cause, channel, part: of its hypothesis; size: as it was found; onset_s: stamp at which it began.
        settled: whether its relations have begun to learn anew; until then its name and size may still change.
        repeated: relation whose reading repeats, where that is the fault.
    """

    cause: str
    channel: str
    size: float
    onset_s: float
    settled: bool = False
    repeated: int | None = None
    part: str = ""

    def is_of(self, hypothesis: Hypothesis) -> bool:
        """Whether it is what the hypothesis says, of whatever size."""
        return (self.cause, self.channel, self.part) == hypothesis.key

    def becomes(self, hypothesis: Hypothesis, size: float) -> None:
        """It is another fault than it seemed."""
        (self.cause, self.channel, self.part), self.size = hypothesis.key, size


@dataclass(slots=True)
class RedundancyState:
    """All that is remembered of one vehicle.

    Attributes:
        memory, segment: of the filters, and the sums of the running segment.
        reference, segments: what was before, and the closed segments since.
        tuned_s: seconds of samples so far, up to ``AIRFRAME_TUNING_S``.
        learns_until_s: stamp until which each relation is not tested, (relations,).
        looked_s, startled_s: stamps of the last test and of the last large innovation.
        log_statistic: of the last test.
        variance: of each row's e2/S, as of the last segment.
        faults: those that alerts are in force for.
        changed: what the settled faults of the airframe have changed forces and moments by, (relations, COLUMNS).
    """

    memory: Memory
    segment: Segment
    reference: Reference = field(default_factory=Reference)
    segments: Segments = field(default_factory=Segments)
    tuned_s: float = 0.0
    learns_until_s: Array = field(default_factory=lambda: np.full(_N, np.nan))
    looked_s: float = -np.inf
    startled_s: float = -np.inf
    log_statistic: float = -np.inf
    variance: Array = field(default_factory=lambda: np.ones(_ROWS))
    faults: list[KnownFault] = field(default_factory=list)
    changed: Array = field(default_factory=lambda: np.zeros((_N, COLUMNS)))


@dataclass(frozen=True, slots=True)
class Second:
    """After a segment.

    Attributes:
        time_s: its end.
        onsets_s: stamps of the onsets that the findings number.
        finding: what the test says of all that no alert is in force for; None where it was not made.
        followed: the same of the relations of faults that have not settled.
    """

    time_s: float
    onsets_s: tuple[float, ...] = ()
    finding: Finding | None = None
    followed: Finding | None = None


class RedundancyWatch:
    """Relations of an aircraft type with its channels; the state is one vehicle's.

    Args:
        aircraft: its file.
        present: channels that the samples carry after completion.
        kinds: of the surfaces: ``command`` where the position is only commanded.

    Attributes:
        absent: by relation that cannot be used, the reason.
        hypotheses: what can be found.
    """

    def __init__(self, aircraft: Aircraft, present: Collection[str], kinds: Mapping[str, str]) -> None:
        self.model, self.absent = model_of(aircraft, present, kinds)
        self.hypotheses = hypotheses_of(aircraft, self.model)
        self._active = frozenset(np.flatnonzero(self.model.active).tolist())
        self._named = [h for h in self.hypotheses if h.cause not in ("unknown", "drag")]
        self._visible = Visible(self._named)
        self._work = new_work()
        self._shown = lru_cache(_MOST_SHOWN)(self._shown_without)
        self._rough_drift = np.clip(least_drift(aircraft, self.model), *_DRIFTS)
        drift = np.array([RELATIONS[i].drift for i in ROWS])
        drift[_N:] = self._rough_drift[list(GUSTY)]
        self._drift = drift
        self._least_scatter = np.where(
            np.isin(ROWS, _SAME_GUSTS) & self.model.active[_SAME_GUSTS].all(), 2.0, 1.0
        )

    def init(self) -> RedundancyState:
        """Before the first sample."""
        state = RedundancyState(new_memory(self._drift), new_segment())
        state.reference.scatter[:] = self._least_scatter
        return state

    def feed(self, state: RedundancyState, block: SampleBlock) -> Iterable[Second]:
        """Take in clean samples; yields what each segment that ends in them leads to."""
        first, values = 0, np.ascontiguousarray(block.values)
        while first < len(values):
            limit = _SURPRISE**2 * state.variance[:_N]
            model = changed(self.model, state.changed) if state.changed.any() else self.model
            first = take_samples(values, first, model, state.memory, state.segment, limit, self._work)
            if first < len(values):
                yield self._close(state, float(values[first, 0]))

    def hypothesis(self, fault: KnownFault) -> Hypothesis | None:
        """The first that is of a fault."""
        return next((h for h in self.hypotheses if fault.is_of(h)), None)

    def learn_anew(self, state: RedundancyState, relations: Collection[int], now_s: float) -> None:
        """Forget what is known of relations, and learn them from now on."""
        for i in relations:
            for row in (i, int(ROUGH[i])) if ROUGH[i] >= 0 else (i,):
                state.reference.forget(row)
                state.segments.forget(row)
                # its filter starts anew, without what the fault has left in it
                state.memory.scalar[row, GOING] = 0.0
                state.segment.forget(row)
            state.learns_until_s[i] = now_s + LEARNING_S

    def settle(self, state: RedundancyState, fault: KnownFault, now_s: float) -> None:
        """A fault has its name and size: relations of its channel, or of the airframe that it changed, learn anew."""
        fault.settled = True
        self.learn_after(state, fault, now_s)

    def learn_after(self, state: RedundancyState, fault: KnownFault, now_s: float) -> None:
        """Relations of a fault that has settled or is gone learn anew, about the airframe as it is now."""
        airframe = np.zeros((_N, COLUMNS))
        for one in state.faults:
            own = self.hypothesis(one) if one.settled and not one.channel else None
            for i, effect in (own.effects if own is not None else {}).items():
                airframe[i] += one.size * effect.direction
        moved = np.flatnonzero((airframe != state.changed).any(axis=1)).tolist()
        state.changed = airframe
        self.learn_anew(state, self.users_of(fault).union(moved), now_s)

    def could_see(self, state: RedundancyState) -> list[tuple[Hypothesis, float | None]]:
        """By hypothesis the smallest size that the remembered segments would have shown, had it begun with them."""
        if not state.segments:
            return []
        changes = changes_since(state.reference, state.segments, 0, 0)
        sizes = self._visible.smallest(changes, self._floors(state), LOG_THRESHOLD)
        return [(h, size if h.repeated is None else 1.0) for h, size in zip(self._named, sizes, strict=True)]

    def repeats(self, state: RedundancyState, relation: int) -> bool:
        """Whether a relation's own reading repeats more often than it ever did before."""
        return bool(_repeated(state)[relation] > 1.0)

    def relations_of(self, fault: KnownFault) -> frozenset[int]:
        """Those that say nothing else than this fault, until it has settled."""
        own = [h.relations for h in self.hypotheses if fault.is_of(h)]
        return frozenset().union(*own)

    def users_of(self, fault: KnownFault) -> frozenset[int]:
        """Relations that use the channel at fault, its own among them."""
        return self.relations_of(fault) | USED_BY.get(fault.channel, frozenset())

    def _close(self, state: RedundancyState, next_s: float) -> Second:
        clock, segments = state.memory.clock, state.segments
        start_s, end_s = float(clock[START_S]), float(clock[END_S])
        seconds = end_s - start_s
        segments.close(state.segment, state.memory, start_s, seconds)
        goes_on = 0.0 <= next_s - end_s < SEGMENT_S
        forced = next_s == end_s and seconds < SEGMENT_S
        clock[START_S] = end_s if goes_on else np.nan
        clock[END_S] = end_s + (SHORT_S if forced else SEGMENT_S) if goes_on else np.nan
        if end_s < state.looked_s - SEGMENT_S:  # the clock was set back
            state.looked_s = state.startled_s = -np.inf
            state.learns_until_s[:] = end_s + LEARNING_S
        numbers = segments.scalar[segments.count]
        if state.tuned_s < TUNING_S:
            state.tuned_s += seconds
            state.learns_until_s[:] = end_s + LEARNING_S
            self._tune(state, numbers, seconds, np.ones(_N, dtype=np.bool_), _TUNING_GAIN)
            return Second(end_s)
        score, state.variance = scored(state.reference, segments, self._floors(state))
        segments.keep()
        if state.tuned_s < AIRFRAME_TUNING_S:
            state.tuned_s += seconds
            if state.tuned_s >= AIRFRAME_TUNING_S:
                self.learn_anew(state, range(LIFT, _N), end_s)
                state.reference.samples[_FEELS_AIR] = state.reference.excess[_FEELS_AIR] = 0.0
                score[_FEELS_AIR] = np.nan
            state.learns_until_s[LIFT:] = end_s + LEARNING_S
        return self._judged(state, seconds, score, forced, end_s)

    def _judged(
        self, state: RedundancyState, seconds: float, score: Array, forced: bool, now_s: float
    ) -> Second:
        if forced or np.nanmax(score, initial=0.0) > _STARTLED:
            state.startled_s = now_s
        following, waiting = self._following(state), self._waiting(state, now_s)
        finding = followed = None
        due = now_s - state.looked_s >= _LOOK_S or now_s - state.startled_s <= _STARTLED_S
        if due or following:
            state.looked_s = now_s
            changes = changes_since(state.reference, state.segments)
            repeated, floors = _repeated(state), self._floors(state)
            finding = rank(changes, floors, repeated, self._tested(state, waiting))
            state.log_statistic = finding.log_statistic
            own = frozenset().union(*(self.relations_of(f) for f in state.faults if not f.settled))
            if own:
                begun_s = max(f.onset_s for f in state.faults if not f.settled)
                begun = max(1, int(np.sum(state.segments.starts_s <= begun_s)))
                since = Changes(*(part[:begun] for part in changes))
                followed = rank(since, floors, repeated, [h for h in self.hypotheses if h.relations & own])
        calm = np.ones(_N, dtype=np.bool_)
        calm[list(following)] = False
        quiet = state.log_statistic < 0.5 * LOG_THRESHOLD
        numbers = state.segments.scalar[state.segments.count - 1]
        if state.log_statistic < 0.5 * LOG_THRESHOLD * self._changed_air(state):
            self._tune(state, numbers, seconds, calm)
            self._note_scatter(state, seconds, score, calm)
        elif quiet:  # a fault of the airframe may grow; how rough the air is shows as ever
            self._tune(state, numbers, seconds, calm & _TELLS_AIR)
        onsets_s = tuple(state.segments.starts_s.tolist())
        self._thin_out(state, calm, quiet)
        return Second(now_s, onsets_s, finding, followed)

    def _following(self, state: RedundancyState) -> frozenset[int]:
        """Relations of faults that have not settled."""
        return frozenset().union(*(self.users_of(f) for f in state.faults if not f.settled))

    def _waiting(self, state: RedundancyState, now_s: float) -> frozenset[int]:
        """Relations that are learned anew, that are of faults that have not settled, or that use a frozen reading."""
        frozen = (self.users_of(f) - self.relations_of(f) for f in state.faults if f.cause == "sensor_freeze")
        learning = np.flatnonzero(~(now_s > state.learns_until_s)).tolist()
        return frozenset(learning).union(self._following(state), *frozen)

    def _tested(self, state: RedundancyState, waiting: frozenset[int]) -> Sequence[Hypothesis]:
        """What competes now, by the relations that are free to show it.

        Where a fault has settled its relations show its end or more of it; those of an airframe fault show faults of
        sensors and surfaces, too, for it has been learned with the rest of the airframe.
        """
        of_parts = frozenset().union(*(self.relations_of(f) for f in state.faults if f.channel))
        changed = any(not f.channel for f in state.faults)
        waiting &= self._active
        tested = list(self._shown(waiting, waiting | (of_parts & self._active), changed))
        for fault in state.faults:
            own = self.hypothesis(fault)
            if own is None or not own.effects or not fault.settled or fault.repeated is not None:
                continue
            if (shown := own.without(waiting)) is None:
                continue
            if own.cause != "unknown":
                tested.append(recovery_from(shown, fault.size))
            if own.size_std > 0.0:
                tested.append(shown)
        return tested

    def _shown_without(
        self, waiting: frozenset[int], silent: frozenset[int], changed: bool
    ) -> tuple[Hypothesis, ...]:
        """Hypotheses as relations that are not silent show them; those of the airframe only where it has not changed
        and none of theirs waits."""
        free = [
            h.without(silent)
            for h in self.hypotheses
            if not (h.is_of_airframe and (changed or h.relations & waiting))
        ]
        return tuple(h for h in free if h is not None)

    def _floors(self, state: RedundancyState) -> Array:
        """What parameters may change by within a minute, (rows, COLUMNS).

        Gusts are no random walk. By what they move a vane's reading in a second a vane may seem to be off. And what a
        coefficient seems to be off the file is in part the gusts', for they act otherwise than the aircraft's own
        motion does: it comes and goes with them, and in other air than it was learned in nothing is known of it.
        """
        floors = _FLOORS.copy()
        gusts = state.memory.scalar[_VANES, DRIFT] * self.model.noise_variance[_VANES_OF]
        floors[_VANES] *= np.sqrt(1.0 + gusts / FLOORS[_VANES_OF, 0] ** 2)[:, None]
        off = state.reference.parameters(state.variance)
        other = self._changed_air(state)
        gusts = np.hypot(_COMES_AND_GOES * off, other * _PRIORS)
        return np.hypot(floors, _GUST_FELT * gusts)

    def _changed_air(self, state: RedundancyState) -> float:
        """0 to 1: how much the air differs from that in which coefficients were learned."""
        return state.reference.changed_air(state.memory.scalar[_FLOW, DRIFT])

    def _tune(
        self, state: RedundancyState, numbers: Array, seconds: float, which: Flags, gain: float = _DRIFT_GAIN
    ) -> None:
        """Relations' drifts follow the correlation of their innovations; ``numbers`` of a segment, (rows, 6)."""
        calm = slice(0, _N)
        correlation = numbers[calm, PRODUCTS] / np.maximum(numbers[calm, SQUARE], 1e-9)
        step = seconds * gain * np.clip(correlation, -0.5, 0.5)
        drift, most = state.memory.scalar[:, DRIFT], np.full(_N, _DRIFTS[1])
        most[ROLLING:] = _COLOURED
        drift[calm][which] = np.clip(drift[calm] * np.exp(step), _DRIFTS[0], most)[which]
        gusty = list(GUSTY)
        drift[_N:] = np.maximum(_ROUGHER * drift[gusty], self._rough_drift[gusty])

    def _note_scatter(self, state: RedundancyState, seconds: float, score: Array, which: Flags) -> None:
        said, scatter = which[list(ROWS)] & np.isfinite(score), state.reference.scatter
        followed = scatter[said] * (1.0 + seconds / _SCATTER_S * (score[said] - 1.0))
        drift = state.memory.scalar[:, DRIFT]
        rough = max(1.0, float(np.max(drift[_FLOW] / self._rough_drift[_FLOW], initial=1.0)))
        least = self._least_scatter * np.where(_FEELS_AIR, rough, 1.0)
        scatter[said] = np.maximum(least[said], followed)

    def _thin_out(self, state: RedundancyState, which: Flags, quiet: bool) -> None:
        """Join old segments; the oldest joins the reference, unless it may be part of a change."""
        segments = state.segments
        if len(segments) <= MOST_SEGMENTS:
            return
        begun = {fault.onset_s for fault in state.faults if not fault.settled}
        for k in range(len(segments) - _SINGLE - 1):
            if segments.start_s[k + 1] in begun:
                continue
            if segments.seconds[k] + segments.seconds[k + 1] <= _LONGEST_S:
                segments.join(k)
                return
        if quiet:
            state.reference.absorb(segments, which[list(ROWS)], state.memory.scalar[_FLOW, DRIFT])
        else:
            segments.drop(0)


def _repeated(state: RedundancyState) -> Array:
    """How often each relation's reading has repeated over how often it did before, at most.

    An attitude or a velocity that has hardly ever changed may rest: nothing is known of how long it does. Readings of
    the flow never do.
    """
    scalar = state.memory.scalar
    known = scalar[:, CHANGES] >= LEAST_CHANGES
    known[_FLOW] = True
    return np.asarray(known * scalar[:, REPEATS] / np.maximum(scalar[:, MOST_REPEATS], LEAST_REPEATED))
