"""Kernels that are compiled into others, and tuples of arrays that kernels are given by their address."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from wingwatch.kernels.by_address import ByAddress, one_vehicle
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import helper, lean


class Level(NamedTuple):
    value: NDArray[np.float64]
    samples: NDArray[np.int64]


class Many(NamedTuple):
    a: NDArray[np.float64]
    b: NDArray[np.float64]
    c: NDArray[np.float64]
    d: NDArray[np.float64]
    e: NDArray[np.float64]


class Structure(NamedTuple):
    level: Level
    many: Many
    matrix: NDArray[np.float64]
    gain: float
    steps: int
    follows: bool


def structure(vehicles: int = 3) -> Structure:
    rng = np.random.default_rng(1)
    return Structure(
        Level(np.arange(float(vehicles)), np.arange(vehicles)),
        Many(*(rng.standard_normal((vehicles, 2 + j)) for j in range(5))),
        rng.standard_normal((vehicles, 2, 3)), 0.25, -7, True,
    )  # fmt: skip


@lean
def _half(x):  # type: ignore[no-untyped-def]
    return 0.5 * x


@helper
def _quarters(x):  # type: ignore[no-untyped-def]
    out = np.empty(4)
    for j in range(4):
        out[j] = _half(_half(x)) * j
    return out


@njit
def _sum_of_quarters(x):  # type: ignore[no-untyped-def]
    return _quarters(x).sum()


@njit
def _read(named):  # type: ignore[no-untyped-def]
    named.level.value[0] = 9.0
    number = named.gain if named.follows else -1.0
    return named.many.e[1, 2], named.matrix[2, 1, 2], number, named.steps, named.many.e.shape


@njit
def _read_one(named, i):  # type: ignore[no-untyped-def]
    vehicle = one_vehicle(named, i)
    vehicle.level.samples[...] = 40 + i
    return vehicle.many.e[2], vehicle.matrix[1, 2], vehicle.matrix.shape


def test_a_piece_is_compiled_into_its_caller_and_has_no_code_of_its_own() -> None:
    assert _sum_of_quarters(8.0) == 12.0
    for piece in (_quarters, _half):
        (compiled,) = piece.overloads.values()
        library: Any = compiled.library
        assert library.get_pointer_to_function(compiled.fndesc.llvm_func_name) == 0


def test_python_may_call_a_piece_which_is_then_compiled_by_itself() -> None:
    np.testing.assert_array_equal(_quarters(8.0), [0.0, 2.0, 4.0, 6.0])
    assert _quarters.by_itself.signatures


def test_a_kernel_reads_and_writes_the_arrays_that_it_is_given_by_address() -> None:
    named = structure()
    assert _read(ByAddress(named)) == (named.many.e[1, 2], named.matrix[2, 1, 2], 0.25, -7, (3, 6))
    assert named.level.value[0] == 9.0


def test_the_arrays_of_one_vehicle_are_without_their_leading_axis() -> None:
    named = structure()
    for i in range(3):
        assert _read_one(ByAddress(named), i) == (named.many.e[i, 2], named.matrix[i, 1, 2], (2, 3))
    np.testing.assert_array_equal(named.level.samples, [40, 41, 42])


def test_a_kernel_takes_the_tuple_itself_too() -> None:
    named = structure()
    assert _read(named) == _read(ByAddress(named))


def test_two_tuples_of_one_class_with_other_arrays_are_of_two_kinds() -> None:
    flat, deep = Level(np.zeros(2), np.zeros(2, np.int64)), Level(np.zeros((2, 2)), np.zeros(2, np.int64))
    single = Level(np.zeros(2, np.float32), np.zeros(2, np.int64))
    kinds = {ByAddress(one)._numba_type_ for one in (flat, deep, single)}
    assert len(kinds) == 3
    assert ByAddress(Level(np.ones(5), np.ones(5, np.int64)))._numba_type_ in kinds


def test_an_array_that_is_not_contiguous_is_refused() -> None:
    with pytest.raises(ValueError, match=r"an array of shape \(3,\) is not contiguous: copy it"):
        ByAddress(Level(np.zeros((3, 2))[:, 0], np.zeros(3, np.int64)))


def test_a_copy_is_element_by_element() -> None:
    source, target = np.arange(12.0).reshape(3, 2, 2), np.zeros((3, 2, 2))
    copy_into(source[1:], target[:2])
    np.testing.assert_array_equal(target[:2], source[1:])
    assert not target[2].any()
