"""Drawing what is hidden until it can be flown and seen, for every source alike."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from diagnosis_hidden import LEAST_SIGNAL, Array, Case, Hidden, Range, bigger, draw_hidden, signal_to_noise

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry import CHANNEL_INDEX

__all__ = ["Plan", "drawn", "flyable", "weakest_signal"]

_ATTEMPTS = 60
_LARGEST = {"roll_rad": 1.2, "pitch_rad": 0.8, "angle_of_attack_rad": 0.35, "sideslip_rad": 0.4}
"""Beyond these a flight is not one that anybody would identify a model from."""


class Plan(Protocol):
    """How a case is flown, all but its effects."""

    @property
    def aircraft(self) -> Aircraft:
        """The file of the aircraft without effects."""

    def ideal(self, effects: Sequence[Hidden]) -> Array | None:
        """The flight in still air without noise, (samples, channels); None where it cannot be flown."""

    def case(self, effects: Sequence[Hidden], signal: float) -> Case | None:
        """The case; None where its flights cannot be flown."""


def drawn(plan: Plan, rows: Sequence[Range], rng: np.random.Generator, count: int) -> Case:
    """A case with so many effects, each of which is seen alone.

    Raises:
        RuntimeError: none of many draws could be flown and seen.
    """
    clean = plan.ideal(())
    for _ in range(_ATTEMPTS):
        hidden: list[Hidden] = []
        for _ in range(count):
            hidden.append(draw_hidden(rng, rows, plan.aircraft, [h.name for h in hidden]))
        if clean is None:
            break
        seen = [_raised(plan, rows, effect, clean) for effect in hidden]
        loud = [effect for effect, _ in seen if effect is not None]
        if len(loud) < count:
            continue
        case = plan.case(loud, min((signal for _, signal in seen), default=0.0))
        if case is not None:
            return case
    raise RuntimeError(
        f"no effect on {plan.aircraft.name} can be flown and seen in this flight; give another seed"
    )


def _raised(plan: Plan, rows: Sequence[Range], effect: Hidden, clean: Array) -> tuple[Hidden | None, float]:
    """The effect with a size that is seen, and its signal; None where none is both seen and flown."""
    loud: Hidden | None = effect
    while loud is not None:
        flown = plan.ideal((loud,))
        if flown is None:
            return None, 0.0
        signal = signal_to_noise(plan.aircraft, loud, flown, clean)
        if signal >= LEAST_SIGNAL:
            return loud, signal
        loud = bigger(loud, rows, plan.aircraft)
    return None, 0.0


def weakest_signal(plan: Plan, effects: Sequence[Hidden]) -> float:
    """Signal of the effect that shows least, each alone; 0 without effects.

    Raises:
        ValueError: a flight that cannot be flown.
    """
    flights = [plan.ideal(some) for some in ((), *((effect,) for effect in effects))]
    clean, *alone = [flight for flight in flights if flight is not None]
    if len(alone) < len(effects):
        raise ValueError(f"{plan.aircraft.name} cannot be flown with {', '.join(e.label for e in effects)}")
    return min(
        (signal_to_noise(plan.aircraft, e, x, clean) for e, x in zip(effects, alone, strict=True)),
        default=0.0,
    )


def flyable(values: Array) -> bool:
    """Whether a flight stays where one would identify a model from it."""
    return all(bool((np.abs(values[:, CHANNEL_INDEX[name]]) < most).all()) for name, most in _LARGEST.items())
