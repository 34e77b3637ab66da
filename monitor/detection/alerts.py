"""Alert life: from verdicts to an alert that is raised, followed, and cleared when the change is gone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingwatch.aircraft import FlightCondition
from wingwatch.monitor.detection.causes import CAUSES, UNEXPLAINED, Cause
from wingwatch.monitor.detection.judge import Judge, largest_change
from wingwatch.monitor.detection.judge_state import JudgeState, Verdict
from wingwatch.monitor.views import AlertAction, AlertState, AlertView, EvidenceView, repeats_in

__all__ = ["CLEAR_BLOCKS", "AlertBook", "BookState", "act", "raised_again", "under_name"]

CLEAR_BLOCKS = 4
"""Informative blocks without the change after which an alert is cleared."""


@dataclass(frozen=True, slots=True)
class BookState:
    """What a book remembers, as in ``AlertBook``."""

    active: AlertView | None
    onset_s: float | None
    waited: int
    doubts: int


@dataclass(slots=True)
class AlertBook:
    """Alerts of one vehicle; at most one is in force at a time.

    Attributes:
        new_id: makes ids.
        active: the alert in force, or None; onset_s: where its change began.
        waited: informative blocks since the statistic first passed its threshold.
        doubts: blocks in a row for which another cause was much likelier.
    """

    fleet: str
    vehicle: str
    new_id: Callable[[], str]
    active: AlertView | None = None
    onset_s: float | None = None
    waited: int = 0
    doubts: int = 0

    @property
    def state(self) -> BookState:
        """What must be kept to go on later as if there had been no interruption."""
        return BookState(self.active, self.onset_s, self.waited, self.doubts)

    def restore(self, state: BookState) -> None:
        """Go on from where another book of this vehicle stopped."""
        self.active, self.onset_s, self.waited, self.doubts = (
            state.active,
            state.onset_s,
            state.waited,
            state.doubts,
        )

    def follow(
        self, judge: Judge, state: JudgeState, verdict: Verdict | None, condition: FlightCondition, time_s: float,
        basis: str,
    ) -> AlertView | None:  # fmt: skip
        """Take in a verdict; returns the alert if it was raised, changed or cleared.

        The blocks of one that was cleared are the caller's to forget (``Judge.forget_change``).
        """
        if verdict is None:
            return None
        if self.active is not None:
            return self._carry_on(judge, state, verdict, condition, time_s)
        if verdict.log_statistic < judge.config.log_threshold:
            self.waited = 0
            return None
        self.waited += state.blocks[-1].informative
        clear = verdict.cause is not UNEXPLAINED and verdict.probability >= judge.config.cause_probability
        if not verdict.confirmed or not (clear or self.waited >= judge.config.patience_blocks):
            return None
        return self._raise(judge, verdict, condition, time_s, basis, clear)

    def dismiss(self) -> None:
        """Someone has cleared the alert in force; a change that persists will be raised again."""
        self.active, self.onset_s, self.waited, self.doubts = None, None, 0, 0

    def note_set_back(self) -> None:
        """The vehicle's clock was set back: by its stamps no block is before the onset."""
        if self.onset_s is not None:
            self.onset_s = float("-inf")

    def rename(self, name: str, alert: AlertView) -> None:
        """The alert of that id goes on as another one that it has opened again."""
        if self.active is not None and self.active.id == name:
            self.active = under_name(self.active, alert)

    def take_over(self, alert: AlertView) -> None:
        """The alert in force gets the state, notes and shelving of another version of it.

        Its size and evidence stay: they are as of the last block, and the version that is announced may be older.
        """
        if self.active is not None:
            self.active = replace(self.active, state=alert.state, note=alert.note, shelving=alert.shelving)

    def _raise(
        self, judge: Judge, verdict: Verdict, condition: FlightCondition, time_s: float, basis: str, clear: bool
    ) -> AlertView:  # fmt: skip
        cause = verdict.cause
        if not clear:
            cause = UNEXPLAINED
            size, error = largest_change(verdict.changes)
            verdict = replace(verdict, size=size, size_standard_error=error, probability=verdict.unexplained)
        self.onset_s = verdict.onset_s
        self.active = AlertView(
            id=self.new_id(), fleet=self.fleet, vehicle=self.vehicle, kind=cause.kind, cause=cause.name,
            level=cause.level(verdict.size), state=AlertState.ACTIVE, raised_s=time_s, cleared_s=None,
            size=verdict.size, size_standard_error=verdict.size_standard_error, probability=verdict.probability,
            basis=basis, text=_text(cause, verdict, verdict.onset_s), evidence=_evidence(judge, verdict, condition),
        )  # fmt: skip
        return self.active

    def _carry_on(
        self, judge: Judge, state: JudgeState, verdict: Verdict, condition: FlightCondition, time_s: float
    ) -> AlertView | None:
        alert = self.active
        if alert is None or self.onset_s is None:
            return None
        if self._gone(judge, state, condition):
            self.dismiss()
            return replace(alert, state=AlertState.CLEARED, cleared_s=time_s)
        if verdict.log_statistic < judge.config.log_threshold or verdict.onset_s < self.onset_s - 60.0:
            return None
        other = verdict.cause.name != alert.cause
        self.doubts = self.doubts + 1 if other and verdict.probability > 0.99 else 0
        if other and self.doubts < 2:
            return None
        cause, self.doubts = verdict.cause, 0
        note = (*alert.note, f"wingwatch: cause {alert.cause} became {cause.name}") if other else alert.note
        self.active = replace(
            alert, kind=cause.kind, cause=cause.name, level=cause.level(verdict.size), size=verdict.size,
            size_standard_error=verdict.size_standard_error, probability=verdict.probability, note=note,
            text=_text(cause, verdict, min(self.onset_s, verdict.onset_s)),
            evidence=_evidence(judge, verdict, condition),
        )  # fmt: skip
        moved = abs(verdict.size - alert.size) > alert.size_standard_error
        return self.active if other or moved or self.active.level != alert.level else None

    def _gone(self, judge: Judge, state: JudgeState, condition: FlightCondition) -> bool:
        """Whether the latest informative blocks agree with the time before the onset."""
        alert = self.active
        if alert is None or self.onset_s is None:
            return False
        cause = next((c for c in (*CAUSES, UNEXPLAINED) if c.name == alert.cause), UNEXPLAINED)
        recent = judge.recent(state, cause, self.onset_s, CLEAR_BLOCKS, condition)
        if recent is None:
            return False
        log_factor, size, error = recent
        return log_factor < 0.0 and size + 2.0 * error < 0.5 * max(alert.size, 1e-9)


