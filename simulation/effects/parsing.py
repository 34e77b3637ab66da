"""Effects as text: NAME:SIZE@START[+RAMP], such as ``icing:0.15@60+30``."""

from wingwatch.simulation.effects.effect import Effect
from wingwatch.simulation.effects.registry import EFFECTS

__all__ = ["EffectSyntaxError", "parse_effect"]

_FORM = "write NAME:SIZE@START[+RAMP], such as icing:0.15@60+30"


class EffectSyntaxError(ValueError):
    """A text that is no effect; the sentence says what is wrong and what is allowed."""


def parse_effect(text: str) -> Effect:
    """An effect from its text; start and ramp in seconds, the ramp 0 where none is written.

    Raises:
        EffectSyntaxError: not of that form, a name that is not known, or a number outside its range.
    """
    name, colon, rest = text.strip().partition(":")
    if name not in EFFECTS:
        raise EffectSyntaxError(
            f"effect {text!r}: {name!r} cannot be simulated; known are {', '.join(EFFECTS)}"
        )
    size, at, times = rest.partition("@")
    if not colon or not at:
        raise EffectSyntaxError(f"effect {text!r} has no {'size' if not colon else 'start'}; {_FORM}")
    start, plus, ramp = times.partition("+")
    try:
        return EFFECTS[name](
            _number(text, "size", size),
            _number(text, "start", start),
            _number(text, "ramp", ramp) if plus else 0.0,
        )
    except EffectSyntaxError:
        raise
    except ValueError as error:
        raise EffectSyntaxError(f"effect {text!r}: {error}") from None


def _number(text: str, what: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise EffectSyntaxError(f"effect {text!r}: {what} {value!r} is not a number; {_FORM}") from None
