"""An autopilot log from a file, by its first bytes and never by its name."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path

from wingwatch.telemetry.logs.dataflash import (
    DATAFLASH_MAGIC,
    is_dataflash_text,
    read_dataflash,
    read_dataflash_text,
)
from wingwatch.telemetry.logs.log import AutopilotLog, LogError
from wingwatch.telemetry.logs.mcap_log import read_mcap
from wingwatch.telemetry.logs.tlog import is_tlog, read_tlog
from wingwatch.telemetry.logs.ulog import ULOG_MAGIC, read_ulog
from wingwatch.telemetry.recording.reading import MCAP_MAGIC, is_recording

__all__ = ["is_autopilot_log", "read_autopilot_log"]

_HEAD_BYTES = 8192
_READERS: Mapping[str, Callable[[str, bytes], AutopilotLog]] = {
    "ulog": read_ulog, "dataflash": read_dataflash, "dataflash-text": read_dataflash_text, "tlog": read_tlog,
    "mcap": read_mcap,
}  # fmt: skip
_OF_DAMAGE = (KeyError, IndexError, TypeError, OverflowError, MemoryError, UnicodeError, struct.error)
"""What bytes that are none of the format's can still raise in a reader that checks them."""


def is_autopilot_log(path: Path) -> bool:
    """Whether a file is one; False for one that cannot be opened, about which its reader has a sentence."""
    try:
        with path.open("rb") as file:
            return _format(file.read(_HEAD_BYTES)) is not None
    except OSError:
        return False


def _format(head: bytes) -> str | None:
    if head.startswith(ULOG_MAGIC):
        return "ulog"
    if head.startswith(DATAFLASH_MAGIC):
        return "dataflash"
    if is_tlog(head):
        return "tlog"
    if head.startswith(MCAP_MAGIC):
        return None if is_recording(head) else "mcap"
    return "dataflash-text" if is_dataflash_text(head) else None


def read_autopilot_log(path: Path) -> AutopilotLog:
    """All of a log.

    Raises:
        LogError: the file cannot be read, is no autopilot log, or holds nothing that can be read.
    """
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise LogError(f"{path}: cannot be read: {problem.strerror}") from None
    read = _READERS.get(_format(data[:_HEAD_BYTES]) or "")
    if read is None:
        raise LogError(f"{path}: the file is no autopilot log; give ULog, DataFlash, tlog or MCAP")
    try:
        return read(str(path), data)
    except _OF_DAMAGE as problem:
        raise LogError(f"{path}: the log is damaged ({type(problem).__name__}); copy it again") from None
