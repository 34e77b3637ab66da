"""A known vehicle as an operator sees it: the state that everything known of it makes, and why."""

from collections.abc import Collection
from dataclasses import replace
from datetime import UTC, datetime

from wingwatch.baselines import ChangeRecord
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.states import Recalling, Stranger, Watched
from wingwatch.monitor.views import VehicleState, VehicleView

__all__ = ["FAULT_SHOWN_S", "LEFT_OUT", "bare_view", "fault_text", "standing", "view"]

FAULT_SHOWN_S = 30.0
"""Wall-clock time for which a fault is shown after the last one: three blocks, so that no block passes in silence."""

LEFT_OUT = "degraded service: this vehicle is not watched, because the machine is overloaded"
"""The reason of a vehicle that is left out."""

_REFUSED = (
    "Messages of a second publisher under this name are refused: two aircraft with one name, or a forger"
)


def standing(known: KnownVehicle, now_s: float, stale_s: float) -> tuple[VehicleState, str | None]:
    """State, and its reason where that is not the monitor's own.

    An alert stands through silence and faults; neither passes for health. Channels that contradict each other do not
    either.

    Args:
        now_s: wall clock.
        stale_s: silence after which it is stale.
    """
    watch, messages = known.watch, known.messages
    faulty = now_s - known.fault.at_s <= FAULT_SHOWN_S
    blind = fault_text(known) if faulty else LEFT_OUT if known.left_out else None
    contradiction = "" if watch is None else _contradiction(watch)
    if watch is not None and watch.monitor.state is VehicleState.DEGRADED:
        meanwhile = blind or contradiction
        return VehicleState.DEGRADED, f"{watch.monitor.reason} Meanwhile {meanwhile}" if meanwhile else None
    if blind:
        return VehicleState.UNKNOWN, blind
    if watch is None:
        return VehicleState.UNKNOWN, _unknown_because(known)
    if messages.received_s is None or now_s - messages.received_s > stale_s:
        if now_s - messages.refused_s <= stale_s:
            return VehicleState.STALE, "messages arrive, but none that can be used: see the counts"
        return VehicleState.STALE, "no samples are arriving"
    if contradiction:
        return VehicleState.NOT_OBSERVABLE, contradiction
    return watch.monitor.state, None


def view(
    known: KnownVehicle, key: tuple[str, str], now_s: float, stale_s: float, alerts: Collection[str]
) -> VehicleView:
    """The vehicle as an operator sees it.

    Args:
        key: its fleet and name.
        now_s: wall clock.
        stale_s: silence after which it is stale.
        alerts: ids of all that are kept.
    """
    watch, messages = known.watch, known.messages
    state, reason = standing(known, now_s, stale_s)
    refused = now_s - messages.owner.refused_s <= FAULT_SHOWN_S
    if watch is None:
        return bare_view(known, key, state, _with_refusal(reason or "", refused))
    found = watch.monitor.view()
    unread = "" if watch.memory.read else " Its earlier flights have not been read yet."
    loaded = f" {text}" if (text := _loading_text(watch)) else ""
    return replace(
        found,
        state=state,
        reason=_with_refusal(found.reason if reason is None else reason, refused),
        basis_text=found.basis_text + loaded + unread + _change_text(watch.memory.renewed),
        counts=known.all_counts,
        active_alerts=tuple(name for name in found.active_alerts if name in alerts),
        mass_kg=watch.basis.loading.mass_kg,
        cg_shift_m=watch.basis.loading.cg_shift_m,
        sample_age_s=None if messages.received_s is None else max(now_s - messages.received_s, 0.0),
    )


def bare_view(known: KnownVehicle, key: tuple[str, str], state: VehicleState, reason: str) -> VehicleView:
    """The vehicle without anything that its monitor says."""
    fleet, vehicle = key
    message = known.message
    return VehicleView(
        fleet=fleet, vehicle=vehicle, aircraft=message.aircraft if message else None,
        configuration=message.configuration if message else None, state=state, state_since_s=None,
        reason=reason, last_sample_time_s=None, basis=None, basis_text="Nothing has been compared yet.",
        worst=None, counts=known.all_counts, active_alerts=(), condition={},
    )  # fmt: skip


def fault_text(known: KnownVehicle) -> str:
    """The program's faults over a vehicle in one clause."""
    times = known.counts.own.get("faults", 0)
    return f"the program failed on its samples {times} times, last with {known.fault.text}"


def _unknown_because(known: KnownVehicle) -> str:
    if known.message is None:
        return "samples arrive, but the vehicle has not announced its aircraft"
    if isinstance(known.state, Recalling) and known.waiting:
        return "its earlier flights are being read from the database"
    problem = known.state.problem if isinstance(known.state, Stranger) else ""
    return problem or "announced; no samples yet"


def _contradiction(watch: Watched) -> str:
    """Channels that contradict each other in one clause; empty where none do."""
    said = watch.contradictions.text
    return f"its channels contradict each other: {said}" if said else ""


def _loading_text(watch: Watched) -> str:
    """The loading in use, and what of that which was announced is not used."""
    loading, announced = watch.basis.loading, watch.said.loading
    if (other := watch.deferred) is not None:
        name = f"{other.aircraft} ({other.configuration})"
        return f"{loading.text} It has announced that it is {name}, which counts once its alert is cleared.".strip()
    said = [
        loading.text,
        *(text for name, text in announced.unused.items() if name not in loading.unused),
    ]
    if announced.differs(loading):
        said.append("It has announced another since, which counts once its alert is cleared.")
    return " ".join(part for part in said if part)


def _change_text(change: ChangeRecord | None) -> str:
    """That the baseline is not what the flight began with."""
    if change is None:
        return ""
    at = datetime.fromtimestamp(change.at_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
    by = f" by {change.who}" if change.who else ""
    return f" The baseline was changed{by} at {at} ({change.action}: {change.text}), and counts as it is now."


def _with_refusal(reason: str, refused: bool) -> str:
    """The reason, with a second publisher where messages of one were refused."""
    return f"{reason.rstrip('.')}. {_REFUSED}." if refused else reason
