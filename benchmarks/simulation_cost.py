"""Cost of simulated flight: microseconds of one core for a sample of a vehicle at 50 Hz, what of it goes where,
and what JSBSim needs for the same minute of flight.

Every figure is the best of several trials, so that other work on the machine counts least. What goes where comes from
flights that lack one thing, and from single kernels in a loop of their own; so the parts need not add up to the whole.

Run: python benchmarks/simulation_cost.py
"""

import os
import time
from collections.abc import Callable

import numpy as np
from numba import njit
from saving import run_benchmark

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.simulation import FleetSimulation, Icing, Scenario, doublet_schedule
from wingwatch.simulation.autopilot import MEMORY, ORDERS, autopilot
from wingwatch.simulation.layout import STATE
from wingwatch.simulation.prepared import working_row
from wingwatch.simulation.random_numbers import fill_normals, random_streams
from wingwatch.simulation.rigid_body import advance
from wingwatch.simulation.sensors import Sensors
from wingwatch.simulation.turbulence import NORMALS, gust_step
from wingwatch.telemetry import CHANNELS

RATE_HZ = 50.0
MINUTE_S = 60.0
WORK = 30_000
"""Vehicle-samples a trial."""
TRIALS = 9
BATCHES = (1, 1000)
JSBSIM_AIRCRAFT, JSBSIM_HZ = "c172p", 120.0


def best(work: Callable[[], object]) -> float:
    """Seconds of the quickest of the trials, after one that does not count."""
    work()
    spent = []
    for _ in range(TRIALS):
        start = time.perf_counter()
        work()
        spent.append(time.perf_counter() - start)
    return min(spent)


def scenario(aircraft: Aircraft, seed: int, without: str = "") -> Scenario:
    """A flight with everything that a study has on, but one."""
    manoeuvres = (doublet_schedule(aircraft, FlightCondition(25.0, 1000.0)),)
    return Scenario(
        aircraft,
        manoeuvres=() if without == "manoeuvres" else manoeuvres,
        effects=() if without == "effects" else (Icing(0.15, 1.0, 1e6),),
        turbulence="none" if without == "turbulence" else "light",
        noise=without != "noise",
        seed=seed,
    )


def flight_us(aircraft: Aircraft, vehicles: int, without: str = "") -> float:
    """A whole sample: flight and sensors."""
    fleet = FleetSimulation([scenario(aircraft, i, without) for i in range(vehicles)], RATE_HZ)
    samples = WORK // vehicles
    return best(lambda: fleet.step(samples)) / (samples * vehicles) * 1e6


