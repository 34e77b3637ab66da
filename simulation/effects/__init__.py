"""What can befall a simulated aircraft: one file an effect, named as in the vocabulary of causes."""

from wingwatch.simulation.effects.aileron_effectiveness import AileronEffectiveness
from wingwatch.simulation.effects.effect import Effect, coefficients_under, factor_row
from wingwatch.simulation.effects.elevator_effectiveness import ElevatorEffectiveness
from wingwatch.simulation.effects.icing import Icing
from wingwatch.simulation.effects.parsing import EffectSyntaxError, parse_effect
from wingwatch.simulation.effects.registry import EFFECTS
from wingwatch.simulation.effects.rudder_effectiveness import RudderEffectiveness

__all__ = [
    "AileronEffectiveness",
    "EFFECTS",
    "Effect",
    "EffectSyntaxError",
    "ElevatorEffectiveness",
    "Icing",
    "RudderEffectiveness",
    "coefficients_under",
    "factor_row",
    "parse_effect",
]
