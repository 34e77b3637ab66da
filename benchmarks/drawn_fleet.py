"""A fleet that is drawn, not estimated: what a page shows of many aircraft, without the work of watching them."""

import dataclasses
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wingwatch.monitor.fleet.kept_events import KeptEvents
from wingwatch.monitor.positions import Position
from wingwatch.monitor.views import (
    SHELVED_S,
    AlertAction,
    AlertGroupView,
    AlertState,
    AlertView,
    Event,
    EvidenceView,
    FleetFigures,
    ManoeuvreView,
    Shelving,
    VehicleState,
    VehicleView,
    WorstDerivative,
)

__all__ = ["DrawnFleet"]

SOLUTION_S, TURN_S, SPEED_M_S, METRES_A_DEGREE = 0.5, 60.0, 25.0, 111_195.0
DERIVATIVES = ("z_w", "m_w", "m_q", "m_eta", "l_p", "n_r", "y_v")
REASONS = {
    VehicleState.HEALTHY: "every derivative agrees with its expectation",
    VehicleState.NOT_OBSERVABLE: "the rudder has not moved enough for a stuck one to be noticed",
    VehicleState.STALE: "no samples are arriving",
    VehicleState.UNKNOWN: "samples arrive but the vehicle has not said what aircraft it is",
}
ICING = (("z_w", -3.32, 0.27, -5.1, 0.19), ("m_w", -0.43, 0.02, -0.52, 0.03), ("m_q", -5.9, 0.3, -6.8, 0.4))
ELEVATOR = (
    ("m_eta", -76.0, 3.1, -131.5, 2.5),
    ("z_eta", -1.9, 0.3, -2.9, 0.2),
    ("m_q", -6.6, 0.3, -6.8, 0.4),
)
ALERTS: Sequence[tuple[dict[str, Any], Sequence[tuple[str, float, float, float, float]]]] = (
    (
        {"kind": "icing", "cause": "icing", "level": "warning", "size": 0.137, "size_standard_error": 0.0073,
         "text": "Icing of severity 0.14 ± 0.01 (Twin Otter scale), since about 62 s. Leave the icing layer and keep "
         "airspeed up."}, ICING,
    ),
    (
        {"kind": "damage", "cause": "elevator_effectiveness", "level": "critical", "size": 0.42,
         "size_standard_error": 0.03, "channel": "elevator_rad",
         "text": "The elevator has lost 42 ± 3 % of its effectiveness since about 75 s. Avoid steep "
         "manoeuvres and land."},
        ELEVATOR,
    ),
    (
        {"kind": "sensor", "cause": "sensor_bias", "level": "watch", "size": 0.0123, "size_standard_error": 0.002,
         "channel": "pitch_rate_rad_s",
         "text": "The pitch rate sensor is off by 0.012 ± 0.002 rad/s since about 81 s. Do not rely on it."}, (),
    ),
)  # fmt: skip


