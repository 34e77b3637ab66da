"""Blocks as the monitor remembers them, and what several of them say together."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import FlightCondition

__all__ = ["BlockView", "ModeBlock", "StructureSums", "Sums", "sums_of", "which_have_blocks"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ModeBlock:
    """One structure's part of a block, in coordinates that do not depend on the flight condition.

    Attributes:
        information, vector: the Fourier estimator's evidence, (k, k) and (k,); bias: information times the bias that
            gusts are expected to have caused, (k,).
        expected, expected_covariance: the expectation.
        ekf: the filter's estimate at the block's end; ekf_stands: whether it has standing.
        ekf_information, ekf_vector: what the filter learned from this block alone.
        rough: the air biases the evidence, alike before and after a change: it tells changes, not right from wrong.
    """

    information: Array
    vector: Array
    bias: Array
    expected: Array
    expected_covariance: Array
    ekf: Array
    ekf_information: Array
    ekf_vector: Array
    ekf_stands: bool
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
        return any(np.trace(m.information) > 0.0 for m in self.modes.values())


class Sums(NamedTuple):
    """Information, vector and bias of several blocks, one sum for each block that divides them.

    Attributes:
        information, vector, bias: (blocks + 1, k, k), (blocks + 1, k) and (blocks + 1, k).
    """

    information: Array
    vector: Array
    bias: Array


class StructureSums(NamedTuple):
    """A structure's blocks: sums over those before each block, and over those from it on; and the latest one."""

    before: Sums
    since: Sums
    latest: ModeBlock


def sums_of(blocks: Sequence[BlockView], name: str) -> StructureSums:
    """Sums over the blocks of a structure that has one."""
    modes = [b.modes.get(name) for b in blocks]
    latest = next(m for m in reversed(modes) if m is not None)
    nothing = Sums(*map(np.zeros_like, (latest.information, latest.vector, latest.bias)))
    parts = [nothing if m is None else Sums(m.information, m.vector, m.bias) for m in modes]
    before = Sums(*(np.cumsum(rows, axis=0) for rows in zip(nothing, *parts, strict=True)))
    since = Sums(*(np.cumsum(rows, axis=0)[::-1] for rows in zip(nothing, *reversed(parts), strict=True)))
    return StructureSums(before, since, latest)


def which_have_blocks(blocks: Sequence[BlockView], names: Collection[str], onsets: Places) -> Flags:
    """Which structures have a block at or after each onset, (structures, m)."""
    last = [max((k for k, b in enumerate(blocks) if name in b.modes), default=-1) for name in names]
    return np.array(last)[:, None] >= onsets
