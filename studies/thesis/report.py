"""The whole comparison as sections, and those as one page that stands alone or as Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from wingwatch.pages.chart import chart_html
from wingwatch.pages.chart import grid as chart_grid
from wingwatch.pages.document import document
from wingwatch.pages.markup import items, paragraph, section, table
from wingwatch.pages.whole_file import write_whole
from wingwatch.studies.thesis.figures import Drawn, charts
from wingwatch.studies.thesis.printed import TABLES_IN_CHAPTERS, printed_pulses, printed_tables
from wingwatch.studies.thesis.shown import SUMMARY_HEAD, Grid, grid_of, pulses_grid, summary_cells
from wingwatch.studies.thesis.tables import Compared

__all__ = [
    "LEAD",
    "Section",
    "coverage_sentence",
    "figure_section",
    "html_page",
    "markdown",
    "pulses_section",
    "sections_of",
    "summary_section",
    "table_section",
    "write_report",
]

_ANSWER = "The thesis beside wingwatch"
LEAD = (
    "Result tables of chapters 7 to 9 of P.-D. Jameson, System identification for UAVs (Cranfield University, 2013), "
    "as printed, beside what wingwatch's estimators say on the same plant, input, noise and record length."
)
_HOW_TO_READ = (
    "The plants have two states and the derivatives that the thesis prints for them (linearised Aerosonde, empirical "
    "Jetstream). The thesis's own records came from a simulation of six degrees of freedom and from flights, so its "
    "errors hold the difference of the models too, ours do not.",
    "Ours is the estimate from the first draw of noise (seed 0) with its stated standard error (se); beside it the rms "
    "error over all draws, and the share of draws whose 95 % interval holds the truth. The thesis has one draw.",
    "Apart is ours less printed, in joint standard errors; in percent of the printed figure where there is no noise. A "
    "fit's ± is the scatter over the draws.",
)


@dataclass(frozen=True, slots=True)
class Section:
    """One part of the report.

    Attributes:
        name: anchor.
        title: heading.
        texts: paragraphs before the grid.
        grid: figures, or None.
        notes: a clause each, below.
        figures: drawn on a page only.
    """

    name: str
    title: str
    texts: tuple[str, ...] = ()
    grid: Grid | None = None
    notes: tuple[str, ...] = ()
    figures: tuple[Drawn, ...] = ()


def coverage_sentence(found: Sequence[Compared]) -> str:
    """How many tables and cases are repeated."""
    cases = sum(len(one.cases) for one in found)
    repeated = sum(one.repeated for one in found)
    flown = sum(one.table.plant.flown for one in found)
    partly = [one.table.number for one in found if one.repeated < len(one.cases)]
    left = (
        f"; the {cases - repeated} left out are in {', '.join(partly)}, where they say why" if partly else ""
    )
    said = (
        f"Result tables: {len(found)}, of the Aerosonde {len(found) - flown}, of the Jetstream {flown}, for whose "
        f"flights a plant stands in. Of their {cases} cases {repeated} are repeated{left}."
    )
    if len(found) < len(printed_tables()):
        return said
    return (
        f"{said} Chapters 7 to 9 have {TABLES_IN_CHAPTERS} numbered tables; beside these 7.1 (widths of pulses), which "
        "is here too, and 7.12 (a list of sensors)."
    )


def summary_section(found: Sequence[Compared]) -> Section:
    """A line a table."""
    return Section(
        "summary",
        "Summary",
        (coverage_sentence(found), *_HOW_TO_READ),
        Grid(SUMMARY_HEAD, tuple(summary_cells(one) for one in found)),
    )


def table_section(found: Compared) -> Section:
    """One table in full."""
    one = found.table
    title = f"Table {one.number} (section {one.section}): {one.plant.title}, {one.about}"
    return Section(f"table-{one.number}", title, (), grid_of(found), found.notes)


def pulses_section() -> Section:
    """Table 7.1."""
    printed = printed_pulses()
    return Section(
        f"table-{printed.number}",
        f"Table {printed.number} (section {printed.section}): widths of the doublets' pulses",
        ("Ours is 2.3 over the natural frequency (equation 4.2) of the frequency that the table prints.",),
        pulses_grid(),
    )


def figure_section(found: Sequence[Drawn]) -> Section:
    """Figures."""
    return Section(
        "figures",
        "Figures",
        (
            "Blue is ours with its 95 % interval, black the plant's value, the short line at the end the last value "
            "that the thesis prints. Of states over time, dashed is measured, blue what the model predicts.",
        ),
        figures=tuple(found),
    )


def sections_of(
    found: Sequence[Compared], figures: Sequence[Drawn], more: Sequence[Section]
) -> list[Section]:
    """The whole report in order."""
    parts = [*([summary_section(found)] if found else []), *more]
    if figures:
        parts.append(figure_section(figures))
    if len(found) == len(printed_tables()):
        parts.append(pulses_section())
    return [*parts, *map(table_section, found)]


def html_page(sections: Sequence[Section], about: str) -> str:
    """One page that needs nothing beside it and runs no script."""
    return document(
        title=_ANSWER,
        kind="wingwatch thesis",
        answer=_ANSWER,
        lead=LEAD,
        about=about,
        body="".join(map(_section_html, sections)),
        style=(files("wingwatch.pages") / "chart.css").read_text(encoding="utf-8"),
    )


def _section_html(one: Section) -> str:
    parts = [*map(paragraph, one.texts)]
    if one.grid is not None:
        parts.append(table(one.grid.head, one.grid.rows))
    parts.append(items(map(_sentence, one.notes)))
    for figure in one.figures:
        parts += [f"<h3>{figure.figure.title}</h3>", chart_grid(map(chart_html, charts(figure)))]
    return section(one.name.replace(".", "-"), one.title, *parts)


def markdown(sections: Sequence[Section], about: str) -> str:
    """The same as Markdown; figures, which it cannot draw, by their command."""
    lines = [f"# {_ANSWER}", "", LEAD, "", about, ""]
    for one in sections:
        lines += [f"## {one.title}", ""]
        if one.figures:
            numbers = ", ".join(figure.figure.number for figure in one.figures)
            lines += [f"`wingwatch thesis --report FILE.html` draws the thesis's figures {numbers}.", ""]
            continue
        if one.name.startswith("table-"):
            lines += [f"`wingwatch thesis --table {one.name.removeprefix('table-')}`", ""]
        for text in one.texts:
            lines += [text, ""]
        if one.grid is not None:
            lines += [_row(one.grid.head), _row(["---"] * len(one.grid.head)), *map(_row, one.grid.rows), ""]
        if one.notes:
            lines += [*(f"- {_sentence(note)}" for note in one.notes), ""]
    return "\n".join(lines).rstrip() + "\n"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _sentence(clause: str) -> str:
    return f"{clause[:1].upper()}{clause[1:]}."


def write_report(sections: Sequence[Section], about: str, path: Path) -> None:
    """Write a page (.html) or Markdown (.md); the file is whole or not there.

    Raises:
        OSError: the file cannot be written.
    """
    write_whole(path, (markdown if path.suffix.lower() == ".md" else html_page)(sections, about))
