"""What the flight came to: state and alerts; and what it excited and could not show."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from wingwatch.api import AlertDocument, CouldSeeDocument
from wingwatch.cli.alert_texts import candidate_text, plus_minus, smallest_size_text, spaced
from wingwatch.cli.flight_clocks import on_clock
from wingwatch.cli.furthest import furthest
from wingwatch.cli.report_page.content import FlightContent
from wingwatch.cli.report_page.course import IN_SENTENCES, ModeCourse
from wingwatch.cli.report_page.flight_sections import key, surface_charts
from wingwatch.diagnosis.summary import display
from wingwatch.pages.chart import Strip, grid, strips_html
from wingwatch.pages.markup import items, paragraph, section, table

__all__ = ["excited_section", "headline", "outcome_section"]

_KINDS = {"converged": "good", "settling": "way", "not_observable": "none", "rejected": "bad"}
_MOST_EVIDENCE = 8


def headline(c: FlightContent) -> tuple[str, str]:
    """The answer, and the sentence below it."""
    monitor = c.watched.monitor
    if not c.alerts:
        state = spaced(str(monitor.state))
        return f"No alert; {state}", f"{_sentence(monitor.reason)} {monitor.basis_text}"
    worst = max(c.alerts, key=lambda one: ("watch", "warning", "critical").index(one.level))
    more = f"{len(c.alerts)} alerts were raised. " if len(c.alerts) > 1 else ""
    return f"{worst.level.capitalize()}: {worst.text}", f"{more}{monitor.basis_text}"


def outcome_section(c: FlightContent) -> str:
    """Section 2."""
    monitor = c.watched.monitor
    state = (
        f"State at the end: {spaced(str(monitor.state))}. {_sentence(monitor.reason)} "
        f"{monitor.observable_s:.0f} of {c.watched.duration_s:.0f} s were observable."
    )
    cards = "".join(_alert(c, alert) for alert in c.alerts)
    parts = [paragraph(state), paragraph(monitor.basis_text), cards or paragraph("No alert.")]
    if (far := furthest(c.derivatives))[0] > 0.0:
        said = far[1].partition("; ")[0]
        for name, words in IN_SENTENCES.items():
            said = said.replace(f" by {name},", f" by the {words},")
        parts.append(paragraph(f"Furthest from what is expected at the end: {said}."))
    if monitor.unseen_surfaces:
        unseen = ", ".join(name.removesuffix("_rad") for name in monitor.unseen_surfaces)
        parts.append(paragraph(f"Not shown to work in this flight: {unseen}."))
    return section("outcome", "2. What it came to", *parts, *_could_see(c))


def _alert(c: FlightContent, alert: AlertDocument) -> str:
    part = "" if alert.channel is None else f" ({alert.channel})"
    number = c.watched.clock_numbers.get(alert.id, 0)
    clock = on_clock(number) if len(c.watched.clocks) > 1 else ""
    until = "" if alert.cleared_s is None else f", cleared at {alert.cleared_s:.1f} s"
    title = f"{alert.level} {alert.id}{part}: raised at {alert.raised_s:.1f} s{clock}{until}"
    return (
        f'<article class="card"><h3>{escape(title)}</h3>{paragraph(alert.text)}'
        f"{_candidates(alert)}{_evidence(c.evidence[alert.id])}</article>"
    )


def _candidates(alert: AlertDocument) -> str:
    return (
        paragraph(f"Possible causes: {'; '.join(map(candidate_text, alert.candidates))}.")
        if alert.candidates
        else ""
    )


def _evidence(rows: Sequence[Mapping[str, Any]]) -> str:
    if not rows:
        return ""
    cells = [
        (
            str(row["derivative"]),
            plus_minus(row["estimate"], row["standard_error"]),
            plus_minus(row["expected"], row["expected_standard_error"]),
            "-" if row["z"] is None else f"{row['z']:.1f}",
            str(row["unit"]),
        )
        for row in rows[:_MOST_EVIDENCE]
    ]
    head = ("derivative", "estimate", "expected", "standard errors apart", "unit")
    more = len(rows) - len(cells)
    left = paragraph(f"and {more} more that are less far from what is expected", "legend") if more > 0 else ""
    return f'<div class="symbols">{table(head, cells)}</div>{left}'


def _could_see(c: FlightContent) -> list[str]:
    """The smallest fault of each kind that would have raised an alert, and what would not have."""
    if not c.could_see:
        return []
    unseen = [one for one in c.could_see if one.smallest_size is None]
    seen = [one for one in c.could_see if one.smallest_size is not None]
    parts = []
    if unseen:
        parts.append("<h3>What would not have been noticed, of any size</h3>")
        texts = []
        for one in unseen:
            helps = f"; {one.input} would help" if one.input else ""
            where = "" if one.channel is None else f" of {_part(one.channel)}"
            texts.append(f"{spaced(one.cause)}{where}{helps}")
        parts.append(items(texts))
    if seen:
        parts.append("<h3>Smallest change that would have been noticed, in the last minutes</h3>")
        by_part: dict[str, list[str]] = {}
        for one in seen:
            by_part.setdefault(_part(one.channel), []).append(_size(one))
        parts.append(
            table(
                ("part", "cause and smallest size"),
                [(part, "; ".join(texts)) for part, texts in by_part.items()],
            )
        )
    return parts


def _size(one: CouldSeeDocument) -> str:
    text = smallest_size_text(one)
    return f"{spaced(one.cause)} {'(any)' if text == 'seen' else text}"


def _part(channel: str | None) -> str:
    return "the airframe" if channel is None else display(channel).name


def excited_section(c: FlightContent) -> str:
    """Section 3."""
    strips = [_strips(c, name, courses) for name, courses in c.course.modes.items()]
    colours = key(
        ("good", "converged"), ("way", "settling"), ("none", "not observable"), ("bad", "rejected: not to be used")
    )  # fmt: skip
    upper = "Each row has two lanes: the Fourier estimator above, the filter below."
    return section(
        "excited", "3. What was excited, and what could not be seen", surface_charts(c),
        colours, grid(strips), paragraph(upper, "legend"), items(_reasons(c)),
    )  # fmt: skip


def _strips(c: FlightContent, name: str, courses: Mapping[str, ModeCourse]) -> str:
    first = next(iter(courses.values()))
    rows = [
        Strip(symbol, [_spans(course, symbol, c.span_s[1]) for course in courses.values()])
        for symbol in first.structure.derivatives
    ]
    said = "; ".join(
        f"{symbol} {spaced(course.outcomes(symbol)[-1])}"
        for course in courses.values()
        for symbol in course.structure.derivatives
    )
    return strips_html(f"{_mode_name(name)}: derivatives over time", rows, c.span_s, f"At the end: {said}.")


def _spans(course: ModeCourse, symbol: str, end_s: float) -> list[tuple[float, float, str]]:
    """Pieces of one outcome."""
    outcomes, times = course.outcomes(symbol), [*course.time_s, end_s]
    spans: list[tuple[float, float, str]] = []
    for k, outcome in enumerate(outcomes):
        kind = _KINDS.get(outcome, "none")
        start, stop = times[k], times[k + 1]
        if stop < start:
            continue  # another clock
        if spans and spans[-1][2] == kind and spans[-1][1] == start:
            spans[-1] = (spans[-1][0], stop, kind)
        else:
            spans.append((start, stop, kind))
    return spans


def _reasons(c: FlightContent) -> list[str]:
    """What each mode reads at the end, and why."""
    lines = []
    for estimator, modes in c.derivatives["estimators"].items():
        for name, mode in modes.items():
            hidden = [s for s, row in mode["derivatives"].items() if row["outcome"] == "not_observable"]
            left = f"; not observable: {', '.join(hidden)}" if hidden else ""
            reason = f" ({mode['reason']})" if mode["reason"] else ""
            together = "".join(
                f"; only combinations of {', '.join(names)} are known, for what they multiply moved together"
                for names in mode["confounded"]
            )
            lines.append(
                f"{_mode_name(name)} by the {IN_SENTENCES.get(estimator, estimator)} is "
                f"{spaced(mode['outcome'])} at the end{reason}{left}{together}."
            )
    lines += [
        f"{_mode_name(name)} is not estimated: {why}." for name, why in c.derivatives["not_estimated"].items()
    ]
    return lines


def _mode_name(name: str) -> str:
    return spaced(name).capitalize()


def _sentence(text: str) -> str:
    text = text if text.endswith((".", "?")) else f"{text}."
    return text[0].upper() + text[1:]
