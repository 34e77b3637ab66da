"""The report of a diagnosis of a change: one HTML page that needs nothing beside it."""

from importlib.resources import files
from pathlib import Path

from wingwatch.diagnosis.change.result import ChangeDiagnosis, Outcome
from wingwatch.diagnosis.change.words import named, sentence_of, sized
from wingwatch.pages.document import Pictures, document
from wingwatch.pages.markup import items, paragraph, section, table
from wingwatch.pages.whole_file import write_whole

__all__ = ["write_change_report"]


def write_change_report(found: ChangeDiagnosis, source: str, aircraft: str, path: Path) -> None:
    """Write the report; the file is whole or not there.

    Raises:
        OSError: the file cannot be written.
    """
    answer = sentence_of(found)
    about = (
        f"{source}, aircraft {aircraft}: {found.after_s:.0f} s of flight since the onset against "
        f"{found.before_s:.0f} s before it. The alert's onset was {found.asked_s:.1f} s."
    )
    write_whole(
        path,
        document(
            title=f"Diagnosis of {source}", kind="wingwatch diagnosis of an alert",
            answer=answer[:1].upper() + answer[1:], lead=found.explanations[0].text if found.explanations else "",
            about=about, body=_sections(found), pictures=Pictures(),
            style=(files("wingwatch.diagnosis.page") / "report.css").read_text(encoding="utf-8"),
        ),
    )  # fmt: skip


def _sections(found: ChangeDiagnosis) -> str:
    rows = [
        (named(e), sized(e), f"{e.evidence:.1f}", f"{100.0 * e.probability:.1f} %", e.text)
        for e in found.explanations
    ]
    rows += [
        (
            "a change that none of them describes",
            "",
            "",
            f"{100.0 * found.unexplained_probability:.1f} %",
            "",
        ),
        ("no change", "", "0.0", f"{100.0 * found.nothing_probability:.1f} %", ""),
    ]
    head = ("cause", "size", "ln odds against no change", "probability", "in words")
    parts = [section("explanations", "Fits to the time since the onset", table(head, rows))]
    if found.outcome is Outcome.NOT_SEPARABLE:
        text = found.separating_manoeuvre or "No manoeuvre of one surface or mode distinguishes them."
        parts.append(section("separating", "What would tell them apart", paragraph(text)))
    notes = [
        f"Scores before the onset scatter {found.inflation:.2f} times as much as independent innovations would; "
        "evidence and standard errors count that.",
        *found.notes,
    ]
    return "".join([*parts, section("notes", "Notes", items(notes))])
