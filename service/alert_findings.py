"""What the answer of a diagnosis makes of an alert: cause, kind, level and words that an operator reads.

Names, sizes and units are those of the one vocabulary of causes; the monitor's own words are used where it has some.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from wingwatch.api import DiagnosisState, DiagnosisView
from wingwatch.monitor import CAUSES, AlertFinding, AlertView, CandidateView, Correction
from wingwatch.monitor.detection.redundancy.hypotheses import HYPOTHESES

__all__ = ["asked_causes", "finding_of", "refused"]

_SURFACES = ("elevator", "aileron", "rudder")


@dataclass(frozen=True, slots=True)
class _Words:
    """Of a cause: its alert's kind, the sizes from which it is a warning and critical, and what an operator reads."""

    kind: str
    levels: tuple[float, float]
    words: str
    advice: str


_ONLY_DIAGNOSED: Mapping[str, _Words] = {
    "cg_shift": _Words(
        "damage", (0.01, 0.03), "Centre of gravity is {size} aft of where it was",
        "Avoid abrupt pitch inputs and keep airspeed up; check the payload after landing.",
    ),
    "wing_damage": _Words(
        "damage", (0.03, 0.1), "{size} of the {target} wing's semi-span is lost",
        "Keep bank angles small and airspeed up; land as soon as possible.",
    ),
    "mass_inertia": _Words(
        "unexplained", (0.05, 0.2), "Mass and moments of inertia have changed by {size}, or all forces by the inverse",
        "Check whether a payload was released; inspect.",
    ),
    "sensor_scale": _Words(
        "sensor", (0.1, 0.3), "{channel} reads {size} too much",
        "Do not trust this reading, nor derivatives estimated with it.",
    ),
    "sensor_bias": _Words(
        "sensor", (0.02, 0.06), "{channel} reads {size} too much",
        "Do not trust this reading, nor derivatives estimated with it.",
    ),
    "sensor_delay": _Words(
        "sensor", (0.05, 0.15), "{channel} is {size} late",
        "Do not trust this reading, nor derivatives estimated with it.",
    ),
}  # fmt: skip
"""Causes that the monitor has no words for, or none for some channels."""


def asked_causes(alert: AlertView) -> tuple[str, ...]:
    """Causes that an alert names or holds possible."""
    names = [alert.cause, *(one.cause for one in alert.candidates)]
    return tuple(dict.fromkeys(name for name in names if name != "unknown"))


def refused(alert: AlertView, why: str) -> AlertFinding:
    """A diagnosis that has not been made."""
    return AlertFinding(alert, f"diagnosis: none, {why}")


def finding_of(alert: AlertView, view: DiagnosisView) -> AlertFinding:
    """What an ended diagnosis says about an alert.

    Args:
        alert: as its monitor had it when the diagnosis was begun.
        view: the diagnosis; its result is that of ``change_as_json``.
    """
    if view.state is not DiagnosisState.DONE or view.result is None:
        return refused(alert, view.problem or str(view.state))
    result = view.result
    outcome, explanations = result["outcome"], result["explanations"]
    since = f"since {result['onset_s']:.0f} s"
    if outcome == "decided":
        correction = _correction(alert, explanations[0], result["onset_s"])
        same = (correction.cause, correction.channel) == (alert.cause, alert.channel)
        said = _said(explanations[0])
        what = f"confirms {said}" if same else f"corrects {_called(alert.cause, alert.channel)} to {said}"
        return AlertFinding(alert, f"diagnosis: {what} {since}", correction, view.id)
    own = next((e for e in explanations if (e["cause"], _channel(e)) == (alert.cause, alert.channel)), None)
    if outcome == "nothing":
        seen = f" ({_said(own)})" if own is not None else ""
        doubted = f"does not confirm {_called(alert.cause, alert.channel)}{seen}: "
        note = f"{doubted if alert.cause != 'unknown' else ''}no change {since} that is beyond doubt"
    elif outcome == "no_known_cause":
        note = f"a change {since} that no known cause explains"
    else:
        note = _not_separable(explanations, result["separating_manoeuvre"])
    return AlertFinding(alert, f"diagnosis: {note}", None, view.id)


def _not_separable(explanations: Sequence[Mapping[str, Any]], manoeuvre: str) -> str:
    possible, so_far = [], 0.0
    total = sum(e["probability"] for e in explanations)
    for one in explanations:
        possible.append(_called(one["cause"], _channel(one)))
        so_far += one["probability"]
        if so_far >= 0.95 * total:
            break
    if len(possible) == 1:
        return f"{possible[0]} is likeliest, but not beyond doubt"
    would = f"; {manoeuvre}" if manoeuvre else "; no single manoeuvre would"
    return f"cannot distinguish {possible[0]} from {' or '.join(possible[1:])}{would}"


def _correction(alert: AlertView, one: Mapping[str, Any], onset_s: float) -> Correction:
    cause, channel, size, error = one["cause"], _channel(one), one["size"], one["size_standard_error"]
    words = _words(cause, channel)
    level = (
        "critical" if abs(size) >= words.levels[1] else "warning" if abs(size) >= words.levels[0] else "watch"
    )
    text = words.words.format(
        size=_sized(cause, size, error, one["unit"]),
        target=one["target"],
        channel=(channel or "").rsplit("_rad", 1)[0],
    )
    probability = min(one["probability"], 1.0)
    return Correction(
        words.kind, cause, level, size, error, probability, f"{text}, since about {onset_s:.0f} s. {words.advice}",
        channel, (CandidateView(cause, channel, probability),) if alert.candidates else (),
    )  # fmt: skip


def _words(cause: str, channel: str | None) -> _Words:
    for one in CAUSES:
        if one.name == cause:
            return _Words(one.kind, one.levels, one.words, one.advice)
    for known in HYPOTHESES:
        if (known.cause, known.channel) == (cause, channel):
            return _Words(known.kind, known.levels, known.words, known.advice)
    return _ONLY_DIAGNOSED[cause]


def _channel(one: Mapping[str, Any]) -> str | None:
    """The part of an explanation by its column of the flight table; None for a cause of the whole airframe."""
    cause, target = one["cause"], one["target"]
    if cause == "thrust_loss":
        return "throttle"
    if cause == "airspeed_error":
        return "airspeed_true_m_s"
    if target in _SURFACES:
        return f"{target}_rad"
    return target if cause.startswith("sensor_") else None


def _called(cause: str, channel: str | None) -> str:
    return f"{cause} of {channel}" if channel else cause


def _said(one: Mapping[str, Any]) -> str:
    """Cause, target and size."""
    target = one["target"]
    what = f"{one['cause']} of {target}" if target else one["cause"]
    if one["size_standard_error"] == 0.0:
        return what
    return f"{what} {_sized(one['cause'], one['size'], one['size_standard_error'], one['unit'])}"


_SCALES = ("icing",)
"""Causes whose size has a scale of its own; other sizes without a unit are parts of a whole."""


def _sized(cause: str, size: float, error: float, unit: str) -> str:
    if unit:
        digits = 3 if abs(size) < 0.1 else 2
        return f"{size:.{digits}f} ± {max(error, 10.0**-digits):.{digits}f} {unit}"
    if cause in _SCALES:
        return f"{size:.2f} ± {max(error, 0.01):.2f}"
    return f"{100.0 * size:.0f} ± {max(100.0 * error, 1.0):.0f} %"
