"""A reference is the sum of what flights taught; its posterior is Bayes' rule, also where it is singular."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wingwatch.baselines import Reference, posteriors

Array = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 15)


def spd(rng: np.random.Generator, k: int, spread: float = 100.0) -> Array:
    """Symmetric positive definite, condition number ``spread``, then scaled like derivatives' units."""
    q, _ = np.linalg.qr(rng.normal(size=(k, k)))
    units = 10.0 ** rng.uniform(-2.0, 2.0, k)
    m = (q * np.geomspace(1.0, spread, k)) @ q.T * np.outer(units, units)
    return np.asarray(0.5 * (m + m.T))


def blocks(rng: np.random.Generator, k: int, n: int) -> list[tuple[Array, Array]]:
    informations = [spd(rng, k) for _ in range(n)]
    return [(j, j @ rng.normal(size=k)) for j in informations]


def test_an_aircraft_that_has_not_flown_leaves_the_prior_alone() -> None:
    rng = np.random.default_rng(1)
    value, covariance = rng.normal(size=6), spd(rng, 6)
    new_value, new_covariance = Reference.empty(6).posterior(value, covariance)
    assert new_value.tobytes() == value.tobytes()
    assert new_covariance == pytest.approx(covariance, rel=1e3 * EPS * 6, abs=0)
    assert Reference.empty(6).estimate() is None


