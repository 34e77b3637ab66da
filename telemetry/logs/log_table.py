"""A log's channels on one clock: the table of its flight, before completion and cleaning."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.expressions import ExpressionError, evaluate_filter, named_columns
from wingwatch.telemetry.logs.airborne import Interval, airborne_intervals
from wingwatch.telemetry.logs.log import AutopilotLog, LogError, Topic
from wingwatch.telemetry.logs.readings import ChannelReader, Reading, on_stamps
from wingwatch.telemetry.logs.ready_map import ready_map
from wingwatch.telemetry.logs.sampling import decimated, rate_hz
from wingwatch.telemetry.logs.stamps import ClockRuns
from wingwatch.telemetry.logs.surfaces import with_surfaces
from wingwatch.telemetry.maps import ChannelMap, MapError, with_travel
from wingwatch.telemetry.sample import SURFACE_CHANNELS
from wingwatch.telemetry.units import SERVO_UNITS

__all__ = ["TABLE_HZ", "ChannelFacts", "LogTable", "log_table", "map_for", "table_clock"]

Array = NDArray[np.float64]

TABLE_HZ = 100.0
"""Rate of a table at most: no mode of an aircraft lies near a half of it."""

_HELD_HZ, _LEAST_HZ = 30.0, 9.0
"""Surfaces logged less often than the first are the clock themselves (held in a faster table, m_w of the Aerosonde came
out up to twelve standard errors off), but not below the second, where no mode is left."""
_MOST_RUNS = 5
_CLOCKS = ("pitch_rate_rad_s", "roll_rate_rad_s", "yaw_rate_rad_s", "specific_force_z_m_s2", "roll_rad")
_FIXED_WING = 2.0


@dataclass(frozen=True, slots=True)
class ChannelFacts:
    """What a log has of one channel, in the flight's rows.

    Attributes:
        source: expression on the log's topics.
        rate_hz: of new readings, not of the table.
        gaps: steps between readings that nothing bridges.
        low: smallest value of the table, in the channel's unit.
        high: largest value.
        missing_rows: rows of the flight without a value.
        quality: measured by a sensor, commanded, or derived by the autopilot.
    """

    source: str
    rate_hz: float
    gaps: int
    low: float
    high: float
    missing_rows: int
    quality: Literal["measured", "commanded", "derived"]


@dataclass(frozen=True, slots=True)
class LogTable:
    """The flight in a log.

    Attributes:
        columns: by channel, shape (rows,), time stamps in s since boot.
        rules: the map it was made by, without the aircraft's travels.
        channels: facts by channel.
        duration_s: of the log's run that was read.
        intervals: times in the air; the table is the longest, or the map's window.
        rows_read: rows of the whole run.
        notes: what was lost or doubtful, one clause each.
    """

    columns: Mapping[str, Array]
    rules: ChannelMap
    channels: Mapping[str, ChannelFacts]
    duration_s: float
    intervals: tuple[Interval, ...]
    rows_read: int
    notes: tuple[str, ...]

    @property
    def flight_s(self) -> float:
        """How long the longest time in the air is."""
        return max((one.duration_s for one in self.intervals), default=0.0)


def map_for(
    log: AutopilotLog, channel_map: ChannelMap | None, travel_rad: Mapping[str, float] | None
) -> tuple[ChannelMap, tuple[str, ...]]:
    """The map a log is read by, servo signals' travel in it where it is known.

    Args:
        log: with its surfaces.
        channel_map: of the user; the ready one without.
        travel_rad: deflections at full travel by channel; None where nobody knows them.

    Raises:
        LogError: no map is ready for the autopilot, or no surface of a ready map has a travel.
    """
    if channel_map is not None:
        return with_travel(channel_map, travel_rad or {}), ()
    rules, notes = ready_map(log)
    rules = with_travel(rules, travel_rad or {})
    without = [
        n for n in SURFACE_CHANNELS if n in rules.channels and rules.channels[n].full_deflection_rad is None
    ]
    if not without:
        return rules, notes
    with_one = [n for n in SURFACE_CHANNELS if n in rules.channels and n not in without]
    words = " and ".join(name.removesuffix("_rad") for name in without)
    if not with_one:
        keys = " and ".join(f"[actuators.{name.removesuffix('_rad')}]" for name in without)
        raise LogError(
            f"{log.source}: the log has {words} as servo signals, and no log says what angle full travel is: state "
            f"position_limit_rad under {keys} in the aircraft file, or full_deflection_rad in a channel map"
        )
    kept = {name: entry for name, entry in rules.channels.items() if name not in without}
    notes = (*notes, f"{words} left out: the aircraft file states no position_limit_rad of it")
    return rules.model_copy(update={"channels": kept}), notes


def log_table(
    log: AutopilotLog,
    channel_map: ChannelMap | None = None,
    travel_rad: Mapping[str, float] | None = None,
    describing: bool = False,
) -> LogTable:
    """The longest flight in a log.

    Args:
        log: as read.
        channel_map: of the user; the ready one of the autopilot without.
        travel_rad: deflections at full travel by channel.
        describing: for showing what is there: surfaces without a travel stay fractions of it, and a log without a
            flight is taken whole; else both are errors.

    Raises:
        LogError: a multicopter, no map, no clock, never airborne, or surfaces without travel.
        MapError: the map does not fit the log.
    """
    if log.vehicle == "multicopter":
        raise LogError(
            f"{log.source}: this is a multicopter's log ({log.firmware or 'by its vehicle type'}); "
            "derivatives of fixed-wing aircraft are estimated, so give a log of one"
        )
    full = with_surfaces(log)
    if describing:
        travel_rad = {**dict.fromkeys(SURFACE_CHANNELS, 1.0), **(travel_rad or {})}
    rules, notes = map_for(full, channel_map, travel_rad)
    stated = ready_map(full)[0] if channel_map is None else channel_map
    reader = ChannelReader(full, rules)
    clock = table_clock(full, rules, reader)
    runs = reader.runs(clock)
    if not runs.runs:
        raise LogError(f"{log.source}: {clock.key}, whose stamps the table takes, has no readings")
    said = (*full.notes, *notes)
    refused: LogError | None = None
    best: LogTable | None = None
    for index in _longest_first(clock, runs)[:_MOST_RUNS]:
        try:
            found = _table_of_run(full, rules, reader, _Run(clock, runs, index, said, stated, describing))
        except LogError as problem:
            refused = refused or problem
            continue
        if best is None or found.flight_s > best.flight_s:
            best = found
    if best is None:
        raise refused or LogError(f"{log.source}: no flight in the log")
    return best


@dataclass(frozen=True, slots=True)
class _Run:
    """One run of the table's clock, and what is the same whichever is read."""

    clock: Topic
    runs: ClockRuns
    index: int
    notes: tuple[str, ...]
    stated: ChannelMap
    describing: bool

    @property
    def time_s(self) -> Array:
        """Its stamps."""
        return self.clock.time_s[self.runs.runs[self.index]]


