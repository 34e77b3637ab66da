"""Every effect by its name."""

from collections.abc import Mapping

from wingwatch.simulation.effects.aileron_effectiveness import AileronEffectiveness
from wingwatch.simulation.effects.effect import Effect
from wingwatch.simulation.effects.elevator_effectiveness import ElevatorEffectiveness
from wingwatch.simulation.effects.icing import Icing
from wingwatch.simulation.effects.rudder_effectiveness import RudderEffectiveness

__all__ = ["EFFECTS"]

EFFECTS: Mapping[str, type[Effect]] = {
    effect.name: effect
    for effect in (Icing, ElevatorEffectiveness, AileronEffectiveness, RudderEffectiveness)
}
