"""The report of a diagnosis: one HTML page that needs nothing beside it and loads nothing from anywhere."""

from importlib.resources import files
from pathlib import Path

from wingwatch.diagnosis.page.sections import sections
from wingwatch.diagnosis.result import Diagnosis
from wingwatch.diagnosis.summary import headline
from wingwatch.pages.document import Pictures, document
from wingwatch.pages.whole_file import write_whole

__all__ = ["report_html", "write_report"]


def write_report(diagnosis: Diagnosis, path: Path) -> None:
    """Write the report; the file is whole or not there.

    Raises:
        OSError: the file cannot be written.
    """
    write_whole(path, report_html(diagnosis))


def report_html(diagnosis: Diagnosis) -> str:
    """The report as one page with styles, scripts and data inside."""
    pictures = Pictures()
    body = sections(diagnosis, pictures)
    answer, gained = headline(diagnosis)
    about = (
        f"{diagnosis.source}, aircraft {diagnosis.aircraft.name}, {diagnosis.seconds:.0f} s in "
        f"{diagnosis.windows} windows"
    )
    return document(
        title=f"Diagnosis of {diagnosis.source}" if diagnosis.source else "Diagnosis",
        kind="wingwatch diagnosis",
        answer=answer,
        lead=gained,
        about=about,
        body=body,
        pictures=pictures,
        style=(files("wingwatch.diagnosis.page") / "report.css").read_text(encoding="utf-8"),
    )
