"""The README is short, shows the page, and its numbers are those that commands have printed; so are other pages'."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results"
README = (ROOT / "README.md").read_text()
NUMBER = r"\d+(?:\.\d+)?"


def numbers(text: str) -> set[str]:
    """Numbers as they are written; what stands in backquotes is a name or a unit, p50 a quantile."""
    return set(re.findall(NUMBER, re.sub(r"`[^`]*`|\bp\d+ ", "", text)))


def printed(output: str) -> set[str]:
    """Numbers of a stored output, without its head."""
    return set(re.findall(NUMBER, re.sub(r"^#.*\n", "", (RESULTS / output).read_text(), flags=re.MULTILINE)))


def test_a_newcomer_reads_sixty_lines_with_one_picture() -> None:
    assert len(README.splitlines()) <= 60
    assert len(README.split()) <= 720
    (picture,) = re.findall(r"!\[[^]]+\]\(([^)]+)\)", README)
    assert (ROOT / picture).is_file()


def figures() -> list[tuple[str, str]]:
    """The README's figures, each with the stored output that it names."""
    section = README.split("## How good the numbers are")[1].split("\n## ")[0]
    table = [line.strip("|").split(" | ") for line in section.splitlines() if line.startswith("|")]
    return [
        (figure, re.findall(r"\]\(benchmarks/results/([\w/]+\.txt)\)", command)[0])
        for _, figure, command in table[2:]
    ]


def test_five_figures_stand_in_the_readme() -> None:
    assert len(figures()) == 5


@pytest.mark.parametrize(("figure", "output"), figures(), ids=[output for _, output in figures()])
def test_a_figure_of_the_readme_was_printed(figure: str, output: str) -> None:
    assert numbers(figure)
    assert numbers(figure) - printed(output) == set()


MARKED = re.compile(r"^( *)<!-- results: (\S+) -->\n\1(?!\n)((?:.+\n)+)", re.MULTILINE)
"""A table or a paragraph with the stored output that its numbers are from; benchmarks.md has a test of its own."""

PAGES = sorted(
    (str(page.relative_to(ROOT / "docs")), output, text)
    for page in (ROOT / "docs").rglob("*.md")
    if page.name != "benchmarks.md"
    for _, output, text in MARKED.findall(page.read_text())
)


def test_tables_and_paragraphs_name_their_output() -> None:
    assert {"limits.md", "real_flight.md", "simulation.md", "library_study.md"} <= {
        page for page, *_ in PAGES
    }
    assert any(not text.startswith("|") for *_, text in PAGES)


@pytest.mark.parametrize(("page", "output", "text"), PAGES, ids=[f"{p}-{o}" for p, o, _ in PAGES])
def test_numbers_of_a_marked_table_or_paragraph_were_printed(page: str, output: str, text: str) -> None:
    rows = text.splitlines()[2:] if text.startswith("|") else [text]
    assert any(numbers(row) for row in rows), page
    assert {row: numbers(row) - printed(output) for row in rows if numbers(row) - printed(output)} == {}
