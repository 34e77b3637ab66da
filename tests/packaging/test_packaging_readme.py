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


@pytest.mark.parametrize("page", ["limits.md", "real_flight.md"])
def test_tables_that_name_their_output_were_printed(page: str) -> None:
    text = (ROOT / "docs" / page).read_text()
    tables = re.findall(r"^<!-- results: (\S+) -->\n((?:\|.*\n)+)", text, re.MULTILINE)
    assert tables
    for output, table in tables:
        rows = table.splitlines()[2:]
        assert {row: numbers(row) - printed(output) for row in rows if numbers(row) - printed(output)} == {}
