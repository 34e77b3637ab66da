"""Which worker watches which vehicle: leases in the database, by the database's clock.

A worker renews one row of its own, and its vehicles are its own for as long as that row holds: a renewal costs the same
for one vehicle and for a thousand. A vehicle's number grows whenever it changes hands, and whoever writes under an
older number is refused (``wingwatch.baselines.fencing``). Why so:
``docs/decisions/0119-leases-and-moving.md``.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Double, and_, cast, delete, exists, extract, func, select, update
from sqlalchemy.orm import Session

from wingwatch.baselines.connection import inserting
from wingwatch.baselines.database import Database
from wingwatch.baselines.fencing import Lease, VehicleName, among
from wingwatch.baselines.tables import VehicleLeaseRow, WorkerLeaseRow

__all__ = ["LEASE_S", "Holder", "LeaseTable", "Leases"]

LEASE_S = 3.0
"""How long a worker that does not renew keeps its vehicles."""

_NOBODY = ""
_FORGET_S = 86_400.0
_AT_ONCE = 500
_ROUNDING_S = 1.0


@dataclass(frozen=True, slots=True)
class Holder:
    """Who watches a vehicle.

    Attributes:
        owner: empty for nobody.
        number: of the lease.
        valid: whether the owner has renewed in time; else any worker may take the vehicle.
    """

    owner: str
    number: int
    valid: bool

    @property
    def lease(self) -> Lease:
        """What the owner writes under."""
        return Lease(self.owner, self.number)


@dataclass(frozen=True, slots=True)
class Leases:
    """A look at the leases.

    Attributes:
        workers: owners, and whether each has renewed in time.
        vehicles: by fleet and vehicle.
        complete: whether ``vehicles`` are all, and not only those of one owner and those that may be taken.
    """

    workers: Mapping[str, bool]
    vehicles: Mapping[VehicleName, Holder]
    complete: bool


class LeaseTable:
    """The leases of an open database; any number of threads and programs may use them at once.

    Every method may raise ``DatabaseError``. Whether its call has changed anything is not known then; ``look`` tells.

    Args:
        lease_s: how long a worker that does not renew keeps its vehicles.
    """

    def __init__(self, database: Database, lease_s: float = LEASE_S) -> None:
        self._database = database
        self._lease_s = lease_s

    def renew(self, owner: str) -> None:
        """From now on the owner holds what is its own for ``lease_s`` more; it is entered where it is new."""
        with self._database.writing() as session:
            until_s = _now_s(session) + self._lease_s
            row = inserting(session)(WorkerLeaseRow).values(owner=owner, until_s=until_s)
            session.execute(
                row.on_conflict_do_update(index_elements=[WorkerLeaseRow.owner], set_={"until_s": until_s})
            )

    def take(self, owner: str, vehicles: Collection[VehicleName]) -> dict[VehicleName, Lease]:
        """Take vehicles that nobody holds; those that are missing in the answer belong to others.

        What is the owner's already keeps its number. An owner that has not renewed in time takes nothing.
        """
        taken: dict[VehicleName, Lease] = {}
        names = sorted(set(vehicles))
        for start in range(0, len(names), _AT_ONCE):
            with self._database.writing() as session:
                taken |= self._take(session, owner, names[start : start + _AT_ONCE])
        return taken

    def give_up(self, owner: str, vehicles: Collection[VehicleName]) -> None:
        """Others may take these at once; what is not the owner's stays as it is."""
        names = sorted(set(vehicles))
        with self._database.writing() as session:
            for start in range(0, len(names), _AT_ONCE):
                some = names[start : start + _AT_ONCE]
                _lock(session, some)
                session.execute(update(VehicleLeaseRow).where(among(some), _of(owner)).values(owner=_NOBODY))

    def forget(self, owner: str, vehicles: Collection[VehicleName]) -> None:
        """Remove the owner's leases of vehicles that nobody needs to watch any more."""
        names = sorted(set(vehicles))
        with self._database.writing() as session:
            for start in range(0, len(names), _AT_ONCE):
                some = names[start : start + _AT_ONCE]
                _lock(session, some)
                session.execute(delete(VehicleLeaseRow).where(among(some), _of(owner)))

    def leave(self, owner: str) -> None:
        """Give up everything; workers that ended a day ago without that are forgotten with this."""
        with self._database.writing() as session:
            mine = select(VehicleLeaseRow.fleet, VehicleLeaseRow.vehicle).where(_of(owner))
            _lock(session, [(fleet, vehicle) for fleet, vehicle in session.execute(mine)])
            session.execute(update(VehicleLeaseRow).where(_of(owner)).values(owner=_NOBODY))
            session.execute(delete(WorkerLeaseRow).where(WorkerLeaseRow.owner == owner))
            holds = exists().where(VehicleLeaseRow.owner == WorkerLeaseRow.owner)
            ended = WorkerLeaseRow.until_s < _now_s(session) - _FORGET_S
            session.execute(delete(WorkerLeaseRow).where(ended, ~holds))

    def look(self, owner: str, everything: bool = True) -> Leases:
        """The leases as they stand.

        Args:
            everything: all of them; else the owner's own, and those that may be taken.
        """
        with self._database.reading() as session:
            workers = self._workers(session)
            query = select(
                VehicleLeaseRow.fleet, VehicleLeaseRow.vehicle, VehicleLeaseRow.owner, VehicleLeaseRow.number
            )
            if not everything:
                ended = [name for name, valid in workers.items() if not valid]
                query = query.where(VehicleLeaseRow.owner.in_([owner, _NOBODY, *ended]))
            vehicles = {
                (fleet, vehicle): Holder(holder, number, workers.get(holder, False))
                for fleet, vehicle, holder, number in session.execute(query)
            }
        return Leases(workers, vehicles, everything)

    def _take(self, session: Session, owner: str, names: list[VehicleName]) -> dict[VehicleName, Lease]:
        new = [{"fleet": f, "vehicle": v, "owner": _NOBODY, "number": 0} for f, v in names]
        session.execute(inserting(session)(VehicleLeaseRow).values(new).on_conflict_do_nothing())
        found = _lock(session, names)
        # Looked at after the vehicles are locked: an owner that renewed in the meantime keeps them.
        workers = self._workers(session)
        if not workers.get(owner, False):
            return {}
        mine = {name: lease for name, lease in found.items() if lease.owner == owner}
        free = [name for name, lease in found.items() if not workers.get(lease.owner, False)]
        if free:
            changes = update(VehicleLeaseRow).where(among(free))
            session.execute(changes.values(owner=owner, number=VehicleLeaseRow.number + 1))
        return mine | {name: Lease(owner, found[name].number + 1) for name in free}

    def _workers(self, session: Session) -> dict[str, bool]:
        """Owners, and whether each has renewed in time."""
        now_s, until_s = _now_s(session), WorkerLeaseRow.until_s
        # One that ends later than any can was written before the clock was set back: its owner may be dead.
        renewed = and_(until_s > now_s, until_s < now_s + self._lease_s + _ROUNDING_S)
        query = select(WorkerLeaseRow.owner, renewed)
        return {owner: bool(valid) for owner, valid in session.execute(query)}


def _lock(session: Session, names: list[VehicleName]) -> dict[VehicleName, Lease]:
    """Leases as they stand, for this transaction to change; locked in one order, so that none waits in a circle."""
    if not names:
        return {}
    row = VehicleLeaseRow
    query = (
        select(row.fleet, row.vehicle, row.owner, row.number)
        .where(among(names))
        .order_by(row.fleet, row.vehicle)
        .with_for_update()
    )
    return {
        (fleet, vehicle): Lease(owner, number) for fleet, vehicle, owner, number in session.execute(query)
    }


def _now_s(session: Session) -> Any:
    """The database's clock at the instant at which it looks (not at the begin of the transaction), since 1970."""
    if session.connection().dialect.name == "postgresql":
        return cast(extract("epoch", func.clock_timestamp()), Double)
    return (func.julianday("now") - 2440587.5) * 86_400.0


def _of(owner: str) -> Any:
    return VehicleLeaseRow.owner == owner
