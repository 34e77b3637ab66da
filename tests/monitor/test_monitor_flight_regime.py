"""Beyond the stall no derivative describes an aircraft: estimation waits, says why, and goes on afterwards."""

import math

import numpy as np
import pytest
from fleet_hall import AEROSONDE, Hall, fly_doublets, second

from wingwatch.monitor import VehicleState
from wingwatch.monitor.flight_regime import FlightRegime, RegimeState
from wingwatch.telemetry import MAX_GAP_S, SampleBlock

RATE_HZ = 50.0
AFTER = round(MAX_GAP_S * RATE_HZ)
"""Samples that wait after the last one beyond the stall."""


def cruise(seconds: float = 10.0, /, **columns: np.ndarray) -> SampleBlock:
    """Steady flight but for the columns given."""
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    flown = {"time_s": time_s, "airspeed_true_m_s": np.full(time_s.size, 25.0)}
    flown |= {"angle_of_attack_rad": np.full(time_s.size, 0.05), "sideslip_rad": np.zeros(time_s.size)}
    return SampleBlock.from_columns(flown | columns)


def incidence(first: int, samples: int, angle_deg: float, seconds: float = 10.0) -> np.ndarray:
    """Angle of attack (or sideslip) that is this for some samples and 0.05 rad otherwise."""
    out = np.full(round(seconds * RATE_HZ), 0.05)
    out[first : first + samples] = math.radians(angle_deg)
    return out


@pytest.mark.parametrize("angle_deg", [30.0, -30.0])
def test_samples_beyond_the_stall_and_half_a_second_after_are_left_out(angle_deg: float) -> None:
    state = RegimeState()
    block = cruise(angle_of_attack_rad=incidence(100, 7, angle_deg))
    used = FlightRegime(AEROSONDE).select(state, block)
    assert state.stalled == 7 + AFTER
    assert state.waits == ""
    np.testing.assert_array_equal(used.time_s, np.delete(block.time_s, np.arange(100, 107 + AFTER)))
    # longer than what the estimators go on over: their running block ends
    assert np.diff(used.time_s).max() > MAX_GAP_S


def test_below_the_stall_angle_of_the_file_nothing_is_left_out() -> None:
    assert AEROSONDE.coefficients is not None
    assert AEROSONDE.coefficients.stall is not None
    almost_deg = math.degrees(AEROSONDE.coefficients.stall.angle_rad) - 0.1
    block = cruise(angle_of_attack_rad=incidence(100, 7, almost_deg))
    assert FlightRegime(AEROSONDE).select(RegimeState(), block) is block


def test_a_file_without_a_stall_angle_has_a_wide_limit_and_sideslip_has_it_too() -> None:
    regime = FlightRegime(AEROSONDE.model_copy(update={"coefficients": None}))
    for column in ("angle_of_attack_rad", "sideslip_rad"):
        for angle_deg, left_out in ((40.0, 0), (50.0, 7 + AFTER)):
            state = RegimeState()
            regime.select(state, cruise(**{column: incidence(100, 7, angle_deg)}))
            assert state.stalled == left_out


@pytest.mark.parametrize("piece", [1, 13, 120])
def test_pieces_change_nothing(piece: int) -> None:
    block = cruise(angle_of_attack_rad=incidence(100, 40, 35.0), sideslip_rad=incidence(300, 2, -60.0))
    whole, parts = RegimeState(), RegimeState()
    used = FlightRegime(AEROSONDE).select(whole, block)
    got = [
        FlightRegime(AEROSONDE).select(parts, SampleBlock(block.values[k : k + piece]))
        for k in range(0, len(block), piece)
    ]
    np.testing.assert_array_equal(np.concatenate([part.values for part in got]), used.values)
    assert parts == whole


def test_a_vane_that_reads_nothing_shows_no_stall_and_a_clock_that_is_set_back_waits_for_nothing() -> None:
    regime, state = FlightRegime(AEROSONDE), RegimeState()
    silent = cruise(angle_of_attack_rad=np.full(500, np.nan), sideslip_rad=np.full(500, np.nan))
    assert regime.select(state, silent) is silent
    regime.select(state, cruise(angle_of_attack_rad=incidence(400, 100, 35.0)))
    assert state.waits
    again = cruise(12.0)
    for part in (again.values[:450], again.values[450:]):
        assert len(regime.select(state, SampleBlock(part))) == len(part)
    assert state.waits == ""


def test_an_operator_reads_of_the_stall_and_the_watch_goes_on_afterwards() -> None:
    hall, flight = Hall(), fly_doublets(30.0)
    hall.announce()
    hall.fly(flight, 0, 12)
    healthy = hall.view()
    assert healthy.state is VehicleState.HEALTHY
    block = second(flight, 12)
    columns = {name: block.column(name) for name in block.present}
    columns["angle_of_attack_rad"] = np.full(len(block), math.radians(60.0))
    hall.sample(SampleBlock.from_columns(columns), next(hall.sequence))
    view = hall.view()
    assert view.state is VehicleState.NOT_OBSERVABLE
    assert "beyond 26.9 degrees" in view.reason
    assert view.counts["stalled"] == 50
    hall.fly(flight, 13, 30)
    assert hall.view().counts["stalled"] == 50 + AFTER
    assert hall.view().state is VehicleState.HEALTHY
    assert "stall" not in hall.view().reason