@settings(deadline=None)
@given(seeds, sizes)
def test_the_posterior_is_bayes_rule(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    prior_value, prior_covariance = rng.normal(size=k), spd(rng, k)
    reference = Reference.empty(k)
    for j, h in blocks(rng, k, 3):
        reference = reference.add(j, h, 10.0)
    value, covariance = reference.posterior(prior_value, prior_covariance)
    scale = np.sqrt(np.diagonal(prior_covariance))  # textbook algebra in units of the prior's standard error
    prior = np.linalg.inv(prior_covariance / np.outer(scale, scale))
    information = reference.information * np.outer(scale, scale)
    direct = np.linalg.solve(prior + information, prior @ (prior_value / scale) + scale * reference.vector)
    expected = np.linalg.inv(prior + information)
    errors = np.sqrt(np.diagonal(expected))
    # a solution is right to eps, times the condition number of what is inverted, times what is summed up
    tolerance = 10.0 * k * EPS * float(np.linalg.cond(prior + information)) * float(np.linalg.cond(prior))
    summed = np.linalg.norm(prior) * np.linalg.norm(prior_value / scale)
    summed += np.linalg.norm(scale * reference.vector)
    size = np.linalg.norm(expected) * summed + np.linalg.norm(prior_value / scale)
    assert np.all(np.abs(value / scale - direct) <= tolerance * size)
    assert np.all(
        np.abs(covariance / np.outer(scale, scale) - expected) <= tolerance * np.outer(errors, errors).max()
    )


@settings(deadline=None)
@given(seeds, sizes)
def test_the_posterior_covariance_is_symmetric_semidefinite_and_no_larger(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    prior = spd(rng, k)
    j = spd(rng, k)
    _, covariance = Reference.empty(k).add(j, j @ rng.normal(size=k), 1.0).posterior(np.zeros(k), prior)
    scale = np.sqrt(np.diagonal(prior))
    unit = covariance / np.outer(scale, scale)
    assert np.array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(unit)[0] >= -k * EPS
    assert np.linalg.eigvalsh(prior / np.outer(scale, scale) - unit)[0] >= -100.0 * k * EPS


def test_what_no_flight_excited_stays_at_the_prior() -> None:
    j = np.diag([4.0, 0.0])
    value, covariance = Reference.empty(2).add(j, j @ [3.0, 9.0], 1.0).posterior([1.0, 2.0], np.eye(2))
    assert value == pytest.approx([1.0 + 4.0 / 5.0 * 2.0, 2.0], abs=4 * EPS)
    assert covariance == pytest.approx(np.diag([1.0 / 5.0, 1.0]), abs=4 * EPS)


def test_what_the_prior_holds_fixed_stays_fixed() -> None:
    j = np.array([[4.0, 1.0], [1.0, 4.0]])
    reference = Reference.empty(2).add(j, j @ [3.0, 9.0], 1.0)
    value, covariance = reference.posterior([1.0, 2.0], np.diag([1.0, 0.0]))
    assert value[1] == 2.0
    assert np.array_equal(covariance[1], [0.0, 0.0])
    # the first alone: J11 x1 = h1 - J12 * 2, with prior 1 +- 1
    assert value[0] == pytest.approx((1.0 + reference.vector[0] - 2.0) / 5.0, rel=8 * EPS)


def test_information_beyond_any_condition_number_is_still_exact() -> None:
    j = np.diag([1e18, 1e-18])
    value, covariance = Reference.empty(2).add(j, j @ [3.0, 9.0], 1.0).posterior([1.0, 2.0], np.eye(2))
    assert value == pytest.approx([3.0, 2.0], rel=1e-15)
    assert np.diagonal(covariance) == pytest.approx([1e-18, 1.0], rel=1e-15)


@settings(deadline=None)
@given(seeds, st.integers(1, 6))
def test_flights_alone_give_their_own_value_once_they_determine_all(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    truth, j = rng.normal(size=k), spd(rng, k)
    estimated = Reference.empty(k).add(j, j @ truth, 1.0).estimate()
    assert estimated is not None
    value, covariance = estimated
    errors = np.sqrt(np.diagonal(covariance))
    unit = np.sqrt(np.diagonal(j))
    bound = 100.0 * k * EPS * float(np.linalg.cond(j / np.outer(unit, unit)))
    assert np.all(np.abs(value - truth) <= bound * np.linalg.norm(unit * truth) * errors)


def test_flights_that_leave_a_direction_open_give_no_estimate_of_their_own() -> None:
    one_direction = np.outer([1.0, 2.0], [1.0, 2.0])
    assert Reference.empty(2).add(one_direction, [1.0, 2.0], 1.0).estimate() is None
    assert Reference.empty(2).add(np.diag([1.0, 0.0]), [1.0, 0.0], 1.0).estimate() is None
    both = Reference.empty(2).add(one_direction, [1.0, 2.0], 1.0).add(np.eye(2), [0.0, 0.0], 1.0)
    assert both.estimate() is not None


@settings(deadline=None)
@given(seeds, st.integers(1, 6))
def test_the_order_of_flights_does_not_matter(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    taught = blocks(rng, k, 4)
    forward, backward = Reference.empty(k), Reference.empty(k)
    for j, h in taught:
        forward = forward.add(j, h, 1.0)
    for j, h in reversed(taught):
        backward = backward.add(j, h, 1.0)
    size = sum(np.abs(j) for j, _ in taught)
    assert np.all(np.abs(forward.information - backward.information) <= 8 * EPS * size)
    assert forward.blocks == backward.blocks == 4
    assert forward.seconds == 4.0


@settings(deadline=None)
@given(seeds, sizes, st.floats(0.0, 1e9))
def test_json_brings_every_bit_back(seed: int, k: int, seconds: float) -> None:
    rng = np.random.default_rng(seed)
    j = spd(rng, k)
    reference = Reference.empty(k).add(j, rng.normal(size=k) * 1e-300, seconds)
    back = Reference.from_dict(json.loads(json.dumps(reference.to_dict())))
    assert back.information.tobytes() == reference.information.tobytes()
    assert back.vector.tobytes() == reference.vector.tobytes()
    assert (back.blocks, back.seconds) == (1, seconds)


def test_a_reference_cannot_be_changed_from_outside() -> None:
    j = np.eye(2)
    reference = Reference.empty(2).add(j, [1.0, 1.0], 1.0)
    j[0, 0] = 9.0
    assert reference.information[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        reference.information[0, 0] = 2.0


@pytest.mark.parametrize(
    ("matrix", "vector", "what"),
    [
        (np.eye(3), [1.0, 1.0], r"got \(3, 3\) and \(2,\)"),
        (np.eye(3), [1.0, 1.0, 1.0], "3 derivatives cannot join a reference of 2"),
        (np.diag([1.0, math.nan]), [1.0, 1.0], "must be finite"),
        (np.eye(2), [1.0, math.inf], "must be finite"),
        ([[1.0, 0.5], [0.4, 1.0]], [1.0, 1.0], "must be symmetric"),
        ([[1.0, 2.0], [2.0, 1.0]], [1.0, 1.0], "must be positive semidefinite"),
        ([[0.0, 1.0], [1.0, 1.0]], [1.0, 1.0], "must be positive semidefinite"),
        (np.diag([1.0, -1.0]), [1.0, 1.0], "negative diagonal entry, -1"),
    ],
)
def test_a_block_that_is_no_information_is_refused(matrix: Array, vector: list[float], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        Reference.empty(2).add(matrix, vector, 1.0)


def test_what_rounding_leaves_below_nothing_is_nothing() -> None:
    prior = np.zeros(2), np.eye(2)
    found = Reference.empty(2).add(np.diag([1.0, -1.5e-323]), [1.0, 0.0], 1.0).posterior(*prior)
    exact = Reference.empty(2).add(np.diag([1.0, 0.0]), [1.0, 0.0], 1.0).posterior(*prior)
    assert all(np.array_equal(a, b) for a, b in zip(found, exact, strict=True))


@pytest.mark.parametrize("seconds", [-1.0, math.nan, math.inf])
def test_a_block_of_no_duration_is_refused(seconds: float) -> None:
    with pytest.raises(ValueError, match="a block lasts 0 s or more"):
        Reference.empty(1).add([[1.0]], [1.0], seconds)


@pytest.mark.parametrize("blocks", [0, 1])
def test_a_prior_that_is_no_covariance_is_refused_before_the_first_flight_and_after_it(blocks: int) -> None:
    reference = Reference(np.eye(2) * blocks, np.zeros(2), blocks)
    for matrix, what in (
        ([[1.0, 2.0], [2.0, 1.0]], "semidefinite"),
        ([[1.0, 0.5], [0.0, 1.0]], "symmetric"),
        ([[-1.0, 0.0], [0.0, 1.0]], "negative diagonal"),
    ):
        with pytest.raises(ValueError, match=what):
            reference.posterior(np.zeros(2), matrix)


def test_a_prior_of_another_structure_is_refused() -> None:
    with pytest.raises(ValueError, match="prior of 3 derivatives cannot meet a reference of 2"):
        Reference.empty(2).posterior(np.zeros(3), np.eye(3))


@pytest.mark.parametrize(
    "text",
    [
        "[]",
        "{}",
        '{"information": [[1]], "vector": [1], "blocks": 1, "seconds": 1, "more": 1}',
        '{"information": [[1]], "vector": ["x"], "blocks": 1, "seconds": 1}',
        '{"information": [[1, 2], [3]], "vector": [1], "blocks": 1, "seconds": 1}',
        '{"information": [[1]], "vector": [NaN], "blocks": 1, "seconds": 1}',
        '{"information": [[1]], "vector": [1], "blocks": -1, "seconds": 1}',
        '{"information": [[1]], "vector": [1], "blocks": null, "seconds": 1}',
    ],
)
def test_json_that_is_no_reference_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        Reference.from_dict(json.loads(text))


def test_the_json_is_plain() -> None:
    assert list(Reference.empty(1).to_dict()) == ["information", "vector", "blocks", "seconds"]


def test_information_discounted_to_next_to_nothing_is_none_and_no_error() -> None:
    """A direction that one block saw, forgotten until its numbers lose their digits."""
    root = np.array([[3.0, 1.0, 0.0], [0.2, 2.0, 1.0]])
    faded = np.diag([1.0, 1.0, 3e-157])
    block = faded @ root.T @ root @ faded
    block[2, 2] *= 0.3  # what rounding of denormal numbers leaves
    added = Reference.empty(3).add(block, np.zeros(3), 5.0)
    assert added.blocks == 1
    assert np.array_equal(added.information, 0.5 * (block + block.T))


@pytest.mark.parametrize("flown", [(False, False, False), (True, False, True), (True, True, True)])
def test_posteriors_of_many_are_those_of_each(flown: tuple[bool, ...]) -> None:
    """To the bit, and of who has not flown the prior."""
    rng = np.random.default_rng(17)
    references, value, covariance = [], rng.normal(size=(3, 6)), np.stack([spd(rng, 6) for _ in range(3)])
    covariance[2, :, 1] = covariance[2, 1] = 0.0  # held fixed
    for has in flown:
        reference = Reference.empty(6)
        for j, h in blocks(rng, 6, 2) if has else []:
            reference = reference.add(j, h, 10.0)
        references.append(reference)
    information = np.stack([r.information for r in references])
    found = posteriors(value, covariance, information, np.stack([r.vector for r in references]))
    for k, reference in enumerate(references):
        alone = reference.posterior(value[k], covariance[k])
        assert found[0][k].tobytes() == alone[0].tobytes()
        assert found[1][k].tobytes() == alone[1].tobytes()
        assert (found[0][k] == value[k]).all() != flown[k]
    assert found[0][2, 1] == pytest.approx(value[2, 1], rel=10 * 6 * 100 * EPS)  # as ``spd`` is conditioned
