"""Random streams: the published generator, normal numbers, alike however they are asked for."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from wingwatch.simulation.random_numbers import NormalStreams, fill_normals, random_streams, uniform

DEVIATIONS = 4.5
"""Standard deviations that a statistic may stray: one such test in 150,000 fails by chance, were the seed not fixed."""


def normals(n: int, seed: int) -> NDArray[np.float64]:
    out = np.empty(n)
    fill_normals(random_streams([np.random.default_rng(seed)])[0], out)
    return out


def test_the_generator_is_the_published_one() -> None:
    """The first words of xoshiro256++ from the state 1, 2, 3, 4, as its other implementations are tested with."""
    words = (
        41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205, 9973669472204895162,
        14011001112246962877, 12406186145184390807, 15849039046786891736, 10450023813501588000,
    )  # fmt: skip
    stream = np.array([1, 2, 3, 4], dtype=np.uint64)
    assert [uniform(stream) for _ in words] == [(word >> 11) * 2.0**-53 for word in words]


@pytest.mark.parametrize("power", [1, 2, 3, 4, 6])
def test_moments_are_those_of_the_normal_distribution(power: int) -> None:
    n = 2_000_000
    x = normals(n, 1)
    moment, square = (float(math.prod(range(k - 1, 0, -2))) for k in (power, 2 * power))
    wanted = moment if power % 2 == 0 else 0.0
    assert abs(np.mean(x**power) - wanted) < DEVIATIONS * math.sqrt((square - wanted**2) / n)


def test_the_distribution_is_normal_on_every_level_and_in_the_tail() -> None:
    n, bins = 2_000_000, 2000
    x = normals(n, 2)
    edges = stats.norm.ppf(np.arange(1, bins) / bins)
    counts = np.bincount(np.searchsorted(edges, x), minlength=bins)
    misfit = float(np.sum((counts - n / bins) ** 2) / (n / bins))
    assert abs(misfit - (bins - 1)) < DEVIATIONS * math.sqrt(2.0 * (bins - 1))
    for limit in (3.0, 3.7, 4.2):  # the ziggurat's tail begins at 3.654
        share = 2.0 * stats.norm.sf(limit)
        assert abs(np.count_nonzero(np.abs(x) > limit) - n * share) < DEVIATIONS * math.sqrt(n * share)


def test_numbers_of_vehicles_columns_and_instants_are_independent() -> None:
    n, vehicles, width = 200_000, 3, 4
    taken = NormalStreams([np.random.default_rng(i) for i in range(vehicles)], [width] * vehicles).take(n)
    series = taken.transpose(0, 2, 1).reshape(vehicles * width, n)
    both = np.concatenate([series[:, 1:], series[:, :-1]])
    for product in (np.corrcoef(both), np.corrcoef(both**2)):
        beside = product[~np.eye(len(both), dtype=bool)]
        again = np.abs(beside) > 0.99  # none: a number that comes back in another place
        assert not again.any()
        assert np.abs(beside).max() < (DEVIATIONS + 0.5) / math.sqrt(n)  # the largest of 276


def test_pieces_and_company_change_nothing() -> None:
    def streams(*which: int) -> NormalStreams:
        return NormalStreams([np.random.default_rng(i) for i in which], [(3, 0, 8)[i] for i in which])

    whole = streams(0, 1, 2).take(100)
    fleet = streams(0, 1, 2)
    np.testing.assert_array_equal(np.concatenate([fleet.take(m) for m in (1, 0, 31, 68)], axis=1), whole)
    np.testing.assert_array_equal(streams(2).take(100)[0], whole[2])
    np.testing.assert_array_equal(streams(0).take(100)[0], whole[0, :, :3])
    np.testing.assert_array_equal(whole[0, :, 3:], 0.0)
    np.testing.assert_array_equal(whole[1], 0.0)


def test_a_kernel_that_draws_for_itself_gets_the_same_numbers() -> None:
    taken, drawn = (NormalStreams([np.random.default_rng(5)], [4]) for _ in range(2))
    own = np.empty(12)
    fill_normals(drawn.streams[0], own[:7])
    fill_normals(drawn.streams[0], own[7:])
    np.testing.assert_array_equal(taken.take(3).ravel(), own)
