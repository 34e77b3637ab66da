"""The leases under which the store writes: who gives them, and what becomes of what was found under a lost one."""

import logging
import threading
from collections.abc import Mapping
from typing import Protocol

from wingwatch.baselines import Lease, LeaseLostError, VehicleName

__all__ = ["Fence", "VehicleLeases"]

_LOG = logging.getLogger(__name__)


class VehicleLeases(Protocol):
    """Knows which vehicles this worker watches; both methods return at once, in any thread."""

    def lease_of(self, fleet: str, vehicle: str) -> Lease | None:
        """The lease of a vehicle; None where this worker does not watch it."""
        ...

    def lost(self, fleet: str, vehicle: str, lease: Lease) -> None:
        """The database says that a lease no longer holds: the vehicle is not this worker's. It may say so twice."""
        ...


class Fence:
    """Gives each entry the lease that holds while it is made, and counts what is refused under it later.

    Args:
        leases: None where one worker watches everything: nothing is checked.

    Attributes:
        fenced: entries that were dropped because their vehicle is another worker's.
    """

    def __init__(self, leases: VehicleLeases | None) -> None:
        self._leases = leases
        self._lock = threading.Lock()
        self.fenced = 0

    def admits(self, fleet: str, vehicle: str) -> tuple[bool, Lease | None]:
        """Whether an entry of the vehicle may be made, and under which lease; None where nothing is checked."""
        if self._leases is None:
            return True, None
        lease = self._leases.lease_of(fleet, vehicle)
        if lease is None:
            self.count(1)
        return lease is not None, lease

    def count(self, entries: int) -> None:
        """So many more were dropped."""
        with self._lock:
            self.fenced += entries

    def report(self, error: LeaseLostError, leases: Mapping[VehicleName, Lease | None]) -> None:
        """Say which vehicles are not ours; ``leases``: under which it was tried."""
        _LOG.warning("not stored: %s", error)
        for name in error.vehicles:
            lease = leases.get(name)
            if self._leases is not None and lease is not None:
                self._leases.lost(*name, lease)
