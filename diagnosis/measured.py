"""A measured flight as a replay needs it: evenly spaced samples, cut into windows."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete
from wingwatch.telemetry.conditioning import align

__all__ = [
    "COMMANDS",
    "DiagnosisError",
    "MeasuredFlight",
    "FORCE_X",
    "OUTPUTS",
    "SURFACES",
    "WINDOW_S",
    "Window",
    "finite_mean",
    "measure",
]

Array = NDArray[np.float64]

OUTPUTS: tuple[str, ...] = (
    "airspeed_true_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s",
    "specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad",
    "angle_of_attack_rad", "sideslip_rad", "elevator_rad", "aileron_rad", "rudder_rad",
)  # fmt: skip
"""Channels that are simulated and compared. A surface is compared where position and command are both measured."""

FORCE_X = OUTPUTS.index("specific_force_x_m_s2")

SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")
COMMANDS = ("elevator_command_rad", "aileron_command_rad", "rudder_command_rad")

WINDOW_S = 8.0
"""Length of a window: longer than the fast modes, shorter than it takes small errors to become large motion."""

SHORTEST_S = 2.5
MAX_GAP_S = 0.1
SHORTEST_FLIGHT_S = 10.0
LEAD_S = 0.3
"""Start of a window that is simulated but not compared, so that a reading may be late."""

_LEAST_SPEED_M_S = 3.0


class DiagnosisError(ValueError):
    """A flight that cannot be diagnosed; the sentence says why and what to do."""


@dataclass(frozen=True, slots=True)
class Window:
    """A span without gaps: rows ``start`` to ``stop`` (not included) of the even samples."""

    start: int
    stop: int


@dataclass(frozen=True)
class MeasuredFlight:
    """Even samples of one flight.

    Attributes:
        time_s: (samples,); dt_s: their step.
        outputs: (samples, len(OUTPUTS)), NaN where not measured.
        flown: surface positions that are flown, (samples, 3), NaN where only the command is known.
        commands: (samples, 3), NaN where unknown.
        throttle: (samples,), NaN where unknown.
        density_kg_m3, altitude_m: (samples,).
        noise_std: of each output, as the aircraft file states it, else from the samples' roughness.
        surface_noise_std: of the positions that are flown, likewise, NaN where none is; (3,).
        windows: those that are used.
    """

    time_s: Array
    dt_s: float
    outputs: Array
    flown: Array
    commands: Array
    throttle: Array
    density_kg_m3: Array
    altitude_m: Array
    noise_std: Array
    surface_noise_std: Array
    windows: tuple[Window, ...]

    @cached_property
    def compared(self) -> tuple[int, ...]:
        """Outputs that are measured."""
        return tuple(int(k) for k in np.flatnonzero(np.isfinite(self.outputs).any(axis=0)))

    @property
    def airspeed_m_s(self) -> float:
        """Mean true airspeed."""
        return float(np.nanmean(self.outputs[:, 0]))

    @property
    def seconds(self) -> float:
        """Of all windows."""
        return sum(w.stop - w.start for w in self.windows) * self.dt_s


def finite_mean(rows: Array) -> Array:
    """Mean of each column's finite values; 0 where there is none."""
    there = np.isfinite(rows)
    return np.asarray(np.where(there, rows, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1))


def measure(
    block: SampleBlock, aircraft: Aircraft, kinds: Mapping[str, str], window_s: float = WINDOW_S
) -> MeasuredFlight:
    """Even samples and windows of a flight.

    Args:
        block: samples; stated delays are taken out.
        aircraft: its file.
        kinds: ``command`` for surface columns that are commands; others are positions.
        window_s: length of a window.

    Raises:
        DiagnosisError: no airspeed, rates, attitude or surface; or less than 10 s of flight.
    """
    block = align(complete(block), aircraft.sensors.delay_s)
    _demand(block)
    time_s, dt_s = _clock(block)
    outputs = _sampled(block, OUTPUTS, time_s)
    commands = _sampled(block, COMMANDS, time_s)
    flown = outputs[:, 11:14].copy()
    for j, name in enumerate(SURFACES):
        only_command = kinds.get(name, "position") == "command"
        if only_command or (COMMANDS[j] in block.present and not _measured_position(block, j)):
            commands[:, j] = np.where(np.isfinite(commands[:, j]), commands[:, j], flown[:, j])
            flown[:, j] = outputs[:, 11 + j] = np.nan
        elif not np.isfinite(commands[:, j]).any():
            outputs[:, 11 + j] = np.nan
    known = np.isfinite(outputs)  # a channel at rest is known, though nothing is to be learned from it
    _without_constants(outputs, commands)
    others = _sampled(block, ("throttle", "air_density_kg_m3", "altitude_m"), time_s)
    windows = _windows(known, outputs, flown, commands, others, (dt_s, window_s))
    if not windows:
        raise DiagnosisError(
            f"the flight has no {SHORTEST_S:g} s without a gap; a diagnosis needs {SHORTEST_FLIGHT_S:g} s of flight"
        )
    flight = MeasuredFlight(
        time_s, dt_s, outputs, flown, commands, others[:, 0], others[:, 1], others[:, 2],
        _noise(outputs, OUTPUTS, aircraft), _noise(flown, SURFACES, aircraft), windows,
    )  # fmt: skip
    if flight.seconds < SHORTEST_FLIGHT_S:
        raise DiagnosisError(
            f"the flight has {flight.seconds:.1f} s without gaps; a diagnosis needs {SHORTEST_FLIGHT_S:g} s"
        )
    return flight


