"""`wingwatch simulate`: a flight whose truth is known."""

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from rich.console import Console
from rich.markup import escape

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.cli.asked_condition import asked_condition
from wingwatch.cli.sampled_input import sampled_input
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.simulation import (
    FleetSimulation,
    Manoeuvre,
    Multisine,
    Route,
    Sampled,
    Scenario,
    doublet_schedule,
    effect_text,
    flight_truth,
    multisine,
    parse_effect,
    patrol,
    three_two_one_one_schedule,
)
from wingwatch.telemetry import SampleBlock, write_flight

__all__ = ["run"]

_SUFFIXES = (".csv", ".parquet")
_DEFAULT_MANOEUVRES = ("doublet",)
_PIECE = 500
_SECONDS, _AFTER_INPUT_S = 60.0, 10.0
"""Length of a flight where none is given: at least so long, and so long beyond an input."""
_MOST_SAMPLES = 2_000_000
"""Half a gigabyte; eleven hours at 50 Hz."""
_UNSENSED = "pitch_demand_rad"
"""Follows from the motion, and no sensor may lose it."""


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    _check_files(arguments.out, arguments.truth)
    given, input_s = ((), 0.0) if arguments.input is None else sampled_input(arguments.input)
    seconds = arguments.seconds if arguments.seconds is not None else max(_SECONDS, input_s + _AFTER_INPUT_S)
    samples = _samples(seconds, arguments.rate)
    names = _manoeuvre_names(arguments.manoeuvre, None if arguments.input is None else ("none",))
    if arguments.autopilot == "off" and "patrol" in names:
        raise CommandError("--manoeuvre patrol needs the autopilot; leave out --autopilot off")
    aircraft = load_aircraft(arguments.aircraft)
    try:
        scenario = _scenario(arguments, aircraft, names, given)
        simulation = FleetSimulation([scenario], arguments.rate)
    except ValueError as error:  # what cannot be trimmed, flown or parsed, each in one sentence
        raise CommandError(" ".join(str(error).split())) from None
    block = _fly(simulation, samples)
    lost = len(block) < samples
    write_flight(block, arguments.out)
    if arguments.truth is not None:
        truth = flight_truth(scenario, len(block) / arguments.rate)
        arguments.truth.write_bytes(orjson.dumps(truth, option=orjson.OPT_INDENT_2) + b"\n")
    result = _result(arguments, scenario, names, len(block), lost)
    if arguments.json:
        write_json(result)
    else:
        _show(page(), result)
    return 0


def _check_files(out: Path, truth: Path | None) -> None:
    """Refuse before the flight what could not be written after it."""
    if out.suffix.lower() not in _SUFFIXES:
        raise CommandError(
            f"--out {out}: a flight is written as .csv or .parquet; choose one of these suffixes"
        )
    for option, path in (("--out", out), ("--truth", truth)):
        if path is not None and not path.parent.is_dir():
            raise CommandError(f"{option} {path}: there is no folder {path.parent}; create it")
    if truth is not None and truth.resolve() == out.resolve():
        raise CommandError(f"--truth {truth} is the flight's own file; give another name")


def _samples(seconds: float, rate_hz: float) -> int:
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise CommandError(f"--seconds {seconds:g}: give a positive length of flight")
    if not 1.0 <= rate_hz <= 1000.0:
        raise CommandError(f"--rate {rate_hz:g}: give 1 to 1000 samples a second")
    samples = max(1, round(seconds * rate_hz))
    if samples > _MOST_SAMPLES:
        raise CommandError(
            f"--seconds {seconds:g} at {rate_hz:g} Hz are {samples} samples, at most {_MOST_SAMPLES} are simulated "
            "at once; ask for a shorter flight or a lower rate"
        )
    return samples


def _manoeuvre_names(asked: list[str] | None, default: tuple[str, ...] | None = None) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(asked or default or _DEFAULT_MANOEUVRES))
    if "none" in names and len(names) > 1:
        raise CommandError(
            f"--manoeuvre none beside {', '.join(n for n in names if n != 'none')}; leave one out"
        )
    return tuple(n for n in names if n != "none")


