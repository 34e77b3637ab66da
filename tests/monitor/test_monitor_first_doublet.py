"""The first doublet after nine quiet seconds: the filter is right at once, whatever quiet flight would have taught."""

import numpy as np
import pytest

from wingwatch.aircraft import LATERAL, FlightCondition, linearised_derivatives, load_aircraft, trimmed
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
CRUISE = FlightCondition(25.0, 1000.0)
FINER = 8


@pytest.mark.parametrize("seed", [7012, 7014, 7015])
def test_the_first_doublet_finds_the_aircraft(seed: int) -> None:
    """Two of these flights are those of ``benchmarks/turbulence.py`` in which the filter once stood at l_p = -100."""
    scenario = Scenario(AIRCRAFT, manoeuvres=(doublet_schedule(AIRCRAFT, CRUISE),), seed=seed)
    fine = FleetSimulation([scenario], 50.0 * FINER).step(round(16.0 * 50.0 * FINER))[0]
    block = complete(SampleBlock(np.ascontiguousarray(fine[::FINER])))
    monitor = VehicleMonitor(AIRCRAFT, "fleet", "one", block.present, {}, new_id=lambda: "1")
    solutions = monitor.feed(block).solutions
    table = linearised_derivatives(AIRCRAFT, trimmed(AIRCRAFT, CRUISE), LATERAL)
    truth = np.array([table[d] for d in LATERAL.derivatives])
    before = next(s for s in solutions if s.time_s >= 8.5).modes["lateral"].ekf
    after = solutions[-1].modes["lateral"].ekf
    assert (np.abs(before.value - truth) < 0.5 * before.standard_error).all()
    assert (np.abs(after.value - truth) < 4.0 * after.standard_error).all()
    p = LATERAL.derivatives.index("l_p")
    assert after.standard_error[p] < 0.1 * abs(truth[p])
