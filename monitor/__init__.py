"""Monitor: findings, causes, alerts and the live loop."""

from wingwatch.monitor.causes import CAUSES, Cause
from wingwatch.monitor.cell_memory import CellBook, CellPlace
from wingwatch.monitor.chain import Chain, Solution
from wingwatch.monitor.fleet import FleetMonitor, FleetSettings
from wingwatch.monitor.judge import JudgeConfig
from wingwatch.monitor.ports import Outputs, Store, VehicleMemory
from wingwatch.monitor.vehicle import Report, VehicleMonitor, surface_kinds
from wingwatch.monitor.views import (
    AlertAction,
    AlertState,
    AlertView,
    Event,
    EvidenceView,
    MonitorPort,
    VehicleState,
    VehicleView,
    WorstDerivative,
)

__all__ = [
    "VehicleMonitor",
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
    "FleetSettings",
    "Store",
    "VehicleMemory",
    "Outputs",
    "MonitorPort",
    "VehicleView",
    "VehicleState",
    "WorstDerivative",
    "AlertView",
    "AlertState",
    "AlertAction",
    "EvidenceView",
    "Event",
]
