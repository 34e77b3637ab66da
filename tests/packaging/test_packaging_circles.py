"""No file needs itself by way of others, and no room does, whenever an import is carried out.

Imports inside functions and those for type checkers alone count like all others: they hide a circle, they do not
break it.
"""

import ast
from collections.abc import Callable, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "wingwatch"

Modules = Mapping[str, Path]


def modules_of(package: Path) -> Modules:
    """Files of a package by module name; a package's own name is that of its ``__init__.py``."""
    found = {}
    for top in sorted(package.iterdir()):
        # the package's folders are links, which a walk from above does not follow
        for path in sorted(top.rglob("*.py")) if top.is_dir() else [top] if top.suffix == ".py" else []:
            parts = (package.name, *path.relative_to(package).with_suffix("").parts)
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def imports_in(text: str) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """All imports of a module's text."""
    return tuple(node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom))


def imported(name: str, modules: Modules) -> set[str]:
    """Modules of the package that a module imports anywhere in its text, but for itself."""
    wanted: set[str] = set()
    for node in imports_in(modules[name].read_text()):
        if isinstance(node, ast.Import):
            wanted.update(alias.name for alias in node.names)
        else:
            assert node.level == 0, f"{name} imports by a relative name"
            whole = [f"{node.module}.{alias.name}" for alias in node.names]
            wanted.update(n if n in modules else str(node.module) for n in whole)
    return (wanted & modules.keys()) - {name}


def room_of(name: str, modules: Modules) -> str:
    """The room that a module is in, where its package has rooms; else the module itself."""
    room = ".".join(name.split(".")[:3])
    return room if room in modules and modules[room].name == "__init__.py" else name


def circle(modules: Modules, node: Callable[[str], str] = str) -> list[str]:
    """One circle of imports between nodes, the first named again at the end; empty where there is none."""
    graph: dict[str, set[str]] = {}
    for name in modules:
        needed = {node(other) for other in imported(name, modules)}
        graph.setdefault(node(name), set()).update(needed - {node(name)})
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def test_no_file_imports_itself_by_way_of_others() -> None:
    assert not circle(modules_of(PACKAGE))


def test_no_room_imports_itself_by_way_of_others() -> None:
    modules = modules_of(PACKAGE)
    assert not circle(modules, lambda name: room_of(name, modules))


def test_every_file_is_looked_at() -> None:
    modules = modules_of(PACKAGE)
    assert {"wingwatch", "wingwatch.aircraft.modes", "wingwatch.estimators.offline"} <= modules.keys()
    assert "wingwatch.aircraft.modes" in imported("wingwatch.aircraft", modules)


@pytest.mark.parametrize(
    "back",
    [
        "import made.one.first",
        "from made.one import first",
        "def later():\n    from made.one.first import name",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from made.one.first import name",
    ],
    ids=["module", "name", "inside a function", "for type checkers"],
)
def test_a_circle_is_noticed(tmp_path: Path, back: str) -> None:
    folder = tmp_path / "made" / "one"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "first.py").write_text("from made.one.second import name\n")
    (folder / "second.py").write_text("name = 1\n")
    assert not circle(modules_of(tmp_path / "made"))
    (folder / "second.py").write_text(f"{back}\nname = 1\n")
    found = circle(modules_of(tmp_path / "made"))
    assert found[0] == found[-1]
    assert set(found) == {"made.one.first", "made.one.second"}


def test_a_circle_of_rooms_is_noticed(tmp_path: Path) -> None:
    for room, text in (
        ("left", "from made.one.right.b import name"),
        ("right", "from made.one.left.a import name"),
    ):
        folder = tmp_path / "made" / "one" / room
        folder.mkdir(parents=True)
        for file in ("__init__", "a", "b"):
            (folder / f"{file}.py").write_text("name = 1\n")
        (folder / "c.py").write_text(f"{text}\n")
    modules = modules_of(tmp_path / "made")
    assert not circle(modules)
    assert set(circle(modules, lambda name: room_of(name, modules))) == {"made.one.left", "made.one.right"}
