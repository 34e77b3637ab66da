"""What people do to alerts, carried out by the thread that writes: whoever asks hears of it once it is committed.

An action that the database does not take in time has not happened. Where its fate is not known then, because a reply
is missing, it is undone as soon as the database answers again, before anything else is written.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar
from uuid import uuid4

from wingwatch.baselines import (
    ActionRecord,
    AlertRecord,
    Database,
    DatabaseError,
    Lease,
    LeaseLostError,
    RefusedError,
)
from wingwatch.monitor import ActionPlan, AlertView, KeyReusedError
from wingwatch.service.stored_alerts import alert_record
from wingwatch.service.vehicle_leases import Fence

__all__ = ["ActionQueue"]

_MOST_WAITING = 16  # each holds a thread of the HTTP server
_MOST_UNDONE = 1000
_PATIENCE_S = 3.0
_KEPT_S = 7 * 86_400.0
_FORGET_EVERY_S = 3600.0
_MOVED = "has just passed to another worker; nothing has happened, try again"
_Written = TypeVar("_Written")


@dataclass(eq=False, slots=True)
class _Order:
    """One action on its way.

    Attributes:
        tried: the alert as it was written, where that was tried; the reply may be missing.
        settled: committed or refused, from then on it is not withdrawn; withdrawn: its caller got a refusal.
    """

    plan: ActionPlan
    key: str
    done: threading.Event = field(default_factory=threading.Event)
    tried: AlertView | None = None
    settled: bool = False
    withdrawn: bool = False
    error: Exception | None = None


class ActionQueue:
    """Actions that wait for the database.

    Args:
        fence: gives each action the lease of its vehicle.
        wall_clock: seconds since 1970-01-01 UTC.
        wake: called when there is something to do.
        supersede: called with the id of an alert whose newer version has been written.

    Attributes:
        withdrawn: actions that the database did not take in time; undone: those of them that it turned out to have.
    """

    def __init__(
        self,
        database: Database,
        fence: Fence,
        wall_clock: Callable[[], float],
        wake: Callable[[], None],
        supersede: Callable[[str], None],
    ) -> None:
        self._database, self._fence, self._wall_clock = database, fence, wall_clock
        self._wake, self._supersede = wake, supersede
        self._lock = threading.Lock()
        self._orders: list[_Order] = []
        self._void: dict[str, ActionPlan] = {}
        self._forgot_s = float("-inf")
        self.withdrawn = 0
        self.undone = 0

    @property
    def waiting(self) -> bool:
        """Whether anything is to be done."""
        return bool(self._orders or self._void)

    @property
    def length(self) -> int:
        """Actions that wait to be carried out or undone."""
        return len(self._orders) + len(self._void)

    def carry_out(self, plan: ActionPlan) -> None:
        """Wait until the action is committed and shown; one of the same key that was so before is left as it is.

        Raises:
            ValueError: it makes no sense in the alert's state.
            KeyReusedError: its key belongs to another action.
            DatabaseError: the database has not taken it, and it has not happened.
        """
        order = _Order(plan, plan.request.key or uuid4().hex)
        with self._lock:
            if len(self._orders) >= _MOST_WAITING or len(self._void) >= _MOST_UNDONE:
                raise DatabaseError("too many actions wait for the database; nothing has happened, try again")
            self._orders.append(order)
        self._wake()
        if not order.done.wait(_PATIENCE_S) and self._withdraw(order):
            raise DatabaseError(
                f"the database has not taken the action within {_PATIENCE_S:.0f} s; nothing has happened, try again"
            )
        order.done.wait()
        if order.error is not None:
            raise order.error

    def _withdraw(self, order: _Order) -> bool:
        """Whether it is not too late for that."""
        with self._lock:
            if order.settled:
                return False
            order.withdrawn = True
            self.withdrawn += 1
            if order in self._orders:
                self._orders.remove(order)
            if order.tried is not None:
                self._void[order.key] = order.plan
        self._wake()
        return True

    # -- in the thread that writes -------------------------------------------------------------------

    def work(self) -> None:
        """Undo and carry out what waits.

        Raises:
            DatabaseError: the database does not take it; it waits on.
        """
        self._undo()
        while True:
            with self._lock:
                if not self._orders:
                    break
                order = self._orders[0]
            self._carry_out(order)
            self._undo()
            self._forget()

    def _undo(self) -> None:
        with self._lock:
            void = list(self._void.items())
        for key, plan in void:
            newest = plan.newest()
            void_action = partial(self._database.void_action, key, self._record(newest))
            try:
                undone = self._under_lease(newest, void_action)
            except LeaseLostError:  # another worker has the vehicle: the action stands, and its key tells so
                undone = False
            if undone:
                self.undone += 1
                self._supersede(newest.id)
                plan.written(newest)
            with self._lock:
                self._void.pop(key, None)

    def _carry_out(self, order: _Order) -> None:
        try:
            changed = self._committed(order)
        except LeaseLostError as error:
            self._refuse(order, DatabaseError(f"{'/'.join(error.vehicles[0])} {_MOVED}"))
            return
        except (ValueError, RefusedError) as error:
            self._refuse(order, error)
            return
        if not self._settle(order):
            return  # it is in the database, and its caller got a refusal: it is undone next
        try:
            if changed is not None:
                self._supersede(order.plan.request.alert_id)
                order.plan.taken(changed)
        except Exception as error:
            order.error = error
        order.done.set()

    def _refuse(self, order: _Order, error: Exception) -> None:
        if self._settle(order):
            order.error = error
            order.done.set()

    def _under_lease(self, alert: AlertView, write: Callable[[Lease | None], _Written]) -> _Written:
        """Write under the lease of the alert's vehicle; ``LeaseLostError`` where another worker has it."""
        name = alert.fleet, alert.vehicle
        admitted, lease = self._fence.admits(*name)
        if not admitted:
            raise LeaseLostError([name])
        try:
            return write(lease)
        except LeaseLostError as error:
            self._fence.count(1)
            self._fence.report(error, {name: lease})
            raise

    def _record(self, alert: AlertView) -> AlertRecord:
        now_s = self._wall_clock()
        return alert_record(alert, now_s, now_s)

    def _committed(self, order: _Order) -> AlertView | None:
        """The alert as it is now stored; None where an earlier request of the same key has done so."""
        request = order.plan.request
        known = self._database.action(order.key)
        if known is not None:
            if order.tried is not None:
                return order.tried
            if (known.alert_id, known.action, known.who, known.note) != (
                request.alert_id, str(request.action), request.who, request.note,
            ):  # fmt: skip
                raise KeyReusedError("this Idempotency-Key belongs to another action; give each its own")
            return None
        changed = order.plan.change()
        with self._lock:
            if order.withdrawn:
                return None
            order.tried = changed
        record = ActionRecord(
            order.key, request.alert_id, str(request.action), request.who, request.note, self._wall_clock()
        )
        self._under_lease(changed, partial(self._database.save_action, self._record(changed), record))
        return changed

    def _settle(self, order: _Order) -> bool:
        """From now on its fate is known; False where its caller waits no longer."""
        with self._lock:
            order.settled = not order.withdrawn
            if order in self._orders:
                self._orders.remove(order)
            return order.settled

    def _forget(self) -> None:
        now_s = self._wall_clock()
        if not 0.0 <= now_s - self._forgot_s < _FORGET_EVERY_S:
            self._forgot_s = now_s
            self._database.forget_actions(now_s - _KEPT_S)
