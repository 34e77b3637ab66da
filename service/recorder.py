"""Recording while the service runs: what came in, and what was said of it, into MCAP files behind the live path's back.

Whoever calls here never waits: what is to be kept is put into a queue, and a thread of its own writes it. Every half
second all that came is handed to the system, so killing this process costs no more than that. Files end at a size or an
age; the oldest are removed where all of them are too large or too old. The database's memory of each vehicle and the
checkpoints that the service started from are attached, so that ``wingwatch replay`` begins where the service began.
"""

import logging
import os
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Self

from wingwatch.aircraft import STRUCTURES
from wingwatch.api import alert_document
from wingwatch.baselines import EstimateRecord
from wingwatch.monitor import AlertView
from wingwatch.service.loops import Loop
from wingwatch.telemetry import JSON, PROTOBUF, InboundMessage, encode_service_object, vehicle_key
from wingwatch.telemetry.keys import KEY_ROOT
from wingwatch.telemetry.protocol import recording_pb2
from wingwatch.telemetry.recording.recording_file import RecordingFile, RecordingPlace

__all__ = ["COUNTED", "Recorder", "RecordingLimits", "alert_message", "estimate_message"]

COUNTED = ("messages", "estimates", "alerts", "dropped", "failed", "files")
"""What a recorder counts."""

_LOG = logging.getLogger(__name__)
_FLUSH_S = 0.5
_AGAIN_S = 10.0
_END_S = 10.0
_MOST_BYTES = 134_217_728
_AN_ENTRY = 300  # bytes beside its payload
_SUFFIX = ".mcap"
_NAME = "wingwatch-"

_Write = Callable[[RecordingFile], None]
"""Writes what waits."""


@dataclass(frozen=True, slots=True)
class RecordingLimits:
    """How much is kept.

    Attributes:
        file_bytes, file_s: a file ends at this size or age.
        most_bytes: of all files; the oldest are removed.
        keep_s: files that ended longer ago are removed.
    """

    file_bytes: float = 268_435_456.0
    file_s: float = 3600.0
    most_bytes: float = 20e9
    keep_s: float = 30 * 86_400.0


