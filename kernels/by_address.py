"""Named tuples of arrays that a kernel is given by their address.

To numba a tuple is a value: an array in it is seven numbers, and a state of 45 arrays three hundred, which every kernel
copies that it is handed on to. LLVM takes each copy apart, in a time that grows faster than their number. ``ByAddress``
writes once where the arrays lie and how long they are, and a kernel is given the address of that. It reads from there
what it uses: ``state.theta`` in a kernel is the same array as in Python.

Of a state whose arrays lead with the vehicle axis ``one_vehicle(state, i)`` is the state of vehicle i.

Tuples within the tuple are by address, too, but for those of at most four arrays: kernels make such tuples themselves
(``Memory``, ``Linearisation``), and a kernel is compiled once for both.

Written on numba's extension interface (``numba.extending``), as its manual has it for types of one's own.

Example:
    >>> from typing import NamedTuple
    >>> import numpy as np
    >>> from numba import njit
    >>> class Filter(NamedTuple):
    ...     level: np.ndarray
    ...     gain: float
    >>> @njit
    ... def follow(state, reading):
    ...     state.level[0] += state.gain * (reading - state.level[0])
    >>> state = Filter(np.zeros(1), 0.25)
    >>> follow(ByAddress(state), 8.0)
    >>> float(state.level[0])
    2.0
"""

import hashlib
from typing import Any, ClassVar

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.pythonapi import NativeValue
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import make_array, populate_array

__all__ = ["ByAddress", "one_vehicle"]

_BY_VALUE = 4
_WORD = ir.IntType(64)


class ByAddress:
    """A named tuple of C-contiguous arrays, numbers and such tuples, as kernels take it.

    Args:
        named: the tuple; its arrays stay where they are as long as this is used.

    Raises:
        ValueError: an array that is not contiguous.
    """

    __slots__ = ("_numba_type_", "_words", "address", "named")

    _kinds: ClassVar[dict[tuple[Any, ...], Any]] = {}

    def __init__(self, named: Any) -> None:
        words: list[int] = []
        form: list[Any] = [type(named)]
        _describe(named, words, form)
        key = tuple(form)
        kind = self._kinds.get(key)
        if kind is None:
            kind = self._kinds[key] = _Structure(typeof(named))
        self.named = named
        self._words = np.array(words, dtype=np.int64)
        self.address = self._words.ctypes.data
        self._numba_type_ = kind


def _describe(value: Any, words: list[int], form: list[Any]) -> None:
    """Adds what a field is to ``form``, and to ``words`` what is written of it: of an array where it lies and its
    shape; of a number its bits."""
    if isinstance(value, tuple):
        for part in value:
            _describe(part, words, form)
    elif isinstance(value, np.ndarray):
        if not value.flags.c_contiguous:
            raise ValueError(
                f"an array of shape {value.shape} is not contiguous: copy it before a kernel is given it"
            )
        words.append(value.__array_interface__["data"][0])
        words.extend(value.shape)
        form.append((value.ndim, value.dtype.char))
    else:
        words.append(int(np.float64(value).view(np.int64)) if isinstance(value, float) else int(value))
        form.append(type(value))


class _Structure(types.Type):
    """A named tuple by its address."""

    def __init__(self, of: Any) -> None:
        self.of = of
        super().__init__(name=f"ByAddress({_short_name(of)})")


class _Vehicle(types.Type):
    """One place on the leading axis of all arrays of a structure."""

    def __init__(self, of: Any) -> None:
        self.of = of
        super().__init__(name=f"OneVehicle({_short_name(of)})")


def _short_name(of: Any) -> str:
    """A name that tells kinds apart: numba writes it into the name of every kernel that takes one."""
    return f"{of.instance_class.__name__}:{hashlib.sha256(str(of).encode()).hexdigest()[:16]}"


@register_model(_Structure)
class _StructureModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _WORD.as_pointer())


@register_model(_Vehicle)
class _VehicleModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("all", _Structure(kind.of)), ("place", types.intp)])


def _length(kind: Any) -> int:
    """How many words are written of a field."""
    if isinstance(kind, types.Array):
        return int(1 + kind.ndim)
    return sum(_length(part) for part in kind) if isinstance(kind, types.BaseTuple) else 1


def _field(of: Any, name: str) -> tuple[int, Any]:
    """Where a field's words begin, and its kind."""
    place = of.fields.index(name)
    return sum(_length(kind) for kind in list(of)[:place]), list(of)[place]


def _is_by_address(kind: Any) -> bool:
    if not isinstance(kind, types.BaseTuple):
        return False
    return len(kind) > _BY_VALUE or not all(isinstance(part, types.Array) for part in kind)


def _of_one(kind: Any) -> Any:
    """The kind without the leading axis of its arrays."""
    if isinstance(kind, types.Array):
        return kind.copy(ndim=kind.ndim - 1)
    return types.NamedTuple([_of_one(part) for part in kind], kind.instance_class)


