"""Columns of HDF5 files, MATLAB's version 7.3 among them: vectors of numbers at the top or in structs."""

from collections import Counter
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Hdf5Error", "hdf5_columns"]

_MOST_DEPTH = 4
_MOST_LEAVES = 10_000


class Hdf5Error(ValueError):
    """An HDF5 file without columns; one clause."""


def hdf5_columns(data: bytes) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Vectors of the length that most of a file's vectors have.

    Args:
        data: the file.

    Returns:
        Columns by name (a field of a struct by its own name where no other has it, else ``struct.field``), each of
        shape (rows,), float64; and what is no such column, each with the reason.

    Raises:
        Hdf5Error: the library is not installed, the file is damaged, or it holds no vector of numbers.
    """
    try:
        import h5py
    except ImportError:
        raise Hdf5Error(
            "MATLAB 7.3 (HDF5) files need h5py, which is not installed; install wingwatch with its extra logs, or save "
            "the file again with save(..., '-v7')"
        ) from None
    leaves: list[tuple[str, Any]] = []
    try:
        with h5py.File(BytesIO(data), "r") as file:
            _collect(file, "", 0, leaves)
    except Exception as problem:  # a damaged file makes the library raise almost anything
        reason = " ".join(str(problem).split())[:120]
        raise Hdf5Error(f"the HDF5 file is truncated or damaged ({reason}); copy it again") from None
    fields = Counter(name.rpartition(".")[2] for name, _ in leaves)
    vectors: dict[str, NDArray[np.float64]] = {}
    ignored: list[str] = []
    for name, value in leaves:
        field = name.rpartition(".")[2]
        _sort(field if fields[field] == 1 else name, value, vectors, ignored)
    if not vectors:
        raise Hdf5Error("the HDF5 file holds no vector of numbers, alone or in a struct")
    rows = Counter(len(vector) for vector in vectors.values()).most_common(1)[0][0]
    ignored += [f"{name} ({len(v)} values)" for name, v in vectors.items() if len(v) != rows]
    return {name: vector for name, vector in vectors.items() if len(vector) == rows}, ignored


def _collect(group: Any, prefix: str, depth: int, leaves: list[tuple[str, Any]]) -> None:
    """Every data set below a group; MATLAB keeps its own things under names with ``#``."""
    for name in group:
        if name.startswith("#") or len(leaves) >= _MOST_LEAVES:
            continue
        one = group[name]
        if hasattr(one, "shape"):
            leaves.append((prefix + name, _value(one)))
        elif depth < _MOST_DEPTH:
            _collect(one, f"{prefix}{name}.", depth + 1, leaves)


def _value(data_set: Any) -> Any:
    """Numbers as an array; a word for what is none. Text is numbers to HDF5, and MATLAB says which."""
    kind = data_set.attrs.get("MATLAB_class", b"")
    if kind == b"char" or data_set.dtype.kind not in "biuf":
        return "no numbers"
    return data_set[()]


def _sort(name: str, value: Any, vectors: dict[str, NDArray[np.float64]], ignored: list[str]) -> None:
    if isinstance(value, str):
        ignored.append(f"{name} ({value})")
    elif np.size(value) <= 1:
        ignored.append(f"{name} (scalar)")
    elif np.size(value) != max(np.shape(value)):
        ignored.append(f"{name} (matrix {' x '.join(map(str, np.shape(value)[::-1]))})")
    else:
        vectors[name] = np.array(value, dtype=np.float64).reshape(-1)