def _longest_first(clock: Topic, runs: ClockRuns) -> list[int]:
    lengths = [clock.time_s[rows[-1]] - clock.time_s[rows[0]] for rows in runs.runs]
    return [int(i) for i in np.argsort(-np.array(lengths), kind="stable")]


def table_clock(log: AutopilotLog, rules: ChannelMap, reader: ChannelReader) -> Topic:
    """The topic whose stamps the table takes: that of surfaces at 9 to 30 Hz, else of the angular rates.

    Args:
        log: with its surfaces.
        rules: the map.
        reader: of both.

    Raises:
        LogError: the log has no channel that can be the clock.
        MapError: the map names a clock that does not fit the log.
    """
    if "time_s" in rules.channels:
        raise MapError(
            "channel time_s: an autopilot log has a clock of its own; leave the entry out, and name with "
            "clock = ... the channel whose stamps the table takes"
        )
    if rules.clock is None and (slow := _slow_surface(rules, reader)) is not None:
        return slow
    names = [rules.clock] if rules.clock is not None else [*_CLOCKS, *rules.channels]
    for name in names:
        if name in rules.channels:
            return reader.topic(name)
    wanted = rules.clock or "angular rates"
    raise LogError(
        f"{log.source}: the log has no {wanted}, whose stamps the table takes; name them in a channel map"
    )


