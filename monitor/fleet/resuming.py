"""From a vehicle that is known to its checkpoint, and from the checkpoint to a vehicle that goes on.

What a checkpoint says is checked against what the program has now: the aircraft, the settings, the alerts that the
database keeps. Where they differ, the vehicle starts anew and one sentence says why.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import Envelope
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.fleet.member.known_vehicle import FAULT_SHOWN_S, KnownVehicle
from wingwatch.monitor.fleet.member.loading import loading_of
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle.checkpoint import CheckpointError, SavedVehicle, settings_of
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor, suspected
from wingwatch.monitor.views import AlertState, AlertView
from wingwatch.telemetry import SampleBlock, SensorsMessage

__all__ = ["RESUMED_S", "Checkpoints", "agreed", "goes_on", "resumed_vehicle", "saved_vehicle"]

RESUMED_S = 3600.0
"""Silence after which a vehicle starts a new flight: the cleaner takes a longer step forward for another clock."""


class Checkpoints(Protocol):
    """Where checkpoints are kept. Nothing here waits for a disk but ``load``, and nothing raises."""

    def load(self) -> Sequence[SavedVehicle]:
        """All that can be read, their silence as of now; what cannot be read is counted and said."""
        ...

    def has_room(self) -> bool:
        """Whether one more would be written soon."""
        ...

    def keep(self, saved: SavedVehicle, urgent: bool) -> None:
        """Write this state in the place of the vehicle's earlier one; returns at once.

        Args:
            urgent: before all that wait, whether there is room or not.
        """
        ...

    def count(self, what: str, text: str = "") -> None:
        """``resumed``, ``expired``, ``failed`` or ``refused``, and why where that is to be said."""
        ...


def saved_vehicle(key: VehicleKey, known: KnownVehicle, now_s: float) -> SavedVehicle | None:
    """All that is known of a vehicle; None where there is nothing to go on from, or a fault may have damaged it."""
    if known.monitor is None or known.message is None or known.watched_as is None:
        return None
    heard_s = known.heard_s if known.received_s is None else known.received_s
    if now_s - known.fault_s <= FAULT_SHOWN_S:
        return None
    return SavedVehicle(
        fleet=key[0], vehicle=key[1], settings=known.settings, silent_s=now_s - heard_s,
        message=known.message, watched_as=known.watched_as, given=known.given, late=known.late,
        recalled=known.recalled, counts=dict(known.counts), arrivals=known.arrivals.state,
        history_s=known.history_s, waiting=known.waiting, monitor=known.monitor.saved(),
    )  # fmt: skip


def goes_on(saved: SavedVehicle, config: JudgeConfig) -> bool:
    """Whether a vehicle resumes its flight: it sent within ``RESUMED_S``, or an alert stands or is suspected."""
    return saved.silent_s <= RESUMED_S or saved.alarmed or suspected(saved.monitor.memory, config)


def resumed_vehicle(
    saved: SavedVehicle,
    find: Callable[[str], Aircraft],
    maker: MonitorMaker,
    envelopes: Callable[[Aircraft, str], Mapping[str, Envelope]],
) -> KnownVehicle:
    """The vehicle as it was when it was saved, with the samples that waited; none has arrived since.

    Args:
        find: the aircraft of a name; raises ValueError for an unknown one.
        maker: of monitors.
        envelopes: expectations that the database has for a type in a configuration.

    Raises:
        CheckpointError: the vehicle cannot go on from this, with the reason.
    """
    known = KnownVehicle(message=saved.message, watched_as=saved.watched_as)
    try:
        known.aircraft = find(saved.message.aircraft)
        watched = find(saved.watched_as.aircraft)
    except ValueError as error:
        raise CheckpointError(str(error)) from error
    known.announce_loading()
    known.loading = loading_of(watched, saved.watched_as)
    if saved.watched_as == saved.message:
        known.loading = known.announced
    if known.loading is None:
        raise CheckpointError("its loading is not known")
    found = VehicleMemory(envelopes=envelopes(watched, saved.watched_as.configuration))
    memory = known.loading.recalled(found)
    monitor = maker.make(
        saved.fleet, saved.vehicle, known.loading.aircraft, saved.watched_as, saved.given,
        VehicleMemory() if saved.late or not saved.recalled else memory,
    )  # fmt: skip
    known.settings = settings_of(monitor, saved.given)
    if known.settings != saved.settings:
        raise CheckpointError("it was saved under another aircraft file, baseline or setting")
    if saved.late:
        monitor.adopt(memory)
    try:
        monitor.restore(saved.monitor)
    except ValueError as error:
        raise CheckpointError(f"it does not fit this aircraft: {error}") from error
    known.monitor, known.given, known.late, known.recalled = monitor, saved.given, saved.late, saved.recalled
    known.counts, known.history_s = dict(saved.counts), saved.history_s
    known.arrivals.resume(saved.arrivals)
    if len(saved.waiting):
        known.hold(SensorsMessage(0, SampleBlock(saved.waiting), saved.given))
    return known


def agreed(
    monitor: VehicleMonitor, kept: Mapping[str, AlertView | None], standing: Sequence[AlertView]
) -> list[AlertView]:
    """Bring a resumed monitor's alerts in line with the database; those that the database has not as they are.

    The database may know more, for it may have been written after the checkpoint, or less.

    Args:
        monitor: resumed, or new where there was no checkpoint.
        kept: by name, the alerts in force as the database has them; None where it has none of that name.
        standing: the vehicle's alerts in the database that are not cleared, oldest first.
    """
    missing: list[AlertView] = []
    for active in monitor.active_alerts:
        known = kept.get(active.id)
        if known is None:
            missing.append(active)
        elif known.state is AlertState.CLEARED:
            if monitor.book.active is not None and active.id == monitor.book.active.id:
                monitor.dismiss(by_person=known.note != active.note)
            else:
                monitor.take_over(known)
        elif len(known.note) < len(active.note):  # notes only grow
            missing.append(active)
        else:
            monitor.take_over(known)
    airframe = [alert for alert in standing if alert.channel is None]
    if airframe and not _of_airframe(monitor):
        monitor.follow_again(airframe[-1])
    of_airframe = _of_airframe(monitor)
    for alert in standing:
        if alert.channel is not None and alert.id not in of_airframe:  # a diagnosis may have named its part
            monitor.follow_again(alert)
    return missing


def _of_airframe(monitor: VehicleMonitor) -> list[str]:
    """Ids of the alerts about the airframe that are in force."""
    return [alert.id for alert in monitor.active_alerts if alert.channel is None]
