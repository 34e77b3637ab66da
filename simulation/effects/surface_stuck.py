"""A control surface that no longer moves: a jam where it is, at a deflection, or a hardover to its limit."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from wingwatch.aircraft import AircraftDataError
from wingwatch.simulation.effects.effect import Effect, Parameters
from wingwatch.simulation.layout import SURFACES

__all__ = ["SurfaceStuck"]


@dataclass(frozen=True, slots=True)
class SurfaceStuck(Effect):
    """``size`` is the deflection at which it stays, in rad: NaN (``here``) where it is at the onset, an infinite
    one (``limit``, ``-limit``) its position limit. It runs there at its rate limit, commands do nothing from the
    onset on."""

    name: ClassVar[str] = "surface_stuck"
    size_min: ClassVar[float] = -1.6
    size_max: ClassVar[float] = 1.6
    size_meaning: ClassVar[str] = "the deflection in rad"
    size_words: ClassVar[Mapping[str, float]] = MappingProxyType(
        {"here": math.nan, "limit": math.inf, "-limit": -math.inf}
    )
    targets: ClassVar[tuple[str, ...]] = SURFACES
    grows: ClassVar[bool] = False

    def apply(self, parameters: Parameters, severity: float) -> None:
        """The surface is stuck, at a deflection within its travel.

        Raises:
            AircraftDataError: a deflection beyond the surface's travel, or a hardover of one without a limit.
        """
        limit = parameters[f"{self.target}_limit"]
        where = math.copysign(limit, severity) if math.isinf(severity) else severity
        if math.isinf(where):
            raise AircraftDataError(
                f"{self.name} of {self.target} at its limit: aircraft {parameters.aircraft.name} states no "
                f"position_limit_rad for it; give a deflection in rad"
            )
        if abs(where) > limit:
            raise AircraftDataError(
                f"{self.name} of {self.target} at {where:g} rad: on aircraft {parameters.aircraft.name} it "
                f"travels to {limit:g}; give a deflection within that"
            )
        parameters[f"{self.target}_stuck"] = 1.0
        parameters[f"{self.target}_stuck_at"] = where
