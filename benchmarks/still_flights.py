"""Still-air flights of one minute: each estimator's error beside that of output error on the same flights.

Aircraft whose files state coefficients fly at their cruise, sensors as their files say, autopilot closed, three
doublets a surface. The online estimators run in the live chain, with a file whose coefficients of stability and
control are each 30 % off to either side; output error works on the whole flight with the same sensor places and
servos. Truth is the linearisation at the condition that an estimate is reported at.

    .venv/bin/python benchmarks/still_flights.py [--flights 8] [--seconds 60]
        [--aircraft aerosonde twinotter ultrastick25e] [--json]

Per aircraft, structure and estimator: rms error over output error's, of the median and of the worst derivative; over
the bound (output error's covariance for white sensor noise, surfaces taken as exact); share of derivatives called
``converged``; truth in the stated 95 % interval of these and of all; largest error over stated error of these.

A new estimator of whole flights is a row in ``WHOLE``.
"""

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    ModeStructure,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.estimators import (
    Estimate,
    Fit,
    FlightForm,
    Manoeuvre,
    Outcome,
    flight_manoeuvres,
    in_form,
    offsets,
    output_error,
)
from wingwatch.monitor.chain import Chain, Solution
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.simulation import Manoeuvre as Excitation
from wingwatch.telemetry import SampleBlock, complete
from wingwatch.telemetry.conditioning import align

Array = NDArray[np.float64]

AIRCRAFT = ("aerosonde", "twinotter", "ultrastick25e")
STRUCTURES = (SHORT_PERIOD, LATERAL)
FIRST_SEED = 3000
RATE_HZ = 50
AMPLITUDE_RAD = math.radians(2.0)
START_OFF = 0.3
PERIOD_S = 20.0
"""Between doublets of the same surface: three in a minute."""
Z_95 = 1.959964
PEER = "output error"

WHOLE: dict[str, Callable[[Sequence[Manoeuvre]], tuple[Estimate, Fit]]] = {PEER: output_error}


@dataclass(frozen=True, slots=True)
class Reading:
    """One estimate of one flight, (k,) each: error, stated error, whether claimed, and the bound if there is one."""

    error: Array
    stated: Array
    claimed: NDArray[np.bool_]
    bound: Array | None = None


@dataclass(frozen=True, slots=True)
class Figures:
    """One estimator of one structure over all flights; ratios of rms errors, percent, stated errors.

    Attributes:
        aircraft, structure, estimator: names.
        flights: number.
        over_peer_median, over_peer_worst, worst_derivative: rms error over output error's.
        over_bound_median: rms error over the rms of the bound.
        claimed, covered_claims, covered_all, worst_score: as the module says; None without claims.
        over_peer: ratio by derivative.
    """

    aircraft: str
    structure: str
    estimator: str
    flights: int
    over_peer_median: float
    over_peer_worst: float
    worst_derivative: str
    over_bound_median: float
    claimed: float
    covered_claims: float | None
    covered_all: float
    worst_score: float
    over_peer: tuple[float, ...]


def cruise_of(aircraft: Aircraft) -> FlightCondition:
    """The cruise that the file states."""
    if aircraft.envelope is None:
        raise ValueError(f"aircraft {aircraft.name} states no [envelope]; choose one that does")
    return aircraft.envelope.cruise


def truth_of(aircraft: Aircraft, estimate: Estimate) -> Array:
    """Linearisation at an estimate's airspeed and density, with the angle of attack that it reports."""
    airspeed, altitude, density, alpha = estimate.condition
    at = trimmed(aircraft, FlightCondition(airspeed, altitude, density))
    table = linearised_derivatives(aircraft, at, estimate.structure)
    concise = np.array([table[d] for d in estimate.structure.derivatives])
    seen = offsets(estimate.structure, airspeed, alpha)
    return np.asarray(concise + seen - offsets(estimate.structure, airspeed, at.angle_of_attack_rad))


def fly(aircraft: Aircraft, manoeuvres: Sequence[Excitation], seed: int, seconds: float) -> SampleBlock:
    """One flight at cruise through still air, its sensors' stated delays taken out."""
    at = cruise_of(aircraft)
    scenario = Scenario(aircraft, at.airspeed_true_m_s, at.altitude_m, tuple(manoeuvres), seed=seed)
    values = FleetSimulation([scenario], RATE_HZ).step(round(RATE_HZ * seconds))[0]
    return align(complete(SampleBlock(values)), aircraft.sensors.delay_s)


def misstated(aircraft: Aircraft, seed: int) -> Aircraft:
    """A file whose coefficients of motion and surfaces are ``START_OFF`` too large or too small, by chance."""
    if aircraft.coefficients is None:
        raise ValueError(f"aircraft {aircraft.name} states no [coefficients]; choose one that does")
    rng, tables = np.random.default_rng(seed), {}
    for table in ("CL", "CY", "Cl", "Cm", "Cn"):
        stated = getattr(aircraft.coefficients, table)
        names = [n for n in type(stated).model_fields if n != "zero"]
        off = {n: getattr(stated, n) * (1.0 + START_OFF * rng.choice([-1.0, 1.0])) for n in names}
        tables[table] = stated.model_copy(update=off)
    return aircraft.model_copy(update={"coefficients": aircraft.coefficients.model_copy(update=tables)})


def last_solution(file: Aircraft, block: SampleBlock) -> Solution:
    """What the live chain with an aircraft file says at the end of a flight."""
    chain = Chain(file, block.present, {})
    return list(chain.advance(chain.init(), block))[-1]


