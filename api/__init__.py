"""The door: REST, event stream and status page. It translates what the monitor knows and computes nothing.

The names that need the web framework are looked up when first asked for: commands write the same objects without it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from wingwatch.api.encoding import encode_json
from wingwatch.api.manoeuvre_schemas import ManoeuvreDocument, manoeuvre_document
from wingwatch.api.ports import (
    BaselineImport,
    BaselinePort,
    BaselineQuestion,
    BaselineRevert,
    DelayView,
    DiagnosisPort,
    DiagnosisState,
    DiagnosisView,
    HistoryPort,
    KernelPart,
    KernelState,
    KernelsView,
    QueueFullError,
    QueueView,
    ServiceFigures,
    StudyPort,
    StudyView,
    WorkerSilentError,
    WorkerView,
)
from wingwatch.api.schemas import (
    AlertDocument,
    CandidateDocument,
    CouldSeeDocument,
    VehicleDocument,
    air_document,
    alert_document,
    could_see_documents,
    proposed_input_document,
    vehicle_document,
)

if TYPE_CHECKING:
    from wingwatch.api.access import AccessSettings, Caller, TokenScope
    from wingwatch.api.app import AppSettings, create_app
    from wingwatch.api.connections import Connections
    from wingwatch.api.conventions import convert_modes
    from wingwatch.api.server import (
        AddressError,
        CertificateError,
        HttpServer,
        PortInUse,
        beyond_loopback,
        listen,
        read_certificate,
        serve,
    )

_WEB = {
    "access": ("AccessSettings", "Caller", "TokenScope"),
    "app": ("AppSettings", "create_app"),
    "connections": ("Connections",),
    "conventions": ("convert_modes",),
    "server": (
        *("HttpServer", "listen", "serve", "beyond_loopback", "read_certificate"),
        *("AddressError", "CertificateError", "PortInUse"),
    ),
}

__all__ = [
    "create_app",
    "AppSettings",
    "AccessSettings",
    "Caller",
    "TokenScope",
    "HttpServer",
    "listen",
    "serve",
    "Connections",
    "beyond_loopback",
    "read_certificate",
    "AddressError",
    "CertificateError",
    "PortInUse",
    "BaselinePort",
    "BaselineImport",
    "BaselineQuestion",
    "BaselineRevert",
    "DiagnosisPort",
    "DiagnosisState",
    "DiagnosisView",
    "QueueFullError",
    "DelayView",
    "QueueView",
    "ServiceFigures",
    "StudyPort",
    "StudyView",
    "WorkerSilentError",
    "WorkerView",
    "HistoryPort",
    "KernelPart",
    "KernelState",
    "KernelsView",
    "AlertDocument",
    "CandidateDocument",
    "CouldSeeDocument",
    "VehicleDocument",
    "air_document",
    "alert_document",
    "could_see_documents",
    "ManoeuvreDocument",
    "manoeuvre_document",
    "proposed_input_document",
    "vehicle_document",
    "encode_json",
    "convert_modes",
]


def __getattr__(name: str) -> Any:
    for module, names in _WEB.items():
        if name in names:
            return getattr(import_module(f"wingwatch.api.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
