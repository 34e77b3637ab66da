"""Channel maps: how any table becomes a flight table, so that nobody edits logs (contract "flight table")."""

import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from wingwatch.telemetry.column_units import UnitError, stated_unit
from wingwatch.telemetry.expressions import ExpressionError, evaluate, evaluate_filter
from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNELS, MAX_GAP_S
from wingwatch.telemetry.shown_later import SAME_STAMP_S, shown_later
from wingwatch.telemetry.units import SERVO_UNITS, allowed_units, units_of

__all__ = [
    "ChannelEntry",
    "ChannelMap",
    "MapError",
    "RowSelection",
    "apply_map",
    "channel_values",
    "is_command",
    "load_map",
    "mentions",
    "parse_map",
    "undelayed",
    "with_travel",
]

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_Text = Annotated[str, Field(min_length=1, max_length=300)]
_MAX_DELAY_S = 10.0


class MapError(ValueError):
    """A channel map that cannot be used; one sentence naming the entry, the value and what is allowed."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RowSelection(_Part):
    """Which rows of the table are the flight.

    Attributes:
        from_s: first time stamp kept, on the mapped clock.
        to_s: last time stamp kept.
        filter: condition on the table's own columns, such as ``mode == 2``.
    """

    from_s: _Finite | None = None
    to_s: _Finite | None = None
    filter: _Text | None = None


class ChannelEntry(_Part):
    """Where one channel comes from: ``scale * SI(source, unit) + offset``, read ``delay_s`` later.

    Attributes:
        source: column or expression of the table.
        unit: unit of the source; the channel's own where none is written.
        scale: factor after conversion; -1 turns the sign.
        offset: added after scaling, in the channel's unit.
        delay_s: how much the source lags; the flight table takes the value the source shows that much later.
        kind: whether a surface channel is a measured position or a command.
        quality: whether it was measured or derived by the logging system.
        full_deflection_rad: angle at full travel, for the units ``norm`` and ``pwm``; where none is written that of
            the aircraft counts (``with_travel``).
        neutral: servo signal at zero deflection.
        span: servo signal from neutral to full travel.
        max_gap_s: of this channel, in place of the map's.
    """

    source: _Text
    unit: str | None = None
    scale: _Finite = 1.0
    offset: _Finite = 0.0
    delay_s: Annotated[float, Field(ge=-_MAX_DELAY_S, le=_MAX_DELAY_S)] = 0.0
    kind: Literal["position", "command"] | None = None
    quality: Literal["measured", "derived"] | None = None
    full_deflection_rad: _Positive | None = None
    neutral: _Finite | None = None
    span: _Positive | None = None
    max_gap_s: _Positive | None = None


class ChannelMap(_Part):
    """A channel map file.

    Attributes:
        format: version of this file format.
        clock: channel whose stamps the table takes; of a table of one clock the rows in which that channel is new,
            where it repeats its values.
        max_gap_s: nothing is interpolated or held across a longer gap.
        rows: window and filter.
        channels: entries by flight-table channel; they override columns that carry a channel's name.
    """

    format: Literal[1]
    clock: str | None = None
    max_gap_s: _Positive = MAX_GAP_S
    rows: RowSelection = RowSelection()
    channels: Mapping[str, ChannelEntry] = {}

    @model_validator(mode="after")
    def _check_channels(self) -> "ChannelMap":
        if self.clock is not None and self.clock not in CHANNEL_INDEX:
            raise ValueError(_unknown_channel("clock", self.clock))
        for name, entry in self.channels.items():
            if name not in CHANNEL_INDEX:
                raise ValueError(_unknown_channel("channel", name))
            _check_entry(name, entry)
        return self


def _unknown_channel(what: str, name: str) -> str:
    begun = [channel for channel in CHANNEL_INDEX if channel.startswith(name)]
    close = begun or get_close_matches(name, CHANNEL_INDEX, n=1)
    hint = f"did you mean {close[0]}?" if close else f"channels are {', '.join(CHANNEL_INDEX)}"
    return f"{what} {name!r} is no flight-table channel; {hint}"


def _check_entry(name: str, entry: ChannelEntry) -> None:
    si = CHANNELS[CHANNEL_INDEX[name]].unit
    allowed = allowed_units(si)
    if entry.unit is not None and entry.unit not in allowed:
        raise ValueError(f"channel {name} has unit {entry.unit!r}; allowed: {', '.join(allowed)}")
    servo = entry.unit in SERVO_UNITS
    given = {key for key in ("full_deflection_rad", "neutral", "span") if getattr(entry, key) is not None}
    if not servo and given:
        raise ValueError(
            f"channel {name} has {min(given)}, which only the units {' and '.join(SERVO_UNITS)} take"
        )
    wanted = {"neutral", "span"} if entry.unit == "pwm" else set()
    if missing := sorted(wanted - given):
        raise ValueError(f"channel {name} in {entry.unit} needs {' and '.join(missing)}")
    if name == "time_s" and entry.delay_s != 0.0:
        raise ValueError("channel time_s cannot have a delay_s: the other channels' delays count from it")


@dataclass(frozen=True, slots=True)
class MappedColumns:
    """Channels of the flight table as a map made them, all rows kept.

    Attributes:
        columns: by channel, shape (rows,).
        keep: rows of the window and filter, shape (rows,).
        notes: units that were taken from the file, one clause each.
    """

    columns: Mapping[str, NDArray[np.float64]]
    keep: NDArray[np.bool_]
    notes: tuple[str, ...] = ()


def parse_map(text: str, name: str = "channel map") -> ChannelMap:
    """A channel map from TOML text.

    Args:
        text: the TOML.
        name: what the sentence calls it, such as the file's path.

    Raises:
        MapError: not TOML, or not a channel map.
    """
    try:
        return ChannelMap.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as problem:
        raise MapError(f"{name}: not valid TOML: {problem}") from None
    except ValidationError as problem:
        raise MapError(f"{name}: {_sentence(problem)}") from None


def load_map(path: Path) -> ChannelMap:
    """A channel map from a file.

    Raises:
        MapError: the file is missing, unreadable, not TOML, or not a channel map.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise MapError(f"{path}: there is no such channel map; check the path") from None
    except (OSError, UnicodeDecodeError) as problem:
        reason = problem.strerror if isinstance(problem, OSError) else "it is no UTF-8 text"
        raise MapError(f"{path}: the channel map cannot be read: {reason}") from None
    return parse_map(text, str(path))


