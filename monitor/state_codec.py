"""State as bytes and back, bit for bit, by the types that classes declare.

A value is written by its declared type alone: dataclasses, named tuples and pydantic models field by field, arrays with
their shape and order in memory, numbers as they are. Nothing in the bytes names a class or is run, so bytes from a
stranger can at worst be refused. What has no plain declared type cannot be written, and says so when the type is first
looked at, not when a flight comes by it.

``layout`` writes down all names and types that the bytes follow. What was renamed keeps its old name there
(``stored_name`` of a class, ``stored`` in a field's metadata). Two programs whose layouts differ cannot read each
other's bytes.
"""

import collections
import collections.abc
import dataclasses
import struct
import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from math import prod
from typing import Any, Literal, NamedTuple, TypeVar, Union

import numpy as np
from pydantic import BaseModel

__all__ = ["NOT_SAVED", "Codec", "Named", "StateError", "detached"]

NOT_SAVED = {"saved": False}
"""Metadata of a dataclass field that follows from the others or is made anew; it needs a default."""

_DOUBLE, _SIZE = struct.Struct("<d"), struct.Struct("<I")
_MOST_AXES = 8
_MOST_SPREAD = 1000  # items of memory an item of an array may take
_C, _F, _STRIDED = range(3)
_DTYPES = (np.float64, np.float32, np.int64, np.bool_)
_LISTS: Mapping[Any, Callable[[list[Any]], Any]] = {
    list: list,
    collections.deque: collections.deque,
    collections.abc.Sequence: tuple,
}
_Value = TypeVar("_Value")
_Write = Callable[[bytearray, Any], None]
_Read = Callable[["_Source"], Any]


class StateError(ValueError):
    """Bytes that are no state of the expected type; one clause."""


class Named(NamedTuple):
    """Objects of the program that are written by their names: ``name`` of one, and all of them ``by_name``."""

    name: Callable[[Any], str]
    by_name: Mapping[str, Any]


class _Plan(NamedTuple):
    layout: str
    write: _Write
    read: _Read


