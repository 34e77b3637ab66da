"""The service's log on standard error: time, level and vehicle, as text or as one JSON object a line."""

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Literal

__all__ = ["JsonLines", "LogFormat", "TextLines", "configure_logs"]

LogFormat = Literal["text", "json"]


class TextLines(logging.Formatter):
    """``2026-01-31T12:00:00.000Z WARNING [fleet/vehicle] text``; the vehicle only where the record has one."""

    def format(self, record: logging.LogRecord) -> str:
        """The record's lines."""
        vehicle = getattr(record, "vehicle", None)
        about = "" if vehicle is None else f"[{vehicle}] "
        return f"{_time(record)} {record.levelname} {about}{_message(record)}{_trace(self, record)}"


class JsonLines(logging.Formatter):
    """Keys ``time``, ``level``, ``logger``, ``message``; ``vehicle`` and ``exception`` where the record has them."""

    def format(self, record: logging.LogRecord) -> str:
        """The record's line."""
        vehicle, trace = getattr(record, "vehicle", None), _trace(self, record)
        line = {
            "time": _time(record),
            "level": record.levelname,
            "logger": record.name,
            "message": _message(record),
            **({} if vehicle is None else {"vehicle": vehicle}),
            **({"exception": trace.strip()} if trace else {}),
        }
        return json.dumps(line, ensure_ascii=True)


def configure_logs(form: LogFormat) -> None:
    """Write what the service says to standard error: its own information, of others warnings.

    A program that has set up its log before keeps it as it is.
    """
    if logging.getLogger().handlers:
        return
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines() if form == "json" else TextLines())
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    logging.getLogger("wingwatch").setLevel(logging.INFO)


def _time(record: logging.LogRecord) -> str:
    moment = datetime.fromtimestamp(record.created, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _message(record: logging.LogRecord) -> str:
    """What came from elsewhere must not begin a line of its own."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in record.getMessage())


def _trace(formatter: logging.Formatter, record: logging.LogRecord) -> str:
    return f"\n{formatter.formatException(record.exc_info)}" if record.exc_info else ""