def _sentence(problem: ValidationError) -> str:
    first = problem.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        return f"{where} is no key of a channel map"
    if first["type"] == "missing":
        return f"{where} is missing"
    said = first["msg"].removeprefix("Value error, ")
    return f"{where} = {first['input']!r}: {said}" if where else said


def with_travel(channel_map: ChannelMap, travel_rad: Mapping[str, float]) -> ChannelMap:
    """The map with the aircraft's deflections at full travel where it has servo signals and states none.

    Args:
        channel_map: any map.
        travel_rad: deflection at full travel by channel, such as ``elevator_rad``; that of a surface's position
            counts for its command and its halves.
    """
    channels = dict(channel_map.channels)
    for name, entry in channel_map.channels.items():
        travel = travel_rad.get(name) or travel_rad.get(f"{name.split('_')[0]}_rad")
        if travel is not None and _lacks_travel(name, entry):
            channels[name] = entry.model_copy(update={"full_deflection_rad": travel})
    return channel_map.model_copy(update={"channels": channels})


def _lacks_travel(name: str, entry: ChannelEntry) -> bool:
    angle = CHANNELS[CHANNEL_INDEX[name]].unit == "rad"
    return angle and entry.unit in SERVO_UNITS and entry.full_deflection_rad is None


def apply_map(
    channel_map: ChannelMap,
    table: Mapping[str, NDArray[np.float64]],
    units: Mapping[str, str] | None = None,
    doubled: Collection[str] = (),
    stamps: Collection[str] = (),
) -> MappedColumns:
    """Every channel that a table yields under a map.

    Args:
        channel_map: the map; an empty one passes columns that carry a channel's name.
        table: columns of equal length by name.
        units: by column, as the file states them; taken where an entry says none.
        doubled: names that several columns of the file share, refused where they are used.
        stamps: columns that were dates or times, which are in seconds whatever the file writes.

    Raises:
        MapError: an expression that cannot be read, a column that is not there, a unit that cannot be, or no time
            stamps.
    """
    notes: list[str] = []
    converted: dict[str, list[str]] = {}
    columns: dict[str, NDArray[np.float64]] = {}
    entries = {name: ChannelEntry(source=name) for name in CHANNEL_INDEX if name in table or name in doubled}
    for name, entry in {**entries, **channel_map.channels}.items():
        _refuse_doubled(name, entry.source, table, doubled)
        if entry.unit is None or name not in channel_map.channels:
            entry = _in_stated_unit(name, entry, table, units or {}, notes)
            if entry.unit is not None:
                converted.setdefault(entry.unit, []).append(entry.source)
        elif entry.source in stamps and entry.unit != "s":
            raise MapError(
                f"channel {name}: {entry.source} is a date or a time, read in seconds: leave its unit out"
            )
        given = name in channel_map.channels or entry.unit is not None
        columns[name] = (
            channel_values(name, entry, table) if given else np.array(table[name], dtype=np.float64)
        )
    if converted:
        each = "; ".join(f"{', '.join(sources)} from {unit}" for unit, sources in converted.items())
        notes.append(f"converted by the units that the file states: {each}")
    if "time_s" not in columns:
        raise MapError(
            "the table has no time_s: name its time column in a channel map, as time_s = { source = ... }"
        )
    if channel_map.clock is not None and channel_map.clock not in columns:
        raise MapError(f"clock {channel_map.clock} is a channel that neither the table nor the map has")
    time_s = columns["time_s"]
    for name, entry in channel_map.channels.items():
        if entry.delay_s != 0.0:
            held = is_command(name, entry)
            columns[name] = undelayed(
                time_s, columns[name], entry.delay_s, entry.max_gap_s or channel_map.max_gap_s, held
            )
    return MappedColumns(columns, _rows(channel_map.rows, time_s, table), tuple(notes))


