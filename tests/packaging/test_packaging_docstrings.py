"""Docstrings of public functions state shapes of arrays and units of numbers (``tools/docstrings.py``)."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]

LEAST = {
    "estimators": (0.75, 0.68),
    "monitor": (1.0, 0.92),
    "baselines": (1.0, 0.96),
    "input_design": (1.0, 1.0),
}
"""Fractions of public functions with shapes and with units, as reached: raise them with each improvement."""


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("wingwatch_docstrings", ROOT / "tools" / "docstrings.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("package", LEAST)
def test_public_functions_state_shapes_and_units(tool: ModuleType, package: str) -> None:
    found = tool.measured(package)
    without_shapes = [one.where for one in found if one.arrays and not one.shapes]
    without_units = [one.where for one in found if one.numbers and not one.units]
    shapes, units = LEAST[package]
    assert len(without_shapes) <= (1.0 - shapes) * sum(one.arrays for one in found), without_shapes
    assert len(without_units) <= (1.0 - units) * sum(one.numbers for one in found), without_units


def test_a_docstring_without_shape_or_unit_is_found(
    tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    module = tmp_path / "module.py"
    module.write_text(
        '__all__ = ["bad", "good"]\n\n'
        'def bad(x: Array) -> float:\n    """The largest of them."""\n\n'
        'def good(x: Array) -> float:\n    """The largest of x (n,), in m/s."""\n'
    )
    bad, good = tool.documented(module)
    assert (bad.shapes, bad.units) == (False, False)
    assert (good.shapes, good.units) == (True, True)
