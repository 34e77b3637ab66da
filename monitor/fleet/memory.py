"""What a fleet keeps of its vehicles in the store: estimates for the history, and what their flights have taught."""

from functools import partial

from wingwatch.baselines import EstimateRecord
from wingwatch.estimators import Estimate
from wingwatch.monitor.fleet.context import FleetContext
from wingwatch.monitor.fleet.member.saving import Saving
from wingwatch.monitor.fleet.member.states import Said, Watched
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.ports import Store, VehicleMemory
from wingwatch.monitor.vehicle.vehicle_monitor import Report

__all__ = ["adopt_late", "keep", "note_changes", "recalled", "renew"]


def recalled(context: FleetContext, key: VehicleKey, said: Said) -> VehicleMemory | None:
    """What the store keeps of a vehicle, empty without a store; None while it has not been read."""
    store = context.store
    if store is None:
        return VehicleMemory()
    ask = partial(store.recall, *key, said.aircraft, said.message.configuration)
    found: VehicleMemory | None = context.guarded(ask)
    return found


def adopt_late(context: FleetContext, key: VehicleKey, watch: Watched) -> None:
    """What is kept of a vehicle joins what its monitor has, once it has been read; with the fleet's lock held."""
    memory = recalled(context, key, watch.said)
    if memory is not None:
        watch.monitor.adopt(watch.basis.loading.recalled(memory))
        watch.memory.note_late(memory)


def keep(context: FleetContext, key: VehicleKey, watch: Watched, saving: Saving, report: Report) -> None:
    """Hand what new solutions bring to the store, if there is one; to be used with the fleet's lock held."""
    if context.store is not None:
        _keep_estimates(context, context.store, key, watch, saving, report)
        _keep_learned(context, context.store, key, watch)


def _keep_estimates(
    context: FleetContext, store: Store, key: VehicleKey, watch: Watched, saving: Saving, report: Report
) -> None:
    monitor, rows = watch.monitor, list[EstimateRecord]()
    for solution in report.solutions:
        if saving.history_is_due(solution.time_s, context.settings.history_interval_s):
            estimates: list[Estimate] = [e for m in solution.modes.values() for e in m.estimates]
            rows += [
                EstimateRecord.of(*key, e, monitor.aircraft.name, monitor.configuration) for e in estimates
            ]
    if rows:
        context.guarded(lambda: store.append_estimates(rows))


def _keep_learned(context: FleetContext, store: Store, key: VehicleKey, watch: Watched) -> None:
    if not watch.memory.may_be_written:
        return
    monitor, loading = watch.monitor, watch.basis.loading
    name, configuration = monitor.aircraft.name, monitor.configuration
    cells = loading.kept_cells(monitor.cells.take_changed())
    if cells:
        context.guarded(lambda: store.save_cells(*key, name, configuration, cells))
    if watch.memory.take_news(monitor.learned_blocks):
        context.guarded(
            lambda: store.save_references(*key, name, configuration, loading.kept(monitor.references))
        )


def note_changes(context: FleetContext) -> None:
    """What of the vehicles is kept was changed by others: it is to be read again; with the fleet's lock held."""
    changes = None if context.store is None else context.guarded(context.store.baseline_changes)
    for change in changes or ():
        for key, known in context.vehicles.items():
            watch = known.watch
            if watch is None or change.id <= watch.memory.change:
                continue
            if change.concerns(*key, watch.monitor.aircraft.name, watch.monitor.configuration):
                watch.memory.note_change(change)


def renew(context: FleetContext, key: VehicleKey, watch: Watched, maker: MonitorMaker) -> bool:
    """Take in what is kept of a vehicle in the place of what was, once it has been read; with the fleet's lock held.

    Returns:
        whether it has been.
    """
    monitor, loading, store = watch.monitor, watch.basis.loading, context.store
    if watch.memory.renewal is None or store is None or not watch.memory.read:
        return False
    if not maker.ready(loading.aircraft, monitor.configuration, watch.given):
        return False
    ask = partial(store.recall, *key, loading.stated, monitor.configuration)
    memory: VehicleMemory | None = context.guarded(ask)
    if memory is None:
        return False
    lacking = [name for name in monitor.chain.envelopes if name not in memory.envelopes]
    stated = maker.stated(loading.aircraft, monitor.configuration, lacking)
    monitor.renew(loading.recalled(memory), stated)
    watch.memory.note_renewed(memory, monitor.learned_blocks)
    return True
