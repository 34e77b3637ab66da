"""Documents lead somewhere: links resolve, the index is complete, what code cites is there, words are the field's."""

import ast
import importlib.util
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
DECISIONS = DOCS / "decisions"
PAGES = sorted((*DOCS.rglob("*.md"), ROOT / "README.md"))
CODE = sorted(
    path
    for folder in (
        *(link.resolve() for link in (ROOT / "wingwatch").iterdir() if link.is_symlink()),
        ROOT / "tests",
    )
    for path in folder.rglob("*.py")
)

METHODS = {page.name: page.read_text() for page in sorted((DOCS / "methods").glob("*.md"))}
PACKAGES_WITH_EQUATIONS = (
    *("aircraft", "baselines", "diagnosis", "estimators", "input_design", "monitor", "simulation", "studies"),
    *("telemetry", "tests"),
)

EQUATION = re.compile(r"^ {4,}\S.*\((\d+[a-e]?)\)$|\\tag\{(\d+)\}", re.MULTILINE)
POINTER = re.compile(r"(?<![\w.\])])\((\d{1,2}[a-e]?)\)")
PAGE_POINTER = re.compile(
    r"([\w]+\.md)(?:\)|`{0,2}),?(?: sections? (\d+))?,? ((?:\(\d+[a-e]?\)(?:, | and | to )?)+)"
)
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+\s+(.*)$", re.MULTILINE)
CITATION = re.compile(r"docs/([\w./-]+\.md)(?:`{0,2},? sections? ((?:\d+(?:, | and | to )?)+))?")
PRIVATE = re.compile(
    r"\b(surprises?|unrest|echo(?:es)?|heard|deaf|pretend(?:s|ed)?|accuse[sd]?|stray(?:s|ed)?|wander(?:s|ed)?|standings?|told|"
    r"stretch(?:es)?|Fourier form)\b",
    re.IGNORECASE,
)
"""Words that were this project's own; the field's words for them stand in the pages and in the code instead."""


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as the usual renderers make them."""
    words = (re.sub(r"[^\w\- ]", "", title.lower()) for title in HEADING.findall(page.read_text()))
    return {title.strip().replace(" ", "-") for title in words}


def named(page: Path) -> str:
    """A page's path from the root."""
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    broken = []
    for target in LINK.findall(page.read_text()):
        if target.startswith(("http://", "https://")):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        if not there.exists() or (anchor and anchor not in anchors(there)):
            broken.append(target)
    assert not broken


def linked_from(page: Path) -> set[Path]:
    return {(page.parent / target.partition("#")[0]).resolve() for target in LINK.findall(page.read_text())}


def test_the_index_names_every_document() -> None:
    """Decisions stand in an index of their own, which the first one names."""
    index, of_decisions = DOCS / "README.md", DECISIONS / "README.md"
    assert of_decisions in linked_from(index)
    assert set(DOCS.rglob("*.md")) - linked_from(index) - linked_from(of_decisions) == {index}


@pytest.mark.parametrize("page", sorted(DECISIONS.rglob("0*.md")), ids=named)
def test_a_decision_says_whether_it_is_in_force_as_the_index_does(page: Path) -> None:
    """First line after the title: in force, in force in part with the page that replaces the rest, or replaced."""
    _, empty, status = page.read_text().split("\n")[:3]
    said = re.match(r"\*\*Status\.\*\* (In force in part|In force|Replaced by)", status)
    assert not empty
    assert said
    (row,) = re.findall(
        rf"^\| \[{page.name[:4]}\]\({page.relative_to(DECISIONS)}\) \| .* \| (.*) \|$",
        (DECISIONS / "README.md").read_text(),
        re.M,
    )
    assert row.lower().startswith(said.group(1).lower())
    others = set(re.findall(r"([\w-]+\.md)\)", row))
    assert others <= set(re.findall(r"([\w-]+\.md)\)", status))
    assert bool(others) == (said.group(1) != "In force")
    assert (page.parent.name == "replaced") == said.group(1).startswith("Replaced")