class Recorder:
    """Writes a recording; use it in a ``with`` statement, which begins the first file and ends the last.

    Args:
        folder: made where it is missing; files of ours in it count towards the limits, others are left alone.
        limits: how much is kept.
        wall_clock: seconds since 1970-01-01 UTC.
        clock: that of ``InboundMessage.received_s``.

    Raises:
        RecordingError: the library is not installed.
        OSError: the folder cannot be written.

    Attributes:
        problem: why nothing is written; None while all is.
        loop: the thread.
    """

    def __init__(
        self,
        folder: Path,
        limits: RecordingLimits | None = None,
        wall_clock: Callable[[], float] = time.time,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._folder, self._limits = folder, limits or RecordingLimits()
        self._wall_clock, self._clock = wall_clock, clock
        self._started_ns = round(wall_clock() * 1e9)
        self._clock_ns = self._started_ns - round(clock() * 1e9)
        self._session, self._number = secrets.token_hex(8), 0
        self._queue: deque[_Write] = deque()
        self._bytes, self._lock = 0, threading.Lock()
        self._aircraft: dict[str, InboundMessage] = {}
        self._ending = threading.Event()
        self._counts = dict.fromkeys(COUNTED, 0)
        self.problem: str | None = None
        self._file: RecordingFile | None = None
        self._file_s = self._failed_s = float("-inf")
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.loop = Loop("wingwatch-recorder", "the loop that records", self._run)

    def __enter__(self) -> Self:
        if self._file is None:
            self._begin_file()
        self.loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what waits, and end the file; a disk that does not answer is not waited for longer than 10 s."""
        self._ending.set()
        self.loop.join(_END_S)

    @property
    def counts(self) -> dict[str, int]:
        """Messages, estimates and alerts written, what found no room (``dropped``), tries that failed, files begun."""
        return dict(self._counts)

    @property
    def waiting(self) -> int:
        """Entries that wait to be written."""
        return len(self._queue)

    # -- what is kept: nothing here waits ----------------------------------------------------------

    def messages(self, messages: Sequence[InboundMessage]) -> None:
        """Messages in the order in which the monitor is given them."""
        if messages:
            size = sum(len(message.payload) + _AN_ENTRY for message in messages)
            self._put(partial(self._write_messages, messages), size)

    def estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Estimates as the history keeps them."""
        self._put(partial(self._write_estimates, rows, self._ns(self._clock())), 2 * _AN_ENTRY * len(rows))

    def alert(self, alert: AlertView) -> None:
        """An alert that the database has committed."""
        self._put(partial(self._write_alert, alert, self._ns(self._clock())), 10 * _AN_ENTRY)

    def attach(self, name: str, data: bytes) -> None:
        """What belongs to the recording and is no message; of one name the first counts."""
        time_ns = self._ns(self._clock())
        self._put(lambda file: file.attach(name, time_ns, data), len(data) + _AN_ENTRY)

    def _put(self, write: _Write, size: int) -> None:
        with self._lock:
            if self._bytes + size > _MOST_BYTES:
                self._counts["dropped"] += 1
                return
            self._bytes += size
            self._queue.append(write)

    def _ns(self, clock_s: float) -> int:
        """Nanoseconds since 1970-01-01 UTC; a wall clock that is set meanwhile moves nothing."""
        return self._clock_ns + round(clock_s * 1e9)

    # -- the thread that writes ---------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ending.wait(_FLUSH_S):
            self.write()
        self.write()
        self._drop_file()

    def write(self) -> None:
        """All that waits; what the disk does not take is lost and counted, and a new file is tried later."""
        with self._lock:
            waiting, self._queue, self._bytes = self._queue, deque(), 0
        if self._file is None and self._clock() - self._failed_s < _AGAIN_S:
            self._counts["dropped"] += len(waiting)
            return
        try:
            file = self._open_file()
            while waiting:
                self._write_one(waiting[0], file)
                waiting.popleft()
            file.flush()
            self.problem = None
        except OSError as error:
            self._counts["failed"] += 1
            self._counts["dropped"] += len(waiting)
            self.problem = f"nothing is recorded: {error.strerror or error}."
            _LOG.warning("%s", self.problem)
            self._failed_s = self._clock()
            self._drop_file()

    def _write_one(self, write: _Write, file: RecordingFile) -> None:
        try:
            write(file)
        except OSError:
            raise
        except Exception:  # one entry that cannot be written must not cost the others
            self._counts["dropped"] += 1
            _LOG.exception("an entry cannot be recorded")

    def _write_messages(self, messages: Sequence[InboundMessage], file: RecordingFile) -> None:
        for message in messages:
            topic = f"{KEY_ROOT}/{message.fleet}/{message.vehicle}/{message.stream}"
            if message.stream == "aircraft":
                self._aircraft[topic] = message
            left = message.stream == "left"
            payload, encoding = (b"{}", JSON) if left else (message.payload, message.encoding)
            file.add(topic, encoding, self._ns(message.received_s), payload)
        self._counts["messages"] += len(messages)

    def _write_estimates(self, rows: Sequence[EstimateRecord], time_ns: int, file: RecordingFile) -> None:
        for row in rows:
            topic = f"{KEY_ROOT}/{row.fleet}/{row.vehicle}/estimates/{row.estimator}/{row.structure}"
            file.add(topic, PROTOBUF, time_ns, estimate_message(row))
        self._counts["estimates"] += len(rows)

    def _write_alert(self, alert: AlertView, time_ns: int, file: RecordingFile) -> None:
        file.add(vehicle_key(alert.fleet, alert.vehicle, "alerts"), PROTOBUF, time_ns, alert_message(alert))
        self._counts["alerts"] += 1

    def _open_file(self) -> RecordingFile:
        """The file that is written now; a new one where there is none or it is large or old enough."""
        limits, file = self._limits, self._file
        if file is not None:
            if file.size_bytes < limits.file_bytes and self._clock() - self._file_s < limits.file_s:
                return file
            self._file = None
            file.close()
        return self._begin_file()

    def _begin_file(self) -> RecordingFile:
        at = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(self._wall_clock()))
        number = self._number + 1
        path = self._folder / f"{_NAME}{at}-{self._session[:6]}-{number:04d}{_SUFFIX}"
        file = self._file = RecordingFile(path, RecordingPlace(self._session, number), self._started_ns)
        self._number, self._file_s = number, self._clock()
        self._counts["files"] += 1
        for topic, message in self._aircraft.items():  # whoever reads this file alone knows what flew
            file.add(topic, message.encoding, self._ns(self._file_s), message.payload, repeated=True)
        self._remove_old(path)
        return file

    def _drop_file(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            with suppress(OSError):
                file.close()

    def _remove_old(self, current: Path) -> None:
        """The oldest files go where all are too large or they are too old."""
        files = []
        for path in self._folder.glob(f"{_NAME}*{_SUFFIX}"):
            with suppress(OSError):
                found = path.stat()
                files.append((found.st_mtime, found.st_size, path))
        left = sum(size for _, size, _ in files)
        for modified_s, size, path in sorted(files):
            old = self._wall_clock() - modified_s > self._limits.keep_s
            if path == current or not (old or left + self._limits.file_bytes > self._limits.most_bytes):
                continue
            with suppress(OSError):
                os.unlink(path)
                left -= size


def estimate_message(row: EstimateRecord) -> bytes:
    """An estimate as recordings have it; equal estimates give equal bytes."""
    airspeed, altitude, density, alpha = row.condition
    message = recording_pb2.RecordedEstimate(
        time_s=row.time_s, outcome=row.outcome, covariance=row.covariance, airspeed_true_m_s=airspeed,
        altitude_m=altitude, air_density_kg_m3=density, angle_of_attack_rad=alpha, aircraft=row.aircraft,
        configuration=row.configuration,
    )  # fmt: skip
    for derivative, value, error in zip(
        STRUCTURES[row.structure].derivatives, row.value, row.standard_error, strict=True
    ):
        message.derivatives.add(symbol=str(derivative), value=value, standard_error=error)
    return message.SerializeToString(deterministic=True)


def alert_message(alert: AlertView) -> bytes:
    """An alert as recordings have it."""
    return encode_service_object("alerts", alert_document(alert).model_dump(mode="json"), PROTOBUF)
