"""A small version of ``benchmarks/alerts.py``: what is lost in rough air is noticed."""

import pytest
from alerts import ONSET_S, Flown, cases, fly

from wingwatch.aircraft import FlightCondition, load_aircraft

SECONDS, FLIGHTS, FIRST_SEED = 160.0, 2, 510_000


@pytest.mark.parametrize("name", ["aileron loss 0.5", "rudder loss 0.5"])
def test_half_a_surface_lost_in_moderate_air_is_noticed_within_a_minute(name: str) -> None:
    case = next(c for c in cases("moderate") if c.name == name)
    assert case.effect is not None
    flown = Flown(load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0))
    for flight in fly(case, flown, FLIGHTS, SECONDS, FIRST_SEED):
        assert flight.false == 0
        assert flight.hit is not None
        assert flight.hit.cause == case.effect.name
        assert flight.hit.raised_s < ONSET_S + 60.0
