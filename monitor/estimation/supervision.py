"""All that passes between the two estimators of a structure: what one says about the data that the other sees.

Fourier estimator and filter read the same signals and know nothing of each other. Each sees what the other cannot:

- signal: the Fourier estimator distinguishes a regressor that moved from one that only carried noise. The filter
  cannot. So after noise it returns to its posterior after the last signal (``EkfEstimator.solve``), and a derivative
  that the Fourier estimator calls not observable for want of signal is not observable for the filter either.
- change: the Fourier estimator finds that a derivative has changed. The filter cannot tell that from the noise of its
  surfaces, so its covariance is reset there (``EkfEstimator.release``).
- rough air: the filter carries the gust and says how much of the motion it causes. A transform of the block knows no
  before and after: of a rate's variance the fraction that the air causes is, to first order, the fraction by which the
  Fourier estimator's moment derivatives come out too small. Changes are then looked for only once it is known how the
  aircraft damps its rolling: rolling air and an aircraft without damping look alike.
- no vane: a reconstructed velocity sees no gust. Whether the air is rough the filter says together with the
  accelerometer alone: a fault moves the filter's gust, too, but is not rough from sample to sample. A gust reaches the
  accelerometer through z_w (or y_v) at once, and within a sample's time it moves as a random walk: of variance Q a
  step it leaves 2 Q in the square of a second difference, white sensor noise of variance R leaves 6 R, and the
  aircraft's own motion, which is smooth, next to nothing. Doublets and faults are rare beside gusts, which never rest,
  so the median of the squares is followed, not their mean.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators import (
    BlockEvidence,
    EkfState,
    FourierState,
    Lanes,
    SignalState,
    arrays_of,
    one_vehicle,
)
from wingwatch.monitor.estimation.calm_air import follow_calm, is_calm, surface_moved
from wingwatch.monitor.estimation.lacking_surfaces import marginal
from wingwatch.monitor.estimation.mode_solution import ModeSolution, Pair
from wingwatch.monitor.estimation.roughness import (
    ROUGHNESS,
    follow_motions,
    follow_roughnesses,
    is_gusty,
)
from wingwatch.monitor.estimation.sizes import MODEL_ERROR, TYPICAL_CHANGE

__all__ = ["Lane", "PairState", "Supervisor"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]
Learned = tuple[Array, Array]

_LEAST_LANES = 8
"""Places are added by eight at least, else by a quarter: memory for a quarter more vehicles than there are."""

ROUGH_FRACTION = 0.1
"""Fraction of a rate's variance from which on the air is rough; the Fourier moment derivatives are biased there."""

BLOCKS_IN_ROUGH_AIR = 4
"""Closed blocks, as many as the Fourier estimator's memory of 40 s holds, before which changes are not looked for in
rough air: the damping of rolling, without which the air's rolling passes for the aircraft's, is not known before."""

MOTION_S = 10.0
"""Time over which the motion is measured that the air's part is compared with: a block."""

ROUGH_MEMORY_S = 80.0
"""Twice the estimators' memory: after it they have forgotten six sevenths of what gusts taught them unseen."""


@dataclass(slots=True)
class PairState:
    """What a pair remembers of its vehicles, one row each.

    Attributes:
        motion: of ``follow_motion``; roughness: of ``follow_roughness``.
        blocks: blocks closed at the last solution, (n,).
        rough_s: when the air was last found rough without a vane, (n,).
        calm_s: since when the air has been found calm without a vane, NaN where it has not, (n,).
        again: whether rows were run again after a change since the filter's evidence was taken, (n,).
    """

    signals: SignalState
    fourier: FourierState
    ekf: EkfState
    motion: Array
    roughness: Array
    blocks: Places
    rough_s: Array
    calm_s: Array
    again: Flags

    def put(self, which: Places | slice, other: "PairState") -> None:
        """Some vehicles become those of another state, in place."""
        for kept, new in zip(self._arrays(), other._arrays(), strict=True):
            kept[which] = new

    def of(self, place: int) -> "PairState":
        """A copy of one vehicle's row, a batch of one."""
        row = slice(place, place + 1)
        return PairState(
            SignalState(*(getattr(self.signals, f.name)[row].copy() for f in fields(SignalState))),
            FourierState(*(getattr(self.fourier, f.name)[row].copy() for f in fields(FourierState))),
            one_vehicle(self.ekf, place),
            self.motion[row].copy(),
            self.roughness[row].copy(),
            self.blocks[row].copy(),
            self.rough_s[row].copy(),
            self.calm_s[row].copy(),
            self.again[row].copy(),
        )

    def alike(self, other: "PairState") -> bool:
        """Whether rows of the other state are of the same shapes."""
        return all(
            own.shape[1:] == its.shape[1:] and own.dtype == its.dtype
            for own, its in zip(self._arrays(), other._arrays(), strict=True)
        )

    def _arrays(self) -> Iterator[NDArray[Any]]:
        for part in (self.signals, self.fourier):
            yield from (getattr(part, f.name) for f in fields(part))
        yield from (array for _, array in arrays_of(self.ekf))
        yield from (self.motion, self.roughness, self.blocks, self.rough_s, self.calm_s, self.again)


