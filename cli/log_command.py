"""`wingwatch log`: what a log or a table holds, and what can be estimated from it."""

import argparse
import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import load_aircraft
from wingwatch.cli.usable_channels import mode_sentence, usable
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import check_output
from wingwatch.operations.progress import page, write_json
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.pages.whole_file import write_whole
from wingwatch.telemetry import (
    CHANNEL_INDEX,
    CHANNELS,
    ChannelMap,
    RowSelection,
    load_map,
    read_table,
)
from wingwatch.telemetry.logs import (
    AutopilotLog,
    LogError,
    LogTable,
    is_autopilot_log,
    log_table,
    map_text,
    read_autopilot_log,
)
from wingwatch.telemetry.logs.sampling import rate_hz
from wingwatch.telemetry.logs.stamps import clock_runs
from wingwatch.telemetry.maps import apply_map, with_travel
from wingwatch.telemetry.units import SERVO_UNITS

__all__ = ["run"]

_FRACTION = "of full travel"


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    file, out = arguments.file, arguments.write_map
    check_output("--write-map", out, (".toml",))
    travel = {} if arguments.aircraft is None else surface_travel(load_aircraft(arguments.aircraft))
    rules = None if arguments.map is None else load_map(arguments.map)
    if is_autopilot_log(file):
        log = read_autopilot_log(file)
        if log.vehicle == "multicopter" or rules is not None:
            table: LogTable | None = log_table(log, rules, travel, describing=True)
        else:
            table = _table_or_none(log, travel)
        result = _log_object(log, table, travel)
        if out is not None:
            if table is None:
                raise CommandError(f"--write-map {out}: {result['reason']}")
            write_whole(out, _map_text(log, table, travel))
    else:
        if out is not None:
            raise CommandError(
                f"--write-map {out}: {file} is a table, not an autopilot's log; no map is ready for it"
            )
        result = _table_object(file, rules, travel)
    result["map"] = None if out is None else str(out)
    if arguments.json:
        write_json(result)
    else:
        _show(page(), result)
    return 0


def _table_or_none(log: AutopilotLog, travel: Mapping[str, float]) -> LogTable | None:
    """The log's channels; None where no map is ready or no clock is there, and then its topics are still shown."""
    try:
        return log_table(log, None, travel, describing=True)
    except LogError:
        return None


def _log_object(log: AutopilotLog, table: LogTable | None, travel: Mapping[str, float]) -> dict[str, Any]:
    result: dict[str, Any] = {
        "file": log.source,
        "format": log.format,
        "vehicle": log.vehicle or None,
        "autopilot": log.autopilot or None,
        "firmware": log.firmware or None,
        "topics": [_topic(log, key) for key in sorted(log.topics)],
    }
    if table is None:
        reason = "no map is ready for this log; write a channel map on its topics"
        return result | {
            "duration_s": _duration(log),
            "channels": [],
            "notes": list(log.notes),
            "reason": reason,
        }
    channels = [
        {
            "channel": name,
            "unit": _unit(name, table.rules, travel),
            "source": facts.source,
            "rate_hz": facts.rate_hz,
            "gaps": facts.gaps,
            "low": facts.low,
            "high": facts.high,
            "missing_rows": facts.missing_rows,
            "quality": facts.quality,
        }
        for name, facts in table.channels.items()
    ]
    return result | {
        "duration_s": table.duration_s,
        "airborne_s": sum(one.duration_s for one in table.intervals),
        "flight_s": table.flight_s,
        "airborne": [{"from_s": one.from_s, "to_s": one.to_s} for one in table.intervals],
        "rows": int(table.columns["time_s"].size),
        "channels": channels,
        **usable({"time_s", *table.channels}),
        "notes": list(table.notes),
    }


def _topic(log: AutopilotLog, key: str) -> dict[str, Any]:
    topic = log.topics[key]
    runs = clock_runs(topic.time_s).runs
    stamps = topic.time_s[max(runs, key=len)] if runs else np.zeros(0)
    return {"name": key, "messages": len(topic), "rate_hz": rate_hz(stamps), "fields": list(topic.fields)}


def _duration(log: AutopilotLog) -> float:
    spans = [float(np.ptp(t.time_s[r])) for t in log.topics.values() for r in clock_runs(t.time_s).runs]
    return max(spans, default=0.0)


def _unit(name: str, rules: ChannelMap, travel: Mapping[str, float]) -> str:
    """A surface whose travel nobody has stated is shown as a fraction of it."""
    unit = CHANNELS[CHANNEL_INDEX[name]].unit
    entry = with_travel(rules, travel).channels.get(name)
    servo = entry is not None and entry.unit in SERVO_UNITS and entry.full_deflection_rad is None
    return _FRACTION if servo and unit == "rad" else unit


