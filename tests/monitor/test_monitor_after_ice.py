"""Heavy ice from one moment to the next: the aircraft is found as it is then, and the alert names ice."""

import numpy as np
import pytest

from wingwatch.aircraft import LATERAL, Aircraft, FlightCondition, load_aircraft
from wingwatch.monitor import AlertView, VehicleMonitor
from wingwatch.monitor.estimation.chain import Solution
from wingwatch.simulation import FleetSimulation, Icing, Scenario, Turbulence, doublet_schedule, linearise
from wingwatch.telemetry import SampleBlock, complete

SEVERITY, ONSET_S, LATER_S = 0.3, 50.0, 35.0
CRUISE = FlightCondition(25.0, 1000.0)
SIDE_FORCE = LATERAL.derivatives.index("y_v")


def flown(
    aircraft: Aircraft, at: FlightCondition, turbulence: Turbulence, seed: int
) -> tuple[list[Solution], list[AlertView]]:
    """Solutions and alerts of a flight with doublets every 20 s."""
    scenario = Scenario(
        aircraft,
        at.airspeed_true_m_s,
        at.altitude_m,
        manoeuvres=(doublet_schedule(aircraft, at, period_s=20.0),),
        effects=(Icing(SEVERITY, ONSET_S),),
        turbulence=turbulence,
        seed=seed,
    )
    block = complete(
        SampleBlock(FleetSimulation([scenario], 50.0).step(round(50.0 * (ONSET_S + LATER_S)))[0])
    )
    monitor = VehicleMonitor(aircraft, "fleet", "one", block.present, {}, new_id=lambda: "1")
    report = monitor.feed(block)
    return report.solutions, report.alerts


def test_what_ice_has_left_of_the_side_force_is_found() -> None:
    """A tenth of y_v. A block after it, linearised at the aircraft as it was, once said +0.9, not -0.06; the filter
    took the new aircraft for gusts on the old one."""
    aircraft = load_aircraft("aerosonde")
    before, after = (
        linearise(aircraft, CRUISE, LATERAL, effects, 1.0)["y_v"] for effects in ((), (Icing(SEVERITY, 0.0),))
    )
    for seed in (1, 2):
        solutions, _ = flown(aircraft, CRUISE, "none", seed)
        late = [s.modes["lateral"] for s in solutions if s.time_s >= ONSET_S + 25.0]
        for estimator in ("fourier", "ekf"):
            found = np.array([getattr(mode, estimator).value[SIDE_FORCE] for mode in late])
            assert (np.abs(found - after) < 0.25 * abs(before - after)).all(), (estimator, found)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ice_in_rough_air_is_called_ice(seed: int) -> None:
    aircraft = load_aircraft("twinotter")
    assert aircraft.envelope is not None
    _, alerts = flown(aircraft, aircraft.envelope.cruise, "moderate", seed)
    assert alerts
    assert {alert.cause for alert in alerts if alert.channel is None} == {"icing"}
    drag = {alert.cause for alert in alerts if alert.channel is not None}
    assert drag <= {"unknown"}, "drag has grown, and the cause is not yet named"
    named = [a for a in alerts if a.channel is None]
    assert abs(next(a for a in named if a.evidence).size - SEVERITY) < 0.05, "as derivatives confirm it"
    assert all(abs(a.size - SEVERITY) < 3.0 * a.size_standard_error for a in named)
