"""A whole flight: a file read, mapped and completed into the flight table, and written back."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.aircraft.vocabulary import SURFACE_OF_INPUT
from wingwatch.telemetry.completion import complete, derivations
from wingwatch.telemetry.flight_checks import FlightError, settled
from wingwatch.telemetry.logs.log_table import log_table
from wingwatch.telemetry.logs.reading import is_autopilot_log, read_autopilot_log
from wingwatch.telemetry.maps import (
    ChannelEntry,
    ChannelMap,
    MapError,
    apply_map,
    load_map,
    mentions,
    with_travel,
)
from wingwatch.telemetry.readers import RawTable, read_table
from wingwatch.telemetry.sample import (
    CHANNEL_INDEX,
    CHANNEL_NAMES,
    INPUT_CHANNELS,
    SURFACE_CHANNELS,
    SampleBlock,
)

__all__ = [
    "REQUIRED_CHANNELS",
    "FlightError",
    "FlightReport",
    "FlightTable",
    "load_flight",
    "missing_for",
    "write_flight",
]

Kind = Literal["position", "command"]
Quality = Literal["measured", "derived"]

REQUIRED_CHANNELS: tuple[str, ...] = (
    "time_s",
    "airspeed_true_m_s",
    "roll_rate_rad_s",
    "pitch_rate_rad_s",
    "yaw_rate_rad_s",
    "specific_force_x_m_s2",
    "specific_force_y_m_s2",
    "specific_force_z_m_s2",
    "roll_rad",
    "pitch_rad",
    "altitude_m",
)
"""Channels without which a sample is of no use to any mode (contract "flight table")."""

_ELSEWHERE: Mapping[str, str] = {
    "airspeed_true_m_s": "or airspeed_indicated_m_s",
    "elevator_rad": "or elevator_command_rad",
    "aileron_rad": "or aileron_command_rad, or aileron_left_rad and aileron_right_rad",
    "rudder_rad": "or rudder_command_rad",
}


@dataclass(frozen=True, slots=True)
class FlightReport:
    """What reading a flight used and left.

    Attributes:
        rows_read: rows of the file.
        rows_kept: rows of the window and filter.
        unused: columns that are no channel and that the map does not name.
        ignored: columns that could not be read as a vector of numbers, each with the reason.
        notes: what was lost or doubtful, one clause each.
        rates_hz: of an autopilot's log, the rate of new readings by channel; the table's rate is another.
    """

    rows_read: int
    rows_kept: int
    unused: tuple[str, ...]
    ignored: tuple[str, ...]
    notes: tuple[str, ...]
    rates_hz: Mapping[str, float] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """One line for a person."""
        parts = [f"{self.rows_kept} of {self.rows_read} rows"]
        if self.unused:
            parts.append(f"{len(self.unused)} columns not used ({_listed(self.unused)})")
        if self.ignored:
            parts.append(f"{len(self.ignored)} columns not readable ({_listed(self.ignored)})")
        return "; ".join([*parts, *self.notes])


@dataclass(frozen=True, slots=True)
class FlightTable:
    """A flight in the contract's channels, completed, not yet cleaned.

    Attributes:
        block: the samples.
        kinds: for each surface channel present, whether it is a measured position or a command.
        quality: for each channel present, whether it was measured or derived.
        source: the file it came from.
        report: what reading used and left.
        entries: by channel, what the map says of it.
    """

    block: SampleBlock
    kinds: Mapping[str, Kind]
    quality: Mapping[str, Quality]
    source: str
    report: FlightReport
    entries: Mapping[str, ChannelEntry] = field(default_factory=dict)

    @property
    def wire_columns(self) -> tuple[str, ...]:
        """Channels a message must carry so that its receiver's completion gives this very table.

        A surface known only by its command goes as the command; the receiver then knows what it is.
        """
        commands = {name for name, kind in self.kinds.items() if kind == "command"}
        return tuple(name for name in self.block.present if name not in commands)


@dataclass(frozen=True, slots=True)
class _Mapped:
    """A file's channels under a map, rows of the flight alone, before completion."""

    columns: dict[str, NDArray[np.float64]]
    rules: ChannelMap
    report: FlightReport
    absent: str = ""
    raw: RawTable | None = None