def _refuse_doubled(
    channel: str, source: str, table: Mapping[str, NDArray[np.float64]], doubled: Collection[str]
) -> None:
    """A column of which there are several cannot be meant."""
    if source in table or not doubled:
        return
    for name in doubled:
        if mentions(source, name):
            raise MapError(
                f"channel {channel}: the file has several columns {name!r} that differ; rename all but one"
            )


def _in_stated_unit(
    name: str,
    entry: ChannelEntry,
    table: Mapping[str, NDArray[np.float64]],
    units: Mapping[str, str],
    notes: list[str],
) -> ChannelEntry:
    """The entry with the unit that the file states of its source."""
    try:
        unit, said = stated_unit(name, entry.source, entry.scale, table, units)
    except (UnitError, ExpressionError) as problem:
        raise MapError(f"channel {name}: {problem}") from None
    if said:
        notes.append(said)
    return entry if unit is None else entry.model_copy(update={"unit": unit})


def mentions(text: str, name: str) -> bool:
    """Whether a column's name stands in a text as a word of its own."""
    start = text.find(name)
    while start >= 0:
        around = text[max(start - 1, 0) : start] + text[start + len(name) : start + len(name) + 1]
        if not any(c.isalnum() or c == "_" for c in around):
            return True
        start = text.find(name, start + 1)
    return False


def is_command(name: str, entry: ChannelEntry) -> bool:
    """Whether a channel's readings hold until the next one."""
    return entry.kind == "command" or name.endswith("_command_rad")


def channel_values(
    name: str, entry: ChannelEntry, table: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """A channel in its own unit as an entry makes it of a table's columns, row by row, its delay still in it.

    Raises:
        MapError: an expression that cannot be read, a column that is not there, or no deflection at full travel.
    """
    if _lacks_travel(name, entry):
        surface = name.split("_")[0]
        raise MapError(
            f"channel {name} in {entry.unit} needs full_deflection_rad: write it into the map, or state "
            f"[actuators.{surface}] position_limit_rad in the aircraft file"
        )
    try:
        raw = evaluate(entry.source, table)
    except ExpressionError as problem:
        raise MapError(f"channel {name}: {problem}") from None
    if entry.unit in SERVO_UNITS:
        neutral = 0.0 if entry.neutral is None else entry.neutral
        span = 1.0 if entry.span is None else entry.span
        full = 1.0 if entry.full_deflection_rad is None else entry.full_deflection_rad
        value = (raw - neutral) * (full / span)
    elif entry.unit is not None:
        unit = units_of(CHANNELS[CHANNEL_INDEX[name]].unit)[entry.unit]
        value = raw * unit.factor + unit.offset
    else:
        value = raw
    return value * entry.scale + entry.offset


def _rows(
    rows: RowSelection, time_s: NDArray[np.float64], table: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.bool_]:
    keep = np.ones(time_s.shape, dtype=np.bool_)
    if rows.from_s is not None:
        keep &= time_s >= rows.from_s
    if rows.to_s is not None:
        keep &= time_s <= rows.to_s
    if rows.filter is not None:
        try:
            keep &= evaluate_filter(rows.filter, table)
        except ExpressionError as problem:
            raise MapError(f"rows.filter: {problem}") from None
    return keep


def undelayed(
    time_s: NDArray[np.float64], values: NDArray[np.float64], delay_s: float, max_gap_s: float, held: bool
) -> NDArray[np.float64]:
    """Values the source shows ``delay_s`` later: states interpolated, commands held, NaN in gaps and at ends.

    Each run of increasing stamps is treated on its own, so a clock that jumps back joins nothing.
    """
    result = np.full(values.shape, np.nan)
    with np.errstate(invalid="ignore"):
        breaks = np.flatnonzero(~(np.diff(time_s) > 0.0)) + 1
    for rows in np.split(np.arange(time_s.size), breaks):
        result[rows] = _undelayed_run(time_s[rows], values[rows], delay_s, max_gap_s, held)
    return result


def _undelayed_run(
    time_s: NDArray[np.float64], values: NDArray[np.float64], delay_s: float, max_gap_s: float, held: bool
) -> NDArray[np.float64]:
    shown = shown_later(time_s, values, delay_s, held)
    inside = (shown.right < time_s.size) & (time_s + delay_s >= time_s[0] - SAME_STAMP_S)
    return np.where(inside & (shown.width_s <= max_gap_s), shown.values, np.nan)
