"""The page, section by section."""

from importlib.resources import files

from wingwatch.cli.report_page.content import FlightContent
from wingwatch.cli.report_page.derivative_sections import derivatives_section, modes_section, table_section
from wingwatch.cli.report_page.fit_section import fit_section
from wingwatch.cli.report_page.flight_sections import flown_section, sensors_section
from wingwatch.cli.report_page.outcome_sections import excited_section, headline, outcome_section
from wingwatch.pages.document import document

__all__ = ["report_html"]


def report_html(c: FlightContent) -> str:
    """One page that needs nothing beside it, runs no script and loads nothing from anywhere."""
    answer, lead = headline(c)
    sections = (
        flown_section, outcome_section, excited_section, derivatives_section, modes_section, fit_section,
        sensors_section, table_section,
    )  # fmt: skip
    return document(
        title=f"Flight report of {c.name}",
        kind="wingwatch flight report",
        answer=answer,
        lead=lead,
        about=f"{c.name}, aircraft {c.aircraft.name}, {c.watched.duration_s:.0f} s",
        body="".join(make(c) for make in sections),
        style=(files("wingwatch.pages") / "chart.css").read_text(encoding="utf-8"),
    )
