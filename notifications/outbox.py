"""What a channel has said and has still to say, in a file that survives the service.

The file is written beside the old one, brought to the disk and put in its place, so a kill leaves the old or the new.
"""

import logging
import os
from collections import deque
from pathlib import Path

import orjson

from wingwatch.notifications.notice import Notice, Said

__all__ = ["MOST_SAID", "MOST_WAITING", "Outbox"]

_LOG = logging.getLogger(__name__)
MOST_WAITING = 256
"""Notices that wait: of a few kilobytes each, so the file stays below about a megabyte."""
MOST_SAID = 2000
"""Alerts that are followed; the one followed longest gives way."""
_MOST_BYTES = 16_000_000
_FORM = 1


class Outbox:
    """Of one channel; used by its thread alone.

    Args:
        path: of the file; its folder is made where it is missing.

    Attributes:
        said: by alert, what has been said or waits to be.
        waiting: what has still to be delivered, oldest first.
        dropped: notices that found no room, since the start.
        problem: why the file could not be written last time; None while it can.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.said: dict[str, Said] = {}
        self.waiting: deque[Notice] = deque()
        self.dropped = 0
        self.problem: str | None = None
        self._kept = b""
        self._load()

    def note(self, alert_id: str, said: Said | None) -> None:
        """Follow an alert from now on as it was said last, or (None) no longer."""
        self.said.pop(alert_id, None)
        if said is None:
            return
        self.said[alert_id] = said
        while len(self.said) > MOST_SAID:
            self.said.pop(next(iter(self.said)))

    def add(self, notice: Notice) -> None:
        """Let a notice wait; without room the oldest goes of whose alert a later one waits, else the oldest."""
        self.waiting.append(notice)
        while len(self.waiting) > MOST_WAITING:
            gone = self._least_missed()
            self.waiting.remove(gone)
            self.dropped += 1
            _LOG.warning(
                "no room for a notice of alert %s (%s): it is dropped", gone.alert["id"], gone.steps[0]
            )

    def _least_missed(self) -> Notice:
        newest = {notice.alert["id"]: notice.key for notice in self.waiting}
        outdated = (notice for notice in self.waiting if newest[notice.alert["id"]] != notice.key)
        return next(outdated, self.waiting[0])

    def save(self) -> None:
        """Write the file where anything has changed; a failure is noted and tried again by the next call."""
        content = orjson.dumps({"form": _FORM, "said": self.said, "waiting": list(self.waiting)})
        if content == self._kept:
            return
        try:
            self._write(content)
        except OSError as error:
            problem = (error.strerror or type(error).__name__).lower()
            if problem != self.problem:
                _LOG.warning("waiting notices are not kept on the disk: %s", problem)
            self.problem = problem
            return
        self._kept, self.problem = content, None

    def _write(self, content: bytes) -> None:
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        unfinished = self._path.with_suffix(".unfinished")
        handle = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(self._path)

    def _load(self) -> None:
        """Whatever the file holds, the channel begins: what cannot be read is said in the log and begun anew."""
        try:
            with self._path.open("rb") as file:
                content = file.read(_MOST_BYTES)
            kept = orjson.loads(content)
            if kept["form"] != _FORM:
                raise ValueError(f"it has form {kept['form']!r}")
            said = {str(name): Said(**one) for name, one in kept["said"].items()}
            waiting = deque(Notice.from_json(one) for one in kept["waiting"])
        except FileNotFoundError:
            return
        except Exception as error:  # a damaged file must not keep the service from starting
            _LOG.warning(
                "%s is not used (%s): alerts in force are announced again", self._path, type(error).__name__
            )
            return
        self.said, self.waiting, self._kept = said, waiting, content
