"""Channel maps for logs of autopilots that are known: which candidate of each channel a log really has."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.expressions import ExpressionError, evaluate, evaluate_filter, named_columns
from wingwatch.telemetry.logs.log import AutopilotLog, LogError, Topic, topic_key
from wingwatch.telemetry.logs.sampling import Readings, rate_hz, without_repeats
from wingwatch.telemetry.logs.stamps import clock_runs
from wingwatch.telemetry.maps import ChannelEntry, ChannelMap
from wingwatch.telemetry.sample import MAX_GAP_S

__all__ = ["TAKEN_FOR_ABSENT", "fields_of", "ready_map"]

Array = NDArray[np.float64]

TAKEN_FOR_ABSENT = "taken for absent"
"""What the note on a channel says that reads nothing."""

_MAPS = {"px4": "px4.toml", "ardupilot": "ardupilot.toml"}
_LINK = "mavlink.toml"
_RECEIVERS = ("IMU", "ARSP", "BARO", "GPS")
_HEALTH = {"IMU": ("GH", "AH"), "ARSP": ("H", "Health"), "BARO": ("H", "Health"), "GPS": ()}
_MOST_INSTANCES = 4
_DEAD_AT_ZERO = ("airspeed_", "altitude_", "latitude_", "longitude_", "specific_force_")
"""Channels that a working sensor does not leave at exactly 0 from the first message to the last."""
_SLOW = ("airspeed_", "altitude_", "velocity_", "latitude_", "longitude_")
_GAP_STEPS = 2.5
_MOST_GAP_S = 3.0


@dataclass(frozen=True, slots=True)
class _Candidate:
    """One way to a channel."""

    channel: str
    group: str
    where: str | None
    autopilot: str | None
    entry: Mapping[str, Any]


@dataclass(slots=True)
class _Choice:
    """What has been chosen so far, and what was passed over."""

    channels: dict[str, ChannelEntry] = field(default_factory=dict)
    groups: set[str] = field(default_factory=set)
    notes: dict[str, None] = field(default_factory=dict)


def ready_map(log: AutopilotLog) -> tuple[ChannelMap, tuple[str, ...]]:
    """The map that fits a log, and what was passed over, one clause each.

    Surfaces are in it as fractions of full travel; the deflection at full travel is in no log.

    Args:
        log: with its surfaces (``with_surfaces``).

    Raises:
        LogError: an autopilot that is not known.
    """
    name = _LINK if log.format == "tlog" else _MAPS.get(log.autopilot)
    if name is None:
        raise LogError(
            f"{log.source}: no map is ready for this autopilot ({log.firmware or 'it does not say which'}); "
            "write a channel map (wingwatch log shows what is in the file)"
        )
    chosen = _Choice()
    in_use = {receiver: topic_key(receiver, _working(log, receiver)) for receiver in _RECEIVERS}
    for candidate in _candidates(name):
        if candidate.group not in chosen.groups and candidate.autopilot in (None, log.autopilot):
            _consider(log, candidate, in_use, chosen)
    return ChannelMap(format=1, channels=chosen.channels), tuple(chosen.notes)


@cache
def _candidates(name: str) -> tuple[_Candidate, ...]:
    text = files("wingwatch.telemetry.logs").joinpath("ready", name).read_text(encoding="utf-8")
    return tuple(
        _Candidate(
            one["channel"],
            one.get("group", one["channel"]),
            one.get("where"),
            one.get("autopilot"),
            {
                key: value
                for key, value in one.items()
                if key not in ("channel", "group", "where", "autopilot")
            },
        )
        for one in tomllib.loads(text)["candidates"]
    )


def _working(log: AutopilotLog, name: str) -> int:
    """The lowest instance whose own health flags are set most of the time."""
    for instance in range(_MOST_INSTANCES):
        topic = log.get(name, instance)
        if topic is None or not len(topic):
            continue
        flags = [topic.fields[flag] for flag in _HEALTH[name] if flag in topic.fields]
        if all(np.mean(flag > 0.0) > 0.5 for flag in flags):
            return instance
    return 0


def _consider(log: AutopilotLog, candidate: _Candidate, in_use: Mapping[str, str], chosen: _Choice) -> None:
    """Take a candidate that the log has and that is alive."""
    source = _filled(candidate.entry["source"], in_use)
    found = _values(log, source)
    if found is None:
        return
    topic, values = found
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return
    if candidate.where is not None and not _holds(log, topic, _filled(candidate.where, in_use)):
        return
    if candidate.channel.startswith(_DEAD_AT_ZERO) and not finite.any():
        chosen.notes[f"{source} reads exactly 0 throughout and is {TAKEN_FOR_ABSENT}"] = None
        return
    entry = ChannelEntry.model_validate({**candidate.entry, "source": source})
    chosen.channels[candidate.channel] = _bridged(candidate.channel, entry, topic, values)
    chosen.groups.add(candidate.group)


def _filled(text: str, in_use: Mapping[str, str]) -> str:
    for name, key in in_use.items():
        text = text.replace("{" + name + "}", key)
    return text


def fields_of(log: AutopilotLog, names: tuple[str, ...]) -> Mapping[str, tuple[Topic, Array]] | None:
    """The topic and the readings of each named column; None where the log lacks one."""
    found = {}
    for name in names:
        key, dot, column = name.partition("].")
        topic = log.topics.get(f"{key}]") if dot else None
        if topic is None or column not in topic.fields:
            return None
        found[name] = (topic, topic.fields[column])
    return found


def _values(log: AutopilotLog, source: str) -> tuple[Topic, Array] | None:
    """A source on the stamps of its topic; of several topics the first one's are as good as any to see if it lives."""
    found = fields_of(log, named_columns(source))
    if not found:
        return None
    topic = next(iter(found.values()))[0]
    columns = {name: np.resize(values, len(topic)) for name, (_, values) in found.items()}
    return topic, evaluate(source, columns)


def _holds(log: AutopilotLog, topic: Topic, where: str) -> bool:
    found = fields_of(log, named_columns(where))
    if not found:
        return False
    try:
        holds = evaluate_filter(where, {name: values for name, (_, values) in found.items()})
    except (ExpressionError, ValueError):
        return False
    return bool(np.mean(holds) > 0.5)


def _bridged(channel: str, entry: ChannelEntry, topic: Topic, values: Array) -> ChannelEntry:
    """With a longer gap for what changes slowly and is logged slowly."""
    if not channel.startswith(_SLOW):
        return entry
    runs = clock_runs(topic.time_s).runs
    if not runs:
        return entry
    longest = max(runs, key=len)
    readings = without_repeats(Readings(topic.time_s[longest], values[longest], False), MAX_GAP_S)
    rate = rate_hz(readings.time_s)
    gap = min(_GAP_STEPS / rate, _MOST_GAP_S) if rate > 0.0 else MAX_GAP_S
    return entry if gap < 1.01 * MAX_GAP_S else entry.model_copy(update={"max_gap_s": round(gap, 2)})
