"""The fleet as a table for the terminal, and its changes as lines for where there is none."""

from collections.abc import Iterator, Mapping, Sequence

from rich.markup import escape
from rich.table import Table

from wingwatch.monitor import AlertState, AlertView, MonitorPort, VehicleState, VehicleView

__all__ = ["FleetLines", "fleet_table"]

_COLOURS: Mapping[VehicleState, str] = {
    VehicleState.HEALTHY: "green",
    VehicleState.DEGRADED: "bold red",
    VehicleState.NOT_OBSERVABLE: "yellow",
    VehicleState.STALE: "yellow",
    VehicleState.UNKNOWN: "dim",
}


def fleet_table(monitor: MonitorPort, title: str) -> Table:
    """One row a vehicle, by name, so that rows stay where they are."""
    alerts = [alert for alert in monitor.alerts() if alert.state is not AlertState.CLEARED]
    table = Table(title=escape(title), title_justify="left", expand=True)
    for name in ("vehicle", "time", "state", "compared with", "worst derivative"):
        table.add_column(name, no_wrap=True, justify="right" if name == "time" else "left")
    table.add_column("alerts", ratio=1)
    for view in sorted(monitor.vehicles(), key=lambda v: (v.fleet, v.vehicle)):
        time_s = view.last_sample_time_s
        table.add_row(
            escape(view.vehicle),
            "-" if time_s is None else f"{time_s:.0f} s",
            f"[{_COLOURS[view.state]}]{_words(view.state)}[/]",
            view.basis or "nothing yet",
            _worst(view),
            "\n".join(escape(f"{a.level}: {a.text}") for a in _of(alerts, view)) or "none",
        )
    return table


class FleetLines:
    """What has changed since the last look, one line each: states, and alerts raised, renamed or cleared."""

    def __init__(self) -> None:
        self._states: dict[tuple[str, str], VehicleState] = {}
        self._alerts: dict[str, tuple[AlertState, str, str | None]] = {}

    def changes(self, monitor: MonitorPort) -> Iterator[str]:
        """The lines of this look."""
        for view in sorted(monitor.vehicles(), key=lambda v: (v.fleet, v.vehicle)):
            owner = (view.fleet, view.vehicle)
            if self._states.get(owner) is not view.state:
                self._states[owner] = view.state
                yield f"{_at(view.last_sample_time_s)} {view.vehicle}: {_words(view.state)} ({view.reason})"
        for alert in reversed(monitor.alerts()):
            standing = (alert.state, alert.cause, alert.channel)
            if self._alerts.get(alert.id) != standing:
                self._alerts[alert.id] = standing
                when_s = alert.raised_s if alert.cleared_s is None else alert.cleared_s
                yield f"{_at(when_s)} {alert.vehicle}: {alert.level} {alert.kind} alert {alert.state}: {alert.text}"


def _of(alerts: Sequence[AlertView], view: VehicleView) -> list[AlertView]:
    return [a for a in alerts if (a.fleet, a.vehicle) == (view.fleet, view.vehicle)]


def _worst(view: VehicleView) -> str:
    worst = view.worst
    return "-" if worst is None else f"{worst.derivative} z = {worst.z:+.1f} ({worst.estimator})"


def _words(state: VehicleState) -> str:
    return str(state).replace("_", " ")


def _at(time_s: float | None) -> str:
    return "        -" if time_s is None else f"{time_s:7.1f} s"
