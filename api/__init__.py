"""The door: REST, event stream and status page. It translates what the monitor knows and computes nothing."""

from wingwatch.api.app import create_app
from wingwatch.api.conventions import convert_modes
from wingwatch.api.encoding import encode_json
from wingwatch.api.ports import (
    DiagnosisPort,
    DiagnosisState,
    DiagnosisView,
    EstimateRow,
    HistoryPort,
    KernelPart,
    KernelState,
    KernelsView,
    QueueFullError,
)
from wingwatch.api.schemas import (
    AlertDocument,
    VehicleDocument,
    air_document,
    alert_document,
    vehicle_document,
)
from wingwatch.api.server import AddressError, HttpServer, PortInUse, listen, serve

__all__ = [
    "create_app",
    "HttpServer",
    "listen",
    "serve",
    "AddressError",
    "PortInUse",
    "DiagnosisPort",
    "DiagnosisState",
    "DiagnosisView",
    "QueueFullError",
    "HistoryPort",
    "EstimateRow",
    "KernelPart",
    "KernelState",
    "KernelsView",
    "AlertDocument",
    "VehicleDocument",
    "air_document",
    "alert_document",
    "vehicle_document",
    "encode_json",
    "convert_modes",
]