def sensors_us(aircraft: Aircraft, vehicles: int) -> float:
    """Sensors and their noise alone."""
    scenarios = [scenario(aircraft, i) for i in range(vehicles)]
    sensors = Sensors(scenarios, [np.random.default_rng(i) for i in range(vehicles)], RATE_HZ)
    values = np.zeros((vehicles, WORK // vehicles, len(CHANNELS)))
    return best(lambda: sensors.read(values)) / WORK * 1e6


@njit(error_model="numpy")
def _many_steps(c, settings, states, dt, steps):  # type: ignore[no-untyped-def]
    k, middle, total, x = np.empty(13), np.empty(13), np.empty(13), np.empty(13)
    for _ in range(steps):
        x[:] = states[0]
        advance(c, settings[0], x, dt, k, middle, total)


@njit(error_model="numpy")
def _many_orders(states, gains, route, steps, memory, orders):  # type: ignore[no-untyped-def]
    for _ in range(steps):
        autopilot(states[0], 25.0, gains[0], route[0], memory, 0.02, orders)


@njit(error_model="numpy")
def _many_gusts(filters, streams, steps, state, normals, after, middle):  # type: ignore[no-untyped-def]
    for _ in range(steps):
        fill_normals(streams[0], normals)
        gust_step(filters[0], state, normals, after, middle)


def kernels_us(aircraft: Aircraft) -> dict[str, float]:
    """Single kernels, as often as a sample calls them."""
    fleet = FleetSimulation([scenario(aircraft, 1)], RATE_HZ)
    fleet.step(1)
    constant, state = fleet._fleet, fleet._state
    steps = round(fleet.steps_hz[0] / RATE_HZ)
    c = working_row(constant.base[0])
    memory, orders = np.zeros(MEMORY), np.zeros(ORDERS)
    streams = random_streams([np.random.default_rng(1)])
    air = np.zeros_like(state.gust_filter[0]), np.zeros(NORMALS), np.zeros(6), np.zeros(6)
    assert state.rigid.shape[1] == len(STATE)
    per = WORK * 1e-6
    return {
        f"equations of motion, {steps} steps": best(
            lambda: _many_steps(c, state.setting, state.rigid, 0.02 / steps, WORK * steps)
        )
        / per,
        "autopilot": best(
            lambda: _many_orders(state.rigid, constant.gains, constant.route, WORK, memory, orders)
        )
        / per,
        "gusts and their random numbers": best(lambda: _many_gusts(constant.gust_filter, streams, WORK, *air))
        / per,
    }


def jsbsim_minute_s() -> float | None:
    """A minute of JSBSim's own light aircraft, left alone, at its usual rate; None where not installed."""
    os.environ.setdefault("JSBSIM_DEBUG", "0")  # it greets on standard output otherwise
    try:
        import jsbsim
    except ImportError:
        return None
    model = jsbsim.FGFDMExec(None)
    model.set_debug_level(0)
    model.load_model(JSBSIM_AIRCRAFT)
    model.set_dt(1.0 / JSBSIM_HZ)
    for name, value in (("h-sl-ft", 3280.0), ("vc-kts", 100.0), ("gamma-deg", 0.0)):
        model[f"ic/{name}"] = value
    model.run_ic()
    model["propulsion/set-running"] = -1
    model["fcs/throttle-cmd-norm"] = 0.7

    def minute() -> None:
        for _ in range(round(MINUTE_S * JSBSIM_HZ)):
            model.run()

    return best(minute)


def times_real(us: float) -> str:
    return f"{us:9.2f} ({1e6 / (us * RATE_HZ):7.0f})"


def main() -> None:
    aircraft = load_aircraft("aerosonde")
    print("simulation: microseconds per vehicle-sample at 50 Hz, one core; times real time in brackets")
    print(f"{'':44}" + "".join(f"{f'batch of {n}':>19}" for n in BATCHES))
    whole = [flight_us(aircraft, n) for n in BATCHES]
    print(f"{'everything':44}" + "".join(f"{times_real(us):>19}" for us in whole))
    for without in ("noise", "turbulence", "manoeuvres", "effects"):
        cells = [flight_us(aircraft, n, without) for n in BATCHES]
        print(f"{f'  without {without}':44}" + "".join(f"{times_real(us):>19}" for us in cells))
    print("of it")
    cells = [sensors_us(aircraft, n) for n in BATCHES]
    print(f"{'  sensors and their noise':44}" + "".join(f"{us:9.2f}{'':10}" for us in cells))
    for name, us in kernels_us(aircraft).items():
        print(f"{f'  {name} (kernel alone)':44}{us:9.2f}")
    theirs = jsbsim_minute_s()
    print("the same minute of flight, milliseconds")
    for n, us in zip(BATCHES, whole, strict=True):
        print(
            f"{f'  here, with autopilot and sensors, batch of {n}':50}{us * MINUTE_S * RATE_HZ * 1e-3:9.2f}"
        )
    if theirs is None:
        print("  JSBSim is not installed: pip install jsbsim")
    else:
        print(
            f"{f'  JSBSim, {JSBSIM_AIRCRAFT}, {JSBSIM_HZ:g} Hz, no autopilot or noise':50}{1e3 * theirs:9.2f}"
        )


if __name__ == "__main__":
    run_benchmark(main)
