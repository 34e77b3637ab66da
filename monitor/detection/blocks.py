"""Blocks as the monitor remembers them, and what several of them say together."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import FlightCondition

__all__ = [
    "EKF",
    "FOURIER",
    "BlockView",
    "Evidence",
    "ModeBlock",
    "StructureSums",
    "sums_of",
    "which_have_blocks",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]

FOURIER, EKF = range(2)
"""Places of the estimators in what is known of both."""


class Evidence(NamedTuple):
    """What both estimators found in a block, or in several: axes of these come first.

    Attributes:
        information, vector: (2, k, k) and (2, k), zero where an estimator says nothing.
        bias: (2, k), information times the bias that gusts are expected to have caused; the filter knows the gusts.
    """

    information: Array
    vector: Array
    bias: Array


@dataclass(frozen=True, slots=True)
class ModeBlock:
    """One structure's part of a block, in coordinates that do not depend on the flight condition.

    Attributes:
        evidence: of both estimators.
        expected, expected_covariance: the expectation.
        rough: the air biases the evidence, alike before and after a change: it tells changes, not right from wrong.
    """

    evidence: Evidence
    expected: Array
    expected_covariance: Array
    rough: bool = False


@dataclass(frozen=True, slots=True)
class BlockView:
    """One block of all structures."""

    end_s: float
    condition: FlightCondition
    modes: Mapping[str, ModeBlock]

    @property
    def informative(self) -> bool:
        """Whether anything was excited."""
        return any(np.trace(m.evidence.information[FOURIER]) > 0.0 for m in self.modes.values())


class StructureSums(NamedTuple):
    """A structure's blocks: sums over those before each block, and over those from it on, one for each block that
    divides them, (blocks + 1, ...); and the latest one."""

    before: Evidence
    since: Evidence
    latest: ModeBlock


def sums_of(blocks: Sequence[BlockView], name: str) -> StructureSums:
    """Sums over the blocks of a structure that has one."""
    modes = [b.modes.get(name) for b in blocks]
    latest = next(m for m in reversed(modes) if m is not None)
    nothing = Evidence(*map(np.zeros_like, latest.evidence))
    parts = [nothing if m is None else m.evidence for m in modes]
    before = Evidence(*(np.cumsum(rows, axis=0) for rows in zip(nothing, *parts, strict=True)))
    since = Evidence(*(np.cumsum(rows, axis=0)[::-1] for rows in zip(nothing, *reversed(parts), strict=True)))
    return StructureSums(before, since, latest)


def which_have_blocks(blocks: Sequence[BlockView], names: Collection[str], onsets: Places) -> Flags:
    """Which structures have a block at or after each onset, (structures, m)."""
    last = [max((k for k, b in enumerate(blocks) if name in b.modes), default=-1) for name in names]
    return np.array(last)[:, None] >= onsets
