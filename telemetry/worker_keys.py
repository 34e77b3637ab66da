"""Zenoh keys of the link between workers and gateways: a prefix of its own, apart from what vehicles may reach."""

from enum import StrEnum
from uuid import uuid4

from wingwatch.telemetry.keys import KeyNameError, check_name

__all__ = [
    "WORKER_ROOT",
    "WorkerToken",
    "check_worker",
    "every_worker",
    "new_worker_name",
    "parse_token_key",
    "token_key",
    "worker_key",
]

WORKER_ROOT = "wingwatch/workers/v1"


class WorkerToken(StrEnum):
    """What a worker shows of itself by liveliness tokens.

    ``present``: it answers questions. ``alive``: it watches vehicles, or will; while it makes ready beside others, and
    while it gives its vehicles up in order, it is present alone.
    """

    PRESENT = "present"
    ALIVE = "alive"


def new_worker_name() -> str:
    """A name that no other worker has."""
    return uuid4().hex


def check_worker(name: str) -> str:
    """The name itself if a worker may be called so.

    Raises:
        KeyNameError: it may not stand in a key, or tokens stand there.
    """
    if name in set(WorkerToken):
        raise KeyNameError(
            f"worker {name!r} is no valid name: the workers' tokens stand there; use another one"
        )
    return check_name("worker", name)


def token_key(token: WorkerToken, worker: str) -> str:
    """Key of a worker's liveliness token.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{WORKER_ROOT}/{token}/{check_worker(worker)}"


def every_worker(token: WorkerToken) -> str:
    """Key expression of a token of all workers."""
    return f"{WORKER_ROOT}/{token}/*"


def parse_token_key(token: WorkerToken, key: str) -> str:
    """The worker whose token stands under a key.

    Raises:
        KeyNameError: a key that is not ``wingwatch/workers/v1/<token>/<worker>``.
    """
    root, _, worker = key[:256].rpartition("/")
    if root != f"{WORKER_ROOT}/{token}":
        raise KeyNameError(f"{key[:80]!r} is no key of the form {WORKER_ROOT}/{token}/<worker>")
    return check_worker(worker)


def worker_key(worker: str, question: str) -> str:
    """Key under which a worker answers a question; ``*`` for all of them.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{WORKER_ROOT}/{check_worker(worker)}/{question}"
