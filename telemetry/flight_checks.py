"""What is settled of a mapped table before it is a flight: one clock, one rate, and readings in the channels' units."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.clock import ClockError, TimeSource, check_clock, unwrapped
from wingwatch.telemetry.maps import ChannelEntry, ChannelMap
from wingwatch.telemetry.mixed_rates import (
    DEFAULT_CLOCK,
    is_sparse,
    join_rates,
    slowest_clock,
    without_slow_vanes,
)
from wingwatch.telemetry.plausibility.holds import hold_of, new_rows
from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNELS, Channel
from wingwatch.telemetry.units import units_of

__all__ = ["FlightError", "settled"]

Array = NDArray[np.float64]

_FEW, _MANY, _FAR = 0.05, 0.5, 1.5
"""Fractions of readings beyond the limits that a channel may have, where they lie far beyond (by this factor) and where
they do not; more are no glitches but another unit or another thing."""

_LEAST_ROWS = 20


class FlightError(ValueError):
    """A file that is a table but no flight; one sentence."""


def settled(
    source: str,
    columns: Mapping[str, Array],
    rules: ChannelMap,
    kinds: Mapping[str, str],
    other: Mapping[str, Array],
    required: Sequence[str],
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The channels on one clock, and what was done to them, one clause each.

    Args:
        source: what sentences call the file.
        columns: by channel, (rows,) each.
        rules: the map they came by.
        kinds: ``position`` or ``command`` of the surfaces.
        other: columns of the file that are no channels, (rows,) each.
        required: channels without which a sample is of no use.

    Raises:
        FlightError: stamps or readings that cannot be what they are called, with the likely cause.
    """
    found = dict(columns)
    found["time_s"], notes = unwrapped(found["time_s"])
    clock = rules.clock or DEFAULT_CLOCK
    if is_sparse(found, required, clock):
        commands = {name for name in found if name.endswith("_command_rad") or kinds.get(name) == "command"}
        found, left_out = without_slow_vanes(found)
        clock = rules.clock or slowest_clock(found)
        found, said = join_rates(found, clock, commands, rules.max_gap_s)
        notes, other = (*notes, *left_out, said), {}
    elif rules.clock is not None and (rows := _new_rows(found, rules.clock)) is not None:
        found = {name: column[rows] for name, column in found.items()}
        other = {name: column[rows] for name, column in other.items()}
        notes = (*notes, f"{rows.size} rows in which {rules.clock} is new are taken")
    entry = rules.channels.get("time_s") or ChannelEntry(source="time_s")
    factor = units_of("s")[entry.unit].factor if entry.unit else 1.0
    signal = found.get(clock, found["time_s"])
    try:
        check_clock(found["time_s"], TimeSource(entry.source, factor * entry.scale), signal, other)
    except ClockError as problem:
        raise FlightError(f"{source}: {problem}") from None
    notes = (*notes, *_without_placeholders(found, required))
    for name in found:
        _check_range(source, name, found[name], rules)
    return found, notes


def _new_rows(columns: Mapping[str, Array], clock: str) -> NDArray[np.int64] | None:
    """Rows in which the clock's channel is new, where it repeats its values; None where it does not."""
    whole = np.flatnonzero(np.isfinite(columns["time_s"]) & np.isfinite(columns[clock]))
    time_s, values = columns["time_s"][whole], columns[clock][whole]
    hold = hold_of(time_s, values)
    return None if hold is None else whole[new_rows(time_s, values, hold)]


def _without_placeholders(columns: dict[str, Array], required: Sequence[str]) -> list[str]:
    """Leave out what is no reading: an optional channel that shows one impossible value throughout."""
    notes = []
    for name in [n for n in columns if n not in required]:
        values = columns[name][np.isfinite(columns[name])]
        channel = CHANNELS[CHANNEL_INDEX[name]]
        outside = values.size > 1 and not channel.low <= values[0] <= channel.high
        if outside and (values == values[0]).all():
            notes.append(f"{name} is {values[0]:g} throughout, which stands for no reading: left out")
            del columns[name]
    return notes


def _check_range(source: str, name: str, column: Array, rules: ChannelMap) -> None:
    """Many readings beyond what a sensor can show are in another unit."""
    channel = CHANNELS[CHANNEL_INDEX[name]]
    values = column[np.isfinite(column)]
    if name == "time_s" or values.size < _LEAST_ROWS:
        return
    outside = float(np.mean((values < channel.low) | (values > channel.high)))
    low, high = np.quantile(values, (0.01, 0.99))
    far = low < _FAR * min(channel.low, 0.0) or high > _FAR * channel.high
    if outside <= (_FEW if far else _MANY):
        return
    entry = rules.channels.get(name) or ChannelEntry(source=name)
    limits = f"{channel.low:g} to {channel.high:g} {channel.unit}".rstrip()
    said = f"{source}: {name} runs from {low:.4g} to {high:.4g}, and {limits} are possible"
    unit = _likely_unit(channel, (low, high)) if entry.unit is None else None
    if unit is None:
        raise FlightError(f"{said}: give its unit or its column in a channel map, or leave it out")
    line = f'{name} = {{ source = "{entry.source}", unit = "{unit}" }}'
    raise FlightError(f"{said}: if it is in {unit}, write {line}")


def _likely_unit(channel: Channel, ends: tuple[float, float]) -> str | None:
    """The unit in which the readings fill most of what is possible, the commonest first where two do."""
    for unit in ("deg/s", "deg", "g", "kt", "ft", "us", "%", "degC", "cm/s", "cm", "mm", "ft/s", "km/h"):
        way = units_of(channel.unit).get(unit)
        if way is not None and all(channel.low <= way.factor * e + way.offset <= channel.high for e in ends):
            return unit
    return None
