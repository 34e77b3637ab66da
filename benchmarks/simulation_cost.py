"""Cost of simulated flight: microseconds of one core for a sample of a vehicle at 50 Hz, by batch and by what is on.

Run: python benchmarks/simulation_cost.py
"""

import time

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation import FleetSimulation, Icing, Scenario, Turbulence, doublet_schedule

RATE_HZ = 50.0
WORK = 20_000
"""Vehicle-samples a trial."""
TRIALS = 5


def microseconds(vehicles: int, turbulence: Turbulence, noise: bool) -> float:
    """The best of the trials, so that other work on the machine counts least."""
    aircraft = load_aircraft("aerosonde")
    manoeuvre = doublet_schedule(aircraft, FlightCondition(25.0, 1000.0))
    fleet = FleetSimulation(
        [
            Scenario(
                aircraft, manoeuvres=(manoeuvre,), effects=(Icing(0.15, 1.0, 30.0),), turbulence=turbulence, seed=i,
                noise=noise,
            )
            for i in range(vehicles)
        ],
        RATE_HZ,
    )  # fmt: skip
    samples = max(1, WORK // vehicles)
    fleet.step(1)
    best = float("inf")
    for _ in range(TRIALS):
        start = time.perf_counter()
        fleet.step(samples)
        best = min(best, time.perf_counter() - start)
    return best / (samples * vehicles) * 1e6


def main() -> None:
    cases: tuple[tuple[str, Turbulence, bool], ...] = (
        ("flight alone", "none", False),
        ("with sensor noise", "none", True),
        ("with noise and turbulence", "light", True),
    )
    print("simulation: microseconds per vehicle-sample at 50 Hz, one core; times real time in brackets")
    print(f"{'':28}{'batch of 1':>22}{'batch of 1000':>22}")
    for label, turbulence, noise in cases:
        cells = [microseconds(vehicles, turbulence, noise) for vehicles in (1, 1000)]
        print(f"{label:28}" + "".join(f"{us:12.2f} ({1e6 / (us * RATE_HZ):7.0f})" for us in cells))


if __name__ == "__main__":
    main()
