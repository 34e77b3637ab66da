"""The thread that reads the database: memories that were asked for, alerts of earlier runs, changes of the baseline."""

import logging
import threading
from collections.abc import Callable, Sequence

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import BaselineLedger, ChangeRecord, Database, VehicleName
from wingwatch.monitor import AlertView, VehicleMemory
from wingwatch.operations.baseline import stored_cells, stored_envelopes, stored_references
from wingwatch.service.loops import Loop
from wingwatch.service.store_entries import Series, WaitingEntries
from wingwatch.service.store_writer import sentence_of
from wingwatch.service.stored_alerts import kept_alerts

__all__ = ["StoreReader"]

_LOG = logging.getLogger(__name__)
_MOST_ASKED = 1000
_RETRY_S = 1.0
_LOOK_EVERY_S = 2.0  # for changes of the baseline by others
_CHANGES_OF_S = 86_400.0  # at the start: vehicles that go on may have been saved before them


class StoreReader:
    """Reads what is asked for.

    Args:
        database: open.
        waiting: what is not written yet; it belongs to what is known of a vehicle.
        wall_clock: seconds since 1970-01-01 UTC.
        end: set when the service ends.

    Attributes:
        question: set when there is something to read.
        failed: reads that failed.
        problem: why nothing is read; None while it is.
        loop: the thread.
    """

    def __init__(
        self,
        database: Database,
        waiting: WaitingEntries,
        wall_clock: Callable[[], float],
        end: threading.Event,
    ) -> None:
        self._database, self._waiting, self._wall_clock, self._end = database, waiting, wall_clock, end
        self._ledger = BaselineLedger(database)
        self._changes: list[ChangeRecord] = []
        self._noticed: int | None = None
        self._asked: dict[Series, Aircraft] = {}
        self._recalled: dict[Series, VehicleMemory] = {}
        self._lock = threading.Lock()
        self._earlier: Sequence[AlertView] | None = None
        self._earlier_read = threading.Event()
        self.question = threading.Event()
        self.failed = 0
        self.problem: str | None = None
        self.loop = Loop("wingwatch-recall", "the loop that reads the database", self._run, self.question.set)

    @property
    def asked(self) -> int:
        """Vehicles whose memory is to be read."""
        return len(self._asked)

    def recall(self, asked: Series, aircraft: Aircraft) -> VehicleMemory | None:
        """What is kept of a vehicle, what waits to be written included; None while it is being read."""
        with self._lock:
            found = self._recalled.pop(asked, None)
            if found is None and len(self._asked) < _MOST_ASKED:
                self._asked.setdefault(asked, aircraft)
        if found is None:
            self.question.set()
        return found

    def forget(self, vehicle: VehicleName) -> None:
        """What was read of a vehicle is read anew when it is asked for again: another worker may write it now."""
        with self._lock:
            for asked in [one for one in self._recalled if one[:2] == vehicle]:
                self._recalled.pop(asked)

    def earlier_alerts(self, patience_s: float) -> Sequence[AlertView] | None:
        """Alerts of earlier runs, newest first; None where they have not been read in time."""
        if not self._earlier_read.is_set():
            self.question.set()
            self._earlier_read.wait(patience_s)
        return self._earlier

    def changes(self) -> Sequence[ChangeRecord]:
        """Changes that others made to the baseline since the last call."""
        with self._lock:
            found, self._changes = self._changes, []
        return found

    def _run(self) -> None:
        """Read for everybody who asked; a read that fails is tried again, and never passes for an empty one."""
        while not self._end.is_set():
            self.question.wait(_LOOK_EVERY_S)
            self.question.clear()
            if self._end.is_set():
                return
            self._look()
            with self._lock:
                asked = list(self._asked.items())
            if not self._read_earlier():
                continue
            for key, aircraft in asked:
                if self._end.is_set():
                    return
                try:
                    found = self._read(key, aircraft)
                except Exception as error:  # whatever a database raises must not end this thread
                    self._not_read(error)
                    break
                self.problem = None
                with self._lock:
                    self._asked.pop(key)
                    self._recalled[key] = found
                    while len(self._recalled) > _MOST_ASKED:
                        self._recalled.pop(next(iter(self._recalled)))

    def _look(self) -> None:
        """Notice changes of the baseline; a database that does not answer is asked again later."""
        try:
            if self._noticed is None:
                newest = self._ledger.newest_change()
                since_s = self._wall_clock() - _CHANGES_OF_S
                found = [c for c in self._ledger.changes(0) if c.at_s >= since_s]
                self._waiting.taken = newest if not found else (found[0].id or 1) - 1
            else:
                newest, found = self._noticed, list(self._ledger.changes(self._noticed))
        except Exception as error:  # whatever a database raises must not end this thread
            _LOG.debug("changes of the baseline not read: %s", sentence_of(error))
            return
        if found:
            newest = max(newest, found[-1].id or 0)
            with self._lock:
                self._changes += found
                self._recalled.clear()  # read before the change
            _LOG.info("the baseline was changed: %s", "; ".join(c.text for c in found[-3:]))
        self._noticed = newest

    def _read_earlier(self) -> bool:
        """Alerts of earlier runs, once; whether they have been read."""
        if self._earlier is None:
            try:
                self._earlier = kept_alerts(self._database)
            except Exception as error:
                self._not_read(error)
                return False
            self.problem = None
            self._earlier_read.set()
        return True

    def _not_read(self, error: Exception) -> None:
        self.failed += 1
        problem = sentence_of(error)
        if problem != self.problem:
            _LOG.warning("not read: %s", problem)
        self.problem = problem
        self._end.wait(_RETRY_S)
        self.question.set()

    def _read(self, asked: Series, aircraft: Aircraft) -> VehicleMemory:
        # What waits is looked at before the database: what is written in between is then seen there or here.
        references, cells = self._waiting.memory_of(asked)
        return VehicleMemory(
            stored_references(self._database, *asked) | references,
            stored_envelopes(self._database, aircraft, asked[3]),
            stored_cells(self._database, *asked, self._wall_clock()) | cells,
            self._noticed or 0,
        )
