"""Samples out of the last seconds of a live link, by the code that makes a log's table."""

from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.expressions import canonical_name, named_columns
from wingwatch.telemetry.logs.log import AutopilotLog, LogError, topic_key
from wingwatch.telemetry.logs.log_table import TABLE_HZ, map_for, table_clock
from wingwatch.telemetry.logs.readings import ChannelReader, Reading, on_stamps, readings_of
from wingwatch.telemetry.logs.ready_map import TAKEN_FOR_ABSENT, ready_map
from wingwatch.telemetry.logs.sampling import (
    Placement,
    Readings,
    decimated,
    is_faster,
    news_of,
    placed,
    rate_hz,
    repeats,
)
from wingwatch.telemetry.logs.surfaces import SURFACES_TOPIC, with_surfaces
from wingwatch.telemetry.maps import ChannelEntry, ChannelMap, is_command
from wingwatch.telemetry.mavlink.topic_buffer import TopicBuffer
from wingwatch.telemetry.sample import CHANNEL_NAMES, SURFACE_CHANNELS, SampleBlock

__all__ = ["HISTORY_S", "SILENT_S", "WAIT_S", "LivePlan", "LiveTable", "live_plan"]

Array = NDArray[np.float64]
Buffers = Mapping[str, TopicBuffer]

HISTORY_S = 6.0
"""What is kept of a topic: by it the map is chosen, and within it the low-pass filter has forgotten where it began."""

WAIT_S = 2.0
"""A sample waits at most so long for the next reading of its slowest channel."""

SILENT_S = 3.0
"""A topic that has not come for so long has ceased."""

AHEAD_STEPS = 10.0
"""Steps of the table that the low-pass filter looks ahead; what lies beyond moves it by about a thousandth of what the
signal moves there."""

_RATE_TOLERANCE = 0.2
_SURFACES_KEY = topic_key(SURFACES_TOPIC, 0)
_OUTPUTS = ("SERVO_OUTPUT_RAW", "ACTUATOR_OUTPUT_STATUS")


@dataclass(frozen=True, slots=True)
class _LiveChannel:
    """One channel, and what was found of it over some seconds.

    Attributes:
        name: of the channel.
        entry: of the map.
        topic: whose messages it is in.
        columns: of that topic that its expression reads, by name: field and element, None for a plain field.
        max_gap_s: over which nothing is bridged.
        repeats: whether it repeats its readings as a clock does.
        rate_hz: of its new readings.
        filtered: whether it is faster than the table.
    """

    name: str
    entry: ChannelEntry
    topic: str
    columns: Mapping[str, tuple[str, int | None]]
    max_gap_s: float
    repeats: bool
    rate_hz: float
    filtered: bool


@dataclass(frozen=True, slots=True)
class LivePlan:
    """How a link's topics become samples.

    Attributes:
        clock: topic whose stamps the samples take.
        every: of them, every how many-th.
        table_hz: their rate.
        channels: by name.
        notes: what was passed over or is doubtful, one clause each.
    """

    clock: str
    every: int
    table_hz: float
    channels: Mapping[str, _LiveChannel]
    notes: tuple[str, ...]

    @property
    def awaits(self) -> bool:
        """Whether a channel was taken for absent because it has read exactly 0 so far, as airspeed on the ground."""
        return any(TAKEN_FOR_ABSENT in note for note in self.notes)

    @property
    def wire_columns(self) -> tuple[str, ...]:
        """Columns of a message, in the order of the flight table; a surface known by its command goes as that."""
        names = {wire_name(one.name, one.entry) for one in self.channels.values()}
        return tuple(name for name in CHANNEL_NAMES if name == "time_s" or name in names)

    def agrees(self, other: "LivePlan") -> bool:
        """Whether another plan takes the same sources at about the same rates."""
        same = {name: one.entry.source for name, one in self.channels.items()} == {
            name: one.entry.source for name, one in other.channels.items()
        }
        rates = [(self.table_hz, other.table_hz)]
        rates += [(one.rate_hz, other.channels[name].rate_hz) for name, one in self.channels.items() if same]
        near = all(abs(a - b) <= _RATE_TOLERANCE * a for a, b in rates)
        return same and near and self.clock == other.clock and self.every == other.every

    def with_kept(self, former: "LivePlan", alive: Collection[str]) -> "LivePlan":
        """With the channels of a former plan that this one passes over though their topics are ``alive``: a channel
        that lived is not absent when it rests."""
        topics = {*alive, *([_SURFACES_KEY] if any(topic_key(name, 0) in alive for name in _OUTPUTS) else [])}
        kept = {
            n: one for n, one in former.channels.items() if n not in self.channels and one.topic in topics
        }
        return replace(self, channels={**self.channels, **kept})


