"""What a recorded flight says of its sensors, its air and its trims: every step of conditioning in its order."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import SURFACES, Aircraft, coefficient_standard_error
from wingwatch.diagnosis.static_derivatives import StaticDerivatives, static_derivatives, static_margin
from wingwatch.diagnosis.tracking import Track, untracked
from wingwatch.telemetry import Cleaner, FlightTable, SampleBlock, load_flight
from wingwatch.telemetry.conditioning import (
    AirConfig,
    AirQuality,
    DelayConfig,
    Parameter,
    PathConfig,
    ReconstructedPath,
    align,
    at_centre,
    centre_of_gravity,
    estimate_delays,
    estimate_servo_delay,
    imu_separation,
    reconstruct_path,
    steady_segments,
    turbulence_intensity,
    without_errors,
)

__all__ = ["PATH_S", "Conditioned", "DelayRow", "condition"]

PATH_S = 600.0
"""The path is reconstructed over at most so much of a flight: its smoother keeps every sample's covariance."""

_CERTAIN = 3.0
"""A delay takes the stated one's place where they differ by more than so many standard errors."""

_LEAST_AIRSPEED_M_S = 1.0
_FORCES = tuple(f"specific_force_{axis}_m_s2" for axis in "xyz")


@dataclass(frozen=True, slots=True)
class DelayRow:
    """One channel's delay: as found, as the aircraft file states it, and what is believed."""

    channel: str
    found: Parameter
    stated_s: float
    used_s: float


@dataclass(slots=True)
class Conditioned:
    """All that was found; a part that could not be had is None or empty, and ``notes`` says why.

    Attributes:
        samples: accepted by the cleaner.
        cleaning_text: what cleaning did.
        delays: of channels behind the gyros.
        servos: of surfaces behind their commands, with time constants.
        air: how rough it was.
        path: sensor errors, from at most ``PATH_S`` of the flight.
        static: from trimmed segments.
        margin: the static margin from these and the elevator's power by the aircraft file; None where it states none.
        centre: place of the second IMU from the first, and of the centre of gravity from where the file has it.
        corrected: the table with delays beyond the stated ones and sensor errors taken out.
        notes: what could not be had, one sentence each.
    """

    samples: int
    cleaning_text: str
    delays: list[DelayRow] = field(default_factory=list)
    servos: tuple[Parameter, ...] = ()
    air: AirQuality | None = None
    path: ReconstructedPath | None = None
    static: StaticDerivatives | None = None
    margin: Parameter | None = None
    centre: tuple[Parameter, ...] = ()
    corrected: SampleBlock | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        """Whether no step has found anything."""
        segments = self.static is not None and self.static.segments > 0
        return not any((self.delays, self.servos, self.air, self.path, segments, self.centre))


def condition(
    flight: FlightTable,
    aircraft: Aircraft,
    second_imu: Path | None,
    track: Track = untracked,
    path_s: float = PATH_S,
) -> Conditioned:
    """Every step on one flight.

    Args:
        flight: as loaded.
        aircraft: where its sensors sit, their noise and delays, its mass and size.
        second_imu: a channel map of the same file whose specific forces are those of a second accelerometer triad.
        track: shows the steps.
        path_s: from how much of the flight sensor errors are found; time and memory grow with it.
    """
    cleaner = Cleaner()
    clean = cleaner.clean(flight.block).block
    result = Conditioned(len(clean), f"{flight.report.text}; {cleaner.report.text}")
    run = _Steps(flight, aircraft, clean, second_imu, result, path_s)
    steps = (run.delays, run.servos, run.air, run.path, run.static, run.centre)
    for step in track(steps, "conditioning"):
        try:
            step()
        except ValueError as error:  # what a step needs and the flight has not, in one sentence
            result.notes.append(f"{step.__name__.replace('_', ' ')}: {error}")
    result.corrected = run.corrected()
    return result


