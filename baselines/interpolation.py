"""Weights over the points of an envelope: bilinear on a grid, linear on triangles or along a line else.

Many queries are placed at once; the weights of one do not depend on its company.

Weights are never negative and sum to one, so an interpolated value lies between those of its points and a
covariance interpolated with the same weights bounds the true one (docs/decisions/0011-baseline-envelope.md).
Coordinates are (airspeed_true_m_s, altitude_m).
"""

from typing import NamedTuple, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["Interpolator", "Placements", "interpolator"]

Array = NDArray[np.float64]
Places = NDArray[np.int64]

_FLAT = 1e-9
"""Singular value of the scaled points, relative to the largest, below which they lie on a line."""


class Placements(NamedTuple):
    """Where m queries stand among n points.

    Attributes:
        weights: shape (m, n), not negative, sum 1.
        nearest: the query itself inside the points' hull, else the nearest point of the hull, shape (m, 2).
        curvature_bound: shape (m, k), what linear interpolation may be off by, from second differences.
    """

    weights: Array
    nearest: Array
    curvature_bound: Array


class Interpolator(Protocol):
    """Places queries among n points."""

    def place(self, queries: Array) -> Placements:
        """Weights of queries of shape (m, 2): airspeed in m/s and altitude in m, all finite."""
        ...


def interpolator(points: Array, values: Array) -> Interpolator:
    """The interpolator that the points allow.

    Args:
        points: shape (n, 2), n at least 1: airspeed in m/s and altitude in m.
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

    def __init__(self, points: Array, values: Array, axes: list[Array]) -> None:
        self._axes = axes
        self._index = np.lexsort((points[:, 1], points[:, 0])).reshape(axes[0].size, axes[1].size)
        table = values[self._index]
        self._curvature = [_cell_curvature(axes[0], table), _cell_curvature(axes[1], table.swapaxes(0, 1))]

    def place(self, queries: Array) -> Placements:
        (i, t, x), (j, u, y) = (_locate(axis, queries[:, c]) for c, axis in enumerate(self._axes))
        weights = np.zeros((len(queries), self._index.size))
        every = np.arange(len(queries))
        for row, a in ((i.below, 1.0 - t), (i.above, t)):
            for column, b in ((j.below, 1.0 - u), (j.above, u)):
                weights[every, self._index[row, column]] += (
                    a * b
                )  # below and above are one where there is one node
        bound = self._bound(0, i, x, j) + self._bound(1, j, y, i)
        return Placements(weights, np.column_stack((x, y)), bound)

    def _bound(self, axis: int, cell: "_Cells", x: Array, across: "_Cells") -> Array:
        """|f - linear| <= (x - a) (b - x) max|f''| / 2 in a cell [a, b]."""
        curvature = self._curvature[axis]
        if curvature.shape[0] == 0:
            return np.zeros((x.size, curvature.shape[2]))
        nodes = self._axes[axis]
        span = (x - nodes[cell.below]) * (nodes[cell.above] - x)
        largest = np.maximum(curvature[cell.below, across.below], curvature[cell.below, across.above])
        return np.asarray(0.5 * span[:, None] * largest)


class _Scattered:
    """Triangles between points in general position, consecutive segments between points on one line."""

    def __init__(self, points: Array, k: int) -> None:
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

    def place(self, queries: Array) -> Placements:
        scaled = queries / self._scale
        weights, inside = self._inside(scaled)
        weights[~inside] = self._on_edge(scaled[~inside])
        nearest = np.where(inside[:, None], queries, (weights[:, None] @ self._points)[:, 0])
        return Placements(weights, nearest, np.zeros((len(queries), self._k)))

    def _inside(self, queries: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Barycentric weights of queries in a triangle, and which of them are."""
        weights = np.zeros((len(queries), len(self._points)))
        if self._triangles is None:
            return weights, np.zeros(len(queries), dtype=np.bool_)
        simplex = self._triangles.find_simplex(queries)
        inside = np.asarray(simplex >= 0)
        transform = self._triangles.transform[simplex[inside]]
        first = (transform[:, :2] @ (queries[inside] - transform[:, 2])[:, :, None])[:, :, 0]
        barycentric = np.clip(np.column_stack((first, 1.0 - first.sum(axis=1))), 0.0, 1.0)
        corners = self._triangles.simplices[simplex[inside]]
        weights[np.flatnonzero(inside)[:, None], corners] = barycentric / barycentric.sum(axis=1)[:, None]
        return weights, inside

    def _on_edge(self, queries: Array) -> Array:
        """Weights of the nearest point on an outer edge, for each query."""
        start, end = self._scaled[self._edges[:, 0]], self._scaled[self._edges[:, 1]]
        along = end - start
        t = np.sum((queries[:, None] - start) * along, axis=2) / np.sum(along**2, axis=1)
        t = np.clip(t, 0.0, 1.0)
        distance = np.linalg.norm(start + t[..., None] * along - queries[:, None], axis=2)
        every, best = np.arange(len(queries)), np.argmin(distance, axis=1)
        weights = np.zeros((len(queries), len(self._points)))
        weights[every[:, None], self._edges[best]] = np.column_stack((1.0 - t[every, best], t[every, best]))
        return weights


class _Cells(NamedTuple):
    """Nodes on both sides of each query, (m,); one and the same where there is but one."""

    below: Places
    above: Places


def _locate(nodes: Array, x: Array) -> tuple[_Cells, Array, Array]:
    """Cells, shares of their upper nodes, and queries (m,) moved to the nearest place within the nodes."""
    inside = np.clip(x, nodes[0], nodes[-1])
    below = np.clip(np.searchsorted(nodes, inside, side="right") - 1, 0, max(nodes.size - 2, 0))
    above = np.minimum(below + 1, nodes.size - 1)
    width = nodes[above] - nodes[below]
    return _Cells(below, above), (inside - nodes[below]) / np.where(width > 0.0, width, 1.0), inside


def _cell_curvature(nodes: Array, table: Array) -> Array:
    """Largest |second derivative| seen next to each cell, (cells, across, k); none below three nodes."""
    if nodes.size < 3:
        return np.zeros((0, *table.shape[1:]))
    step = np.diff(nodes)[:, None, None]
    slope = np.diff(table, axis=0) / step
    second = np.abs(2.0 * np.diff(slope, axis=0) / (step[1:] + step[:-1]))
    below, above = np.concatenate((second[:1], second)), np.concatenate((second, second[-1:]))
    return np.asarray(np.maximum(below, above))