def _slow_surface(rules: ChannelMap, reader: ChannelReader) -> Topic | None:
    """The topic of the slowest surface, where commands held in a faster table would not be those that were given."""
    topics = [reader.topic(name) for name in SURFACE_CHANNELS if name in rules.channels]
    rates = [rate_hz(topic.time_s) for topic in topics]
    slow = [(rate, k) for k, rate in enumerate(rates) if _LEAST_HZ <= rate < _HELD_HZ]
    return topics[min(slow)[1]] if slow else None


def _table_of_run(log: AutopilotLog, rules: ChannelMap, reader: ChannelReader, run: _Run) -> LogTable:
    clock_s = run.time_s
    stamps = decimated(clock_s, TABLE_HZ)
    table_hz = rate_hz(stamps)
    readings = {name: reader.read(name, run.clock, run.index) for name in rules.channels}
    columns: dict[str, Array] = {"time_s": stamps}
    for name, reading in readings.items():
        if reading is not None:
            columns[name] = on_stamps(reading, stamps, table_hz)
    kept, intervals, cut = _cut(log, rules, columns, reader, run.describing)
    if not kept.any():
        raise LogError(f"{log.source}: the map's window and filter leave none of the {stamps.size} rows")
    notes = [*run.notes, *reader.clock_notes(), *_jump_notes(run), *cut]
    if stamps.size < clock_s.size:
        notes.append(
            f"{run.clock.key} has {rate_hz(clock_s):.0f} Hz: low-pass filtered, then sampled at {table_hz:.0f} Hz"
        )
    facts = {
        name: _facts(rules, name, reading, columns[name][kept], stamps[kept])
        for name, reading in readings.items()
        if reading is not None
    }
    notes += [f"{name} left out: {why}" for name, why in reader.left_out.items()]
    notes += _doubts(rules, facts)
    return LogTable(
        {name: column[kept] for name, column in columns.items()},
        run.stated, facts, float(clock_s[-1] - clock_s[0]), intervals, stamps.size, tuple(dict.fromkeys(notes)),
    )  # fmt: skip


def _cut(
    log: AutopilotLog,
    rules: ChannelMap,
    columns: Mapping[str, Array],
    reader: ChannelReader,
    describing: bool,
) -> tuple[NDArray[np.bool_], tuple[Interval, ...], list[str]]:
    """Rows of the flight, the times in the air, and what is to be said of them."""
    time_s = columns["time_s"]
    kept = np.ones(time_s.shape, dtype=np.bool_)
    if rules.rows.filter is not None:
        kept &= _filter(log, rules.rows.filter, time_s, reader)
    speed = _speed(log, columns)
    if speed is None:
        return kept, (), ["neither airspeed nor speed over the ground: when it flew is not known"]
    intervals = airborne_intervals(time_s, speed, _column(columns, "altitude_m"), _force(columns))
    if rules.rows.from_s is not None or rules.rows.to_s is not None:
        low, high = rules.rows.from_s, rules.rows.to_s
        kept &= (time_s >= (-np.inf if low is None else low)) & (time_s <= (np.inf if high is None else high))
        return kept, intervals, []
    if not intervals and describing:
        return kept, (), ["it was never airborne"]
    if not intervals:
        top = float(np.nanmax(speed)) if np.isfinite(speed).any() else 0.0
        raise LogError(
            f"{log.source}: the aircraft was never airborne in this log (speed at most {top:.0f} m/s, no height "
            "gained at speed); give a log of a flight, or the window [rows] in a channel map"
        )
    longest = max(intervals, key=lambda one: one.duration_s)
    inside = (time_s >= longest.from_s) & (time_s <= longest.to_s)
    notes = [f"airborne from {longest.from_s:.1f} to {longest.to_s:.1f} s"]
    if not inside.all():
        notes.append(f"{int((~inside).sum())} rows before and after are left out")
    if others := [f"{one.from_s:.1f} to {one.to_s:.1f} s" for one in intervals if one is not longest]:
        notes.append(f"also airborne from {', '.join(others)}, which is not read")
    return kept & inside, intervals, notes


