"""Comparisons as rows of text: the same cells on a terminal, in Markdown and on a page."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from wingwatch.aircraft import doublet_pulse_s
from wingwatch.studies.thesis.printed import plants, printed_pulses
from wingwatch.studies.thesis.tables import FIT, Z_95, Compared, Quantity

__all__ = ["SUMMARY_HEAD", "Grid", "grid_of", "number", "pulses_grid", "summary_cells", "with_error"]

SUMMARY_HEAD = ("table", "shows", "printed", "ours", "apart", "truth in 95 %: printed", "ours")
_NONE = "-"


@dataclass(frozen=True, slots=True)
class Grid:
    """Cells with a head.

    Attributes:
        head: of the columns.
        rows: as many cells each.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def number(value: float | None) -> str:
    """Four digits, or four decimals below 1, as the thesis prints."""
    if value is None or not math.isfinite(value):
        return _NONE
    if abs(value) >= 1.0 or value == 0.0:
        return f"{value:.4g}"
    return f"{value:.4f}".rstrip("0").rstrip(".") if abs(value) >= 0.001 else f"{value:.1g}"


def with_error(value: float | None, error: float | None) -> str:
    """A value and its standard error."""
    if value is None or error is None or not math.isfinite(value):
        return number(value)
    if error == 0.0:
        return f"{number(value)} ± 0.000"
    return f"{number(value)} ± {error:.2g}"


def _apart(one: Quantity) -> str:
    """In joint standard errors; in percent where there is no noise."""
    if one.ours is None:
        return _NONE
    if one.apart is not None:
        return f"{one.apart:+.1f} se"
    return f"{100.0 * (one.ours - one.printed) / abs(one.printed):+.1f} %" if one.printed else _NONE


def _share(share: float | None) -> str:
    return _NONE if share is None else f"{100.0 * share:.0f} %"


def grid_of(found: Compared) -> Grid:
    """All rows of a table."""
    if found.table.kind == "fit":
        return _fits(found)
    head = ("case", "", "true", "printed", "ours", "apart", "rms error of draws", "truth in 95 %")
    return Grid(
        head,
        tuple(
            (
                one.case,
                one.name,
                number(one.true),
                with_error(one.printed, one.printed_error),
                with_error(one.ours, one.ours_error),
                _apart(one),
                number(one.rms_error),
                _share(one.inside),
            )
            for one in found.quantities
        ),
    )


def _fits(found: Compared) -> Grid:
    head = ("case", *(f"{name}{who}" for name in FIT for who in (": printed", ": ours")))
    rows = []
    for case, group in groupby(found.quantities, lambda one: one.case):
        cells = [text for one in group for text in (number(one.printed), _fit_figure(one))]
        rows.append((case, *cells))
    return Grid(head, tuple(rows))


def _fit_figure(one: Quantity) -> str:
    """First draw, and how far draws scatter."""
    return with_error(one.ours, one.scatter)


def summary_cells(found: Compared) -> tuple[str, ...]:
    """One line of the summary."""
    table = found.table
    shows = f"{table.plant.title}: {table.about}"
    theirs, ours, apart = {"derivatives": _derivatives, "fit": _fit, "frequency": _frequency}[table.kind](
        [one for one in found.quantities if one.ours is not None]
    )
    if table.plant.flown and table.kind == "derivatives":
        theirs = "of an aircraft in flight"
    printed = [one for one in found.quantities if one.printed_error is not None and one.apart is not None]
    held = sum(
        abs(one.printed - one.true) <= Z_95 * one.printed_error
        for one in printed
        if one.true is not None and one.printed_error is not None
    )
    shares = [one.inside for one in found.quantities if one.inside is not None]
    return (
        table.number,
        shows,
        theirs,
        ours,
        apart,
        _NONE if table.plant.flown or not printed else f"{held} of {len(printed)}",
        _share(float(np.mean(shares))) if shares else _NONE,
    )


def _derivatives(rows: Sequence[Quantity]) -> tuple[str, str, str]:
    """Median error in percent of the truth, and how many are more than two joint errors apart; noisy cases alone."""

    def median(values: Sequence[float | None]) -> str:
        off = [
            abs(v - one.true) / abs(one.true)
            for v, one in zip(values, rows, strict=True)
            if v is not None and one.true
        ]
        return f"median error {100.0 * float(np.median(off)):.2g} %"

    far = [one for one in rows if one.apart is not None]
    rows = far or rows
    apart = (
        f"{sum(abs(one.apart or 0.0) > 2.0 for one in far)} of {len(far)} beyond 2 se" if far else "no noise"
    )
    return median([one.printed for one in rows]), median([one.ours for one in rows]), apart


def _range(values: Sequence[float | None], form: str) -> str:
    known = [v for v in values if v is not None]
    if not known:
        return _NONE
    low, high = format(min(known), form), format(max(known), form)
    return low if low == high else f"{low} to {high}"


def _fit(rows: Sequence[Quantity]) -> tuple[str, str, str]:
    """Ranges of R2 and Theil's coefficient."""
    r2, theil = ([one for one in rows if one.name == name] for name in FIT[:2])
    texts = [
        f"R2 {_range(a, '.0f')} %, Theil {_range(b, '.2f')}"
        for a, b in (
            ([one.printed for one in r2], [one.printed for one in theil]),
            ([one.ours for one in r2], [one.ours for one in theil]),
        )
    ]
    most = max((abs((one.ours or 0.0) - one.printed) for one in r2), default=0.0)
    return texts[0], texts[1], f"R2 up to {most:.0f} points"


def _frequency(rows: Sequence[Quantity]) -> tuple[str, str, str]:
    """Ranges of natural frequency and damping ratio."""
    natural, damping = ([one for one in rows if one.name.startswith(name)] for name in ("natural", "damping"))
    texts = [
        f"{_range(a, '.2f')} rad/s, damping {_range(b, '.3f')}"
        for a, b in (
            ([one.printed for one in natural], [one.printed for one in damping]),
            ([one.ours for one in natural], [one.ours for one in damping]),
        )
    ]
    most = max((abs((one.ours or 0.0) / one.printed - 1.0) for one in natural), default=0.0)
    return texts[0], texts[1], f"up to {100.0 * most:.0f} % in rad/s"


def pulses_grid() -> Grid:
    """Table 7.1 beside the width that ``wingwatch.aircraft`` gives for the printed frequency."""
    rows = [
        (
            plants()[plant].title,
            number(frequency),
            f"{width:.4f}",
            f"{doublet_pulse_s(frequency):.4f}",
            f"{100.0 * (doublet_pulse_s(frequency) / width - 1.0):+.2f} %",
        )
        for plant, (frequency, width) in printed_pulses().by_plant.items()
    ]
    return Grid(("plant", "rad/s", "pulse printed, s", "ours, s", "apart"), tuple(rows))
