"""The plan of one flight: everything that is drawn for it, from the kind of study, the grid and the flight's seed.

Every quantity has a random stream of its own, so that another choice of one leaves the draws of the others as they
were: two studies that differ in one key fly the same flights in all else.
"""

import math
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
import orjson

from wingwatch.aircraft import Aircraft, AircraftDataError, FlightCondition, coefficient_names, load_aircraft
from wingwatch.simulation import (
    EFFECTS,
    Manoeuvre,
    doublet_schedule,
    multisine,
    three_two_one_one_schedule,
)
from wingwatch.simulation.effects.icing import LINEAR_FACTORS, NONLINEAR_SHARES
from wingwatch.studies.fault_names import SENSOR_EFFECTS, part_of
from wingwatch.studies.grid import UNSENT, Effects, Grid, Kind, Range, StudyError, bounds, one_line

__all__ = ["FlightPlan", "Gusts", "draw_plan", "load_fleet", "manoeuvres"]

ENVELOPE_AIRSPEEDS = (0.15, 0.7)
"""Part of the envelope's airspeeds from which ``condition = "envelope"`` draws: ice costs lift below and needs power
above."""
ENVELOPE_ALTITUDES = (0.0, 0.75)

_FIRST_S = 5.0
"""Earliest manoeuvre."""
_CHANGE_RAMP_S = 20.0
_CHANGE_M_S = (0.3, 2.5)
"""Root mean square of the vertical gust that changing turbulence grows by: light to moderate."""


@dataclass(frozen=True, slots=True)
class Gusts:
    """Turbulence that begins in flight: root mean square of its vertical gust, and when."""

    rms_m_s: float
    onset_s: float
    ramp_s: float


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """One flight as drawn.

    Attributes:
        turbulence: level, or ``changing``; air: the level at the start, gusts: what begins later.
        excitation_start_s: of the first manoeuvre.
        expectation_errors: error of each coefficient of the expectation, in its standard errors; empty where exact.
        effect: name in the vocabulary of causes, empty for a healthy flight; severity, onset_s and ramp_s are then
            None. The severity is NaN where a surface is stuck where it was.
        icing_factors: what each coefficient's (or each severity's) icing factor is multiplied by.
    """

    kind: Kind
    seed: int
    seconds: float
    rate_hz: float
    aircraft: str
    airspeed_true_m_s: float
    altitude_m: float
    route: str
    turbulence: str
    turbulence_model: str
    air: str
    gusts: tuple[Gusts, ...]
    excitation: str
    excitation_period_s: float
    excitation_start_s: float
    noise_scale: float
    sensors: str
    surfaces: str
    expectation: str
    expectation_errors: Mapping[str, float]
    effect: str
    target: str
    severity: float | None
    onset_s: float | None
    ramp_s: float | None
    icing_factors: Mapping[str, float]

    @property
    def condition(self) -> FlightCondition:
        """Where the flight is held."""
        return FlightCondition(self.airspeed_true_m_s, self.altitude_m)

    def as_json(self) -> str:
        """All of it, as one line of JSON."""
        return orjson.dumps(asdict(self)).decode()


class _Draws:
    """Random streams of one flight, one a quantity."""

    def __init__(self, kind: Kind, seed: int) -> None:
        self._kind, self._seed = kind, seed

    def stream(self, what: str) -> np.random.Generator:
        return np.random.default_rng([self._seed, zlib.crc32(f"{self._kind}/{what}".encode())])

    def word(self, what: str, choices: Mapping[str, float]) -> str:
        """The order in which the choices stand makes no difference."""
        words = sorted(choices)
        weights = np.array([choices[word] for word in words])
        return str(self.stream(what).choice(words, p=weights / weights.sum()))

    def number(self, what: str, numbers: Range | list[float]) -> float:
        if isinstance(numbers, Range):
            return self._between(what, numbers)
        return numbers[int(self.stream(what).integers(len(numbers)))]

    def _between(self, what: str, limits: Range) -> float:
        if limits.logarithmic:
            value = math.exp(self.uniform(what, math.log(limits.low), math.log(limits.high)))
        else:
            value = self.uniform(what, limits.low, limits.high)
        turned = limits.either_sign and self.uniform(f"{what}_sign", 0.0, 1.0) < 0.5
        return -value if turned else value

    def uniform(self, what: str, low: float, high: float) -> float:
        return float(self.stream(what).uniform(low, high))


