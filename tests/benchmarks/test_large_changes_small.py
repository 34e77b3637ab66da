"""A small version of ``benchmarks/large_changes.py``: estimates are those of the aircraft as ice has left it."""

from dataclasses import replace

import numpy as np
import pytest
from alerts import Flown, cases
from large_changes import ESTIMATORS, SINCE_S, said

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation import Turbulence

FLOWN = Flown(load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0))
SEED, FLIGHTS = 520_000, 8
"""Of four flights one claim of 252 decided."""


@pytest.mark.slow
@pytest.mark.parametrize(("severity", "air"), [(0.05, "none"), (0.15, "moderate")])
def test_nine_tenths_of_what_is_claimed_in_the_first_minute_after_ice_hold(
    severity: float, air: Turbulence
) -> None:
    """From the second doublet on."""
    case = next(c for c in cases(air) if c.name == f"icing {severity:g}")
    first_minute = [since_s for since_s in SINCE_S if 25.0 <= since_s <= 75.0]
    flights = list(said(replace(case, turbulence=air), FLOWN, FLIGHTS, SEED, first_minute))
    for estimator in ESTIMATORS:
        mine = [s for s in flights if s.estimator == estimator]
        claimed, score = (np.concatenate([getattr(s, name) for s in mine]) for name in ("claimed", "score"))
        assert claimed.mean() > 0.8, estimator
        assert (np.abs(score[claimed]) <= 1.96).mean() > 0.9, estimator