@infer_getattr
class _StructureFields(AttributeTemplate):
    key = _Structure

    def generic_resolve(self, structure: Any, name: str) -> Any:
        if name not in structure.of.fields:
            return None
        kind = _field(structure.of, name)[1]
        return _Structure(kind) if _is_by_address(kind) else kind


@infer_getattr
class _VehicleFields(AttributeTemplate):
    key = _Vehicle

    def generic_resolve(self, vehicle: Any, name: str) -> Any:
        if name not in vehicle.of.fields:
            return None
        kind = _field(vehicle.of, name)[1]
        return _Vehicle(kind) if _is_by_address(kind) else _of_one(kind)


def _word(builder: Any, structure: Any, place: int) -> Any:
    """One word, which never changes as long as the structure lives: LLVM need not read it again."""
    read = builder.load(_at(builder, structure, place))
    read.set_metadata("invariant.load", builder.module.add_metadata([]))
    return read


def _at(builder: Any, structure: Any, place: int) -> Any:
    return builder.gep(structure, [ir.Constant(ir.IntType(32), place)], inbounds=True)


def _read(context: Any, builder: Any, kind: Any, structure: Any, first: int, vehicle: Any = None) -> Any:
    """The field whose words begin at ``first``; of its arrays the element ``vehicle`` of the leading axis, if given."""
    if isinstance(kind, types.BaseTuple):
        parts, at = [], first
        for part in kind:
            parts.append(_read(context, builder, part, structure, at, vehicle))
            at += _length(part)
        return context.make_tuple(builder, kind if vehicle is None else _of_one(kind), parts)
    if isinstance(kind, types.Array):
        return _read_array(context, builder, kind, structure, first, vehicle)
    word = _word(builder, structure, first)
    if isinstance(kind, types.Boolean):
        return builder.icmp_unsigned("!=", word, _WORD(0))
    return builder.bitcast(word, ir.DoubleType()) if isinstance(kind, types.Float) else word


def _read_array(context: Any, builder: Any, kind: Any, structure: Any, first: int, vehicle: Any) -> Any:
    element = context.get_data_type(kind.dtype)
    itemsize = context.get_abi_sizeof(element)
    shape = [_word(builder, structure, first + 1 + axis) for axis in range(kind.ndim)]
    strides = [_WORD(itemsize)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length, flags=["nsw"]))
    data = _word(builder, structure, first)
    if vehicle is not None:
        data = builder.add(data, builder.mul(vehicle, strides[0]))
        kind, shape, strides = _of_one(kind), shape[1:], strides[1:]
    array = make_array(kind)(context, builder)
    populate_array(
        array,
        data=builder.inttoptr(data, element.as_pointer()),
        shape=cgutils.pack_array(builder, shape, ty=_WORD),
        strides=cgutils.pack_array(builder, strides, ty=_WORD),
        itemsize=context.get_constant(types.intp, itemsize),
        meminfo=None,
    )
    return array._getvalue()


@lower_getattr_generic(_Structure)
def _structure_field(context: Any, builder: Any, structure: Any, value: Any, name: str) -> Any:
    first, kind = _field(structure.of, name)
    return _at(builder, value, first) if _is_by_address(kind) else _read(context, builder, kind, value, first)


@lower_getattr_generic(_Vehicle)
def _vehicle_field(context: Any, builder: Any, vehicle: Any, value: Any, name: str) -> Any:
    first, kind = _field(vehicle.of, name)
    pair = cgutils.create_struct_proxy(vehicle)(context, builder, value=value)
    if not _is_by_address(kind):
        return _read(context, builder, kind, pair.all, first, pair.place)
    inner = cgutils.create_struct_proxy(_Vehicle(kind))(context, builder)
    inner.all, inner.place = _at(builder, pair.all, first), pair.place
    return inner._getvalue()


def _one_vehicle(typing_context: Any, structure: Any, place: Any) -> Any:
    vehicle = _Vehicle(structure.of)

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pair = cgutils.create_struct_proxy(vehicle)(context, builder)
        pair.all, pair.place = arguments
        return pair._getvalue()

    return vehicle(structure, types.intp), write


one_vehicle: Any = intrinsic(_one_vehicle)
"""In a kernel: of a structure the part of vehicle ``place``, every array without its leading axis."""


@typeof_impl.register(ByAddress)
def _kind_of(value: ByAddress, context: Any) -> Any:
    return value._numba_type_


@unbox(_Structure)
def _address_of(kind: Any, value: Any, c: Any) -> Any:
    number = c.pyapi.object_getattr_string(value, "address")
    address = c.pyapi.long_as_voidptr(number)
    c.pyapi.decref(number)
    return NativeValue(c.builder.bitcast(address, _WORD.as_pointer()))
