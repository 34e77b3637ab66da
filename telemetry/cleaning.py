"""Cleaning: which samples an estimator may see. Bad ones are rejected and counted, never repaired or sorted.

The cleaner is causal and its answer does not depend on how the stream is cut into blocks: the same code runs
over a log and behind a subscriber. Rows leave with their own time stamps; a reader downstream starts anew
where a step between stamps is not positive or is longer than the gap.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.flight import REQUIRED_CHANNELS
from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNEL_NAMES, CHANNELS, MAX_GAP_S, SampleBlock

__all__ = ["CleanResult", "Cleaner", "CleanerConfig", "CleanerState", "CleaningReport"]

SAME_TIME_S = 1e-6
"""Stamps this close are one: clocks resolve no less, and what is divided by a shorter step is noise or infinite."""

_REJECTIONS = ("non_finite", "out_of_range", "duplicate", "out_of_order", "clock_jump")
_EVENTS = ("gap", "clock_change")
_LOW = np.array([channel.low for channel in CHANNELS])
_HIGH = np.array([channel.high for channel in CHANNELS])
_WORDS: Mapping[str, str] = {
    "non_finite": "without a finite value",
    "out_of_range": "out of range",
    "duplicate": "duplicate",
    "out_of_order": "out of order",
    "clock_jump": "on a clock that did not last",
    "gap": "gaps",
    "clock_change": "clock changes",
}


@dataclass(frozen=True, slots=True)
class CleanerConfig:
    """Limits of the cleaner.

    Attributes:
        max_gap_s: a longer step forward is counted as a gap.
        clock_jump_s: a step back at least this long is a jump of the clock, a shorter one is out of order.
        forward_jump_s: a longer step forward is a jump of the clock.
        agreement_s: a sample after a jump agrees with the one before it if it follows within this time.
        confirmations: samples in a row that must agree on a new clock before it is believed.
        required: channels without whose finite value a sample is rejected.
    """

    max_gap_s: float = MAX_GAP_S
    clock_jump_s: float = 1.0
    forward_jump_s: float = 3600.0
    agreement_s: float = 5.0
    confirmations: int = 3
    required: tuple[str, ...] = REQUIRED_CHANNELS

    def __post_init__(self) -> None:
        if unknown := [name for name in self.required if name not in CHANNEL_INDEX]:
            raise ValueError(f"required channel {unknown[0]!r} is no flight-table channel")
        if not 0.0 < self.max_gap_s < self.forward_jump_s:
            raise ValueError(f"max_gap_s = {self.max_gap_s} must lie between 0 and forward_jump_s")
        if self.confirmations < 1 or self.clock_jump_s <= 0.0 or self.agreement_s <= 0.0:
            raise ValueError("confirmations, clock_jump_s and agreement_s must be positive")


@dataclass(frozen=True, slots=True)
class CleaningReport:
    """What cleaning did to a window of samples.

    Attributes:
        accepted: rows passed on.
        rejected: rows refused, by reason: ``non_finite``, ``out_of_range``, ``duplicate``, ``out_of_order``,
            ``clock_jump`` (on a clock that did not last).
        events: ``gap`` (a step longer than allowed between accepted rows) and ``clock_change`` (a new clock
            that was believed).
        by_channel: rows refused as non-finite or out of range, by channel at fault (a row can have several).
        pending: rows held back now until their clock is believed or not.
    """

    accepted: int = 0
    rejected: Mapping[str, int] = field(default_factory=dict)
    events: Mapping[str, int] = field(default_factory=dict)
    by_channel: Mapping[str, int] = field(default_factory=dict)
    pending: int = 0

    def __add__(self, later: "CleaningReport") -> "CleaningReport":
        """Both windows together; what is pending is the later one's."""
        return CleaningReport(
            self.accepted + later.accepted,
            _sum(self.rejected, later.rejected),
            _sum(self.events, later.events),
            _sum(self.by_channel, later.by_channel),
            later.pending,
        )

    @property
    def counts(self) -> dict[str, int]:
        """Accepted rows, rejected rows by reason and events, in one mapping without zeros."""
        return {"accepted": self.accepted, **self.rejected, **self.events}

    @property
    def text(self) -> str:
        """One line for a person."""
        parts = [f"{self.accepted} samples accepted"]
        parts += [f"{self.rejected[name]} {_WORDS[name]}" for name in _REJECTIONS if name in self.rejected]
        if self.by_channel:
            worst = sorted(self.by_channel.items(), key=lambda item: (-item[1], item[0]))[:4]
            parts.append(f"at fault: {', '.join(f'{name} {count}' for name, count in worst)}")
        parts += [f"{self.events[name]} {_WORDS[name]}" for name in _EVENTS if name in self.events]
        return "; ".join(parts)


