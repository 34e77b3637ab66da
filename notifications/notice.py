"""A notice: one step of an alert's life, as it goes to people; and which steps a new version of an alert takes."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Self

from wingwatch.api import alert_document
from wingwatch.monitor import AlertState, AlertView

__all__ = ["ALL_STEPS", "Notice", "Said", "Step", "notice_of", "said_of", "steps_of", "trial_notice"]


class Step(StrEnum):
    """What has happened to an alert since it was last spoken of."""

    RAISED = "raised"
    LEVEL = "level"
    CAUSE = "cause"
    DIAGNOSED = "diagnosed"
    ACKNOWLEDGED = "acknowledged"
    SHELVED = "shelved"
    UNSHELVED = "unshelved"
    CLEARED = "cleared"


ALL_STEPS = tuple(Step)


@dataclass(frozen=True, slots=True)
class Said:
    """What a channel has last said, or has waiting to say, of an alert that is not cleared.

    Attributes:
        state, level, cause, channel, repeats: as in ``AlertView``.
        diagnosis: id of the newest diagnosis spoken of; empty where there was none.
        number: of notices about the alert so far.
        raised_at_s: when the channel first spoke of it, seconds since 1970-01-01 UTC.
    """

    state: str
    level: str
    cause: str
    channel: str | None
    repeats: int
    diagnosis: str
    number: int
    raised_at_s: float


@dataclass(frozen=True, slots=True)
class Notice:
    """One message to people.

    Attributes:
        key: the same for the same notice whenever it is sent, so a receiver can tell a repetition.
        steps: what has happened, at least one.
        alert: the object of ``/v1/alerts/{id}``.
        aircraft: of the vehicle, where it is known.
        raised_at_s, at_s: when the alert was first spoken of, and this step; seconds since 1970-01-01 UTC.
        was_level, was_cause: as last spoken of; empty for an alert that is new.
        test: sent by ``wingwatch notify test``: no vehicle is concerned.
    """

    key: str
    steps: tuple[Step, ...]
    alert: Mapping[str, Any]
    aircraft: str | None
    raised_at_s: float
    at_s: float
    was_level: str = ""
    was_cause: str = ""
    test: bool = False

    @classmethod
    def from_json(cls, kept: Mapping[str, Any]) -> Self:
        """From what ``orjson`` has made of one.

        Raises:
            TypeError, KeyError, ValueError: it is none.
        """
        return cls(**{**kept, "steps": tuple(Step(step) for step in kept["steps"])})


def steps_of(said: Said | None, alert: AlertView) -> tuple[Step, ...]:
    """What has happened to an alert since a channel last spoke of it; empty where nothing has that people want to hear.

    Sizes, evidence and notes change with every block and are no steps.
    """
    if said is None:
        return () if alert.state is AlertState.CLEARED else (Step.RAISED,)
    if alert.state is AlertState.CLEARED:
        return (Step.CLEARED,)
    if alert.repeats > said.repeats:
        return (Step.RAISED,)
    steps = {
        Step.LEVEL: alert.level != said.level,
        Step.CAUSE: (alert.cause, alert.channel) != (said.cause, said.channel),
        Step.DIAGNOSED: alert.diagnosis_id not in (None, said.diagnosis),  # a restart forgets it: no step
        Step.ACKNOWLEDGED: alert.state is AlertState.ACKNOWLEDGED and said.state != alert.state,
        Step.SHELVED: alert.state is AlertState.SHELVED and said.state != alert.state,
        Step.UNSHELVED: alert.state is AlertState.ACTIVE and said.state == AlertState.SHELVED,
    }
    return tuple(step for step, taken in steps.items() if taken)


def said_of(said: Said | None, alert: AlertView, at_s: float) -> Said:
    """What will have been said once a version of an alert has been spoken of.

    Args:
        said: before; None for an alert that is new to the channel.
        at_s: now, seconds since 1970-01-01 UTC.
    """
    again = said is None or alert.repeats > said.repeats
    earlier = "" if said is None else said.diagnosis
    return Said(
        str(alert.state), alert.level, alert.cause, alert.channel, alert.repeats, alert.diagnosis_id or earlier,
        1 if said is None else said.number + 1, at_s if said is None or again else said.raised_at_s,
    )  # fmt: skip


def notice_of(
    alert: AlertView, steps: tuple[Step, ...], before: Said | None, after: Said, aircraft: str | None, at_s: float
) -> Notice:  # fmt: skip
    """The notice of a version of an alert.

    Its key follows from the alert, what was said of it before and what is said now: a service that was killed before it
    could note the delivery makes the same key again.
    """
    parts = (
        alert.id,
        after.number,
        after.repeats,
        *steps,
        after.state,
        after.level,
        after.cause,
        after.channel,
    )
    key = hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()[:32]
    return Notice(
        key, steps, alert_document(alert).model_dump(mode="json"), aircraft, after.raised_at_s, at_s,
        "" if before is None else before.level, "" if before is None else before.cause,
    )  # fmt: skip


def trial_notice(at_s: float) -> Notice:
    """What ``wingwatch notify test`` sends: marked as a test, of a vehicle that does not exist.

    Args:
        at_s: now, seconds since 1970-01-01 UTC.
    """
    alert = AlertView(
        id=f"test-{at_s:.0f}", fleet="test", vehicle="test", kind="unexplained", cause="unknown", level="watch",
        state=AlertState.ACTIVE, raised_s=0.0, cleared_s=None, size=0.0, size_standard_error=0.0, probability=1.0,
        basis="", text="TEST of wingwatch. No vehicle is concerned.", evidence=(),
    )  # fmt: skip
    after = said_of(None, alert, at_s)
    return replace(notice_of(alert, (Step.RAISED,), None, after, None, at_s), test=True)
