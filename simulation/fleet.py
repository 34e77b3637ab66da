"""A fleet of simulated aircraft, stepped together: integration, autopilot, turbulence, sensors."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.simulation.flight import fly
from wingwatch.simulation.scenario import Scenario
from wingwatch.simulation.sensors import Sensors
from wingwatch.simulation.set_up import flying_start
from wingwatch.telemetry import CHANNELS, SampleBlock

__all__ = ["FleetSimulation", "simulate"]


class FleetSimulation:
    """Flights of several scenarios, stepped together.

    Args:
        scenarios: one a vehicle.
        rate_hz: samples a second.
        refine: times as many integration steps as the aircraft's fastest motion needs, to see that it makes
            no difference.

    Raises:
        ValueError: no scenario, a rate outside 1 to 1000 Hz, a refinement outside 1 to 100, or an aircraft that its
            autopilot cannot fly.
        AircraftDataError, TrimError: an aircraft that cannot be simulated, or not be trimmed as asked.
    """

    def __init__(self, scenarios: Sequence[Scenario], rate_hz: float = 50.0, refine: int = 1) -> None:
        if not scenarios:
            raise ValueError("a fleet without a scenario cannot fly; give at least one")
        if not 1.0 <= rate_hz <= 1000.0:
            raise ValueError(f"rate_hz is {rate_hz}; give 1 to 1000 samples a second")
        if not 1 <= refine <= 100:
            raise ValueError(f"refine is {refine}; give 1 to 100")
        self.scenarios = tuple(scenarios)
        self.rate_hz = float(rate_hz)
        streams = [
            [np.random.default_rng(c) for c in np.random.SeedSequence(s.seed).spawn(2)] for s in scenarios
        ]
        self._fleet, self._state = flying_start(
            self.scenarios, [air for air, _ in streams], self.rate_hz, refine
        )
        self._sensors = Sensors(scenarios, [sensors for _, sensors in streams], self.rate_hz)
        self._samples = 0

    @property
    def time_s(self) -> float:
        """Time stamp of the next sample."""
        return self._samples / self.rate_hz

    @property
    def steps_hz(self) -> NDArray[np.float64]:
        """Integration steps a second of each vehicle, shape (vehicles,)."""
        return np.asarray(self._fleet.steps_a_sample * self.rate_hz, dtype=np.float64)

    @property
    def positions_m(self) -> NDArray[np.float64]:
        """Where each vehicle is then, north, east and down of its start (down of sea level), shape (vehicles, 3)."""
        return self._state.rigid[:, :3].copy()

    def step(self, n_samples: int) -> NDArray[np.float64]:
        """The next samples of every vehicle.

        Returns:
            Shape (vehicles, n_samples, channels) in the order of ``CHANNELS``, NaN in columns that are not simulated.
            The first sample of a flight, at time 0, is the trimmed aircraft.

        Raises:
            ValueError: a negative number of samples.
        """
        if n_samples < 0:
            raise ValueError(f"n_samples is {n_samples}; give a number of samples from 0")
        out = np.empty((len(self.scenarios), n_samples, len(CHANNELS)))
        fly(self._fleet, self._state, self._samples, self.rate_hz, out)
        self._samples += n_samples
        self._sensors.read(out)
        return out


def simulate(scenario: Scenario, seconds: float, rate_hz: float = 50.0) -> SampleBlock:
    """One flight from time 0; as many samples as fit into ``seconds``, at least one.

    Raises:
        ValueError: a length that is not positive; else as ``FleetSimulation``.
    """
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise ValueError(f"seconds is {seconds}; give a positive length of flight")
    return SampleBlock(FleetSimulation([scenario], rate_hz).step(max(1, round(seconds * rate_hz)))[0])
