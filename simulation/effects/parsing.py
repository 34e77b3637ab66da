"""Effects as text: NAME:SIZE@START[+RAMP], such as ``icing:0.15@60+30``, or with a target in brackets behind the name,
such as ``sensor_bias[pitch_rate_rad_s]:0.01@60``."""

import re

from wingwatch.simulation.effects.effect import Effect
from wingwatch.simulation.effects.registry import EFFECTS

__all__ = ["EffectSyntaxError", "effect_text", "parse_effect"]

_FORM = (
    "write NAME:SIZE@START[+RAMP], such as icing:0.15@60+30, the target in brackets as in icing[tail]:0.15@60"
)
_NAME_AND_TARGET = re.compile(r"([^\[\]:]*)(?:\[([^\[\]]*)\])?(.*)", re.DOTALL)


class EffectSyntaxError(ValueError):
    """A text that is no effect; the sentence says what is wrong and what is allowed."""


def parse_effect(text: str) -> Effect:
    """An effect from its text; start and ramp in seconds, the ramp 0 where none is written.

    Raises:
        EffectSyntaxError: not of that form, a name or target that is not known, or a number outside its range.
    """
    match = _NAME_AND_TARGET.fullmatch(text.strip())
    name, target, rest = match.groups() if match else ("", None, "")
    if name not in EFFECTS:
        raise EffectSyntaxError(
            f"effect {text!r}: {name!r} cannot be simulated; known are {', '.join(EFFECTS)}"
        )
    kind = EFFECTS[name]
    if rest and not rest.startswith(":"):
        raise EffectSyntaxError(f"effect {text!r}: {rest!r} is out of place; {_FORM}")
    size, at, times = rest.removeprefix(":").partition("@")
    if not rest or not at:
        raise EffectSyntaxError(f"effect {text!r} has no {'size' if not rest else 'start'}; {_FORM}")
    start, plus, ramp = times.partition("+")
    try:
        return kind(
            kind.size_words[size] if size in kind.size_words else _number(text, "size", size),
            _number(text, "start", start),
            _number(text, "ramp", ramp) if plus else 0.0,
            target or "",
        )
    except EffectSyntaxError:
        raise
    except ValueError as error:
        raise EffectSyntaxError(f"effect {text!r}: {error}") from None


def effect_text(effect: Effect) -> str:
    """The text of an effect; ``parse_effect`` makes the same effect of it."""
    target = "" if effect.target == effect.target_default else f"[{effect.target}]"
    ramp = f"+{_digits(effect.ramp_s)}" if effect.ramp_s else ""
    return f"{effect.name}{target}:{effect.word or _digits(effect.size)}@{_digits(effect.onset_s)}{ramp}"


def _digits(value: float) -> str:
    """The shortest digits that give the same number, without a plus sign, which parts start and ramp."""
    return repr(float(value)).removesuffix(".0").replace("e+", "e")


def _number(text: str, what: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise EffectSyntaxError(f"effect {text!r}: {what} {value!r} is not a number; {_FORM}") from None
