"""Monitor: findings, causes, alerts and the live loop.

Example:
    One vehicle watched, by the code that watches a fleet live:

    >>> from wingwatch.aircraft import load_aircraft
    >>> from wingwatch.monitor import VehicleMonitor
    >>> from wingwatch.simulation import Scenario, doublet_schedule, simulate
    >>> aerosonde = load_aircraft("aerosonde")
    >>> doublets = doublet_schedule(aerosonde, aerosonde.envelope.cruise)
    >>> flight = simulate(Scenario(aerosonde, manoeuvres=(doublets,), seed=1), 50.0)
    >>> monitor = VehicleMonitor(aerosonde, "default", "uav1", flight.present, {}, new_id=lambda: "a1")
    >>> report = monitor.feed(flight)
    >>> str(monitor.state), monitor.reason, len(report.alerts)
    ('healthy', 'no change against what is expected', 0)
"""

from wingwatch.monitor.detection.alert_finding import AlertFinding, Correction
from wingwatch.monitor.detection.causes import CAUSES, Cause
from wingwatch.monitor.detection.cell_memory import CellBook, CellPlace
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.estimation.chain import Chain, Solution
from wingwatch.monitor.fleet.diagnoses import AlertFlight
from wingwatch.monitor.fleet.fleet_monitor import FleetMonitor, FleetPorts
from wingwatch.monitor.fleet.member.sample_ring import SampleRing
from wingwatch.monitor.fleet.resuming import Checkpoints
from wingwatch.monitor.fleet.settings import FleetSettings
from wingwatch.monitor.ports import ActionPlan, ActionRequest, Outputs, Store, VehicleMemory
from wingwatch.monitor.vehicle.checkpoint import (
    Checkpoint,
    CheckpointError,
    SavedVehicle,
    decode_checkpoint,
    default_settings,
    encode_checkpoint,
)
from wingwatch.monitor.vehicle.manoeuvre_verdict import verdict
from wingwatch.monitor.vehicle.vehicle_monitor import MonitorStart, Report, VehicleMonitor, surface_kinds
from wingwatch.monitor.views import (
    AlertAction,
    AlertGroupView,
    AlertState,
    AlertView,
    CandidateView,
    CouldSeeView,
    Event,
    EvidenceView,
    FleetFigures,
    HelpfulInputView,
    KeyReusedError,
    LearnedView,
    ManoeuvreView,
    MonitorPort,
    PoorView,
    ProposedInputView,
    Shelving,
    VehicleState,
    VehicleView,
    WorstDerivative,
)

__all__ = [
    "VehicleMonitor",
    "MonitorStart",
    "Report",
    "surface_kinds",
    "CellBook",
    "CellPlace",
    "Chain",
    "Solution",
    "CAUSES",
    "Cause",
    "JudgeConfig",
    "FleetMonitor",
    "FleetPorts",
    "FleetSettings",
    "Store",
    "ActionPlan",
    "ActionRequest",
    "VehicleMemory",
    "Outputs",
    "Checkpoint",
    "CheckpointError",
    "Checkpoints",
    "SampleRing",
    "SavedVehicle",
    "decode_checkpoint",
    "default_settings",
    "encode_checkpoint",
    "MonitorPort",
    "VehicleView",
    "VehicleState",
    "WorstDerivative",
    "AlertFinding",
    "AlertFlight",
    "AlertView",
    "CandidateView",
    "Correction",
    "CouldSeeView",
    "AlertGroupView",
    "ProposedInputView",
    "Shelving",
    "AlertState",
    "AlertAction",
    "KeyReusedError",
    "EvidenceView",
    "ManoeuvreView",
    "HelpfulInputView",
    "LearnedView",
    "PoorView",
    "verdict",
    "FleetFigures",
    "Event",
]
