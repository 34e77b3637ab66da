"""Beyond the stall no derivative describes an aircraft: estimation waits, says why, and goes on afterwards."""

import math

import numpy as np
import pytest
from fleet_hall import AEROSONDE, Hall, fly_doublets, second

from wingwatch.monitor import VehicleState
from wingwatch.monitor.estimation.flight_regime import FlightRegime, RegimeState, least_stall_speed_m_s
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
    hall, flight = Hall(), fly_doublets(60.0)
    hall.announce()
    hall.fly(flight, 0, 45)
    healthy = hall.view()
    assert healthy.state is VehicleState.HEALTHY
    block = second(flight, 45)
    columns = {name: block.column(name) for name in block.present}
    columns["angle_of_attack_rad"] = np.full(len(block), math.radians(60.0))
    hall.sample(SampleBlock.from_columns(columns), next(hall.sequence))
    view = hall.view()
    assert view.state is VehicleState.NOT_OBSERVABLE
    assert "beyond 26.9 degrees" in view.reason
    assert view.counts["stalled"] == 50
    hall.fly(flight, 46, 60)
    assert hall.view().counts["stalled"] == 50 + AFTER
    assert hall.view().state is VehicleState.HEALTHY
    assert "stall" not in hall.view().reason


STALL_M_S = 12.1
"""Of the Aerosonde at sea level: 11 kg, 0.55 m2, lift line 0.28 + 3.45 alpha at 20 degrees."""


def at_speeds(*airspeeds_m_s: float, **columns: np.ndarray) -> SampleBlock:
    """A second at each airspeed, 5 samples."""
    airspeed = np.repeat(np.array(airspeeds_m_s), 5)
    flown = {"time_s": 0.2 * np.arange(airspeed.size), "airspeed_true_m_s": airspeed}
    return SampleBlock.from_columns(flown | columns)


def used_seconds(block: SampleBlock, piece: int = 1000) -> list[int]:
    regime, state = FlightRegime(AEROSONDE), RegimeState()
    times = [
        regime.select(state, SampleBlock(block.values[k : k + piece])).time_s
        for k in range(0, len(block), piece)
    ]
    assert state.too_slow == len(block) - sum(map(len, times))
    return sorted({int(t) for t in np.concatenate(times)})


@pytest.mark.parametrize("piece", [1, 3, 1000])
def test_the_ground_is_left_near_the_stall_speed_and_reached_far_below_it(piece: int) -> None:
    stall = least_stall_speed_m_s(AEROSONDE)
    assert stall == pytest.approx(STALL_M_S, abs=0.05)
    taxi, run, flight = 0.3 * STALL_M_S, 0.7 * STALL_M_S, 2.0 * STALL_M_S
    speeds = (taxi, run, flight, run, flight, run, taxi, run, run, flight)
    assert used_seconds(at_speeds(*speeds), piece) == [2, 3, 4, 5, 9]


def test_a_velocity_over_the_ground_contradicts_an_airspeed_that_is_too_low() -> None:
    speeds, east = (25.0, 9.0, 3.0, 3.0, 25.0), np.repeat([25.0, 25.0, 25.0, 5.0, 5.0], 5)
    moving = {"velocity_north_m_s": np.zeros(25), "velocity_east_m_s": east}
    assert used_seconds(at_speeds(*speeds, **moving)) == [0, 1, 2, 4]
    assert used_seconds(at_speeds(*speeds)) == [0, 1, 4]


@pytest.mark.parametrize("piece", [1, 7, 1000])
def test_an_airspeed_that_falls_faster_than_any_brake_is_wrong_and_not_of_the_ground(piece: int) -> None:
    """From flight to the ground takes 0.37 s at least; here it takes a sample, 0.2 s."""
    speeds = (25.0, 3.0, 3.0, 25.0, 9.0, 3.0, 3.0)
    assert used_seconds(at_speeds(*speeds), piece) == [0, 1, 2, 3, 4]
    state = RegimeState()
    assert len(FlightRegime(AEROSONDE).select(state, at_speeds(25.0, 0.2))) == 5
    assert "it is wrong" in state.waits


def test_a_file_that_states_no_lift_has_no_ground_but_standing_still() -> None:
    bare = AEROSONDE.model_copy(update={"coefficients": None})
    assert least_stall_speed_m_s(bare) is None
    state = RegimeState()
    used = FlightRegime(bare).select(state, at_speeds(2.0, 0.5, 2.0))
    assert (len(used), state.too_slow) == (10, 5)


def taxiing(flight: SampleBlock, k: int, late_s: float) -> SampleBlock:
    """A second on the ground: a gyro that is off and a rudder that does not follow would be faults in flight."""
    block = second(flight, k)
    columns = {name: block.column(name) for name in block.present}
    columns["time_s"] = columns["time_s"] + late_s
    columns["airspeed_true_m_s"] = columns["velocity_north_m_s"] = np.full(len(block), 4.0)
    columns["pitch_rate_rad_s"] = columns["pitch_rate_rad_s"] + 0.2 * (k % 2)
    columns["rudder_rad"] = columns["rudder_rad"] + 0.3 * (k % 3)
    return SampleBlock.from_columns(columns)


def test_nobody_is_alarmed_by_an_aircraft_that_taxies_and_its_surfaces_show_themselves_anew() -> None:
    hall, flight = Hall(), fly_doublets(60.0)
    hall.announce()
    for k in range(10):
        hall.sample(taxiing(flight, k, 0.0), next(hall.sequence))
    assert hall.view().last_sample_time_s is None, "nothing was estimated"
    hall.fly(flight, 10, 60)
    assert hall.view().state is VehicleState.HEALTHY
    for k in range(10):
        hall.sample(taxiing(flight, k, 200.0), next(hall.sequence))
    view = hall.view()
    assert list(hall.fleet.alerts()) == []
    assert view.state is VehicleState.NOT_OBSERVABLE
    assert "on the ground" in view.reason
    assert view.unseen_surfaces == ("elevator_rad", "aileron_rad", "rudder_rad")
    assert view.counts["too_slow"] == 20 * 50