def _sum(one: Mapping[str, int], other: Mapping[str, int]) -> Mapping[str, int]:
    return {**one, **{name: one.get(name, 0) + times for name, times in other.items()}} if other else one


@dataclass(frozen=True, slots=True)
class CleanResult:
    """Accepted rows of a block (and rows held back before it), and what happened to the rest."""

    block: SampleBlock
    report: CleaningReport


@dataclass(frozen=True, slots=True)
class CleanerState:
    """Everything a cleaner remembers between blocks.

    Attributes:
        last_time_s: stamp of the last accepted row, None before the first.
        held: rows on a new clock that is not believed yet, shape (rows, channels).
    """

    last_time_s: float | None
    held: NDArray[np.float64]

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; ``from_dict`` gives the same state to the bit."""
        held = [[None if np.isnan(value) else float(value) for value in row] for row in self.held]
        return {"last_time_s": self.last_time_s, "channels": list(CHANNEL_NAMES), "held": held}

    @classmethod
    def from_dict(cls, saved: Mapping[str, Any]) -> "CleanerState":
        """The state that ``to_dict`` saved.

        Raises:
            ValueError: it was saved with other channels.
        """
        if tuple(saved["channels"]) != CHANNEL_NAMES:
            raise ValueError("the saved cleaner has other channels than this version: start it anew")
        held = np.array(saved["held"], dtype=np.float64).reshape(-1, len(CHANNELS))
        return cls(saved["last_time_s"], held)


class Cleaner:
    """Cleans one vehicle's stream, block by block.

    Args:
        config: limits.
        state: where an earlier cleaner stopped, None for a new stream.
        report: what it had done by then.
    """

    def __init__(
        self,
        config: CleanerConfig | None = None,
        state: CleanerState | None = None,
        report: CleaningReport | None = None,
    ) -> None:
        self._config = CleanerConfig() if config is None else config
        self._state = CleanerState(None, np.empty((0, len(CHANNELS)))) if state is None else state
        self._required = np.array([CHANNEL_INDEX[name] for name in self._config.required])
        self._report = CleaningReport(pending=len(self._state.held)) if report is None else report

    @property
    def state(self) -> CleanerState:
        """What must be kept to go on later as if there had been no interruption."""
        return self._state

    @property
    def report(self) -> CleaningReport:
        """All blocks of this cleaner together."""
        return self._report

    def clean(self, block: SampleBlock) -> CleanResult:
        """The rows of the stream that are decided by now, and the counts of this block."""
        sound, rejected, by_channel = self._sound_rows(block.values)
        steps = self._steps(sound[:, 0])
        if (
            not len(self._state.held)
            and ((steps > SAME_TIME_S) & (steps <= self._config.forward_jump_s)).all()
        ):
            result = self._accept_all(sound, steps, rejected, by_channel)
        else:
            result = self._sort_out(sound, rejected, by_channel)
        self._report = self._report + result.report
        return result

    def _sound_rows(
        self, values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], dict[str, int], dict[str, int]]:
        """Rows whose own values are possible; the others counted by reason and by channel."""
        inside = (values >= _LOW) & (values <= _HIGH)
        if inside.take(self._required, axis=1).all() and (inside | np.isnan(values)).all():
            return values, {}, {}
        missing = ~np.isfinite(values[:, self._required])
        outside = (values < _LOW) | (values > _HIGH)
        outside |= np.isinf(values)
        outside[:, self._required] &= ~missing
        without, beyond = np.logical_or.reduce(missing, axis=1), np.logical_or.reduce(outside, axis=1)
        faults = outside & ~without[:, None]
        faults[:, self._required] |= missing
        per_channel = faults.sum(axis=0)
        by_channel = {CHANNEL_NAMES[i]: int(per_channel[i]) for i in np.flatnonzero(per_channel)}
        rejected = {"non_finite": int(without.sum()), "out_of_range": int((beyond & ~without).sum())}
        return values[~(without | beyond)], {k: n for k, n in rejected.items() if n}, by_channel

    def _steps(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Steps between stamps, the first one from the last accepted row if there is one."""
        last = self._state.last_time_s
        if last is None or not time_s.size:
            return time_s[1:] - time_s[:-1]
        steps = np.empty(time_s.size)
        steps[0] = time_s[0] - last
        np.subtract(time_s[1:], time_s[:-1], out=steps[1:])
        return steps

    def _accept_all(
        self,
        rows: NDArray[np.float64],
        steps: NDArray[np.float64],
        rejected: dict[str, int],
        by_channel: dict[str, int],
    ) -> CleanResult:
        gaps = int(np.count_nonzero(steps > self._config.max_gap_s))
        if len(rows):
            self._state = CleanerState(float(rows[-1, 0]), self._state.held)
        events = {"gap": gaps} if gaps else {}
        return CleanResult(SampleBlock(rows.copy()), CleaningReport(len(rows), rejected, events, by_channel))

    def _sort_out(
        self, sound: NDArray[np.float64], rejected: dict[str, int], by_channel: dict[str, int]
    ) -> CleanResult:
        """The slow path: row by row through the clock's rules, rows held back before coming first."""
        rows = np.concatenate([self._state.held, sound])
        first_new = len(self._state.held)
        clock = _Clock(self._config, self._state.last_time_s, rows[:, 0].tolist(), list(range(first_new)))
        for i in range(first_new, len(rows)):
            clock.take(i)
        self._state = CleanerState(clock.last_time_s, rows[clock.held].copy())
        report = CleaningReport(
            len(clock.accepted),
            _sum(rejected, {name: clock.counts[name] for name in _REJECTIONS if name in clock.counts}),
            {name: clock.counts[name] for name in _EVENTS if name in clock.counts},
            by_channel,
            len(clock.held),
        )
        return CleanResult(SampleBlock(rows[clock.accepted]), report)


