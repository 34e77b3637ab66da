"""Manoeuvres in another axis: whether what an estimator says of the axis that did not move is true or withheld.

Flights of six degrees of freedom in still air, loop closed, in which the ailerons and the rudder alone make doublets,
or the elevator alone; with the Aerosonde and with a copy of it whose inertia couples the axes ten times as strongly:
I_xz is ten times as large, and I_z - I_x too by I_z; rolling and yawing coefficients are those that leave its
derivatives the Aerosonde's. (No body has such moments; the equations of motion do not mind.) What no derivative
describes is, in pitch, ((I_z - I_x) p r - I_xz (p^2 - r^2)) / I_y. The chain's file is off as in ``simulated_flights``.

    .venv/bin/python benchmarks/other_axis.py [--flights 8] [--seconds 60] [--degrees 2 6] [--json]

Per aircraft, surfaces, amplitude and structure: share of derivatives ``converged``, ``settling`` and not observable or
rejected; truth in the stated 95 % interval of the converged ones; true or withheld (inside its interval, or not
observable, or rejected); largest error over stated error of the converged ones; and what the coupling did at its
largest, rad/s2. ``ekf`` is the filter as the live chain shows it, ``ekf alone`` without the Fourier estimator's word.
"""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark
from simulated_flights import (
    PERIOD_S,
    RATE_HZ,
    STRUCTURES,
    Z_95,
    cruise_of,
    fly,
    last_solution,
    misstated,
    truth_of,
)

from wingwatch.aircraft import Aircraft, Mass, load_aircraft
from wingwatch.estimators import Estimate, Outcome
from wingwatch.monitor.estimation.chain import Chain
from wingwatch.simulation import DoubletSchedule, doublet_schedule
from wingwatch.telemetry import SampleBlock

Array = NDArray[np.float64]

FIRST_SEED = 6000
COUPLING = 10.0
SURFACES = {"ailerons and rudder": (1, 2), "elevator": (0,)}
"""Places of the surfaces that move, in the usual schedule."""
WITHHELD = (Outcome.NOT_OBSERVABLE, Outcome.REJECTED)


@dataclass(frozen=True, slots=True)
class Figures:
    """One estimator of one structure; percent, stated errors, rad/s2."""

    aircraft: str
    surfaces: str
    degrees: float
    structure: str
    estimator: str
    flights: int
    converged: float
    settling: float
    withheld: float
    covered_claims: float | None
    true_or_withheld: float
    worst_score: float | None
    coupling_rad_s2: float


def coupled(aircraft: Aircraft, times: float = COUPLING) -> Aircraft:
    """A copy whose I_xz and I_z - I_x are so many times as large, and whose derivatives are the same."""
    if aircraft.mass is None or aircraft.coefficients is None:
        raise ValueError(
            f"aircraft {aircraft.name} states no [mass] or no [coefficients]; choose one that does"
        )
    m, c = aircraft.mass, aircraft.coefficients
    heavier = m.model_copy(
        update={
            "inertia_xz_kg_m2": times * m.inertia_xz_kg_m2,
            "inertia_z_kg_m2": m.inertia_x_kg_m2 + times * (m.inertia_z_kg_m2 - m.inertia_x_kg_m2),
        }
    )
    turned = _roll_and_yaw(heavier) @ np.linalg.inv(_roll_and_yaw(m))
    names = list(type(c.Cl).model_fields)
    moments = turned @ np.array([[getattr(table, n) for n in names] for table in (c.Cl, c.Cn)])
    tables = {
        "Cl": c.Cl.model_copy(update=dict(zip(names, moments[0].tolist(), strict=True))),
        "Cn": c.Cn.model_copy(update=dict(zip(names, moments[1].tolist(), strict=True))),
    }
    name = f"{aircraft.name}, coupling x{times:g}"
    return aircraft.model_copy(
        update={"name": name, "mass": heavier, "coefficients": c.model_copy(update=tables)}
    )


def _roll_and_yaw(mass: Mass) -> Array:
    """Inertia of roll and yaw."""
    across = -mass.inertia_xz_kg_m2
    return np.array([[mass.inertia_x_kg_m2, across], [across, mass.inertia_z_kg_m2]])


def pitch_coupling(aircraft: Aircraft, block: SampleBlock) -> Array:
    """Angular acceleration in pitch that p and r cause through the inertia, rad/s2."""
    assert aircraft.mass is not None
    m = aircraft.mass
    p, r = block.column("roll_rate_rad_s"), block.column("yaw_rate_rad_s")
    apart = m.inertia_z_kg_m2 - m.inertia_x_kg_m2
    return np.asarray((apart * p * r - m.inertia_xz_kg_m2 * (p**2 - r**2)) / m.inertia_y_kg_m2)


def schedule(aircraft: Aircraft, places: Sequence[int], amplitude_rad: float) -> DoubletSchedule:
    """The usual doublets of some surfaces only."""
    usual = doublet_schedule(aircraft, cruise_of(aircraft), amplitude_rad, period_s=PERIOD_S)
    return replace(
        usual,
        surfaces=tuple(usual.surfaces[k] for k in places),
        amplitudes_rad=tuple(usual.amplitudes_rad[k] for k in places),
        pulses_s=tuple(usual.pulses_s[k] for k in places),
    )


