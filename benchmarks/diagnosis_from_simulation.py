"""Cases flown by the project's own simulation at a finer step, with its own effects from the first instant on.

The finder gets the library's aircraft file, its noise as the sensors have it. The autopilot is always closed; it holds
airspeed, altitude and heading and lets doublets, 3-2-1-1 and multisines through.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from diagnosis_hidden import (
    CATALOGUE,
    LEAST_SIGNAL,
    SURFACES,
    Array,
    Case,
    Hidden,
    bigger,
    draw_hidden,
    signal_to_noise,
)

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    AircraftDataError,
    FlightCondition,
    TrimError,
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

__all__ = ["FlownCase", "draw_simulation", "drawn_manoeuvres", "made"]

AIRCRAFT = ("aerosonde", "twinotter", "ultrastick25e")
RATE_HZ = 50
REFINE = 4
"""Integration steps of the simulated flight over those that its own accuracy asks for."""
Turbulence = Literal["none", "light", "moderate"]
TURBULENCE: tuple[Turbulence, ...] = ("none", "light", "moderate")
HOW_OFTEN = (0.5, 0.4, 0.1)
COMMAND_ONLY = 0.1
"""Share of flights whose record has no measured surface positions."""
ATTEMPTS = 40
_NEEDS_POSITION = ("actuator_", "surface_")
_LARGEST = {"roll_rad": 1.2, "pitch_rad": 0.8, "angle_of_attack_rad": 0.35, "sideslip_rad": 0.4}
"""Beyond these a flight is not one that anybody would identify a model from."""


@dataclass(frozen=True, slots=True)
class FlownCase:
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

    def scenario(self, effects: Sequence[Effect], which: int, ideal: bool = False) -> Scenario:
        """Of the flight (0) or the held-out one (1); ``ideal`` in still air without noise."""
        return Scenario(
            self.aircraft,
            self.condition.airspeed_true_m_s,
            self.condition.altitude_m,
            self.manoeuvres[which],
            tuple(effects),
            "none" if ideal else self.turbulence,
            seed=2 * self.seed + which,
            noise=not ideal,
        )


@cache
def _library(name: str) -> Aircraft:
    return load_aircraft(name)


def draw_simulation(seed: int, count: int) -> Case:
    """A case with ``count`` effects; what is flown goes by the seed alone, so a healthy case has the same flight.

    Raises:
        RuntimeError: none of many draws could be flown and seen.
    """
    plan = _plan(np.random.default_rng([seed, 1]), seed)
    rng = np.random.default_rng([seed, 2])
    rows = [r for r in CATALOGUE if not (plan.command_only and r.name.startswith(_NEEDS_POSITION))]
    for _ in range(ATTEMPTS):
        hidden: list[Hidden] = []
        for _ in range(count):
            hidden.append(draw_hidden(rng, rows, plan.aircraft, [h.name for h in hidden]))
        case = _seen(plan, hidden)
        if case is not None:
            return case
    raise RuntimeError(f"no effect of seed {seed} can be flown and seen in simulation; give another seed")


def _plan(rng: np.random.Generator, seed: int) -> FlownCase:
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
    flights = [drawn_manoeuvres(rng, aircraft, condition, float(level), seconds) for _ in range(2)]
    return FlownCase(
        seed, aircraft, condition, (flights[0], flights[1]), seconds, turbulence,
        command_only=bool(rng.random() < COMMAND_ONLY),
    )  # fmt: skip


def drawn_manoeuvres(
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
    bands = [aircraft.band_hz(mode) for mode in (SHORT_PERIOD, LATERAL, DUTCH_ROLL)]
    dealt = deal_harmonics(SURFACES, bands, length_s)
    phases = tuple(tuple(schroeder_phases_rad(len(ks)).tolist()) for ks in dealt)
    return Multisine(SURFACES, (amplitude_rad,) * 3, dealt, phases, length_s, start_s, length_s)


def _seen(plan: FlownCase, hidden: Sequence[Hidden]) -> Case | None:
    """The case, with sizes raised until each effect is seen alone; None where that cannot be."""
    try:
        clean = _flown([plan.scenario((), 0, ideal=True)], plan)[0]
        found, least = [], np.inf
        for effect in hidden:
            loud, signal = _raised(plan, effect, clean)
            if loud is None:
                return None
            found.append(loud)
            least = min(least, signal)
        return made(plan, found, least if found else 0.0)
    except (AircraftDataError, TrimError):
        return None


def _raised(plan: FlownCase, effect: Hidden, clean: Array) -> tuple[Hidden | None, float]:
    """The effect with the size that is seen, and its signal; None where none is both seen and flown."""
    loud: Hidden | None = effect
    while loud is not None:
        flown = _flown([plan.scenario((as_effect(loud),), 0, ideal=True)], plan)[0]
        if not _flyable(flown):
            return None, 0.0
        signal = signal_to_noise(plan.aircraft, loud, flown, clean)
        if signal >= LEAST_SIGNAL:
            return loud, signal
        loud = bigger(loud, CATALOGUE, plan.aircraft)
    return None, 0.0


def made(plan: FlownCase, hidden: Sequence[Hidden], signal: float | None = None) -> Case | None:
    """The case of a plan with effects, None where its flights leave what is flyable.

    Raises:
        AircraftDataError, TrimError: effects that this aircraft cannot have or not be trimmed with.
    """
    effects = [as_effect(h) for h in hidden]
    if signal is None:
        clean = _flown([plan.scenario((), 0, ideal=True)], plan)[0]
        alone = [_flown([plan.scenario((e,), 0, ideal=True)], plan)[0] for e in effects]
        signal = min(
            (signal_to_noise(plan.aircraft, h, x, clean) for h, x in zip(hidden, alone, strict=True)),
            default=0.0,
        )
    flights = _flown([plan.scenario(effects, which) for which in (0, 1)], plan)
    if not all(_flyable(flight) for flight in flights):
        return None
    return Case(
        "simulation", plan.seed, plan.aircraft, SampleBlock(flights[0]), SampleBlock(flights[1]),
        {f"{s}_rad": "command" if plan.command_only else "position" for s in SURFACES},
        tuple(hidden), plan.turbulence, float(signal), plan.name,
    )  # fmt: skip


def as_effect(hidden: Hidden) -> Effect:
    """The simulation's own effect, there from the start."""
    return parse_effect(f"{hidden.label}:{hidden.size!r}@0")


def _flown(scenarios: Sequence[Scenario], plan: FlownCase) -> list[Array]:
    """Flight tables of scenarios, (samples, channels)."""
    values = FleetSimulation(scenarios, RATE_HZ, refine=REFINE).step(round(RATE_HZ * plan.seconds))
    if plan.command_only:
        for surface in SURFACES:
            values[..., CHANNEL_INDEX[f"{surface}_rad"]] = values[
                ..., CHANNEL_INDEX[f"{surface}_command_rad"]
            ]
    return list(values)


def _flyable(values: Array) -> bool:
    """Whether a flight stays where one would identify a model from it."""
    return all(bool((np.abs(values[:, CHANNEL_INDEX[name]]) < most).all()) for name, most in _LARGEST.items())
