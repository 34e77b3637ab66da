"""Checkpoints inside a block of the Fourier estimator, from which the block can be cut in two; compiled.

Transforms add up: with s = j omega, what a block from t0 to T holds since a checkpoint at a is X(T) - e^{s (T - a)}
X(a), exactly, so a copy of the bank at a is all that is needed to tell the last seconds from what was before them.
"""

import math

from wingwatch.estimators.fourier.state import LAST, START, TIME
from wingwatch.kernels.decorators import lean

__all__ = [
    "CHECKPOINTS",
    "copy_bank",
    "copy_matrix",
    "copy_vector",
    "place_checkpoint",
    "since_checkpoint",
]

CHECKPOINTS, CHECKPOINT_S = 3, 1.0
"""Checkpoints kept, and their distance: windows of up to three to four seconds are compared with what was known
before."""


@lean
def copy_vector(source, target):  # type: ignore[no-untyped-def]
    """Copy a vector onto one of the same length."""
    for a in range(target.size):
        target[a] = source[a]


@lean
def copy_matrix(source, target):  # type: ignore[no-untyped-def]
    """Copy a matrix onto one of the same shape."""
    for a in range(target.shape[0]):
        copy_vector(source[a], target[a])


@lean
def copy_bank(source, target):  # type: ignore[no-untyped-def]
    """Copy a bank (channels, 2, bins) onto another."""
    for a in range(target.shape[0]):
        copy_matrix(source[a], target[a])


@lean
def place_checkpoint(block, gained, checkpoints):  # type: ignore[no-untyped-def]
    """Copy the running block, and what it adds to the memory, as the newest checkpoint, if the last one lies far
    enough back."""
    start, now, newest = block.rows[START, TIME], block.rows[LAST, TIME], checkpoints.rows[0, TIME]
    last = newest if start <= newest <= now else start
    if now - last < CHECKPOINT_S - 1e-6:
        return
    known = checkpoints.gained
    for m in range(CHECKPOINTS - 1, 0, -1):
        copy_bank(checkpoints.bank[m - 1], checkpoints.bank[m])
        copy_vector(checkpoints.rows[m - 1], checkpoints.rows[m])
        copy_vector(checkpoints.sums[m - 1], checkpoints.sums[m])
        copy_vector(checkpoints.roughness[m - 1], checkpoints.roughness[m])
        copy_matrix(known.sensitivity[m - 1], known.sensitivity[m])
        copy_matrix(known.information[m - 1], known.information[m])
        copy_vector(known.vector[m - 1], known.vector[m])
        copy_vector(known.bias[m - 1], known.bias[m])
    copy_bank(block.bank, checkpoints.bank[0])
    copy_vector(block.rows[LAST], checkpoints.rows[0])
    copy_vector(block.sums, checkpoints.sums[0])
    copy_vector(block.roughness, checkpoints.roughness[0])
    copy_matrix(gained.sensitivity, known.sensitivity[0])
    copy_matrix(gained.information, known.information[0])
    copy_vector(gained.vector, known.vector[0])
    copy_vector(gained.bias, known.bias[0])


@lean
def since_checkpoint(omega, block, checkpoints, m, window):  # type: ignore[no-untyped-def]
    """The part of a running block since checkpoint m, as a block of its own: ``window`` becomes it.

    The row at the checkpoint is not in its sums yet.
    """
    bank, earlier, part = block.bank, checkpoints.bank[m], window.bank
    span = block.rows[LAST, TIME] - checkpoints.rows[m, TIME]
    for f in range(omega.size):
        cos, sin = math.cos(omega[f] * span), math.sin(omega[f] * span)
        for c in range(bank.shape[0]):
            x, y = earlier[c, 0, f], earlier[c, 1, f]
            part[c, 0, f] = bank[c, 0, f] - (cos * x - sin * y)
            part[c, 1, f] = bank[c, 1, f] - (cos * y + sin * x)
    copy_matrix(block.rows, window.rows)
    copy_vector(checkpoints.rows[m], window.rows[START])
    for a in range(window.sums.size):
        window.sums[a] = block.sums[a] - checkpoints.sums[m, a]
    for a in range(window.roughness.size):
        window.roughness[a] = block.roughness[a] - checkpoints.roughness[m, a]
