"""The numerical kernels in steps: what each compiles, and who needs it first.

A step calls what needs its kernels, with the least work that makes numba compile all of them. Where they are in numba's
cache already, the same call loads them. What a step does not name is compiled by the first who calls it.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

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
from wingwatch.estimators.ekf.accepted import NOISE
from wingwatch.monitor import VehicleMonitor
from wingwatch.telemetry import REQUIRED_CHANNELS, SampleBlock
from wingwatch.telemetry.conditioning import reconstruct_path, turbulence_intensity

__all__ = ["AFTER_DEMO", "AT_FIRST_USE", "DEMO", "EVERY", "LIVE", "STEPS", "KernelStep"]

_RATE_HZ = 50.0
_REFERENCE = (25.0, 1.2)
_VANES = ("angle_of_attack_rad", "sideslip_rad")
_A_MESSAGE = 10


@dataclass(frozen=True, slots=True)
class KernelStep:
    """Kernels that one process compiles in one go.

    Attributes:
        name: what they compute, in words.
        seconds: about the processor time that their compilation takes; only the ratio of two steps matters.
        run: calls them.
        after: steps whose kernels this one calls; begun before, they would be compiled twice.
    """

    name: str
    seconds: float
    run: Callable[[], object]
    after: tuple[str, ...] = ()


def _fourier() -> None:
    """One structure serves all: the kernels' types are the same."""
    k = len(SHORT_PERIOD.derivatives)
    estimator = FourierEstimator(FourierConfig(SHORT_PERIOD, (0.1, 1.0), np.zeros(k), np.ones(k), _REFERENCE))
    state = estimator.init(1)
    estimator.update(state, np.zeros((1, 1, estimator.layout.columns)))
    estimator.solve(state)


def _filter(span_m: float = 1.0) -> None:
    """Its kernels are compiled for the numbers of states, inputs and gusts: for two states and for three.

    Args:
        span_m: of the wing; where an aircraft file states none, the filter knows no gusts.
    """
    samples, half_second = 750, 25  # as long as it takes until the first seconds are run again
    for structure in (SHORT_PERIOD, LATERAL):
        k = len(structure.derivatives)
        estimator = EkfEstimator(EkfConfig(structure, np.zeros(k), np.ones(k), _REFERENCE, span_m=span_m))
        state = estimator.init(1)
        layout = SignalLayout(len(structure.states), len(structure.inputs))
        angles = np.outer(np.arange(samples) / _RATE_HZ, 2.0 + 0.7 * np.arange(layout.kinematic - 1))
        rows = _level_flight(layout, 0.05 * np.sin(angles))
        for start in range(0, samples, half_second):
            estimator.update(state, rows[None, start : start + half_second])
            estimator.solve(state)
        estimator.gust_variance(state, np.array([0]))
        for since_s in (0.8 * samples / _RATE_HZ, np.inf):  # what a change leads to, at its time or later
            estimator.release(state, np.eye(k)[0], 0, since_s)
        estimator.solve(state, np.array([NOISE]))  # it goes back to what it knew


