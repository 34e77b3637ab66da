"""Every simulated aircraft of the library is trimmed over the envelope that its file states."""

import numpy as np
import pytest

from wingwatch.aircraft import FlightCondition, TrimError, library_names, load_aircraft
from wingwatch.simulation import Scenario, simulate, trim

NAMES = [name for name in library_names() if load_aircraft(name).coefficients is not None]


def test_those_with_coefficients_are_meant() -> None:
    assert NAMES == ["aerosonde", "aerosonde-a", "twinotter", "ultrastick25e"]


@pytest.mark.parametrize("name", NAMES)
def test_level_trim_over_the_envelope(name: str) -> None:
    aircraft = load_aircraft(name)
    assert aircraft.envelope is not None
    refused = []
    for speed in np.linspace(*aircraft.envelope.airspeed_true_m_s, 6):
        for altitude in np.linspace(*aircraft.envelope.altitude_m, 3):
            condition = FlightCondition(float(speed), float(altitude))
            try:
                point = trim(aircraft, condition)
            except TrimError as error:
                refused.append((float(speed), "throttle" in str(error)))
                continue
            assert point.residual < 1e-8
            assert abs(point.angle_of_attack_rad) < 0.2
    # Only the Aerosonde's published propeller and battery do not carry the fast end of its envelope.
    assert all(by_throttle and speed > 30.0 for speed, by_throttle in refused)
    assert bool(refused) == (name == "aerosonde")


@pytest.mark.parametrize("name", NAMES)
def test_it_flies_straight_and_level_by_itself(name: str) -> None:
    aircraft = load_aircraft(name)
    assert aircraft.envelope is not None
    cruise = aircraft.envelope.cruise
    block = simulate(Scenario(aircraft, cruise.airspeed_true_m_s, cruise.altitude_m, noise=False), 10.0)
    for column, held, within in (
        ("airspeed_true_m_s", cruise.airspeed_true_m_s, 1e-3),
        ("altitude_m", cruise.altitude_m, 1e-3),
        ("roll_rad", 0.0, 1e-6),
    ):
        assert np.abs(block.column(column) - held).max() < within, column
