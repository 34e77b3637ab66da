"""The import contracts hold for the tree, and each of them notices the breach that it is there for."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Runs the contracts over the package in a folder."""
    return subprocess.run(
        [str(Path(sys.executable).parent / "lint-imports"), "--no-cache"],
        cwd=folder,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


def broken(output: str) -> set[str]:
    """Names of the contracts that a run reports as broken."""
    return set(re.findall(r"^(.+?) BROKEN", output, re.MULTILINE))


def test_the_tree_keeps_every_contract() -> None:
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout
    assert "0 broken" in done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package and its contracts, with the links resolved."""
    target = tmp_path_factory.mktemp("contracts")
    shutil.copytree(ROOT / "wingwatch", target / "wingwatch", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", target)
    return target


@pytest.mark.parametrize(
    ("place", "breach", "contract"),
    [
        ("aircraft", "import wingwatch.monitor", "layers, never upwards"),
        ("estimators", "import wingwatch.baselines", "layers, never upwards"),
        ("monitor", "import wingwatch.api", "layers, never upwards"),
        ("monitor", "import wingwatch.simulation", "nothing on the live path sees the simulation's truth"),
        ("api", "import wingwatch.simulation", "nothing on the live path sees the simulation's truth"),
        ("simulation", "import wingwatch.estimators", "simulation knows only aircraft and the sample"),
        ("simulation", "import wingwatch.telemetry.maps", "simulation knows only aircraft and the sample"),
        ("estimators", "import time", "numbers come from no web, no network, no clock and no log"),
        ("baselines", "import logging", "numbers come from no web, no network, no clock and no log"),
        ("aircraft", "import zenoh", "numbers come from no web, no network, no clock and no log"),
        ("monitor", "import sqlalchemy.orm", "only the database's own modules speak SQL"),
        ("baselines", "import sqlite3", "only the database's own modules speak SQL"),
    ],
)
def test_a_breach_is_noticed(copy: Path, place: str, breach: str, contract: str) -> None:
    stranger = copy / "wingwatch" / place / "stranger.py"
    stranger.write_text(f"{breach}\n")
    try:
        done = lint(copy)
    finally:
        stranger.unlink()
    assert done.returncode == 1
    assert contract in broken(done.stdout)


def test_one_estimator_that_imports_another_is_noticed(copy: Path) -> None:
    fourier = copy / "wingwatch" / "estimators" / "fourier" / "estimator.py"
    text = fourier.read_text()
    fourier.write_text(f"{text}\nimport wingwatch.estimators.ekf.estimator\n")
    try:
        done = lint(copy)
    finally:
        fourier.write_text(text)
    assert "one estimator does not import another" in broken(done.stdout)


def test_a_package_without_a_place_in_the_layers_is_noticed(copy: Path) -> None:
    stranger = copy / "wingwatch" / "stranger"
    stranger.mkdir()
    (stranger / "__init__.py").write_text("")
    try:
        done = lint(copy)
    finally:
        shutil.rmtree(stranger)
    assert "layers, never upwards" in broken(done.stdout)