def act(alert: AlertView, action: AlertAction, who: str, note: str) -> AlertView:
    """The alert after a person's action.

    Raises:
        ValueError: the action makes no sense in the alert's state, in one sentence.
    """
    after: Mapping[AlertAction, tuple[Sequence[AlertState], AlertState]] = {
        AlertAction.ACKNOWLEDGE: ((AlertState.ACTIVE,), AlertState.ACKNOWLEDGED),
        AlertAction.SHELVE: ((AlertState.ACTIVE, AlertState.ACKNOWLEDGED), AlertState.SHELVED),
        AlertAction.UNSHELVE: ((AlertState.SHELVED,), AlertState.ACTIVE),
        AlertAction.CLEAR: (
            (AlertState.ACTIVE, AlertState.ACKNOWLEDGED, AlertState.SHELVED),
            AlertState.CLEARED,
        ),
    }
    allowed, state = after[action]
    if alert.state not in allowed:
        raise ValueError(
            f"alert {alert.id} is {alert.state}; {action} applies to alerts that are {' or '.join(allowed)}"
        )
    said = f"{who}: {action}" + (f" ({note})" if note else "")
    return replace(alert, state=state, note=(*alert.note, said))


def raised_again(note: Sequence[str]) -> tuple[str, ...]:
    """The notes of an alert that comes back: how often is said once, newest last where others came between."""
    kept = note[:-1] if note and repeats_in(note[-1:]) else note
    return (*kept, f"wingwatch: raised again ({repeats_in(note) + 1})")


def under_name(mine: AlertView, alert: AlertView) -> AlertView:
    """A version by a book as the version of an alert that it has opened again."""
    note = (*alert.note, *mine.note)
    return replace(mine, id=alert.id, state=alert.state, note=note, shelving=alert.shelving)


def _size(cause: Cause, size: float, error: float) -> str:
    if cause.name == "icing":
        return f"{size:.2f} ± {error:.2f}"
    return f"{100.0 * size:.0f} ± {100.0 * error:.0f} %"


def _text(cause: Cause, verdict: Verdict, onset_s: float) -> str:
    """``onset_s``: the earliest so far; the best single onset of a change that grows moves on with it."""
    what = cause.words.format(size=_size(cause, verdict.size, verdict.size_standard_error))
    return f"{what}, since about {onset_s:.0f} s. {cause.advice}"


def _evidence(judge: Judge, verdict: Verdict, condition: FlightCondition) -> tuple[EvidenceView, ...]:
    """Every derivative of the structures that changed, most significant first."""
    rows: list[EvidenceView] = []
    for name, change in verdict.changes.items():
        coordinates = judge.coordinates[name]
        scale, offset, *_ = coordinates.at(condition)
        spread = np.diagonal(change.precision)
        seen = spread > 0.0
        natural = np.maximum(np.abs(change.mean), np.sqrt(np.diagonal(change.covariance)))
        wide = np.diag((3.0 * natural) ** -2)
        after = np.linalg.inv(change.information + wide)
        value = after @ (change.vector + wide @ change.mean)
        before = np.sqrt(np.diagonal(change.covariance))
        error = np.sqrt(np.diagonal(after))
        z = (value - change.mean) / np.hypot(before, error)
        for k, symbol in enumerate(coordinates.structure.derivatives):
            if not seen[k]:
                continue
            evidence = EvidenceView(
                symbol,
                float(scale[k] * value[k] + offset[k]),
                float(abs(scale[k]) * error[k]),
                float(scale[k] * change.mean[k] + offset[k]),
                float(abs(scale[k]) * before[k]),
                float(z[k] * np.sign(scale[k])),
            )
            rows.append(evidence)
    return tuple(sorted(rows, key=lambda row: -abs(row.z)))
