"""Whether stated errors and stated evidence hold on healthy time, stratum by stratum."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import orjson
from numpy.typing import NDArray
from scipy.special import chdtrc

from wingwatch.studies.detection import ORDER
from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.statistics import Interval, clustered_proportion, clustered_ratio, wilson

__all__ = ["IMPROBABLE", "Exceedance", "Scatter", "bayes_factor_exceedances", "block_scatters"]

Array = NDArray[np.float64]

_STRATA = ("turbulence", "excitation", "aircraft", "expectation", "sensors", "surfaces")
IMPROBABLE = 1e-3
_FACTORS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0)


@dataclass(frozen=True, slots=True)
class Scatter:
    """Squared distance of blocks from their expectation over what was stated, per degree of freedom: 1 is right.

    Attributes:
        structure: model structure; by, group: stratum, both empty for all.
        blocks, flights: that it rests on; the intervals take the blocks of a flight as dependent.
        improbable: share of blocks whose distance had a probability below ``IMPROBABLE``, so much is right. A mean
            near one may hide few blocks that are far off.
    """

    structure: str
    by: str
    group: str
    flights: int
    blocks: int
    ratio: Interval
    improbable: Interval


@dataclass(frozen=True, slots=True)
class Exceedance:
    """How often a healthy flight's largest Bayes factor exceeds each value.

    A Bayes factor has expectation one while nothing has changed, so no more than ``1 / factor`` of flights should.

    Attributes:
        fraction, low, high: of flights, with Wilson's interval.
        too_often: whether the interval's lower limit lies above ``1 / factor`` anywhere.
    """

    by: str
    group: str
    flights: int
    factor: list[float]
    fraction: list[float]
    low: list[float]
    high: list[float]
    too_often: bool


def block_scatters(rows: Rows, well: Flags) -> list[Scatter]:
    """By structure: all healthy blocks, then those of each stratum."""
    chosen = np.flatnonzero(well)
    found = []
    for structure, sums in _block_sums(rows, chosen).items():
        found.append(_scatter(structure, "", "", sums))
        for by in _STRATA:
            groups = rows.groups(by, well, ORDER.get(by, ()))
            if len(groups) > 1:
                found += [_scatter(structure, by, g, sums[:, f[chosen]]) for g, f in groups.items()]
    return found


def _scatter(structure: str, by: str, group: str, sums: Array) -> Scatter:
    chi_square, freedom, blocks, improbable = sums[:, sums[1] > 0.0]
    return Scatter(
        structure, by, group, blocks.size, int(blocks.sum()),
        clustered_ratio(chi_square, freedom), clustered_proportion(improbable, blocks),
    )  # fmt: skip


def _block_sums(rows: Rows, chosen: NDArray[np.intp]) -> dict[str, Array]:
    """Per structure chi-square, degrees of freedom, number of blocks and of improbable ones before any onset, each by
    flight, (4, flights)."""
    onset = np.where(rows.words("effect") == "", np.inf, rows.number("onset_s"))
    found: dict[str, Array] = defaultdict(lambda: np.zeros((4, chosen.size)))
    for place, (row, text) in enumerate(rows.texts("block_scores", chosen)):
        for structure, blocks in orjson.loads(text or "{}").items():
            time_s, chi_square, freedom = np.array(blocks, dtype=np.float64).reshape(-1, 3).T
            used = (freedom > 0.0) & (time_s <= onset[row])
            far = chdtrc(freedom[used], chi_square[used]) < IMPROBABLE
            found[structure][:, place] = (
                chi_square[used].sum(), freedom[used].sum(), np.count_nonzero(used), np.count_nonzero(far),
            )  # fmt: skip
    return dict(found)


def bayes_factor_exceedances(rows: Rows, healthy: Flags) -> list[Exceedance]:
    """Over all healthy flights, then by stratum."""
    healthy = healthy & np.isfinite(rows.number("bayes_factor_max"))
    found = [_exceedance(rows, "", "", healthy)] if healthy.any() else []
    for by in _STRATA:
        groups = rows.groups(by, healthy, ORDER.get(by, ()))
        if len(groups) > 1:
            found += [_exceedance(rows, by, group, chosen) for group, chosen in groups.items()]
    return found


def _exceedance(rows: Rows, by: str, group: str, chosen: Flags) -> Exceedance:
    largest = np.sort(rows.number("bayes_factor_max")[chosen])
    above = largest.size - np.searchsorted(largest, _FACTORS, side="right")
    seen = [wilson(int(n), largest.size) for n in above]
    return Exceedance(
        by=by,
        group=group,
        flights=int(largest.size),
        factor=list(_FACTORS),
        fraction=[s.value for s in seen],
        low=[s.low for s in seen],
        high=[s.high for s in seen],
        too_often=any(s.low > 1.0 / f for s, f in zip(seen, _FACTORS, strict=True)),
    )
