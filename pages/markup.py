"""HTML from texts: whatever comes from a flight or a file is escaped here."""

from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["cells", "items", "paragraph", "section", "table"]


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of a plain text; nothing where the text is empty."""
    return f"<p{_class(kind)}>{escape(text)}</p>" if text else ""


def items(texts: Iterable[str]) -> str:
    """A list of plain texts; nothing where there is none."""
    rows = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f"<ul>{rows}</ul>" if rows else ""


def section(name: str, title: str, *parts: str) -> str:
    """A section with a heading that can be linked to; its parts are HTML."""
    return f'<section id="{escape(name)}"><h2>{escape(title)}</h2>{"".join(parts)}</section>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of plain texts; the first cell of a row names it, and narrow screens show the head beside each cell."""
    top = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    body = "".join(f"<tr>{cells(head, row)}</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def cells(head: Sequence[str], row: Sequence[str]) -> str:
    """One row's cells."""
    first = f'<th scope="row">{escape(row[0])}</th>'
    rest = zip(head[1:], row[1:], strict=True)
    return first + "".join(f'<td data-label="{escape(name)}">{escape(text)}</td>' for name, text in rest)


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
