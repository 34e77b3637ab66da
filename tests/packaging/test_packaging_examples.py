"""The example of every public package runs, as does the one in ``diagnose``."""

import doctest
import importlib
from types import ModuleType

import pytest

PACKAGES = (
    "aircraft", "telemetry", "simulation", "estimators", "baselines", "input_design", "monitor", "diagnosis", "studies",
)  # fmt: skip


def run(module: ModuleType) -> tuple[int, list[str]]:
    """How many statements the examples of a module have, and what went wrong."""
    complaints: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    count = 0
    for found in doctest.DocTestFinder(exclude_empty=True).find(module):
        count += len(found.examples)
        runner.run(found, out=complaints.append)
    return count, complaints


@pytest.mark.parametrize("name", PACKAGES)
def test_the_example_of_a_package_runs(name: str) -> None:
    count, complaints = run(importlib.import_module(f"wingwatch.{name}"))
    assert not complaints, "".join(complaints)
    assert count >= 3


@pytest.mark.slow
def test_the_example_of_diagnose_runs() -> None:
    count, complaints = run(importlib.import_module("wingwatch.diagnosis.diagnose"))
    assert not complaints, "".join(complaints)
    assert count >= 6
