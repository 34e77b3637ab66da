"""Derivatives about another centre of gravity: forces keep their places, moments and motions are carried over.

With the new centre a distance d aft of the old one, the old one moves through the air with v + d r and w - d q where
the new one moves with v and w, and forces Y and Z at the old one have the moments d Y and -d Z about the new one. Both
hold exactly, at any angle of attack.
"""

from collections.abc import Mapping

from wingwatch.aircraft.structures import ModeStructure

__all__ = ["about_centre"]


def about_centre(
    dimensional: Mapping[str, float], structure: ModeStructure, aft_m: float, yaw_gain: float = 1.0
) -> dict[str, float]:
    """Dimensional derivatives about a centre of gravity that lies ``aft_m`` behind the one they are about.

    Args:
        dimensional: every derivative of the structure by its concise symbol, ``Convention.DIMENSIONAL``.
        structure: the mode's structure.
        aft_m: m along x body, positive aft.
        yaw_gain: by how much a yawing moment counts in the ``n`` row: 1, but for a structure without a roll row,
            whose yaw moments are the effective ones (``affine``): I_x I_z / (I_x I_z - I_xz^2).
    """
    out = dict(dimensional)
    states = structure.regressors
    for row in structure.equations:
        if "q" in states and "w" in states:
            out[f"{row}_q"] -= aft_m * out[f"{row}_w"]
        if "r" in states and "v" in states:
            out[f"{row}_r"] += aft_m * out[f"{row}_v"]
    for regressor in states:
        if "m" in structure.equations:
            out[f"m_{regressor}"] -= aft_m * out[f"z_{regressor}"]
        if "n" in structure.equations and "y" in structure.equations:
            out[f"n_{regressor}"] += aft_m * yaw_gain * out[f"y_{regressor}"]
    return out
