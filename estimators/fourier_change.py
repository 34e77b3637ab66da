"""Marks inside a block of the Fourier form, from which the block can be cut in two; compiled.

Transforms add up: with s = j omega, what a block from t0 to T holds since a mark at a is X(T) - e^{s (T - a)} X(a),
exactly, so a copy of the bank at a is all that is needed to tell the last seconds from what was before them.
"""

import numpy as np
from numba import njit

__all__ = ["MARKS", "place_mark", "since_mark"]

MARKS, MARK_S = 3, 1.0
"""Marks kept, and their distance: windows of up to three to four seconds are held against what was known before."""


@njit(cache=True)
def place_mark(  # type: ignore[no-untyped-def]
    bank,
    rows,
    sums,
    roughness,
    sensitivity,
    information,
    vector,
    driven,
    mark_bank,
    mark_rows,
    mark_sums,
    mark_known,
):
    """Copy the running block, and what it says, as the newest mark, if the last mark lies far enough back.

    Args:
        bank, rows, sums, roughness: the running block's.
        sensitivity, information, vector, driven: what it says of the derivatives, as its solution found it.
        mark_bank: (MARKS, channels, 2, frequencies); mark_rows: (MARKS, columns) the signal row there; mark_sums:
            (MARKS, sums + roughness); mark_known: (MARKS, k, 2 k + 2).
    """
    start, now = rows[0, 0], rows[1, 0]
    last = mark_rows[0, 0] if start <= mark_rows[0, 0] <= now else start
    if now - last < MARK_S - 1e-6:
        return
    for m in range(MARKS - 1, 0, -1):
        mark_bank[m], mark_rows[m], mark_sums[m] = mark_bank[m - 1], mark_rows[m - 1], mark_sums[m - 1]
        mark_known[m] = mark_known[m - 1]
    k = vector.size
    mark_bank[0] = bank
    mark_rows[0] = rows[1]
    mark_sums[0, : sums.size] = sums
    mark_sums[0, sums.size :] = roughness
    mark_known[0, :, :k] = sensitivity
    mark_known[0, :, k : 2 * k] = information
    mark_known[0, :, 2 * k] = vector
    mark_known[0, :, 2 * k + 1] = driven


@njit(cache=True)
def since_mark(omega, bank, rows, sums, roughness, mark_bank, mark_row, mark_sums):  # type: ignore[no-untyped-def]
    """The part of a running block since a mark, as a block of its own: bank, rows, sums, roughness.

    The row at the mark is not in the sums yet.
    """
    part, ends = bank.copy(), rows.copy()
    for f in range(omega.size):
        turn = np.exp(1j * omega[f] * (rows[1, 0] - mark_row[0]))
        for c in range(bank.shape[0]):
            past = turn * complex(mark_bank[c, 0, f], mark_bank[c, 1, f])
            part[c, 0, f] -= past.real
            part[c, 1, f] -= past.imag
    ends[0] = mark_row
    return part, ends, sums - mark_sums[: sums.size], roughness - mark_sums[sums.size :]
