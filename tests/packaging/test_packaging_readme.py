"""The README is short, shows the page, and its numbers are those that commands have printed; so are other pages'."""

import re
from pathlib import Path

import pytest
from test_packaging_results import TABLE, kept, numbers, rows

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
RESULT = re.compile(r"\]\((benchmarks/results/[\w/]+\.txt)\)")


def test_a_newcomer_reads_sixty_lines_with_one_picture() -> None:
    assert len(README.splitlines()) <= 60
    assert len(README.split()) <= 800
    (picture,) = re.findall(r"!\[[^]]+\]\(([^)]+)\)", README)
    assert (ROOT / picture).is_file()


def figures() -> list[tuple[str, str]]:
    """The README's figures, each with the stored output that it names."""
    section = README.split("## How good the numbers are")[1].split("\n## ")[0]
    table = [line.strip("|").split(" | ") for line in section.splitlines() if line.startswith("|")]
    return [(figure, RESULT.findall(command)[0]) for _, figure, command in table[2:]]


def test_five_figures_stand_in_the_readme() -> None:
    assert len(figures()) == 5


@pytest.mark.parametrize(("figure", "output"), figures(), ids=[output for _, output in figures()])
def test_a_figure_of_the_readme_was_printed(figure: str, output: str) -> None:
    wanted = numbers(re.sub(r"\bp\d+ ", "", figure))
    assert wanted
    assert wanted <= set(re.findall(r"\d+(?:\.\d+)?", kept(output.removeprefix("benchmarks/results/"))))


@pytest.mark.parametrize("page", ["limits.md", "real_flight.md"])
def test_a_table_that_names_its_output_was_printed(page: str) -> None:
    tables = TABLE.findall((ROOT / "docs" / page).read_text())
    assert tables
    for names, table in tables:
        printed = set(re.findall(r"\d+(?:\.\d+)?", kept(names)))
        assert {row: sorted(numbers(row) - printed) for row in rows(table) if numbers(row) - printed} == {}
