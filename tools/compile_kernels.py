"""Compiles the numerical kernels once, for every process that follows: a short simulated flight through the live chain.

numba keeps what it compiles beside the sources, so this costs minutes the first time and seconds from then on.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import SampleBlock

RATE_HZ, SECONDS, PIECE = 50.0, 25.0, 25


def main() -> None:
    """Fly, watch and say how long it took."""
    print(
        "[set-up] numerical kernels: compiled on the first start, two to three minutes, then kept", flush=True
    )
    began = time.monotonic()
    aircraft = load_aircraft("aerosonde")
    plain = Scenario(aircraft, turbulence="light", seed=1)
    schedule = doublet_schedule(aircraft, plain.condition, start_s=3.0)
    simulation = FleetSimulation(
        [Scenario(aircraft, manoeuvres=(schedule,), turbulence="light", seed=1)], RATE_HZ
    )
    monitor: VehicleMonitor | None = None
    for _ in range(round(SECONDS * RATE_HZ) // PIECE):
        block = SampleBlock(simulation.step(PIECE)[0])
        if monitor is None:
            monitor = VehicleMonitor(aircraft, "set-up", "one", block.present, {}, new_id=lambda: "1")
        monitor.feed(block)
    print(f"[set-up] kernels ready after {time.monotonic() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
