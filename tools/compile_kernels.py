"""Compiles the numerical kernels once, for every process that follows: a short simulated flight through the live chain.

numba keeps what it compiles beside the sources, so this costs minutes the first time and seconds from then on. The
kernels of the Fourier form and of the estimators of whole flights, half of the work, are compiled by a second process
meanwhile: they lie in files of their own.
"""

import multiprocessing
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, load_aircraft
from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    FourierConfig,
    FourierEstimator,
    ManoeuvreConfig,
    SignalLayout,
    filter_error,
    manoeuvres,
    output_error,
)
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import SampleBlock

RATE_HZ, SECONDS, PIECE = 50.0, 25.0, 25
REFERENCE = (25.0, 1.2)


def compile_fourier() -> None:
    """The Fourier form's kernels; they are the same for every structure."""
    k = len(SHORT_PERIOD.derivatives)
    estimator = FourierEstimator(FourierConfig(SHORT_PERIOD, (0.1, 1.0), np.zeros(k), np.ones(k), REFERENCE))
    state = estimator.init(1)
    estimator.update(state, np.zeros((1, 1, estimator.layout.columns)))
    estimator.solve(state)


def compile_whole_flights() -> None:
    """The kernels of output error and filter error, which are the same for every structure, by 4 s of level flight."""
    samples, layout = 200, SignalLayout(2, 1)
    rng = np.random.default_rng(1)
    rows = np.zeros((samples, layout.columns))
    rows[:, 0] = np.arange(samples) / RATE_HZ
    rows[:, 1 : layout.kinematic] = 0.01 * rng.standard_normal((samples, layout.kinematic - 1))
    rows[:, layout.kinematic] = REFERENCE[0] * rows[:, 2]
    rows[:, layout.kinematic + 1 : layout.kinematic + 4] = 1.0, *REFERENCE
    rows[:, layout.kinematic + 6] = 1.0
    parts = manoeuvres(ManoeuvreConfig(SHORT_PERIOD, REFERENCE), rows)
    expected = np.array([-4.0, -0.5, -2.0, -4.0, -6.0, -30.0])
    output_error(parts)
    filter_error(parts, expected=expected)


def compile_beside() -> None:
    """What the second process compiles."""
    compile_fourier()
    compile_whole_flights()


def compile_filter() -> None:
    """The Kalman filter's kernels, for two states and for three."""
    for structure in (SHORT_PERIOD, LATERAL):
        k = len(structure.derivatives)
        estimator = EkfEstimator(EkfConfig(structure, np.zeros(k), np.ones(k), REFERENCE, span_m=1.0))
        state = estimator.init(1)
        layout = SignalLayout(len(structure.states), len(structure.inputs))
        estimator.update(state, np.zeros((1, 1, layout.columns)))
        estimator.solve(state)


def main() -> None:
    """Fly, watch and say how long it took."""
    print(
        "[set-up] numerical kernels: compiled on the first start, two to four minutes, then kept", flush=True
    )
    began = time.monotonic()
    other = multiprocessing.get_context("spawn").Process(target=compile_beside)
    other.start()
    aircraft = load_aircraft("aerosonde")
    plain = Scenario(aircraft, turbulence="light", seed=1)
    schedule = doublet_schedule(aircraft, plain.condition, start_s=3.0)
    simulation = FleetSimulation(
        [Scenario(aircraft, manoeuvres=(schedule,), turbulence="light", seed=1)], RATE_HZ
    )
    blocks = [SampleBlock(simulation.step(PIECE)[0]) for _ in range(round(SECONDS * RATE_HZ) // PIECE)]
    compile_filter()
    other.join()
    monitor: VehicleMonitor | None = None
    for block in blocks:
        if monitor is None:
            monitor = VehicleMonitor(aircraft, "set-up", "one", block.present, {}, new_id=lambda: "1")
        monitor.feed(block)
    print(f"[set-up] kernels ready after {time.monotonic() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
