"""How many docstrings of public functions state shapes of arrays and units of numbers, by package.

    python tools/docstrings.py [--missing] [PACKAGE ...]

A public function is one whose name, or whose class, stands in the ``__all__`` of its module. Arrays are parameters and
results annotated as such; their shapes stand in the docstring as ``(n, k)`` or in words ("of the same shape"). Numbers
are parameters and results annotated ``float`` or as arrays; their unit ends the name (``_s``) or stands in the
docstring. A function that has neither arrays nor numbers does not count.
"""

import argparse
import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("estimators", "monitor", "baselines", "input_design")

_ARRAY = re.compile(r"\b(?:Array|NDArray|Complex|ndarray|Codes|Bool|Points)\b")
_SHAPE = re.compile(
    r"\(\s*(?:\.\.\.|[\w*+ /-]+)\s*,[^()]*\)|\bshapes?\b|\bscalar\b|\bone for each\b|\bsame length\b"
)
_UNIT_NAME = re.compile(
    r"_(?:s|m|kg|rad|deg|hz|n|k|m2|m_s|m_s2|rad_s|rad_s2|kg_m3|kg_m2|s2|m_s3|h|days|mb|us|ms|db|bit|per_s)$"
)
_UNIT = re.compile(
    r"\b(?:rad(?:/s2?)?|deg|degrees|m/s(?:\^?[23])?|m2/s3|kg(?:/m3| m2)?|Hz|1/s2?|s|seconds|minutes|hours|days|N|bits?|"
    r"metres|percent|units?|concise|dimensionless|non-dimensional|samples|standard errors?|sizes?|natural|ratio|"
    r"fraction|probability|logarithm|log|nats|weights?|places?|index|indices|number of|count)\b"
)


@dataclass(frozen=True, slots=True)
class Documented:
    """What one public function has to state, and whether it does.

    Attributes:
        where: file and name.
        arrays, numbers: whether it takes or gives any.
        shapes, units: whether the docstring, or the names, state them.
    """

    where: str
    arrays: bool
    shapes: bool
    numbers: bool
    units: bool


def documented(path: Path) -> Iterator[Documented]:
    """Every public function of a module."""
    tree = ast.parse(path.read_text())
    public = _public(tree)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name in public:
            yield _judged(path, node, node.name, "")
        if isinstance(node, ast.ClassDef) and node.name in public:
            of_class = ast.get_docstring(node) or ""
            for method in node.body:
                if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
                    yield _judged(path, method, f"{node.name}.{method.name}", of_class)


def _public(tree: ast.Module) -> set[str]:
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return set(ast.literal_eval(node.value))
    return set()


def _judged(path: Path, node: ast.FunctionDef, name: str, of_class: str) -> Documented:
    text = ast.get_docstring(node) or ""
    compiled = not any(a.annotation for a in node.args.args) and node.returns is None
    annotated = [
        (a.arg, ast.unparse(a.annotation)) for a in (*node.args.args, *node.args.kwonlyargs) if a.annotation
    ]
    result = ast.unparse(node.returns) if node.returns else ""
    kinds = [kind for _, kind in annotated] + [result]
    arrays = compiled or any(_ARRAY.search(kind) for kind in kinds)
    numbers = compiled or arrays or any(re.search(r"\bfloat\b", kind) for kind in kinds)
    number = re.compile(rf"\bfloat\b|{_ARRAY.pattern}")
    of_numbers = [arg for arg, kind in annotated if number.search(kind)] + [name] * bool(
        number.search(result)
    )
    named = bool(of_numbers) and all(_UNIT_NAME.search(one) for one in of_numbers)
    return Documented(
        f"{path.relative_to(ROOT)}:{node.lineno} {name}",
        arrays,
        bool(_SHAPE.search(text)),
        numbers,
        bool(_UNIT.search(text)) or named,
    )


def measured(package: str) -> list[Documented]:
    """Public functions of a package."""
    paths = sorted((ROOT / package).rglob("*.py"))
    return [one for path in paths for one in documented(path)]


def main() -> None:
    """Print the fractions, and the functions that lack something."""
    parser = argparse.ArgumentParser(description="shapes and units in docstrings of public functions")
    parser.add_argument("packages", nargs="*", default=PACKAGES)
    parser.add_argument("--missing", action="store_true", help="list the functions without them")
    arguments = parser.parse_args()
    for package in arguments.packages:
        found = measured(package)
        arrays, numbers = [one for one in found if one.arrays], [one for one in found if one.numbers]
        print(
            f"{package}: {len(found)} public functions; shapes in {sum(one.shapes for one in arrays)} of "
            f"{len(arrays)} with arrays, units in {sum(one.units for one in numbers)} of {len(numbers)} with numbers"
        )
        if arguments.missing:
            for one in found:
                lacks = "shapes " * (one.arrays and not one.shapes) + "units" * (
                    one.numbers and not one.units
                )
                if lacks:
                    print(f"  {one.where}: {lacks}")


if __name__ == "__main__":
    main()
