"""Tables whose rows hold only some channels, as logs of several topics in one table have them: joined on one clock."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.vocabulary import SURFACES
from wingwatch.telemetry.sample import LEAPING_CHANNELS, MAX_GAP_S
from wingwatch.telemetry.shown_later import SAME_STAMP_S

__all__ = ["DEFAULT_CLOCK", "is_sparse", "join_rates", "slowest_clock", "without_slow_vanes"]

Array = NDArray[np.float64]

DEFAULT_CLOCK = "pitch_rate_rad_s"
"""Channel whose stamps the table takes, where no vane or surface is slower: that of the angular rates."""

_VANES = ("angle_of_attack_rad", "sideslip_rad")
_LEAST_HZ = 8.0
"""Of a clock: below it the modes of interest are not resolved."""

_WHOLE = 0.5
_FASTER = 1.5


def is_sparse(columns: Mapping[str, Array], required: Sequence[str], clock: str) -> bool:
    """Whether less than half of the rows that have the clock's channel have the others that are required, although
    each of them is somewhere in the table.

    Args:
        columns: by channel, (rows,) each, ``time_s`` among them.
        required: channels without which a row is of no use.
        clock: one of them.
    """
    there = [name for name in required if name in columns]
    if clock not in columns or not all(np.isfinite(columns[name]).any() for name in there):
        return False
    rows = np.isfinite(columns[clock])
    whole = np.logical_and.reduce([np.isfinite(columns[name][rows]) for name in there])
    return float(np.mean(whole)) < _WHOLE


def without_slow_vanes(columns: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The columns without vanes that read less than ``_LEAST_HZ``, and a clause for each."""
    slow = [name for name in _VANES if name in columns and _rate_hz(columns, name) < _LEAST_HZ]
    notes = tuple(
        f"{name} has {_rate_hz(columns, name):.3g} Hz, too slow for these modes: left out" for name in slow
    )
    return {name: column for name, column in columns.items() if name not in slow}, notes


def slowest_clock(columns: Mapping[str, Array]) -> str:
    """The channel whose stamps a joined table takes: that of the slowest vane or surface.

    A state that is interpolated up to a faster clock lags and is damped, and derivatives by it are wrong without a
    sign; at its own rate their errors are wide and true. The command of a surface that is read does not count.
    Surfaces slower than ``_LEAST_HZ`` are held or interpolated all the same, and without a slower channel the clock is
    ``DEFAULT_CLOCK``.
    """
    read = [f"{surface}_rad" for surface in SURFACES if f"{surface}_rad" in columns]
    commands = [f"{surface}_command_rad" for surface in SURFACES if f"{surface}_rad" not in read]
    rates = {name: _rate_hz(columns, name) for name in (*_VANES, *read, *commands) if name in columns}
    usual = _rate_hz(columns, DEFAULT_CLOCK) / _FASTER
    slower = {name: hz for name, hz in rates.items() if _LEAST_HZ <= hz < usual}
    return min(slower, key=lambda name: slower[name]) if slower else DEFAULT_CLOCK


def _rate_hz(columns: Mapping[str, Array], name: str) -> float:
    step_s = _step_s(columns["time_s"][np.isfinite(columns[name])])
    return 1.0 / step_s if step_s > 0.0 else 0.0


def join_rates(
    columns: Mapping[str, Array], clock: str, held: Collection[str], max_gap_s: float = MAX_GAP_S
) -> tuple[dict[str, Array], str]:
    """Every channel at the stamps of the clock's channel, and one clause about it.

    Slower states are interpolated and commands held, nothing over a longer gap; a faster channel is averaged over the
    clock's step before it is sampled.

    Args:
        columns: by channel, (rows,) each, ``time_s`` among them; NaN where a row does not hold the channel.
        clock: channel whose rows stay.
        held: channels that keep their value until the next one.
        max_gap_s: nothing is bridged over a longer step.
    """
    time_s = columns["time_s"]
    rows = np.flatnonzero(np.isfinite(columns[clock]) & np.isfinite(time_s))
    at = time_s[rows]
    step_s = _step_s(at)
    joined: dict[str, Array] = {}
    rates: dict[float, list[str]] = {}
    for name, column in columns.items():
        own = np.flatnonzero(np.isfinite(column) & np.isfinite(time_s))
        if name == "time_s" or not own.size or np.isfinite(column[rows]).all():
            joined[name] = column[rows]
            continue
        own = own[np.argsort(time_s[own], kind="stable")]
        stamps, values = time_s[own], column[own]
        fresh = np.concatenate([[True], np.diff(stamps) > SAME_STAMP_S])
        stamps, values = stamps[fresh], values[fresh]
        if step_s > _FASTER * _step_s(stamps) > 0.0 and name not in held and name not in LEAPING_CHANNELS:
            values = _averaged(stamps, values, step_s)
        joined[name] = _sampled(at, stamps, values, name, name in held, max_gap_s)
        rates.setdefault(round(1.0 / max(_step_s(stamps), 1e-4), 1), []).append(name)
    slow = "; ".join(f"{', '.join(names[:4])} {hz:g} Hz" for hz, names in sorted(rates.items()))
    note = f"rows hold only some channels: joined at the stamps of {clock} ({1.0 / max(step_s, 1e-4):.1f} Hz; {slow})"
    return joined, note


def _step_s(stamps: Array) -> float:
    steps = np.diff(stamps)
    steps = steps[steps > SAME_STAMP_S]
    return float(np.median(steps)) if steps.size else 0.0


def _averaged(stamps: Array, values: Array, width_s: float) -> Array:
    """Means over ``width_s`` around each reading."""
    total = np.concatenate([[0.0], np.cumsum(values - values[0])])
    begin = np.searchsorted(stamps, stamps - width_s / 2.0, side="left")
    end = np.searchsorted(stamps, stamps + width_s / 2.0, side="right")
    mean: Array = (total[end] - total[begin]) / (end - begin) + values[0]
    return mean


def _sampled(at: Array, stamps: Array, values: Array, name: str, hold: bool, max_gap_s: float) -> Array:
    """Readings at other stamps: between two of them, or held; NaN in gaps and at the ends."""
    if hold:
        left = np.searchsorted(stamps, at + SAME_STAMP_S, side="right") - 1
        age = at - stamps[np.maximum(left, 0)]
        return np.where((left >= 0) & (age <= max_gap_s), values[np.maximum(left, 0)], np.nan)
    right = np.searchsorted(stamps, at - SAME_STAMP_S, side="left")
    there = np.minimum(right, stamps.size - 1)
    exact = np.abs(stamps[there] - at) <= SAME_STAMP_S
    before = np.where(exact, there, np.maximum(there - 1, 0))
    width = stamps[there] - stamps[before]
    change = values[there] - values[before]
    if name in LEAPING_CHANNELS:
        change = (change + np.pi) % (2.0 * np.pi) - np.pi
    weight = np.divide(at - stamps[before], width, out=np.zeros_like(at), where=width > 0.0)
    inside = (right < stamps.size) & (exact | (right > 0)) & (width <= max_gap_s)
    return np.where(inside, values[before] + weight * change, np.nan)
