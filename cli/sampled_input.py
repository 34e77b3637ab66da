"""A designed or recorded input from a file, as manoeuvres of a simulated flight."""

from pathlib import Path

import numpy as np

from wingwatch.operations.faults import CommandError
from wingwatch.simulation import Sampled, Surface
from wingwatch.telemetry import read_table

__all__ = ["sampled_input"]

_SURFACES: tuple[Surface, ...] = ("elevator", "aileron", "rudder")
_OF_A_FLIGHT = ("airspeed_true_m_s", "airspeed_indicated_m_s", "pitch_rate_rad_s")


def sampled_input(path: Path) -> tuple[tuple[Sampled, ...], float]:
    """The surfaces that a file moves, and how long, in s.

    A file with nothing but ``time_s`` and surfaces has deflections from trim, as ``design-input`` writes them. Of a
    flight table the median of each surface is its trim. Stamps count from the first one.

    Raises:
        CommandError: no time, no surface, or values that cannot be flown.
        TableError: the file cannot be read.
    """
    table = read_table(path)
    columns = table.columns
    if "time_s" not in columns:
        raise CommandError(f"--input {path}: it has no column time_s; name the times of the samples so, in s")
    names = [s for s in _SURFACES if f"{s}_rad" in columns or f"{s}_command_rad" in columns]
    if not names:
        raise CommandError(
            f"--input {path}: it moves no surface; give columns elevator_rad, aileron_rad or rudder_rad"
        )
    time_s = columns["time_s"] - columns["time_s"][0]
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.02
    recorded = any(name in columns for name in _OF_A_FLIGHT)
    made = []
    for name in names:
        values = columns[f"{name}_rad" if f"{name}_rad" in columns else f"{name}_command_rad"]
        if recorded:
            values = values - np.nanmedian(values)
        try:
            made.append(Sampled(name, tuple(time_s.tolist()), tuple(values.tolist()), step_s))
        except ValueError as error:
            raise CommandError(f"--input {path}: {error}") from None
    return tuple(made), float(time_s[-1]) + step_s
