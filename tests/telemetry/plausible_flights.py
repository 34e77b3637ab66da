"""Simulated flights, and what people's logs do to them, for the tests of plausibility."""

import functools
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import load_aircraft
from wingwatch.simulation import Manoeuvre, Scenario, doublet_schedule, parse_effect, patrol, simulate
from wingwatch.simulation import three_two_one_one_schedule as steps
from wingwatch.telemetry import CHANNEL_INDEX, Cleaner, SampleBlock
from wingwatch.telemetry.plausibility import Finding, check_flight

Values = NDArray[np.float64]
Spoil = Callable[[Values], None]

AIRCRAFT = ("aerosonde", "ultrastick25e", "twinotter")
SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")
DEG, G = 180.0 / np.pi, 9.80665


@functools.cache
def flown(
    aircraft: str, manoeuvre: str, air: str, seed: int = 1, effect: str = "", seconds: float = 120.0
) -> SampleBlock:
    """A flight at cruise: doublets, steps (3-2-1-1), a patrol, both, or nothing at all."""
    known = load_aircraft(aircraft)
    assert known.envelope is not None
    at = known.envelope.cruise
    known_manoeuvres: dict[str, tuple[Manoeuvre, ...]] = {
        "doublets": (doublet_schedule(known, at),),
        "both": (doublet_schedule(known, at),),
        "steps": tuple(steps(known, at)),
    }
    return simulate(
        Scenario(
            known,
            at.airspeed_true_m_s,
            at.altitude_m,
            known_manoeuvres.get(manoeuvre, ()),
            (parse_effect(effect),) if effect else (),
            air,  # type: ignore[arg-type]
            seed,
            wind_m_s=(5.0, 3.0, 0.0),
            route=patrol(known, at) if manoeuvre in ("patrol", "both") else None,
        ),
        seconds,
    )


def findings(
    block: SampleBlock, aircraft: str, spoil: Spoil | None = None, **more: object
) -> tuple[Finding, ...]:
    """What the checks say of a flight, after something was done to its values."""
    values = block.values.copy()
    if spoil is not None:
        spoil(values)
    kinds: Mapping[str, str] = {}
    clean = Cleaner().clean(SampleBlock(values)).block
    return check_flight(clean, kinds, load_aircraft(aircraft), **more)  # type: ignore[arg-type]


def times(factor: float, *names: str) -> Spoil:
    """Channels in another unit, or with another sign."""

    def spoil(values: Values) -> None:
        for name in names:
            values[:, CHANNEL_INDEX[name]] *= factor

    return spoil


def without_gravity(values: Values) -> None:
    """Linear acceleration."""
    pitch, roll = values[:, CHANNEL_INDEX["pitch_rad"]].copy(), values[:, CHANNEL_INDEX["roll_rad"]].copy()
    values[:, CHANNEL_INDEX["specific_force_x_m_s2"]] -= G * np.sin(pitch)
    values[:, CHANNEL_INDEX["specific_force_y_m_s2"]] += G * np.cos(pitch) * np.sin(roll)
    values[:, CHANNEL_INDEX["specific_force_z_m_s2"]] += G * np.cos(pitch) * np.cos(roll)


def held(rows: float, *names: str) -> Spoil:
    """Channels that show each value for so many rows."""

    def spoil(values: Values) -> None:
        steps = np.arange(len(values))
        source = np.floor(np.floor(steps / rows + 1e-9) * rows + 1e-9).astype(int)
        for name in names:
            values[:, CHANNEL_INDEX[name]] = values[source, CHANNEL_INDEX[name]]

    return spoil


def exchanged(one: str, other: str) -> Spoil:
    """Two channels under each other's name."""

    def spoil(values: Values) -> None:
        pair = [CHANNEL_INDEX[one], CHANNEL_INDEX[other]]
        values[:, pair] = values[:, pair[::-1]]

    return spoil


def low_passed(time_constant_s: float, *names: str) -> Spoil:
    """Channels behind a first-order filter."""

    def spoil(values: Values) -> None:
        gain = 0.02 / (0.02 + time_constant_s)
        for name in names:
            column = values[:, CHANNEL_INDEX[name]]
            for row in range(1, len(column)):
                column[row] = column[row - 1] + gain * (column[row] - column[row - 1])

    return spoil
