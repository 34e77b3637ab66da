"""How figures and lists are written, on pages and on a terminal."""

import math
from collections.abc import Iterable

__all__ = ["listed", "number", "percent", "probability_text", "with_error"]


def number(value: float, digits: int = 3) -> str:
    """A figure with so many significant digits, a dash where it is not known."""
    if not math.isfinite(value):
        return "-"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e" in text and 1.0 <= abs(value) < 1e6 else text


def percent(part: float) -> str:
    """A part as percent, a dash where it is not known."""
    return f"{100.0 * part:.0f} %" if math.isfinite(part) else "-"


def probability_text(probability: float) -> str:
    """A probability; next to 0 and 1 only on which side."""
    if probability > 0.999:
        return "> 0.999"
    return "< 0.001" if probability < 0.001 else number(probability)


def with_error(value: float, standard_error: float) -> str:
    """Value ± standard error, to two digits of the error."""
    if not math.isfinite(value):
        return "-"
    if not (math.isfinite(standard_error) and standard_error > 0.0):
        return number(value, 4)
    exponent = math.floor(math.log10(standard_error))
    if not -5 <= exponent <= 4:
        return f"{value:.3g} ± {standard_error:.2g}"
    places = max(1 - exponent, 0)
    return f"{value:.{places}f} ± {standard_error:.{places}f}"


def listed(words: Iterable[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    items = list(words)
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else ""
