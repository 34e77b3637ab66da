"""All checks of a flight's channels against one another, before anything is estimated.

They are after units, signs, exchanged axes, missing gravity and repeated readings: factors of -1, 57.3, 9.81 or 0. A
scale that is off by a tenth, a bias or a late channel is the monitor's to find. Nothing is decided where the flight
does not show it.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry.maps import ChannelEntry
from wingwatch.telemetry.plausibility.attitude import attitude_findings
from wingwatch.telemetry.plausibility.extremes import clipped_findings, stuck_findings
from wingwatch.telemetry.plausibility.finding import Finding, Verdict
from wingwatch.telemetry.plausibility.forces import gravity_findings, turn_findings
from wingwatch.telemetry.plausibility.holds import Hold, hold_of
from wingwatch.telemetry.plausibility.lift import lift_findings
from wingwatch.telemetry.plausibility.lines import Lines
from wingwatch.telemetry.plausibility.response import response_findings
from wingwatch.telemetry.sample import LEAPING_CHANNELS, SampleBlock

__all__ = ["check_flight"]

Array = NDArray[np.float64]

_MOTION = (
    "time_s", "airspeed_true_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_x_m_s2",
    "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad", "altitude_m",
)  # fmt: skip
_BESIDE = (
    "heading_rad", "angle_of_attack_rad", "sideslip_rad", "elevator_rad", "aileron_rad", "rudder_rad",
    "air_density_kg_m3",
)  # fmt: skip
_AIRSPEED = "airspeed_true_m_s"
_SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")
_VANES = ("angle_of_attack_rad", "sideslip_rad")
_RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
_SENSORS = (*_VANES, *_RATES, *(name for name in _MOTION if "force" in name))
_HARDLY = 0.05
"""Fraction of rows without a reading from which on an optional channel is not looked at."""
_SLOWEST_S = 0.11
_LEAST_HZ, _SLOW_HZ = 9.0, 30.0
"""True rates below which a held channel helps nobody, and below which it comes late by what matters: autopilots command
at 50 Hz, in tables of any rate."""
_LEAST_ROWS = 200


def check_flight(
    block: SampleBlock,
    kinds: Mapping[str, str],
    aircraft: Aircraft | None = None,
    entries: Mapping[str, ChannelEntry] | None = None,
) -> tuple[Finding, ...]:
    """Every channel that shows something, the refusals first.

    Args:
        block: clean samples.
        kinds: ``position`` or ``command`` of the surfaces.
        aircraft: whose lift and surfaces are known; without one they are not judged.
        entries: by channel, what the user's map says.
    """
    columns = _columns(block)
    time_s = columns["time_s"]
    if time_s.size < _LEAST_ROWS or not 0.0 < float(np.median(np.diff(time_s))) < _SLOWEST_S:
        return ()
    lines = Lines(entries or {})
    stated_s = {} if aircraft is None else aircraft.sensors.delay_s
    stuck = stuck_findings(columns)
    frozen = any(one.channel == _AIRSPEED for one in stuck)
    found = attitude_findings(columns, lines, stated_s)
    wrong = _refused(found)
    # each check rests on what the ones before it found right, so that one cause is one finding
    if not wrong & {"roll_rad", "pitch_rad"}:
        found += gravity_findings(columns, lines)
        if not _refused(found) and not frozen:
            found += turn_findings(columns, lines)
    if "specific_force_z_m_s2" not in _refused(found):
        known = frozen or any(one.channel == _AIRSPEED for one in found)
        found += lift_findings(columns, None if known else aircraft, lines)
    held = _held(columns)
    if aircraft is not None and not _refused(found) & {*_RATES, *_VANES, _AIRSPEED}:
        right = {one.channel for one in found if one.check == "slope" and one.standing is Verdict.RIGHT}
        moving = {name: c for name, c in columns.items() if name not in held}
        if right <= set(moving):
            found += response_findings(moving, right, kinds, aircraft, lines)
    found += [*_held_findings(held, kinds, lines), *clipped_findings(columns), *stuck]
    order = (Verdict.REFUSAL, Verdict.WARNING, Verdict.RIGHT)
    return tuple(sorted(found, key=lambda one: order.index(one.standing)))


def _refused(found: list[Finding]) -> set[str]:
    return {one.channel for one in found if one.standing is Verdict.REFUSAL}


def _columns(block: SampleBlock) -> dict[str, Array]:
    """Channels on the rows that have all of them; an optional channel that hardly is there is none."""
    present = set(block.present)
    names = [name for name in _MOTION if name in present]
    if len(names) < len(_MOTION):
        return {"time_s": np.empty(0)}
    values = {name: block.column(name) for name in (*names, *(n for n in _BESIDE if n in present))}
    whole = np.logical_and.reduce([np.isfinite(values[name]) for name in names])
    for name in [n for n in values if n in _BESIDE]:
        there = np.isfinite(values[name])
        if float(np.mean(there)) < 1.0 - _HARDLY:
            del values[name]
        else:
            whole &= there
    rows = _longest_clock(values["time_s"], np.flatnonzero(whole))
    columns = {name: np.asarray(column[rows]) for name, column in values.items()}
    return {name: np.unwrap(c) if name in LEAPING_CHANNELS else c for name, c in columns.items()}


def _longest_clock(time_s: Array, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of the rows the longest part whose stamps rise: a clock may have been set back in flight."""
    back = np.flatnonzero(np.diff(time_s[rows]) <= 0.0) + 1
    return max(np.split(rows, back), key=len) if back.size else rows


def _held(columns: Mapping[str, Array]) -> dict[str, Hold]:
    """Surfaces and sensors of the fast motion that repeat each reading."""
    held = {n: hold_of(columns["time_s"], columns[n]) for n in (*_SURFACES, *_SENSORS) if n in columns}
    return {name: hold for name, hold in held.items() if hold is not None and hold.rate_hz < _SLOW_HZ}


def _held_findings(held: Mapping[str, Hold], kinds: Mapping[str, str], lines: Lines) -> list[Finding]:
    """One finding for the surfaces together, whose line takes the rows of the slowest, and one for the sensors."""
    found = []
    for group, standing in ((_SURFACES, Verdict.REFUSAL), (_SENSORS, Verdict.WARNING)):
        names = [name for name in held if name in group]
        if not names:
            continue
        slowest = min(names, key=lambda name: held[name].rate_hz)
        hold = held[slowest]
        text = (
            f"{' and '.join(names)} repeat each value, {slowest} for {hold.rows:.3g} rows ({hold.rate_hz:.3g} Hz in "
            f"a table of {hold.table_hz:.3g} Hz), and so come late"
        )
        command = slowest.removesuffix("_rad") + "_command_rad"
        clock = command if kinds.get(slowest) == "command" and slowest not in lines.entries else slowest
        line = f'clock = "{clock}"'
        if hold.rate_hz < _LEAST_HZ:
            text, line = f"{text}: too slow for these modes (10 Hz at least), log them faster", ""
        found.append(Finding(standing, slowest, "held", hold.rate_hz, 0.0, "Hz", text, line))
    return found
