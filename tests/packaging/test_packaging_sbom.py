"""The bill of materials names what the program needs and nothing of where it was made; licences are listed."""

import importlib.util
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def tool() -> Iterator[ModuleType]:
    """``tools/sbom.py``, which finds ``tools/install.py`` beside it."""
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        spec = importlib.util.spec_from_file_location("wingwatch_sbom", ROOT / "tools" / "sbom.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        yield module
    finally:
        sys.path.remove(str(ROOT / "tools"))


def component(name: str, *licences: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"bom-ref": f"{name}==1", "name": name, "version": "1", "licenses": list(licences), **more}


def bill() -> dict[str, Any]:
    return {
        "metadata": {"component": {"bom-ref": "root", "name": "wingwatch"}},
        "components": [
            component(
                "NumPy", {"expression": "BSD-3-Clause AND MIT"}, properties=[{"name": "x", "value": "y"}]
            ),
            component("fastapi", {"license": {"id": "MIT"}}),
            component("starlette", {"license": {"name": "License :: OSI Approved :: BSD License"}}),
            component("pytest", {"license": {"id": "MIT"}}),
        ],
        "dependencies": [
            {"ref": "root", "dependsOn": []},
            {"ref": "fastapi==1", "dependsOn": ["starlette==1", "pytest==1"]},
            {"ref": "NumPy==1"},
            {"ref": "pytest==1", "dependsOn": ["fastapi==1"]},
        ],
    }


def test_only_what_the_program_needs_is_named(tool: ModuleType) -> None:
    found = tool.select_components(bill(), {"numpy", "fastapi"}, {"numpy", "fastapi", "starlette"}, "9.8")
    assert [c["name"] for c in found["components"]] == ["NumPy", "fastapi", "starlette"]
    assert found["metadata"]["component"]["version"] == "9.8"
    assert {one["ref"]: one["dependsOn"] for one in found["dependencies"]} == {
        "NumPy==1": [],
        "fastapi==1": ["starlette==1"],
        "root": ["NumPy==1", "fastapi==1"],
    }
    assert "properties" not in found["components"][0]
    with pytest.raises(tool.BillError, match="not installed are scipy"):
        tool.select_components(bill(), {"scipy"}, {"scipy"}, "1")


def test_the_core_leads_to_no_developer_s_tool(tool: ModuleType) -> None:
    direct, names = tool.runtime_names([])
    assert {"numpy", "fastapi", "prometheus-client"} <= direct < names
    assert "starlette" in names
    assert not {"pytest", "mypy", "psycopg", "cyclonedx-bom"} & names
    assert "psycopg" in tool.runtime_names(["postgres"])[1]
    with pytest.raises(tool.BillError, match="no extra 'nope'"):
        tool.runtime_names(["nope"])


def test_registries_and_places_of_the_machine_are_taken_out(tool: ModuleType) -> None:
    index = "https://" + "py" + "pi.org/project/numpy"
    part = {
        "externalReferences": [{"type": "distribution", "url": index}, {"type": "vcs", "url": "https://a.example"}],
        "description": f"get it from {index}",
        "path": f"{ROOT}/x",
        "cache": "file:///x",
        "kept": ["numpy", 1, None],
    }  # fmt: skip
    assert tool.without_places(part, tool.places()) == {
        "externalReferences": [{"type": "vcs", "url": "https://a.example"}],
        "kept": ["numpy", 1],
    }
    assert not tool.places().search("pkg:" + "py" + "pi/numpy@1 https://numpy.org")


def test_licences_are_listed_one_a_line(tool: ModuleType) -> None:
    long = {"license": {"name": "The text of a licence " * 20}}
    lines = tool.licence_list(
        {"components": [*bill()["components"], component("odd", long), component("none")]}
    )
    assert lines.splitlines() == [
        "fastapi    1  MIT",
        "none       1  not stated",
        "NumPy      1  BSD-3-Clause AND MIT",
        "odd        1  not stated",
        "pytest     1  MIT",
        "starlette  1  BSD License",
    ]


def test_what_cannot_be_made_is_one_sentence(
    tool: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert tool.main(["--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("wingwatch sbom: cyclonedx-py failed with")
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_bill_of_this_environment(tool: ModuleType, tmp_path: Path) -> None:
    assert tool.main(["--out", str(tmp_path)]) == 0
    text = (tmp_path / "wingwatch.cdx.json").read_text()
    made = json.loads(text)
    assert (made["bomFormat"], made["metadata"]["component"]["name"]) == ("CycloneDX", "wingwatch")
    names = {tool.normalise(c["name"]) for c in made["components"]}
    assert names == tool.runtime_names([])[1]
    pinned = dict(
        re.findall(r"^([a-z0-9-]+)==([^ \\]+)", (ROOT / "constraints.txt").read_text(), re.MULTILINE)
    )
    assert {tool.normalise(c["name"]): c["version"] for c in made["components"]} == {
        n: pinned[n] for n in names
    }
    assert not tool.places().search(text)
    licences = (tmp_path / "licences.txt").read_text()
    assert len(licences.splitlines()) == len(names)
    assert not re.search(r"  not stated$", licences, re.MULTILINE)
    with pytest.raises(tool.BillError, match=r"is not what CycloneDX 1\.\d asks for"):
        tool.check_form({**made, "components": [{"name": "without a type"}]})


def test_make_says_how(tool: ModuleType) -> None:
    makefile = (ROOT / "Makefile").read_text()
    assert re.search(r"^sbom: python +## .*CycloneDX", makefile, re.MULTILINE)
    assert "tools/sbom.py" in makefile
