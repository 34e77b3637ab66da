"""Filter error beside truth: on plants of two degrees of freedom in thirty situations, and on simulated flights.

Each line: truths inside the stated 95 % interval, of all derivatives and of those that claim to be converged, the share
that claims, rms of error over stated error of each derivative, and median stated error in per cent of the truth.

Run: python benchmarks/filter_error.py plants [--seeds N] [--plant short_period] [--situation NAME ...]
     python benchmarks/filter_error.py flights [--flights N] [--seconds S] [--turbulence LEVEL ...] [--structure ...]
"""

import argparse
import math
import sys
import time
from collections.abc import Iterable

import numpy as np
from filter_situations import PLANTS, SITUATIONS, Flight, Plant, fly
from numpy.typing import NDArray
from turbulence import AIRCRAFT, FIRST_SEED, LEVELS, RATE_HZ, truth_of

from wingwatch.aircraft import MODEL_STRUCTURES, FlightCondition, ModeStructure
from wingwatch.baselines import OutOfEnvelope, apriori_envelope
from wingwatch.estimators import (
    Estimate,
    FilterErrorConfig,
    Fit,
    FlightForm,
    Outcome,
    filter_error,
    flight_manoeuvres,
    in_form,
    offsets,
    output_error,
)
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.telemetry import SampleBlock, complete

Array = NDArray[np.float64]
Row = tuple[Array, Array, list[Outcome]]

CRUISE = FlightCondition(25.0, 1000.0)
SURFACES = {"eta": "elevator", "xi": "aileron", "zeta": "rudder"}


def estimate_plant(flight: Flight) -> tuple[Estimate, Fit]:
    """The filter with what it may know of a flight."""
    config = FilterErrorConfig(vane_ahead_m=flight.vane_ahead_m)
    return filter_error(flight.parts, config, expected=flight.expected, natural=flight.natural)


def plant_row(plant: Plant, estimate: Estimate) -> Row:
    return estimate.value, np.array(plant.derivatives), list(estimate.outcomes)


def flights_of(turbulence: Turbulence, count: int, seconds: float) -> Iterable[SampleBlock]:
    """Autopilot closed, doublets of 2 degrees of each surface; air as fine as in ``turbulence.py``."""
    doublets = doublet_schedule(AIRCRAFT, CRUISE, np.deg2rad(2.0))
    for i in range(count):
        scenario = Scenario(
            AIRCRAFT, manoeuvres=(doublets,), turbulence=turbulence, seed=FIRST_SEED + 500 + i
        )
        values = FleetSimulation([scenario], rate_hz=RATE_HZ).step(round(RATE_HZ * seconds))[0]
        yield complete(SampleBlock(np.ascontiguousarray(values)))


def estimate_flight(block: SampleBlock, structure: ModeStructure, *, beside: bool) -> tuple[Estimate, Fit]:
    """As ``wingwatch estimate`` does it; output error where ``beside``."""
    envelope = apriori_envelope(AIRCRAFT, structure)
    found = envelope.lookup(CRUISE)
    assert not isinstance(found, OutOfEnvelope)
    own = found.value - offsets(structure, CRUISE.airspeed_true_m_s, CRUISE.angle_of_attack_rad)
    natural = np.maximum(np.abs(own), 2.0 * found.standard_error)
    servos = {u: getattr(AIRCRAFT.actuators, name) for u, name in SURFACES.items()}
    form = FlightForm(
        (CRUISE.airspeed_true_m_s, CRUISE.air_density_kg_m3), frozenset(), AIRCRAFT.sensors.imu_position_m,
        AIRCRAFT.sensors.vane_position_m,
        {u: 2.0 * math.pi * s.bandwidth_hz for u, s in servos.items() if s is not None},
        window_s=12.0 if beside else 30.0,
    )  # fmt: skip
    parts = flight_manoeuvres(structure, form, [block])
    if beside:
        return in_form(*output_error(parts, natural=natural), structure)
    assert AIRCRAFT.geometry is not None
    config = FilterErrorConfig(
        AIRCRAFT.geometry.span_m, AIRCRAFT.sensors.vane_position_m[0],
        input_noise_std=tuple(AIRCRAFT.noise_std(f"{SURFACES[u]}_rad") or 0.0 for u in structure.inputs),
    )  # fmt: skip
    return in_form(*filter_error(parts, config, expected=own, natural=natural), structure)


