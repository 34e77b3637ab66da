"""Limits of the live loop."""

from dataclasses import dataclass, field

from wingwatch.monitor.detection.judge_state import JudgeConfig

__all__ = ["FleetSettings"]


@dataclass(frozen=True, slots=True)
class FleetSettings:
    """Limits of the live loop.

    Attributes:
        stale_s: wall-clock time without samples after which a vehicle is stale.
        status_interval_s: how often an unchanged status is published.
        ask_interval_s: least time between two questions for a vehicle's aircraft.
        max_vehicles: vehicles remembered (``Roster`` says who gives way).
        kept_events: how many are kept in memory for listeners who come back, at least two for each vehicle: its newest
            ``derivatives`` take one place.
        kept_alerts: how many are kept in memory.
        history_interval_s: least sample time between two estimates kept for history.
        recall_patience_s: how long samples wait for what is kept of their vehicle before they are watched without.
        checkpoint_interval_s: least time between two checkpoints of a vehicle without news of an alert; of more than
            fifty vehicles each waits longer.
        excite: whether inputs that would help are proposed; excite_interval_s: least time between two for a vehicle.
        ring_channels: channels of which the last two minutes are kept of each vehicle, for diagnoses; none where empty.
    """

    stale_s: float = 5.0
    status_interval_s: float = 5.0
    ask_interval_s: float = 1.0
    max_vehicles: int = 5000
    kept_events: int = 10_000
    kept_alerts: int = 10_000
    history_interval_s: float = 1.0
    recall_patience_s: float = 2.0
    checkpoint_interval_s: float = 5.0
    excite: bool = False
    excite_interval_s: float = 300.0
    judge: JudgeConfig = field(default_factory=JudgeConfig)
    ring_channels: tuple[str, ...] = ()
