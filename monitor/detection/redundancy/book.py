"""Alerts by analytical redundancy: several at a time, one a cause and part."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wingwatch.monitor.detection.alerts import under_name
from wingwatch.monitor.detection.causes import CAUSES
from wingwatch.monitor.detection.redundancy.hypotheses import Hypothesis
from wingwatch.monitor.detection.redundancy.sequential import Finding, Ranked
from wingwatch.monitor.detection.redundancy.watch import (
    LOG_THRESHOLD,
    KnownFault,
    RedundancyState,
    RedundancyWatch,
    Second,
)
from wingwatch.monitor.views import LEVELS, AlertState, AlertView, CandidateView

__all__ = ["RedundancyBook", "RedundancyBookState"]

CLEAR = 0.9
"""Probability from which a cause is named at once."""
PATIENCE_S = 3.0
"""So long is waited for one; then the alert says what is possible."""
CORRECTED = 0.99
"""Probability from which another name takes the place of the first."""
ENDED = 1e5
"""Odds from which a fault is gone: it ends more often than one begins."""
_STATES_FROM = {
    "airspeed_true_m_s": "wqvpr", "roll_rad": "wqvpr", "pitch_rad": "wqvpr", "specific_force_x_m_s2": "wqvpr",
    "angle_of_attack_rad": "wq", "pitch_rate_rad_s": "wqvpr", "specific_force_z_m_s2": "wq",
    "sideslip_rad": "vpr", "roll_rate_rad_s": "vpr", "yaw_rate_rad_s": "vpr", "specific_force_y_m_s2": "vpr",
}  # fmt: skip
"""States of the modes whose derivatives a channel at fault makes wrong."""
_OF_DERIVATIVES = frozenset(c.name for c in CAUSES) | {"unknown"}
"""Causes that derivatives can tell from one another."""
MOVED = 2.0
"""Standard errors by which a size has moved where the alert states it anew."""
SETTLES_S = 6.0
"""So long the size is followed; then the name is looked at once more."""
LEAST_CANDIDATE = 0.02
_MOST_CANDIDATES = 5


@dataclass(slots=True)
class RedundancyBookState:
    """What a book remembers.

    Attributes:
        active: alerts in force, in the order of the state's ``faults``.
        crossed_s: stamp at which the statistic passed its threshold without a clear cause; NaN where it has not.
    """

    active: list[AlertView] = field(default_factory=list)
    crossed_s: float = float("nan")


class RedundancyBook:
    """Alerts of one vehicle.

    Args:
        new_id: makes ids.
        watch: of its type.
    """

    def __init__(self, fleet: str, vehicle: str, new_id: Callable[[], str], watch: RedundancyWatch) -> None:
        self._fleet, self._vehicle, self._new_id, self._watch = fleet, vehicle, new_id, watch
        self.state = RedundancyBookState()

    @property
    def active(self) -> Sequence[AlertView]:
        """Alerts in force, worst first."""
        return sorted(self.state.active, key=lambda a: (-LEVELS.index(a.level), a.raised_s))

    def doubts(self, states: Collection[str]) -> bool:
        """Whether a sensor is at fault that derivatives of a structure with these states are estimated from."""
        return any(
            alert.kind == "sensor" and set(states) & set(_STATES_FROM.get(alert.channel or "", ""))
            for alert in self.state.active
        )

    def follow(self, state: RedundancyState, second: Second, airframe_alarmed: bool) -> list[AlertView]:
        """What a second leads to: alerts that were raised, changed or cleared.

        Args:
            state: of the watch; faults that alerts are in force for are entered and taken out.
            second: of the watch.
            airframe_alarmed: an alert about the airframe is in force, so that a changed drag needs no name.
        """
        versions = self._follow_known(state, second)
        if second.finding is not None:
            versions += self._look(state, second, second.finding, airframe_alarmed)
        return versions

    def dismiss(self, state: RedundancyState, alert_id: str, now_s: float) -> None:
        """Someone has cleared an alert in force; its relations learn what is now."""
        for k, alert in enumerate(self.state.active):
            if alert.id == alert_id:
                fault = state.faults.pop(k)
                self.state.active.pop(k)
                self._watch.learn_after(state, fault, now_s)
                return

    def explained(self, state: RedundancyState, by: AlertView, now_s: float) -> list[AlertView]:
        """An alert about the airframe explains a changed drag: the alert of that is cleared."""
        versions = []
        for k in reversed(range(len(state.faults))):
            if state.faults[k].cause == "drag":
                cleared = self._cleared(state, k, now_s)
                versions.append(
                    replace(cleared, note=(*cleared.note, f"wingwatch: explained by {by.cause} ({by.id})"))
                )
        return versions

    def confirm(self, state: RedundancyState, by: AlertView, now_s: float) -> AlertView | None:
        """The alert about the airframe in force as derivatives confirm it; None where that is no news.

        Their cause and size count, for they rest on more of the flight, where they know the cause of the alert.
        Relations that have begun to learn the fault learn it as it is now known.
        """
        for k, mine in enumerate(self.state.active):
            if mine.channel is not None:
                continue
            counts = by.cause == mine.cause or (by.cause != "unknown" and mine.cause in _OF_DERIVATIVES)
            shown, renamed = (by, by.cause != mine.cause) if counts else (mine, False)
            note = (*mine.note, f"wingwatch: {mine.cause} became {by.cause}") if renamed else mine.note
            self.state.active[k] = replace(
                shown, id=mine.id, raised_s=mine.raised_s, state=mine.state, shelving=mine.shelving, note=note,
                evidence=by.evidence,
            )  # fmt: skip
            own = [h for h in self._watch.hypotheses if h.is_of_airframe and h.cause == shown.cause]
            fault = state.faults[k]
            if renamed and own:
                fault.becomes(own[0], shown.size)
            fault.size = shown.size
            news = renamed or abs(shown.size - mine.size) > shown.size_standard_error
            if news and fault.settled:
                self._watch.settle(state, fault, now_s)
            return self.state.active[k] if news or not mine.evidence else None
        return None

    @property
    def airframe_alarmed(self) -> bool:
        """Whether an alert about the airframe is in force."""
        return any(a.channel is None for a in self.state.active)

    def take_over(self, alert: AlertView) -> None:
        """An alert in force gets the state, notes and shelving of another version of it."""
        for k, mine in enumerate(self.state.active):
            if mine.id == alert.id:
                self.state.active[k] = replace(
                    mine, state=alert.state, note=alert.note, shelving=alert.shelving
                )

    def rename(self, name: str, alert: AlertView) -> None:
        """The alert of that id goes on as another one that it has opened again."""
        self.state.active[:] = [
            under_name(one, alert) if one.id == name else one for one in self.state.active
        ]

    def restore(self, state: RedundancyBookState) -> None:
        """Go on from where another book of this vehicle stopped."""
        self.state = state

    def reinstate(self, state: RedundancyState, alert: AlertView) -> None:
        """An alert of an earlier run is in force again."""
        if alert.channel is None or any(a.id == alert.id for a in self.state.active):
            return
        cause = _hidden(alert.cause, alert.channel)
        fault = KnownFault(cause, alert.channel, alert.size, alert.raised_s, settled=True)
        own = [h.repeated for h in self._watch.hypotheses if fault.is_of(h) and h.repeated is not None]
        fault.repeated = own[0] if own else None
        self.state.active.append(alert)
        state.faults.append(fault)

    def _follow_known(self, state: RedundancyState, second: Second) -> list[AlertView]:
        versions: list[AlertView] = []
        for k in reversed(range(len(self.state.active))):
            fault, alert = state.faults[k], self.state.active[k]
            if fault.repeated is not None:
                if not self._watch.repeats(state, fault.repeated):
                    versions.append(self._cleared(state, k, second.time_s))
                continue
            if fault.settled:
                continue
            if second.followed is not None and (
                changed := self._corrected(fault, alert, second, second.followed)
            ):
                self.state.active[k] = changed
                versions.append(changed)
            if second.time_s - alert.raised_s >= SETTLES_S:
                self._watch.settle(state, fault, second.time_s)
        return versions

    def _corrected(
        self, fault: KnownFault, alert: AlertView, second: Second, followed: Finding
    ) -> AlertView | None:
        """The alert with another name or size, where the evidence since its onset says so; None where it does not."""
        if followed.log_statistic < LOG_THRESHOLD:
            return None
        named = [k for k, r in enumerate(followed.ranked) if r.hypothesis.cause != "unknown"]
        if not named:
            return None
        best = followed.ranked[named[0]]
        probability = followed.probabilities[named[0]] / sum(followed.probabilities[k] for k in named)
        same = fault.is_of(best.hypothesis)
        settling = second.time_s - alert.raised_s >= SETTLES_S
        if probability < CORRECTED or not (same or settling):
            return None
        moved = abs(best.size - fault.size) > MOVED * max(best.standard_error, alert.size_standard_error)
        if same and not moved and not alert.candidates:
            return None
        fault.becomes(best.hypothesis, best.size)
        shown = self._alert(best, second, followed, True, alert.id)
        was, now = (f"{a.cause} of {a.channel}" if a.channel else a.cause for a in (alert, shown))
        note = alert.note if same or was == now else (*alert.note, f"wingwatch: {was} became {now}")
        return replace(
            shown, raised_s=alert.raised_s, state=alert.state, note=note, shelving=alert.shelving,
            probability=probability, candidates=(),
        )  # fmt: skip

    def _look(
        self, state: RedundancyState, second: Second, finding: Finding, airframe_alarmed: bool
    ) -> list[AlertView]:
        versions = self._ended(state, second, finding)
        if versions or finding.log_statistic < LOG_THRESHOLD:
            self.state.crossed_s = float("nan")
            return versions
        best, probability = finding.ranked[0], finding.probabilities[0]
        if best.hypothesis.cause == "recovered":
            return []
        known = next((k for k, f in enumerate(state.faults) if f.is_of(best.hypothesis)), None)
        if known is not None:
            return self._grown(state, known, best, second)
        if (airframe_alarmed or self.state.active) and best.hypothesis.kind == "unexplained":
            return []
        if airframe_alarmed and (best.hypothesis.is_of_airframe or _is_like_drag(best.hypothesis)):
            return []
        late = best.hypothesis.late
        clear = probability >= (CORRECTED if late else CLEAR) and best.hypothesis.cause != "unknown"
        if late or not clear:
            if np.isnan(self.state.crossed_s):
                self.state.crossed_s = second.time_s
            if second.time_s - self.state.crossed_s < PATIENCE_S:
                return []
        self.state.crossed_s = float("nan")
        alert, h = self._alert(best, second, finding, clear, self._new_id()), best.hypothesis
        self.state.active.append(alert)
        state.faults.append(
            KnownFault(
                h.cause, h.channel, best.size, second.onsets_s[best.onset], repeated=h.repeated, part=h.part
            )
        )
        return [alert]

    def _ended(self, state: RedundancyState, second: Second, finding: Finding) -> list[AlertView]:
        """Alerts of faults that are gone by odds of ``ENDED``."""
        versions = []
        for r in finding.ranked:
            if r.hypothesis.cause == "recovered" and r.log_factor >= np.log(ENDED):
                gone = next(
                    (k for k, f in enumerate(state.faults) if (f.channel, f.part) == r.hypothesis.key[1:]),
                    None,
                )
                if gone is not None:
                    versions.append(self._cleared(state, gone, second.time_s))
        return versions

    def _grown(self, state: RedundancyState, k: int, more: Ranked, second: Second) -> list[AlertView]:
        """A fault that has settled has changed by a size."""
        fault, alert = state.faults[k], self.state.active[k]
        fault.size += more.size
        if abs(fault.size) < 2.0 * more.standard_error:
            return [self._cleared(state, k, second.time_s)]
        fault.settled = False
        self.state.active[k] = replace(
            alert, size=fault.size, size_standard_error=more.standard_error, level=more.hypothesis.level(fault.size),
            text=_text(more.hypothesis, fault.size, more.standard_error, fault.onset_s),
        )  # fmt: skip
        return [self.state.active[k]]

    def _cleared(self, state: RedundancyState, k: int, now_s: float) -> AlertView:
        alert, fault = self.state.active.pop(k), state.faults.pop(k)
        self._watch.learn_after(state, fault, now_s)
        return replace(alert, state=AlertState.CLEARED, cleared_s=now_s)

    def _alert(self, best: Ranked, second: Second, finding: Finding, clear: bool, alert_id: str) -> AlertView:
        h, onset_s = best.hypothesis, second.onsets_s[best.onset]
        candidates = _candidates(finding)
        cause, kind = ("unknown", "unexplained") if h.cause == "drag" or not clear else (h.cause, h.kind)
        text = _text(h, best.size, best.standard_error, onset_s)
        if not clear and h.cause != "unknown":
            which = [r for r in finding.ranked[:2] if r.hypothesis.cause != "unknown"]
            names = ", or ".join(_named(r.hypothesis, r.size, r.standard_error) for r in which)
            text = f"{names}, since about {onset_s:.0f} s: not distinguished yet. Inspect."
        return AlertView(
            id=alert_id, fleet=self._fleet, vehicle=self._vehicle, kind=kind, cause=cause,
            level=h.level(best.size), state=AlertState.ACTIVE, raised_s=second.time_s, cleared_s=None, size=best.size,
            size_standard_error=best.standard_error, probability=finding.probabilities[0], basis="empirical",
            text=text, evidence=(), channel=h.channel or None,
            candidates=candidates if len(candidates) > 1 or h.cause == "drag" else (),
        )  # fmt: skip


def _is_like_drag(hypothesis: Hypothesis) -> bool:
    """Whether growing drag, as of ice, would be taken for it: less thrust, or an accelerometer off along x."""
    return hypothesis.cause == "thrust_loss" or hypothesis.channel == "specific_force_x_m_s2"


def _hidden(cause: str, channel: str) -> str:
    """The hypothesis behind an alert's cause."""
    return "drag" if (cause, channel) == ("unknown", "specific_force_x_m_s2") else cause


def _candidates(finding: Finding) -> tuple[CandidateView, ...]:
    found: list[CandidateView] = []
    for r, probability in zip(finding.ranked, finding.probabilities, strict=True):
        if probability < LEAST_CANDIDATE or len(found) == _MOST_CANDIDATES:
            break
        if r.hypothesis.cause == "drag":
            found.append(CandidateView("icing", None, probability / 2.0))
            found.append(CandidateView("wing_damage", None, probability / 2.0))
        else:
            found.append(CandidateView(r.hypothesis.cause, r.hypothesis.channel or None, probability))
    return tuple(found)


def _text(h: Hypothesis, size: float, error: float, onset_s: float) -> str:
    return f"{_named(h, size, error)}, since about {onset_s:.0f} s. {h.advice}"


def _named(h: Hypothesis, size: float, error: float) -> str:
    factor, unit = {
        "rad": (180.0 / np.pi, "°"),
        "rad/s": (180.0 / np.pi, "°/s"),
        "s": (1000.0, " ms"),
        "": (100.0, " %"),
        "1": (1.0, ""),
    }.get(h.unit, (1.0, f" {h.unit}"))
    number = f"{factor * size:.3g} ± {factor * error:.1g}{unit}"
    return h.words.format(size=number)