def _scenario(
    arguments: argparse.Namespace, aircraft: Aircraft, names: tuple[str, ...], given: tuple[Sampled, ...]
) -> Scenario:
    condition = asked_condition(arguments, aircraft)
    speed, origin = arguments.wind
    return Scenario(
        aircraft,
        condition.airspeed_true_m_s,
        condition.altitude_m,
        manoeuvres=(*given, *(m for name in names for m in _manoeuvres(name, aircraft, condition))),
        effects=tuple(parse_effect(text) for text in arguments.effect),
        turbulence=arguments.turbulence,
        turbulence_model=arguments.turbulence_model,
        seed=arguments.seed,
        noise=not arguments.noiseless,
        wind_m_s=(0.0 - speed * math.cos(origin), 0.0 - speed * math.sin(origin), 0.0),
        route=_route(names, aircraft, condition),
        hands_off=arguments.autopilot == "off",
    )


def _manoeuvres(name: str, aircraft: Aircraft, condition: FlightCondition) -> tuple[Manoeuvre, ...]:
    if name == "doublet":
        return (doublet_schedule(aircraft, condition),)
    if name == "3211":
        return three_two_one_one_schedule(aircraft, condition)
    return (multisine(aircraft),) if name == "multisine" else ()


def _route(names: tuple[str, ...], aircraft: Aircraft, condition: FlightCondition) -> Route | None:
    return patrol(aircraft, condition) if "patrol" in names else None


def _fly(simulation: FleetSimulation, samples: int) -> SampleBlock:
    """The flight, up to where the motion of a lost aircraft ends to be numbers."""
    pieces = []
    with Progress().count(samples, "flying") as show:
        for done in range(0, samples, _PIECE):
            piece = SampleBlock(simulation.step(min(_PIECE, samples - done))[0])
            beyond = np.flatnonzero(~np.isfinite(piece.column(_UNSENSED)))
            if beyond.size:
                pieces.append(SampleBlock(piece.values[: beyond[0]]))
                break
            pieces.append(piece)
            show(done)
    return SampleBlock.concatenate(pieces)


def _result(
    arguments: argparse.Namespace, scenario: Scenario, names: tuple[str, ...], samples: int, lost: bool
) -> dict[str, Any]:
    """What was flown, for JSON."""
    return {
        "flight": str(arguments.out),
        "truth": None if arguments.truth is None else str(arguments.truth),
        "aircraft": scenario.aircraft.name,
        "samples": samples,
        "duration_s": samples / arguments.rate,
        "lost": lost,
        "rate_hz": arguments.rate,
        "airspeed_true_m_s": scenario.airspeed_true_m_s,
        "altitude_m": scenario.altitude_m,
        "manoeuvres": list(names),
        "autopilot": arguments.autopilot,
        "input": None if arguments.input is None else str(arguments.input),
        "relative_peak_factors": {
            surface: factor
            for m in scenario.manoeuvres
            if isinstance(m, Multisine)
            for surface, factor in zip(m.surfaces, m.relative_peak_factors, strict=True)
        },
        "turbulence": scenario.turbulence,
        "turbulence_model": scenario.turbulence_model,
        "wind_m_s": list(scenario.wind_m_s),
        "seed": scenario.seed,
        "noise": scenario.noise,
        "effects": [
            {"text": effect_text(e), "name": e.name, "target": e.target, "size": e.word or e.size}
            | {"onset_s": e.onset_s, "ramp_s": e.ramp_s}
            for e in scenario.effects
        ],
    }


def _show(console: Console, result: dict[str, Any]) -> None:
    console.print(
        f"[bold]{escape(result['flight'])}[/]  {result['samples']} samples, {result['duration_s']:g} s at "
        f"{result['rate_hz']:g} Hz"
    )
    console.print(
        f"aircraft {result['aircraft']} at {result['airspeed_true_m_s']:g} m/s and {result['altitude_m']:g} m, "
        f"turbulence {result['turbulence']}, seed {result['seed']}"
    )
    console.print(f"manoeuvres: {', '.join(result['manoeuvres']) or 'none'}")
    if result["autopilot"] == "off":
        console.print("autopilot off: surfaces and throttle stay at the trim but for manoeuvres and input")
    if result["input"] is not None:
        console.print(f"input: {escape(result['input'])}")
    if result["relative_peak_factors"]:
        factors = ", ".join(f"{s} {f:.2f}" for s, f in result["relative_peak_factors"].items())
        console.print(f"relative peak factors of the multisine: {factors}")
    effects = ", ".join(effect["text"] for effect in result["effects"])
    console.print(f"effects: {escape(effects) or 'none'}")
    if result["lost"]:
        console.print(
            f"[bold]lost[/]: after {result['duration_s']:g} s the damaged aircraft's motion goes beyond all numbers; "
            "the flight ends there"
        )
    if result["truth"] is not None:
        console.print(f"truth in {escape(result['truth'])}")
