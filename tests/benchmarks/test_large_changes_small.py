"""A small version of ``benchmarks/large_changes.py``: estimates are those of the aircraft as ice has left it."""

from dataclasses import replace

import numpy as np
import pytest
from alerts import Flown, cases
from large_changes import ESTIMATORS, Said, said

from wingwatch.aircraft import FlightCondition, load_aircraft

FLOWN = Flown(load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0))
SEED, FLIGHTS = 520_000, 8
"""Of four flights one claim of 252 decided."""


@pytest.fixture(scope="module", params=[(0.05, "none"), (0.15, "moderate")], ids=str)
def flights(request: pytest.FixtureRequest) -> list[Said]:
    """What was said in the first minute after ice, from the second doublet on."""
    severity, air = request.param
    case = next(c for c in cases(air) if c.name == f"icing {severity:g}")
    moments = said(replace(case, turbulence=air), FLOWN, FLIGHTS, SEED)
    return [s for s in moments if 25.0 <= s.since_s <= 75.0]


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_nine_tenths_of_what_is_claimed_in_the_first_minute_after_ice_hold(
    flights: list[Said], estimator: str
) -> None:
    mine = [s for s in flights if s.estimator == estimator]
    claimed, score = (np.concatenate([getattr(s, name) for s in mine]) for name in ("claimed", "score"))
    assert claimed.mean() > 0.8
    assert (np.abs(score[claimed]) <= 1.96).mean() > 0.9
