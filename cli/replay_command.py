"""`wingwatch replay`: a recording through the whole chain once more."""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from wingwatch import __version__
from wingwatch.aircraft import Aircraft, parse_aircraft
from wingwatch.cli.fleet_display import FleetLines
from wingwatch.cli.replaying import Agreement, Replay
from wingwatch.operations.faults import CommandError, say
from wingwatch.operations.progress import write_json
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.telemetry import SampleBlock, write_flight
from wingwatch.telemetry.recording.reading import Recording, open_recording
from wingwatch.telemetry.recording.recorded_flight import recorded_samples

__all__ = ["run"]

_AIRCRAFT = "aircraft/"


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    recording = open_recording(arguments.recording)
    if not arguments.json:
        print(_about(recording), flush=True)
    if arguments.tables is not None:
        _tell(_tables(recording, arguments.tables), recording, arguments.json)
        return 0
    if recording.version != __version__:
        say(f"recorded by wingwatch {recording.version}, replayed by {__version__}: results may differ")
    if not recording.whole:
        say(
            "files are missing at the beginning or in between: what follows them differs from what was recorded"
        )
    replay = Replay(recording, _finder(recording, arguments.aircraft))
    for text in replay.refused:
        say(text)
    began_s = time.monotonic()
    last_s = _replay(replay, arguments.speed, quiet=arguments.json)
    result = _result(replay, recording, last_s, time.monotonic() - began_s)
    _tell(result, recording, arguments.json)
    return 0


def _about(recording: Recording) -> str:
    at = datetime.fromtimestamp(recording.started_ns / 1e9, UTC)
    files = "1 file" if len(recording.paths) == 1 else f"{len(recording.paths)} files"
    return f"recording of {at:%Y-%m-%d %H:%M:%S} UTC, {files}, wingwatch {recording.version}"


def _finder(recording: Recording, given: Sequence[Path]) -> Callable[[str], Aircraft]:
    """Aircraft by name: of the files given, else those that the recording carries, else the library's."""
    registry = AircraftRegistry(given)
    carried = {}
    for name, data in recording.attachments().items():
        if name.startswith(_AIRCRAFT):
            aircraft = parse_aircraft(data, f"{recording.paths[0]}: {name}")
            carried[aircraft.name] = aircraft

    def find(name: str) -> Aircraft:
        if name in carried and name not in registry.names:
            return carried[name]
        return registry.find(name)

    return find


def _replay(replay: Replay, speed: float | None, quiet: bool) -> float:
    """Everything, at that speed; what changes is said as it comes. The time of the recording in s at its end."""
    lines, began_s, last_s = FleetLines(), time.monotonic(), 0.0
    for last_s in replay.seconds():
        if speed is not None:
            time.sleep(max(0.0, began_s + last_s / speed - time.monotonic()))
        for line in lines.changes(replay.monitor):
            if not quiet:
                print(line, flush=True)
    return last_s


def _result(replay: Replay, recording: Recording, last_s: float, took_s: float) -> dict[str, Any]:
    vehicles = replay.monitor.vehicles()
    agreement = replay.agreement()
    return {
        "started_ns": recording.started_ns,
        "files": [str(path) for path in recording.paths],
        "messages": replay.messages,
        "seconds": last_s,
        "took_s": took_s,
        "vehicles": [
            {"fleet": one.fleet, "vehicle": one.vehicle, "state": str(one.state), "reason": one.reason}
            for one in vehicles
        ],
        "alerts": [
            {"fleet": one.fleet, "vehicle": one.vehicle, "kind": one.kind, "cause": one.cause, "level": one.level,
             "state": str(one.state), "raised_s": one.raised_s, "cleared_s": one.cleared_s, "text": one.text}
            for one in reversed(replay.monitor.alerts())
        ],
        "as_recorded": {**asdict(agreement), "whole": agreement.whole},
        "notes": list(recording.notes),
        "text": _words(agreement, replay.messages, last_s, took_s),
    }  # fmt: skip


def _words(agreement: Agreement, messages: int, last_s: float, took_s: float) -> str:
    lines = [f"{messages} messages of {last_s:.0f} s replayed in {took_s:.1f} s"]
    same, all_of = agreement.estimates_equal, agreement.estimates
    lines.append(f"estimates: {same} of {all_of} recorded ones came again, the same to the bit")
    if agreement.first_difference is not None:
        lines.append(f"the first that differs is {agreement.first_difference}")
    alerts = f"alerts: {agreement.alerts_equal} of {agreement.alerts} recorded ones came again"
    if agreement.alerts_changed:
        alerts += f"; {agreement.alerts_changed} were changed later by a person or a diagnosis, which is not repeated"
    if agreement.further_alerts:
        alerts += f"; {agreement.further_alerts} more came that were not recorded"
    return "\n".join([*lines, alerts])


def _tables(recording: Recording, folder: Path) -> dict[str, Any]:
    """A flight file of each vehicle."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(
            f"--tables {folder}: {(error.strerror or 'unusable').lower()}; name a folder"
        ) from None
    written = {}
    for (fleet, vehicle), samples in recorded_samples(recording).items():
        path = folder / f"{fleet}.{vehicle}.parquet"
        block = SampleBlock.from_columns(samples.columns())
        write_flight(block, path)
        written[f"{fleet}/{vehicle}"] = {"file": str(path), "samples": len(block), "unread": samples.unread}
    if not written:
        raise CommandError(f"{recording.paths[0]}: the recording holds no samples of a vehicle")
    text = "\n".join(f"{name}: {one['samples']} samples in {one['file']}" for name, one in written.items())
    return {"flights": written, "notes": list(recording.notes), "text": text}


def _tell(result: dict[str, Any], recording: Recording, as_json: bool) -> None:
    for note in recording.notes:
        say(note)
    if as_json:
        write_json({name: value for name, value in result.items() if name != "text"})
    else:
        print(result["text"], flush=True)
