"""The import contracts hold for the tree, and each of them notices the breach that it is there for."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
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


def complaints(output: str) -> dict[str, str]:
    """What a run says of each contract that it reports as broken."""
    _, _, broken = output.partition("Broken contracts")
    found = re.split(r"^(.+)\n-+$", broken, flags=re.MULTILINE)
    return dict(zip(found[1::2], found[2::2], strict=True))


def test_the_tree_keeps_every_contract() -> None:
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout
    assert "0 broken" in done.stdout


BREACHES = (
    ("aircraft", "import wingwatch.monitor", "layers, never upwards"),
    ("estimators", "import wingwatch.baselines", "layers, never upwards"),
    ("monitor", "import wingwatch.api", "layers, never upwards"),
    ("monitor", "import wingwatch.simulation", "nothing on the live path sees the simulation's truth"),
    ("api", "import wingwatch.simulation", "nothing on the live path sees the simulation's truth"),
    ("notifications", "import wingwatch.cli", "layers, never upwards"),
    ("service", "import wingwatch.cli.main", "layers, never upwards"),
    ("operations", "import wingwatch.service.store", "layers, never upwards"),
    ("kernels", "import wingwatch.aircraft", "layers, never upwards"),
    ("monitor/estimation", "import wingwatch.monitor.detection.judge", "rooms of the monitor, never upwards"),
    ("monitor/detection", "import wingwatch.monitor.vehicle.state", "rooms of the monitor, never upwards"),
    ("monitor/vehicle", "import wingwatch.monitor.fleet.roster", "rooms of the monitor, never upwards"),
    (
        "monitor/fleet/member",
        "import wingwatch.monitor.fleet.context",
        "what is known of a vehicle knows no fleet",
    ),
    ("simulation", "import wingwatch.estimators", "simulation knows only aircraft and the sample"),
    ("simulation", "import wingwatch.telemetry.maps", "simulation knows only aircraft and the sample"),
    ("estimators", "import time", "numbers come from no web, no network, no clock and no log"),
    ("baselines", "import logging", "numbers come from no web, no network, no clock and no log"),
    (
        "estimators/fourier",
        "import wingwatch.estimators.ekf.noise",
        "one estimator does not import another",
    ),
    (
        "estimators/ekf",
        "import wingwatch.estimators.offline.window",
        "one estimator does not import another",
    ),
    (
        "estimators/kernels",
        "import wingwatch.estimators.fourier.bank",
        "what estimators share knows none of them",
    ),
    (
        "estimators/plant",
        "import wingwatch.estimators.ekf.noise",
        "what estimators share knows none of them",
    ),
    ("aircraft", "import zenoh", "numbers come from no web, no network, no clock and no log"),
    ("monitor", "import sqlalchemy.orm", "only the database's own modules speak SQL"),
    ("baselines", "import sqlite3", "only the database's own modules speak SQL"),
    (
        "diagnosis",
        "import wingwatch.simulation.effects",
        "what hides an effect and what finds it share no code",
    ),
)
"""A folder, what a module in it imports, and the contract that this breaks."""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package and its contracts, with the links resolved."""
    target = tmp_path_factory.mktemp("contracts")
    shutil.copytree(ROOT / "wingwatch", target / "wingwatch", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", target)
    return target


@pytest.fixture(scope="module")
def said(copy: Path) -> dict[str, str]:
    """What the contracts say where every breach is in the tree at once, each in a module of its own."""
    planted = []
    for number, (place, breach, _) in enumerate(BREACHES):
        planted.append(copy / "wingwatch" / place / f"stranger_{number}.py")
        planted[-1].write_text(f"{breach}\n")
    try:
        done = lint(copy)
    finally:
        for stranger in planted:
            stranger.unlink()
    assert done.returncode == 1
    return complaints(done.stdout)


@pytest.mark.parametrize("number", range(len(BREACHES)), ids=[f"{p}, {b}" for p, b, _ in BREACHES])
def test_a_breach_is_noticed(said: dict[str, str], number: int) -> None:
    place, breach, contract = BREACHES[number]
    stranger = f"wingwatch.{place.replace('/', '.')}.stranger_{number}"
    target = breach.removeprefix("import ").removesuffix(".orm")  # of other packages the outermost is named
    assert f"{stranger} -> {target} (l.1)" in said[contract]


def test_every_contract_has_its_breach(said: dict[str, str]) -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert set(said) == {contract["name"] for contract in settings["tool"]["importlinter"]["contracts"]}


def test_a_package_without_a_place_in_the_layers_is_noticed(copy: Path) -> None:
    stranger = copy / "wingwatch" / "stranger"
    stranger.mkdir()
    (stranger / "__init__.py").write_text("")
    try:
        done = lint(copy)
    finally:
        shutil.rmtree(stranger)
    assert "layers, never upwards" in broken(done.stdout)
