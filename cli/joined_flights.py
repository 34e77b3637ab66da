"""Several flights of one aircraft as one, for estimates that rest on all of them."""

from collections.abc import Sequence

import numpy as np

from wingwatch.operations.faults import CommandError
from wingwatch.telemetry import FlightReport, FlightTable, SampleBlock

__all__ = ["joined"]

BETWEEN_S = 10.0
"""Between the last stamp of a flight and the first of the next: a gap, over which nothing is bridged."""


def joined(flights: Sequence[FlightTable]) -> FlightTable:
    """The flights one after another, on the clock of the first.

    Later flights are moved in time to begin ten seconds after the one before has ended. Channels that one of them
    lacks are left out of all.

    Raises:
        CommandError: a surface is a position in one flight and a command in another.
    """
    if len(flights) == 1:
        return flights[0]
    first = flights[0]
    for other in flights[1:]:
        for surface, kind in first.kinds.items():
            if other.kinds.get(surface, kind) != kind:
                raise CommandError(
                    f"{surface} is a {kind} in {first.source} and a {other.kinds[surface]} in {other.source}; "
                    "name the same kind for both in a channel map"
                )
    common = [name for name in first.block.present if all(name in f.block.present for f in flights)]
    pieces, end = [], float("nan")
    for flight in flights:
        columns = {name: flight.block.column(name).copy() for name in common}
        stamps = columns["time_s"]
        known = stamps[np.isfinite(stamps)]
        if known.size and np.isfinite(end):
            stamps += end + BETWEEN_S - known.min()
        if known.size:
            end = float(np.nanmax(stamps))
        pieces.append(SampleBlock.from_columns(columns))
    return FlightTable(
        SampleBlock.concatenate(pieces),
        {name: kind for name, kind in first.kinds.items() if name in common},
        {name: quality for name, quality in first.quality.items() if name in common},
        ", ".join(f.source for f in flights),
        _together([f.report for f in flights]),
        first.entries,
    )


def _together(reports: Sequence[FlightReport]) -> FlightReport:
    def once(rows: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(entry for row in rows for entry in row))

    return FlightReport(
        sum(r.rows_read for r in reports),
        sum(r.rows_kept for r in reports),
        once([r.unused for r in reports]),
        once([r.ignored for r in reports]),
        once([r.notes for r in reports]),
    )
