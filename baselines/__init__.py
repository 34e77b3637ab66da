"""Baselines: what each derivative is expected to be at a flight condition, and how well that is known.

The database's names are looked up when first asked for, so that estimating offline needs no database library.

Example:
    What is expected of the short period at one point of the envelope, and how well that is known:

    >>> from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, load_aircraft, trimmed
    >>> from wingwatch.baselines import apriori_envelope
    >>> aerosonde = load_aircraft("aerosonde")
    >>> at = trimmed(aerosonde, FlightCondition(27.0, 1200.0))
    >>> found = apriori_envelope(aerosonde, SHORT_PERIOD).lookup(at)
    >>> m_q = SHORT_PERIOD.derivatives.index("m_q")
    >>> f"{found.value[m_q]:.1f} +- {found.standard_error[m_q]:.1f}, {found.provenance}"
    '-4.9 +- 1.0, a-priori'
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from wingwatch.baselines.apriori import apriori_envelope
from wingwatch.baselines.cells import Cell, CellMemory, aged, cell_of, joined
from wingwatch.baselines.expectation import (
    DECLARED,
    MEASURED,
    UNSCALED,
    Envelope,
    Expectation,
    Neighbourhood,
    OutOfEnvelope,
    american,
    concise,
    empirical,
)
from wingwatch.baselines.flight_history import FlightRecord, HistoryColumns, HistoryKey
from wingwatch.baselines.records import (
    ActionRecord,
    AlertPage,
    AlertRecord,
    CandidateRecord,
    CellRecord,
    ChangeRecord,
    EstimateRecord,
    EvidenceRecord,
    ExpectationRecord,
    HistoryRow,
    HistoryWanted,
    ReferenceKey,
    ReferenceRecord,
    Retention,
    SeriesOverview,
    TaughtOverview,
)
from wingwatch.baselines.reference import Reference, posteriors

if TYPE_CHECKING:
    from wingwatch.baselines.database import Database, DatabaseError, RefusedError, open_database
    from wingwatch.baselines.fencing import Lease, LeaseLostError, VehicleName
    from wingwatch.baselines.leases import LEASE_S, Holder, Leases, LeaseTable
    from wingwatch.baselines.ledger import BaselineContent, BaselineLedger, Teaching
    from wingwatch.baselines.reverting import Reverted, Selection

__all__ = [
    "Expectation",
    "OutOfEnvelope",
    "Envelope",
    "Neighbourhood",
    "MEASURED",
    "DECLARED",
    "UNSCALED",
    "apriori_envelope",
    "american",
    "concise",
    "empirical",
    "Reference",
    "posteriors",
    "Cell",
    "CellMemory",
    "aged",
    "cell_of",
    "joined",
    "open_database",
    "Database",
    "DatabaseError",
    "RefusedError",
    "Lease",
    "LeaseLostError",
    "VehicleName",
    "LEASE_S",
    "Holder",
    "Leases",
    "LeaseTable",
    "ActionRecord",
    "AlertPage",
    "AlertRecord",
    "CandidateRecord",
    "CellRecord",
    "ChangeRecord",
    "EstimateRecord",
    "EvidenceRecord",
    "ExpectationRecord",
    "FlightRecord",
    "HistoryColumns",
    "HistoryKey",
    "HistoryRow",
    "HistoryWanted",
    "ReferenceKey",
    "ReferenceRecord",
    "Retention",
    "SeriesOverview",
    "TaughtOverview",
    "BaselineLedger",
    "BaselineContent",
    "Reverted",
    "Selection",
    "Teaching",
]


def __getattr__(name: str) -> Any:
    if name in ("Database", "DatabaseError", "RefusedError", "open_database"):
        return getattr(import_module("wingwatch.baselines.database"), name)
    if name in ("BaselineLedger", "BaselineContent", "Teaching", "Reverted", "Selection"):
        return getattr(import_module("wingwatch.baselines.ledger"), name)
    if name in ("Lease", "LeaseLostError", "VehicleName"):
        return getattr(import_module("wingwatch.baselines.fencing"), name)
    if name in ("LEASE_S", "Holder", "Leases", "LeaseTable"):
        return getattr(import_module("wingwatch.baselines.leases"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
