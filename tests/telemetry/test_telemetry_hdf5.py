"""MATLAB 7.3 files, which are HDF5 behind a header of MATLAB's own."""

import builtins
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wingwatch.telemetry import TableError, read_table

h5py = pytest.importorskip("h5py")

HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024 HDF5 schema 1.00 ."


def write(path: Path, variables: Mapping[str, Any]) -> Path:
    """As MATLAB writes them: matrices turned, text as numbers, structs as groups, 512 bytes of its own in front."""
    with h5py.File(path, "w", userblock_size=512) as file:
        _put(file, variables)
    with path.open("r+b") as raw:
        raw.write(HEADER.ljust(128))
    return path


def _put(group: Any, variables: Mapping[str, Any]) -> None:
    for name, value in variables.items():
        if isinstance(value, Mapping):
            _put(group.create_group(name), value)
        elif isinstance(value, str):
            data = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype=np.uint16))
            data.attrs["MATLAB_class"] = np.bytes_("char")
        else:
            data = group.create_dataset(name, data=np.atleast_2d(value).T)
            data.attrs["MATLAB_class"] = np.bytes_("double")


def test_a_struct_of_vectors_is_a_table_and_the_rest_is_listed(tmp_path: Path) -> None:
    q = np.random.default_rng(1).normal(size=5)
    path = write(
        tmp_path / "log.dat",
        {
            "flight": {"time": np.arange(5.0)[:, None], "q": q[None, :], "name": "thor", "inner": {"h": np.ones(5)}},
            "#refs#": {"a": np.arange(5.0)},
            "slow": np.arange(3.0), "mass": 2.5, "matrix": np.arange(1.0, 11.0).reshape(5, 2),
        },
    )  # fmt: skip
    table = read_table(path)
    assert table.format == "matlab"
    assert sorted(table.columns) == ["h", "matrix[0]", "matrix[1]", "q", "time"]
    assert table.columns["matrix[1]"].tolist() == [2.0, 4.0, 6.0, 8.0, 10.0]
    assert table.columns["q"].tolist() == q.tolist()
    assert table.columns["time"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert sorted(table.ignored) == [
        "mass (scalar)",
        "name (no numbers)",
        "slow (3 values)",
    ]


def test_fields_of_one_name_in_two_structs_keep_the_structs_name(tmp_path: Path) -> None:
    path = write(
        tmp_path / "log.mat", {"imu": {"q": np.arange(4.0)}, "nav": {"q": -np.arange(4.0), "h": np.ones(4)}}
    )
    assert sorted(read_table(path).columns) == ["h", "imu.q", "nav.q"]


def test_truncated_damaged_and_empty_files_are_said(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mat", {"q": np.random.default_rng(1).normal(size=500)})
    whole = path.read_bytes()
    for length in (130, 600, 1200, len(whole) // 2):
        path.write_bytes(whole[:length])
        with pytest.raises(TableError, match=r"log.mat: the HDF5 file is truncated or damaged"):
            read_table(path)
    with pytest.raises(TableError, match="holds no vector of numbers"):
        read_table(write(tmp_path / "none.mat", {"mass": 1.0, "name": "thor"}))


def test_without_the_library_the_sentence_names_both_ways_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "log.mat", {"q": np.arange(5.0)})
    real = builtins.__import__

    def without(module: str, *rest: Any, **named: Any) -> Any:
        if module == "h5py":
            raise ImportError(module)
        return real(module, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(TableError, match=r"install wingwatch with its extra logs.*-v7"):
        read_table(path)
