"""The report's sections: what each says in words and tables, and where its pictures stand."""

from html import escape

from wingwatch.aircraft import MODEL_DERIVATIVES
from wingwatch.diagnosis.page import captions
from wingwatch.diagnosis.page.figures import (
    gain_figure,
    misfit_figure,
    ranking_figure,
    spectrum_figures,
)
from wingwatch.diagnosis.page.traces import trace_figure
from wingwatch.diagnosis.result import Cause, Diagnosis, Gain, Interval
from wingwatch.diagnosis.summary import (
    by_misfit,
    cause_title,
    chances,
    change_text,
    display,
    label_title,
    parameter_title,
    unexplained_text,
)
from wingwatch.pages.document import Pictures
from wingwatch.pages.markup import items, paragraph, section, table
from wingwatch.pages.texts import listed, number, percent, probability_text, with_error

__all__ = ["sections"]

_MOST_RANKED = 20


def sections(diagnosis: Diagnosis, page: Pictures) -> str:
    """All sections below the answer, in their order."""
    parts = [_traces(diagnosis, page), _misfit(diagnosis, page), _spectra(diagnosis, page)]
    parts += [_ranking(diagnosis, page), _causes(diagnosis), _not_separable(diagnosis)]
    parts += [_gain(diagnosis, page), _derivatives(diagnosis), _unexplained(diagnosis), _notes(diagnosis)]
    return "".join(parts)


def _traces(d: Diagnosis, page: Pictures) -> str:
    figure = trace_figure(d)
    if figure is None:
        return ""
    return section("flight", "The flight and its simulation", page.place(figure, captions.trace_caption(d)))


def _misfit(d: Diagnosis, page: Pictures) -> str:
    if not d.misfit:
        return ""
    head = (
        "channel",
        "R2",
        "Theil",
        "bias",
        "variance",
        "covariance",
        "noise part",
        "white",
        "coherent with",
    )
    rows = []
    for channel in by_misfit(d.misfit):
        m = d.misfit[channel]
        shares = (percent(m.bias), percent(m.variance), percent(m.covariance), percent(m.noise_fraction))
        coherence = sorted(m.coherence.items(), key=lambda item: -item[1])[:2]
        with_whom = ", ".join(f"{display(name).name} {number(value, 2)}" for name, value in coherence) or "-"
        row = (display(channel).name, number(m.r_squared), number(m.tic), *shares)
        rows.append((*row, probability_text(m.whiteness), with_whom))
    return section(
        "misfit",
        "Misfit of the simulation as it stands",
        page.place(misfit_figure(d), captions.misfit_caption(d)),
        table(head, rows),
        paragraph(
            "R2 is the part of the measured variation that the simulation follows. Theil's coefficient is the rms "
            "residual over the sum of the rms of both signals; its proportions say whether the mean (bias), the size "
            "(variance) or the course (covariance) is wrong. The noise part of the residual is of sensors and gusts. "
            "White is the probability of so correlated a residual, were it white. Coherent with: the signal with "
            "which the residual goes together most, from 0 to 1.",
            "legend",
        ),
    )  # fmt: skip


def _spectra(d: Diagnosis, page: Pictures) -> str:
    figures = [page.place(figure) for figure in spectrum_figures(d)]
    if not figures:
        return ""
    grid = f'<div class="grid">{"".join(figures)}</div>'
    return section(
        "spectra", "Residuals over frequency", grid, paragraph(captions.spectrum_caption(d), "caption")
    )


def _ranking(d: Diagnosis, page: Pictures) -> str:
    if not d.ranking:
        return ""
    found = {cause.label for cause in d.causes}
    rows = [
        (label_title(label), number(gain), probability_text(probability), "found" if label in found else "")
        for label, gain, probability in d.ranking[:_MOST_RANKED]
    ]
    more = len(d.ranking) - len(rows)
    return section(
        "ranking",
        "Causes that were tried",
        page.place(ranking_figure(d), captions.ranking_caption(d)),
        table(("cause", "log-likelihood gained alone", "probability", ""), rows),
        paragraph(f"and {more} more that explain less", "legend") if more > 0 else "",
    )


