"""Documents lead somewhere: links resolve, the index is complete, what code cites is there, words are the field's."""

import importlib.util
import re
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

LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+\s+(.*)$", re.MULTILINE)
CITATION = re.compile(r"docs/([\w./-]+\.md)(?:`{0,2},? sections? ((?:\d+(?:, | and | to )?)+))?")
PRIVATE = re.compile(
    r"\b(unrest|echo(es)?|heard|deaf|pretend(s|ed)?|accuse[sd]?|stray(s|ed)?|wander(s|ed)?|standing|told|stretch(es)?)\b",
    re.IGNORECASE,
)


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


@pytest.mark.parametrize("page", sorted(DECISIONS.glob("0*.md")), ids=named)
def test_a_decision_says_whether_it_is_in_force_as_the_index_does(page: Path) -> None:
    """First line after the title: in force, in force in part with the decision that replaces the rest, or replaced."""
    _, empty, status = page.read_text().split("\n")[:3]
    said = re.match(r"\*\*Status\.\*\* (In force in part|In force|Replaced by)", status)
    assert not empty
    assert said
    (row,) = re.findall(
        rf"^\| \[{page.name[:4]}\]\({page.name}\) \| .* \| (.*) \|$",
        (DECISIONS / "README.md").read_text(),
        re.M,
    )
    assert row.lower().startswith(said.group(1).lower())
    others = set(re.findall(r"\((0\d{3}-[^)]*\.md)\)", row))
    assert others <= set(re.findall(r"\((0\d{3}-[^)]*\.md)\)", status))
    assert bool(others) == (said.group(1) != "In force")


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


@pytest.mark.parametrize("page", sorted((DOCS / "methods").glob("*.md")), ids=named)
def test_equations_are_numbered_in_order(page: Path) -> None:
    """Numbers at the ends of indented lines go up by one from 1."""
    numbers = [int(n) for n in re.findall(r"^ {4,}\S.*\((\d+)\)$", page.read_text(), re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("page", sorted((DOCS / "methods").glob("*.md")), ids=named)
def test_methods_speak_the_field_s_words(page: Path) -> None:
    assert not PRIVATE.findall(page.read_text())


@pytest.mark.parametrize("page", [p for p in PAGES if "decisions" not in p.parts], ids=named)
def test_pages_leave_the_words_that_were_ours_alone(page: Path) -> None:
    assert not re.findall(r"\b(?:told|unrest|stretch(?:es)?|Fourier form)\b", page.read_text())
