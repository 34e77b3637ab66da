"""A diagnosis on a terminal, in the order of the report."""

from collections.abc import Iterator

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import MODEL_DERIVATIVES
from wingwatch.diagnosis import Cause, Diagnosis, Gain, Misfit
from wingwatch.diagnosis.summary import (
    by_misfit,
    cause_title,
    chances,
    change_text,
    display,
    headline,
    label_title,
    parameter_text,
    unexplained_text,
)
from wingwatch.pages.texts import listed, number, percent, probability_text

__all__ = ["show"]

_MOST_RANKED = 10


def show(console: Console, found: Diagnosis) -> None:
    """Print the answer, then what it rests on."""
    answer, gained = headline(found)
    console.print(f"[bold]{escape(answer)}[/]")
    if gained:
        console.print(escape(gained))
    console.print(
        f"{escape(found.source)}  aircraft {found.aircraft.name}, {found.seconds:.0f} s in {found.windows} windows",
        style="dim",
    )
    console.print(_misfits(found))
    if found.ranking:
        console.print(_ranking(found))
    for cause in found.causes:
        console.print(f"\n[bold]{escape(cause_title(cause))}[/]  {chances(cause)}")
        for line in _cause_lines(cause):
            console.print(f"  {escape(line)}")
    for group in found.not_separable:
        console.print(
            f"no flight tells apart {escape(listed(map(label_title, group.causes)))}: {escape(group.reason)}"
        )
    if found.gain is not None:
        console.print(_gain(found.gain))
    if found.derivatives:
        console.print(_derivatives(found))
    console.print(escape(unexplained_text(found)))
    for note in found.notes:
        console.print(f"note: {escape(note)}", style="yellow")


def _table(title: str, *columns: str) -> Table:
    """The first column names the row, the others are figures."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for i, name in enumerate(columns):
        table.add_column(name, justify="right" if i else "left")
    return table


def _misfits(found: Diagnosis) -> Table:
    table = _table(
        "misfit of the simulation as it stands",
        "channel", "R2", "Theil", "bias, variance, covariance", "noise", "white", "coherent with",
    )  # fmt: skip
    for channel in by_misfit(found.misfit):
        m = found.misfit[channel]
        parts = ", ".join(percent(p) for p in (m.bias, m.variance, m.covariance))
        row = (
            number(m.r_squared),
            number(m.tic),
            parts,
            percent(m.noise_fraction),
            probability_text(m.whiteness),
        )
        table.add_row(channel, *row, escape(_coherent(m)))
    return table


def _coherent(misfit: Misfit) -> str:
    """The signal with which the residual goes together most."""
    if not misfit.coherence:
        return "-"
    name = max(misfit.coherence, key=lambda key: misfit.coherence[key])
    return f"{display(name).name} {number(misfit.coherence[name], 2)}"


def _ranking(found: Diagnosis) -> Table:
    names = {cause.label for cause in found.causes}
    table = _table("causes tried, best first", "cause", "log-likelihood gained alone", "probability", "")
    for label, gain, probability in found.ranking[:_MOST_RANKED]:
        mark = "found" if label in names else ""
        table.add_row(escape(label_title(label)), number(gain), probability_text(probability), mark)
    if len(found.ranking) > _MOST_RANKED:
        table.caption = f"and {len(found.ranking) - _MOST_RANKED} more"
    return table


def _cause_lines(cause: Cause) -> Iterator[str]:
    if cause.text:
        yield cause.text
    for name, parameter in cause.parameters.items():
        yield parameter_text(name, parameter)
    if cause.channels:
        yield f"lowers the misfit of {listed(display(c).name for c in cause.channels)}"
    yield (
        f"log-likelihood gained {number(cause.gain)}; on windows left out it takes away "
        f"{percent(cause.held_out_gain)} of what is beyond noise without it"
    )
    if cause.indistinguishable_from:
        yield f"this flight does not distinguish it from {listed(map(label_title, cause.indistinguishable_from))}"
    if cause.separating_manoeuvre:
        yield f"what would: {cause.separating_manoeuvre}"


def _gain(gain: Gain) -> Table:
    title = f"judged on {gain.source}"
    table = _table(title, "channel", "R2 before", "after", "Theil before", "after", "rms residual")
    for channel in by_misfit(gain.before):
        before, after = gain.before[channel], gain.after.get(channel)
        if after is None:
            continue
        change = gain.change.get(channel)
        table.add_row(
            channel,
            number(before.r_squared), number(after.r_squared), number(before.tic), number(after.tic),
            "-" if change is None else change_text(change),
        )  # fmt: skip
    return table


def _derivatives(found: Diagnosis) -> Table:
    table = _table("derivatives", "symbol", "unit", "before", "after", "change")
    for symbol, (before, after) in found.derivatives.items():
        unit = MODEL_DERIVATIVES[symbol].unit if symbol in MODEL_DERIVATIVES else ""
        change = f"{100.0 * (after / before - 1.0):+.0f} %" if before != 0.0 else "-"
        table.add_row(symbol, unit, number(before, 4), number(after, 4), change)
    return table
