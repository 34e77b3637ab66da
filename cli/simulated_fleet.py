"""The demonstration's fleet: simulated flights sent over a Zenoh session of their own, in real time.

It is given scenarios and an endpoint, nothing of the service: what is true of a flight stays here.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Self

import numpy as np
import zenoh
from numpy.typing import NDArray

from wingwatch.simulation import FleetSimulation, Scenario
from wingwatch.simulation.navigation import M_A_DEGREE_EAST, M_A_DEGREE_NORTH
from wingwatch.telemetry import (
    CHANNEL_INDEX,
    AircraftMessage,
    FlightPublisher,
    SampleBlock,
    ZenohSettings,
    open_session,
)

__all__ = ["SimulatedFleet"]

_LOG = logging.getLogger(__name__)
_SAMPLES_A_MESSAGE = 5
_AT_ONCE = 1e9  # rate of a message whose moment has come: the pace is kept here, for all vehicles together
_LATEST_S = 1.0
_STOP_S = 1.0
_LOOK_S = 0.2
_APART_NORTH_M, _APART_EAST_M = 250.0, 400.0
_PLACE = [CHANNEL_INDEX["latitude_deg"], CHANNEL_INDEX["longitude_deg"]]


class SimulatedFleet:
    """Flies in a thread of its own; use it in a ``with`` statement.

    Simulated flights all start at one place. Here each vehicle is some hundred metres beside and behind the one before:
    its receiver's positions are moved, and nothing else.

    Args:
        scenarios: one a vehicle, each with a name.
        endpoint: Zenoh endpoint of the service.
        rate_hz: samples a second.
        speed: 1 is real time.
        clock: monotonic seconds.
        await_kernels: waits at most that many seconds for the simulation's kernels; whether they are there. Without,
            this process compiles those that are missing.

    Attributes:
        problem: why the fleet no longer flies; None while it does.
    """

    def __init__(
        self, scenarios: Sequence[Scenario], endpoint: str, rate_hz: float = 50.0, speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic, await_kernels: Callable[[float], bool] | None = None,
    ) -> None:  # fmt: skip
        self._scenarios = tuple(scenarios)
        self._endpoint = endpoint
        self._rate_hz = rate_hz
        self._speed = speed
        self._clock = clock
        self._await_kernels = await_kernels
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wingwatch-simulated-fleet", daemon=True)
        self.problem: str | None = None

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join(_STOP_S)

    @property
    def alive(self) -> bool:
        """Whether the thread still runs."""
        return self._thread.is_alive()

    def _run(self) -> None:
        while self._await_kernels is not None and not self._await_kernels(_LOOK_S):
            if self._end.is_set():
                return
        try:
            simulation = FleetSimulation(self._scenarios, self._rate_hz)
            simulation.step(0)  # compiles before the first moment is due
            with ExitStack() as stack:
                session = stack.enter_context(open_session(ZenohSettings.for_vehicle((self._endpoint,))))
                publishers = [stack.enter_context(_publisher(session, s)) for s in self._scenarios]
                self._fly(simulation, publishers)
        except Exception as error:
            _LOG.exception("the simulated fleet ended")
            self.problem = f"{type(error).__name__}: {error}"

    def _fly(self, simulation: FleetSimulation, publishers: Sequence[FlightPublisher]) -> None:
        period_s = _SAMPLES_A_MESSAGE / (self._rate_hz * self._speed)
        due_s = self._clock() + period_s
        places_deg = _places_deg(len(publishers))
        while not self._end.wait(max(0.0, due_s - self._clock())):
            flown = simulation.step(_SAMPLES_A_MESSAGE)
            flown[:, :, _PLACE] += places_deg[:, None]
            for publisher, rows in zip(publishers, flown, strict=True):
                publisher.publish(SampleBlock(rows), _AT_ONCE)
            due_s = max(
                due_s + period_s, self._clock() - _LATEST_S
            )  # a machine that slept is not caught up with


def _places_deg(vehicles: int) -> NDArray[np.float64]:
    """Latitude and longitude of each from the first, shape (vehicles, 2): every other one is behind."""
    k = np.arange(vehicles)
    north_m, east_m = -_APART_NORTH_M * (k % 2), _APART_EAST_M * k
    return np.stack((north_m / M_A_DEGREE_NORTH, east_m / M_A_DEGREE_EAST), axis=1)


def _publisher(session: zenoh.Session, scenario: Scenario) -> FlightPublisher:
    aircraft = AircraftMessage(aircraft=scenario.aircraft.name)
    return FlightPublisher(
        session, "default", scenario.name, aircraft, samples_per_message=_SAMPLES_A_MESSAGE
    )
