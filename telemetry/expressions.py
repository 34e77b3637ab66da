"""Arithmetic on table columns: parsed into a tree whose every node is checked, never ``eval``."""

import ast
import operator
import re
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.quaternion import euler_heading, euler_pitch, euler_roll

__all__ = ["ExpressionError", "canonical_name", "evaluate", "evaluate_filter", "named_columns", "parts_of"]

_MAX_CHARACTERS = 300
_ARITHMETIC: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_COMPARISON: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_QUATERNION: Mapping[str, Callable[..., Any]] = {
    "euler_roll": euler_roll,
    "euler_pitch": euler_pitch,
    "euler_heading": euler_heading,
}
_FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {"sin": np.sin, "cos": np.cos}
_TOPIC_WITHOUT_INSTANCE = re.compile(r"(\w+)\.(.+)")


class ExpressionError(ValueError):
    """An expression that cannot be read or names a column the table lacks; one clause."""


@lru_cache(maxsize=1024)
def canonical_name(name: str) -> str:
    """A column's name with its topic's instance written out: ``IMU.GyrY`` becomes ``IMU[0].GyrY``."""
    match = _TOPIC_WITHOUT_INSTANCE.fullmatch(name)
    return f"{match[1]}[0].{match[2]}" if match else name


def named_columns(text: str) -> tuple[str, ...]:
    """Columns that an expression or a condition reads, each once, by their canonical names.

    Raises:
        ExpressionError: it cannot be read.
    """
    names: dict[str, None] = {}
    _collect(_parse(text), names)
    return tuple(names)


def _collect(node: ast.AST, names: dict[str, None]) -> None:
    match node:
        case ast.Call(func=ast.Name(id=function), args=[vector]) if function in _QUATERNION:
            names.update(dict.fromkeys(canonical_name(name) for name in _elements(vector)))
        case ast.Call(args=arguments):
            for argument in arguments:
                _collect(argument, names)
        case ast.Constant(value=str() as name):
            names[canonical_name(name)] = None
        case ast.Name() | ast.Attribute() | ast.Subscript():
            names[canonical_name(_column_name(node))] = None
        case _:
            for child in ast.iter_child_nodes(node):
                _collect(child, names)


def _elements(vector: ast.expr) -> list[str]:
    """The columns of a quaternion that is one vector, scalar first."""
    match vector:
        case ast.Constant(value=str() as name):
            pass
        case node:
            name = _column_name(node)
    return [f"{name}[{k}]" for k in range(4)]