class DrawnFleet:
    """Obeys MonitorPort. Every vehicle flies a circle and is drawn anew twice a second while ``fly`` runs.

    Args:
        vehicles: how many; alerts: how many of them have one.
        seed: of what is drawn.
        fleets: names, in turns.
    """

    def __init__(
        self, vehicles: int, alerts: int = 3, seed: int = 0, fleets: Sequence[str] = ("default",)
    ) -> None:
        self._random = np.random.default_rng(seed)
        self._lock = threading.Lock()
        self._events = KeptEvents(10_000)
        self._start = time.monotonic()
        self._middles = np.array([50.0, 10.0]) + self._random.normal(0.0, 0.03, (vehicles, 2))
        self._radii_m = self._random.uniform(300.0, 900.0, vehicles)
        self._raised = [self._alert(k, fleets) for k in range(min(alerts, vehicles))]
        self._views = [self._vehicle(k, fleets[k % len(fleets)]) for k in range(vehicles)]

    def fly(self, over: threading.Event) -> None:
        """Draw all vehicles anew twice a second until ``over``."""
        while not over.wait(SOLUTION_S):
            self.step()

    def step(self) -> None:
        """Half a second of flight."""
        views = [self._flown(k, view) for k, view in enumerate(self._views)]
        with self._lock:
            self._views = views
            for view in views:
                if view.state is not VehicleState.STALE:
                    said = {"fleet": view.fleet, "vehicle": view.vehicle, "time_s": view.last_sample_time_s}
                    self._events.add("derivatives", said)

    def _alert(self, k: int, fleets: Sequence[str]) -> AlertView:
        said, proof = ALERTS[k % len(ALERTS)]
        evidence = tuple(
            EvidenceView(name, value, error, expected, of_it, (value - expected) / np.hypot(error, of_it))
            for name, value, error, expected, of_it in proof
        )
        common = AlertView(
            id=f"a{k + 1}", fleet=fleets[k % len(fleets)], vehicle=f"uav-{k + 1:03d}", kind="", cause="", level="",
            state=AlertState.ACTIVE, raised_s=70.0 + k, cleared_s=None, size=0.0, size_standard_error=0.0,
            probability=0.998, basis="a-priori", text="", evidence=evidence,
        )  # fmt: skip
        return dataclasses.replace(common, **said)

    def _vehicle(self, k: int, fleet: str) -> VehicleView:
        drawn = self._random.choice(4, p=[0.85, 0.08, 0.04, 0.03])
        state = list(REASONS)[drawn]
        alerts = tuple(alert.id for alert in self._raised if alert.vehicle == f"uav-{k + 1:03d}")
        if alerts:
            state = VehicleState.DEGRADED
        unseen = ("rudder_rad",) if state is VehicleState.NOT_OBSERVABLE else ()
        return VehicleView(
            fleet=fleet, vehicle=f"uav-{k + 1:03d}", aircraft="aerosonde", configuration="clean", state=state,
            state_since_s=70.0 + k if alerts else 20.0, reason=self._raised[k].text if alerts else REASONS[state],
            last_sample_time_s=118.0, basis="a-priori", basis_text="Compared with a-priori numbers.",
            worst=None if state is VehicleState.UNKNOWN else self._worst(bool(alerts)), counts={"accepted": 5900},
            active_alerts=alerts, condition={"airspeed_true_m_s": 25.0, "altitude_m": 1000.0},
            unseen_surfaces=unseen, sample_age_s=0.2 if state is not VehicleState.STALE else 40.0,
            position=self._position(k),
        )  # fmt: skip

    def _worst(self, changed: bool) -> WorstDerivative:
        z = self._random.normal(6.0 if changed else 0.0, 1.0)
        return WorstDerivative("ekf", "short_period", str(self._random.choice(DERIVATIVES)), float(z))

    def _position(self, k: int) -> Position:
        turned = 2.0 * np.pi * ((time.monotonic() - self._start) / TURN_S + k / 7.0)
        north, east = self._radii_m[k] * np.array([np.cos(turned), np.sin(turned)]) / METRES_A_DEGREE
        latitude, longitude = self._middles[k]
        return Position(latitude + north, longitude + east / np.cos(np.radians(latitude)), 1000.0)

    def _flown(self, k: int, view: VehicleView) -> VehicleView:
        if view.state is VehicleState.STALE:
            return dataclasses.replace(view, sample_age_s=(view.sample_age_s or 0.0) + SOLUTION_S)
        worst = view.worst and dataclasses.replace(
            view.worst, z=view.worst.z + float(self._random.normal(0.0, 0.2))
        )
        return dataclasses.replace(
            view, worst=worst, position=self._position(k), sample_age_s=float(self._random.uniform(0.0, 0.5)),
            last_sample_time_s=(view.last_sample_time_s or 0.0) + SOLUTION_S,
        )  # fmt: skip

    def vehicles(self) -> Sequence[VehicleView]:
        """All vehicles, those with an alert first."""
        return sorted(self._views, key=lambda view: view.state is not VehicleState.DEGRADED)

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        """One vehicle."""
        return next((view for view in self._views if (view.fleet, view.vehicle) == (fleet, vehicle)), None)

    def derivatives(self, fleet: str, vehicle: str) -> Mapping[str, Any] | None:
        """None are estimated."""
        return None

    def alerts(self) -> Sequence[AlertView]:
        """All alerts."""
        return tuple(self._raised)

    def manoeuvres(self, fleet: str, vehicle: str) -> Sequence[ManoeuvreView] | None:
        """None are flown."""
        return ()

    def flight_record(self, fleet: str, vehicle: str) -> None:
        """Nothing is kept."""

    def expected(self, *_: object) -> None:
        """Nothing is expected."""

    def alert_groups(self) -> Sequence[AlertGroupView]:
        """No alerts are one event."""
        return ()

    def act_on_alert(
        self,
        alert_id: str,
        action: AlertAction,
        who: str,
        note: str,
        key: str | None = None,
        shelve_s: float = SHELVED_S,
    ) -> AlertView | None:
        """What a person does; everything is allowed."""
        states = {
            AlertAction.ACKNOWLEDGE: AlertState.ACKNOWLEDGED, AlertAction.SHELVE: AlertState.SHELVED,
            AlertAction.UNSHELVE: AlertState.ACTIVE, AlertAction.CLEAR: AlertState.CLEARED,
        }  # fmt: skip
        for place, alert in enumerate(self._raised):
            if alert.id == alert_id:
                shelved = Shelving(time.time() + shelve_s, alert.level, alert.size)
                noted = (*alert.note, f"{who}: {action} ({note})" if note else f"{who}: {action}")
                self._raised[place] = dataclasses.replace(
                    alert, state=states[action], note=noted,
                    shelving=shelved if action is AlertAction.SHELVE else None,
                )  # fmt: skip
                with self._lock:
                    self._events.add("alert", {"id": alert_id})
                return self._raised[place]
        return None

    def events(self, after: int) -> Sequence[Event]:
        """Events after one."""
        with self._lock:
            return self._events.after(after)

    def events_complete_after(self) -> int:
        """After which none is lost."""
        return self._events.complete_after

    def figures(self) -> FleetFigures:
        """The fleet in numbers."""
        return FleetFigures(Counter(view.state for view in self._views), {}, {}, 0, 0)
