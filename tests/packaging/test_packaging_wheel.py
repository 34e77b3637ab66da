"""The wheel holds one import package with real files, and every folder at the top level is linked into it."""

import json
import os
import stat
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest

from wingwatch.service.kernel_wheel import ARCHIVE, pack_kernels

ROOT = Path(__file__).parents[2]
PACKAGES = sorted(p.parent.name for p in ROOT.glob("*/__init__.py") if p.parent.name != "wingwatch")


def files_of_the_tree() -> list[str]:
    """Files of the repository that are tracked or about to be, as relative posix paths."""
    listing = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    if listing.returncode:
        pytest.skip("this is not a git clone, so there is no list of the project's files to compare with")
    return sorted({name for name in listing.stdout.decode().split("\0") if name and (ROOT / name).is_file()})


def build(target: Path, **environment: str) -> Path:
    done = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(target)],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (built,) = target.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def wheel(made_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    (built,) = made_once("wheel", build).glob("*.whl")
    return built


def test_every_package_at_the_top_level_is_linked_relatively() -> None:
    links = {p.name: os.readlink(p) for p in (ROOT / "wingwatch").iterdir() if p.is_symlink()}
    assert links == {name: f"../{name}" for name in PACKAGES}
    assert {"estimators", "monitor", "baselines", "api"} <= set(links)


def test_bare_imports_of_every_package_are_banned() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    banned = settings["tool"]["ruff"]["lint"]["flake8-tidy-imports"]["banned-api"]
    assert sorted(banned) == PACKAGES


def test_nothing_stands_beside_the_one_import_package(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.split("/")[0] for name in archive.namelist()}
    metadata = {top for top in tops if top.endswith(".dist-info")}
    assert len(metadata) == 1
    assert tops - metadata == {"wingwatch"}


def test_the_wheel_holds_every_file_of_the_packages_and_no_other(wheel: Path) -> None:
    expected = {
        name if name.startswith("wingwatch/") else f"wingwatch/{name}"
        for name in files_of_the_tree()
        if name.split("/")[0] in {*PACKAGES, "wingwatch"}
    }
    with zipfile.ZipFile(wheel) as archive:
        inside = {name for name in archive.namelist() if name.startswith("wingwatch/")}
        links = [i.filename for i in archive.infolist() if stat.S_ISLNK(i.external_attr >> 16)]
    assert inside == expected
    assert not links


@pytest.mark.parametrize(
    ("folder", "ending"),
    [
        ("wingwatch/aircraft/library/", ".toml"),
        ("wingwatch/api/pages/", ".html"),
        ("wingwatch/api/pages/", ".css"),
        ("wingwatch/api/pages/", ".js"),
        ("wingwatch/baselines/migrations/versions/", ".py"),
        ("wingwatch/telemetry/logs/ready/", ".toml"),
        ("wingwatch/telemetry/protocol/", "_pb2.py"),
        ("wingwatch/", "py.typed"),
    ],
)
def test_the_wheel_holds_what_is_not_code_too(wheel: Path, folder: str, ending: str) -> None:
    with zipfile.ZipFile(wheel) as archive:
        found = [name for name in archive.namelist() if name.startswith(folder) and name.endswith(ending)]
    assert found


def test_the_wheel_carries_licence_command_and_python_version(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (folder,) = {n.split("/")[0] for n in archive.namelist() if ".dist-info/" in n}
        metadata = archive.read(f"{folder}/METADATA").decode()
        scripts = archive.read(f"{folder}/entry_points.txt").decode()
        licence = archive.read(f"{folder}/licenses/LICENSE").decode()
    assert "License-Expression: MIT" in metadata
    assert "Requires-Python: >=3.11" in metadata
    assert "wingwatch = wingwatch.cli.main:main" in scripts
    assert "wingwatch authors" in licence


def test_a_wheel_with_compiled_kernels_says_what_it_is_for(wheel: Path, tmp_path: Path) -> None:
    """As `make wheel` has it built, of an archive without kernels."""
    package = tmp_path / "package"
    package.mkdir()
    pack_kernels(package, tmp_path / "kernels.zip", "x86-64-v3", ("avx2",))
    switched_on = {
        "WINGWATCH_COMPILED": str(tmp_path / "kernels.zip"),
        "HATCH_BUILD_HOOK_ENABLE_CUSTOM": "true",
    }
    built = build(tmp_path / "dist", **switched_on)
    python = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert built.name.endswith(f"-{python}-{python}-{system}.whl")
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(built) as archive, zipfile.ZipFile(wheel) as plain:
        assert set(archive.namelist()) - set(plain.namelist()) == {f"wingwatch/{ARCHIVE}"}
        (folder,) = {n.split("/")[0] for n in archive.namelist() if ".dist-info/" in n}
        asked = archive.read(f"{folder}/METADATA").decode().splitlines()
        assert "Root-Is-Purelib: false" in archive.read(f"{folder}/WHEEL").decode()
        before = plain.read(f"{folder}/METADATA").decode().splitlines()
    exact = {f"Requires-Dist: {name}=={version(name)}" for name in ("llvmlite", "numba")}
    assert set(asked) - set(before) == exact


def test_the_installed_wheel_imports_from_where_it_was_put(wheel: Path, tmp_path: Path) -> None:
    target = tmp_path / "place with a space"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install"]
    subprocess.run([*pip, "--no-deps", "--no-index", "--target", str(target), str(wheel)], check=True)
    program = (
        "import importlib, json, sys\n"
        "names = ['wingwatch', *('wingwatch.' + n for n in sys.argv[1:])]\n"
        "print(json.dumps([importlib.import_module(n).__file__ for n in names]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *PACKAGES],
        env={**os.environ, "PYTHONPATH": str(target), "NUMBA_CACHE_DIR": str(tmp_path / "compiled")},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    places = [Path(p) for p in json.loads(done.stdout)]
    assert places == [target / "wingwatch" / n / "__init__.py" for n in ["", *PACKAGES]]