class _Steps:
    """The steps, each going on from what those before it have left."""

    def __init__(
        self,
        flight: FlightTable,
        aircraft: Aircraft,
        clean: SampleBlock,
        second_imu: Path | None,
        result: Conditioned,
        path_s: float,
    ) -> None:
        self._flight, self._aircraft, self._clean = flight, aircraft, clean
        self._second_imu, self._result, self._path_s = second_imu, result, path_s
        self._vane = aircraft.sensors.vane_position_m
        self._imu = aircraft.sensors.imu_position_m
        self._stated: Mapping[str, float] = aircraft.sensors.delay_s
        self._aligned = align(clean, self._stated)

    def delays(self) -> None:
        """Delays of channels; the table goes on aligned by those that are believed."""
        c = DelayConfig(vane_position_m=self._vane, imu_position_m=self._imu)
        rows = []
        for found in estimate_delays(self._clean, c):
            channel = found.name.removeprefix("delay of ")
            stated = self._aircraft.delay_s(channel) - self._gyro_delay_s()
            off = found.observable and abs(found.value - stated) > _CERTAIN * found.standard_error
            used = (found.value if off else stated) + self._gyro_delay_s()
            rows.append(DelayRow(channel, found, stated, used))
        self._result.delays = rows
        believed = {**self._stated, **{row.channel: row.used_s for row in rows}}
        self._aligned = align(self._clean, believed)

    def _gyro_delay_s(self) -> float:
        """What the file states of the gyros: delays are found from them, and stated from the true instant."""
        return self._aircraft.delay_s("pitch_rate_rad_s")

    def servos(self) -> None:
        """Delays of surfaces whose position and command are both measured."""
        found: list[Parameter] = []
        for surface in SURFACES:
            name = f"{surface}_rad"
            both = {name, f"{surface}_command_rad"} <= set(self._clean.present)
            if both and self._flight.kinds.get(name) == "position":
                found += estimate_servo_delay(self._clean, surface)
        self._result.servos = tuple(found)

    def air(self) -> None:
        """Strength of the gusts."""
        self._result.air = turbulence_intensity(
            self._aligned, AirConfig(vane_position_m=self._vane, imu_position_m=self._imu)
        )

    def path(self) -> None:
        """Biases and scale errors."""
        speed_m_s = self._aligned.column("airspeed_true_m_s")
        if speed_m_s.size and float(np.median(speed_m_s)) < _LEAST_AIRSPEED_M_S:
            raise ValueError(
                f"the median airspeed is below {_LEAST_AIRSPEED_M_S:g} m/s; give a flight, or correct its unit"
            )
        stamps = self._aligned.time_s
        part = SampleBlock(self._aligned.values[stamps <= stamps[:1] + self._path_s])
        if len(part) < len(self._aligned):
            self._result.notes.append(f"path: sensor errors are those of the first {self._path_s:.0f} s")
        self._result.path = reconstruct_path(
            part,
            PathConfig(self._vane, self._imu, self._aircraft.sensors.noise_std, gust_std_m_s=self._gusts()),
        )

    def _gusts(self) -> tuple[float, float, float]:
        """Standard deviations of the gusts u, v, w; along the path no sensor tells, and Dryden's are alike."""
        if self._result.air is None:
            self._result.notes.append("path: without vanes the air is taken as still")
            return (0.0, 0.0, 0.0)
        by_name = {p.name: p.value for p in self._result.air.sigma if p.observable}
        down, across = by_name.get("vertical gust", 0.0), by_name.get("lateral gust", 0.0)
        return (max(down, across), across, down)

    def static(self) -> None:
        """Ratios of derivatives from trimmed segments."""
        mass = self._aircraft.need_mass("static derivatives").mass_kg
        area = self._aircraft.need_geometry("static derivatives").wing_area_m2
        at_rest = at_centre(self._without_errors(self._aligned), self._vane, self._imu)
        self._result.static = found = static_derivatives(steady_segments(at_rest), mass, area)
        if (coefficients := self._aircraft.coefficients) is not None:
            error = coefficient_standard_error(coefficients, "Cm_elevator")
            self._result.margin = static_margin(found, coefficients.Cm.elevator, error)

    def centre(self) -> None:
        """Centre of gravity from two triads of accelerometers."""
        if self._second_imu is None:
            return
        other = load_flight(Path(self._flight.source), self._second_imu).block
        forces = _at_stamps(other, self._clean.time_s)
        separation = imu_separation(self._clean, forces)
        self._result.centre = separation
        if not all(p.observable for p in separation):
            self._result.notes.append(
                "centre: the second triad's place is not known, so neither is the centre's"
            )
            return
        second = tuple(a + p.value for a, p in zip(self._imu, separation, strict=True))
        places = [self._imu, (second[0], second[1], second[2])]
        centre = centre_of_gravity(self._clean, places, (forces,))
        # the centre is counted from the triads' mean place, half of whose doubt is the separation's
        self._result.centre += tuple(
            Parameter(
                c.name, c.value, float(np.hypot(c.standard_error, 0.5 * s.standard_error)), c.unit, c.observable,
                c.reason,
            )
            for c, s in zip(centre, separation, strict=True)
        )  # fmt: skip

    def _without_errors(self, block: SampleBlock) -> SampleBlock:
        path = self._result.path
        return block if path is None else without_errors(block, path.parameters)

    def corrected(self) -> SampleBlock:
        """The table as the aircraft file promises it: delays as stated there, sensors without errors."""
        extra = {row.channel: row.used_s - self._aircraft.delay_s(row.channel) for row in self._result.delays}
        return self._without_errors(align(self._clean, extra))


def _at_stamps(other: SampleBlock, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Specific forces of a table at stamps (n,), shape (n, 3); NaN where it has no row of that very stamp."""
    stamps, first = np.unique(other.time_s, return_index=True)
    place = np.clip(np.searchsorted(stamps, time_s), 0, len(stamps) - 1)
    forces = np.stack([other.column(name) for name in _FORCES], axis=1)[first][place]
    return np.where((stamps[place] == time_s)[:, None], forces, np.nan)
