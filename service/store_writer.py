"""The thread that writes the database: what waits, people's actions between, and the history thinned in small steps.

Every write may be repeated, for a reply can be lost; an entry that the database refuses while it works is given up
after five tries, and the others do not wait for it. What is refused because another worker has the vehicle is dropped
with all else that waits of it.
"""

import logging
import threading
import time
from collections.abc import Callable, Collection
from typing import Any

from wingwatch.baselines import (
    Database,
    DatabaseError,
    Lease,
    LeaseLostError,
    RefusedError,
    Retention,
    VehicleName,
)
from wingwatch.monitor import ActionPlan
from wingwatch.service.action_queue import ActionQueue
from wingwatch.service.loops import Loop
from wingwatch.service.store_entries import AlertEntry, Entry, EstimateEntry, WaitingEntries
from wingwatch.service.vehicle_leases import Fence

__all__ = ["StoreWriter", "sentence_of"]

_LOG = logging.getLogger(__name__)
_MOST_TRIES = 5
_RETRY_S = 1.0
_GATHER_S = 0.2  # a transaction costs as much as a hundred rows
_ESTIMATES_AT_ONCE = 5000
_PRUNE_EVERY_S = 30.0
_PRUNE_AGAIN_S = 0.5


class StoreWriter:
    """Writes what waits.

    Args:
        database: open.
        waiting: what others hand over.
        fence: gets what was refused because another worker has the vehicle.
        wall_clock: seconds since 1970-01-01 UTC.
        retention: how long the history of estimates is kept; it is not thinned without.
        end: set when the service ends; what waits then is written once.

    Attributes:
        news: set when there is something to write.
        problem: why entries are not written; None while they are.
        loop: the thread.
    """

    def __init__(
        self,
        database: Database,
        waiting: WaitingEntries,
        fence: Fence,
        wall_clock: Callable[[], float],
        retention: Retention | None,
        end: threading.Event,
        news: threading.Event,
    ) -> None:
        self._database, self._waiting, self._fence = database, waiting, fence
        self._wall_clock, self._retention, self._end = wall_clock, retention, end
        self.news = news
        self._pruned_s = float("-inf")
        self._tries: dict[Any, int] = {}
        self._counts = {"retries": 0, "refused": 0}
        self._turn = threading.Condition()
        self._actions = ActionQueue(database, fence, wall_clock, news.set, waiting.supersede)
        self.problem: str | None = None
        self.loop = Loop("wingwatch-store", "the loop that writes the database", self._run, news.set)

    @property
    def counts(self) -> dict[str, int]:
        """Writes tried again, entries refused for good, and people's actions that were not taken in time."""
        actions = self._actions
        return self._counts | {"withdrawn_actions": actions.withdrawn, "undone_actions": actions.undone}

    @property
    def actions(self) -> int:
        """People's actions that wait."""
        return self._actions.length

    def carry_out(self, plan: ActionPlan) -> None:
        """Carry out a person's action; returns once it is committed and taken (``ActionQueue.carry_out``)."""
        self._actions.carry_out(plan)

    def wait_for(self, vehicles: Collection[VehicleName], patience_s: float) -> bool:
        """Wait until nothing of these vehicles waits to be written; whether that came in time."""
        self.news.set()
        with self._turn:
            return self._turn.wait_for(lambda: not self._waiting.of_vehicles(vehicles), patience_s)

    def _run(self) -> None:
        while True:
            self.news.wait(_PRUNE_EVERY_S if self._retention is not None else None)
            ending = self._end.wait(0.0 if self._actions.waiting else _GATHER_S)
            self.news.clear()
            written = self._write()
            with self._turn:
                self._turn.notify_all()
            if ending:
                return
            if not written:
                self._end.wait(_RETRY_S)
                self.news.set()

    def _write(self) -> bool:
        """Write everything that waits; whether nothing of it has to be tried again."""
        waiting = self._waiting
        with waiting.lock:
            queues: tuple[dict[Any, Any], ...] = (waiting.alerts, waiting.references, waiting.cells)
            jobs = [(queue, key) for queue in queues for key in queue]
        estimates = waiting.take_estimates()
        problem = self._act()
        down = problem is not None
        for queue, key in jobs:
            if down:
                break  # the others would fare no better
            try:
                self._carry_out(queue, key)
            except Exception as error:  # whatever a database raises must not end this thread
                problem, down = self._again(queue, key, error), not _of_the_entry(error)
            if self._actions.waiting and not down and (fault := self._act()) is not None:
                problem, down = fault, True
        if not down and (fault := self._write_estimates(estimates)) is not None:
            problem, down = fault, True
        waiting.give_back(estimates)
        if not down:
            self._prune()
        if problem is None:
            waiting.all_written()
        self._say(problem)
        return problem is None

    def _carry_out(self, queue: dict[Any, Any], key: Any) -> None:
        """Write one entry; it waits no longer unless something newer has taken its place."""
        entry: Entry | None = queue.get(key)
        if entry is None:
            return
        try:
            entry.write(self._database, self._wall_clock())
        except LeaseLostError as error:
            self._lost(error, {entry.name: entry.lease})
            return
        with self._waiting.lock:
            self._tries.pop(key, None)
            if queue.get(key) is entry:
                queue.pop(key)
        if isinstance(entry, AlertEntry):
            _announce(entry)

    def _lost(self, error: LeaseLostError, leases: dict[VehicleName, Lease | None]) -> None:
        """Other workers have these vehicles: what waits of them is dropped."""
        lost = {name: leases.get(name) for name in error.vehicles}
        self._fence.count(self._waiting.drop(lost))
        self._fence.report(error, lost)

    def _write_estimates(self, estimates: list[EstimateEntry]) -> str | None:
        """Why the database does not take them, None where it has or never will; those written are removed."""
        while estimates:
            some = estimates[:_ESTIMATES_AT_ONCE]
            leases = {entry.name: entry.lease for entry in some}  # the newest of each vehicle
            older = [entry for entry in some if entry.lease != leases[entry.name]]
            if older:  # of an earlier watch, and others may have written since
                self._fence.count(len(older))
                estimates[: len(some)] = [entry for entry in some if entry.lease == leases[entry.name]]
                continue
            try:
                held = {name: lease for name, lease in leases.items() if lease is not None}
                self._database.append_estimates([(entry.row, entry.at_s) for entry in some], held)
            except LeaseLostError as error:
                estimates[: len(some)] = [entry for entry in some if entry.name not in error.vehicles]
                self._fence.count(sum(entry.name in error.vehicles for entry in some))
                self._lost(error, leases)
                continue
            except Exception as error:
                if not _of_the_entry(error):
                    return sentence_of(error)
                self._waiting.drop_estimates(len(some))
                _LOG.error("history not stored: %s", sentence_of(error))
            del estimates[: len(some)]
            if self._actions.waiting and (fault := self._act()) is not None:
                return fault
        return None

    def _prune(self) -> None:
        """A small step of thinning and dropping the history, where it is time for one."""
        if self._retention is None or time.monotonic() - self._pruned_s < _PRUNE_EVERY_S:
            return
        try:
            more = self._database.prune_history(self._wall_clock(), self._retention)
        except Exception as error:
            _LOG.warning("history not thinned: %s", sentence_of(error))
            more = False
        self._pruned_s = time.monotonic() - (_PRUNE_EVERY_S - _PRUNE_AGAIN_S if more else 0.0)

    def _act(self) -> str | None:
        """Carry out what people have asked for; why the database does not take it, None where it does."""
        try:
            self._actions.work()
        except Exception as error:
            return sentence_of(error)
        return None

    def _again(self, queue: dict[Any, Any], key: Any, error: Exception) -> str:
        """What happens to an entry that was not written: it waits on, unless the database refuses just this one."""
        with self._waiting.lock:
            self._counts["retries"] += 1
            entry = queue.pop(key, None)
            tries = self._tries.get(key, 0) + _of_the_entry(error)
            if tries >= _MOST_TRIES:
                self._tries.pop(key, None)
                self._counts["refused"] += 1
                _LOG.error("not stored, and given up after %d tries: %s", tries, sentence_of(error))
            elif entry is not None:
                queue[key] = entry  # last: the others need not wait for it
                if tries:
                    self._tries[key] = tries
        return sentence_of(error)

    def _say(self, problem: str | None) -> None:
        if problem is not None and problem != self.problem:
            _LOG.warning("not stored: %s", problem)
        self.problem = problem


def _announce(entry: AlertEntry) -> None:
    try:
        entry.kept(entry.alert)
    except Exception:  # it is stored, and the thread goes on
        _LOG.exception("alert %s could not be announced", entry.alert.id)


def _of_the_entry(error: Exception) -> bool:
    """Whether the entry is at fault, and not the database."""
    return isinstance(error, RefusedError) or not isinstance(error, DatabaseError)


def sentence_of(error: Exception) -> str:
    """What is said of a fault."""
    return str(error) if isinstance(error, DatabaseError) else f"{type(error).__name__}: {error}"
