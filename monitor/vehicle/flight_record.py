"""A record of a vehicle's last hour for pictures: what each block said, and when the faults of its alerts began."""

from array import array
from collections import OrderedDict, deque
from collections.abc import Sequence
from functools import lru_cache
from math import isnan, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from wingwatch.baselines import posteriors
from wingwatch.monitor.detection.blocks import EKF, FOURIER, BlockView
from wingwatch.monitor.detection.comparison import bias_of, change_since, natural_size
from wingwatch.monitor.detection.judge import Judge
from wingwatch.monitor.detection.judge_state import JudgeState, Verdict
from wingwatch.monitor.estimation.chain import Solution
from wingwatch.monitor.record_views import BlockRecord, ModeRecord

__all__ = ["KEPT_BLOCKS", "FlightRecord", "block_record", "information_bit", "innovation"]

Array = NDArray[np.float64]

KEPT_BLOCKS = 360
"""An hour of blocks of ten seconds."""

_KEPT_ONSETS = 100
_CONFIDENCE = 0.95
_RANK_TOLERANCE = 1e-9
_NAMES = {FOURIER: "fourier", EKF: "ekf"}

_END, _MODES = 1, 3
"""Places in a row of numbers: start, end and statistic of a block, then three of each mode by each estimator."""


class _Form(NamedTuple):
    """What most blocks of a vehicle have in common: which numbers their rows hold, and what of the air was rough."""

    modes: tuple[tuple[str, str], ...]
    rough: tuple[str, ...]


@lru_cache(maxsize=1024)
def _shared(form: _Form) -> _Form:
    """One form for all blocks that have an equal one."""
    return form


def _packed(block: BlockRecord) -> tuple[_Form, "array[float]"]:
    """A block as one row of numbers, NaN where there is none: as objects an hour of blocks took 300 kB more."""
    row = array("d", (block.start_s, block.end_s, nan if block.statistic is None else block.statistic))
    keys: list[tuple[str, str]] = []
    for structure, by_estimator in block.modes.items():
        for estimator, mode in by_estimator.items():
            keys.append((structure, estimator))
            row.extend(nan if n is None else n for n in (mode.information_bit, mode.innovation, mode.limit))
    return _shared(_Form(tuple(keys), tuple(block.rough))), row


def _unpacked(form: _Form, row: "array[float]") -> BlockRecord:
    numbers = [None if isnan(n) else n for n in row]
    modes: dict[str, dict[str, ModeRecord]] = {}
    for place, (structure, estimator) in enumerate(form.modes):
        first = _MODES + 3 * place
        modes.setdefault(structure, {})[estimator] = ModeRecord(*numbers[first : first + 3])
    return BlockRecord(row[0], row[_END], modes, numbers[2], form.rough)


class FlightRecord:
    """What is kept; nothing of it is in a checkpoint.

    Attributes:
        onsets_s: by alert, of the newest alerts.
    """

    __slots__ = ("_rows", "onsets_s")

    def __init__(self) -> None:
        self._rows: deque[tuple[_Form, array[float]]] = deque(maxlen=KEPT_BLOCKS)
        self.onsets_s: OrderedDict[str, float] = OrderedDict()

    @property
    def blocks(self) -> Sequence[BlockRecord]:
        """Oldest first."""
        return tuple(_unpacked(form, row) for form, row in self._rows)

    def note_blocks(self, blocks: Sequence[BlockRecord]) -> None:
        """Blocks that have been closed; where the clock was set back, those of the old clock go."""
        for block in blocks:
            if self._rows and block.end_s < self._rows[-1][1][_END]:
                self._rows.clear()
            self._rows.append(_packed(block))

    def note_onset(self, alert_id: str, onset_s: float | None) -> None:
        """When the fault of an alert began, where that is known."""
        if onset_s is None or not np.isfinite(onset_s):
            return
        self.onsets_s[alert_id] = float(onset_s)
        while len(self.onsets_s) > _KEPT_ONSETS:
            self.onsets_s.popitem(last=False)


