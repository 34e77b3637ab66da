"""Notices in words: a summary, a description with intervals, and the short text of ground control stations."""

from collections.abc import Mapping
from typing import Any

from wingwatch.monitor import CAUSES
from wingwatch.monitor.detection.redundancy.hypotheses import HYPOTHESES
from wingwatch.notifications.notice import Notice, Step

__all__ = ["described", "short_text", "summary"]

_NORMAL_95 = 1.96
_MOST_EVIDENCE = 3
_MOST_NAME = 16
_DEGREES = 57.29577951308232
_SHOWN: Mapping[str, tuple[float, str]] = {
    "rad": (_DEGREES, "°"),
    "rad/s": (_DEGREES, "°/s"),
    "s": (1000.0, " ms"),
    "": (100.0, " %"),
    "1": (1.0, ""),
}
"""Of each unit of a size the factor and the unit that people read."""


def summary(notice: Notice) -> str:
    """One line: which vehicle, how bad, what has happened, what it is."""
    alert = notice.alert
    if notice.test:
        return str(alert["text"])
    return f"{alert['vehicle']} ({alert['fleet']}), {_happened(notice)}: {_what(alert)}"


def described(notice: Notice) -> str:
    """What the alert says, its size and what changed most with 95 % intervals, and the newest note."""
    alert = notice.alert
    if notice.test:
        return str(alert["text"])
    lines = [
        str(alert["text"]),
        _size(alert),
        *(_evidence(row) for row in alert["evidence"][:_MOST_EVIDENCE]),
    ]
    if notice.aircraft:
        lines.append(f"Aircraft: {notice.aircraft}.")
    if alert["notes"] and Step.RAISED not in notice.steps:
        lines.append(f"Newest note: {alert['notes'][-1]}.")
    return "\n".join(line for line in lines if line)


def short_text(notice: Notice, name: str) -> str:
    """In ASCII, what counts most first: level or step, vehicle, cause and size, then what to do.

    Args:
        name: of the vehicle as it is to be said; empty where the receiver knows it from the message's source.
    """
    alert = notice.alert
    if notice.test:
        return _ascii(alert["text"])
    who = f" {name[:_MOST_NAME]}" if name else ""
    level, steps = str(alert["level"]).upper(), notice.steps
    if Step.CLEARED in steps:
        return _ascii(f"CLEARED{who}: {_what(alert)}.")
    if Step.RAISED in steps or Step.LEVEL in steps or Step.CAUSE in steps:
        return _ascii(f"{level}{who}: {alert['text']}")
    note = f" {alert['notes'][-1]}." if alert["notes"] else ""
    return _ascii(f"{str(steps[0]).capitalize()}{who}: {_what(alert)}.{note}")


def _happened(notice: Notice) -> str:
    alert, said = notice.alert, []
    for step in notice.steps:
        if step is Step.RAISED:
            times = alert["repeats"]
            said.append(f"{alert['level']}" + (f", back for the {times + 1}. time" if times else ""))
        elif step is Step.LEVEL:
            said.append(f"now {alert['level']} (it was {notice.was_level})")
        elif step is Step.CAUSE:
            said.append(f"cause now {alert['cause']} (it was {notice.was_cause})")
        else:
            said.append(str(step))
    return ", ".join(said)


def _what(alert: Mapping[str, Any]) -> str:
    """The first sentence of an alert's text, without its end; a full stop inside a number is none."""
    return str(alert["text"]).split(". ")[0].rstrip(".")


def _size(alert: Mapping[str, Any]) -> str:
    size, error = alert["size"]["value"], alert["size"]["standard_error"]
    unit = _unit(alert["cause"], alert["channel"])
    chance = alert["probability"]
    likely = "" if chance is None else f" Probability of this cause: {_percent(chance)}."
    if size is None or not error or unit is None:
        return likely.strip()
    factor, shown = (1.0, "") if alert["cause"] == "icing" else _SHOWN.get(unit, (1.0, f" {unit}"))
    low, high = factor * (size - _NORMAL_95 * error), factor * (size + _NORMAL_95 * error)
    return f"Size: {factor * size:.3g}{shown}, with 95 % confidence between {low:.3g} and {high:.3g}{shown}.{likely}"


def _unit(cause: str, channel: str | None) -> str | None:
    """Of a cause's size; None where it is not known here, and then the alert's text alone says the size."""
    for one in HYPOTHESES:
        if (one.cause, one.channel or None) == (cause, channel):
            return one.unit
    return "" if channel is None and any(one.name == cause for one in CAUSES) else None


def _percent(probability: float) -> str:
    """A probability is never rounded to certainty."""
    return "above 99 %" if probability > 0.99 else f"{100.0 * probability:.0f} %"


def _evidence(row: Mapping[str, Any]) -> str:
    value, error, expected, spread = (
        row[name] for name in ("estimate", "standard_error", "expected", "expected_standard_error")
    )
    if None in (value, error, expected, spread):
        return ""
    low, high = value - _NORMAL_95 * error, value + _NORMAL_95 * error
    unit, meaning = f" {row['unit']}" if row["unit"] else "", f" ({row['meaning']})" if row["meaning"] else ""
    return (
        f"{row['derivative']}{meaning}: {value:.3g}, 95 % interval {low:.3g} to {high:.3g}{unit}; "
        f"expected {expected - _NORMAL_95 * spread:.3g} to {expected + _NORMAL_95 * spread:.3g}{unit}."
    )


def _ascii(text: str) -> str:
    replaced = text.replace("±", "+/-").replace("°", " deg").replace("  ", " ")
    return replaced.encode("ascii", "replace").decode("ascii")
