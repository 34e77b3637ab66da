"""What cannot be distinguished is named, and only that; on made-up covariances and on simulated flights."""

import numpy as np
import pytest
from correlated_inputs import cases, flown

from wingwatch.aircraft import LATERAL
from wingwatch.estimators.confounding import confounded_sets, confounding_text

SYMBOLS = LATERAL.derivatives
NATURAL = np.full(15, 2.0)


def covariance_of(information: np.ndarray, prior_ratio: float) -> np.ndarray:
    """Covariance from what data say in natural units, and a prior."""
    inner = np.linalg.inv(information + np.eye(15) / prior_ratio**2)
    return np.asarray(inner * np.outer(NATURAL, NATURAL))


def of_row(row: int, direction: tuple[float, ...], precision: float) -> np.ndarray:
    """Information of a row of the lateral structure that knows all but one direction."""
    unknown = np.array(direction) / np.linalg.norm(direction)
    information = np.zeros((15, 15))
    at = slice(5 * row, 5 * row + 5)
    information[at, at] = precision * (np.eye(5) - np.outer(unknown, unknown))
    return information


@pytest.mark.parametrize("prior_ratio", [1.0, 3.0])
def test_a_combination_that_alone_is_known_is_named(prior_ratio: float) -> None:
    information = (
        of_row(0, (0, 0, 0, 0, 1), 1e4) + of_row(1, (0, 0, 0, 1, -1), 1e4) + of_row(2, (0, 1, 0, 2, 2), 1e4)
    )
    hidden, sets = confounded_sets(LATERAL, covariance_of(information, prior_ratio), NATURAL, prior_ratio)
    assert sets == (("l_xi", "l_zeta"), ("n_p", "n_xi", "n_zeta"))
    assert [s for s, h in zip(SYMBOLS, hidden, strict=True) if h] == [
        "l_xi",
        "l_zeta",
        "n_p",
        "n_xi",
        "n_zeta",
    ]
    text = confounding_text(LATERAL, sets)
    assert "l_xi and l_zeta cannot be distinguished: aileron and rudder move together" in text
    assert "roll rate, aileron and rudder move together" in text


@pytest.mark.parametrize("prior_ratio", [1.0, 3.0])
def test_what_nothing_moved_is_not_confounded(prior_ratio: float) -> None:
    """No information at all, and one surface that never moved: not observable, but there is nothing to tell apart."""
    resting_rudder = np.sum([of_row(row, (0, 0, 0, 0, 1), 1e4) for row in range(3)], axis=0)
    for information in (np.zeros((15, 15)), resting_rudder):
        hidden, sets = confounded_sets(LATERAL, covariance_of(information, prior_ratio), NATURAL, prior_ratio)
        assert not hidden.any()
        assert sets == ()


def test_a_covariance_that_is_not_finite_names_nothing() -> None:
    covariance = np.full((15, 15), np.nan)
    assert confounded_sets(LATERAL, covariance, NATURAL, 3.0)[1] == ()


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True,
    reason="each block drops another direction, so their sum seems to inform it (docs/methods/fourier.md, section 11)",
)
def test_simulated_flight_names_the_mixed_surfaces_and_only_them() -> None:
    """Six degrees of freedom, autopilot closed: a rudder mixed to the aileron beside independent doublets."""
    independent, _, mixed, *_ = cases()
    assert all(e.confounded == () for e in flown(independent, 80.0))
    for e in flown(mixed, 80.0):
        if e.structure is not LATERAL:
            continue
        assert set(e.confounded) == {("y_xi", "y_zeta"), ("l_xi", "l_zeta"), ("n_xi", "n_zeta")}
        outcomes = dict(zip(SYMBOLS, e.outcomes, strict=True))
        assert {outcomes["l_zeta"], outcomes["n_xi"], outcomes["n_zeta"]} == {"not_observable"}
        assert outcomes["l_p"] == "converged"
        assert "cannot be distinguished: aileron and rudder move together" in e.reason
