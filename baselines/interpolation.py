"""Weights over the points of an envelope: bilinear on a grid, linear on triangles or along a line else.

Weights are never negative and sum to one, so an interpolated value lies between those of its points and a
covariance interpolated with the same weights bounds the true one (docs/decisions/0011-baseline-envelope.md).
Coordinates are (airspeed_true_m_s, altitude_m).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["Interpolator", "Placement", "interpolator"]

_FLAT = 1e-9
"""Singular value of the scaled points, relative to the largest, below which they lie on a line."""


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Where a query stands among the points.

    Attributes:
        weights: shape (n,), not negative, sum 1.
        nearest: the query itself inside the points' hull, else the nearest point of the hull, shape (2,).
        curvature_bound: shape (k,), what linear interpolation may be off by, from second differences.
    """

    weights: NDArray[np.float64]
    nearest: NDArray[np.float64]
    curvature_bound: NDArray[np.float64]


class Interpolator(Protocol):
    """Places a query among n points."""

    def place(self, query: NDArray[np.float64]) -> Placement:
        """Weights of a query of shape (2,)."""
        ...


def interpolator(points: NDArray[np.float64], values: NDArray[np.float64]) -> Interpolator:
    """The interpolator that the points allow.

    Args:
        points: shape (n, 2), n at least 1.
        values: shape (n, k), what will be interpolated; only its curvature is used.

    Raises:
        ValueError: no points, or one twice.
    """
    if len(points) == 0:
        raise ValueError("an envelope needs at least one point")
    if len(np.unique(points, axis=0)) < len(points):
        raise ValueError("an envelope has two entries at the same airspeed and altitude; keep one of them")
    axes = [np.unique(points[:, i]) for i in (0, 1)]
    if axes[0].size * axes[1].size == len(points):
        return _Grid(points, values, axes)
    return _Scattered(points, values.shape[1])


class _Grid:
    """All combinations of some airspeeds and some altitudes; one of each is the single point."""

    def __init__(
        self, points: NDArray[np.float64], values: NDArray[np.float64], axes: list[NDArray[np.float64]]
    ) -> None:
        self._axes = axes
        self._index = np.lexsort((points[:, 1], points[:, 0])).reshape(axes[0].size, axes[1].size)
        table = values[self._index]
        self._curvature = [_cell_curvature(axes[0], table), _cell_curvature(axes[1], table.swapaxes(0, 1))]

    def place(self, query: NDArray[np.float64]) -> Placement:
        (i, t, x), (j, u, y) = (_locate(axis, float(q)) for axis, q in zip(self._axes, query, strict=True))
        weights = np.zeros(self._index.size)
        for row, a in ((i, 1.0 - t), (i + 1, t)):
            for column, b in ((j, 1.0 - u), (j + 1, u)):
                if a * b > 0.0:
                    weights[self._index[row, column]] = a * b
        bound = self._bound(0, i, x, slice(j, j + 2)) + self._bound(1, j, y, slice(i, i + 2))
        return Placement(weights, np.array([x, y]), bound)

    def _bound(self, axis: int, cell: int, x: float, across: slice) -> NDArray[np.float64]:
        """|f - linear| <= (x - a) (b - x) max|f''| / 2 in a cell [a, b]."""
        curvature = self._curvature[axis]
        if curvature.shape[0] == 0:
            return np.zeros(curvature.shape[2])
        nodes = self._axes[axis]
        span = (x - nodes[cell]) * (nodes[min(cell + 1, nodes.size - 1)] - x)
        return np.asarray(0.5 * span * curvature[cell, across].max(axis=0))


class _Scattered:
    """Triangles between points in general position, consecutive segments between points on one line."""

    def __init__(self, points: NDArray[np.float64], k: int) -> None:
        self._points = points
        self._k = k
        self._scale = np.ptp(points, axis=0)  # neither is zero: such points are a grid
        scaled = points / self._scale
        self._triangles: scipy.spatial.Delaunay | None = None
        centred = scaled - scaled.mean(axis=0)
        _, spread, direction = np.linalg.svd(centred, full_matrices=False)
        order = np.argsort(centred @ direction[0])
        self._edges = np.column_stack((order[:-1], order[1:]))
        if spread[-1] > _FLAT * spread[0]:
            try:
                self._triangles = scipy.spatial.Delaunay(scaled)
                self._edges = np.asarray(scipy.spatial.ConvexHull(scaled).simplices)
            except scipy.spatial.QhullError as error:
                raise ValueError(
                    "the entries of an envelope lie too close to each other to interpolate; drop some"
                ) from error
        self._scaled = scaled

    def place(self, query: NDArray[np.float64]) -> Placement:
        weights = self._inside(query / self._scale)
        if weights is not None:
            return Placement(weights, query, np.zeros(self._k))
        weights = self._on_edge(query / self._scale)
        return Placement(weights, weights @ self._points, np.zeros(self._k))

    def _inside(self, query: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Barycentric weights, None outside of every triangle."""
        if self._triangles is None:
            return None
        simplex = int(self._triangles.find_simplex(query[None, :])[0])
        if simplex < 0:
            return None
        transform = self._triangles.transform[simplex]
        first = transform[:2] @ (query - transform[2])
        barycentric = np.clip(np.append(first, 1.0 - first.sum()), 0.0, 1.0)
        weights = np.zeros(len(self._points))
        weights[self._triangles.simplices[simplex]] = barycentric / barycentric.sum()
        return weights

    def _on_edge(self, query: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights of the nearest point on an outer edge."""
        start, end = self._scaled[self._edges[:, 0]], self._scaled[self._edges[:, 1]]
        along = end - start
        t = np.clip(np.sum((query - start) * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
        distance = np.linalg.norm(start + t[:, None] * along - query, axis=1)
        best = int(np.argmin(distance))
        weights = np.zeros(len(self._points))
        weights[self._edges[best]] = (1.0 - t[best], t[best])
        return weights


def _locate(nodes: NDArray[np.float64], x: float) -> tuple[int, float, float]:
    """Cell, share of its upper node, and x moved to the nearest place within the nodes."""
    inside = min(max(x, float(nodes[0])), float(nodes[-1]))
    if nodes.size == 1:
        return 0, 0.0, inside
    cell = max(min(int(nodes.searchsorted(inside, side="right")) - 1, nodes.size - 2), 0)
    return cell, float((inside - nodes[cell]) / (nodes[cell + 1] - nodes[cell])), inside


def _cell_curvature(nodes: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest |second derivative| seen next to each cell, (cells, across, k); none below three nodes."""
    if nodes.size < 3:
        return np.zeros((0, *table.shape[1:]))
    step = np.diff(nodes)[:, None, None]
    slope = np.diff(table, axis=0) / step
    second = np.abs(2.0 * np.diff(slope, axis=0) / (step[1:] + step[:-1]))
    below, above = np.concatenate((second[:1], second)), np.concatenate((second, second[-1:]))
    return np.asarray(np.maximum(below, above))
