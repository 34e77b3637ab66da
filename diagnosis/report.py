"""The report of a diagnosis: one HTML page that needs nothing beside it and loads nothing from anywhere."""

import functools
import json
from html import escape
from importlib.resources import files
from pathlib import Path

from wingwatch.diagnosis.page.markup import paragraph
from wingwatch.diagnosis.page.sections import Page, sections
from wingwatch.diagnosis.result import Diagnosis
from wingwatch.diagnosis.summary import headline
from wingwatch.diagnosis.whole_file import write_whole

__all__ = ["report_html", "write_report"]

_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'"
)
"""The page's own vow that it fetches nothing; browsers hold it to that."""


def write_report(diagnosis: Diagnosis, path: Path) -> None:
    """Write the report; the file is whole or not there.

    Raises:
        OSError: the file cannot be written.
    """
    write_whole(path, report_html(diagnosis))


def report_html(diagnosis: Diagnosis) -> str:
    """The report as one page with styles, scripts and data inside."""
    page = Page()
    body = sections(diagnosis, page)
    title = f"Diagnosis of {diagnosis.source}" if diagnosis.source else "Diagnosis"
    answer, gained = headline(diagnosis)
    about = (
        f"{diagnosis.source}, aircraft {diagnosis.aircraft.name}, {diagnosis.seconds:.0f} s in "
        f"{diagnosis.windows} windows"
    )
    return "".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{escape(_POLICY)}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title><style>{_own('report.css')}</style></head><body>",
            f'<header><p class="soft">wingwatch diagnosis</p><h1>{escape(answer)}</h1>',
            f'{paragraph(gained, "lead")}<p class="soft">{escape(about)}</p></header>',
            "<noscript><p>The pictures need JavaScript; every figure in them stands in the tables too.</p></noscript>",
            f"<main>{body}</main>",
            f'<script type="application/json" id="figures">{_figures(page)}</script>',
            f"<script>{_plotly()}</script><script>{_own('report.js')}</script></body></html>\n",
        ]
    )


def _figures(page: Page) -> str:
    """The pictures as JSON that no HTML parser mistakes for the end of its element."""
    text = json.dumps([f.content for f in page.figures], allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _own(name: str) -> str:
    return (files("wingwatch.diagnosis.page") / name).read_text(encoding="utf-8")


@functools.cache
def _plotly() -> str:
    """The script of the installed plotly package; its Python part is not needed."""
    script = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    return script.replace("</script", "<\\/script")