def draw_plan(kind: Kind, grid: Grid, seed: int, aircraft: Mapping[str, Aircraft]) -> FlightPlan:
    """The plan of the flight with a seed.

    Args:
        aircraft: the grid's, by name (``load_fleet``).
    """
    draws = _Draws(kind, seed)
    name = draws.word("aircraft", grid.aircraft)
    airspeed, altitude = _condition(draws, grid, aircraft[name])
    excitation = draws.word("excitation", grid.excitation)
    period_s = draws.number("excitation_period_s", grid.excitation_period_s)
    turbulence = draws.word("turbulence", grid.turbulence)
    expectation = draws.word("expectation", grid.expectation)
    effect, target, severity, onset_s, ramp_s = _effect(draws, grid, aircraft[name])
    at_fault = part_of(effect, target) if effect in SENSOR_EFFECTS else ""
    return FlightPlan(
        kind=kind,
        seed=seed,
        seconds=grid.seconds,
        rate_hz=grid.rate_hz,
        aircraft=name,
        airspeed_true_m_s=airspeed,
        altitude_m=altitude,
        route=draws.word("route", grid.route_of(excitation)),
        turbulence=turbulence,
        turbulence_model=draws.word("turbulence_model", grid.turbulence_model),
        air=draws.word("air", {"none": 1.0, "light": 1.0}) if turbulence == "changing" else turbulence,
        gusts=_gusts(draws, grid.seconds) if turbulence == "changing" else (),
        excitation=excitation,
        excitation_period_s=period_s,
        excitation_start_s=_FIRST_S + draws.uniform("excitation_start_s", 0.0, period_s),
        noise_scale=draws.number("noise_scale", grid.noise_scale),
        sensors=draws.word("sensors", _sending(at_fault, grid.sensors)),
        surfaces=draws.word("surfaces", _sending(at_fault, grid.surfaces)),
        expectation=expectation,
        expectation_errors=_expectation_errors(draws) if expectation == "drawn" else {},
        effect=effect,
        target=target,
        severity=severity,
        onset_s=onset_s,
        ramp_s=ramp_s,
        icing_factors=_icing_factors(draws, target, grid.icing_factor_spread) if effect == "icing" else {},
    )


def _condition(draws: _Draws, grid: Grid, aircraft: Aircraft) -> tuple[float, float]:
    envelope = aircraft.envelope
    assert envelope is not None  # load_fleet refuses an aircraft without one
    if draws.word("condition", grid.condition) == "cruise":
        return envelope.cruise.airspeed_true_m_s, envelope.cruise.altitude_m
    speeds, altitudes = envelope.airspeed_true_m_s, envelope.altitude_m
    u = draws.uniform("airspeed", *ENVELOPE_AIRSPEEDS)
    h = draws.uniform("altitude", *ENVELOPE_ALTITUDES)
    return speeds[0] + u * (speeds[1] - speeds[0]), altitudes[0] + h * (altitudes[1] - altitudes[0])


