"""Which vehicles a worker watches."""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

__all__ = ["ByOrder", "EveryVehicle", "Ownership", "first_in_order", "in_order"]

_DENOMINATOR = 2.0**64 + 1.0


class Ownership(Protocol):
    """Says which vehicles are this worker's; the answer may change at any time. Every method is thread-safe."""

    def owns(self, fleet: str, vehicle: str) -> bool:
        """Whether this worker watches the vehicle now; it returns at once."""
        ...

    def heard(self, fleet: str, vehicle: str) -> None:
        """A vehicle is there; it returns at once."""
        ...


class EveryVehicle:
    """A worker that watches all vehicles there are."""

    def owns(self, fleet: str, vehicle: str) -> bool:
        """Every one."""
        return True

    def heard(self, fleet: str, vehicle: str) -> None:
        """It is watched already."""


class ByOrder:
    """Each vehicle is watched by the first of the live workers in its order; nobody is asked, so no lease is held.

    Workers that hear of a change at different moments may both watch a vehicle for as long, or neither.

    Args:
        me: name of this worker.
        live: names of those that live.
    """

    def __init__(self, me: str, live: Callable[[], Sequence[str]]) -> None:
        self._me, self._live = me, live

    def owns(self, fleet: str, vehicle: str) -> bool:
        """Whether this worker is the first of those that live."""
        live = self._live()
        return self._me in live and first_in_order(live, fleet, vehicle) == self._me

    def heard(self, fleet: str, vehicle: str) -> None:
        """The order is known without."""


def first_in_order(workers: Sequence[str], fleet: str, vehicle: str) -> str:
    """The worker that a vehicle belongs to; ``ValueError`` without any."""
    return max(workers, key=lambda worker: _score(worker, 1.0, fleet, vehicle))


def in_order(capacities: Mapping[str, float], fleet: str, vehicle: str) -> list[str]:
    """Workers by who watches a vehicle first: rendezvous hashing, weighted by capacity.

    A worker that comes or goes moves only the vehicles that it watches then or has watched. Of many vehicles each
    worker is first for as large a part as its capacity is of all.

    Source: Schindelhauer and Schomaker, Weighted distributed hash tables, SPAA 2005, the logarithmic method.
    """
    return sorted(capacities, key=lambda w: (-_score(w, capacities[w], fleet, vehicle), w))


def _score(worker: str, capacity: float, fleet: str, vehicle: str) -> float:
    digest = hashlib.blake2b(f"{worker}/{fleet}/{vehicle}".encode(), digest_size=8).digest()
    uniform = (int.from_bytes(digest) + 1.0) / _DENOMINATOR
    return -capacity / math.log(uniform)
