"""What the estimators make of a designed input, beside the standard errors that it promises.

The Aerosonde's linear short period and Dutch roll at cruise with the noise of the file's sensors, surfaces included:
10 s quiet, then the input of 10 s, held between samples. Estimators as live, given the noise, started 30 % off, without
forgetting. As in the promise, airspeed and dynamic pressure are known.

Run: python benchmarks/promised_errors.py [--seeds N] [--degrees A]
"""

import argparse
import math

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.aircraft import (
    DUTCH_ROLL,
    GRAVITY_M_S2,
    SHORT_PERIOD,
    ModeStructure,
    analysis_band_hz,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    FourierConfig,
    FourierEstimator,
    SignalLayout,
    offsets,
)
from wingwatch.input_design import SensedPlant, design_input, promise, sensed_plant, surface_targets
from wingwatch.simulation import linear_response, specific_force, state_rates

Array = NDArray[np.float64]

AIRCRAFT = load_aircraft("aerosonde")
RATE_HZ, QUIET_S, LENGTH_S = 50.0, 10.0, 10.0
KINDS = ("doublet", "3211", "multisine", "weighted-multisine")
SOLVE_EVERY = 25
"""Samples between solutions: 2 Hz, as live."""
ENDLESS_S = 1e9


def plant_of(structure: ModeStructure) -> SensedPlant:
    """The mode at cruise with the file's sensors."""
    assert AIRCRAFT.envelope is not None
    condition = trimmed(AIRCRAFT, AIRCRAFT.envelope.cruise)
    return sensed_plant(
        AIRCRAFT, structure, condition, linearised_derivatives(AIRCRAFT, condition, structure)
    )


def inputs(plant: SensedPlant, kind: str, degrees: float) -> Array:
    """The designed input, shape (samples, 1)."""
    derivatives = dict(zip(plant.structure.derivatives, map(float, plant.derivatives), strict=True))
    targets = surface_targets(
        plant.structure, derivatives, analysis_band_hz(AIRCRAFT, plant.structure), math.radians(degrees)
    )
    return design_input(kind, targets, LENGTH_S, RATE_HZ).inputs_rad


def flights(plant: SensedPlant, u: Array, seeds: int) -> Array:
    """Signals of as many noisy flights, shape (seeds, samples, columns)."""
    s, at = plant.structure, plant.condition
    derivatives = dict(zip(s.derivatives, map(float, plant.derivatives), strict=True))
    whole = np.vstack([np.zeros((round(QUIET_S * RATE_HZ), 1)), u])
    states = linear_response(s, derivatives, whole, 1.0 / RATE_HZ)
    rates = state_rates(s, derivatives, states, whole)
    pitch = at.angle_of_attack_rad
    force = specific_force(s, rates, states[:, 1], at, pitch)
    layout, rows = SignalLayout(2, 1), []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        row = np.zeros((len(whole), layout.columns))
        row[:, 0] = np.arange(len(whole)) / RATE_HZ
        row[:, 1:4] = np.column_stack([states, force]) + plant.noise_std * rng.standard_normal(
            (len(whole), 3)
        )
        row[:, layout.first_input] = whole[:, 0] + plant.input_noise_std * rng.standard_normal(len(whole))
        turn = at.forward_velocity_m_s * row[:, 2]
        level = GRAVITY_M_S2 * math.cos(pitch)
        row[:, layout.kinematic] = turn + level if s == SHORT_PERIOD else -turn
        row[:, layout.kinematic + 1 : layout.known_moments] = [
            1.0, at.airspeed_true_m_s, at.air_density_kg_m3, at.altitude_m, at.angle_of_attack_rad, 1.0,
        ]  # fmt: skip
        rows.append(row)
    return np.stack(rows)


def estimates(plant: SensedPlant, rows: Array) -> dict[str, Array]:
    """Last values by estimator, shape (seeds, derivatives)."""
    s, at = plant.structure, plant.condition
    reference = (at.airspeed_true_m_s, at.air_density_kg_m3)
    aerodynamic = plant.derivatives - offsets(s, at.airspeed_true_m_s, at.angle_of_attack_rad)
    size = np.maximum(np.abs(aerodynamic), 0.1)
    stated_std = tuple(map(float, plant.noise_std[: len(s.states)]))
    n = rows.shape[0]
    fourier = FourierEstimator(
        FourierConfig(
            s,
            analysis_band_hz(AIRCRAFT, s),
            0.7 * aerodynamic,
            3.0 * size,
            reference,
            block_s=LENGTH_S,
            held=(True,),
            input_noise_std=tuple(map(float, plant.input_noise_std)),
        )
    )
    state = fourier.init(n)
    for k in range(0, rows.shape[1], SOLVE_EVERY):
        fourier.update(state, rows[:, k : k + SOLVE_EVERY])
        fourier.solve(state)
    ekf = EkfEstimator(
        EkfConfig(
            s, 0.7 * aerodynamic, size, reference, memory_s=ENDLESS_S, noise_std=stated_std, held=(True,)
        )
    )
    filtered = ekf.init(n)
    for k in range(0, rows.shape[1], SOLVE_EVERY):
        ekf.update(filtered, rows[:, k : k + SOLVE_EVERY])
        ekf.solve(filtered)
    return {
        "fourier": np.array([fourier.estimate(state, i).value for i in range(n)]),
        "ekf": np.array([ekf.estimate(filtered, i).value for i in range(n)]),
    }


def ratios(plant: SensedPlant, kind: str, degrees: float, seeds: int) -> tuple[Array, dict[str, Array]]:
    """Promised standard errors, and rms errors over them by estimator, each (derivatives,)."""
    u = inputs(plant, kind, degrees)
    promised = promise(plant, u, RATE_HZ).standard_error
    rows = flights(plant, u, seeds)
    return promised, {
        name: np.sqrt(np.mean((values - plant.derivatives) ** 2, axis=0)) / promised
        for name, values in estimates(plant, rows).items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Estimators beside what a designed input promises.")
    parser.add_argument("--seeds", type=int, default=100, help="flights a kind, at least 2")
    parser.add_argument("--degrees", type=float, default=2.0, help="amplitude")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error(f"--seeds is {arguments.seeds}; give at least 2")
    for structure in (SHORT_PERIOD, DUTCH_ROLL):
        plant = plant_of(structure)
        print(f"\n{structure.name}, {arguments.degrees:g} degrees, {arguments.seeds} flights")
        print(" " * 34 + "".join(f"{s:>9}" for s in structure.derivatives))
        for kind in KINDS:
            promised, reached = ratios(plant, kind, arguments.degrees, arguments.seeds)
            share = 100.0 * promised / np.abs(plant.derivatives)
            print(f"  {kind:<20}{'promised, %':<12}" + "".join(f"{x:9.2f}" for x in share))
            for name, ratio in reached.items():
                print(f"  {'':<20}{name + ' / it':<12}" + "".join(f"{x:9.2f}" for x in ratio))
    print(
        f"\nA ratio of rms errors is known to {100.0 / math.sqrt(2.0 * arguments.seeds):.0f} % (one sigma)."
    )


if __name__ == "__main__":
    run_benchmark(main)