def _effect(
    draws: _Draws, grid: Grid, aircraft: Aircraft
) -> tuple[str, str, float | None, float | None, float | None]:
    """Name, target, severity, onset and ramp."""
    weights = {str(i): entry.weight for i, entry in enumerate(grid.effects) if grid.targets_of(entry)}
    if grid.healthy_weight > 0.0:
        weights[""] = grid.healthy_weight
    drawn = draws.word("effect", weights)
    if drawn == "":
        return "", "", None, None, None
    entry = grid.effects[int(drawn)]
    target = draws.word("target", grid.targets_of(entry))
    ramp_s = draws.number("ramp_s", grid.ramp_s) if EFFECTS[entry.name].grows else 0.0
    onset_s = draws.number("onset_s", grid.onset_s)
    return entry.name, target, _severity(draws, entry, aircraft), onset_s, ramp_s


def _sending(channel: str, choices: Mapping[str, float]) -> Mapping[str, float]:
    """The choices with which a channel is sent: what fails must be there."""
    return {word: weight for word, weight in choices.items() if channel not in UNSENT.get(word, ())}


def _severity(draws: _Draws, entry: Effects, aircraft: Aircraft) -> float:
    if isinstance(entry.size, str):
        return EFFECTS[entry.name].size_words[entry.size]
    size = draws.number("severity", entry.size)
    return size * aircraft.need_geometry("a shift in chords").mean_chord_m if entry.in_chords else size


def _gusts(draws: _Draws, seconds: float) -> tuple[Gusts, ...]:
    """One change of the air in each half of the flight."""
    half = 0.5 * seconds
    return tuple(
        Gusts(
            draws.uniform(f"gust_{k}", *_CHANGE_M_S),
            k * half + draws.uniform(f"gust_onset_{k}", 0.0, half),
            _CHANGE_RAMP_S,
        )
        for k in range(2)
    )


def _expectation_errors(draws: _Draws) -> dict[str, float]:
    names = coefficient_names()
    errors = draws.stream("expectation_errors").standard_normal(len(names))
    return dict(zip(names, errors.tolist(), strict=True))


def _icing_factors(draws: _Draws, target: str, spread: float) -> dict[str, float]:
    """Independent factors of every coefficient that this kind of ice moves."""
    moved = LINEAR_FACTORS[target] if target in LINEAR_FACTORS else NONLINEAR_SHARES[target]
    names = [name for name, factor in moved.items() if factor != 0.0]
    drawn = draws.stream("icing_factors").uniform(1.0 - spread, 1.0 + spread, len(names))
    return dict(zip(names, drawn.tolist(), strict=True))


def manoeuvres(
    excitation: str, aircraft: Aircraft, condition: FlightCondition, period_s: float, start_s: float
) -> tuple[Manoeuvre, ...]:
    """What is added to the autopilot's commands.

    Raises:
        AircraftDataError, TrimError: an aircraft whose modes are not known there.
        ValueError: manoeuvres that take longer than the period.
    """
    if excitation == "doublet":
        return (doublet_schedule(aircraft, condition, period_s=period_s, start_s=start_s),)
    if excitation == "3211":
        return three_two_one_one_schedule(aircraft, condition, period_s=period_s, start_s=start_s)
    if excitation == "multisine":
        return (multisine(aircraft, start_s=start_s, period_s=period_s),)
    return ()


def load_fleet(grid: Grid) -> dict[str, Aircraft]:
    """The aircraft of a grid, each of which can fly and be excited as the grid says.

    Raises:
        AircraftFileError: an aircraft that is not known, or a file that is none.
        StudyError: one that cannot be flown so.
    """
    known = {name: load_aircraft(name) for name in grid.aircraft}
    period_s = bounds(grid.excitation_period_s)[0]
    for name, aircraft in known.items():
        if aircraft.envelope is None:
            raise StudyError(f"aircraft {name} states no [envelope], from which a study draws where to fly")
        for excitation in grid.excitation:
            try:
                manoeuvres(excitation, aircraft, aircraft.envelope.cruise, period_s, 0.0)
            except (ValueError, AircraftDataError) as error:
                raise StudyError(
                    f"aircraft {name} cannot be excited by {excitation} every {period_s:g} s: {one_line(error)}"
                ) from None
    return known
