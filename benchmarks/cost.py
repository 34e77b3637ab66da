"""What one vehicle-sample costs through both estimators and the monitor, in batches of 1 and of 1,000.

Beside it, in the same run and on the same model and signals: filterpy's extended Kalman filter as a loop in Python.
Times are CPU time of one process after a warm-up, so other work on the machine counts little and compilation not at
all; what remains of the machine's mood falls on all rows alike: read the ratios.

Run: python benchmarks/cost.py [--vehicles N] [--seconds S]
"""

import argparse
import itertools
import time
import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.aircraft import STRUCTURES, Aircraft, ModeStructure, analysis_band_hz, load_aircraft
from wingwatch.baselines import OutOfEnvelope, apriori_envelope
from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    EkfState,
    FourierConfig,
    FourierEstimator,
    FourierState,
    SignalConfig,
    Signals,
    SignalState,
    offsets,
)
from wingwatch.estimators.ekf.model import measure, transition
from wingwatch.estimators.ekf.recursion import step_of
from wingwatch.estimators.ekf.sample import Sample
from wingwatch.estimators.ekf.state import arrays_of
from wingwatch.monitor import Chain, VehicleMonitor
from wingwatch.monitor.estimation.chain import nominal_condition
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule, simulate
from wingwatch.telemetry import Cleaner, SampleBlock

Array = NDArray[np.float64]

RATE_HZ = 50.0
PIECES = (10, 10, 5)
"""Samples a message; after the three of them half a second is full and both estimators solve."""
PARTS = ("signals", "Fourier bank", "Fourier solution (2 Hz)", "filter step", "filter forgetting (2 Hz)")
HELD = (
    "signals",
    "Fourier estimator",
    "filter",
    "Fourier checkpoints",
    "filter's window and its checkpoints",
)
SETTLED_S = 200.0
"""From here on the monitor remembers as many blocks as it ever will."""
WATCHED_S = 300.0


@dataclass(slots=True)
class Mode:
    """One structure's estimators with their states, and the CPU time spent in each."""

    structure: ModeStructure
    signals: Signals
    fourier: FourierEstimator
    ekf: EkfEstimator
    signal_state: SignalState
    fourier_state: FourierState
    ekf_state: EkfState

    @property
    def state_bytes(self) -> dict[str, int]:
        """Size of the state arrays by what they are for."""
        sizes = dict.fromkeys(HELD, 0)
        for f in fields(self.fourier_state):
            part = HELD[3] if f.name.startswith("checkpoint_") else HELD[1]
            sizes[part] += getattr(self.fourier_state, f.name).nbytes
        for f in fields(self.signal_state):
            sizes[HELD[0]] += getattr(self.signal_state, f.name).nbytes
        for name, array in arrays_of(self.ekf_state):
            sizes[HELD[4] if name.startswith("window.") else HELD[2]] += array.nbytes
        return sizes


@dataclass(frozen=True, slots=True)
class Watch:
    """Microseconds a vehicle-sample of one vehicle watched as live."""

    cleaning: float
    chain: float
    everything: float

    @property
    def monitor(self) -> float:
        """Comparison, sequential test, alerts and state: what is neither cleaning nor estimation."""
        return self.everything - self.cleaning - self.chain


def modes(aircraft: Aircraft, vehicles: int) -> list[Mode]:
    """Every structure's estimators, configured as the live chain does."""
    nominal = nominal_condition(aircraft)
    if nominal is None:
        raise ValueError(f"aircraft {aircraft.name} states no condition; take one of the library that does")
    made = []
    for structure in STRUCTURES.values():
        prior = apriori_envelope(aircraft, structure, "clean").lookup(nominal)
        if isinstance(prior, OutOfEnvelope):
            raise ValueError(prior.reason)
        reference = (nominal.airspeed_true_m_s, nominal.air_density_kg_m3)
        value = prior.value - offsets(structure, nominal.airspeed_true_m_s, nominal.angle_of_attack_rad)
        size = np.maximum(np.abs(value), 2.0 * np.sqrt(np.diagonal(prior.covariance)))
        signals = Signals(
            SignalConfig(structure, aircraft.sensors.vane_position_m, reference_airspeed_m_s=reference[0])
        )
        span_m = aircraft.geometry.span_m if aircraft.geometry else 0.0
        fourier = FourierEstimator(
            FourierConfig(
                structure, analysis_band_hz(aircraft, structure), value, 3.0 * size, reference, span_m=span_m
            )
        )
        ekf = EkfEstimator(EkfConfig(structure, value, size, reference, span_m=span_m))
        made.append(
            Mode(structure, signals, fourier, ekf, signals.init(vehicles), fourier.init(vehicles), ekf.init(vehicles))
        )  # fmt: skip
    return made


