"""A diagnosis of a change in words and as JSON."""

from dataclasses import asdict
from typing import Any

from wingwatch.diagnosis.change.result import ChangeDiagnosis, Explanation, Outcome

__all__ = ["change_as_json", "named", "sentence_of", "sized"]


def change_as_json(found: ChangeDiagnosis) -> dict[str, Any]:
    """Plain numbers, texts, lists and objects."""
    plain = asdict(found)
    plain["outcome"] = str(found.outcome)
    plain["explanations"] = [asdict(e) for e in found.explanations]
    plain["notes"] = list(found.notes)
    return plain


def named(one: Explanation) -> str:
    """Cause and part."""
    return f"{one.cause} of {one.target}" if one.target else one.cause


def sized(one: Explanation) -> str:
    """Size with standard error and unit; empty for what is there or not."""
    if one.size_standard_error == 0.0:
        return ""
    digits = 2 if abs(one.size) >= 0.095 else 3
    unit = f" {one.unit}" if one.unit else ""
    return f"{one.size:.{digits}f} ± {max(one.size_standard_error, 10.0**-digits):.{digits}f}{unit}"


def sentence_of(found: ChangeDiagnosis) -> str:
    """The answer without an alert: what is found since when."""
    since = f"since {found.onset_s:.0f} s"
    if found.outcome is Outcome.NOTHING:
        return f"no change {since} that is beyond doubt"
    if found.outcome is Outcome.NO_KNOWN_CAUSE:
        return f"a change {since} that no known cause explains"
    if found.outcome is Outcome.DECIDED:
        best = found.explanations[0]
        return f"{named(best)} {sized(best)} {since}".replace("  ", " ")
    return f"one of {', '.join(named(e) for e in found.possible)} {since}"
