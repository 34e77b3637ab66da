"""Writes under a lease: refused where another worker has taken the vehicle since.

The check stands in the transaction of the write and locks the rows of the leases, so no vehicle changes hands between
the check and the commit.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, and_, or_, select
from sqlalchemy.orm import Session

from wingwatch.baselines.connection import RefusedError
from wingwatch.baselines.tables import VehicleLeaseRow

__all__ = ["Lease", "LeaseLostError", "VehicleName", "among", "check_leases"]

VehicleName = tuple[str, str]
"""Fleet and vehicle."""

_AT_ONCE = 5000
_SHOWN = 3


@dataclass(frozen=True, slots=True)
class Lease:
    """The right to write what is found about a vehicle.

    Attributes:
        owner: a worker; it takes a new name at each start.
        number: grows whenever the vehicle changes hands.
    """

    owner: str
    number: int


class LeaseLostError(RefusedError):
    """Another worker has taken a vehicle, or its lease was given up: nothing was written.

    Attributes:
        vehicles: those whose lease no longer holds.
    """

    def __init__(self, vehicles: Collection[VehicleName]) -> None:
        self.vehicles = tuple(sorted(vehicles))
        shown = ", ".join("/".join(name) for name in self.vehicles[:_SHOWN])
        more = len(self.vehicles) - _SHOWN
        super().__init__(
            f"the lease of {shown}{f' and {more} more' if more > 0 else ''} has passed to another worker; "
            "what this one still had to write of it is dropped"
        )


def check_leases(session: Session, leases: Mapping[VehicleName, Lease]) -> None:
    """Make sure that leases hold until the session's transaction ends; to be called before it does anything else.

    Raises:
        LeaseLostError: some do not.
    """
    held: dict[VehicleName, Lease] = {}
    names = sorted(leases)  # one order for all transactions, so that none waits for another in a circle
    for start in range(0, len(names), _AT_ONCE):
        held |= _locked(session, names[start : start + _AT_ONCE])
    lost = [name for name in names if held.get(name) != leases[name]]
    if lost:
        raise LeaseLostError(lost)


def among(names: Collection[VehicleName]) -> ColumnElement[bool]:
    """Condition for the leases of vehicles, of which there is at least one.

    Fleet by fleet: SQLite looks pairs of columns up without the key's index.
    """
    fleets: dict[str, list[str]] = {}
    for fleet, vehicle in names:
        fleets.setdefault(fleet, []).append(vehicle)
    row = VehicleLeaseRow
    return or_(*(and_(row.fleet == fleet, row.vehicle.in_(those)) for fleet, those in fleets.items()))


def _locked(session: Session, names: Sequence[VehicleName]) -> dict[VehicleName, Lease]:
    """Leases as they stand, locked against a change of hands (SQLite's transactions that write are alone already)."""
    row = VehicleLeaseRow
    wanted = (
        select(row.fleet, row.vehicle, row.owner, row.number)
        .where(among(names))
        .order_by(row.fleet, row.vehicle)
        .with_for_update(read=True)
    )
    return {
        (fleet, vehicle): Lease(owner, number) for fleet, vehicle, owner, number in session.execute(wanted)
    }
