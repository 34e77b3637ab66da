"""`wingwatch serve`: the service, until Ctrl-C or SIGTERM."""

import argparse
import logging
import os
import resource
import threading
import time
from collections.abc import Callable

from rich.console import Console

from wingwatch.cli.ending import asked_to_end, leave
from wingwatch.operations.faults import say
from wingwatch.operations.progress import write_json
from wingwatch.service.logs import configure_logs
from wingwatch.service.refusals import noticed_refusals
from wingwatch.service.service import Service, running_service
from wingwatch.service.settings import serve_settings

__all__ = ["allow_open_files", "await_ready", "run", "write_address"]

_LOG = logging.getLogger(__name__)
_MOST_FILES = 65_536
_LOOK_S = 0.2
_SAY_S = 10.0


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    settings = serve_settings(arguments, os.environ)
    configure_logs(settings.log_format)
    allow_open_files()
    tell: Callable[[str], object] = say if settings.log_format == "text" else _LOG.info
    with asked_to_end() as end:
        with (
            noticed_refusals(settings.zenoh.access is not None) as refusals,
            running_service(settings, refusals=refusals) as service,
        ):
            write_address(service, arguments.json)
            if await_ready(service, end, tell):
                tell("ready")
            end.wait()
            tell("ending")
        return leave(0, service.ingest.loop.alive)


def allow_open_files() -> None:
    """As many as the system lets this process have: each vehicle's link and each listener takes one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, _MOST_FILES)
    if soft != resource.RLIM_INFINITY and soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def write_address(service: Service, as_json: bool) -> None:
    """Say where the service is found, as soon as it is."""
    if as_json:
        write_json({"url": service.url, "zenoh": list(service.endpoints)})
    else:
        print(f"status page {service.url}   Zenoh {' '.join(service.endpoints)}", flush=True)


def await_ready(service: Service, end: threading.Event, tell: Callable[[str], object] = say) -> bool:
    """Wait until samples are taken in, or the end is asked for, or it turns out that neither will come."""
    console = Console(stderr=True)
    if console.is_terminal and tell is say:
        with console.status("starting") as status:
            return _await(service, end, status.update)
    last_said_s = time.monotonic()

    def say_at_times(text: str) -> None:
        nonlocal last_said_s
        if time.monotonic() - last_said_s >= _SAY_S:
            last_said_s = time.monotonic()
            tell(text)

    return _await(service, end, say_at_times)


def _await(service: Service, end: threading.Event, tell: Callable[[str], object]) -> bool:
    while not end.is_set() and service.ingest.loop.alive:
        if service.ingest.wait(_LOOK_S):
            return True
        tell(service.ingest.problem or "")
    return False
