"""Files that a command is to write, checked before the work that fills them."""

import os
from collections.abc import Sequence
from pathlib import Path

from wingwatch.operations.faults import CommandError

__all__ = ["PICTURES", "check_output"]

PICTURES = (".png", ".pdf", ".svg")
"""Suffixes of pictures."""


def check_output(option: str, out: Path | None, suffixes: Sequence[str]) -> None:
    """Refuse what could not be written later.

    Args:
        option: that names it.
        out: the file; None where none is asked for.
        suffixes: of which it has to have one.

    Raises:
        CommandError: another suffix, no folder, or nothing can be written there.
    """
    if out is None:
        return
    if out.suffix.lower() not in suffixes:
        raise CommandError(f"{option} {out}: it is written as {' or '.join(suffixes)}; choose such a suffix")
    if not out.parent.is_dir():
        raise CommandError(f"{option} {out}: there is no folder {out.parent}; create it")
    if out.is_dir() or not os.access(out.parent, os.W_OK):
        raise CommandError(f"{option} {out}: no file can be written there; choose another place")