@pytest.mark.parametrize("name", ["options.md", "operations.md"])
def test_pages_made_from_the_code_are_those_of_the_code(name: str) -> None:
    """`make reference` writes them anew."""
    spec = importlib.util.spec_from_file_location("wingwatch_reference", ROOT / "tools" / "reference.py")
    assert spec is not None
    assert spec.loader is not None
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    assert (DOCS / "reference" / name).read_text() == reference.PAGES[name]()


def test_what_code_cites_is_there() -> None:
    """Pages exist, and so do the sections that are named with them."""
    missing = []
    for path in CODE:
        text = re.sub(r"\s*\n\s*", " ", path.read_text())
        for name, sections in CITATION.findall(text):
            page = DOCS / name
            numbers = (
                set(re.findall(r"^## (\d+)\.", page.read_text(), re.MULTILINE)) if page.exists() else set()
            )
            if not page.exists() or not set(re.findall(r"\d+", sections)) <= numbers:
                missing.append(f"{path.relative_to(ROOT)}: docs/{name} {sections}".rstrip())
    assert not missing


def equations(text: str) -> list[str]:
    """Numbers of the equations of a text, as they follow each other: "1", "1a", "2"."""
    return [plain or tagged for plain, tagged in EQUATION.findall(text)]


def section_with(page: str, number: str) -> str | None:
    """Number of the section that has an equation; None where the page has no such equation."""
    for section in re.split(r"^## ", METHODS[page], flags=re.MULTILINE):
        if number in equations(section):
            return section.partition(".")[0]
    return None


