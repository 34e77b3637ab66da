"""constraints.txt pins everything with hashes, names no address, and divides into sound subsets."""

import importlib.metadata
import importlib.util
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
CONSTRAINTS = (ROOT / "constraints.txt").read_text()
PYPROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())
EXTRAS = sorted(PYPROJECT["project"]["optional-dependencies"])
DEVELOPERS_TOOLS = {
    "pytest",
    "mypy",
    "ruff",
    "hypothesis",
    "import-linter",
    "pip-tools",
    "grpcio-tools",
    "httpx",
}


def load_install() -> ModuleType:
    """tools/install.py as a module: it is no part of the package."""
    spec = importlib.util.spec_from_file_location("wingwatch_install", ROOT / "tools" / "install.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


install = load_install()


def names(*extras: str) -> set[str]:
    """Names of the pins that these extras take, the core among them."""
    return {
        p.name
        for p in install.select(install.read_pins(CONSTRAINTS), install.wanted_names(PYPROJECT, extras))
    }


def test_every_line_is_a_pin_a_hash_or_a_note() -> None:
    pin = re.compile(r"[a-z0-9][a-z0-9._-]*==[0-9][0-9A-Za-z.+!]*( ; .+)? \\")
    digest = re.compile(r"    --hash=sha256:[0-9a-f]{64}( \\)?")
    note = re.compile(r"( {4})?#.*")
    odd = [
        line
        for line in CONSTRAINTS.splitlines()
        if not (pin.fullmatch(line) or digest.fullmatch(line) or note.fullmatch(line) or not line)
    ]
    assert not odd


def test_every_pin_has_a_hash_and_stands_once() -> None:
    pins = install.read_pins(CONSTRAINTS)
    assert (
        len(pins) == len({pin.name for pin in pins}) == len(re.findall(r"^\S+==", CONSTRAINTS, re.MULTILINE))
    )
    assert all("--hash=sha256:" in pin.text for pin in pins)


def test_no_address_and_no_pip_option_is_named() -> None:
    assert "://" not in CONSTRAINTS
    assert not re.search(r"(index-url|find-links|trusted-host|file:/|@ )", CONSTRAINTS)


def test_all_extras_together_take_every_pin() -> None:
    assert names(*EXTRAS) == {pin.name for pin in install.read_pins(CONSTRAINTS)}


def test_the_core_takes_no_developers_tool_and_no_extra() -> None:
    core = names()
    assert {"numpy", "eclipse-zenoh", "fastapi", "hatchling"} <= core
    assert not core & (DEVELOPERS_TOOLS | {"psycopg", "psycopg-binary"})
    assert names("dev") >= DEVELOPERS_TOOLS
    assert names("postgres") - core >= {"psycopg", "psycopg-binary"}


@pytest.mark.parametrize("extras", [(), ("dev",)])
def test_a_subset_holds_all_that_its_packages_require(extras: tuple[str, ...]) -> None:
    taken = names(*extras)
    for name in taken:
        try:
            requires = importlib.metadata.requires(name) or []
        except importlib.metadata.PackageNotFoundError:
            pytest.fail(f"{name} is pinned and wanted, but not installed: run make test, which sets up first")
        for requirement in map(Requirement, requires):
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                assert install.normalise(requirement.name) in taken, f"{name} requires {requirement}"


def test_what_is_installed_is_what_is_pinned() -> None:
    pins = dict(re.findall(r"^([^\s=]+)==([^\s;]+)", CONSTRAINTS, re.MULTILINE))
    different = {
        name: (importlib.metadata.version(name), pins[name])
        for name in names("dev")
        if importlib.metadata.version(name) != pins[name]
    }
    assert not different


def test_the_python_that_setup_asks_for_is_the_packages() -> None:
    needed = ".".join(str(part) for part in install.MINIMUM_PYTHON)
    assert PYPROJECT["project"]["requires-python"] == f">={needed}"


def test_a_requirement_without_a_pin_is_one_sentence() -> None:
    with pytest.raises(install.SetupError, match=r"constraints\.txt pins no left-pad: run make constraints"):
        install.select(install.read_pins(CONSTRAINTS), ["numpy", "Left_Pad"])


def test_an_unknown_extra_names_those_there_are() -> None:
    with pytest.raises(
        install.SetupError,
        match=r"no extra 'plots': choose among dask, dev, docs, jsbsim, logs, notify, plot, postgres",
    ):
        install.wanted_names(PYPROJECT, ["plots"])


def test_notes_of_either_style_are_read() -> None:
    text = "\n".join(
        [
            "# made by",
            "a==1 \\",
            "    --hash=sha256:00",
            "    # via b, wingwatch (pyproject.toml)",
            "Big_B==2 ; python_version < '4' \\",
            "    --hash=sha256:01",
            "    # via",
            "    #   c",
            "    #   d",
            "",
            "# unsafe:",
            "c==3 \\",
            "    --hash=sha256:02",
        ]
    )
    pins = install.read_pins(text)
    assert [(p.name, set(p.via)) for p in pins] == [
        ("a", {"b", "wingwatch"}),
        ("big-b", {"c", "d"}),
        ("c", set()),
    ]
    assert "unsafe" not in "".join(p.text for p in pins)
    assert [p.name for p in install.select(pins, ["C"])] == ["big-b", "c"]
