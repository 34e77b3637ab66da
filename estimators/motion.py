"""How strongly an aircraft moves, and the share of it from which on the air counts as rough; compiled.

Air that turns and rolls an aircraft acts within the same block as the aircraft's answer to it, and the autopilot's. A
transform of the block knows no before and after: of the rate's variance the share that the air causes is, to first
order, the share by which the Fourier form's damping, and with it the other moment derivatives, come out too small.
"""

import numpy as np
from numba import njit

__all__ = ["ROUGH_SHARE", "gather_motion"]

ROUGH_SHARE = 0.1
"""Share of a rate's variance from which on the air is rough: the Fourier form's moment derivatives are off as much."""


@njit(cache=True)
def gather_motion(motion, signals, memory_s):  # type: ignore[no-untyped-def]
    """Running mean and mean square of the measured states of one vehicle, sample by sample, in place.

    Args:
        motion: (3, ns): means, mean squares, and the last time in the third row's first place; NaN at the start.
        signals: (samples, columns) from ``Signals``.
        memory_s: time constant.
    """
    ns = motion.shape[1]
    for k in range(signals.shape[0]):
        row = signals[k]
        complete = True
        for j in range(1 + ns):
            complete = complete and np.isfinite(row[j])
        if not complete:
            continue
        weight = 1.0
        if np.isfinite(motion[2, 0]):
            weight = 1.0 - np.exp(-max(row[0] - motion[2, 0], 0.0) / memory_s)
        for j in range(ns):
            before, square = (motion[0, j], motion[1, j]) if weight < 1.0 else (0.0, 0.0)
            motion[0, j] = before + weight * (row[1 + j] - before)
            motion[1, j] = square + weight * (row[1 + j] * row[1 + j] - square)
        motion[2, 0] = row[0]
