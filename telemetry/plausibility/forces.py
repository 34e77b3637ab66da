"""Specific forces against gravity and turns, and the airspeed that turns need.

Turned into earth axes by the attitude, the mean specific force of a flight is minus gravity, whatever the air: what is
left is the change of vertical speed over the flight, divided by its length. In a turn

    a_y + g cos(theta) sin(phi) = k (r V - p V sin(theta)) + dv/dt

with k the factor from the recorded airspeed to the true one; dv/dt is noise, for sideslip ends about where it began.
The bank is the instrument, k = sum(bank force) / sum(bank turn): yaw rates that gusts make go with no bank, so they do
not make k too small.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.telemetry.plausibility.airspeed_units import unit_of_airspeed
from wingwatch.telemetry.plausibility.finding import Finding, Verdict
from wingwatch.telemetry.plausibility.lines import Lines
from wingwatch.telemetry.plausibility.spans import Spans

__all__ = ["gravity_findings", "turn_findings"]

Array = NDArray[np.float64]

_LEAST_S = 20.0
_MEAN_S = 5.0
_TURN_S = 8.0
_LEAST_BANK, _LEAST_TURNS, _LEAST_SPANS = 0.2, 3, 10
"""Mean sine of the bank in a span of turns, and how many such spans and how many of all kinds there must be."""
_KNOWN, _EXPLAINED = 0.05, 0.9
_GUSTS = 0.05
"""Relative error of the factor that gusts make beside what spans show of it."""
_AT_REST, _IN_G, _NEAR = 0.5, 0.4, 2.5
"""How near the mean must be to 0, to 1 g in g, and to 9.81 m/s2, in m/s2."""
_WIDE, _NARROW = 0.6, 0.1
"""Largest standard errors of a mean near 0 and of one near 1, which in g hardly scatters."""
_Z = "specific_force_z_m_s2"


def gravity_findings(columns: Mapping[str, Array], lines: Lines) -> list[Finding]:
    """Sign and unit of the vertical accelerometer, and whether gravity is in it.

    Args:
        columns: finite, (n,) each.
        lines: writes lines of the map.
    """
    spans = Spans.of(columns["time_s"], _MEAN_S)
    if float(np.sum(spans.length_s)) < _LEAST_S:
        return []
    down = _down(columns)
    means = spans.mean(down)
    mean = float(np.mean(means))
    # a span's mean is the change of vertical speed over its length, so neighbours take from each other
    error = float(np.std(means, ddof=1) / np.sqrt(means.size)) + 0.05
    if error > 1.0:
        return []
    said = f"mean specific force along the vertical is {mean:.2f} ± {error:.1g} m/s2 (-9.81 is right)"
    measured = ("gravity", mean, error, "m/s2")
    if abs(mean + GRAVITY_M_S2) < _NEAR:
        return [Finding(Verdict.RIGHT, _Z, *measured, said)]
    if abs(mean - GRAVITY_M_S2) < _NEAR:
        text = f"{said}: {_Z} is positive up"
        return [Finding(Verdict.REFUSAL, _Z, *measured, text, lines.turned(_Z))]
    if abs(mean) < _AT_REST and error < _WIDE:
        text = f"{said}: gravity has been taken out of the accelerometers"
        return [Finding(Verdict.REFUSAL, _Z, *measured, text, lines.with_gravity())]
    if abs(abs(mean) - 1.0) < _IN_G and error < _NARROW:
        up = mean > 0.0
        text = f"{said}: {_Z} is in g" + (" and positive up" if up else "")
        written = [lines.in_unit(f"specific_force_{axis}_m_s2", "g") for axis in ("x", "y")]
        written.append(lines.in_unit(_Z, "g", -1.0 if up else 1.0))
        return [Finding(Verdict.REFUSAL, _Z, *measured, text, "\n".join(written))]
    return [Finding(Verdict.WARNING, _Z, *measured, f"{said}: it does not carry the weight")]


def _down(columns: Mapping[str, Array]) -> Array:
    """Specific force along the vertical, down positive."""
    x, y, z = (columns[f"specific_force_{axis}_m_s2"] for axis in "xyz")
    roll, pitch = columns["roll_rad"], columns["pitch_rad"]
    across = np.sin(roll) * y + np.cos(roll) * z
    return np.asarray(-np.sin(pitch) * x + np.cos(pitch) * across)


def turn_findings(columns: Mapping[str, Array], lines: Lines) -> list[Finding]:
    """Unit of the airspeed, from turns. Rates, attitude and accelerometers are right.

    Args:
        columns: finite, (n,) each.
        lines: writes lines of the map.
    """
    spans = Spans.of(columns["time_s"], _TURN_S)
    speed, roll, pitch = (columns[name] for name in ("airspeed_true_m_s", "roll_rad", "pitch_rad"))
    rate = columns["yaw_rate_rad_s"] - columns["roll_rate_rad_s"] * np.sin(pitch)
    turn, bank = spans.integral(rate * speed), spans.integral(GRAVITY_M_S2 * np.cos(pitch) * np.sin(roll))
    force = spans.integral(columns["specific_force_y_m_s2"]) + bank
    turning = np.abs(bank) > _LEAST_BANK * GRAVITY_M_S2 * _TURN_S
    if len(turn) < _LEAST_SPANS or int(np.count_nonzero(turning)) < _LEAST_TURNS:
        return []
    slope = float(bank @ turn)
    if slope == 0.0:
        return []
    factor = float(bank @ force) / slope
    left = force - factor * turn
    error = float(np.sqrt(np.sum((bank * left) ** 2))) / abs(slope)
    if not 0.0 < error < _KNOWN * factor or float(np.sum(left**2)) > (1.0 - _EXPLAINED) * float(
        np.sum(force**2)
    ):
        return []
    return unit_of_airspeed(factor, float(np.hypot(error, _GUSTS * factor)), "turns", lines)
