"""An airspeed that is slower than the table, as autopilots log it: held, it counts once and not as often as held."""

from dataclasses import replace

import numpy as np

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import surface_kinds
from wingwatch.monitor.detection.redundancy import RedundancyWatch
from wingwatch.monitor.detection.redundancy.watch import LOG_THRESHOLD
from wingwatch.simulation import Effect, FleetSimulation, Scenario, demo_fleet, parse_effect
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

RATE_HZ, SECONDS = 50.0, 110.0
VANES = ("angle_of_attack_rad", "sideslip_rad")


def slow(block: np.ndarray, rate_hz: float) -> SampleBlock:
    """Without vanes, the airspeed at a lower rate."""
    values = block.copy()
    for name in VANES:
        values[:, CHANNEL_INDEX[name]] = np.nan
    every = round(RATE_HZ / rate_hz)
    airspeed = CHANNEL_INDEX["airspeed_true_m_s"]
    values[:, airspeed] = values[np.arange(len(values)) // every * every, airspeed]
    return SampleBlock(values)


def watched(block: SampleBlock) -> float:
    """The most that the statistic came to."""
    given = block.present
    whole = complete(block, given)
    watch = RedundancyWatch(load_aircraft("aerosonde"), whole.present, surface_kinds(given))
    state, most = watch.init(), -np.inf
    for first in range(0, len(whole), 50):
        for second in watch.feed(state, SampleBlock(whole.values[first : first + 50])):
            if second.finding is not None:
                most = max(most, second.finding.log_statistic)
    return most


def scenario(seed: int, *effects: Effect) -> Scenario:
    healthy = next(one for one in demo_fleet() if one.name == "healthy")
    return replace(healthy, seed=seed, turbulence="moderate", effects=effects)


def test_a_held_airspeed_in_gusts_is_no_fault() -> None:
    """Counted as often as it was held, its error was a scale error of 7 % in one of three such flights."""
    flights = FleetSimulation([scenario(seed) for seed in (101, 104, 9101)], RATE_HZ).step(
        round(RATE_HZ * SECONDS)
    )
    for one in flights:
        assert watched(slow(one, 10.0)) < LOG_THRESHOLD


def test_a_held_airspeed_that_is_wrong_is_seen() -> None:
    wrong = scenario(9102, parse_effect("airspeed_error:0.15@60"))
    (flight,) = FleetSimulation([wrong], RATE_HZ).step(round(RATE_HZ * SECONDS))[:1]
    assert watched(slow(flight, 10.0)) > LOG_THRESHOLD
