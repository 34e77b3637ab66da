"""Finished studies as the service offers them: the HTML reports of one folder."""

import re
from collections.abc import Sequence
from html import unescape
from pathlib import Path

from wingwatch.api import StudyView

__all__ = ["StudyFolder"]

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._ -]{0,99}")
_MOST_LISTED, _MOST_BYTES, _HEAD_BYTES = 500, 64 * 2**20, 200_000
_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_ANSWER = re.compile(r"<h1[^>]*>(.*?)</h1>", re.DOTALL)


class StudyFolder:
    """Reports that ``wingwatch study ... --report`` wrote into a folder. Whatever else lies there is left alone.

    Args:
        folder: looked at anew with each question; it need not be there yet.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[tuple[Path, float, int], StudyView] = {}

    def studies(self) -> Sequence[StudyView]:
        """Those that can be read, the newest first, 500 at most."""
        found = [view for path in self._paths() if (view := self._view(path)) is not None]
        return sorted(found, key=lambda view: (-view.written_at_s, view.name))[:_MOST_LISTED]

    def report(self, name: str) -> bytes | None:
        """The report of this name; None where there is none."""
        path = next((path for path in self._paths() if path.stem == name), None)
        try:
            return None if path is None or path.stat().st_size > _MOST_BYTES else path.read_bytes()
        except OSError:
            return None

    def _paths(self) -> list[Path]:
        """Files of the folder itself; a link to somewhere else is none of them."""
        try:
            return [
                path
                for path in self._folder.iterdir()
                if path.suffix == ".html"
                and _NAME.fullmatch(path.stem)
                and path.is_file()
                and not path.is_symlink()
            ]
        except OSError:
            return []

    def _view(self, path: Path) -> StudyView | None:
        try:
            state = path.stat()
            key = (path, state.st_mtime, state.st_size)
            if key not in self._known:
                with path.open("rb") as file:
                    head = file.read(_HEAD_BYTES).decode("utf-8", "replace")
                title, answer = _text(_TITLE, head) or path.stem, _text(_ANSWER, head)
                self._known[key] = StudyView(path.stem, title, answer, state.st_mtime, state.st_size)
            return self._known[key]
        except OSError:
            return None


def _text(pattern: re.Pattern[str], page: str) -> str:
    """What an element of a page says, on one line."""
    found = pattern.search(page)
    if found is None:
        return ""
    return " ".join(unescape(re.sub(r"<[^>]*>", "", found[1])).split())[:300]