def wire_name(name: str, entry: ChannelEntry) -> str:
    """What a channel is called in a message."""
    command = name in SURFACE_CHANNELS and is_command(name, entry)
    return name.removesuffix("_rad") + "_command_rad" if command else name


def live_plan(log: AutopilotLog, travel_rad: Mapping[str, float]) -> LivePlan:
    """The plan that fits some seconds of a link.

    Args:
        log: those seconds.
        travel_rad: deflections at full travel by channel, such as ``elevator_rad``.

    Raises:
        LogError: no topic can be the clock.
        MapError: an entry that does not fit.
    """
    full = with_surfaces(log)
    rules, notes = _rules(full, travel_rad)
    reader = ChannelReader(full, rules)
    clock = table_clock(full, rules, reader)
    runs = reader.runs(clock).runs
    if not runs:
        raise LogError(f"{log.source}: {clock.key}, whose stamps the samples take, has no readings")
    index = int(np.argmax([run.size for run in runs]))
    time_s = clock.time_s[runs[index]]
    stamps = decimated(time_s, TABLE_HZ)
    table_hz = rate_hz(stamps)
    channels = {}
    for name, entry in rules.channels.items():
        reading = reader.read(name, clock, index)
        if reading is None:
            continue
        topic = reader.topic(name)
        raw = readings_of(
            name,
            entry,
            topic.time_s,
            {n: topic.fields[n.partition("].")[2]] for n in named_columns(entry.source)},
        )
        rate = rate_hz(reading.readings.time_s)
        channels[name] = _LiveChannel(
            name, entry, topic.key, _places(entry.source), reading.max_gap_s, raw is not None and repeats(raw), rate,
            is_faster(reading.readings, table_hz, rate),
        )  # fmt: skip
    every = max(1, round(time_s.size / stamps.size))
    return LivePlan(clock.key, every, table_hz, channels, (*full.notes, *notes))


def _rules(log: AutopilotLog, travel_rad: Mapping[str, float]) -> tuple[ChannelMap, tuple[str, ...]]:
    """The ready map; without surfaces where the aircraft states the travel of none, as nothing else says it."""
    try:
        return map_for(log, None, travel_rad)
    except LogError:
        rules, notes = ready_map(log)
        kept = {name: entry for name, entry in rules.channels.items() if name not in SURFACE_CHANNELS}
        said = "surfaces left out: the aircraft file states no position_limit_rad of them"
        return rules.model_copy(update={"channels": kept}), (*notes, said)


def _places(source: str) -> dict[str, tuple[str, int | None]]:
    """Field and element of each column that an expression reads; a source that is one column keeps its own name, so
    that nothing is to be parsed."""
    found: dict[str, tuple[str, int | None]] = {}
    for name in named_columns(source):
        field, bracket, element = name.partition("].")[2].partition("[")
        key = source if canonical_name(source) == name else name
        found[key] = (field, int(element.rstrip("]")) if bracket else None)
    return found


