"""HDF5 files, MATLAB's version 7.3 among them: what they hold is sorted as that of MATLAB's earlier versions."""

from io import BytesIO
from typing import Any

from wingwatch.telemetry.tables.matlab_file import table_of
from wingwatch.telemetry.tables.raw_table import RawTable, TableError

__all__ = ["read_hdf5"]

_MOST_DEPTH = 4
_MOST_LEAVES = 10_000


def read_hdf5(source: str, data: bytes) -> RawTable:
    """Every vector and matrix of numbers of the common length, at the top or in groups, named as by ``read_matlab``.

    Raises:
        TableError: the library is not installed, the file is damaged, or it holds no vector of numbers.
    """
    try:
        import h5py
    except ImportError:
        raise TableError(
            f"{source}: MATLAB 7.3 (HDF5) files need h5py, which is not installed; install wingwatch with its extra "
            "logs, or save the file again with save(..., '-v7')"
        ) from None
    leaves: list[tuple[str, Any]] = []
    try:
        with h5py.File(BytesIO(data), "r") as file:
            _collect(file, "", 0, leaves)
    except Exception as problem:  # a damaged file makes the library raise almost anything
        reason = " ".join(str(problem).split())[:120]
        raise TableError(
            f"{source}: the HDF5 file is truncated or damaged ({reason}); copy it again"
        ) from None
    return table_of(source, leaves, what="HDF5")


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
    """Numbers as an array, turned back; None for what is none. Text is numbers to HDF5, and MATLAB says which."""
    kind = data_set.attrs.get("MATLAB_class", b"")
    if kind == b"char" or data_set.dtype.kind not in "biuf":
        return None
    value = data_set[()]
    return value.T if hasattr(value, "T") else value