def _table_object(file: Path, rules: ChannelMap | None, travel: Mapping[str, float]) -> dict[str, Any]:
    """The same of a table: its columns, and those that are channels."""
    raw = read_table(file)
    named = {name: raw.columns[name] for name in CHANNEL_INDEX if name in raw.columns}
    if rules is not None:
        named = dict(apply_map(with_travel(rules, travel), raw.columns).columns)
    stamps = named.get("time_s", np.zeros(0))
    known = stamps[np.isfinite(stamps)]
    return {
        "file": str(file),
        "format": raw.format,
        "duration_s": float(np.ptp(known)) if known.size else None,
        "rows": len(raw),
        "channels": [
            {
                "channel": name,
                "unit": CHANNELS[CHANNEL_INDEX[name]].unit,
                "rate_hz": rate_hz(known),
                **_range(values),
            }
            for name, values in named.items()
            if name != "time_s"
        ],
        "columns": [
            {"column": name, **_range(v)} for name, v in raw.columns.items() if name not in CHANNEL_INDEX
        ],
        **usable(set(named)),
        "notes": [*raw.notes, *(f"not readable: {one}" for one in raw.ignored)],
    }


def _range(values: "np.ndarray[Any, np.dtype[np.float64]]") -> dict[str, Any]:
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (None, None)
    return {"low": low, "high": high, "missing_rows": int(values.size - known.size)}


def _map_text(log: AutopilotLog, table: LogTable, travel: Mapping[str, float]) -> str:
    """The map with the flight's window, and with the travels where they are known."""
    rules = with_travel(table.rules, travel)
    if table.intervals and rules.rows == RowSelection():
        longest = max(table.intervals, key=lambda one: one.duration_s)
        rules = rules.model_copy(update={"rows": RowSelection(from_s=longest.from_s, to_s=longest.to_s)})
    comments = [f"How wingwatch reads {Path(log.source).name}. Stamps are seconds since boot."]
    if any(e.unit in SERVO_UNITS and e.full_deflection_rad is None for e in rules.channels.values()):
        comments.append(
            "A surface in norm takes its angle at full travel from the aircraft file ([actuators.elevator]\n"
            "position_limit_rad and so on), or from full_deflection_rad = ... in its entry."
        )
    return map_text(rules, tuple(comments))


def _show(console: Console, result: Mapping[str, Any]) -> None:
    words = [result.get("vehicle"), result.get("autopilot"), result.get("firmware")]
    console.print(
        f"[bold]{escape(result['file'])}[/]  {result['format']}  {escape(', '.join(w for w in words if w))}"
    )
    if result.get("duration_s") is not None:
        airborne = "".join(f", airborne {result['airborne_s']:.1f} s" for _ in range("airborne_s" in result))
        console.print(f"{result['duration_s']:.1f} s{airborne}", highlight=False)
    if result["channels"]:
        console.print(_channels(result["channels"]))
    for title, key, column in (("other columns", "columns", "column"), ("topics", "topics", "name")):
        if result.get(key) and (key == "columns" or not result["channels"]):
            console.print(f"{title}: {escape(', '.join(str(one[column]) for one in result[key]))}")
    if result.get("missing"):
        console.print(f"missing: {', '.join(result['missing'])}")
    for name, mode in result.get("modes", {}).items():
        console.print(mode_sentence(name, mode))
    if result.get("reconstructed") and any(m["can_be_estimated"] for m in result["modes"].values()):
        console.print("without vanes the velocities are reconstructed from the accelerometers")
    if result.get("reason"):
        console.print(escape(result["reason"]))
    for note in result["notes"]:
        console.print(escape(note), style="dim")
    if result["map"]:
        console.print(f"map in {escape(result['map'])}")


def _channels(channels: Collection[Mapping[str, Any]]) -> Table:
    table = Table()
    for name in ("channel", "unit", "source", "Hz", "gaps", "from", "to", "quality"):
        justify: Literal["right", "left"] = "right" if name in ("Hz", "gaps", "from", "to") else "left"
        table.add_column(name, justify=justify, overflow="fold")
    for one in channels:
        gaps = str(one["gaps"]) if "gaps" in one else "-"
        table.add_row(
            one["channel"], one["unit"], escape(str(one.get("source", "-"))), _number(one["rate_hz"]), gaps,
            _number(one["low"]), _number(one["high"]), str(one.get("quality", "-")),
        )  # fmt: skip
    return table


def _number(value: float | None) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:.4g}"
