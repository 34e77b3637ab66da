"""What numba has compiled is kept until something that went into it has changed.

numba's cache asks whether the source file of a kernel is as it was. A kernel has in it the kernels that it calls and
the constants that it names, and those stand in other files: after an update it would run yesterday's code of theirs.
Here a kernel's place in the cache goes by all of them.
"""

import hashlib
import pickle
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile

__all__ = ["KernelCache", "contents_of"]

_OURS = "wingwatch."
_COMPILED_BY = b"".join(
    hashlib.sha256((Path(__file__).parent / name).read_bytes()).digest()
    for name in ("by_address.py", "decorators.py", "pieces.py", "rows.py")
)
"""What decides how every kernel is compiled."""
_digests: dict[int, tuple[FunctionType, bytes]] = {}
"""By the identity of a function, which is held so that nothing else gets it."""


class KernelCache(FunctionCache):
    """numba's cache of one kernel, for ``Dispatcher._cache``; numba 0.68 has these two methods."""

    def __init__(self, function: FunctionType) -> None:
        super().__init__(function)
        self._function = function
        self._cache_file.__class__ = _Index

    def _index_key(self, signature: Any, codegen: Any) -> Any:
        signature, processor, own = super()._index_key(signature, codegen)
        return signature, processor, (*own, contents_of(self._function).hex())


class _Index(IndexDataCacheFile):
    """Its files: what cannot be read any more is as good as absent, and what has been replaced is not kept."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except _UNREADABLE:
            return {}

    def _load_data(self, name: str) -> Any:
        try:
            return super()._load_data(name)
        except _UNREADABLE as problem:
            raise OSError(str(problem)) from None  # as of a file that is gone: it is compiled anew

    def _save_index(self, overloads: Any) -> None:
        kept = overloads
        if overloads:
            newest = next(reversed(overloads))
            kept = {key: name for key, name in overloads.items() if key == newest or key[:2] != newest[:2]}
        super()._save_index(kept)


_UNREADABLE = (
    pickle.UnpicklingError,
    AttributeError,
    ImportError,
    EOFError,
    IndexError,
    TypeError,
    ValueError,
)
"""What pickle raises where a file is cut off, or names a class that an update has moved."""


def contents_of(function: FunctionType) -> bytes:
    """Digest of all that is compiled into a kernel: its code, the functions that it calls, the constants that it names.

    Names are followed within wingwatch; numpy and numba have the version that numba's own cache asks for.
    """
    known = _digests.get(id(function))
    if known is not None:
        return known[1]
    found: dict[int, FunctionType] = {}
    digest = hashlib.sha256(_COMPILED_BY)
    _gather(function, found, digest)
    _digests[id(function)] = function, digest.digest()
    return digest.digest()


def _gather(function: FunctionType, found: dict[int, FunctionType], digest: Any) -> None:
    """Every function is taken in once, in the order in which it is first named."""
    if id(function) in found:
        return
    found[id(function)] = function
    _take_code(function.__code__, digest)
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    values = {
        name: function.__globals__[name] for name in _names(function.__code__) if name in function.__globals__
    }
    for name, value in (*sorted(values.items()), *enumerate(cells)):
        digest.update(f"\0{name}=".encode())
        _take_value(value, found, digest)


def _take_code(code: CodeType, digest: Any) -> None:
    """What the function does, not where it stands."""
    digest.update(code.co_code)
    for names in (code.co_names, code.co_varnames, code.co_freevars):
        digest.update(repr(names).encode())
    for number, constant in enumerate(code.co_consts):
        if isinstance(constant, CodeType):
            _take_code(constant, digest)
        elif number or not isinstance(constant, str):  # the first one is the docstring
            digest.update(_written(constant).encode())


def _written(value: Any) -> str:
    """The same text in every process: a set of words has another order in each."""
    if isinstance(value, (set, frozenset)):
        return "{" + ", ".join(sorted(map(_written, value))) + "}"
    if isinstance(value, tuple):
        return "(" + ", ".join(map(_written, value)) + ")"
    return repr(value)


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _take_value(value: Any, found: dict[int, FunctionType], digest: Any) -> None:
    inner = getattr(value, "py_func", value)
    if isinstance(inner, FunctionType) and (inner.__module__ or "").startswith(_OURS):
        options = getattr(value, "targetoptions", {})
        digest.update(repr(sorted((name, _written(option)) for name, option in options.items())).encode())
        _gather(inner, found, digest)
    elif isinstance(value, ModuleType):
        digest.update(value.__name__.encode())
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    elif isinstance(value, type) and hasattr(value, "_fields"):
        digest.update(repr(value._fields).encode())
    elif isinstance(value, tuple):
        for part in value:
            _take_value(part, found, digest)
    elif isinstance(value, (int, float, complex, str, bytes, bool, np.generic, type(None))):
        digest.update(repr(value).encode())
    else:
        digest.update(getattr(value, "__qualname__", type(value).__qualname__).encode())
