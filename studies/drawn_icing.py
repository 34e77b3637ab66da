"""Icing whose factors are drawn anew for every flight, so that no published table is the truth of a study."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from wingwatch.simulation import Effect, Icing
from wingwatch.simulation.effects.effect import Parameters
from wingwatch.simulation.effects.icing import LINEAR_FACTORS, NONLINEAR_SHARES

__all__ = ["DrawnIcing", "drawn_icing"]


@dataclass(frozen=True, slots=True)
class DrawnIcing(Effect):
    """Icing with factors of its own.

    Attributes:
        factors: of a linear kind what a severity of 1 adds to the ratio of each coefficient, else what it adds to
            each severity of the non-linear model.
    """

    factors: tuple[tuple[str, float], ...] = ()

    name: ClassVar[str] = Icing.name
    size_max: ClassVar[float] = Icing.size_max
    size_meaning: ClassVar[str] = Icing.size_meaning
    targets: ClassVar[tuple[str, ...]] = Icing.targets
    target_default: ClassVar[str] = Icing.target_default

    def apply(self, parameters: Parameters, severity: float) -> None:
        """As ``Icing``, with the factors drawn."""
        if self.target in LINEAR_FACTORS:
            parameters.scale(dict(self.factors), severity)
            return
        for name, share in self.factors:
            parameters[name] += severity * share


def drawn_icing(
    size: float, onset_s: float, ramp_s: float, target: str, drawn: Mapping[str, float]
) -> DrawnIcing:
    """Icing of a kind, each published factor times what is drawn for it (1 where nothing is)."""
    published = LINEAR_FACTORS[target] if target in LINEAR_FACTORS else NONLINEAR_SHARES[target]
    factors = tuple((name, factor * drawn.get(name, 1.0)) for name, factor in published.items())
    return DrawnIcing(size, onset_s, ramp_s, target, factors)
