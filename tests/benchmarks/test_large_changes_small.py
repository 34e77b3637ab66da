"""A small version of ``benchmarks/large_changes.py``: estimates are those of the aircraft as ice has left it."""

import numpy as np
import pytest
from alerts import Flown, cases
from large_changes import ESTIMATORS, Said, said

from wingwatch.aircraft import FlightCondition, load_aircraft

FLOWN = Flown(load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0))
SEED, FLIGHTS = 520_000, 4
NOT_YET = {
    (0.05, "fourier"): "changes of a few percent are followed by forgetting alone (decision 63)",
    (0.05, "ekf"): "changes of a few percent are followed by forgetting alone (decision 63)",
    (0.15, "ekf"): "the filter keeps what it knows of derivatives that were not seen to change (decision 63)",
}


@pytest.fixture(scope="module", params=[0.05, 0.15])
def flights(request: pytest.FixtureRequest) -> tuple[float, list[Said]]:
    """Severity, and what was said in the first minute after it, from the second doublet on."""
    case = next(c for c in cases("none") if c.name == f"icing {request.param:g}")
    return request.param, [s for s in said(case, FLOWN, FLIGHTS, SEED) if 25.0 <= s.since_s <= 75.0]


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_nine_tenths_of_what_is_claimed_in_the_first_minute_after_ice_hold(
    flights: tuple[float, list[Said]], estimator: str, request: pytest.FixtureRequest
) -> None:
    size, moments = flights
    if (size, estimator) in NOT_YET:
        request.applymarker(pytest.mark.xfail(strict=True, reason=NOT_YET[size, estimator]))
    mine = [s for s in moments if s.estimator == estimator]
    claimed, score = (np.concatenate([getattr(s, name) for s in mine]) for name in ("claimed", "score"))
    assert claimed.mean() > 0.8
    assert (np.abs(score[claimed]) <= 1.96).mean() > 0.9