def load_flight(
    path: Path,
    channel_map: ChannelMap | Path | None = None,
    full_deflection_rad: Mapping[str, float] | None = None,
) -> FlightTable:
    """A flight from a CSV, Parquet or MATLAB file, or from an autopilot's log (ULog, DataFlash, telemetry log).

    Args:
        path: the file; its first bytes say what it is.
        channel_map: a map, its file, or None for a file that already carries the channels' names and for a log of PX4
            or ArduPilot.
        full_deflection_rad: the aircraft's deflection at full travel by channel (``elevator_rad`` ...), for servo
            signals whose map does not state it; a log's surfaces need it.

    Raises:
        TableError: the file cannot be read as a table.
        LogError: the file cannot be read as a log, or holds no flight of a fixed-wing aircraft.
        MapError: the map cannot be read or does not fit the table.
        FlightError: no row is left, or a required channel is missing.
    """
    rules = load_map(channel_map) if isinstance(channel_map, Path) else channel_map
    read = _read_log if is_autopilot_log(path) else _read_columns
    mapped = read(path, rules, full_deflection_rad or {})
    columns, rules, source = mapped.columns, mapped.rules, str(path)
    kinds = _command_kinds(columns, rules)
    copies = [name for name in kinds if kinds[name] == "position" and _is_copy(columns, name)]
    kinds |= dict.fromkeys(copies, "command")
    given = [name for name, column in columns.items() if np.isfinite(column).any()]
    made = derivations(given)
    block = complete(SampleBlock.from_columns(columns), given)
    _demand_required(mapped.raw or source, mapped.report.unused, given, mapped.absent)
    for name in SURFACE_CHANNELS:
        if name in made and name not in kinds:
            kinds[name] = "command" if made[name] == (_command_of(name),) else "position"
    quality = _quality(block, rules, made)
    said = [f"{name} is its command to the bit, and taken for that" for name in copies]
    report = replace(mapped.report, notes=(*mapped.report.notes, *said))
    return FlightTable(block, kinds, quality, source, report, rules.channels)


def _read_columns(path: Path, channel_map: ChannelMap | None, travel_rad: Mapping[str, float]) -> _Mapped:
    raw = read_table(path)
    rules = with_travel(channel_map or ChannelMap(format=1), travel_rad)
    unused = _unused(raw, rules)
    _demand_required(raw, unused, {*raw.columns, *raw.doubled, *rules.channels})
    try:
        mapped = apply_map(rules, raw.columns, raw.units, raw.doubled, raw.stamps)
    except MapError as problem:
        raise MapError(_with_columns(f"{path}: {problem}", raw)) from None
    rows = np.flatnonzero(mapped.keep)
    if rows.size == 0:
        raise FlightError(f"{path}: the map's window and filter leave none of the {len(raw)} rows")
    columns = {name: column[rows] for name, column in mapped.columns.items()}
    other = {name: raw.columns[name][rows] for name in unused}
    kinds = _command_kinds(columns, rules)
    columns, noticed = settled(str(path), columns, rules, kinds, other, REQUIRED_CHANNELS)
    notes = (*raw.notes, *mapped.notes, *noticed)
    return _Mapped(
        columns, rules, FlightReport(len(raw), int(rows.size), unused, raw.ignored, notes), raw=raw
    )


def _read_log(path: Path, channel_map: ChannelMap | None, travel_rad: Mapping[str, float]) -> _Mapped:
    table = log_table(read_autopilot_log(path), channel_map, travel_rad)
    rates = {name: facts.rate_hz for name, facts in table.channels.items()}
    kept = int(table.columns["time_s"].size)
    report = FlightReport(table.rows_read, kept, (), (), table.notes, rates)
    absent = "; ".join(note for note in table.notes if "taken for absent" in note or " left out: " in note)
    return _Mapped(dict(table.columns), table.rules, report, absent)


def _with_columns(text: str, raw: RawTable) -> str:
    """The sentence, with what a person needs who names columns of a file without names."""
    numbered = not any(not name.isdigit() for name in raw.columns)
    return (
        f"{text}; no line of the file names its columns: they are 1 to {len(raw.columns)}"
        if numbered
        else text
    )


def missing_for(structure: ModeStructure, present: Collection[str]) -> tuple[str, ...]:
    """Channels that a mode needs and a block does not have, in the order of the flight table.

    Args:
        structure: the mode.
        present: channels there are, after completion (``SampleBlock.present``).
    """
    needed = set(REQUIRED_CHANNELS)
    for symbol in structure.regressors:
        if symbol in SURFACE_OF_INPUT:
            needed.add(INPUT_CHANNELS[symbol])
    return tuple(name for name in CHANNEL_NAMES if name in needed and name not in present)


