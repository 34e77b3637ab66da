"""Vehicles fed together: those of one type advance as one batch, each as if it were alone."""

from collections.abc import Sequence

from wingwatch.monitor.vehicle.vehicle_monitor import Report, VehicleMonitor
from wingwatch.telemetry import SampleBlock

__all__ = ["feed_together"]


def feed_together(
    monitors: Sequence[VehicleMonitor], blocks: Sequence[SampleBlock]
) -> list[Report | Exception]:
    """Take in samples of different vehicles as they came, ``VehicleMonitor.feed`` for all of them at once.

    Args:
        monitors: each once.
        blocks: of each, completed, not cleaned.

    Returns:
        what the samples of each led to, or what the program failed on; that does not touch the others.
    """
    reports: list[Report | Exception] = [Report() for _ in monitors]
    clean: dict[int, SampleBlock] = {}
    types: dict[int, list[int]] = {}
    for n, (monitor, block) in enumerate(zip(monitors, blocks, strict=True)):
        try:
            clean[n] = monitor.prepared(block)
        except Exception as error:
            reports[n] = error
            continue
        types.setdefault(id(monitor.chain.supervisor), []).append(n)
    for numbers in types.values():
        found = _advance([monitors[n] for n in numbers], [clean[n] for n in numbers])
        for n, report in zip(numbers, found, strict=True):
            reports[n] = report
    return reports


def _advance(monitors: Sequence[VehicleMonitor], blocks: Sequence[SampleBlock]) -> list[Report | Exception]:
    """Vehicles whose chains share their estimators, with clean samples."""
    found: list[Report] = [Report() for _ in monitors]
    faults: dict[int, Exception] = {}
    chain, states = monitors[0].chain, [m.chain_state for m in monitors]
    for solutions in chain.advance_together(states, blocks, faults):
        for n, solution in solutions.items():
            try:
                judged = monitors[n].judge_solution(solution)
                monitors[n].enter_cells(judged)
            except Exception as error:  # one vehicle's fault is not the others'
                faults[n] = error
                continue
            found[n].add(solution, judged)
    for n, monitor in enumerate(monitors):
        if n not in faults:
            found[n].add_alerts(monitor.after_samples())
    return [faults.get(n, report) for n, report in enumerate(found)]
