"""Without a vane: when a block of the filter says something of the aircraft.

A reconstructed velocity sees no gust. What gusts do looks like changed derivatives, and a changed derivative looks like
gusts to the filter, which puts what it cannot explain down to the air. Two things tell them apart: the accelerometer
feels gusts and no fault, and a fault passes into the derivatives once these may have changed, while gusts stay gusts.
So the air has to be found calm by both first. From then on a block counts while the accelerometer feels nothing and the
filter puts little of the motion down to the air by the block's end.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import ModeStructure
from wingwatch.monitor.estimation.sizes import TYPICAL_CHANGE

__all__ = ["CALM_S", "follow_calm", "is_calm", "surface_moved"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CALM_S = 20.0
"""For so long both have to find the air calm: two blocks, one that is compared and one to compare it with."""


def follow_calm(calm_s: Array, time_s: Array, gusty: Flags, turned: Flags) -> Array:
    """Since when the air of some vehicles has been calm, (m,); NaN where it is not known to be.

    Args:
        calm_s: the same before, s.
        time_s: of the last samples, s.
        gusty: whose accelerometer feels gusts.
        turned: whose filter puts motion down to gusts.
    """
    found = is_calm(calm_s, time_s)
    lasting = np.where(time_s >= calm_s, calm_s, time_s)  # NaN, and a clock that was set back, begin now
    return np.asarray(np.where(gusty | (turned & ~found), np.nan, lasting))


def is_calm(calm_s: Array, time_s: Array) -> Flags:
    """Whose air has been found calm, (m,)."""
    return np.asarray(time_s - calm_s >= CALM_S)


KNOWN = TYPICAL_CHANGE
"""Fraction of its natural size to which a block alone tells each derivative that ``surface_moved`` asks for: that of a
change that is looked for. A doublet tells them to 2 to 15 %; where the other axis moves the aircraft, some of them
mostly stay at 50 % and more."""


def surface_moved(structure: ModeStructure, information: Array, natural: Array) -> bool:
    """Whether a surface of the mode has moved the aircraft in a block: stiffness, damping and control of a moment are
    distinguished by the block alone.

    Motion that no surface of the mode has caused is that of the other axis, through a velocity that nothing measures,
    or of the air: it is in no equation, and all that it moves is put down to too few derivatives.

    Args:
        information: of the block, (k, k); natural: size of each derivative, (k,).
    """
    known = np.linalg.inv(np.eye(natural.size) + information * (natural[:, None] * natural))
    ns = len(structure.states)
    variance = np.diagonal(known).reshape(ns, -1)
    variance = np.where(variance > 0.0, variance, np.inf)  # of a difference of two states of knowledge
    worst = [max(variance[e, 0], variance[e, e], variance[e, ns:].min()) for e in range(1, ns)]
    return bool(min(worst) < KNOWN**2)