def information_bit(information: Array, natural: Array) -> float:
    """Information of a block about derivatives, in bits, beside a prior as wide as their natural sizes.

    It is the mutual information of the block and the derivatives, log2 det(I + N J N) / 2.

    Args:
        information: J, (k, k), positive semidefinite.
        natural: N, (k,).
    """
    scaled = information * (natural[:, None] * natural)
    power = np.linalg.eigvalsh(0.5 * (scaled + scaled.T))
    return float(0.5 * np.sum(np.log2(1.0 + np.maximum(power, 0.0))))


def innovation(
    judge: Judge, state: JudgeState, name: str, onset_s: float | None = None
) -> dict[int, tuple[float, float]]:
    """By estimator, the normalised innovation squared of a structure's latest block, and its limit.

    The innovation is the block's vector less what was expected of it, h - J m, its covariance J + J (P + b b') J: m and
    P are the expectation with what all blocks before this one taught, b is the bias that gusts are expected to have
    caused. Its square over its degrees of freedom is 1 on average while the aircraft is as it was.

    Args:
        state: whose last block has the structure.
        onset_s: of the change that an alert in force is about: blocks after it teach nothing.
    """
    mode = state.blocks[-1].modes[name]
    natural = natural_size(mode.expected, mode.expected_covariance)
    ends_s = [block.end_s for block in state.blocks[:-1]]
    healthy = len(ends_s) if onset_s is None else sum(end_s <= onset_s for end_s in ends_s)
    found: dict[int, tuple[float, float]] = {}
    for estimator in (FOURIER, EKF):
        information = mode.evidence.information[estimator]
        if not np.trace(information) > 0.0:
            continue
        taught = judge.before(state, name, healthy, estimator)
        mean, covariance = (
            part[0]
            for part in posteriors(
                mode.expected[None], mode.expected_covariance[None], taught[0][None], taught[1][None]
            )
        )
        bias = bias_of(information, mode.evidence.bias[estimator])
        change = change_since(
            mean, covariance, information, mode.evidence.vector[estimator], np.outer(bias, bias), natural
        )
        power, axes = np.linalg.eigh(change.precision * (natural[:, None] * natural))
        seen = power > _RANK_TOLERANCE * power.max(initial=0.0)
        if freedom := int(np.count_nonzero(seen)):
            along = axes[:, seen].T @ (natural * change.score)
            distance = float(np.sum(along * along / power[seen]))
            found[estimator] = distance / freedom, float(chdtri(freedom, 1.0 - _CONFIDENCE)) / freedom
    return found


def block_record(
    solution: Solution,
    last: BlockView | None,
    verdict: Verdict | None,
    judge: Judge,
    state: JudgeState,
    onset_s: float | None = None,
) -> BlockRecord | None:
    """What the block that a solution has closed said; None where it has closed none.

    Args:
        last, verdict: the latest block that was compared, and what the test said after it.
        judge, state: that compared it.
        onset_s: of the change that an alert in force is about.
    """
    closed = {name: (mode, mode.block) for name, mode in solution.modes.items() if mode.block is not None}
    if not closed:
        return None
    ends_s = [block.end_s for _, block in closed.values()]
    compared = last.modes if last is not None and last.end_s in ends_s else {}
    modes: dict[str, dict[str, ModeRecord]] = {}
    for name, (mode, block) in closed.items():
        natural = mode.pair.ekf.config.prior_std
        found = innovation(judge, state, name, onset_s) if name in compared else {}
        # Where the filter's account of a block is not to be used, it is none or zeros.
        used = mode.gained is not None and mode.gained[0].any()
        gained = {
            FOURIER: block.information,
            EKF: mode.gained[0] if mode.gained is not None and used else None,
        }
        modes[name] = {
            _NAMES[estimator]: ModeRecord(
                None if matrix is None else information_bit(matrix, natural),
                *found.get(estimator, (None, None)),
            )
            for estimator, matrix in gained.items()
        }
    return BlockRecord(
        min(block.start_s for _, block in closed.values()), max(ends_s), modes,
        verdict.log_statistic if compared and verdict is not None else None,
        tuple(name for name, (mode, _) in closed.items() if mode.rough),
    )  # fmt: skip
