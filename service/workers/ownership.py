"""Which vehicles a worker watches."""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

__all__ = ["ByOrder", "EveryVehicle", "Ownership", "first_in_order", "in_order"]

_DENOMINATOR = 2.0**64 + 1.0


class Ownership(Protocol):
    """Says which vehicles are this worker's; the answer may change at any time. ``owned`` is asked by one thread."""

    def owned(self, vehicles: Sequence[tuple[str, str]]) -> set[tuple[str, str]]:
        """Which of these, by fleet and name, this worker is to watch now; it may take a moment."""
        ...

    def heard(self, fleet: str, vehicle: str) -> None:
        """A vehicle is there; it returns at once."""
        ...


class EveryVehicle:
    """A worker that watches all vehicles there are."""

    def owned(self, vehicles: Sequence[tuple[str, str]]) -> set[tuple[str, str]]:
        """Every one."""
        return set(vehicles)

    def heard(self, fleet: str, vehicle: str) -> None:
        """It is watched already."""


class ByOrder:
    """Each vehicle is watched by the first of the live workers in its order; nobody is asked, so no lease is held.

    Workers that see a change at different moments may both watch a vehicle for as long, or neither.

    Args:
        me: name of this worker.
        capacities: of those that live, by name.
    """

    def __init__(self, me: str, capacities: Callable[[], Mapping[str, float]]) -> None:
        self._me, self._capacities = me, capacities

    def owned(self, vehicles: Sequence[tuple[str, str]]) -> set[tuple[str, str]]:
        """Those of which this worker is the first of those that live."""
        capacities = self._capacities()
        if self._me not in capacities:
            return set()
        return {key for key in vehicles if first_in_order(capacities, *key) == self._me}

    def heard(self, fleet: str, vehicle: str) -> None:
        """The order is known without."""


def first_in_order(capacities: Mapping[str, float], fleet: str, vehicle: str) -> str:
    """The first of ``in_order``; ``ValueError`` without any worker."""
    return max(capacities, key=lambda worker: _score(worker, capacities[worker], fleet, vehicle))


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
