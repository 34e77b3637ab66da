"""Numbers do not depend on where small arrays lie in memory: none begins right after another."""

from dataclasses import fields
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from estimator_plants import PITCH, ekf, fourier
from numpy.typing import NDArray

from wingwatch.estimators.ekf.state import one_vehicle
from wingwatch.estimators.fourier.blocks import block_workspace
from wingwatch.estimators.kernels.apart import apart, room_around


class Pair(NamedTuple):
    one: NDArray[Any]
    other: NDArray[Any]


VECTORS_BYTES = 4 * 4 * 8
"""What a loop takes at once, at most."""


def arrays_in(state: tuple[Any, ...]) -> list[NDArray[Any]]:
    found: list[NDArray[Any]] = []
    for one in state:
        found += arrays_in(one) if isinstance(one, tuple) else [one]
    return found


def assert_apart(arrays: list[NDArray[Any]]) -> None:
    starts = sorted({a.ctypes.data: a.nbytes for a in arrays}.items())
    for (start, size), (after, _) in pairwise(starts):
        assert after - start >= max(VECTORS_BYTES, size)


def test_workspace_and_states_have_room_around_each_array() -> None:
    assert_apart(arrays_in(block_workspace(2, 1, 40, 12, 3)))
    state = fourier(PITCH).init(1)
    assert_apart([getattr(state, f.name) for f in fields(state)])  # type: ignore[arg-type]
    kept: Any = ekf(PITCH).init(1)
    assert_apart(arrays_in(kept))
    assert_apart(arrays_in(one_vehicle(kept, 0)))


def test_what_was_one_array_stays_one() -> None:
    shared = np.arange(3.0)
    moved = apart(Pair(shared, shared))
    assert moved.one is moved.other
    assert moved.one is not shared
    np.testing.assert_array_equal(moved.one, shared)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64, np.bool_, np.complex128])
def test_a_copy_is_the_same_array_elsewhere(dtype: Any) -> None:
    array = np.arange(12).reshape(3, 4)[:, 1:].astype(dtype)
    copy = room_around(array)
    np.testing.assert_array_equal(copy, array)
    assert copy.dtype == array.dtype
    assert copy.flags.c_contiguous
    copy[0, 0] = 1
    assert array[0, 0] == np.arange(12).reshape(3, 4)[0, 1].astype(dtype)
