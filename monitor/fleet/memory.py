"""What a fleet keeps of its vehicles in the store: estimates for the history, and what their flights have taught."""

from functools import partial

from wingwatch.baselines import EstimateRecord
from wingwatch.estimators import Estimate
from wingwatch.monitor.fleet.context import FleetContext
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.ports import Store, VehicleMemory
from wingwatch.monitor.vehicle.vehicle_monitor import Report, VehicleMonitor

__all__ = ["keep", "learned_blocks", "note_changes", "renew"]


def keep(context: FleetContext, key: VehicleKey, known: KnownVehicle, report: Report) -> None:
    """Hand what new solutions bring to the store, if there is one; to be used with the fleet's lock held."""
    if context.store is None or known.monitor is None:
        return
    _keep_estimates(context, context.store, key, known, report)
    _keep_learned(context, context.store, key, known)


def _keep_estimates(
    context: FleetContext, store: Store, key: VehicleKey, known: KnownVehicle, report: Report
) -> None:
    monitor, rows = known.monitor, list[EstimateRecord]()
    if monitor is None:
        return
    for solution in report.solutions:
        since = solution.time_s - known.history_s
        if 0.0 <= since < context.settings.history_interval_s - 1e-6:
            continue
        known.history_s = solution.time_s
        estimates: list[Estimate] = [e for m in solution.modes.values() for e in m.estimates]
        rows += [EstimateRecord.of(*key, e, monitor.aircraft.name, monitor.configuration) for e in estimates]
    if rows:
        context.guarded(lambda: store.append_estimates(rows))


def _keep_learned(context: FleetContext, store: Store, key: VehicleKey, known: KnownVehicle) -> None:
    monitor, loading = known.monitor, known.loading
    if monitor is None or not known.recalled or loading is None or known.renewal is not None:
        return  # nothing is written over what has not been read
    name, configuration = monitor.aircraft.name, monitor.configuration
    cells = loading.kept_cells(monitor.cells.take_changed())
    if cells:
        context.guarded(lambda: store.save_cells(*key, name, configuration, cells))
    learned = learned_blocks(monitor)
    if learned > known.saved_blocks:
        known.saved_blocks = learned
        context.guarded(
            lambda: store.save_references(*key, name, configuration, loading.kept(monitor.references))
        )


def learned_blocks(monitor: VehicleMonitor) -> int:
    """Blocks that a vehicle's references rest on; one more means there is something new to keep."""
    return sum(r.blocks for r in monitor.references.values())


def note_changes(context: FleetContext) -> None:
    """What of the vehicles is kept was changed by others: it is to be read again; with the fleet's lock held."""
    changes = None if context.store is None else context.guarded(context.store.baseline_changes)
    for change in changes or ():
        for key, known in context.vehicles.items():
            monitor = known.monitor
            if monitor is None or change.id <= known.change:
                continue
            if change.concerns(*key, monitor.aircraft.name, monitor.configuration):
                known.renewal = change


def renew(context: FleetContext, key: VehicleKey, known: KnownVehicle, maker: MonitorMaker) -> None:
    """Take in what is kept of a vehicle in the place of what was, once it has been read; with the fleet's lock held."""
    monitor, loading, store = known.monitor, known.loading, context.store
    if known.renewal is None or monitor is None or loading is None or store is None or not known.recalled:
        return
    if not maker.ready(loading.aircraft, monitor.configuration, known.given):
        return
    ask = partial(store.recall, *key, loading.stated, monitor.configuration)
    memory: VehicleMemory | None = context.guarded(ask)
    if memory is None:
        return
    lacking = [name for name in monitor.chain.envelopes if name not in memory.envelopes]
    stated = maker.stated(loading.aircraft, monitor.configuration, lacking)
    monitor.renew(loading.recalled(memory), stated)
    known.change, known.renewed, known.renewal = memory.change, known.renewal, None
    known.saved_blocks, known.unsaved = learned_blocks(monitor), True