@cache
def strings_in(path: Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Docstrings and comments of a module; all its other strings."""
    source = path.read_text()
    nodes = list(ast.walk(ast.parse(source)))
    documented = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    found: tuple[list[str], list[str]] = [], []
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found[id(node) not in documented].append(node.value)
    found[0].extend(re.findall(r"(?:^|\s)#\s(.*)$", source, re.MULTILINE))
    return tuple(found[0]), tuple(found[1])


def said_in(path: Path) -> tuple[str, ...]:
    """Docstrings and comments of a module."""
    return strings_in(path)[0]


def sentences_in(path: Path) -> Iterator[str]:
    """Docstrings, comments and strings of more than one word, without names of attributes and of code."""
    for text in (text for texts in strings_in(path) for text in texts):
        if " " in text.strip():
            yield re.sub(r"``.*?``|^\s+[\w, ]+:", "", text, flags=re.MULTILINE | re.DOTALL)


@cache
def equations_in(folder: Path) -> frozenset[str]:
    """Numbers of the equations in the docstrings of a folder's modules."""
    return frozenset(n for path in folder.glob("*.py") for text in said_in(path) for n in equations(text))


@pytest.mark.parametrize("page", METHODS)
def test_equations_are_numbered_in_order(page: str) -> None:
    """Numbers go up by one from 1; 1a follows 1; no number stands twice."""
    found = equations(METHODS[page])
    whole = [int(n) for n in found if n.isdigit()]
    assert whole == list(range(1, len(whole) + 1))
    assert found == sorted(set(found), key=lambda n: (int(n.rstrip("abcde")), n))


SECTION_POINTER = re.compile(r"(\w+\.md)\)?,? sections? ((?:\d+[a-z]?(?:, | and | to )?)+)")


def test_pointers_to_method_pages_name_equations_and_sections() -> None:
    """On every page: what is named with a number is there; a replaced decision keeps the numbers of its time."""
    wrong = []
    for page in (page for page in PAGES if page.parent.name != "replaced"):
        text = re.sub(r"\s+", " ", page.read_text())
        for target, section, numbers in PAGE_POINTER.findall(text):
            for number in re.findall(r"\d+[a-e]?", numbers):
                there = section_with(target, number)
                if there is None or (section and section != there):
                    wrong.append(f"{named(page)}: {target} {section} ({number})")
        for target, sections in SECTION_POINTER.findall(text):
            there_are = set(re.findall(r"^## (\d+[a-z]?)\.", METHODS.get(target, ""), re.MULTILINE))
            if target in METHODS and not set(re.findall(r"\d+[a-z]?", sections)) <= there_are:
                wrong.append(f"{named(page)}: {target}, sections {sections}")
    assert not wrong


@pytest.mark.parametrize("package", PACKAGES_WITH_EQUATIONS)
def test_pointers_of_docstrings_name_equations(package: str) -> None:
    """A "(N)" is an equation of a page that the module cites or of a docstring beside it; "(docs (N))" of a page."""
    wrong = []
    for path in sorted((ROOT / package).rglob("*.py")):
        cited = re.findall(r"docs/methods/(\w+\.md)", path.read_text())
        if not cited and not POINTER.search(path.read_text()):
            continue
        on_pages = {number for page in cited for number in equations(METHODS[page])}
        beside = equations_in(path.parent)
        for text in said_in(path):
            flat = re.sub(r"\s+", " ", text)
            pages_only = {
                n for group in re.findall(r"\(docs ([^a-z]*)\)", flat) for n in POINTER.findall(group)
            }
            wrong += [f"{path.name}: (docs ({n}))" for n in pages_only - on_pages]
            wrong += [f"{path.name}: ({n})" for n in set(POINTER.findall(flat)) - on_pages - beside]
            for page, section, numbers in PAGE_POINTER.findall(flat):
                for number in re.findall(r"\d+[a-e]?", numbers):
                    there = section_with(page, number) if page in METHODS else section
                    if there is None or (section and section != there):
                        wrong.append(f"{path.name}: {page} {section} ({number})")
    assert not wrong


@pytest.mark.parametrize("page", METHODS)
def test_modules_that_a_method_page_names_are_there(page: str) -> None:
    names = set(re.findall(r"`((?:\w+/)*\w+\.py)`", METHODS[page]))
    there = {str(path.relative_to(ROOT)) for path in CODE} | {
        str(path.relative_to(ROOT)) for path in (ROOT / "benchmarks").glob("*.py")
    }
    assert not {name for name in names if not any(f"/{path}".endswith(f"/{name}") for path in there)}


def names_in(path: Path) -> set[str]:
    """Names of a module's variables, attributes, arguments, functions and classes."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        found |= {
            str(getattr(node, field)) for field in ("id", "attr", "arg", "name") if hasattr(node, field)
        }
    return found


PRIVATE_NAMES = re.compile(
    r"_*(?:(?:un)?told(?:_.*)?|.*_told|hangar|pump(?:_.*)?|blame|standings|echo(?:es)?(?:_.*)?|pull|unrest|deaf_.*)",
    re.IGNORECASE,
)
"""Identifiers that were this project's own; names of files that are to move, and of tests, stay as they are."""


def test_identifiers_are_the_field_s_words() -> None:
    private = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in (*CODE, *sorted((ROOT / "benchmarks").glob("*.py")))
        if not path.name.startswith("test_")
        and path.parts[-2] != "packaging"
        and any(PRIVATE_NAMES.fullmatch(word) for word in set(re.findall(r"\w+", path.read_text())))
        for name in names_in(path)
        if PRIVATE_NAMES.fullmatch(name)
    ]
    assert not private


@pytest.mark.parametrize("page", METHODS)
def test_methods_speak_the_field_s_words(page: str) -> None:
    assert not PRIVATE.findall(METHODS[page])


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_pages_leave_the_words_that_were_ours_alone(page: Path) -> None:
    assert not re.findall(r"\b(?:told|unrest|stretch(?:es)?|Fourier form)\b", page.read_text())


@pytest.mark.parametrize(
    "folder", sorted({path.relative_to(ROOT).parts[0] for path in CODE} | {"benchmarks"})
)
def test_code_speaks_the_field_s_words(folder: str) -> None:
    """Docstrings, comments and messages; identifiers and keys of public contracts stay as they are."""
    private = [
        f"{path.relative_to(ROOT)}: {found}: {' '.join(text.split())[:80]}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        if "_pb2" not in path.name and path != Path(__file__) and PRIVATE.search(path.read_text())
        for text in sentences_in(path)
        for found in PRIVATE.findall(text)
    ]
    assert not private
