"""Channels read from a log's topics, each on the stamps of its own messages."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.expressions import ExpressionError, named_columns
from wingwatch.telemetry.logs.log import AutopilotLog, Topic
from wingwatch.telemetry.logs.ready_map import fields_of
from wingwatch.telemetry.logs.sampling import Placement, Readings, low_passed, sampled, without_repeats
from wingwatch.telemetry.logs.stamps import ClockRuns, clock_runs
from wingwatch.telemetry.maps import ChannelEntry, ChannelMap, MapError, channel_values, is_command

__all__ = ["ChannelReader", "Reading", "holds", "on_stamps", "readings_of"]

Array = NDArray[np.float64]

_PERIODS = {
    "roll_rad": 2.0 * np.pi, "heading_rad": 2.0 * np.pi, "roll_demand_rad": 2.0 * np.pi, "longitude_deg": 360.0,
}  # fmt: skip
_HELD = (
    "airspeed_true_m_s",
    "airspeed_indicated_m_s",
    "throttle",
    "roll_demand_rad",
    "pitch_demand_rad",
    "airspeed_demand_m_s",
    "altitude_demand_m",
)


@dataclass(frozen=True, slots=True)
class Reading:
    """A channel of the run that is read.

    Attributes:
        readings: on their own stamps, in the channel's unit.
        delay_s: how much they lag.
        max_gap_s: over which nothing is bridged.
    """

    readings: Readings
    delay_s: float
    max_gap_s: float


def holds(channel: str, entry: ChannelEntry) -> bool:
    """Whether a reading of a channel counts until the next one: commands, and what an autopilot works out."""
    return is_command(channel, entry) or channel in _HELD


def readings_of(
    channel: str, entry: ChannelEntry, time_s: Array, columns: Mapping[str, Array]
) -> Readings | None:
    """A channel as an entry makes it of columns of one topic; None without a finite value.

    Raises:
        MapError: the entry does not fit the columns.
    """
    made = channel_values(channel, entry, columns)
    held, period = holds(channel, entry), _PERIODS.get(channel, 0.0)
    finite = np.isfinite(made)
    if finite.all() and finite.size:
        return Readings(time_s, made, held, period)
    return Readings(time_s[finite], made[finite], held, period) if finite.any() else None


def on_stamps(
    reading: Reading,
    stamps: Array,
    table_hz: float,
    rate: float | None = None,
    placement: Placement | None = None,
) -> Array:
    """A channel at the table's stamps: filtered where it is faster, interpolated or held where it is slower.

    Args:
        reading: of the channel.
        stamps: of the table, s.
        table_hz: their usual rate.
        rate: usual rate of the readings, where a part of them is all that is here.
        placement: of the stamps among the readings, where it is known already.
    """
    smooth = low_passed(reading.readings, table_hz, rate)
    return sampled(smooth, stamps + reading.delay_s, reading.max_gap_s, placement)


class ChannelReader:
    """Reads channels by a map.

    Args:
        log: with its surfaces.
        rules: the map.

    Attributes:
        left_out: channels without readings in the run that was read last, each with the reason.
    """

    def __init__(self, log: AutopilotLog, rules: ChannelMap) -> None:
        self._log = log
        self._rules = rules
        self._runs: dict[str, ClockRuns] = {}
        self.left_out: dict[str, str] = {}

    def topic(self, channel: str) -> Topic:
        """The topic of a channel; of several the one with most messages.

        Raises:
            MapError: a source that cannot be read, or columns that the log has not.
        """
        found = self._found(channel, self._rules.channels[channel])
        return max((topic for topic, _ in found.values()), key=len)

    def runs(self, topic: Topic) -> ClockRuns:
        """A topic's stamps put right."""
        if topic.key not in self._runs:
            self._runs[topic.key] = clock_runs(topic.time_s)
        return self._runs[topic.key]

    def read(self, channel: str, clock: Topic, index: int) -> Reading | None:
        """A channel during one run of the clock; None, with the reason in ``left_out``, where it has no readings then.

        Raises:
            MapError: the map does not fit the log.
        """
        self.left_out.pop(channel, None)
        entry = self._rules.channels[channel]
        found = self._found(channel, entry)
        base = self.topic(channel)
        gap = entry.max_gap_s or self._rules.max_gap_s
        held = holds(channel, entry)
        rows = self._rows(base, clock, index)
        if rows is None:
            self.left_out[channel] = f"{base.key} has no reading during the run that is read"
            return None
        columns = {}
        for name, (topic, values) in found.items():
            if topic.key == base.key:
                columns[name] = values[rows]
                continue
            other = self._rows(topic, clock, index)
            if other is None:
                self.left_out[channel] = f"{topic.key} has no reading during the run that is read"
                return None
            columns[name] = sampled(
                Readings(topic.time_s[other], values[other], held), base.time_s[rows], gap
            )
        readings = readings_of(channel, entry, base.time_s[rows], columns)
        if readings is None:
            self.left_out[channel] = f"{entry.source} has no finite value"
            return None
        return Reading(without_repeats(readings, gap), entry.delay_s, gap)

    def held(self, name: str, time_s: Array) -> Array:
        """One column at other stamps, held until its next reading.

        Raises:
            ExpressionError: a column that the log has not.
        """
        found = fields_of(self._log, (name,))
        if not found:
            raise ExpressionError(f"the log has no column {name!r}")
        topic, values = found[name]
        runs = self.runs(topic).runs
        rows = max(runs, key=len) if runs else np.zeros(0, dtype=np.int64)
        last = np.searchsorted(topic.time_s[rows], time_s, side="right") - 1
        return (
            np.where(last >= 0, values[rows][np.maximum(last, 0)], np.nan) if rows.size else time_s * np.nan
        )

    def clock_notes(self) -> list[str]:
        """What was dropped for its stamps, by topic."""
        notes = []
        for what, word in (
            ("repeated", "with the stamp of the one before"),
            ("late", "older than the one before"),
            ("off_clock", "stamped far off"),
        ):
            counts = {key: getattr(runs, what) for key, runs in self._runs.items() if getattr(runs, what)}
            if counts:
                listed = ", ".join(f"{key} {count}" for key, count in counts.items())
                notes.append(f"readings {word} are dropped: {listed}")
        return notes

    def _found(self, channel: str, entry: ChannelEntry) -> dict[str, tuple[Topic, Array]]:
        try:
            names = named_columns(entry.source)
        except ExpressionError as problem:
            raise MapError(f"channel {channel}: {problem}") from None
        found = fields_of(self._log, names)
        if found:
            return dict(found)
        if not names:
            raise MapError(f"channel {channel}: {entry.source!r} names no column of the log")
        missing = next(name for name in names if not fields_of(self._log, (name,)))
        raise MapError(f"channel {channel}: the log has no column {missing!r}; {self._hint(missing)}")

    def _hint(self, missing: str) -> str:
        key, dot, _ = missing.partition("].")
        topic = self._log.topics.get(f"{key}]") if dot else None
        names = list(self._log.topics) if topic is None else [f"{topic.key}.{name}" for name in topic.fields]
        shown = ", ".join(names[:12])
        return f"it has {shown}" if len(names) <= 12 else f"it has {shown} and {len(names) - 12} more"

    def _rows(self, topic: Topic, clock: Topic, index: int) -> NDArray[np.int64] | None:
        """The run of a topic that belongs to a run of the clock: the one of the same number, or that overlaps most."""
        runs, own = self.runs(topic).runs, self.runs(clock).runs
        start, end = clock.time_s[own[index][0]], clock.time_s[own[index][-1]]
        overlaps = [min(end, topic.time_s[r[-1]]) - max(start, topic.time_s[r[0]]) for r in runs]
        if not overlaps or max(overlaps) < 0.0:
            return None
        if len(runs) == len(own) and overlaps[index] >= 0.0:
            return runs[index]
        return runs[int(np.argmax(overlaps))]
