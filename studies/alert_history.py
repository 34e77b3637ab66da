"""The alerts of one flight: what each was called since when, and how that stands beside the truth."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from wingwatch.monitor import AlertState, AlertView
from wingwatch.studies.fault_names import KINDS_OF_FAULT, kind_of, names_rightly

__all__ = ["AlertHistory", "Named", "after_onset", "keep_alert"]


@dataclass(slots=True)
class Named:
    """An alert as long as it had one name: since when, and how it stood last under it."""

    since_s: float
    view: AlertView

    @property
    def name(self) -> tuple[str, str, str | None]:
        """Kind, cause and channel."""
        return self.view.kind, self.view.cause, self.view.channel


@dataclass(slots=True)
class AlertHistory:
    """One alert: as it was raised, as it stands, and its names one after the other."""

    raised: AlertView
    last: AlertView
    names: list[Named] = field(default_factory=list)

    def take(self, version: AlertView, now_s: float) -> None:
        """Take in a version of it."""
        self.last = version
        if not self.names or self.names[-1].name != (version.kind, version.cause, version.channel):
            self.names.append(Named(now_s if self.names else version.raised_s, version))
        else:
            self.names[-1].view = version

    def rightly(self, effect: str, target: str) -> Named | None:
        """The first of its names that is the truth."""
        right = (n for n in self.names if names_rightly(effect, target, n.view.cause, n.view.channel))
        return next(right, None)

    def as_json(self) -> dict[str, Any]:
        """All of it that a row keeps."""
        return {
            "raised_s": self.raised.raised_s,
            "cleared_s": self.last.cleared_s,
            "names": [
                {
                    "since_s": n.since_s, "kind": n.view.kind, "cause": n.view.cause, "channel": n.view.channel,
                    "level": n.view.level, "probability": n.view.probability, "size": n.view.size,
                    "size_standard_error": n.view.size_standard_error, "candidates": _candidates(n.view),
                }
                for n in self.names
            ],
        }  # fmt: skip


def keep_alert(histories: dict[str, AlertHistory], version: AlertView, now_s: float) -> None:
    """Take in a version of an alert, the first of which is the alert as it was raised."""
    if version.id not in histories:
        histories[version.id] = AlertHistory(version, version)
    histories[version.id].take(version, now_s)


def _candidates(alert: AlertView) -> list[list[Any]]:
    return [[c.cause, c.channel, c.probability] for c in alert.candidates]


def after_onset(
    alerts: Iterable[AlertHistory], effect: str, target: str, onset_s: float
) -> Mapping[str, Any]:
    """Columns of a row about the alerts that were raised after an effect's onset; nothing where there is none."""
    later = sorted((a for a in alerts if a.raised.raised_s >= onset_s), key=lambda a: a.raised.raised_s)
    if not later:
        return {}
    first = later[0].raised
    # that something has changed may be said before what: the first alert that names a cause counts, if there is one
    said = next((a for a in later if a.last.kind in KINDS_OF_FAULT), later[0]).last
    stated = [(first.cause, first.channel), *((c.cause, c.channel) for c in first.candidates)]
    derivatives = [a.raised.raised_s for a in later if a.raised.channel is None]
    others = [n.since_s for a in later for n in a.names if _another_kind(n, effect)]
    return {
        "detected": True,
        "detected_s": first.raised_s,
        "delay_s": first.raised_s - onset_s,
        "derivatives_delay_s": min(derivatives, default=math.nan) - onset_s,
        "first_kind": first.kind,
        "first_cause": first.cause,
        "first_channel": first.channel or "",
        "first_right": names_rightly(effect, target, *stated[0]),
        "first_in_set": any(names_rightly(effect, target, *name) for name in stated),
        "said_kind": said.kind,
        "said_cause": said.cause,
        "said_channel": said.channel or "",
        "said_level": said.level,
        "said_probability": said.probability,
        "other_kind_delay_s": min(others, default=math.nan) - onset_s,
    } | _rightly(later, effect, target, onset_s)


def _rightly(later: Sequence[AlertHistory], effect: str, target: str, onset_s: float) -> dict[str, Any]:
    """When the effect was named rightly, whether it still is, and how large it was called."""
    right = [named for a in later if (named := a.rightly(effect, target)) is not None]
    at_end = any(
        a.last.state is not AlertState.CLEARED and names_rightly(effect, target, a.last.cause, a.last.channel)
        for a in later
    )
    if not right:
        return {"right_at_end": at_end}
    earliest = min(right, key=lambda named: named.since_s)
    return {
        "right_at_end": at_end,
        "right_delay_s": earliest.since_s - onset_s,
        "size": earliest.view.size,
        "size_standard_error": earliest.view.size_standard_error,
    }


def _another_kind(named: Named, effect: str) -> bool:
    """Whether a name is of another kind of fault than an effect; what is unexplained is of none."""
    return named.view.kind in KINDS_OF_FAULT and named.view.kind != kind_of(effect)