def flight_form(aircraft: Aircraft, at: FlightCondition) -> FlightForm:
    """What a file tells an estimator of whole flights, referred to a condition."""
    servos = {
        "eta": aircraft.actuators.elevator,
        "xi": aircraft.actuators.aileron,
        "zeta": aircraft.actuators.rudder,
    }
    return FlightForm(
        (at.airspeed_true_m_s, at.air_density_kg_m3),
        imu_position_m=aircraft.sensors.imu_position_m,
        vane_position_m=aircraft.sensors.vane_position_m,
        servo_rad_s={u: 2.0 * math.pi * servo.bandwidth_hz for u, servo in servos.items() if servo},
    )


def reading(aircraft: Aircraft, estimate: Estimate, fit: Fit | None = None) -> Reading:
    """An estimate beside its truth."""
    claimed = np.array([o is Outcome.CONVERGED for o in estimate.outcomes])
    bound = None if fit is None else np.sqrt(np.diagonal(fit.covariance_white))
    return Reading(estimate.value - truth_of(aircraft, estimate), estimate.standard_error, claimed, bound)


def read(aircraft: Aircraft, block: SampleBlock, structure: ModeStructure, seed: int) -> dict[str, Reading]:
    """Every estimator of one structure on one flight; ``seed``: of what the live chain's file misstates."""
    mode = last_solution(misstated(aircraft, seed), block).modes[structure.name]
    found = {e.estimator: reading(aircraft, e) for e in (mode.fourier, mode.ekf)}
    parts = flight_manoeuvres(structure, flight_form(aircraft, cruise_of(aircraft)), [block])
    for name, solve in WHOLE.items():
        estimate, fit = in_form(*solve(parts), structure)
        found[name] = reading(aircraft, estimate, fit)
    return found


def collect(
    aircraft: Aircraft, structure: ModeStructure, flights: int, seconds: float
) -> dict[str, list[Reading]]:
    """Readings over flights with seeds from ``FIRST_SEED`` on, by estimator."""
    doublets = doublet_schedule(aircraft, cruise_of(aircraft), AMPLITUDE_RAD, period_s=PERIOD_S)
    found: dict[str, list[Reading]] = {}
    for k in range(flights):
        block = fly(aircraft, [doublets], FIRST_SEED + k, seconds)
        for name, one in read(aircraft, block, structure, FIRST_SEED + k).items():
            found.setdefault(name, []).append(one)
    return found


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


def figures(aircraft: str, structure: ModeStructure, found: dict[str, list[Reading]]) -> list[Figures]:
    """Every estimator beside output error on the same flights."""
    peer = _rms(np.array([r.error for r in found[PEER]]))
    bound = _rms(np.array([r.bound for r in found[PEER]]))
    rows = []
    for name, readings in found.items():
        error = np.array([r.error for r in readings])
        claimed = np.array([r.claimed for r in readings])
        score = np.abs(error) / np.array([r.stated for r in readings])
        score = np.where(np.isfinite(score), score, np.inf)
        ratio = _rms(error) / peer
        inside = score <= Z_95
        rows.append(
            Figures(
                aircraft,
                structure.name,
                name,
                len(readings),
                float(np.median(ratio)),
                float(ratio.max()),
                structure.derivatives[int(ratio.argmax())],
                float(np.median(_rms(error) / bound)),
                100.0 * float(claimed.mean()),
                100.0 * float(inside[claimed].mean()) if claimed.any() else None,
                100.0 * float(inside.mean()),
                float(score[claimed].max()) if claimed.any() else math.nan,
                tuple(float(r) for r in ratio),
            )
        )
    return rows


HEADER = (
    f"{'aircraft':15}{'structure':14}{'estimator':14}{'over output error':>22}{'over':>8}{'claims':>8}{'in 95 %:':>10}"
    f"{'':6}{'worst':>7}\n{'':43}{'median':>10}{'worst':>12}{'bound':>8}{'%':>8}{'claims':>10}{'all':>6}{'z':>7}"
)


def line(f: Figures) -> str:
    """One row of the table, and every derivative's ratio."""
    covered = f"{'-':>10}" if f.covered_claims is None else f"{f.covered_claims:10.0f}"
    worst = f"{f.over_peer_worst:.2f} {f.worst_derivative}"
    each = " ".join(f"{r:.2f}" for r in f.over_peer)
    return (
        f"{f.aircraft:15}{f.structure:14}{f.estimator:14}{f.over_peer_median:10.2f}{worst:>14}{f.over_bound_median:6.2f}"
        f"{f.claimed:8.0f}{covered}{f.covered_all:6.0f}{f.worst_score:7.1f}   {each}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Estimators in still air beside output error on the same flights."
    )
    parser.add_argument("--flights", type=int, default=8, help="an aircraft, at least 1")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a flight, at least 15")
    parser.add_argument("--aircraft", nargs="+", default=list(AIRCRAFT))
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of the table")
    chosen = parser.parse_args()
    if chosen.flights < 1:
        parser.error(f"--flights is {chosen.flights}; give at least 1")
    if not 15.0 <= chosen.seconds < math.inf:
        parser.error(f"--seconds is {chosen.seconds:g}; give at least 15")
    if not chosen.json:
        print(
            f"{chosen.flights} flights of {chosen.seconds:g} s in still air, doublets every {PERIOD_S:g} s\n{HEADER}"
        )
    for name in chosen.aircraft:
        aircraft = load_aircraft(name)
        for structure in STRUCTURES:
            for row in figures(name, structure, collect(aircraft, structure, chosen.flights, chosen.seconds)):
                print(json.dumps(asdict(row)) if chosen.json else line(row), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
