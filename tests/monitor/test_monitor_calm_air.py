"""Air is calm once both have found it so for a while, and until the accelerometer feels gusts."""

import numpy as np
import pytest

from wingwatch.aircraft import LATERAL, SHORT_PERIOD
from wingwatch.monitor.estimation.calm_air import CALM_S, KNOWN, follow_calm, is_calm, surface_moved


def followed(*seconds: tuple[float, bool, bool]) -> bool:
    """Whether air is calm after (time, gusts felt by the accelerometer, motion put down to gusts by the filter)."""
    calm_s, time_s = np.array([np.nan]), np.array([0.0])
    for at_s, gusty, turned in seconds:
        time_s = np.array([at_s])
        calm_s = follow_calm(calm_s, time_s, np.array([gusty]), np.array([turned]))
    return bool(is_calm(calm_s, time_s)[0])


def test_it_takes_both_and_some_time() -> None:
    assert not followed((0.0, False, False), (0.9 * CALM_S, False, False))
    assert followed((0.0, False, False), (CALM_S, False, False))
    assert not followed((0.0, False, True), (CALM_S, False, False))
    assert not followed((0.0, True, False), (CALM_S, False, False))


def test_what_the_filter_alone_puts_down_to_gusts_later_may_be_a_fault() -> None:
    assert followed((0.0, False, False), (CALM_S, False, False), (CALM_S + 1.0, False, True))
    assert not followed((0.0, False, False), (CALM_S, False, False), (CALM_S + 1.0, True, False))


def test_a_clock_that_was_set_back_begins_anew() -> None:
    assert not followed((100.0, False, False), (100.0 + CALM_S, False, False), (10.0, False, False))
    assert not followed((100.0, False, False), (10.0, False, False), (100.0 + CALM_S, True, False))


def test_a_surface_has_moved_the_mode_where_one_moment_is_known_whole() -> None:
    natural = np.array([1.0, 2.0, 0.5, 3.0, 1.0, 4.0])  # z_w z_q z_eta m_w m_q m_eta

    def moved(*stds: float) -> bool:
        return surface_moved(SHORT_PERIOD, np.diag((np.array(stds) * natural) ** -2.0), natural)

    small, large = 0.5 * KNOWN, 2.0 * KNOWN
    assert moved(large, large, large, small, small, small)
    assert not moved(small, small, small, small, large, small)
    assert not moved(small, small, small, small, small, large)
    assert not surface_moved(SHORT_PERIOD, np.zeros((6, 6)), natural)


@pytest.mark.parametrize("surface", ["xi", "zeta"])
def test_either_surface_of_the_lateral_mode_will_do(surface: str) -> None:
    symbols = LATERAL.derivatives
    known = {"l_v", "l_p", f"l_{surface}"} if surface == "xi" else {"n_v", "n_r", "n_zeta"}
    information = np.diag([100.0 / KNOWN**2 if s in known else 0.0 for s in symbols])
    assert surface_moved(LATERAL, information, np.ones(len(symbols)))
    assert not surface_moved(
        LATERAL,
        np.diag([100.0 / KNOWN**2 * (s in known - {"l_p", "n_r"}) for s in symbols]),
        np.ones(len(symbols)),
    )


def test_a_difference_that_is_no_information_has_moved_nothing() -> None:
    """What was taken back for better reasons may be more than what was learned."""
    assert not surface_moved(SHORT_PERIOD, -100.0 * np.eye(6), np.ones(6))