class _Source:
    """Bytes that are read from the front."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = memoryview(data), 0

    def take(self, size: int) -> memoryview:
        end = self._at + size
        if end > len(self._data):
            raise StateError("the saved state ends too early; the file is cut off")
        part, self._at = self._data[self._at : end], end
        return part

    def size(self) -> int:
        return int(_SIZE.unpack(self.take(_SIZE.size))[0])

    def count(self) -> int:
        """How many entries follow; each takes a byte at least, or there are none to speak of."""
        many = self.size()
        if many > len(self._data):
            raise StateError("the saved state does not match its declared type")
        return many

    def text(self) -> str:
        try:
            return str(self.take(self.size()), "utf-8")
        except UnicodeDecodeError:
            raise StateError("the saved state does not match its declared type") from None

    def end(self) -> None:
        if self._at != len(self._data):
            raise StateError("the saved state is longer than its declared type")


class Codec:
    """Writes and reads values of declared types.

    Args:
        named: objects that the program has and a state only names, by their class.
    """

    def __init__(self, named: Mapping[type, Named] | None = None) -> None:
        self._named = named or {}
        self._plans: dict[Any, _Plan] = {}

    def layout(self, kind: Any) -> str:
        """All names and types that values of a type are written by.

        Raises:
            TypeError: a type that cannot be saved.
        """
        return self._plan(kind).layout

    def encode(self, kind: Any, value: Any) -> bytes:
        """A value of the declared type as bytes.

        Raises:
            TypeError: a value that is not of the type it is declared to be.
        """
        out = bytearray()
        self._plan(kind).write(out, value)
        return bytes(out)

    def decode(self, kind: type[_Value], data: bytes) -> _Value:
        """The value that ``encode`` wrote.

        Raises:
            StateError: bytes of something else.
        """
        source = _Source(data)
        try:
            value: _Value = self._plan(kind).read(source)
        except StateError:
            raise
        except (ValueError, TypeError, KeyError, OverflowError, MemoryError) as error:
            raise StateError(f"the saved state does not match its declared type ({error})") from error
        source.end()
        return value

    def _plan(self, kind: Any) -> _Plan:
        plan = self._plans.get(kind)
        if plan is None:
            plan = self._plans[kind] = self._made(kind)
        return plan

    def _made(self, kind: Any) -> _Plan:
        if kind in self._named:
            return _by_name(kind, self._named[kind])
        if kind in _PLAIN:
            return _PLAIN[kind]
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is np.ndarray:
            return _array(kind, typing.get_args(arguments[1])[0])
        if origin in (Union, types.UnionType):
            return self._union(arguments)
        if origin is Literal:
            return _PLAIN[str]
        if origin is tuple:
            return self._tuple(arguments)
        if origin in (dict, collections.abc.Mapping):
            return self._mapping(*arguments)
        if origin in (set, frozenset):
            return _set(origin, self._plan(arguments[0]))
        if origin in _LISTS:
            return _many(f"{origin.__name__}[{{}}]", self._plan(arguments[0]), _LISTS[origin])
        if isinstance(kind, type):
            return self._class(kind)
        raise TypeError(f"{kind} cannot be saved: declare a plain type")

    def _class(self, kind: type) -> _Plan:
        if issubclass(kind, Enum):
            return _by_name(kind, Named(lambda one: str(one.name), dict(kind.__members__)))
        hints = typing.get_type_hints(kind)
        if dataclasses.is_dataclass(kind):
            saved = [f.name for f in dataclasses.fields(kind) if f.init and f.metadata.get("saved", True)]
        elif issubclass(kind, BaseModel):
            saved = list(kind.model_fields)
        elif issubclass(kind, tuple) and hasattr(kind, "_fields"):
            saved = list(kind._fields)
        else:
            raise TypeError(f"{kind.__qualname__} cannot be saved: it is no dataclass and no named tuple")
        plans = {}
        for name in saved:
            try:
                plans[name] = self._plan(hints[name])
            except TypeError as error:
                raise TypeError(f"{kind.__qualname__}.{name}: {error}") from None
        parts = list(plans.items())

        def write(out: bytearray, value: Any) -> None:
            if type(value) is not kind:
                raise TypeError(f"{value!r:.80} is no {kind.__qualname__}")
            for name, plan in parts:
                plan.write(out, getattr(value, name))

        def read(source: _Source) -> Any:
            return kind(**{name: plan.read(source) for name, plan in parts})

        stored = {
            f.name: f.metadata.get("stored", f.name)
            for f in getattr(kind, "__dataclass_fields__", {}).values()
        }
        inside = ", ".join(f"{stored.get(name, name)}: {plan.layout}" for name, plan in parts)
        return _Plan(f"{getattr(kind, 'stored_name', lambda: kind.__qualname__)()}({inside})", write, read)

    def _union(self, members: tuple[Any, ...]) -> _Plan:
        plans = [self._plan(member) for member in members]
        classes = [typing.get_origin(member) or member for member in members]

        def write(out: bytearray, value: Any) -> None:
            for k, known in enumerate(classes):
                if isinstance(value, known):
                    out.append(k)
                    plans[k].write(out, value)
                    return
            raise TypeError(f"{value!r:.80} is none of {', '.join(c.__name__ for c in classes)}")

        def read(source: _Source) -> Any:
            k = source.take(1)[0]
            if k >= len(plans):
                raise StateError("the saved state does not match its declared type")
            return plans[k].read(source)

        return _Plan(" | ".join(plan.layout for plan in plans), write, read)

    def _tuple(self, arguments: tuple[Any, ...]) -> _Plan:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return _many("tuple[{}, ...]", self._plan(arguments[0]), tuple)
        plans = [self._plan(argument) for argument in arguments]

        def write(out: bytearray, value: Any) -> None:
            for plan, part in zip(plans, value, strict=True):
                plan.write(out, part)

        inside = ", ".join(plan.layout for plan in plans)
        return _Plan(f"tuple[{inside}]", write, lambda source: tuple(plan.read(source) for plan in plans))

    def _mapping(self, key: Any, entry: Any) -> _Plan:
        keys, entries = self._plan(key), self._plan(entry)

        def write(out: bytearray, value: Any) -> None:
            out += _SIZE.pack(len(value))
            for one, part in value.items():
                keys.write(out, one)
                entries.write(out, part)

        def read(source: _Source) -> Any:
            return {keys.read(source): entries.read(source) for _ in range(source.count())}

        return _Plan(f"dict[{keys.layout}, {entries.layout}]", write, read)


def detached(value: Any) -> Any:
    """A copy that no longer changes with the original: lists, dictionaries and dataclasses that can be changed.

    Arrays and frozen dataclasses are taken as they are: nothing changes them in place. Of arrays that are changed the
    caller hands over copies.
    """
    if isinstance(value, dict):
        return {key: detached(part) for key, part in value.items()}
    if isinstance(value, (list, set, collections.deque)):
        return type(value)(detached(part) for part in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        if value.__dataclass_params__.frozen:  # type: ignore[attr-defined]
            return value
        parts = {f.name: detached(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return type(value)(**parts)
    return value


def _by_name(kind: type, named: Named) -> _Plan:
    plain = _PLAIN[str]

    def read(source: _Source) -> Any:
        name = source.text()
        if name not in named.by_name:
            raise StateError(f"there is no {kind.__qualname__} {name:.60}")
        return named.by_name[name]

    return _Plan(f"name of {kind.__qualname__}", lambda out, value: plain.write(out, named.name(value)), read)


def _many(layout: str, plan: _Plan, made: Callable[[list[Any]], Any]) -> _Plan:
    write_one, read_one = plan.write, plan.read

    def write(out: bytearray, value: Any) -> None:
        out += _SIZE.pack(len(value))
        for part in value:
            write_one(out, part)

    def read(source: _Source) -> Any:
        return made([read_one(source) for _ in range(source.count())])

    return _Plan(layout.format(plan.layout), write, read)


def _set(origin: Any, plan: _Plan) -> _Plan:
    """In the order of their bytes: equal sets give equal bytes."""

    def write(out: bytearray, value: Any) -> None:
        out += _SIZE.pack(len(value))
        parts = []
        for part in value:
            one = bytearray()
            plan.write(one, part)
            parts.append(bytes(one))
        out += b"".join(sorted(parts))

    read = _many("", plan, origin).read
    return _Plan(f"{origin.__name__}[{plan.layout}]", write, read)


def _array(kind: Any, scalar: Any) -> _Plan:
    """Arrays with their places in memory: products of the same numbers from other places may round differently."""
    if scalar not in _DTYPES:
        raise TypeError(f"{kind} cannot be saved: declare one of {', '.join(d.__name__ for d in _DTYPES)}")
    dtype = np.dtype(scalar).newbyteorder("<")

    def write(out: bytearray, value: Any) -> None:
        if not isinstance(value, np.ndarray) or value.dtype != dtype:
            raise TypeError(f"an array of {dtype} was declared, not {getattr(value, 'dtype', type(value))}")
        order = _C if value.flags.c_contiguous else _F if value.flags.f_contiguous else _STRIDED
        out.append(value.ndim)
        out.append(order)
        for size in value.shape:
            out += _SIZE.pack(size)
        if order == _STRIDED:
            for stride in value.strides:
                out += _SIZE.pack(stride // dtype.itemsize)  # one that is negative is refused here
        out += value.tobytes("F" if order == _F else "C")

    def read(source: _Source) -> Any:
        axes, order = source.take(2)
        if axes > _MOST_AXES or order > _STRIDED:
            raise StateError("the saved state does not match its declared type")
        shape = tuple(source.size() for _ in range(axes))
        strides = tuple(source.size() for _ in range(axes)) if order == _STRIDED else ()
        flat = np.frombuffer(source.take(prod(shape) * dtype.itemsize), dtype).astype(scalar)
        values = flat.reshape(shape, order="F" if order == _F else "C")
        return _spread(values, strides) if order == _STRIDED else values

    return _Plan(f"array of {np.dtype(scalar).name}", write, read)


def _spread(values: Any, strides: tuple[int, ...]) -> Any:
    """The same values, as many items apart as they were."""
    room = 1 + sum((size - 1) * stride for size, stride in zip(values.shape, strides, strict=True))
    if not 0 < room <= _MOST_SPREAD * max(values.size, 1):
        raise StateError("the saved state does not match its declared type")
    base = np.zeros(room, values.dtype)
    view = np.lib.stride_tricks.as_strided(base, values.shape, [s * values.itemsize for s in strides])
    view[...] = values
    return view


def _write_int(out: bytearray, value: Any) -> None:
    number = int(value)
    data = number.to_bytes(number.bit_length() // 8 + 1, "little", signed=True)
    out.append(len(data))  # an integer of more than 255 bytes is refused here
    out += data


def _write_text(out: bytearray, value: Any) -> None:
    data = value.encode("utf-8")
    out += _SIZE.pack(len(data))
    out += data


def _write_range(out: bytearray, value: Any) -> None:
    for number in (value.start, value.stop, value.step):
        _write_int(out, number)


def _read_int(source: _Source) -> int:
    return int.from_bytes(source.take(source.take(1)[0]), "little", signed=True)


def _read_float(source: _Source) -> float:
    return float(_DOUBLE.unpack(source.take(_DOUBLE.size))[0])


_PLAIN: Mapping[Any, _Plan] = {
    type(None): _Plan("None", lambda out, value: None, lambda source: None),
    bool: _Plan("bool", lambda out, value: out.append(bool(value)), lambda source: bool(source.take(1)[0])),
    int: _Plan("int", _write_int, _read_int),
    float: _Plan("float", lambda out, value: out.extend(_DOUBLE.pack(value)), _read_float),
    str: _Plan("str", _write_text, lambda source: source.text()),
    range: _Plan("range", _write_range, lambda source: range(*(_read_int(source) for _ in range(3)))),
}