def _filter(log: AutopilotLog, condition: str, time_s: Array, reader: ChannelReader) -> NDArray[np.bool_]:
    """A condition on the log's columns, each held until its next reading."""
    try:
        columns = {name: reader.held(name, time_s) for name in named_columns(condition)}
        return evaluate_filter(condition, columns or {"": time_s})
    except ExpressionError as problem:
        raise MapError(f"rows.filter: {problem}") from None


def _column(columns: Mapping[str, Array], name: str) -> Array:
    return columns.get(name, np.full(columns["time_s"].shape, np.nan))


def _speed(log: AutopilotLog, columns: Mapping[str, Array]) -> Array | None:
    """Through the air or over the ground, the faster one; 0 while a VTOL hovers. None where neither is known."""
    air = columns.get("airspeed_true_m_s", columns.get("airspeed_indicated_m_s"))
    ground = np.hypot(_column(columns, "velocity_north_m_s"), _column(columns, "velocity_east_m_s"))
    speed = ground if air is None else np.fmax(air, ground)  # a pitot may fail in flight
    if not np.isfinite(speed).any():
        return None
    status = log.get("vehicle_status")
    if log.vehicle == "vtol" and status is not None and "vehicle_type" in status.fields and len(status):
        last = np.searchsorted(status.time_s, columns["time_s"], side="right") - 1
        speed = np.where(status.fields["vehicle_type"][np.maximum(last, 0)] == _FIXED_WING, speed, 0.0)
    return speed


def _force(columns: Mapping[str, Array]) -> Array:
    axes = [_column(columns, f"specific_force_{axis}_m_s2") for axis in "xyz"]
    return np.sqrt(axes[0] ** 2 + axes[1] ** 2 + axes[2] ** 2)


def _facts(rules: ChannelMap, name: str, reading: Reading, values: Array, stamps: Array) -> ChannelFacts:
    entry = rules.channels[name]
    time_s = reading.readings.time_s
    inside = time_s[(time_s >= stamps[0]) & (time_s <= stamps[-1])]
    known = values[np.isfinite(values)]
    quality: Literal["measured", "commanded", "derived"] = (
        "commanded" if reading.readings.held else "measured"
    )
    if entry.quality == "derived":
        quality = "derived"
    return ChannelFacts(
        entry.source,
        rate_hz(inside),
        int((np.diff(inside) > reading.max_gap_s).sum()),
        float(known.min()) if known.size else np.nan,
        float(known.max()) if known.size else np.nan,
        int(values.size - known.size),
        quality,
    )


def _jump_notes(run: _Run) -> list[str]:
    if not run.runs.jumps:
        return []
    time_s, rows = run.time_s, run.runs.runs
    others = sum(one.size for i, one in enumerate(rows) if i != run.index)
    return [
        f"the clock jumped {run.runs.jumps} times: the run from {time_s[0]:.1f} to {time_s[-1]:.1f} s is read, "
        f"{others} readings of {run.clock.key} in other runs are not"
    ]


def _doubts(rules: ChannelMap, facts: Mapping[str, ChannelFacts]) -> list[str]:
    notes = [
        f"{name} is derived by the autopilot ({facts[name].source}), not measured"
        for name in ("airspeed_true_m_s", "airspeed_indicated_m_s")
        if name in facts and facts[name].quality == "derived"
    ]
    for name, fact in facts.items():
        gap = rules.channels[name].max_gap_s or rules.max_gap_s
        if fact.rate_hz and 1.0 / fact.rate_hz > gap:
            notes.append(
                f"{name} comes every {1.0 / fact.rate_hz:.2g} s, and max_gap_s bridges {gap:g} s: give it a longer one"
            )
    servo = [name for name, entry in rules.channels.items() if entry.unit in SERVO_UNITS and name in facts]
    rates = sorted({round(facts[name].rate_hz, 1) for name in servo if name in SURFACE_CHANNELS})
    if rates:
        notes.append(f"surfaces are commands, logged at {' and '.join(f'{rate:g}' for rate in rates)} Hz")
    return notes