class Lane:
    """The place of one vehicle in the states of its type; it is free again when the lane is dropped.

    Attributes:
        place: row of the states.
    """

    __slots__ = ("__weakref__", "place")

    def __init__(self, place: int) -> None:
        self.place = place


class Supervisor:
    """Leads the pairs of all vehicles of a type, and carries over what one estimator of a pair says to the other.

    Vehicles advance together or alone; no number of one enters another's.

    Args:
        pairs: one a structure.
    """

    def __init__(self, pairs: Sequence[Pair]) -> None:
        self.pairs = {p.structure.name: p for p in pairs}
        self._size = 0
        self._free: list[int] = []
        self._states: dict[str, PairState] = {}
        self._first: dict[str, PairState] = {}
        """Of one vehicle before its first sample."""

    def join(self) -> Lane:
        """A place for one more vehicle, its states as before the first sample."""
        if not self._free:
            self._grow(self._size + (max(self._size // 4, _LEAST_LANES) if self._size else 1))
        lane = Lane(self._free.pop())
        place = np.array([lane.place])
        for name in self.pairs:
            self._states[name].put(place, self._first[name])
        finalize(lane, self._free.append, lane.place).atexit = False
        return lane

    def _grow(self, size: int) -> None:
        for name, p in self.pairs.items():
            grown = _init(p, size)
            if self._size:
                grown.put(slice(self._size), self._states[name])
            else:
                self._first[name] = _init(p, 1)
            self._states[name] = grown
        self._free += range(size - 1, self._size - 1, -1)
        self._size = size

    def take(self, lanes: Lanes, values: Array) -> None:
        """Take in clean samples, shape (vehicles, samples, columns)."""
        for name, p in self.pairs.items():
            state = self._states[name]
            signals = p.signals.update(state.signals, values, lanes)
            whole = signals if p.vane else p.signals.high_passed(state.signals, signals, lanes)
            p.fourier.update(state.fourier, whole, lanes)
            p.ekf.update(state.ekf, signals, lanes)
            follow_motions(state.motion, signals, lanes, MOTION_S)
            if not p.vane:
                column = p.signals.config.layout.accelerometer
                follow_roughnesses(state.roughness, signals, lanes, column)

    def solve(
        self, places: Places, time_s: Array, faults: dict[int, Exception]
    ) -> list[dict[str, ModeSolution]]:
        """Bring both estimators of every structure up to the last sample, each with what the other says.

        Args:
            places: the vehicles, (m,).
            time_s: of the last sample of each, (m,).
            faults: by place, gets what the program failed on of one vehicle; the others go on.
        """
        gusty = self._feels_gusts(places)
        self._follow_calm(places, time_s, gusty)
        by_mode = [self._solve(p, places, time_s, gusty, faults) for p in self.pairs.values()]
        return [dict(zip(self.pairs, modes, strict=True)) for modes in zip(*by_mode, strict=True)] or [
            {} for _ in places
        ]

    def read(self, lane: Lane, time_s: float) -> dict[str, ModeSolution]:
        """As of the last sample: the filter to that sample, the Fourier estimator to its last solution."""
        place, at_s = np.array([lane.place]), np.array([time_s])
        gusty = self._feels_gusts(place)
        return {
            name: _read(p, state, place, at_s, _is_rough(p, state, place, gusty), {})[0]
            for (name, p), state in zip(self.pairs.items(), self._states.values(), strict=True)
        }

    def stuck(self, lane: Lane) -> tuple[str, ...]:
        """Channels of one vehicle's sensors that are stuck now, so that no estimator reads them."""
        found = [p.signals.stuck(self._states[name].signals, lane.place) for name, p in self.pairs.items()]
        return tuple(dict.fromkeys(channel for channels in found for channel in channels))

    def stuck_rows(self, lane: Lane) -> dict[str, int]:
        """In how many rows one vehicle's sensors have been stuck, by channel."""
        rows: dict[str, int] = {}
        for name, p in self.pairs.items():
            rows |= p.signals.stuck_rows(self._states[name].signals, lane.place)
        return rows

    def saved(self, lane: Lane) -> dict[str, PairState]:
        """A copy of what is remembered of one vehicle, by structure, each a batch of one."""
        return {name: state.of(lane.place) for name, state in self._states.items()}

    def restore(self, lane: Lane, saved: Mapping[str, PairState]) -> None:
        """One vehicle goes on from what ``saved`` gave.

        Raises:
            ValueError: it was saved by other estimators.
        """
        if set(saved) != set(self._states) or not all(
            len(part.blocks) == 1 and self._states[name].alike(part) for name, part in saved.items()
        ):
            raise ValueError("the estimators' states have other shapes than this chain's")
        for name, state in self._states.items():
            state.put(np.array([lane.place]), saved[name])

    def resume(self, lane: Lane, structure: str, information: Array, vector: Array) -> None:
        """The Fourier estimator of a structure continues from a memory instead of from its closed blocks.

        ``information`` (k, k), ``vector`` (k,): J and h of the derivatives at the reference, concise.
        """
        state = self._states[structure].fourier
        self.pairs[structure].fourier.resume(state, information, vector, lane.place)

    def _solve(
        self, pair: Pair, places: Places, time_s: Array, gusty: Flags, faults: dict[int, Exception]
    ) -> list[ModeSolution]:
        state = self._states[pair.structure.name]
        pair.fourier.solve(state.fourier, places)
        closed = pair.fourier.blocks_closed(state.fourier, places)
        news = closed != state.blocks[places]
        state.blocks[places] = closed
        spread = pair.fourier.changed(state.fourier, places)
        changed = np.asarray(spread.any(axis=1))
        gained, unlike = _gained(pair, state, places[news])
        for i in _listed(places[news & changed]):
            # Since the change, with which the block ends, the filter took the new aircraft for the old one.
            gained[i] = None
        faults |= pair.ekf.solve(state.ekf, pair.fourier.sees(state.fourier, places), places)
        rough = _is_rough(pair, state, places, gusty)
        state.rough_s[places[rough]] = time_s[rough]
        calm = is_calm(state.calm_s[places], time_s)
        for i in set(_listed(places[calm])) & unlike:
            # Any derivative may have changed; forgetting alone would have the next blocks contradict it, too.
            pair.ekf.release(state.ekf, np.full(len(pair.structure.derivatives), TYPICAL_CHANGE), i)
            state.again[i] = True
        solutions = _read(pair, state, places, time_s, rough, gained)
        # Without a vane all may contradict what is remembered; with one, rough air at first.
        trusted = ~rough | (closed >= BLOCKS_IN_ROUGH_AIR) if pair.vane else np.zeros_like(rough)
        pair.fourier.follow_changes(state.fourier, trusted, places)
        for m in np.flatnonzero(changed):
            i = int(places[m])
            not_yet_s = pair.fourier.block_start_s(state.fourier, i)  # a change begins the running block
            try:  # whatever the filter says of the air: it takes a change for a gust
                state.again[i] = pair.ekf.release(state.ekf, spread[m], i, not_yet_s)
            except Exception as error:  # the others are not to suffer by it
                faults[i] = error
        return solutions

    def _follow_calm(self, places: Places, time_s: Array, gusty: Flags) -> None:
        """Whether the air is calm, where a velocity is reconstructed: a gust that turns any mode counts for all."""
        blind = [(p, self._states[name]) for name, p in self.pairs.items() if not p.vane]
        turned = np.zeros(places.size, dtype=np.bool_)
        for p, state in blind:
            turned |= _is_turned(p, state, places)
        for _, state in blind:
            state.calm_s[places] = follow_calm(state.calm_s[places], time_s, gusty, turned)

    def _feels_gusts(self, places: Places) -> Flags:
        """Of which vehicles an accelerometer does, (m,): asked where no vane sees them."""
        felt = np.zeros(places.size, dtype=np.bool_)
        for name, p in self.pairs.items():
            if not p.vane:
                memory = self._states[name].roughness
                felt |= np.array([is_gusty(memory[i], p.force_noise_variance) for i in places])
        return felt


def _init(pair: Pair, vehicles: int) -> PairState:
    return PairState(
        pair.signals.init(vehicles),
        pair.fourier.init(vehicles),
        pair.ekf.init(vehicles),
        np.full((vehicles, 3, len(pair.structure.states)), np.nan),
        np.zeros((vehicles, 2, ROUGHNESS)),
        np.zeros(vehicles, dtype=np.int64),
        np.full(vehicles, -np.inf),
        np.full(vehicles, np.nan),
        np.zeros(vehicles, dtype=np.bool_),
    )


def _listed(array: NDArray[Any]) -> list[Any]:
    return array.tolist()  # type: ignore[no-any-return]


def _gained(pair: Pair, state: PairState, closed: Places) -> tuple[dict[int, Learned | None], set[int]]:
    """What the filter has learned in the blocks that some vehicles have closed, and without a vane those that
    contradict what it knows.

    Without a vane only blocks count in which a surface of the mode has moved the vehicle, and a block contradicts what
    is known by more than blocks may differ: else the filter, which forgets slowly, would never agree with a changed
    aircraft.
    """
    if pair.vane:
        gained: dict[int, Learned | None] = {
            i: pair.ekf.take_gained(state.ekf, i, again=state.again[i]) for i in _listed(closed)
        }
        state.again[closed] = False
        return gained, set()
    gained, unlike = {}, set()
    for i in _listed(closed):
        moved = surface_moved(pair.structure, state.ekf.gained_matrix[i], pair.ekf.config.prior_std)
        if moved and pair.ekf.contradicted(state.ekf, i, MODEL_ERROR):
            unlike.add(i)
        taken = pair.ekf.take_gained(state.ekf, i, again=state.again[i], within=MODEL_ERROR)
        gained[i] = taken if moved else None
        state.again[i] &= not moved
    return gained, unlike


def _is_turned(pair: Pair, state: PairState, places: Places) -> Flags:
    """Of which vehicles the filter puts a large part of the rotation down to the air, (m,)."""
    mean, square = state.motion[places, 0], state.motion[places, 1]
    with np.errstate(over="ignore"):  # a filter that diverged: infinitely rough all right
        fraction = pair.ekf.gust_variance(state.ekf, places) / np.maximum(square - mean**2, 1e-12)
    return np.asarray((fraction[:, 1:] > ROUGH_FRACTION).any(axis=1))


def _is_rough(pair: Pair, state: PairState, places: Places, gusty: Flags) -> Flags:
    """Whose air is rough now, (m,); ``gusty``: whose accelerometer feels it."""
    rough = _is_turned(pair, state, places)
    return rough if pair.vane else rough & gusty


def _read(
    pair: Pair,
    state: PairState,
    places: Places,
    time_s: Array,
    rough: Flags,
    gained: Mapping[int, Learned | None],
) -> list[ModeSolution]:
    """What is known of a mode of some vehicles now, and of the blocks that they have closed.

    ``gained``: by place of those that have, what the filter has learned in the block; None where that is not known.
    """
    if not pair.vane:
        since_s = time_s - state.rough_s[places]
        rough = rough | ((since_s >= 0.0) & (since_s < ROUGH_MEMORY_S))
    comparable = np.ones_like(rough)
    if not pair.vane:
        comparable = is_calm(state.calm_s[places], time_s) & ~rough & ~_is_turned(pair, state, places)
    fourier, ekf = pair.fourier.validities(state.fourier, places), pair.ekf.validities(state.ekf, places)
    solutions = []
    for m, (i, is_rough, compared) in enumerate(zip(*map(_listed, (places, rough, comparable)), strict=True)):
        block = pair.fourier.evidence(state.fourier, i) if i in gained else None
        learned = gained.get(i)
        if (known := pair.known) is not None:
            block, learned = _of_known(block, learned, known)
        solutions.append(ModeSolution(pair, (fourier.of(m), ekf.of(m)), block, learned, is_rough, compared))
    return solutions


def _of_known(
    block: BlockEvidence | None, gained: tuple[Array, Array] | None, known: Array
) -> tuple[BlockEvidence | None, tuple[Array, Array] | None]:
    """Evidence without that of a column of zeros, which is rounding, and of what a surface did unseen."""
    if block is not None:
        information, vectors = marginal(block.information, np.stack([block.vector, block.bias]), known)
        block = replace(block, information=information, vector=vectors[0], bias=vectors[1])
    if gained is not None:
        information, vectors = marginal(gained[0], gained[1][None], known)
        gained = information, vectors[0]
    return block, gained
