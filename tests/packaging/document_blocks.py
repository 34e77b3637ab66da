"""Fenced blocks of the documents, the commands in them, and what is said before a block that is not run."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", ROOT / "SECURITY.md", *sorted((ROOT / "docs").rglob("*.md")))

LANGUAGES = ("sh", "console", "python", "json", "toml", "yaml", "text")
"""``console``: commands behind ``$`` with what they print; ``text``: what is printed alone."""

_FENCE = re.compile(
    r"(?:^<!-- parsed only: (?P<why>[^\n]+) -->\n)?^```(?P<language>[^\n]*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block.

    Attributes:
        page: path from the root.
        line: of its fence.
        why: it is parsed and not run; "" for one that runs.
    """

    page: str
    line: int
    language: str
    text: str
    why: str

    @property
    def name(self) -> str:
        """For a test's name."""
        return f"{self.page}:{self.line}"

    @property
    def commands(self) -> tuple[Sequence[str], ...]:
        """Words of every command of a shell block."""
        text = self.text.replace("\\\n", " ")
        lines = text.splitlines()
        if self.language == "console":
            lines = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
        return tuple(words for line in lines if (words := shlex.split(line, comments=True)))


def blocks_of(page: Path) -> list[Block]:
    """Every fenced block of a page."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            str(page.relative_to(ROOT)),
            text[: match.start("language")].count("\n") + 1,
            match["language"],
            match["text"],
            match["why"] or "",
        )
        for match in _FENCE.finditer(text)
    ]


BLOCKS = tuple(block for page in PAGES for block in blocks_of(page))


def written_in(*languages: str) -> list[Block]:
    """Blocks of these languages."""
    return [block for block in BLOCKS if block.language in languages]
