"""Kernels of the Fourier form with the memory that they ask of their caller, for tests of one of them at a time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.fourier import bank as transforms
from wingwatch.estimators.fourier import between, change, marks
from wingwatch.estimators.fourier.directions import DIRECTION_LINES, DIRECTION_SQUARES, reduce_information
from wingwatch.estimators.fourier.forgetting import FORGETTING_LINES, FORGETTING_SQUARES, replaced

Array = NDArray[np.float64]
Real = NDArray[np.floating[Any]]


def reduced(
    m: Real, noise: Real, suspected: Real, score: Real, driven: Real, smallest: float
) -> tuple[list[Array], list[Array]]:
    """``reduce_information``: sensitivity, kept, evidence; then score, driven part, evidence's score and bias."""
    p = len(m)
    vectors, matrices = [np.empty(p) for _ in range(4)], [np.empty((p, p)) for _ in range(3)]
    squares, lines = np.empty((DIRECTION_SQUARES, p, p)), np.empty((DIRECTION_LINES, p))
    reduce_information(
        m,
        noise,
        suspected,
        score,
        driven,
        smallest,
        squares,
        lines,
        np.empty((p, 2)),
        tuple(vectors),
        tuple(matrices),
    )
    return matrices, vectors


def left_by(reserve: Real, known: Real, gained: Real, share: float) -> Array:
    """``replaced``: what a reserve is multiplied by."""
    k = len(known)
    squares, lines, out = (
        np.empty((FORGETTING_SQUARES, k, k)),
        np.empty((FORGETTING_LINES, k)),
        np.empty((k, k)),
    )
    replaced(reserve, known, gained, share, squares, lines, out)
    return out


def change_of(window: Real, vector: Real, mean: Real, covariance: Real) -> tuple[Array, Array]:
    """``change.change_of``: K and pull."""
    k = len(mean)
    weight, pull = np.empty((k, k)), np.empty(k)
    change.change_of(window, vector, mean, covariance, np.empty((k, k)), np.empty((k, k + 1)), weight, pull)
    return weight, pull


def changed_derivatives(
    weight: Real, pull: Real, size: Real, threshold: float, changed: NDArray[np.bool_]
) -> float:
    """``change.changed_derivatives`` that asks of every derivative."""
    k = len(pull)
    room = np.empty((k, k)), np.empty((k, k + 1)), np.empty(k)
    return float(change.changed_derivatives(weight, pull, size, threshold, 0.0, *room, changed))


def free_memory(
    sensitivity: Real,
    information: Real,
    vector: Real,
    driven: Real,
    size: Real,
    changed: NDArray[np.bool_],
) -> None:
    """``change.free_memory``."""
    k = len(vector)
    change.free_memory(sensitivity, information, vector, driven, size, changed, np.empty(k), np.empty(k))


def since_mark(
    omega: Real, bank: Real, rows: Real, sums: Real, roughness: Real, mark: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """``marks.since_mark``: bank and rows of the part."""
    part, ends = np.empty(bank.shape), np.empty(rows.shape)
    marks.since_mark(
        omega, bank, rows, sums, roughness, *mark, part, ends, np.empty_like(sums), np.empty_like(roughness)
    )
    return part, ends


def transforms_of(omega: Real, bank: Real, span: float, ns: int, nu: int) -> tuple[Array, Array]:
    """``bank.block_transforms``: (channels, 2, frequencies), phase (2, frequencies); span smoothed 0.1 s."""
    out = np.empty((len(bank) + transforms.NUISANCE - 1, 2, omega.size))
    phase = np.empty((2, omega.size))
    transforms.block_transforms(omega, bank, span, 0.1, ns, nu, out, phase)
    return out, phase


def curves_of(
    omega: Real, lines: Real, phase: Real, rows: Real, dt: float, servo_s: Real, theta: Real, forward: Real,
    lever_m: float,
) -> Array:  # fmt: skip
    """``between.between_samples`` of two states and one input, the force seen ``lever_m`` ahead of the c.g."""
    out, room, lever = np.empty(lines.shape), np.empty((2, 3, 2, omega.size)), np.array([0.0, lever_m])
    between.between_samples(
        omega, lines, phase, rows[0], rows[-1], dt, servo_s, theta, np.ones(6), forward, lever, 2, 1,
        room, out,
    )  # fmt: skip
    return out


def as_complex(planar: Real) -> NDArray[np.complex128]:
    """(channels, 2, frequencies), or (2, frequencies), as complex (frequencies, channels) or (frequencies,)."""
    return np.asarray(np.moveaxis(planar[..., 0, :] + 1j * planar[..., 1, :], 0, -1))
