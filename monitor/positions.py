"""Where vehicles are, and which of several places are near one another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = ["Place", "Position", "near_one_another", "position_of"]

_EARTH_M = 6_371_000.0
_COLUMNS = [CHANNEL_INDEX[name] for name in ("latitude_deg", "longitude_deg", "altitude_m")]


@dataclass(frozen=True, slots=True)
class Position:
    """Latitude and longitude in degrees, altitude in m."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class Place:
    """A position at a time, in s."""

    position: Position
    at_s: float


def position_of(block: SampleBlock) -> Position | None:
    """Of the last sample that says where; None where none does."""
    said = np.flatnonzero(np.isfinite(block.values[:, _COLUMNS]).all(axis=1))
    return Position(*block.values[said[-1], _COLUMNS].tolist()) if said.size else None


def near_one_another(places: Sequence[Place], within_m: float, above_m: float, within_s: float) -> list[int]:
    """By place the number of its cluster: each is near some other of it, in all three respects.

    Args:
        within_m: horizontally; above_m: in altitude; within_s: in time.
    """
    if not places:
        return []
    latitude, longitude = (
        np.radians([getattr(p.position, name) for p in places]) for name in ("latitude_deg", "longitude_deg")
    )
    near = _distances_m(latitude, longitude) <= within_m
    for values, most in (
        ([p.position.altitude_m for p in places], above_m),
        ([p.at_s for p in places], within_s),
    ):
        near &= np.abs(np.subtract.outer(values, values)) <= most
    clusters: Sequence[int] = connected_components(near, directed=False)[1].tolist()
    return list(clusters)


def _distances_m(latitude: NDArray[np.float64], longitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """Great circles between all pairs, by haversines: half of a difference of 360 degrees has the sine of none."""
    half = np.sin(0.5 * np.subtract.outer(latitude, latitude)) ** 2
    half += np.multiply.outer(np.cos(latitude), np.cos(latitude)) * (
        np.sin(0.5 * np.subtract.outer(longitude, longitude)) ** 2
    )
    return np.asarray(2.0 * _EARTH_M * np.arcsin(np.sqrt(np.clip(half, 0.0, 1.0))))
