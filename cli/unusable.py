"""Flights of which nothing could be judged, and the likely cause in one sentence."""

import numpy as np

from wingwatch.cli.flight_watch import Watched
from wingwatch.operations.faults import CommandError

__all__ = ["refuse_unusable"]

_SLOW_S = 0.1


def refuse_unusable(watched: Watched) -> None:
    """Refuse a flight without a solution, for silence would read as health.

    Raises:
        CommandError: there was no solution and no alert.
    """
    if not watched.monitor.solved and not watched.alerts:
        raise CommandError(f"{watched.flight.source}: nothing could be judged: {_why(watched)}")


def _why(watched: Watched) -> str:
    monitor, rows = watched.monitor, len(watched.flight.block)
    report = monitor.cleaner.report
    if not report.accepted:
        return _why_rejected(watched, rows)
    time_s = watched.flight.block.time_s
    steps = np.diff(time_s[np.isfinite(time_s)])
    steps = steps[steps > 0.0]
    if steps.size and float(np.median(steps)) > _SLOW_S:
        step_s = float(np.median(steps))
        return (
            f"one sample in {step_s:.3g} s is too slow for these modes (10 Hz at least, 50 Hz is good): log faster, or "
            'give the unit of the stamps in a channel map, as time_s = { source = "time_s", unit = "ms" }'
        )
    if monitor.waits:
        return monitor.waits
    left = f", {watched.cleaning_text.partition('; ')[2]}" if report.rejected else ""
    return (
        f"{report.accepted} samples in {watched.duration_s:.3g} s are too short a flight: it takes half a second at "
        f"least, and a minute with manoeuvres to say something{left}"
    )


def _why_rejected(watched: Watched, rows: int) -> str:
    """Why the cleaner accepted none of the rows."""
    report = watched.monitor.cleaner.report
    if not report.rejected:
        return f"{rows} rows are too few to believe their clock"
    reason = max(report.rejected, key=lambda name: report.rejected[name])
    faults = sorted(report.by_channel.items(), key=lambda item: (-item[1], item[0]))
    most = ", ".join(f"{name} in {count}" for name, count in faults[:4])
    if reason == "non_finite":
        return (
            f"no row has a value of every channel that is required (of {rows} rows there is none for {most})"
        )
    if reason == "out_of_range":
        return (
            f"every row has a reading that no working sensor shows (of {rows} rows: {most}); check its unit"
        )
    return f"the stamps do not rise ({watched.cleaning_text.partition('; ')[2]}); check the column of time_s"