def _causes(d: Diagnosis) -> str:
    body = "".join(_cause(cause) for cause in d.causes)
    return section("causes", "Causes found", body or paragraph("None is beyond doubt."))


def _cause(cause: Cause) -> str:
    rows = [
        (parameter_title(name), with_error(p.value, p.standard_error), p.unit)
        for name, p in cause.parameters.items()
    ]
    chance = chances(cause)
    facts = [f"{chance[:1].upper()}{chance[1:]}; log-likelihood gained {number(cause.gain)}."]
    facts.append(
        f"On windows left out it takes away {percent(cause.held_out_gain)} of what is beyond noise without it."
    )
    if cause.channels:
        facts.append(f"Lowers the misfit of {listed(display(c).name for c in cause.channels)}.")
    if cause.indistinguishable_from:
        rivals = listed(label_title(label) for label in cause.indistinguishable_from)
        facts.append(f"This flight does not distinguish it from {rivals}.")
    if cause.separating_manoeuvre:
        facts.append(f"What would: {cause.separating_manoeuvre}")
    title = f"<h3>{escape(cause_title(cause))}</h3>"
    values = table(("parameter", "value ± standard error", "unit"), rows) if rows else ""
    return f'<article class="card">{title}{paragraph(cause.text)}{values}{items(facts)}</article>'  # fmt: skip


def _not_separable(d: Diagnosis) -> str:
    if not d.not_separable:
        return ""
    rows = [(listed(label_title(label) for label in group.causes), group.reason) for group in d.not_separable]
    return section("inseparable", "Causes that no flight can distinguish", table(("causes", "why"), rows))


def _gain(d: Diagnosis, page: Pictures) -> str:
    if d.gain is None:
        why = (
            "Without a cause there is no extended model." if not d.causes
            else "No extended model is offered: it does not pay on data left out."
        )  # fmt: skip
        return section("gain", "Gain on data left out", paragraph(why))
    picture = page.place(gain_figure(d.gain), captions.gain_caption(d.gain))
    legend = paragraph("In brackets: 95 % intervals, by drawing windows anew.", "legend")
    return section("gain", "Gain on data left out", picture, _gain_table(d.gain), legend)


def _gain_table(gain: Gain) -> str:
    head = ("channel", "R2 before", "R2 after", "Theil before", "Theil after", "rms residual")
    rows = []
    for channel in by_misfit(gain.before):
        before, after = gain.before[channel], gain.after.get(channel)
        if after is None:
            continue
        change = gain.change.get(channel)
        figures = (before.r_squared, after.r_squared, before.tic, after.tic)
        known = gain.intervals.get(channel, {})
        ends = (*known.get("r_squared", (None, None)), *known.get("tic", (None, None)))
        cells = [number(value) + _ends(interval) for value, interval in zip(figures, ends, strict=True)]
        rows.append((display(channel).name, *cells, "-" if change is None else change_text(change)))
    return table(head, rows)


def _ends(interval: Interval | None) -> str:
    """An interval behind its value."""
    return "" if interval is None else f" ({number(interval.low)} to {number(interval.high)})"


def _derivatives(d: Diagnosis) -> str:
    if not d.derivatives:
        return ""
    rows = []
    for symbol, (before, after) in d.derivatives.items():
        known = MODEL_DERIVATIVES.get(symbol)
        change = f"{100.0 * (after / before - 1.0):+.0f} %" if before != 0.0 else "-"
        words = (known.unit, known.meaning) if known is not None else ("", "")
        rows.append((symbol, number(before, 4), number(after, 4), change, *words))
    head = ("derivative", "before", "after", "change", "unit", "meaning")
    return section("derivatives", "Derivatives before and after", table(head, rows))


def _unexplained(d: Diagnosis) -> str:
    return section("unexplained", "What is unexplained", paragraph(unexplained_text(d)))


def _notes(d: Diagnosis) -> str:
    return section("notes", "Notes", items(d.notes)) if d.notes else ""
