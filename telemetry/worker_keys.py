"""Zenoh keys of the link between workers and gateways: a prefix of its own, apart from what vehicles may reach."""

from uuid import uuid4

from wingwatch.telemetry.keys import KeyNameError, check_name

__all__ = [
    "EVERY_WORKER_ALIVE",
    "WORKER_ROOT",
    "check_worker",
    "new_worker_name",
    "parse_worker_alive_key",
    "worker_alive_key",
    "worker_key",
]

WORKER_ROOT = "wingwatch/workers/v1"
_ALIVE = "alive"
EVERY_WORKER_ALIVE = f"{WORKER_ROOT}/{_ALIVE}/*"
"""Key expression of all workers' liveliness tokens."""


def new_worker_name() -> str:
    """A name that no other worker has."""
    return uuid4().hex


def check_worker(name: str) -> str:
    """The name itself if a worker may be called so.

    Raises:
        KeyNameError: it may not stand in a key, or it is ``alive``, where the tokens are.
    """
    if name == _ALIVE:
        raise KeyNameError(
            f"worker {name!r} is no valid name: the workers' tokens stand there; use another one"
        )
    return check_name("worker", name)


def worker_alive_key(worker: str) -> str:
    """Key of a worker's liveliness token.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{WORKER_ROOT}/{_ALIVE}/{check_worker(worker)}"


def parse_worker_alive_key(key: str) -> str:
    """The worker whose token stands under a key.

    Raises:
        KeyNameError: a key that is not ``wingwatch/workers/v1/alive/<worker>``.
    """
    root, _, worker = key[:256].rpartition("/")
    if root != f"{WORKER_ROOT}/{_ALIVE}":
        raise KeyNameError(f"{key[:80]!r} is no key of the form {WORKER_ROOT}/{_ALIVE}/<worker>")
    return check_worker(worker)


def worker_key(worker: str, question: str) -> str:
    """Key under which a worker answers a question; ``*`` for all of them.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{WORKER_ROOT}/{check_worker(worker)}/{question}"
