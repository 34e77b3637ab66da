"""From a vehicle that is known to its checkpoint, and from the checkpoint to a vehicle that goes on.

What a checkpoint says is checked against what the program has now: the aircraft, the settings, the alerts that the
database keeps. Where they differ, the vehicle starts anew and one sentence says why.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import Envelope
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.fleet.member.counts import VehicleCounts
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.loading import loading_of
from wingwatch.monitor.fleet.member.recalled_memory import RecalledMemory
from wingwatch.monitor.fleet.member.saving import Saving
from wingwatch.monitor.fleet.member.shown import FAULT_SHOWN_S
from wingwatch.monitor.fleet.member.states import Basis, Said, Watched
from wingwatch.monitor.fleet.member.waiting import WaitingSamples
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
    watch = known.watch
    if watch is None or now_s - known.fault.at_s <= FAULT_SHOWN_S:
        return None
    return SavedVehicle(
        fleet=key[0], vehicle=key[1], settings=watch.settings, silent_s=now_s - known.messages.last_s,
        message=watch.said.message, watched_as=watch.basis.message, given=watch.given, late=watch.memory.late,
        recalled=watch.memory.read, counts=dict(known.counts.own), arrivals=known.messages.sequence.state,
        history_s=known.saving.history_s, waiting=watch.samples.values, monitor=watch.monitor.saved(),
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
    try:
        aircraft, watched = find(saved.message.aircraft), find(saved.watched_as.aircraft)
    except ValueError as error:
        raise CheckpointError(str(error)) from error
    said = Said(saved.message, aircraft, loading_of(aircraft, saved.message))
    loading = said.loading
    if saved.watched_as != saved.message:
        loading = loading_of(watched, saved.watched_as)
    memory = loading.recalled(VehicleMemory(envelopes=envelopes(watched, saved.watched_as.configuration)))
    monitor = maker.make(
        saved.fleet, saved.vehicle, loading.aircraft, saved.watched_as, saved.given,
        VehicleMemory() if saved.late or not saved.recalled else memory,
    )  # fmt: skip
    if settings_of(monitor, saved.given) != saved.settings:
        raise CheckpointError("it was saved under another aircraft file, baseline or setting")
    if saved.late:
        monitor.adopt(memory)
    try:
        monitor.restore(saved.monitor)
    except ValueError as error:
        raise CheckpointError(f"it does not fit this aircraft: {error}") from error
    samples = WaitingSamples()
    if len(saved.waiting):
        samples.add(SensorsMessage(0, SampleBlock(saved.waiting), saved.given))
    watch = Watched(
        said, Basis(saved.watched_as, loading), samples, monitor, saved.given, saved.settings,
        RecalledMemory(saved.recalled, saved.late),
    )  # fmt: skip
    return KnownVehicle(
        watch, counts=VehicleCounts(dict(saved.counts)), saving=Saving(history_s=saved.history_s)
    )


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
        monitor.reinstate(airframe[-1])
    of_airframe = _of_airframe(monitor)
    for alert in standing:
        if alert.channel is not None and alert.id not in of_airframe:  # a diagnosis may have named its part
            monitor.reinstate(alert)
    return missing


def _of_airframe(monitor: VehicleMonitor) -> list[str]:
    """Ids of the alerts about the airframe that are in force."""
    return [alert.id for alert in monitor.active_alerts if alert.channel is None]
