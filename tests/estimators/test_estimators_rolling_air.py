"""Rolling air and an aircraft that hardly damps its rolling move alike; the second is not claimed of the first."""

import numpy as np
import pytest
from simulated_flights import (
    AMPLITUDE_RAD,
    PERIOD_S,
    Z_95,
    cruise_of,
    fly,
    last_solution,
    misstated,
    truth_of,
)

from wingwatch.aircraft import load_aircraft
from wingwatch.estimators import Outcome
from wingwatch.simulation import doublet_schedule


@pytest.mark.parametrize("seed", range(61000, 61006))
def test_roll_damping_is_not_lost_to_rolling_air(seed: int) -> None:
    """A minute in light air, coefficients in the file 30 % off: what is said of the derivatives by roll rate lies
    within five stated errors. Of two of these flights it lay ten to twenty off."""
    aircraft = load_aircraft("aerosonde")
    doublets = doublet_schedule(aircraft, cruise_of(aircraft), AMPLITUDE_RAD, period_s=PERIOD_S)
    flight = fly(aircraft, [doublets], seed, 60.0, "light")
    said = last_solution(misstated(aircraft, seed), flight).modes["lateral"].fourier
    by_roll = np.arange(1, 15, 5)
    score = np.abs(said.value - truth_of(aircraft, said))[by_roll] / said.standard_error[by_roll]
    assert (score < 5.0).all(), score
    assert any(o is Outcome.CONVERGED for o in said.outcomes)


def test_the_running_block_does_not_lose_the_roll_damping_either() -> None:
    """In the first 20 s in moderate air l_p of these flights was 38 % too small on average, and 88 % of what was
    claimed of the lateral structure held."""
    aircraft = load_aircraft("aerosonde")
    doublets = doublet_schedule(aircraft, cruise_of(aircraft), AMPLITUDE_RAD, period_s=PERIOD_S)
    damping, held = [], []
    for seed in range(114000, 114024):
        flight = fly(aircraft, [doublets], seed, 20.0, "moderate")
        said = last_solution(misstated(aircraft, seed), flight).modes["lateral"].fourier
        truth = truth_of(aircraft, said)
        damping.append(said.value[6] / truth[6])
        claimed = [o in (Outcome.CONVERGED, Outcome.SETTLING) for o in said.outcomes]
        held.append((np.abs(said.value - truth) <= Z_95 * said.standard_error)[claimed])
    assert np.mean(damping) > 0.8
    assert np.mean(np.concatenate(held)) >= 0.93