class _Clock:
    """The rules on time stamps, one row after another."""

    def __init__(
        self, config: CleanerConfig, last_time_s: float | None, time_s: Sequence[float], held: list[int]
    ) -> None:
        self.last_time_s = last_time_s
        self.held = held
        self.accepted: list[int] = []
        self.counts: dict[str, int] = {}
        self._config = config
        self._time_s = time_s

    def take(self, row: int) -> None:
        """Accept the row, reject it, or hold it back."""
        limits = self._config
        step = self._step_from(self.last_time_s, row)
        if step is None or SAME_TIME_S < step <= limits.forward_jump_s:
            self._reject_held()
            self._accept(row, step is not None and step > limits.max_gap_s)
            return
        held_step = self._step_from(self._time_s[self.held[-1]], row) if self.held else None
        if held_step is not None and SAME_TIME_S < held_step <= limits.agreement_s:
            self.held.append(row)
            self._believe_if_confirmed()
        elif _same(step) or _same(held_step):
            self._count("duplicate")
        elif _slightly_back(step, limits) or (held_step is not None and _slightly_back(held_step, limits)):
            self._count("out_of_order")
        else:
            self._reject_held()
            self.held.append(row)
            self._believe_if_confirmed()

    def _step_from(self, earlier_s: float | None, row: int) -> float | None:
        return None if earlier_s is None else self._time_s[row] - earlier_s

    def _accept(self, row: int, after_gap: bool) -> None:
        if after_gap:
            self._count("gap")
        self.accepted.append(row)
        self.last_time_s = self._time_s[row]

    def _believe_if_confirmed(self) -> None:
        if len(self.held) < self._config.confirmations:
            return
        self._count("clock_change")
        for i, row in enumerate(self.held):
            step = 0.0 if i == 0 else self._time_s[row] - self._time_s[self.held[i - 1]]
            self._accept(row, step > self._config.max_gap_s)
        self.held = []

    def _reject_held(self) -> None:
        if self.held:
            self._count("clock_jump", len(self.held))
            self.held = []

    def _count(self, name: str, times: int = 1) -> None:
        self.counts[name] = self.counts.get(name, 0) + times


def _same(step: float | None) -> bool:
    return step is not None and abs(step) <= SAME_TIME_S


def _slightly_back(step: float, limits: CleanerConfig) -> bool:
    return -limits.clock_jump_s < step < 0.0