def _demand(block: SampleBlock) -> None:
    present = set(block.present)
    needed = [*OUTPUTS[:9], "altitude_m"]
    missing = [name for name in needed if name not in present]
    if missing:
        raise DiagnosisError(f"the flight has no {', '.join(missing)}; a replay needs them, map them (--map)")
    for position, command in zip(SURFACES, COMMANDS, strict=True):
        if position not in present and command not in present:
            raise DiagnosisError(
                f"the flight has neither {position} nor {command}; a replay needs all three surfaces "
                "(map a surface that does not move to the constant 0)"
            )


def _measured_position(block: SampleBlock, j: int) -> bool:
    """Whether a position is more than a copy of its command."""
    position, command = block.column(SURFACES[j]), block.column(COMMANDS[j])
    both = np.isfinite(position) & np.isfinite(command)
    return bool(np.isfinite(position).any()) and not np.array_equal(position[both], command[both])


def _clock(block: SampleBlock) -> tuple[Array, float]:
    stamps = block.time_s[np.isfinite(block.time_s)]
    steps = np.diff(stamps)
    steps = steps[steps > 0.0]
    if steps.size == 0:
        raise DiagnosisError("the flight has fewer than two samples; a diagnosis needs 10 s of flight")
    dt_s = float(np.median(steps))
    if dt_s > 0.1:
        raise DiagnosisError(f"the flight has {1.0 / dt_s:.1f} samples a second; a replay needs 10 or more")
    return stamps[0] + dt_s * np.arange(math.floor((stamps[-1] - stamps[0]) / dt_s + 1e-6) + 1), dt_s


def _sampled(block: SampleBlock, names: tuple[str, ...], time_s: Array) -> Array:
    """Columns at even times, on straight lines between samples; NaN in gaps."""
    out = np.full((time_s.size, len(names)), np.nan)
    stamps = block.time_s
    for j, name in enumerate(names):
        column = block.values[:, CHANNEL_INDEX[name]]
        good = np.isfinite(column) & np.isfinite(stamps)
        if good.sum() < 2:
            continue
        at, value = stamps[good], column[good]
        order = np.argsort(at, kind="stable")
        at, value = at[order], value[order]
        after = np.clip(np.searchsorted(at, time_s), 1, at.size - 1)
        near = at[after] - at[after - 1] <= MAX_GAP_S + 1e-9
        inside = (time_s >= at[0] - 1e-9) & (time_s <= at[-1] + 1e-9)
        out[:, j] = np.where(near & inside, np.interp(time_s, at, value), np.nan)
    return out


def _without_constants(outputs: Array, commands: Array) -> None:
    """A channel that never changes is no measurement, but for a surface that does not follow a command that moves."""
    first = outputs.shape[1] - commands.shape[1]
    for j in range(outputs.shape[1]):
        seen = outputs[np.isfinite(outputs[:, j]), j]
        if j >= first and np.nanmax(commands[:, j - first], initial=-np.inf) > np.nanmin(
            commands[:, j - first], initial=np.inf
        ):
            continue
        if seen.size and np.ptp(seen) == 0.0:
            outputs[:, j] = np.nan


def _windows(
    known: NDArray[np.bool_],
    outputs: Array,
    flown: Array,
    commands: Array,
    others: Array,
    lengths_s: tuple[float, float],
) -> tuple[Window, ...]:
    """Spans of ``window_s`` in which every input is known; what is left of a span is spread over its windows."""
    dt_s, window_s = lengths_s
    inputs = np.isfinite(flown) | np.isfinite(commands)
    whole = inputs.all(axis=1) & np.isfinite(others[:, 1:]).all(axis=1)
    whole &= known[:, [0, 1, 2, 3, 7, 8]].all(axis=1) & (outputs[:, 0] > _LEAST_SPEED_M_S)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], whole.astype(np.int8), [0]])))
    windows: list[Window] = []
    for first, last in edges.reshape(-1, 2):
        seconds = (last - first) * dt_s
        if seconds < SHORTEST_S:
            continue
        count = max(1, round(seconds / window_s))
        cuts = np.linspace(first, last, count + 1).round().astype(int)
        windows += [Window(int(a), int(b)) for a, b in itertools.pairwise(cuts)]
    return tuple(windows)


def _noise(outputs: Array, names: Sequence[str], aircraft: Aircraft) -> Array:
    """Stated standard deviations, else by third differences; at least 1e-4 of a channel's own spread."""
    noise = np.full(outputs.shape[1], np.nan)
    for j, name in enumerate(names):
        column = outputs[:, j]
        if not np.isfinite(column).any():
            continue
        rough = np.diff(column, 3)
        rough = rough[np.isfinite(rough)]
        stated = aircraft.noise_std(name)
        found = math.sqrt(float(np.median(rough**2)) / 0.455 / 20.0) if rough.size else 0.0
        noise[j] = max(stated or found, 1e-4 * float(np.nanstd(column)), 1e-12)
    return noise
