"""Kernels that a wheel brings compiled: taken where they are right and would run, else one sentence and a compiler."""

import importlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba
import pytest

from wingwatch.service import kernel_wheel
from wingwatch.service.kernel_wheel import ARCHIVE, MANIFEST, pack_kernels, take_kernels, take_or_say
from wingwatch.service.kernels import only_load

CPU = "x86-64"
KERNEL = """
from numba import njit

@njit(cache=True)
def twice(x):
    return 2.0 * x
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package as its wheel is built: a kernel that another process compiled for the least that this system needs."""
    package = tmp_path_factory.mktemp("built") / "package"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "inner" / "brought_kernel.py").write_text(KERNEL)
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {"NUMBA_CPU_NAME": CPU, "NUMBA_CPU_FEATURES": "", "PYTHONPATH": str(package / "inner")}
    program = "import brought_kernel; brought_kernel.twice(1.0)"
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=60.0)
    pack_kernels(package, package / ARCHIVE, CPU, ("sse2",))
    shutil.rmtree(package / "inner" / "__pycache__")
    return package


@pytest.fixture
def installed(built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The package in another place, whose folders numba may not write: what is compiled is kept elsewhere."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kept"))
    package = Path(shutil.copytree(built, tmp_path / "place with a space" / "package"))
    monkeypatch.syspath_prepend(str(package / "inner"))
    return package


def kernel() -> Any:
    sys.modules.pop("brought_kernel", None)
    return importlib.import_module("brought_kernel").twice


def has_to_compile() -> bool:
    """Whether numba would have to compile the package's kernel."""
    with only_load() as missing:
        assert kernel()(4.0) == 8.0
    return missing == ["twice"]


def alter(package: Path, **changes: Any) -> None:
    """Let the archive say something else of itself."""
    path = package / ARCHIVE
    with zipfile.ZipFile(path) as packed:
        contents = {name: packed.read(name) for name in packed.namelist()}
    contents[MANIFEST] = json.dumps(json.loads(contents[MANIFEST]) | changes).encode()
    with zipfile.ZipFile(path, "w") as packed:
        for name, data in contents.items():
            packed.writestr(name, data)


def test_a_kernel_that_came_compiled_is_not_compiled_again(installed: Path) -> None:
    assert has_to_compile()
    assert take_kernels(installed) is None
    assert not has_to_compile()


def test_the_archive_says_what_it_was_built_with(built: Path) -> None:
    with zipfile.ZipFile(built / ARCHIVE) as packed:
        said = json.loads(packed.read(MANIFEST))
        names = packed.namelist()
    assert said["numba"] == numba.__version__
    assert said["llvmlite"] == version("llvmlite")
    assert said["features"] == ["sse2"]
    assert sorted(Path(name).suffix for name in names) == [".json", ".nbc", ".nbi"]
    assert all(name == MANIFEST or name.startswith("inner/brought_kernel.twice-") for name in names)


def test_kernels_are_taken_once(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert take_kernels(installed) is None
    monkeypatch.setattr(kernel_wheel, "_lay", lambda *_: pytest.fail("a second time"))
    assert take_kernels(installed) is None


def test_what_an_earlier_version_left_gives_way(installed: Path, tmp_path: Path) -> None:
    kernel()(1.0)
    (own,) = (tmp_path / "kept").rglob("*.nbc")
    assert take_kernels(installed) is None
    with zipfile.ZipFile(installed / ARCHIVE) as packed:
        (brought,) = (packed.read(name) for name in packed.namelist() if name.endswith(".nbc"))
    assert own.read_bytes() == brought
    assert list((tmp_path / "kept").rglob("*.nbc")) == [own]
    assert not has_to_compile()


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ({"features": ["sse2", "avx99", "warp"]}, "this processor has no avx99, warp"),
        ({"numba": "0.1"}, f"they are for numba 0.1, and numba {numba.__version__} is installed"),
        ({"llvmlite": "0.2"}, f"they are for llvmlite 0.2, and llvmlite {version('llvmlite')} is installed"),
        (
            {"python": "3.1"},
            f"they are for Python 3.1, and this is {sys.version_info[0]}.{sys.version_info[1]}",
        ),
    ],
)
def test_kernels_that_would_not_run_here_are_left_and_it_is_said_once(
    installed: Path, said: dict[str, Any], why: str
) -> None:
    alter(installed, **said)
    assert take_kernels(installed) == (
        f"the compiled kernels of this installation are not used ({why}); "
        "they are compiled here, which takes minutes, once"
    )
    assert take_kernels(installed) is None
    assert has_to_compile()
    assert kernel()(3.0) == 6.0


def cut(package: Path) -> None:
    whole = (package / ARCHIVE).read_bytes()
    (package / ARCHIVE).write_bytes(whole[: len(whole) // 2])


def change_another_source(package: Path) -> None:
    """One that the kernel's own file may take a kernel from."""
    (package / "__init__.py").write_text("# changed\n")


@pytest.mark.parametrize(
    ("harm", "why"),
    [(cut, "not a zip file"), (change_another_source, "a source file was changed")],
)
def test_kernels_of_other_sources_and_broken_archives_are_left(
    installed: Path, harm: Callable[[Path], None], why: str
) -> None:
    harm(installed)
    said = take_kernels(installed)
    assert said is not None
    assert why in said
    assert has_to_compile()
    assert kernel()(3.0) == 6.0


def test_an_installation_without_compiled_kernels_has_nothing_to_say(
    installed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (installed / ARCHIVE).unlink()
    assert take_kernels(installed) is None
    take_or_say()  # this one has none, either
    assert capsys.readouterr().err == ""
