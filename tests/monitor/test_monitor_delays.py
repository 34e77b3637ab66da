"""Delays that the aircraft file states are taken out before anything is estimated, whatever the messages' size."""

import numpy as np
from monitor_flights import last_mode

from wingwatch.aircraft import (
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.monitor.estimation.mode_solution import ModeSolution
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import SampleBlock

CRUISE = FlightCondition(25.0, 1000.0)
DELAYS = {"specific_force_z_m_s2": 0.06, "angle_of_attack_rad": 0.04, "pitch_rad": 0.05}


def late(delays: dict[str, float]) -> Aircraft:
    known = load_aircraft("aerosonde")
    return known.model_copy(update={"sensors": known.sensors.model_copy(update={"delay_s": delays})})


def short_period(aircraft: Aircraft, block: SampleBlock, piece: int) -> ModeSolution:
    return last_mode(aircraft, block, piece, SHORT_PERIOD, {})


def test_stated_delays_bias_nothing_and_cuts_change_nothing() -> None:
    schedule = doublet_schedule(load_aircraft("aerosonde"), CRUISE, period_s=10.0)
    flown = simulate(Scenario(late(DELAYS), manoeuvres=(schedule,), seed=11), 60.0)
    stated, unstated = short_period(late(DELAYS), flown, 10), short_period(late({}), flown, 10)
    whole = short_period(late(DELAYS), flown, len(flown))
    np.testing.assert_array_equal(stated.ekf.value, whole.ekf.value)
    np.testing.assert_array_equal(stated.fourier.value, whole.fourier.value)
    truth = linearised_derivatives(
        load_aircraft("aerosonde"), trimmed(load_aircraft("aerosonde"), CRUISE), SHORT_PERIOD
    )
    for estimate, without in ((stated.fourier, unstated.fourier), (stated.ekf, unstated.ekf)):
        misses = []
        for value in (estimate.value, without.value):
            of = dict(zip(SHORT_PERIOD.derivatives, value.tolist(), strict=True))
            misses.append(
                {symbol: abs(of[symbol] / truth[symbol] - 1.0) for symbol in ("z_w", "m_w", "m_q", "m_eta")}
            )
        assert max(misses[0].values()) < 0.1, misses
        assert max(misses[1].values()) > 2.0 * max(misses[0].values()), misses
