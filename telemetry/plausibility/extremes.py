"""Sensors that pile up at an extreme, or stay as they are."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.plausibility.finding import Finding, Verdict
from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNELS

__all__ = ["clipped_findings", "stuck_findings"]

Array = NDArray[np.float64]

_CLIPPED = (
    "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_x_m_s2", "specific_force_y_m_s2",
    "specific_force_z_m_s2", "angle_of_attack_rad", "sideslip_rad",
)  # fmt: skip
_STUCK = (*_CLIPPED, "roll_rad", "pitch_rad", "airspeed_true_m_s")
_LEAST_PILED, _LEAST_VISITS, _MORE = 8, 3, 4
"""Readings at an extreme, times that it was reached, and how many times as many there are as at the next value."""
_LONG_S, _LONG_HOLDS = 10.0, 20.0
"""A reading that stays for so long, and for so many times as long as it usually does, is stuck."""


def clipped_findings(columns: Mapping[str, Array]) -> list[Finding]:
    """Gyros, accelerometers and vanes with a limit that readings pile up at."""
    found = []
    for name in _CLIPPED:
        values = columns.get(name)
        if values is None:
            continue
        at = [float(values.max())] if _is_piled(values) else []
        at += [float(values.min())] if _is_piled(-values) else []
        if not at:
            continue
        rows = np.flatnonzero(np.isin(values, at))
        time_s, unit = columns["time_s"], CHANNELS[CHANNEL_INDEX[name]].unit
        said = " and ".join(f"{v:.4g}" for v in at)
        text = (
            f"{name} is clipped at {said} {unit}: {rows.size} readings from {time_s[rows[0]]:.1f} to "
            f"{time_s[rows[-1]]:.1f} s are at its limit"
        )
        found.append(Finding(Verdict.WARNING, name, "clipped", at[0], 0.0, unit, text))
    return found


def _is_piled(values: Array) -> bool:
    """Whether readings pile up at the largest value."""
    top = float(values.max())
    at = values == top
    count = int(np.count_nonzero(at))
    if count < _LEAST_PILED or count == values.size:
        return False
    visits = int(np.count_nonzero(np.diff(at.astype(np.int8)) == 1)) + int(at[0])
    below = float(values[~at].max())
    few = int(np.count_nonzero(values == below))
    return visits >= _LEAST_VISITS and count > _MORE * few


def stuck_findings(columns: Mapping[str, Array]) -> list[Finding]:
    """Readings that stay to the last bit while the aircraft moves."""
    time_s = columns["time_s"]
    found = []
    for name in _STUCK:
        values = columns.get(name)
        if values is None or values.size < 2:
            continue
        edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1, [values.size]])
        lengths = time_s[edges[1:] - 1] - time_s[edges[:-1]]
        longest = int(np.argmax(lengths))
        usual = float(np.median(np.delete(lengths, longest))) if lengths.size > 1 else 0.0
        if lengths[longest] < max(_LONG_S, _LONG_HOLDS * usual):
            continue
        first, last = time_s[edges[longest]], time_s[edges[longest + 1] - 1]
        unit = CHANNELS[CHANNEL_INDEX[name]].unit
        value = float(values[edges[longest]])
        text = f"{name} stays at {value:.4g} {unit} from {first:.1f} to {last:.1f} s: a stuck sensor or a dead link"
        found.append(Finding(Verdict.WARNING, name, "stuck", value, 0.0, unit, text))
    return found
