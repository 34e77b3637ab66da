"""The codec alone: what is written comes back, and what cannot be written or read is said."""

from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.monitor.state_codec import NOT_SAVED, Codec, Named, StateError, detached

Array = NDArray[np.float64]


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class Pair(NamedTuple):
    left: Array
    right: NDArray[np.int64]


@dataclass(slots=True)
class Whole:
    number: int
    real: float
    text: str | None
    either: int | float | None
    names: tuple[str, ...]
    both: tuple[int, str]
    colour: Colour
    pair: Pair
    small: NDArray[np.float32]
    flags: NDArray[np.bool_]
    table: dict[tuple[str, int], list[float]]
    shown: Mapping[str, Sequence[str]]
    waiting: deque[tuple[float, Array]]
    some: set[str]
    spans: tuple[range, ...]
    made: float = field(default=0.0, metadata=NOT_SAVED)


def whole() -> Whole:
    return Whole(
        number=-(2**70), real=float("nan"), text=None, either=2**64 - 1, names=("a", ""), both=(1, "\u00b5"),
        colour=Colour.BLUE, pair=Pair(np.array([[1.0, -0.0], [np.inf, np.nan]]), np.arange(3)),
        small=np.ones((0, 3), np.float32), flags=np.array([True, False]), table={("x", 1): [0.1]},
        shown={"b": ("c",), "a": ()}, waiting=deque([(1.0, np.zeros(2))]), some={"q", "p"},
        spans=(range(3, 9), range(0)), made=7.0,
    )  # fmt: skip


def test_what_is_written_comes_back_to_the_bit() -> None:
    codec, value = Codec(), whole()
    data = codec.encode(Whole, value)
    back = codec.decode(Whole, data)
    assert codec.encode(Whole, back) == data
    assert (back.number, back.either, back.both, back.colour) == (
        -(2**70),
        2**64 - 1,
        (1, "\u00b5"),
        Colour.BLUE,
    )
    assert back.pair.left.tobytes() == value.pair.left.tobytes()
    assert list(back.shown) == ["b", "a"]
    assert back.made == 0.0


def test_arrays_keep_their_places_in_memory() -> None:
    codec, square = Codec(), np.arange(12.0).reshape(3, 4)
    for array in (
        square,
        square.T,
        square[:, 1],
        square[::2, 1:3],
        square[1:, :],
        np.zeros((0, 4)),
        np.array(2.0),
    ):
        back = codec.decode(Array, codec.encode(Array, array))
        assert np.array_equal(back, array)
        assert back.strides == array.strides or not array.size
        assert back.flags.writeable


def test_objects_of_the_program_are_named() -> None:
    @dataclass(frozen=True)
    class Cause:
        name: str

    ice = Cause("ice")
    codec = Codec({Cause: Named(lambda one: str(one.name), {"ice": ice})})
    assert codec.decode(Cause, codec.encode(Cause, ice)) is ice
    with pytest.raises(StateError, match=r"no .*Cause wind"):
        codec.decode(Cause, codec.encode(Cause, Cause("wind")))


def test_another_field_is_another_layout() -> None:
    @dataclass
    class One:
        a: float

    @dataclass
    class Two:
        a: float
        b: int = 0

    first, second = Codec().layout(One), Codec().layout(Two)
    assert first.partition("(")[2] == "a: float)"
    assert first.partition("(")[2] != second.partition("(")[2]


def test_what_cannot_be_saved_is_said_when_the_type_is_looked_at() -> None:
    @dataclass
    class Vague:
        inner: Any

    @dataclass
    class Untyped:
        inner: NDArray[Any]

    for kind in (Vague, Untyped, object, dict[str, Vague]):
        with pytest.raises(TypeError, match="cannot be saved"):
            Codec().layout(kind)


def test_a_value_of_another_type_than_declared_is_no_state() -> None:
    for kind, value in ((Array, np.arange(3)), (float | None, "x"), (Pair, (1, 2))):
        with pytest.raises(TypeError):
            Codec().encode(kind, value)


def test_whatever_the_bytes_they_are_read_or_refused() -> None:
    codec = Codec()
    data = codec.encode(Whole, whole())
    rng = np.random.default_rng(3)
    for end in range(0, len(data), 3):
        with pytest.raises(StateError):
            codec.decode(Whole, data[:end])
    with pytest.raises(StateError, match="longer"):
        codec.decode(Whole, data + b"x")
    for _ in range(3000):
        bad = bytearray(data)
        bad[rng.integers(len(data))] = rng.integers(256)
        with suppress(StateError):
            codec.decode(Whole, bytes(bad))


def test_a_detached_copy_does_not_change_with_the_original() -> None:
    value = whole()
    copy = detached(value)
    value.table["y", 2] = []
    value.table["x", 1].append(9.0)
    value.waiting.append((2.0, np.zeros(1)))
    value.some.add("r")
    assert (list(copy.table), copy.table["x", 1], len(copy.waiting), copy.some) == (
        [("x", 1)],
        [0.1],
        1,
        {"p", "q"},
    )
