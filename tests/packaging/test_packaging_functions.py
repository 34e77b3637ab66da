"""No function takes more than eight parameters, and none is longer than seventy lines."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = sorted(path.parent.name for path in (ROOT / "wingwatch").glob("*/__init__.py"))
MOST_PARAMETERS = 8
MOST_LINES = 70


def functions(path: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """All that it takes, ``self`` and ``cls`` among them."""
    given = function.args
    rest = [one for one in (given.vararg, given.kwarg) if one is not None]
    return len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs) + len(rest)


def lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """From ``def`` to the last line; decorators are apart."""
    return (function.end_lineno or function.lineno) - function.lineno + 1


@pytest.mark.parametrize("folder", [*PACKAGES, "benchmarks", "tests", "tools"])
def test_functions_are_small(folder: str) -> None:
    files = [path for path in sorted((ROOT / folder).rglob("*.py")) if "_pb2" not in path.name]
    found = [
        f"{path.relative_to(ROOT)}:{one.lineno}: {one.name} takes {parameters(one)}, has {lines(one)} lines"
        for path in files
        for one in functions(path)
        if parameters(one) > MOST_PARAMETERS or lines(one) > MOST_LINES
    ]
    assert files
    assert not found


def test_every_parameter_and_line_is_counted(tmp_path: Path) -> None:
    file = tmp_path / "made.py"
    file.write_text(
        "class Made:\n"
        "    @property\n"
        "    def one(self, a, /, b, *c, d=1, **e):\n"
        "        async def two():\n"
        "            pass\n"
        "        return two\n"
    )
    found = {one.name: (parameters(one), lines(one)) for one in functions(file)}
    assert found == {"one": (6, 4), "two": (0, 2)}
