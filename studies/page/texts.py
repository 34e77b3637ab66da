"""How a study's figures and words are written."""

import math
from collections.abc import Mapping
from typing import Any

from wingwatch.pages.texts import number
from wingwatch.studies.operator_answer import Answer
from wingwatch.studies.statistics import Interval

__all__ = [
    "column_text",
    "effect_text",
    "group_text",
    "interval_text",
    "per_100_h_text",
    "percent_text",
    "reason_text",
    "size_axis",
    "size_flown_text",
    "size_text",
]

NOT_KNOWN = "not known"

_SIZES: Mapping[str, str] = {
    "icing": "severity (Twin Otter scale)",
    "surface_stuck": "deflection at which it is stuck, rad",
    "surface_offset": "offset, rad",
    "wing_damage": "fraction of the semi-span lost",
    "cg_shift": "shift, m",
    "thrust_loss": "fraction of thrust lost",
    "actuator_lag": "added time constant, s",
    "mass_inertia": "ratio of the masses less 1",
    "pitch_damping": "ratio of the pitch dampings less 1",
}
_COLUMNS: Mapping[str, str] = {
    "turbulence": "turbulence",
    "turbulence_model": "turbulence model",
    "excitation": "excitation",
    "expectation": "errors of the expectation",
    "surfaces": "surfaces reported as",
    "sensor fault": "sensor fault",
}
_WORDS: Mapping[str, str] = {
    "none": "none",
    "3211": "3-2-1-1",
    "no_vanes": "without vanes",
    "vanes": "with vanes",
    "von-karman": "von Karman",
    "dryden": "Dryden",
    "autopilot": "autopilot only",
}


def effect_text(effect: str) -> str:
    """An effect's name in words."""
    return effect.replace("_effectiveness", " effectiveness lost").replace("cg_", "c.g. ").replace("_", " ")


def column_text(by: str) -> str:
    """A condition's name in words."""
    return _COLUMNS.get(by, by.replace("_", " "))


def group_text(by: str, group: str) -> str:
    """A condition and its word: "turbulence light"."""
    if not by:
        return "all flights"
    word = _WORDS.get(group, group.replace("_", " "))
    if by in ("aircraft", "sensors"):
        return word
    return f"{column_text(by)} {word or 'not stated'}"


def reason_text(reason: Mapping[str, Any]) -> str:
    """What misled the monitor: "l_p off by -4.1 standard errors; least likely block: lateral to 130 s, 1e-8"."""
    parts = []
    if "derivative" in reason:
        parts.append(f"{reason['derivative']} off by {reason['z']:+.1f} standard errors")
    if "structure" in reason:
        name = str(reason["structure"]).replace("_", " ")
        chance = 10.0 ** max(reason["log10_probability"], -300.0)
        parts.append(f"least likely block: {name} to {reason['block_end_s']:.0f} s, probability {chance:.1g}")
    return "; ".join(parts)


def size_axis(effect: str) -> str:
    """What the size of an effect is, with its unit."""
    return _SIZES.get(effect, "fraction lost" if effect.endswith("_effectiveness") else "size, SI units")


def interval_text(interval: Interval, digits: int = 2, factor: float = 1.0) -> str:
    """ "0.21 (0.18 to 0.25)"; a dash where it is not known."""
    if math.isnan(interval.value):
        return "-"
    limits = [_limit(factor * x, digits) for x in (interval.low, interval.high)]
    return f"{_limit(factor * interval.value, digits)} ({limits[0]} to {limits[1]})"


def percent_text(interval: Interval) -> str:
    """ "63 % (51 to 74)"."""
    if math.isnan(interval.value):
        return "-"
    return f"{100.0 * interval.value:.0f} % ({100.0 * interval.low:.0f} to {100.0 * interval.high:.0f})"


def per_100_h_text(per_hour: Interval) -> str:
    """A rate per hour, said per 100 h."""
    return interval_text(per_hour, 2, 100.0)


def _limit(value: float, digits: int) -> str:
    if math.isinf(value):
        return "no limit"
    return number(value, digits) if value < 1e6 else "> 1e6"


def size_text(answer: Answer, there: bool = False) -> str:
    """A size that is seen with 95 % probability in time; only what was flown is vouched for.

    Args:
        there: at the threshold for one false alarm in 100 h, else at the monitor's own.
    """
    if not there:
        return size_flown_text(answer.size, answer.largest)
    size = answer.size_at_threshold
    words = size_flown_text(size, answer.largest)
    if not answer.relation or words == NOT_KNOWN:
        return words
    if size.value <= answer.largest:
        return f"{answer.relation} {words}"
    return words if answer.relation == "at least" else NOT_KNOWN


def size_flown_text(size: Interval, largest: float) -> str:
    """A size with its interval, as far as sizes were flown."""
    if math.isnan(size.value) or (size.low <= 0.0 and size.high > largest):
        return NOT_KNOWN
    end = number(largest, 2)
    if size.low >= largest:
        return f"none up to {end}"
    if size.value > largest:
        return f"over {end} (not below {number(size.low, 2)})"
    high = number(size.high, 2) if size.high <= largest else f"over {end}"
    return f"{number(size.value, 2)} ({number(size.low, 2)} to {high})"
