"""The last minutes of a vehicle with an alert: written by the service, read and diagnosed by the worker."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, aircraft_toml, load_aircraft
from wingwatch.operations.diagnosis_files import AIRCRAFT, CHANGE, REQUEST, SAMPLES
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, Cleaner, SampleBlock

__all__ = ["RING_CHANNELS", "ChangeRequest", "diagnose_request"]

RING_CHANNELS = (
    "airspeed_true_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s",
    "specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad",
    "angle_of_attack_rad", "sideslip_rad", "elevator_rad", "aileron_rad", "rudder_rad",
    "elevator_command_rad", "aileron_command_rad", "rudder_command_rad", "throttle", "air_density_kg_m3", "altitude_m",
)  # fmt: skip
"""Channels that are kept of each vehicle, as far as they are there: what a diagnosis reads."""


@dataclass(frozen=True, slots=True)
class ChangeRequest:
    """A diagnosis of an alert.

    Attributes:
        title: what the job is called.
        aircraft: as it is loaded; kinds: of its surface columns.
        onset_s: about when the change began.
        asked: causes that are fitted whatever they promise.
        names: channels; time_s: (samples,); values: (samples, channels), in single precision.
    """

    title: str
    aircraft: Aircraft
    kinds: Mapping[str, str]
    onset_s: float
    asked: Sequence[str]
    names: tuple[str, ...]
    time_s: NDArray[np.float64]
    values: NDArray[np.float32]

    def write(self, folder: Path) -> None:
        """As the worker reads it."""
        (folder / AIRCRAFT).write_text(aircraft_toml(self.aircraft), encoding="utf-8")
        change = {"onset_s": self.onset_s, "kinds": dict(self.kinds), "asked": list(self.asked)}
        (folder / REQUEST).write_text(json.dumps({"file": self.title, CHANGE: change}))
        np.savez(folder / SAMPLES, names=np.array(self.names), time_s=self.time_s, values=self.values)


def diagnose_request(folder: Path, report: Path, progress: Callable[[str, float], None]) -> dict[str, Any]:
    """Diagnose what ``ChangeRequest.write`` wrote; writes the report and returns the result as JSON.

    Raises:
        DiagnosisError: it cannot be diagnosed; the sentence says why.
    """
    from wingwatch.diagnosis.change import change_as_json, diagnose_change, write_change_report

    request = json.loads((folder / REQUEST).read_text())
    change, aircraft = request[CHANGE], load_aircraft(folder / AIRCRAFT)
    found = diagnose_change(
        Cleaner().clean(_block(folder / SAMPLES)).block, aircraft, change["onset_s"], kinds=change["kinds"],
        asked=change["asked"], progress=progress,
    )  # fmt: skip
    write_change_report(found, request["file"], aircraft.name, report)
    return change_as_json(found)


def _block(path: Path) -> SampleBlock:
    with np.load(path) as kept:
        values = np.full((len(kept["time_s"]), len(CHANNELS)), np.nan)
        values[:, CHANNEL_INDEX["time_s"]] = kept["time_s"]
        values[:, [CHANNEL_INDEX[name] for name in kept["names"].tolist()]] = kept["values"]
    return SampleBlock(values)