def filter_alone(file: Aircraft, block: SampleBlock) -> dict[str, Estimate]:
    """The filter's last estimates by structure, as the chain configures it, nobody telling it what the data carry."""
    found = {}
    for mode in Chain(file, block.present, {}).supervisor.pairs.values():
        rows = mode.signals.update(mode.signals.init(1), block.values[None])
        state = mode.ekf.init(1)
        for at in range(0, rows.shape[1], RATE_HZ // 2):
            mode.ekf.update(state, rows[:, at : at + RATE_HZ // 2])
            mode.ekf.solve(state)
        found[mode.structure.name] = mode.ekf.estimate(state)
    return found


def estimates(file: Aircraft, block: SampleBlock) -> dict[tuple[str, str], Estimate]:
    """Last estimates by structure and estimator."""
    shown, alone = last_solution(file, block).modes, filter_alone(file, block)
    found = {}
    for structure in STRUCTURES:
        mode = shown[structure.name]
        found[structure.name, "fourier"] = mode.fourier
        found[structure.name, "ekf"] = mode.ekf
        found[structure.name, "ekf alone"] = alone[structure.name]
    return found


def case_figures(
    aircraft: Aircraft, surfaces: str, degrees: float, flights: int, seconds: float
) -> list[Figures]:
    """Figures of one way of flying."""
    doublets = schedule(aircraft, SURFACES[surfaces], math.radians(degrees))
    found: dict[tuple[str, str], list[tuple[Estimate, Array]]] = {}
    largest = 0.0
    for k in range(flights):
        block = fly(aircraft, [doublets], FIRST_SEED + k, seconds)
        largest = max(largest, float(np.abs(pitch_coupling(aircraft, block)).max()))
        for key, estimate in estimates(misstated(aircraft, FIRST_SEED + k), block).items():
            found.setdefault(key, []).append((estimate, truth_of(aircraft, estimate)))
    names = (aircraft.name, surfaces, degrees)
    return [figures(names, key, rows, largest) for key, rows in found.items()]


def figures(
    names: tuple[str, str, float],
    key: tuple[str, str],
    rows: Sequence[tuple[Estimate, Array]],
    coupling: float,
) -> Figures:
    """Figures of one estimator from estimates and truths."""
    outcome = np.array([[str(o) for o in e.outcomes] for e, _ in rows])
    score = np.abs([(e.value - truth) / e.standard_error for e, truth in rows])
    inside = np.isfinite(score) & (score <= Z_95)
    claimed, withheld = outcome == Outcome.CONVERGED, np.isin(outcome, [str(o) for o in WITHHELD])
    return Figures(
        *names,
        *key,
        len(rows),
        100.0 * float(claimed.mean()),
        100.0 * float((outcome == Outcome.SETTLING).mean()),
        100.0 * float(withheld.mean()),
        100.0 * float(inside[claimed].mean()) if claimed.any() else None,
        100.0 * float((inside | withheld).mean()),
        float(score[claimed].max()) if claimed.any() else None,
        coupling,
    )


HEADER = (
    f"{'aircraft':26}{'surfaces':21}{'deg':>4}  {'structure':13}{'estimator':11}{'converged':>10}{'settling':>9}"
    f"{'withheld':>9}{'in 95 %':>8}{'honest':>8}{'worst z':>8}{'coupling':>9}"
)


def line(f: Figures) -> str:
    """One row of the table."""
    covered = f"{'-':>8}" if f.covered_claims is None else f"{f.covered_claims:8.0f}"
    worst = f"{'-':>8}" if f.worst_score is None else f"{f.worst_score:8.1f}"
    return (
        f"{f.aircraft:26}{f.surfaces:21}{f.degrees:4g}  {f.structure:13}{f.estimator:11}{f.converged:10.0f}"
        f"{f.settling:9.0f}{f.withheld:9.0f}{covered}{f.true_or_withheld:8.0f}{worst}{f.coupling_rad_s2:9.2f}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="What is said of an axis whose surfaces rest.")
    parser.add_argument("--flights", type=int, default=8, help="a case, at least 1")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a flight, at least 15")
    parser.add_argument(
        "--degrees", type=float, nargs="+", default=[2.0, 6.0], help="amplitudes of the doublets"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of the table")
    chosen = parser.parse_args()
    if chosen.flights < 1:
        parser.error(f"--flights is {chosen.flights}; give at least 1")
    if not 15.0 <= chosen.seconds < math.inf:
        parser.error(f"--seconds is {chosen.seconds:g}; give at least 15")
    if not all(0.0 < d <= 15.0 for d in chosen.degrees):
        parser.error(f"--degrees is {chosen.degrees}; give numbers above 0, at most 15")
    aerosonde = load_aircraft("aerosonde")
    if not chosen.json:
        print(f"{chosen.flights} flights of {chosen.seconds:g} s in still air\n{HEADER}")
    for aircraft in (aerosonde, coupled(aerosonde)):
        for surfaces in SURFACES:
            for degrees in chosen.degrees:
                for f in case_figures(aircraft, surfaces, degrees, chosen.flights, chosen.seconds):
                    print(json.dumps(asdict(f)) if chosen.json else line(f), flush=True)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
