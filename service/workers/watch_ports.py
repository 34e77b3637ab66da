"""What a worker's watch keeping needs from outside: leases, members, what watches vehicles, and other workers."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from wingwatch.baselines import Lease, Leases, VehicleName
from wingwatch.service.workers.shares import Worker

__all__ = ["KeeperPorts", "LeasePort", "MembersPort", "MovesPort", "WatchPort"]


class LeasePort(Protocol):
    """The leases in the database (``wingwatch.baselines.LeaseTable``); every method may raise ``DatabaseError``."""

    def renew(self, owner: str) -> None:
        """Hold what is the owner's for a lease's length more."""
        ...

    def take(self, owner: str, vehicles: Collection[VehicleName]) -> Mapping[VehicleName, Lease]:
        """Take what nobody holds; gives what is the owner's then."""
        ...

    def give_up(self, owner: str, vehicles: Collection[VehicleName]) -> None:
        """Others may take these at once."""
        ...

    def forget(self, owner: str, vehicles: Collection[VehicleName]) -> None:
        """Nobody needs to watch these any more."""
        ...

    def leave(self, owner: str) -> None:
        """Give up everything."""
        ...

    def look(self, owner: str, everything: bool = True) -> Leases:
        """The leases as they stand."""
        ...


class MembersPort(Protocol):
    """Who is on the network; every method returns at once."""

    def linked(self) -> bool:
        """Whether this worker is."""
        ...

    def workers(self) -> Mapping[str, Worker]:
        """All that are, this one included while it is to be seen."""
        ...

    def appear(self) -> None:
        """Be seen; may be called again."""
        ...

    def retire(self) -> None:
        """Be seen as a worker that leaves: others take what it has."""
        ...


class WatchPort(Protocol):
    """What watches vehicles."""

    def known(self) -> Collection[VehicleName]:
        """Vehicles that send or are announced."""
        ...

    def start(self, vehicle: VehicleName, lease: Lease, state: bytes | None) -> None:
        """Watch a vehicle from now on.

        Args:
            state: its checkpoint where its last owner handed it over; else the newest at hand is used.
        """
        ...

    def stop(self, vehicles: Sequence[VehicleName]) -> Mapping[VehicleName, bytes]:
        """Watch these no longer, and give their checkpoints (empty where there is none).

        What waits of them is written before this returns, as far as that takes no longer than a second.
        """
        ...

    def drop(self, vehicle: VehicleName, lease: Lease) -> None:
        """The vehicle is another worker's already: watch it no longer, and keep nothing of what waits."""
        ...


class MovesPort(Protocol):
    """Talks to other workers; both methods return at once."""

    def ask(self, owner: str, vehicle: VehicleName, answered: Callable[[bytes | None], None]) -> None:
        """Ask a worker to release a vehicle.

        Args:
            answered: called once, in any thread, with its checkpoint (empty where there is none); with None where it
                keeps the vehicle or does not answer in time.
        """
        ...

    def tell(self, owner: str, vehicle: VehicleName, number: int) -> None:
        """Say to a worker that its lease of a vehicle has passed on, under this number."""
        ...


@dataclass(frozen=True, slots=True)
class KeeperPorts:
    """What a keeper works with."""

    leases: LeasePort
    members: MembersPort
    watch: WatchPort
    moves: MovesPort
