"""JSBSim flies two of its bundled aircraft beside ours, expressed in our aircraft file as it reads them itself."""

from functools import cache

import numpy as np
import pytest
import simulation_outside as outside
from jsbsim_file import peer_aircraft
from jsbsim_peer import Peer, PeerTrim

DENSITIES_APART = 2.4e-5
"""JSBSim takes height as geometric, we as geopotential: at 1000 m its air is denser by 16 m of 10 km times 1.5e-2, and
every derivative is proportional to density."""
DERIVATIVES_APART = 10.0 * DENSITIES_APART
"""Room for the trims that follow, and for its central differences."""


@cache
def flat(name: str) -> outside.PeerComparison:
    return outside.compare_peer(name)


@pytest.mark.parametrize("name", outside.PEERS)
def test_both_trim_alike(name: str) -> None:
    theirs, ours = flat(name).trims
    assert ours.angle_of_attack_rad == pytest.approx(theirs.angle_of_attack_rad, rel=DERIVATIVES_APART)
    assert ours.elevator_rad == pytest.approx(theirs.elevator_rad, rel=DERIVATIVES_APART)
    assert ours.thrust_n == pytest.approx(theirs.thrust_n, rel=DERIVATIVES_APART)


@pytest.mark.parametrize("name", outside.PEERS)
def test_every_derivative_that_both_define_is_the_same(name: str) -> None:
    derivatives = flat(name).derivatives
    assert len(derivatives) == 6 + 15
    for symbol, (theirs, ours) in derivatives.items():
        assert ours == pytest.approx(theirs, rel=DERIVATIVES_APART, abs=1e-9), symbol


@pytest.mark.parametrize("name", outside.PEERS)
def test_a_round_turning_earth_changes_no_derivative_by_one_per_cent(name: str) -> None:
    derivatives = outside.compare_peer(name, flat_earth=False).derivatives
    for symbol, (theirs, ours) in derivatives.items():
        assert ours == pytest.approx(theirs, rel=0.01, abs=1e-9), symbol


def test_a_linear_aircraft_answers_doublets_alike() -> None:
    error = flat("x24b").response_error
    assert (error < 0.01).all(), dict(zip(outside.MOTIONS, error, strict=True))


def test_what_is_left_of_the_response_shrinks_with_jsbsims_step() -> None:
    coarse = outside.compare_peer("x24b", rate_hz=outside.JSBSIM_USUAL_HZ).response_error
    fine = flat("x24b").response_error
    rates = [outside.MOTIONS.index(m) for m in ("p", "q", "r")]
    assert (coarse[rates] > 5.0 * fine[rates]).all()  # ten times the step: ten times, at first order


def test_the_other_aircraft_differs_by_the_drag_term_that_our_file_lacks() -> None:
    forward = outside.MOTIONS.index("u")
    bundled = flat("pa28").response_error
    without = outside.compare_peer("pa28", without=(outside.SIDESLIP_DRAG,)).response_error
    assert bundled[forward] > 0.3
    assert without[forward] < 0.03  # what is left is drag tabulated by straight segments
    assert (np.delete(without, forward) < 0.01).all()


def test_an_aircraft_whose_tables_have_two_variables_is_refused() -> None:
    with pytest.raises(ValueError, match="JSBSim's F80C has a table of aero/alpha-rad and fcs/flap-pos-norm"):
        peer_aircraft(Peer("F80C"), PeerTrim(0.05, 0.0, 1.0))


def test_jsbsims_minute_is_a_minute() -> None:
    peer, condition = Peer("x24b", rate_hz=50.0), outside.PEERS["x24b"]
    ticks = iter((1.0, 3.5))
    assert peer.minute_s(condition, peer.trim(condition), lambda: next(ticks)) == 2.5
    assert peer["simulation/sim-time-sec"] == pytest.approx(60.0, abs=1.5 / 50.0)
