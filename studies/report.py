"""The report of a study: one HTML page that needs nothing beside it, and the same figures as JSON."""

import json
from importlib.resources import files
from pathlib import Path

from wingwatch.pages.document import Pictures, document
from wingwatch.pages.whole_file import write_whole
from wingwatch.studies.page.captions import about, headline
from wingwatch.studies.page.sections import sections
from wingwatch.studies.summary import Summary, as_json

__all__ = ["report_html", "report_json", "write_report"]


def write_report(summary: Summary, path: Path) -> None:
    """Write the report; the file is whole or not there.

    Raises:
        OSError: the file cannot be written.
    """
    write_whole(path, report_html(summary))


def report_html(summary: Summary) -> str:
    """The report as one page with styles, scripts and data inside."""
    pictures = Pictures()
    body = sections(summary, pictures)
    answer, lead = headline(summary)
    return document(
        title=f"Study: {', '.join(summary.flown.kinds)}",
        kind="wingwatch study",
        answer=answer,
        lead=lead,
        about=about(summary),
        body=body,
        pictures=pictures,
        style=(files("wingwatch.studies.page") / "report.css").read_text(encoding="utf-8"),
    )


def report_json(summary: Summary) -> str:
    """All figures of the report as one JSON object."""
    return json.dumps(as_json(summary), allow_nan=False, indent=1)
