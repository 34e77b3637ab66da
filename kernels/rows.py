"""Rows of 24 numbers, added in one go.

A processor multiplies and adds four or eight numbers in one instruction. A compiler that cannot know whether two arrays
overlap does not ask it to, and on rows this short what it asks beforehand costs as much as the work. Here a row is read
as a whole before one is written, so there is nothing to ask. Arrays are (rows, ``ROW``), contiguous; LLVM makes of a
row what the processor has. Rows and places are not checked: a wrong one reads or writes elsewhere.

Written on numba's extension interface (``numba.extending``).

Example:
    >>> import numpy as np
    >>> from numba import njit
    >>> @njit
    ... def thrice(rows, total):
    ...     for i in range(len(rows)):
    ...         add_row(total, 0, 3.0, rows, i)
    >>> total = np.zeros((1, ROW))
    >>> thrice(np.ones((2, ROW)), total)
    >>> float(total[0, 23])
    6.0
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

__all__ = ["ROW", "add_row", "add_rows"]

ROW = 24
"""Numbers in a row."""

_LANES = 8
"""Of one instruction, where the processor has so many; LLVM halves them where it has not."""
_VECTOR = ir.VectorType(ir.DoubleType(), _LANES)
_WORD = ir.IntType(64)
_EIGHT_BYTES = 8
"""An array of numba begins at any multiple of it."""
_FUSED = ("contract",)


def _places(context: Any, builder: Any, kind: Any, array: Any, row: Any) -> list[Any]:
    """Where the parts of a row lie."""
    data = make_array(kind)(context, builder, array).data
    first = builder.mul(row, _WORD(ROW))
    places = [builder.gep(data, [builder.add(first, _WORD(lane))]) for lane in range(0, ROW, _LANES)]
    return [builder.bitcast(place, _VECTOR.as_pointer()) for place in places]


def _read(builder: Any, places: list[Any]) -> list[Any]:
    return [builder.load(place, align=_EIGHT_BYTES) for place in places]


def _write(builder: Any, parts: list[Any], places: list[Any]) -> None:
    for part, place in zip(parts, places, strict=True):
        builder.store(part, place, align=_EIGHT_BYTES)


def _sum(builder: Any, total: list[Any], weight: Any, row: list[Any]) -> list[Any]:
    """A row plus a weight times a row."""
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(nothing, weight, ir.IntType(32)(0))
    spread = builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), _LANES), [0] * _LANES)
    )
    products = [builder.fmul(spread, part, flags=_FUSED) for part in row]
    return [builder.fadd(a, b, flags=_FUSED) for a, b in zip(total, products, strict=True)]


def _checked(*arrays: Any) -> None:
    for kind in arrays:
        if not isinstance(kind, types.Array) or kind.dtype != types.float64 or kind.layout != "C":
            raise TypeError("rows are of contiguous arrays of float64")


def _add_row(typing_context: Any, into: Any, i: Any, weight: Any, of: Any, j: Any) -> Any:
    _checked(into, of)

    def write(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        there = _places(context, builder, into, values[0], values[1])
        row = _read(builder, _places(context, builder, of, values[3], values[4]))
        _write(builder, _sum(builder, _read(builder, there), values[2], row), there)
        return context.get_dummy_value()

    return types.void(into, types.intp, types.float64, of, types.intp), write


def _add_rows(
    typing_context: Any, into: Any, i: Any, weights: Any, columns: Any, first: Any, end: Any, of: Any
) -> Any:
    _checked(into, weights, of)

    def write(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        there = _places(context, builder, into, values[0], values[1])
        begun, before = _read(builder, there), builder.basic_block
        weight, column = (
            make_array(kind)(context, builder, value).data
            for kind, value in ((weights, values[2]), (columns, values[3]))
        )
        ask, add, done = (builder.append_basic_block(name) for name in ("ask", "add", "done"))
        builder.branch(ask)
        builder.position_at_end(ask)
        n, total = builder.phi(_WORD), [builder.phi(_VECTOR) for _ in begun]
        builder.cbranch(builder.icmp_signed("<", n, values[5]), add, done)
        builder.position_at_end(add)
        row = _read(builder, _places(context, builder, of, values[6], builder.load(builder.gep(column, [n]))))
        more = _sum(builder, total, builder.load(builder.gep(weight, [n])), row)
        after = builder.add(n, _WORD(1))
        for value, start, again in ((n, values[4], after), *zip(total, begun, more, strict=True)):
            value.add_incoming(start, before)
            value.add_incoming(again, add)
        builder.branch(ask)
        builder.position_at_end(done)
        _write(builder, total, there)
        return context.get_dummy_value()

    if columns.dtype != types.int64 or columns.layout != "C":
        raise TypeError("places of rows are a contiguous array of int64")
    return types.void(into, types.intp, weights, columns, types.intp, types.intp, of), write


add_row: Any = intrinsic(_add_row)
"""In a kernel: ``into[i] += weight * of[j]``."""

add_rows: Any = intrinsic(_add_rows)
"""In a kernel: ``into[i] += weights[n] * of[columns[n]]`` for n from ``first`` to before ``end``."""
