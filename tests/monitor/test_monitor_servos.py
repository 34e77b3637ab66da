"""Surfaces known by their commands alone: where the aircraft file states the servo, they are where it has them."""

import numpy as np
from monitor_flights import last_mode

from wingwatch.aircraft import (
    LATERAL,
    Aircraft,
    FlightCondition,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.aircraft.aircraft_file import Actuators
from wingwatch.monitor.estimation.mode_solution import ModeSolution
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

CRUISE = FlightCondition(25.0, 1000.0)
SURFACES = ("elevator", "aileron", "rudder")


def lateral(aircraft: Aircraft, block: SampleBlock, piece: int) -> ModeSolution:
    kinds = {f"{surface}_rad": "command" for surface in SURFACES}
    return last_mode(aircraft, block, piece, LATERAL, kinds)


def test_commands_go_through_the_servo_that_the_file_states() -> None:
    known = load_aircraft("aerosonde")
    flown = simulate(
        Scenario(known, manoeuvres=(doublet_schedule(known, CRUISE, period_s=10.0),), seed=12), 60.0
    )
    for surface in SURFACES:
        command = flown.values[:, CHANNEL_INDEX[f"{surface}_command_rad"]]
        flown.values[:, CHANNEL_INDEX[f"{surface}_rad"]] = command
    stated, whole = lateral(known, flown, 10), lateral(known, flown, len(flown))
    unstated = lateral(known.model_copy(update={"actuators": Actuators()}), flown, 10)
    np.testing.assert_array_equal(stated.ekf.value, whole.ekf.value)
    np.testing.assert_array_equal(stated.fourier.value, whole.fourier.value)
    table = linearised_derivatives(known, trimmed(known, CRUISE), LATERAL)
    roll = [LATERAL.derivatives.index(symbol) for symbol in ("l_p", "l_xi")]
    truth = np.array([table[d] for d in LATERAL.derivatives])[roll]
    for estimate, without in ((stated.fourier, unstated.fourier), (stated.ekf, unstated.ekf)):
        misses = np.abs(estimate.value[roll] / truth - 1.0), np.abs(without.value[roll] / truth - 1.0)
        assert misses[0].max() < 0.1, misses
        assert misses[1].min() > 0.2, misses
