"""Zenoh keys of the link between workers and gateways: a prefix of its own, apart from what vehicles may reach."""

import math
from uuid import uuid4

from wingwatch.telemetry.keys import KeyNameError, check_name

__all__ = [
    "EVERY_LOAD",
    "EVERY_TOKEN",
    "LEAST_CAPACITY",
    "MOST_CAPACITY",
    "WORKER_ROOT",
    "check_worker",
    "new_worker_name",
    "parse_token_key",
    "token_key",
    "worker_key",
]

WORKER_ROOT = "wingwatch/workers/v1"
"""Prefix of everything that workers and gateways say to each other."""

EVERY_TOKEN = f"{WORKER_ROOT}/alive/*/*"
"""Key expression of all workers' liveliness tokens: name and capacity."""

EVERY_LOAD = f"{WORKER_ROOT}/*/load"

LEAST_CAPACITY, MOST_CAPACITY = 0.001, 1000.0

_ALIVE = "alive"
_LONGEST_NAME = 63 - 9
_LONGEST_CAPACITY = 16


def new_worker_name(name: str = "") -> str:
    """A name that no worker has had before: leases of an earlier start under the same name are not its own.

    Args:
        name: for people, in front; at most 54 characters.

    Raises:
        KeyNameError: it may not stand in a key.
    """
    if not name:
        return uuid4().hex
    if len(name) > _LONGEST_NAME:
        raise KeyNameError(f"worker {name!r} is too long a name: use at most {_LONGEST_NAME} characters")
    return f"{check_worker(name)}-{uuid4().hex[:8]}"


def check_worker(name: str) -> str:
    """The name itself if a worker may be called so.

    Raises:
        KeyNameError: it may not stand in a key, or tokens stand there.
    """
    if name == _ALIVE:
        raise KeyNameError(
            f"worker {name!r} is no valid name: the workers' tokens stand there; use another one"
        )
    return check_name("worker", name)


def token_key(worker: str, capacity: float | str) -> str:
    """Key of a worker's liveliness token; ``*`` for any capacity.

    Args:
        capacity: what it takes beside others; 0 while it takes nothing: before it is ready, and once it leaves.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    shown = capacity if isinstance(capacity, str) else f"{capacity:.3f}".rstrip("0").rstrip(".")
    return f"{WORKER_ROOT}/{_ALIVE}/{check_worker(worker)}/{shown}"


def parse_token_key(key: str) -> tuple[str, float]:
    """Name and capacity of the worker whose token stands under a key.

    Raises:
        KeyNameError: a key that is not ``wingwatch/workers/v1/alive/<worker>/<capacity>``.
    """
    root, _, rest = key[:256].partition(f"/{_ALIVE}/")
    worker, _, shown = rest.partition("/")
    plain = shown.replace(".", "", 1)
    capacity = (
        float(shown) if plain.isascii() and plain.isdigit() and len(shown) <= _LONGEST_CAPACITY else math.inf
    )
    if root != WORKER_ROOT or capacity > MOST_CAPACITY:
        raise KeyNameError(f"{key[:80]!r} is no key of the form {WORKER_ROOT}/{_ALIVE}/<worker>/<capacity>")
    return check_worker(worker), capacity


def worker_key(worker: str, what: str) -> str:
    """Key of one thing of one worker, such as a question that it answers; ``*`` for all of them.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{WORKER_ROOT}/{check_worker(worker)}/{what}"
