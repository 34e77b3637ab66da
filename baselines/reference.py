"""What an aircraft's own flights taught: normal equations that grow block by block.

A healthy flight yields blocks of independent estimates. Each block with covariance C and value x adds
its information C^-1 and C^-1 x; the sum is all that later flights need. Coordinates are American
non-dimensional (the affine form of ``wingwatch.aircraft``), so blocks of different airspeeds add up.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["MAX_CONDITION", "Reference", "posteriors"]

Array = NDArray[np.float64]

MAX_CONDITION = 1e8
"""Largest condition number (unit diagonal) at which flights alone count as an estimate: half of the sixteen
digits of a double are then still right, far more than any derivative's standard error needs."""

_ROUNDING = 1e-9
"""Asymmetry or negative eigenvalue, relative to the largest entry, that may come from rounding alone: an
inverse of a covariance with condition number 1e6 (its author's, not ours) has errors of about 1e6 eps."""

_NOTHING = float(np.finfo(np.float64).tiny / np.finfo(np.float64).eps)
"""Information that has been discounted to this is none: smaller numbers lose their digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Empirical normal equations of one structure of one aircraft, American non-dimensional coordinates.

    Attributes:
        information: J, shape (k, k), symmetric, positive semidefinite; zero before the first block.
        vector: h = J x, shape (k,).
        blocks: how many blocks were added.
        seconds: seconds of observable flight they rest on.
    """

    information: Array
    vector: Array
    blocks: int = 0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        information, vector = _checked(self.information, self.vector)
        if self.blocks < 0 or not (np.isfinite(self.seconds) and self.seconds >= 0.0):
            raise ValueError(
                f"a reference has blocks and seconds of 0 or more, got {self.blocks} and {self.seconds}"
            )
        object.__setattr__(self, "information", information)
        object.__setattr__(self, "vector", vector)

    @classmethod
    def empty(cls, k: int) -> Self:
        """The reference of an aircraft that has not flown yet, for k derivatives."""
        return cls(np.zeros((k, k)), np.zeros(k))

    def add(self, information: ArrayLike, vector: ArrayLike, seconds: float) -> "Reference":
        """One more block.

        Args:
            information: inverse covariance of the block's estimate, shape (k, k); may be singular.
            vector: ``information @ value``, shape (k,).
            seconds: of observable flight that the block rests on.

        Raises:
            ValueError: wrong shape, not finite, not symmetric, not positive semidefinite, negative seconds.
        """
        if not (np.isfinite(seconds) and seconds >= 0.0):
            raise ValueError(f"a block lasts 0 s or more, got {seconds}")
        block, h = _checked(information, vector)
        if h.shape != self.vector.shape:
            raise ValueError(f"a block of {h.size} derivatives cannot join a reference of {self.vector.size}")
        return Reference(self.information + block, self.vector + h, self.blocks + 1, self.seconds + seconds)

    def plus(self, other: "Reference") -> "Reference":
        """Both together, of different flights of one aircraft.

        Raises:
            ValueError: they are of different structures.
        """
        if self.vector.shape != other.vector.shape:
            raise ValueError(
                f"references of {self.vector.size} and of {other.vector.size} derivatives do not add up"
            )
        return Reference(
            self.information + other.information, self.vector + other.vector,
            self.blocks + other.blocks, self.seconds + other.seconds,
        )  # fmt: skip

    def posterior(self, prior_value: ArrayLike, prior_covariance: ArrayLike) -> tuple[Array, Array]:
        """Expectation after the flights, from the one before: Gaussian prior times Gaussian blocks.

        It is that of ``posteriors`` with its arguments checked.

        Args:
            prior_value: shape (k,), American non-dimensional.
            prior_covariance: shape (k, k).

        Returns:
            value (k,), covariance (k, k), symmetric and positive semidefinite.

        Raises:
            ValueError: wrong shape, not finite, not symmetric, not positive semidefinite.
        """
        covariance, value = _symmetric(prior_covariance, prior_value)
        if value.shape != self.vector.shape:
            raise ValueError(
                f"a prior of {value.size} derivatives cannot meet a reference of {self.vector.size}"
            )
        unit, _ = _unit_diagonal(covariance)
        _demand_semidefinite(np.linalg.eigvalsh(unit))
        return posteriors(value, covariance, self.information, self.vector)

    def estimate(self) -> tuple[Array, Array] | None:
        """Value (k,) and covariance (k, k) from the flights alone; None while they do not determine all k.

        Determined means: scaled to unit diagonal, the condition number of J is at most ``MAX_CONDITION``.
        """
        diagonal = np.diagonal(self.information)
        if not np.all(diagonal > 0.0):
            return None
        scale = 1.0 / np.sqrt(diagonal)
        w, u = np.linalg.eigh(self.information * np.outer(scale, scale))
        if w[0] * MAX_CONDITION < w[-1]:
            return None
        root = scale[:, None] * u / np.sqrt(w)
        return root @ (root.T @ self.vector), root @ root.T

    def to_dict(self) -> dict[str, Any]:
        """Plain lists and numbers."""
        return {
            "information": self.information.tolist(),
            "vector": self.vector.tolist(),
            "blocks": self.blocks,
            "seconds": self.seconds,
        }

    @classmethod
    def from_dict(cls, data: Any) -> Self:
        """Inverse of ``to_dict``."""
        keys = {"information", "vector", "blocks", "seconds"}
        if not isinstance(data, dict) or set(data) != keys:
            raise ValueError(f"a reference has the keys {', '.join(sorted(keys))}, got {data!r:.80}")
        try:
            return cls(
                np.array(data["information"], dtype=np.float64),
                np.array(data["vector"], dtype=np.float64),
                int(data["blocks"]),
                float(data["seconds"]),
            )
        except TypeError as error:
            raise ValueError(f"a reference holds numbers only: {error}") from error