def write_flight(block: SampleBlock, path: Path) -> None:
    """Writes the channels present to ``.csv`` or ``.parquet``; reading it back gives the same numbers.

    Raises:
        FlightError: another suffix, nothing to write, or a file that cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".parquet"):
        raise FlightError(
            f"{path}: a flight is written as .csv or .parquet, not {suffix or 'without a suffix'}"
        )
    names = [name for name in CHANNEL_NAMES if name in set(block.present)]
    if not names:
        raise FlightError(f"{path}: the flight has no samples to write")
    table = pa.table({name: pa.array(block.column(name), from_pandas=suffix == ".csv") for name in names})
    try:
        if suffix == ".csv":
            pacsv.write_csv(table, path, pacsv.WriteOptions(quoting_style="none"))
        else:
            pq.write_table(table, path)
    except OSError as problem:
        raise FlightError(f"{path}: cannot be written: {problem.strerror or problem}") from None


def _unused(raw: RawTable, rules: ChannelMap) -> tuple[str, ...]:
    mentioned = " ".join([*(entry.source for entry in rules.channels.values()), rules.rows.filter or ""])
    return tuple(
        name
        for name in raw.columns
        if name not in CHANNEL_INDEX
        and not mentions(mentioned, name)
        and not ("euler_" in mentioned and _vector_is_mentioned(mentioned, name))
    )


def _vector_is_mentioned(text: str, name: str) -> bool:
    """Whether the vector that a column is a part of stands in a text, its topic with or without an instance."""
    vector = name.rpartition("[")[0]
    return bool(vector) and any(mentions(text, form) for form in (vector, vector.replace("[0].", ".")))


def _command_of(surface: str) -> str:
    return surface.removesuffix("_rad") + "_command_rad"


def _is_copy(columns: Mapping[str, NDArray[np.float64]], surface: str) -> bool:
    """Whether a surface's position is no reading: a servo that moves is never where its command is, to the bit."""
    position, command = columns[surface], columns.get(_command_of(surface))
    if command is None or not np.array_equal(position, command, equal_nan=True):
        return False
    known = position[np.isfinite(position)]
    return known.size > 0 and bool(np.ptp(known) > 0.0)


def _command_kinds(columns: dict[str, NDArray[np.float64]], rules: ChannelMap) -> dict[str, Kind]:
    """Kinds of the surfaces in the table; one that the map calls a command is put among the commands too."""
    kinds: dict[str, Kind] = {}
    for name in SURFACE_CHANNELS:
        if name not in columns:
            continue
        entry = rules.channels.get(name)
        if entry is not None and entry.kind == "command":
            kinds[name] = "command"
            columns[_command_of(name)] = columns[name]
        else:
            kinds[name] = "position"
    return kinds


def _quality(
    block: SampleBlock, rules: ChannelMap, made: Mapping[str, tuple[str, ...]]
) -> dict[str, Quality]:
    quality: dict[str, Quality] = {}
    for name in block.present:
        entry = rules.channels.get(name)
        said = entry.quality if entry is not None else None
        quality[name] = said or ("derived" if name in made else "measured")
    return quality


def _demand_required(
    source: RawTable | str, unused: tuple[str, ...], given: Collection[str], absent: str = ""
) -> None:
    """Refuses channels without which there is no flight; ``absent`` says what a log had and what became of it."""
    made = derivations(given)
    missing = [name for name in REQUIRED_CHANNELS if name not in given and name not in made]
    if not missing:
        return
    named = [f"{name} ({_ELSEWHERE[name]})" if name in _ELSEWHERE else name for name in missing]
    close = [(name, get_close_matches(name, unused, n=1)) for name in missing]
    hints = [f"does {name} come from {found[0]}?" for name, found in close if found]
    if absent:
        hints.append(absent)
    advice = f"; {' '.join(hints)}" if hints else f" (the file has {_listed(unused)})" if unused else ""
    said = f"no values for {', '.join(named)}: name their columns in a channel map"
    if isinstance(source, str):
        raise FlightError(f"{source}: {said}{advice}")
    if "time_s" in missing and source.stamps:
        stamp = " + ".join(f"'{name}'" if " " in name else name for name in source.stamps[:2])
        advice = f', as time_s = {{ source = "{stamp}" }}{advice}'
    raise FlightError(_with_columns(f"{source.source}: {said}{advice}", source))


def _listed(names: tuple[str, ...], most: int = 8) -> str:
    shown = ", ".join(names[:most])
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"
