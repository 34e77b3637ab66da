"""Alerts as the database stores them, and as the monitor shows them."""

from dataclasses import asdict

from wingwatch.baselines import AlertRecord, CandidateRecord, Database, EvidenceRecord
from wingwatch.monitor import AlertState, AlertView, CandidateView, EvidenceView, Shelving

__all__ = ["MOST_KEPT", "alert_record", "alert_view", "kept_alerts"]

MOST_KEPT = 10_000
"""Alerts that are kept in memory."""
_PAGE = 1000


def alert_record(alert: AlertView, created_at_s: float, updated_at_s: float) -> AlertRecord:
    """An alert as it is stored."""
    values = {name: getattr(alert, name) for name in AlertView.__dataclass_fields__}
    values.pop("diagnosis_id")  # its report ends with the service
    values["state"] = str(alert.state)
    values["evidence"] = tuple(EvidenceRecord(**asdict(part)) for part in alert.evidence)
    values["note"] = tuple(alert.note)
    values["shelving"] = None if alert.shelving is None else asdict(alert.shelving)
    values["candidates"] = tuple(CandidateRecord(**asdict(one)) for one in alert.candidates)
    return AlertRecord(**values, created_at_s=created_at_s, updated_at_s=updated_at_s)


def alert_view(record: AlertRecord) -> AlertView:
    """A stored alert as the monitor shows it."""
    values = {
        name: getattr(record, name) for name in AlertView.__dataclass_fields__ if name != "diagnosis_id"
    }
    values["state"] = AlertState(record.state)
    values["evidence"] = tuple(EvidenceView(**asdict(part)) for part in record.evidence)
    values["note"] = tuple(record.note)
    values["shelving"] = None if record.shelving is None else Shelving(**record.shelving)  # type: ignore[arg-type]
    values["candidates"] = tuple(CandidateView(**asdict(one)) for one in record.candidates)
    return AlertView(**values)


def kept_alerts(database: Database) -> list[AlertView]:
    """The newest alerts of a database, newest first.

    Raises:
        DatabaseError: they cannot be read.
    """
    records: list[AlertRecord] = []
    cursor: str | None = None
    while len(records) < MOST_KEPT:
        page = database.alerts(limit=_PAGE, cursor=cursor)
        records += page.items
        cursor = page.next
        if cursor is None:
            break
    return [alert_view(record) for record in records]
