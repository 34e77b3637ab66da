"""Cases flown by the project's own simulation at a finer step, with its own effects from the first instant on.

The finder gets the library's aircraft file, its noise as the sensors have it. The autopilot is always closed; it holds
airspeed, altitude and heading and lets doublets, 3-2-1-1 and multisines through.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from diagnosis_draw import drawn, flyable
from diagnosis_hidden import CATALOGUE, SURFACES, Array, Case, Hidden

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    AircraftDataError,
    FlightCondition,
    TrimError,
    analysis_band_hz,
    deal_harmonics,
    load_aircraft,
    schroeder_phases_rad,
)
from wingwatch.simulation import (
    Effect,
    FleetSimulation,
    Manoeuvre,
    Multisine,
    Scenario,
    doublet_schedule,
    parse_effect,
    three_two_one_one_schedule,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = ["SimulatedPlan", "draw_simulation"]

AIRCRAFT = ("aerosonde", "twinotter", "ultrastick25e")
RATE_HZ = 50
REFINE = 4
"""Integration steps of the simulated flight over those that its own accuracy asks for."""
Turbulence = Literal["none", "light", "moderate"]
TURBULENCE: tuple[Turbulence, ...] = ("none", "light", "moderate")
HOW_OFTEN = (0.5, 0.4, 0.1)
COMMAND_ONLY = 0.1
"""Share of flights whose record has no measured surface positions."""
_NEEDS_POSITION = ("actuator_", "surface_")


@dataclass(frozen=True, slots=True)
class SimulatedPlan:
    """How a case is flown, all but its effects.

    Attributes:
        seed: of noise and turbulence.
        aircraft: the file.
        condition: where it flies, and where its held-out flight does.
        manoeuvres: of the flight and of the held-out flight.
        seconds: of each.
        turbulence: of both.
        command_only: the record has no surface positions.
        name: of a fixed case.
    """

    seed: int
    aircraft: Aircraft
    condition: FlightCondition
    manoeuvres: tuple[tuple[Manoeuvre, ...], tuple[Manoeuvre, ...]]
    seconds: float = 60.0
    turbulence: Turbulence = "none"
    command_only: bool = False
    name: str = ""

    def ideal(self, effects: Sequence[Hidden]) -> Array | None:
        """The flight in still air without noise; None where the aircraft cannot have the effects or be flown."""
        flights = self._flown([self._scenario(effects, 0, ideal=True)])
        return None if flights is None else flights[0]

    def case(self, effects: Sequence[Hidden], signal: float) -> Case | None:
        """The case, None where the aircraft cannot have the effects or be flown."""
        flights = self._flown([self._scenario(effects, which) for which in (0, 1)])
        if flights is None:
            return None
        kind = "command" if self.command_only else "position"
        return Case(
            "simulation", self.seed, self.aircraft, SampleBlock(flights[0]), SampleBlock(flights[1]),
            {f"{surface}_rad": kind for surface in SURFACES}, tuple(effects), self.turbulence, signal, self.name,
        )  # fmt: skip

    def _scenario(self, effects: Sequence[Hidden], which: int, ideal: bool = False) -> Scenario:
        """Of the flight (0) or the held-out one (1); ``ideal`` in still air without noise."""
        return Scenario(
            self.aircraft,
            self.condition.airspeed_true_m_s,
            self.condition.altitude_m,
            self.manoeuvres[which],
            tuple(as_effect(hidden) for hidden in effects),
            "none" if ideal else self.turbulence,
            seed=2 * self.seed + which,
            noise=not ideal,
        )

    def _flown(self, scenarios: Sequence[Scenario]) -> list[Array] | None:
        """Flight tables, (samples, channels)."""
        try:
            fleet = FleetSimulation(scenarios, RATE_HZ, refine=REFINE)
        except (AircraftDataError, TrimError):
            return None
        values = fleet.step(round(RATE_HZ * self.seconds))
        if self.command_only:
            for surface in SURFACES:
                command = values[..., CHANNEL_INDEX[f"{surface}_command_rad"]]
                values[..., CHANNEL_INDEX[f"{surface}_rad"]] = command
        return list(values) if all(flyable(flight) for flight in values) else None


@cache
def _library(name: str) -> Aircraft:
    return load_aircraft(name)


def draw_simulation(seed: int, count: int) -> Case:
    """A case with ``count`` effects; what is flown goes by the seed alone, so a healthy case has the same flight.

    Raises:
        RuntimeError: none of many draws could be flown and seen.
    """
    plan = _plan(np.random.default_rng([seed, 1]), seed)
    rows = [r for r in CATALOGUE if not (plan.command_only and r.name.startswith(_NEEDS_POSITION))]
    return drawn(plan, rows, np.random.default_rng([seed, 2]), count)


def _plan(rng: np.random.Generator, seed: int) -> SimulatedPlan:
    stated = _library(AIRCRAFT[rng.integers(len(AIRCRAFT))])
    louder = float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
    noise = {column: louder * std for column, std in stated.sensors.noise_std.items()}
    aircraft = stated.model_copy(update={"sensors": stated.sensors.model_copy(update={"noise_std": noise})})
    assert aircraft.envelope is not None
    cruise, (low, high) = aircraft.envelope.cruise, aircraft.envelope.airspeed_true_m_s
    airspeed = float(np.clip(cruise.airspeed_true_m_s * rng.uniform(0.92, 1.15), 1.02 * low, 0.98 * high))
    condition = FlightCondition(round(airspeed, 1), round(cruise.altitude_m * rng.uniform(0.6, 1.4)))
    seconds = float(rng.integers(60, 121))
    level = np.radians(rng.uniform(1.5, 4.0 if stated.name != "twinotter" else 3.0))
    turbulence = TURBULENCE[rng.choice(len(TURBULENCE), p=HOW_OFTEN)]
    flights = [_manoeuvres(rng, aircraft, condition, float(level), seconds) for _ in range(2)]
    return SimulatedPlan(
        seed, aircraft, condition, (flights[0], flights[1]), seconds, turbulence,
        command_only=bool(rng.random() < COMMAND_ONLY),
    )  # fmt: skip


def _manoeuvres(
    rng: np.random.Generator,
    aircraft: Aircraft,
    condition: FlightCondition,
    amplitude_rad: float,
    seconds: float,
) -> tuple[Manoeuvre, ...]:
    """Doublets, 3-2-1-1 or multisines of all surfaces over a flight, or doublets and then multisines."""
    kind = rng.integers(4)
    period_s, start_s = float(rng.uniform(18.0, 28.0)), float(rng.uniform(2.0, 6.0))

    def doublets(size: float) -> Manoeuvre:
        return doublet_schedule(
            aircraft, condition, size, period_s=period_s, spacing_s=period_s / 3.2, start_s=start_s
        )

    if kind == 0:
        return (doublets(amplitude_rad),)
    if kind == 1:
        spacing_s = period_s / 2.7
        return three_two_one_one_schedule(
            aircraft, condition, 0.8 * amplitude_rad, period_s=3.0 * spacing_s, spacing_s=spacing_s,
            start_s=start_s,
        )  # fmt: skip
    waves = _multisine(aircraft, 0.8 * amplitude_rad, float(rng.choice([10.0, 15.0, 20.0])), start_s)
    if kind == 2:
        return (waves,)
    # Doublets in the first half, which come again only after the end of the flight; multisines in the second half.
    half = 0.5 * seconds
    early = doublet_schedule(
        aircraft, condition, amplitude_rad, period_s=2.0 * seconds, spacing_s=half / 3.5, start_s=start_s
    )
    return early, replace(waves, start_s=half)


def _multisine(aircraft: Aircraft, amplitude_rad: float, length_s: float, start_s: float) -> Multisine:
    """All surfaces at once with Schroeder's phases, which take no search."""
    bands = [analysis_band_hz(aircraft, mode) for mode in (SHORT_PERIOD, LATERAL, DUTCH_ROLL)]
    dealt = deal_harmonics(SURFACES, bands, length_s)
    phases = tuple(tuple(schroeder_phases_rad(len(ks)).tolist()) for ks in dealt)
    return Multisine(SURFACES, (amplitude_rad,) * 3, dealt, phases, length_s, start_s, length_s)


def as_effect(hidden: Hidden) -> Effect:
    """The simulation's own effect, there from the start."""
    return parse_effect(f"{hidden.label}:{hidden.size!r}@0")
