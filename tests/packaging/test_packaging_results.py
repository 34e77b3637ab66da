"""Every number of a table of `docs/benchmarks.md` stands in the stored output that is named beside it."""

import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "benchmarks.md"
RESULTS = ROOT / "benchmarks" / "results"
KEPT = sorted(RESULTS.rglob("*.txt"))

TABLE = re.compile(r"^<!-- results(, a row a line)?: (.+) -->\n\n((?:\|.*\n)+)", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w]*[A-Za-z_])")
QUOTED = re.compile(r"`[^`]*`")


def numbers(text: str) -> Counter[str]:
    """Numbers as they are written, without signs; what stands in backquotes is a name or a command."""
    return Counter(NUMBER.findall(QUOTED.sub("", text)))


def printed_numbers(text: str) -> Counter[str]:
    """All numbers of an output, those beside letters as well (a percentage, a name)."""
    return Counter(re.findall(r"\d+(?:\.\d+)?", text))


def kept(names: str) -> str:
    """Text of the stored outputs, without their heads."""
    files = (RESULTS / name.strip() for name in names.split(","))
    return "\n".join(re.sub(r"^#.*\n", "", file.read_text(), flags=re.MULTILINE) for file in files)


def rows(table: str) -> list[str]:
    """Rows below a table's heading."""
    return table.strip().split("\n")[2:]


TABLES = [(bool(match[1]), match[2], rows(match[3])) for match in TABLE.finditer(PAGE.read_text())]


@pytest.mark.parametrize(("by_line", "names", "table"), TABLES, ids=[names for _, names, _ in TABLES])
def test_every_number_of_a_table_was_printed(by_line: bool, names: str, table: list[str]) -> None:
    """Each is in the output; where a row of the table is a line of the output, all are in one line."""
    text = kept(names)
    lines = [printed_numbers(line) for line in text.split("\n")]
    anywhere = set(printed_numbers(text))
    invented = {
        row: sorted(set(numbers(row)) - anywhere)
        for row in table
        if not numbers(row).keys() <= anywhere
        or (by_line and not any(numbers(row) <= line for line in lines))
    }
    assert table
    assert not invented


@pytest.mark.parametrize("names", sorted({names for _, names, _ in TABLES}))
def test_the_page_names_the_command_of_an_output(names: str) -> None:
    page = PAGE.read_text()
    for name in names.split(","):
        command = re.match(r"# command: (.*)", (RESULTS / name.strip()).read_text())
        assert command is not None
        assert name.strip().startswith("compiled/") or f"`{command[1]}`" in page


def test_every_table_of_the_page_names_its_output() -> None:
    text = PAGE.read_text()
    assert len(TABLES) == len(re.findall(r"^\|-", text, re.MULTILINE)) > 20


def test_a_number_that_was_not_printed_is_found() -> None:
    assert set(numbers("| z_w, 5 s | `--seeds 7` | 1.20; 95 | -0.5 |")) == {"5", "1.20", "95", "0.5"}
    assert numbers("| 7 | 7 |") == {"7": 2}
    assert not numbers("| m_q2 | 3dB |")


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.stem)
def test_an_output_says_where_it_comes_from(path: Path) -> None:
    command, date, commit, *_ = path.read_text().split("\n")
    assert re.fullmatch(r"# command: (?:benchmarks/\w+\.py|wingwatch ).*", command)
    assert re.fullmatch(r"# date: \d{4}-\d\d-\d\d", date)
    assert re.match(r"# commit: (?:[0-9a-f]{7}|as stated below)", commit)
    script = re.match(r"# command: (benchmarks/\w+\.py)", command)
    assert script is None or (ROOT / script[1]).exists()


def test_pages_and_outputs_name_each_other() -> None:
    """No stored output that no page leads to, and no page that names an output which is not there."""
    pages = "\n".join(page.read_text() for page in (ROOT / "docs").rglob("*.md"))
    marked = {name.strip() for _, names, _ in TABLES for name in names.split(",")}
    named = set(re.findall(r"benchmarks/results/((?:compiled/)?\w+\.txt)", pages)) | marked
    there = {str(path.relative_to(RESULTS)) for path in KEPT}
    assert there
    assert there - named == set()
    assert marked - there == set()


def test_every_benchmark_is_among_the_commands() -> None:
    scripts = {path.name for path in (ROOT / "benchmarks").glob("*.py") if '"__main__"' in path.read_text()}
    page = (ROOT / "docs" / "notes" / "benchmark_commands.md").read_text()
    assert len(scripts) > 50
    assert scripts - set(re.findall(r"benchmarks/(\w+\.py)", page)) == set()