def _level_flight(layout: SignalLayout, moving: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of signals at the reference, whose states, inputs and derivatives move as given."""
    rows = np.zeros((len(moving), layout.columns))
    rows[:, 0] = np.arange(len(moving)) / _RATE_HZ
    rows[:, 1 : layout.kinematic] = moving
    rows[:, layout.kinematic] = _REFERENCE[0] * rows[:, 2]
    rows[:, layout.kinematic + 1 : layout.kinematic + 4] = 1.0, *_REFERENCE
    rows[:, layout.kinematic + 6] = 1.0
    return rows


def _watch() -> None:
    """A short invented flight is watched, with vanes and for a moment without, and forgotten."""
    block, numbers = _flight(), itertools.count(1)
    blind = [name for name in block.present if name not in _VANES]
    for present, samples in ((block.present, len(block)), (blind, _A_MESSAGE)):
        monitor = VehicleMonitor(
            load_aircraft("aerosonde"), "default", "warm-up", present, {}, new_id=lambda: str(next(numbers))
        )
        for start in range(0, samples, _A_MESSAGE):
            monitor.feed(SampleBlock(block.values[start : start + _A_MESSAGE]))
        monitor.derivatives()
        monitor.view()
    turbulence_intensity(block)  # of half a minute, more than is flown here


def _flight() -> SampleBlock:
    """Level flight with every channel of every mode moving a little."""
    seconds = 25.0  # two blocks of the monitor's comparison and a little
    time_s = np.arange(round(seconds * _RATE_HZ)) / _RATE_HZ
    moving = ("elevator_rad", "aileron_rad", "rudder_rad", *_VANES)
    columns = {
        name: 0.02 * np.sin((2.0 + 0.7 * i) * time_s + i)
        for i, name in enumerate((*REQUIRED_CHANNELS, *moving))
    }
    columns["time_s"] = time_s
    columns["airspeed_true_m_s"] = 25.0 + columns["airspeed_true_m_s"]
    columns["altitude_m"] = 1000.0 + columns["altitude_m"]
    columns["air_density_kg_m3"] = np.full_like(time_s, 1.1)
    columns["specific_force_z_m_s2"] = -9.81 + columns["specific_force_z_m_s2"]
    return SampleBlock.from_columns(columns)


def _simulation() -> None:
    from wingwatch.simulation import FleetSimulation, demo_fleet  # only who simulates loads it

    FleetSimulation(demo_fleet(), _RATE_HZ).step(1)


def _whole_flights() -> None:
    """4 s of level flight; the kernels are the same for every structure. The path of two seconds is reconstructed."""
    layout = SignalLayout(2, 1)
    moving = 0.01 * np.random.default_rng(1).standard_normal((200, layout.kinematic - 1))
    rows = _level_flight(layout, moving)
    parts = manoeuvres(ManoeuvreConfig(SHORT_PERIOD, _REFERENCE), rows)
    output_error(parts)
    filter_error(parts, expected=np.array([-4.0, -0.5, -2.0, -4.0, -6.0, -30.0]))
    reconstruct_path(SampleBlock(_flight().values[: round(2.0 * _RATE_HZ)]))


def _diagnosis() -> None:
    """A short simulated flight in light turbulence, whose elevator has lost a third of its effectiveness."""
    from wingwatch.diagnosis import diagnose
    from wingwatch.simulation import Scenario, doublet_schedule, parse_effect, simulate

    aircraft = load_aircraft("aerosonde")
    plain = Scenario(aircraft)
    flown = Scenario(
        aircraft,
        manoeuvres=(doublet_schedule(aircraft, plain.condition, start_s=2.0),),
        effects=(parse_effect("elevator_effectiveness:0.3@0"),),
        turbulence="light",
        seed=1,
    )
    diagnose(simulate(flown, 11.0), aircraft)  # it needs ten seconds


STEPS: Mapping[str, KernelStep] = {
    "fourier": KernelStep("the Fourier estimator", 58.0, _fourier),
    "filter": KernelStep("the Kalman filter", 50.0, _filter),
    "calm-filter": KernelStep(
        "the Kalman filter without gusts", 28.0, partial(_filter, 0.0), after=("filter",)
    ),
    "simulation": KernelStep("simulated flight", 18.0, _simulation),
    "watch": KernelStep("signals and the monitor", 34.0, _watch, after=("fourier", "filter")),
    "whole-flights": KernelStep("estimates from whole flights", 20.0, _whole_flights),
    "diagnosis": KernelStep("diagnosis", 26.0, _diagnosis, after=("simulation",)),
}
"""By the name under which a process is asked for it, in the order in which they are begun."""

LIVE: Sequence[str] = ("fourier", "filter", "calm-filter", "watch")
"""Without these no sample is taken in."""

DEMO: Sequence[str] = ("simulation", "fourier", "filter", "watch")
"""What the simulated fleet needs: its aircraft state their span, so each filter has gusts. It flies once the first of
them is compiled; its messages wait for the others."""

AT_FIRST_USE: Sequence[str] = ("simulation", "whole-flights", "diagnosis")
"""For files: these can wait."""

AFTER_DEMO: Sequence[str] = ("calm-filter", *AT_FIRST_USE)
"""What the demonstration compiles once it is under way."""

EVERY: Sequence[str] = (
    "simulation", "filter", "fourier", "diagnosis", "calm-filter", "whole-flights", "watch",
)  # fmt: skip
"""All, for who waits for all: the long ones and those that others come after first, so that no process ends long before
the other."""