def evaluate(text: str, columns: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """The value of an expression, row by row.

    A text that is exactly a column's name is that column, whatever characters it has; inside an expression
    such a name stands in quotes.

    Args:
        text: numbers, columns, ``+ - * / **``, parentheses, ``sin`` and ``cos`` of an angle in rad, ``euler_roll``,
            ``euler_pitch``, ``euler_heading`` of a quaternion, in rad: of the columns ``q[0]`` to ``q[3]`` as
            ``euler_roll(q)``, of four as ``euler_roll(qw, qx, qy, qz)`` (``telemetry.quaternion``); at most 300
            characters.
        columns: equal-length columns by name.

    Returns:
        Shape (rows,), float64; a division by zero gives a non-finite value, which cleaning rejects.

    Raises:
        ExpressionError: anything else in the text, or a column that is not there.
    """
    if text in columns:
        return np.array(columns[text], dtype=np.float64)
    with np.errstate(all="ignore"):
        value = _Evaluator(columns).number(_parse(text))
    return np.array(np.broadcast_to(value, _shape(columns)), dtype=np.float64)


def parts_of(text: str, columns: Mapping[str, NDArray[np.float64]]) -> tuple[set[str], list[float], bool]:
    """What an expression is made of: its columns, its numbers, and whether a function of a quaternion is in it.

    Raises:
        ExpressionError: it cannot be read.
    """
    if text in columns:
        return {text}, [], False
    canonical = {canonical_name(name): name for name in columns}
    names: set[str] = set()
    numbers: list[float] = []
    calls = False
    waiting: list[ast.AST] = [_parse(text)]
    while waiting:
        node = waiting.pop()
        calls |= isinstance(node, ast.Call)
        match node:
            case ast.Constant(value=str() as name):
                names.add(canonical.get(canonical_name(name), name))
            case ast.Constant(value=int() | float() as value):
                numbers.append(float(value))
            case ast.Name() | ast.Attribute() | ast.Subscript():
                name = _column_name(node)
                names.add(canonical.get(canonical_name(name), name))
            case _:
                waiting += ast.iter_child_nodes(node)
    return names & set(columns), numbers, calls


def evaluate_filter(text: str, columns: Mapping[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Which rows a condition keeps: comparisons of expressions joined by ``and``, ``or``, ``not``.

    Returns:
        Shape (rows,); a comparison with a missing value is false.

    Raises:
        ExpressionError: anything else in the text, or a column that is not there.
    """
    with np.errstate(all="ignore"):
        value = _Evaluator(columns).condition(_parse(text))
    return np.array(np.broadcast_to(value, _shape(columns)), dtype=np.bool_)


def _shape(columns: Mapping[str, NDArray[np.float64]]) -> tuple[int, ...]:
    return next(iter(columns.values())).shape


@lru_cache(maxsize=512)  # a live link evaluates the same few several times a second; nobody changes a tree
def _parse(text: str) -> ast.expr:
    if len(text) > _MAX_CHARACTERS:
        raise ExpressionError(f"an expression of {len(text)} characters is longer than {_MAX_CHARACTERS}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{text!r} is neither a column nor a valid expression") from None


class _Evaluator:
    """Walks a parsed expression over the columns of one table."""

    def __init__(self, columns: Mapping[str, NDArray[np.float64]]) -> None:
        self._columns = {canonical_name(name): column for name, column in columns.items()}

    def number(self, node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=bool()):
                raise _refused(node)
            case ast.Constant(value=int() | float() as value):
                return _finite(value)
            case ast.Constant(value=str() as name):
                return self._column(name)
            case ast.Name() | ast.Attribute() | ast.Subscript():
                return self._column(_column_name(node))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self.number(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.number(operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return _ARITHMETIC[type(op)](self.number(left), self.number(right))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _QUATERNION:
                return _QUATERNION[name](*self._quaternion(name, arguments))
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in _FUNCTIONS:
                return _FUNCTIONS[name](self.number(argument))
        raise _refused(node)

    def _quaternion(self, function: str, arguments: list[ast.expr]) -> list[Any]:
        """The four parts, scalar first: given one by one, or those of one vector."""
        if len(arguments) == 4:
            return [self.number(argument) for argument in arguments]
        if len(arguments) == 1:
            names = _elements(arguments[0])
            if all(canonical_name(name) in self._columns for name in names):
                return [self._column(name) for name in names]
            raise ExpressionError(
                f"{function}({names[0].removesuffix('[0]')}) needs the columns {', '.join(names)}, scalar first; "
                f"four columns of other names are written {function}(qw, qx, qy, qz)"
            )
        raise ExpressionError(
            f"{function} takes one quaternion, {function}(q), or its four parts, {function}(qw, qx, qy, qz)"
        )

    def condition(self, node: ast.expr) -> Any:
        match node:
            case ast.BoolOp(op=op, values=values):
                join = np.logical_and if isinstance(op, ast.And) else np.logical_or
                return join.reduce(np.broadcast_arrays(*(self.condition(value) for value in values)), axis=0)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return np.logical_not(self.condition(operand))
            case ast.Compare(left=left, ops=ops, comparators=comparators):
                return self._comparison([left, *comparators], ops)
        raise ExpressionError(f"{ast.unparse(node)!r} is no condition: compare, as in 'mode == 2'")

    def _comparison(self, operands: list[ast.expr], ops: list[ast.cmpop]) -> Any:
        values = [self.number(operand) for operand in operands]
        result: Any = True
        for i, op in enumerate(ops):
            if type(op) not in _COMPARISON:
                raise ExpressionError("a condition compares with == != < <= > >= only")
            result = np.logical_and(result, _COMPARISON[type(op)](values[i], values[i + 1]))
        return result

    def _column(self, name: str) -> NDArray[np.float64]:
        column = self._columns.get(canonical_name(name))
        if column is None:
            close = get_close_matches(canonical_name(name), self._columns, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else f" (it has {_some(self._columns)})"
            raise ExpressionError(f"the table has no column {name!r}{hint}")
        return column


def _column_name(node: ast.expr) -> str:
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=value, attr=field):
            return f"{_column_name(value)}.{field}"
        case ast.Subscript(value=value, slice=ast.Constant(value=int() as index)) if not isinstance(
            index, bool
        ):
            return f"{_column_name(value)}[{index}]"
    raise _refused(node)


def _finite(value: int | float) -> np.float64:
    try:
        number = np.float64(value)
    except OverflowError:
        number = np.float64(np.inf)
    if not np.isfinite(number):
        raise ExpressionError("a number in the expression is too large")
    return number


def _refused(node: ast.expr) -> ExpressionError:
    return ExpressionError(
        f"{ast.unparse(node)[:80]!r} is not allowed in an expression: "
        f"use columns, numbers, + - * / **, parentheses, {', '.join([*_FUNCTIONS, *_QUATERNION])}"
    )


def _some(names: Mapping[str, object], most: int = 12) -> str:
    shown = ", ".join(list(names)[:most])
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"
