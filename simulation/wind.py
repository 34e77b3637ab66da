"""Steady wind and how it changes with height: not at all, as in the boundary layer, or by a gradient; and its veer.

The boundary layer is that of MIL-F-8785C (section 3.7.3.2): W = W_20 ln(h / z0) / ln(20 ft / z0) from 3 to 1000 ft
above the ground, z0 = 0.15 ft for landing and take-off (flight phases of category C), 2.0 ft for all others. Outside
that layer the wind is as at its edge. A change of direction with height is the specification's vector shear (3.7.3.3).
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import helper

__all__ = ["WIND", "WindProfile", "wind_at", "wind_row"]

BoundaryLayer = Literal["none", "terminal", "other"]
BOUNDARY_LAYERS: tuple[str, ...] = get_args(BoundaryLayer)

_FOOT_M = 0.3048
_ROUGHNESS_M = {"terminal": 0.15 * _FOOT_M, "other": 2.0 * _FOOT_M}
REFERENCE_HEIGHT_M = 20.0 * _FOOT_M
"""Where the boundary layer's wind is given."""
_LOWEST_M, _HIGHEST_M = 3.0 * _FOOT_M, 1000.0 * _FOOT_M


@dataclass(frozen=True, slots=True)
class WindProfile:
    """How a scenario's wind changes with height; as it stands, not at all.

    Attributes:
        boundary_layer: "terminal" (category C: landing, take-off) or "other" for the logarithmic profile; the
            scenario's wind is then that at 20 ft (6.1 m) above the ground, else that at the scenario's altitude.
        shear_per_s: growth of the wind to the north and to the east with height, m/s per m; not with a boundary layer.
        veer_rad_m: how far the wind turns clockwise, seen from above, per m of height.

    Raises:
        ValueError: a boundary layer that is not known, numbers that are not finite, a shear on top of a boundary layer.
    """

    boundary_layer: BoundaryLayer = "none"
    shear_per_s: tuple[float, float] = (0.0, 0.0)
    veer_rad_m: float = 0.0

    def __post_init__(self) -> None:
        if self.boundary_layer not in BOUNDARY_LAYERS:
            raise ValueError(
                f"boundary_layer is {self.boundary_layer!r}; give one of {', '.join(BOUNDARY_LAYERS)}"
            )
        if len(self.shear_per_s) != 2 or not all(math.isfinite(s) for s in self.shear_per_s):
            raise ValueError(
                f"shear_per_s is {self.shear_per_s}; give two finite numbers, north and east, of 1/s"
            )
        if not math.isfinite(self.veer_rad_m):
            raise ValueError(f"veer_rad_m is {self.veer_rad_m}; give a finite number of rad/m")
        if self.boundary_layer != "none" and any(self.shear_per_s):
            raise ValueError(
                f"shear_per_s is {self.shear_per_s} and boundary_layer {self.boundary_layer!r}; give one of the two"
            )


WIND: tuple[str, ...] = (
    "north_m_s", "east_m_s", "down_m_s", "reference_altitude_m", "shear_north_per_s", "shear_east_per_s", "veer_rad_m",
    "layered", "ground_altitude_m", "roughness_m", "per_logarithm",
)  # fmt: skip
"""Columns of a wind row: the wind at the reference altitude, how it changes from there, and the boundary layer."""
(
    _NORTH, _EAST, _DOWN, _REFERENCE, _SHEAR_NORTH, _SHEAR_EAST, _VEER, _LAYERED, _GROUND, _ROUGHNESS, _PER_LOGARITHM,
) = range(len(WIND))  # fmt: skip


def wind_row(
    profile: WindProfile, wind_m_s: tuple[float, float, float], altitude_m: float, ground_altitude_m: float
) -> NDArray[np.float64]:
    """A wind as ``wind_at`` reads it, shape (len(WIND),).

    Args:
        profile: how it changes with height.
        wind_m_s: velocity of the air over the ground (north, east, down), where ``profile`` says.
        altitude_m: where that is without a boundary layer.
        ground_altitude_m: above sea level.
    """
    layered = profile.boundary_layer != "none"
    roughness = _ROUGHNESS_M.get(profile.boundary_layer, 1.0)
    return np.array([
        *wind_m_s,
        ground_altitude_m + REFERENCE_HEIGHT_M if layered else altitude_m,
        *profile.shear_per_s,
        profile.veer_rad_m,
        float(layered), ground_altitude_m, roughness, 1.0 / math.log(REFERENCE_HEIGHT_M / roughness),
    ])  # fmt: skip


@helper
def wind_at(row, altitude_m, out):  # type: ignore[no-untyped-def]
    """Velocity of the air over the ground (north, east, down), m/s, at an altitude above the sea, into ``out`` (3,)."""
    north, east, altitude = row[_NORTH], row[_EAST], altitude_m
    if row[_LAYERED] != 0.0:
        height = min(_HIGHEST_M, max(_LOWEST_M, altitude - row[_GROUND]))
        share = math.log(height / row[_ROUGHNESS]) * row[_PER_LOGARITHM]
        north *= share
        east *= share
        altitude = height + row[_GROUND]
    rise = altitude - row[_REFERENCE]
    north += row[_SHEAR_NORTH] * rise
    east += row[_SHEAR_EAST] * rise
    if row[_VEER] != 0.0:
        angle = row[_VEER] * rise
        cosine, sine = math.cos(angle), math.sin(angle)
        north, east = north * cosine - east * sine, north * sine + east * cosine
    out[0], out[1], out[2] = north, east, row[_DOWN]