def _checked(matrix: ArrayLike, vector: ArrayLike) -> tuple[Array, Array]:
    """Both as read-only arrays, the matrix exactly symmetric and semidefinite but for rounding."""
    symmetric, v = _symmetric(matrix, vector)
    unit, _ = _unit_diagonal(symmetric)
    if unit.size:
        _demand_semidefinite(np.linalg.eigvalsh(unit))
    return symmetric, v


def _symmetric(matrix: ArrayLike, vector: ArrayLike) -> tuple[Array, Array]:
    """Both as read-only arrays, the matrix exactly symmetric."""
    m = np.array(matrix, dtype=np.float64)
    v = np.array(vector, dtype=np.float64)
    if v.ndim != 1 or m.shape != (v.size, v.size):
        raise ValueError(f"a matrix (k, k) and a vector (k,) are needed, got {m.shape} and {v.shape}")
    if not (np.isfinite(m).all() and np.isfinite(v).all()):
        raise ValueError("matrix and vector must be finite; leave out a block that holds NaN or infinity")
    if np.array_equal(m, m.T):
        symmetric = m
    else:
        unit, _ = _unit_diagonal(m)
        if float(np.abs(unit - unit.T).max()) > _ROUNDING:
            raise ValueError("the matrix must be symmetric")
        symmetric = 0.5 * (m + m.T)
    symmetric.setflags(write=False)
    v.setflags(write=False)
    return symmetric, v


def _unit_diagonal(m: Array) -> tuple[Array, Array]:
    """The matrix (k, k) scaled to unit diagonal, and the roots of its diagonal, (k,), 1 where there is next to nothing.

    Raises:
        ValueError: an entry of the diagonal is negative.
    """
    diagonal = np.diagonal(m)
    if (diagonal < -_NOTHING).any():
        raise ValueError(f"the matrix has a negative diagonal entry, {diagonal.min():.6g}")
    scale = np.sqrt(np.where(diagonal > _NOTHING, diagonal, 1.0))
    return m / (scale[:, None] * scale), scale


def _demand_semidefinite(eigenvalues: NDArray[Any]) -> None:
    """Those of a matrix of unit diagonal, rising."""
    if float(eigenvalues[0]) < -_ROUNDING * eigenvalues.size:
        raise ValueError("the matrix must be positive semidefinite")


def posteriors(value: Array, covariance: Array, information: Array, vector: Array) -> tuple[Array, Array]:
    """Gaussian priors times Gaussian blocks, each on its own: axes (...) in front of those below.

    With P = L L' and the eigenvalues w of L' J L, the posterior covariance is L U diag(1/(1+w)) U' L'. Neither P nor J
    is ever inverted, so both may be singular: what no flight excited stays at the prior, what the prior holds fixed
    stays fixed.

    Args:
        value: of the prior, (k,).
        covariance: P, symmetric and positive semidefinite but for rounding, (k, k).
        information: J likewise.
        vector: h = J x, (k,).

    Returns:
        value (..., k), covariance (..., k, k), symmetric and positive semidefinite.
    """
    flown = np.any(information, axis=(-2, -1), keepdims=True)
    if not flown.any():
        return value, covariance
    diagonal = np.diagonal(covariance, axis1=-2, axis2=-1)
    scale = np.sqrt(np.where(diagonal > _NOTHING, diagonal, 1.0))
    w, u = np.linalg.eigh(covariance / (scale[..., :, None] * scale[..., None, :]))
    root = scale[..., None] * u * np.sqrt(np.maximum(w, 0.0))[..., None, :]
    w, u = np.linalg.eigh(np.swapaxes(root, -1, -2) @ information @ root)
    shrunk = (root @ u) / np.sqrt(1.0 + np.maximum(w, 0.0))[..., None, :]
    turned = np.swapaxes(shrunk, -1, -2)
    residual = vector - np.squeeze(information @ value[..., None], -1)
    shifted = value + np.squeeze(shrunk @ (turned @ residual[..., None]), -1)
    return np.where(flown[..., 0], shifted, value), np.where(flown, shrunk @ turned, covariance)