def scenario(aircraft: Aircraft, seed: int) -> Scenario:
    """As in the demonstration: 25 m/s, 1000 m, doublets on all surfaces."""
    plain = Scenario(aircraft, seed=seed)
    return Scenario(aircraft, manoeuvres=(doublet_schedule(aircraft, plain.condition),), seed=seed)


def estimator_cost(
    aircraft: Aircraft, vehicles: int, seconds: float
) -> tuple[dict[str, float], dict[str, int]]:
    """Microseconds a vehicle-sample of each part, all structures together, and bytes of state a vehicle by part."""
    simulation = FleetSimulation([scenario(aircraft, seed) for seed in range(vehicles)], RATE_HZ)
    parts = modes(aircraft, vehicles)
    halves = round(seconds * RATE_HZ) // sum(PIECES)
    spent = dict.fromkeys(PARTS, 0.0)
    for _ in range(halves):
        for piece in PIECES:
            values = simulation.step(piece)
            for m in parts:
                _take(m, values, spent)
        for m in parts:
            _solve(m, spent)
    samples = halves * sum(PIECES) * vehicles
    held = {part: sum(m.state_bytes[part] for m in parts) // vehicles for part in HELD}
    return {k: v / samples * 1e6 for k, v in spent.items()}, held


def _take(m: Mode, values: Array, spent: dict[str, float]) -> None:
    start = time.process_time()
    rows = m.signals.update(m.signal_state, values)
    made = time.process_time()
    m.fourier.update(m.fourier_state, rows)
    transformed = time.process_time()
    m.ekf.update(m.ekf_state, rows)
    end = time.process_time()
    spent["signals"] += made - start
    spent["Fourier bank"] += transformed - made
    spent["filter step"] += end - transformed


def _solve(m: Mode, spent: dict[str, float]) -> None:
    start = time.process_time()
    m.fourier.solve(m.fourier_state)
    between = time.process_time()
    m.ekf.solve(m.ekf_state)
    end = time.process_time()
    spent["Fourier solution (2 Hz)"] += between - start
    spent["filter forgetting (2 Hz)"] += end - between


class _Filter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy carries no types
    """filterpy's filter with the state's prediction handed in instead of F x."""

    def predict_x(self, u: float = 0) -> None:
        """The state has been predicted by the model already."""


def filterpy_cost(aircraft: Aircraft, seconds: float) -> dict[str, float]:
    """Microseconds a sample of filterpy's filter, all structures together, one vehicle.

    ``bare``: model functions (the same compiled ones) and filterpy's predict and update, one filter object kept, noise
    levels fixed. ``with adaptation``: our engine "filterpy", which agrees with the compiled one to rounding.
    """
    flown = simulate(scenario(aircraft, 0), seconds, RATE_HZ)
    bare = adapted = 0.0
    for m in modes(aircraft, 1):
        rows = m.signals.update(m.signal_state, flown.values[None])[0]
        bare += _bare_loop(m, rows)
        engine = EkfEstimator(replace(m.ekf.config, engine="filterpy"))
        state = engine.init(1)
        start = time.process_time()
        engine.update(state, rows[None])
        adapted += time.process_time() - start
    return {"bare": bare / len(flown) * 1e6, "with adaptation": adapted / len(flown) * 1e6}


def _bare_loop(m: Mode, rows: Array) -> float:
    """CPU time of the plain predict and update loop over all rows, by a filter that knows only calm air."""
    calm = EkfEstimator(replace(m.ekf.config, span_m=0.0))
    state, model, ns = calm.init(1), calm.model, calm.layout.states
    kalman = _Filter(dim_x=model.sizes.augmented, dim_z=ns + 1)
    kalman.x, kalman.P = state.z[0].copy(), state.cov[0].copy()
    kalman.Q, kalman.R = 1e-4 * np.eye(len(kalman.x)), 1e-2 * np.eye(ns + 1)
    start = time.process_time()
    for k in range(2, len(rows)):
        dt = rows[k, 0] - rows[k - 1, 0]
        sample = Sample(rows[k], rows[k - 1], rows[k - 2], dt, True, 0.0)
        step = step_of(model, sample, False, model.gust_direction)
        moved = transition(model, kalman.x, step)
        kalman.x, kalman.F[:ns] = moved.after, moved.jacobian
        kalman.predict()
        expected, jacobian = measure(model, kalman.x, step)
        kalman.update(rows[k, 1 : 2 + ns], lambda _: jacobian, lambda _: expected)  # noqa: B023
    return time.process_time() - start


def watch_cost(aircraft: Aircraft) -> Watch:
    """One vehicle as live, from the time on at which the monitor's memory is full, 10 samples a message."""
    flown = simulate(scenario(aircraft, 0), WATCHED_S, RATE_HZ)
    pieces = [SampleBlock(flown.values[k : k + 10]) for k in range(0, len(flown), 10)]
    first = round(SETTLED_S * RATE_HZ) // 10
    samples = (len(pieces) - first) * 10
    cleaner, chain = Cleaner(), Chain(aircraft, flown.present, {})
    clean = [cleaner.clean(p).block for p in pieces[:first]]
    start = time.process_time()
    clean += [cleaner.clean(p).block for p in pieces[first:]]
    cleaning = time.process_time() - start
    state = chain.init()
    for block in clean[:first]:
        for _ in chain.advance(state, block):
            pass
    start = time.process_time()
    for block in clean[first:]:
        for _ in chain.advance(state, block):
            pass
    chained = time.process_time() - start
    monitor = _monitor(aircraft, flown.present)
    for block in pieces[:first]:
        monitor.feed(block)
    start = time.process_time()
    for block in pieces[first:]:
        monitor.feed(block)
    everything = time.process_time() - start
    return Watch(cleaning / samples * 1e6, chained / samples * 1e6, everything / samples * 1e6)


def _monitor(aircraft: Aircraft, present: Sequence[str]) -> VehicleMonitor:
    numbers = itertools.count(1)
    return VehicleMonitor(aircraft, "benchmark", "one", present, {}, new_id=lambda: str(next(numbers)))


def monitor_bytes(aircraft: Aircraft) -> int:
    """Memory that a vehicle's whole watch holds once the monitor's memory is full."""
    flown = simulate(scenario(aircraft, 0), SETTLED_S, RATE_HZ)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        monitor = _monitor(aircraft, flown.present)
        for k in range(0, len(flown), 10):
            monitor.feed(SampleBlock(flown.values[k : k + 10]))
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return after - before


def warm_up(aircraft: Aircraft) -> float:
    """Wall-clock time until every kernel has been compiled, or loaded from numba's cache, and run."""
    start = time.perf_counter()
    flown = simulate(scenario(aircraft, 0), 25.0, RATE_HZ)
    monitor = _monitor(aircraft, flown.present)
    for k in range(0, len(flown), 10):
        monitor.feed(SampleBlock(flown.values[k : k + 10]))
    filterpy_cost(aircraft, 7.0)  # past the seconds in which only noise levels are learned
    estimator_cost(aircraft, 2, 1.0)
    return time.perf_counter() - start


def _row(label: str, one: float, many: float) -> None:
    print(f"  {label:<42}{one:14.2f}{many:14.2f}{one / many:10.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Cost of one vehicle-sample.")
    parser.add_argument("--vehicles", type=int, default=1000, help="of the large batch, at least 2")
    parser.add_argument("--seconds", type=float, default=20.0, help="flight of the large batch, at least 1")
    given = parser.parse_args()
    if given.vehicles < 2 or not given.seconds >= 1.0:
        parser.error("give --vehicles of at least 2 and --seconds of at least 1")
    aircraft = load_aircraft("aerosonde")
    print(f"compiling or loading all kernels, and their first run: {warm_up(aircraft):.1f} s")
    one, one_bytes = estimator_cost(aircraft, 1, 200.0)
    many, _ = estimator_cost(aircraft, given.vehicles, given.seconds)
    watch = watch_cost(aircraft)
    peer = filterpy_cost(aircraft, 40.0)
    print(f"\nmicroseconds of CPU a vehicle-sample at {RATE_HZ:g} Hz; {', '.join(STRUCTURES)} together")
    print(f"  {'':<42}{'batch of 1':>14}{f'of {given.vehicles}':>14}{'ratio':>10}")
    for part in PARTS:
        _row(part, one[part], many[part])
    both = sum(one.values()), sum(many.values())
    _row("both estimators", *both)
    print("\none vehicle as live (messages of 10 samples, monitor's memory full)")
    print(f"  {'cleaning':<42}{watch.cleaning:14.2f}")
    print(f"  {'chain: estimators and their reading':<42}{watch.chain:14.2f}")
    print(f"  {'monitor: comparison, test, alerts':<42}{watch.monitor:14.2f}")
    print(f"  {'all of it':<42}{watch.everything:14.2f}")
    ours = one["filter step"], many["filter step"]
    print("\nfilterpy's extended Kalman filter, same model and signals, and how many times dearer it is than")
    print(f"  {'':<42}{'':>14}{'our filter, batch of':>24}{'both estimators':>20}")
    print(f"  {'':<42}{'microseconds':>14}{'1':>12}{given.vehicles:>12}{f'at {given.vehicles}':>20}")
    for label, us in peer.items():
        print(f"  {label:<42}{us:14.1f}{us / ours[0]:12.1f}{us / ours[1]:12.1f}{us / both[1]:20.1f}")
    print("\nmemory a vehicle, KiB")
    for part, size in one_bytes.items():
        print(f"  {part:<42}{size / 1024:14.1f}")
    print(f"  {'all estimator state':<42}{sum(one_bytes.values()) / 1024:14.1f}")
    print(f"  {'the whole watch as live':<42}{monitor_bytes(aircraft) / 1024:14.0f}")


if __name__ == "__main__":
    run_benchmark(main)