def show(name: str, found: list[tuple[Estimate, Array]], seconds: float) -> None:
    """One line, and with few flights one line each."""
    value = np.array([e.value for e, _ in found])
    error = np.array([e.standard_error for e, _ in found])
    truth = np.array([t for _, t in found])
    z = (value - truth) / error
    claims = np.array([[o is Outcome.CONVERGED for o in e.outcomes] for e, _ in found])
    inside = np.abs(z) <= 1.959964
    claimed = f"{100.0 * inside[claims].mean():3.0f}" if claims.any() else "  -"
    rms = " ".join(f"{r:.1f}" for r in np.sqrt(np.mean(z**2, axis=0)))
    stated = " ".join(f"{s:.2g}" for s in 100.0 * np.median(error / np.abs(truth), axis=0))
    print(
        f"{name:46} {100.0 * inside.mean():3.0f} %  converged {claimed} % of {100.0 * claims.mean():3.0f} %"
        f"  rms/stated {rms}  stated % {stated}  {seconds / len(found):.1f} s",
        flush=True,
    )


def on_plants(chosen: argparse.Namespace) -> None:
    plant = PLANTS[chosen.plant]
    for name in chosen.situation or SITUATIONS:
        start, found = time.perf_counter(), []
        for seed in range(chosen.first, chosen.first + chosen.seeds):
            flight = fly(
                plant,
                SITUATIONS[name],
                seed,
                rate_hz=chosen.rate_hz,
                accelerometer=not chosen.no_accelerometer,
            )
            found.append((estimate_plant(flight)[0], np.array(plant.derivatives)))
        show(name, found, time.perf_counter() - start)


def on_flights(chosen: argparse.Namespace) -> None:
    for turbulence in chosen.turbulence:
        blocks = list(flights_of(turbulence, chosen.flights, chosen.seconds))
        for name in chosen.structure:
            structure = MODEL_STRUCTURES[name]
            for beside in (False, True):
                start = time.perf_counter()
                estimates = [estimate_flight(b, structure, beside=beside)[0] for b in blocks]
                found = [(e, truth_of(e)) for e in estimates]
                show(f"{turbulence} {name} {estimates[0].estimator}", found, time.perf_counter() - start)
                if chosen.verbose:
                    for e, truth in found:
                        print(
                            "   ",
                            *(
                                f"{d} {(v - t) / s:+.1f} ({100 * s / abs(t):.2g}%) {o[:4]}"
                                for d, v, t, s, o in zip(
                                    structure.derivatives,
                                    e.value,
                                    truth,
                                    e.standard_error,
                                    e.outcomes,
                                    strict=True,
                                )
                            ),
                            e.reason,
                        )


def main() -> int:
    parser = argparse.ArgumentParser(description="Filter error beside truth.")
    commands = parser.add_subparsers(dest="what", required=True)
    plants = commands.add_parser("plants")
    plants.add_argument("--seeds", type=int, default=8)
    plants.add_argument("--first", type=int, default=0)
    plants.add_argument("--plant", choices=tuple(PLANTS), default="short_period")
    plants.add_argument("--situation", nargs="*", choices=tuple(SITUATIONS), default=())
    plants.add_argument("--rate-hz", type=float, default=50.0)
    plants.add_argument("--no-accelerometer", action="store_true")
    flights = commands.add_parser("flights")
    flights.add_argument("--flights", type=int, default=6)
    flights.add_argument("--seconds", type=float, default=60.0)
    flights.add_argument("--turbulence", nargs="*", choices=LEVELS, default=list(LEVELS))
    flights.add_argument("--structure", nargs="*", default=["short_period", "dutch_roll", "lateral"])
    flights.add_argument("--verbose", action="store_true")
    chosen = parser.parse_args()
    if chosen.what == "plants":
        on_plants(chosen)
    else:
        on_flights(chosen)
    return 0


if __name__ == "__main__":
    sys.exit(main())
