"""Marks inside a block of the Fourier form, from which the block can be cut in two; compiled.

Transforms add up: with s = j omega, what a block from t0 to T holds since a mark at a is X(T) - e^{s (T - a)} X(a),
exactly, so a copy of the bank at a is all that is needed to tell the last seconds from what was before them.
"""

import math

from wingwatch.estimators.kernels.hot import lean

__all__ = ["MARKS", "copied", "copied_bank", "copied_rows", "place_mark", "since_mark"]

MARKS, MARK_S = 3, 1.0
"""Marks kept, and their distance: windows of up to three to four seconds are held against what was known before."""


@lean
def copied(source, target):  # type: ignore[no-untyped-def]
    """Copy a vector onto one of the same length."""
    for a in range(target.size):
        target[a] = source[a]


@lean
def copied_rows(source, target):  # type: ignore[no-untyped-def]
    """Copy a matrix onto one of the same shape."""
    for a in range(target.shape[0]):
        copied(source[a], target[a])


@lean
def copied_bank(source, target):  # type: ignore[no-untyped-def]
    """Copy a bank (channels, 2, frequencies) onto another."""
    for a in range(target.shape[0]):
        copied_rows(source[a], target[a])


@lean
def place_mark(  # type: ignore[no-untyped-def]
    bank, rows, sums, roughness, matrices, vectors, mark_bank, mark_rows, mark_sums, mark_known
):
    """Copy the running block, and what it says, as the newest mark, if the last mark lies far enough back.

    Args:
        bank, rows, sums, roughness: the running block's.
        matrices, vectors: what it says of the derivatives, as its solution found it: sensitivity and information;
            vector and driven part.
        mark_bank: (MARKS, channels, 2, frequencies); mark_rows: (MARKS, columns) the signal row there; mark_sums:
            (MARKS, sums + roughness); mark_known: (MARKS, k, 2 k + 2).
    """
    start, now = rows[0, 0], rows[1, 0]
    last = mark_rows[0, 0] if start <= mark_rows[0, 0] <= now else start
    if now - last < MARK_S - 1e-6:
        return
    for m in range(MARKS - 1, 0, -1):
        copied_bank(mark_bank[m - 1], mark_bank[m])
        copied(mark_rows[m - 1], mark_rows[m])
        copied(mark_sums[m - 1], mark_sums[m])
        copied_rows(mark_known[m - 1], mark_known[m])
    sensitivity, information = matrices
    vector, driven = vectors
    k = vector.size
    copied_bank(bank, mark_bank[0])
    copied(rows[1], mark_rows[0])
    for a in range(sums.size):
        mark_sums[0, a] = sums[a]
    for a in range(roughness.size):
        mark_sums[0, sums.size + a] = roughness[a]
    for a in range(k):
        for b in range(k):
            mark_known[0, a, b] = sensitivity[a, b]
            mark_known[0, a, k + b] = information[a, b]
        mark_known[0, a, 2 * k] = vector[a]
        mark_known[0, a, 2 * k + 1] = driven[a]


@lean
def since_mark(  # type: ignore[no-untyped-def]
    omega, bank, rows, sums, roughness, mark_bank, mark_row, mark_sums, part, ends, part_sums, part_roughness
):
    """The part of a running block since a mark, as a block of its own: bank, rows, sums, roughness become it.

    The row at the mark is not in the sums yet.
    """
    span = rows[1, 0] - mark_row[0]
    for f in range(omega.size):
        cos, sin = math.cos(omega[f] * span), math.sin(omega[f] * span)
        for c in range(bank.shape[0]):
            x, y = mark_bank[c, 0, f], mark_bank[c, 1, f]
            part[c, 0, f] = bank[c, 0, f] - (cos * x - sin * y)
            part[c, 1, f] = bank[c, 1, f] - (cos * y + sin * x)
    copied_rows(rows, ends)
    copied(mark_row, ends[0])
    for a in range(sums.size):
        part_sums[a] = sums[a] - mark_sums[a]
    for a in range(roughness.size):
        part_roughness[a] = roughness[a] - mark_sums[sums.size + a]
