"""What is committed names no package index, no secret place and no folder of a developer's machine."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# Written so that these lines do not match themselves.
INDEXES = re.compile(
    r"[p]ypi\.org|[p]ythonhosted\.org|[r]egistry\.npmjs|[e]xtra-index|--[i]ndex-url[ =]", re.IGNORECASE
)
HOMES = re.compile(
    r"(?<![\w.~*-])/(?:[h]ome|[U]sers)/[\w.-]+|(?<![\w.~*-])/[r]oot/|(?<![\w.~*-])/[w]ork/|[A-Z]:\\[U]sers"
)


def committed() -> list[Path]:
    """Tracked files that are text."""
    listing = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False
    )
    if listing.returncode:
        pytest.skip("this is not a git clone, so there is no list of the project's files")
    files = [ROOT / name for name in listing.stdout.decode().split("\0") if name]
    return [path for path in files if path.is_file() and b"\0" not in path.read_bytes()[:8192]]


@pytest.mark.parametrize("pattern", [INDEXES, HOMES], ids=["package index", "developer's folder"])
def test_no_committed_file_names_a(pattern: re.Pattern[str]) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:120]}"
        for path in committed()
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1)
        if pattern.search(line)
    ]
    assert not found


@pytest.mark.parametrize(
    ("pattern", "text"),
    [
        (INDEXES, "https://" + "py" + "pi.org/simple"),
        (INDEXES, "pip install --index" + "-url=x"),
        (HOMES, "see /ho" + "me/ann/project"),
        (HOMES, "'/wo" + "rk/main'"),
        (HOMES, "/ro" + "ot/.config"),
    ],
)
def test_the_patterns_find_what_they_are_for(pattern: re.Pattern[str], text: str) -> None:
    assert pattern.search(text)


@pytest.mark.parametrize(
    "text", ["/v1/home", "docs/work/notes", "$HOME/wingwatch", "../root/file", "network/work/"]
)
def test_the_patterns_leave_ordinary_text_alone(text: str) -> None:
    assert not HOMES.search(text)