class LiveTable:
    """Makes samples of one stream of a vehicle by one plan after another.

    Args:
        buffers: its topics; they forget what is older than ``HISTORY_S``.

    Attributes:
        plan: the plan in force.
        last_s: stamp of the newest sample made.
        unbridged: values by channel that samples lack because no reading was near.
    """

    def __init__(self, buffers: Buffers, plan: LivePlan) -> None:
        self._buffers = buffers
        self._phase = 0
        self.plan = plan
        self.last_s = -np.inf
        self.unbridged: dict[str, int] = {}

    def rows(self, log: AutopilotLog, newest_s: float, final: bool = False) -> SampleBlock | None:
        """Samples that are due; None where there are none.

        Args:
            log: autopilot, vehicle and parameters of the link, without topics.
            newest_s: what the vehicle's clock says now.
            final: nothing more comes, so all are due.
        """
        plan, oldest_s = self.plan, newest_s - HISTORY_S - WAIT_S
        if np.isfinite(self.last_s):  # a clock that leapt ahead leaves no sample behind
            oldest_s = min(oldest_s, self.last_s - HISTORY_S)
        clock_s, _ = self._buffer(plan.clock).since(oldest_s)
        due_s = np.inf if final else self._due_s(newest_s)
        first, end = np.searchsorted(clock_s, (self.last_s, due_s), side="right")
        stamps = clock_s[first:end]
        stamps = stamps[(-self._phase) % plan.every :: plan.every]
        self._phase = (self._phase + int(end - first)) % plan.every
        if end > first:
            self.last_s = float(clock_s[end - 1])
        if stamps.size == 0:
            return None
        columns: dict[str, Array] = {"time_s": stamps}
        for key, channels in self._by_topic().items():
            buffer = self._buffer(key)
            time_s, rows = buffer.since(oldest_s)
            if not any(one.filtered or one.repeats for one in channels):  # then only what is near counts
                near_s = stamps[0] - max(one.max_gap_s for one in channels)
                first = max(int(np.searchsorted(time_s, near_s)) - 1, 0)
                time_s, rows = time_s[first:], rows[first:]
            if time_s.size:
                self._read(columns, channels, time_s, self._fields(log, key, buffer, time_s, rows))
        return SampleBlock.from_columns(columns)

    def _due_s(self, newest_s: float) -> float:
        """Up to when every channel is known; nothing waits for longer than ``WAIT_S``."""
        ahead: dict[str, float] = {}
        for one in self.plan.channels.values():
            wanted = AHEAD_STEPS / self.plan.table_hz if one.filtered else 0.0
            ahead[one.topic] = max(ahead.get(one.topic, 0.0), wanted)
        known = [self._buffer(key).newest_s - wanted for key, wanted in ahead.items()]
        return max(min(known, default=-np.inf), newest_s - WAIT_S)

    def _by_topic(self) -> dict[str, list[_LiveChannel]]:
        found: dict[str, list[_LiveChannel]] = {}
        for one in self.plan.channels.values():
            found.setdefault(one.topic, []).append(one)
        return found

    def _outputs_key(self) -> str:
        """The topic that surfaces are made of: the first of those that still come."""
        there = [key for name in _OUTPUTS if (key := topic_key(name, 0)) in self._buffers]
        newest_s = max(self._buffers[key].newest_s for key in there)
        return next(key for key in there if self._buffers[key].newest_s > newest_s - SILENT_S)

    def _buffer(self, key: str) -> TopicBuffer:
        return self._buffers[self._outputs_key() if key == _SURFACES_KEY else key]

    def _fields(
        self, log: AutopilotLog, key: str, buffer: TopicBuffer, time_s: Array, rows: NDArray[Any]
    ) -> Mapping[str, NDArray[Any]] | NDArray[Any]:
        """Readings of a topic by field, those of surfaces as the log's reader makes them."""
        if key != _SURFACES_KEY:
            return rows
        topic = buffer.topic_of(time_s, rows)
        found = with_surfaces(replace(log, topics={topic.key: topic})).get(SURFACES_TOPIC)
        lacking = np.full(rows.shape, np.nan)
        return defaultdict(lambda: lacking, {} if found is None else found.fields)

    def _read(
        self,
        columns: dict[str, Array],
        channels: list[_LiveChannel],
        time_s: Array,
        fields: Mapping[str, NDArray[Any]] | NDArray[Any],
    ) -> None:
        """Channels of one topic at the samples' stamps."""
        stamps = columns["time_s"]
        places: dict[tuple[bool, float], Placement] = {}
        for one in channels:
            read = {
                name: (fields[field] if element is None else fields[field][:, element]).astype(np.float64)
                for name, (field, element) in one.columns.items()
            }
            readings = readings_of(one.name, one.entry, time_s, read)
            if readings is None:
                values = np.full(stamps.shape, np.nan)
            else:
                values = self._sampled(one, readings, stamps, places if readings.time_s is time_s else {})
            columns[wire_name(one.name, one.entry)] = values
            if missing := int(np.count_nonzero(~np.isfinite(values))):
                self.unbridged[one.name] = self.unbridged.get(one.name, 0) + missing

    def _sampled(
        self,
        one: _LiveChannel,
        readings: Readings,
        stamps: Array,
        places: dict[tuple[bool, float], Placement],
    ) -> Array:
        """A channel at the samples' stamps; ``places`` keeps where these lie among the readings of its topic."""
        table_hz = self.plan.table_hz if one.filtered else 0.0
        placement = None
        if one.repeats:
            readings = news_of(readings, one.max_gap_s)
        elif not one.entry.delay_s:
            key = readings.held, one.max_gap_s
            if key not in places:
                places[key] = placed(readings.time_s, stamps, one.max_gap_s, readings.held)
            placement = places[key]
        reading = Reading(readings, one.entry.delay_s, one.max_gap_s)
        return on_stamps(reading, stamps, table_hz, one.rate_hz, placement)
