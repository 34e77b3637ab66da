"""One page that needs nothing beside it and loads nothing from anywhere."""

import functools
import json
from collections.abc import Sequence
from html import escape
from importlib.resources import files

from wingwatch.pages.markup import paragraph
from wingwatch.pages.picture import Figure

__all__ = ["Pictures", "document"]

_STILL = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
_POLICY = f"{_STILL}; script-src 'unsafe-inline'; img-src data: blob:"
"""The page's own vow that it fetches nothing, and without plotly that it runs nothing; browsers hold it to that."""


class Pictures:
    """Collects the pictures that sections place.

    Attributes:
        figures: in the order in which they stand.
    """

    def __init__(self) -> None:
        self.figures: list[Figure] = []

    def place(self, figure: Figure | None, caption: str = "") -> str:
        """The element in which a picture will be drawn, with its sentence; nothing without a picture."""
        if figure is None:
            return ""
        self.figures.append(figure)
        described = escape(f"{figure.title}. {caption}".strip(), quote=True)
        return (
            f'<figure><div class="picture" id="{escape(figure.name)}" role="img" aria-label="{described}" '
            f'style="min-height:{figure.height_px}px"></div>'
            + (f"<figcaption>{escape(caption)}</figcaption>" if caption else "")
            + "</figure>"
        )


def document(
    *,
    title: str,
    kind: str,
    answer: str,
    lead: str,
    about: str,
    body: str,
    style: str,
    pictures: Pictures | None = None,
) -> str:
    """The whole page.

    Args:
        title: of the browser's tab.
        kind: what sort of page it is, above the answer.
        answer, lead, about: the heading, the sentence below it, and what the page is about; plain texts.
        body: sections as HTML.
        style: rules of this kind of page beside those of all.
        pictures: drawn by plotly, placed in the body; without them the page has no script.
    """
    return "".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{escape(_STILL if pictures is None else _POLICY)}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title><style>{_own('page.css')}{style}</style></head><body>",
            f'<header><p class="soft">{escape(kind)}</p><h1>{escape(answer)}</h1>',
            f"{paragraph(lead, 'lead')}{paragraph(about, 'soft')}</header>",
            "" if pictures is None else _NO_SCRIPT,
            f"<main>{body}</main>",
            "" if pictures is None else _drawn(pictures),
            "</body></html>\n",
        ]
    )


_NO_SCRIPT = (
    "<noscript><p>The pictures need JavaScript; every figure in them stands in the tables too.</p></noscript>"
)


def _drawn(pictures: Pictures) -> str:
    """The pictures' data and the scripts that draw them."""
    return (
        f'<script type="application/json" id="figures">{_figures(pictures.figures)}</script>'
        f"<script>{_plotly()}</script><script>{_own('page.js')}</script>"
    )


def _figures(figures: Sequence[Figure]) -> str:
    """The pictures as JSON that no HTML parser mistakes for the end of its element."""
    text = json.dumps([f.content for f in figures], allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _own(name: str) -> str:
    return (files("wingwatch.pages") / name).read_text(encoding="utf-8")


@functools.cache
def _plotly() -> str:
    """The script of the installed plotly package; its Python part is not needed."""
    script = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    return script.replace("</script", "<\\/script")
