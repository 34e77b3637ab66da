"""`wingwatch serve`: the service, until Ctrl-C or SIGTERM; with several workers a gateway and a process for each."""

import argparse
import logging
import os
import resource
import threading
import time
from collections.abc import Callable, Mapping
from typing import NoReturn, Protocol

from rich.console import Console

from wingwatch.cli.ending import asked_to_end, leave, leave_at_once
from wingwatch.operations.faults import say
from wingwatch.operations.progress import write_json
from wingwatch.service.logs import configure_logs
from wingwatch.service.refusals import noticed_refusals
from wingwatch.service.service import running_service
from wingwatch.service.settings import ServeSettings, serve_settings

__all__ = ["allow_open_files", "await_ready", "begun", "run", "write_address"]

_LOG = logging.getLogger(__name__)
_MOST_FILES = 65_536
_LOOK_S = 0.2
_SAY_S = 10.0


class Running(Protocol):
    """A service or a gateway."""

    @property
    def url(self) -> str:
        """Of the status page."""
        ...

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Of Zenoh."""
        ...

    @property
    def waits_for(self) -> str | None:
        """Why no samples are taken in yet; None once they are."""
        ...

    @property
    def starting(self) -> bool:
        """Whether samples will be taken in, as far as can be said."""
        ...

    def wait(self, timeout_s: float) -> bool:
        """Wait until samples are taken in; whether they are."""
        ...


def begun(arguments: argparse.Namespace) -> tuple[ServeSettings, Callable[[str], object]]:
    """The settings of a process that serves, its logs and open files as they say, and what tells an operator.

    Raises:
        CommandError: a setting cannot be used; one sentence.
    """
    settings = serve_settings(arguments, os.environ)
    configure_logs(settings.log_format)
    allow_open_files()
    return settings, say if settings.log_format == "text" else _LOG.info


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    settings, tell = begun(arguments)
    with asked_to_end() as end, noticed_refusals(settings.zenoh.access is not None) as refusals:
        if settings.worker_count > 1:
            _gateway_and_workers(settings, refusals, end, arguments.json, tell)
        with running_service(settings, refusals=refusals) as service:
            _until_the_end(service, end, arguments.json, tell)
        return leave(0, service.ingest.loop.alive)


def _gateway_and_workers(
    settings: ServeSettings,
    refusals: Mapping[str, int],
    end: threading.Event,
    as_json: bool,
    tell: Callable[[str], object],
) -> NoReturn:
    from wingwatch.service.workers.gateway import running_gateway  # what a service alone does not load

    with running_gateway(settings, workers=settings.worker_count, refusals=refusals) as gateway:
        _until_the_end(gateway, end, as_json, tell)
    leave_at_once(0)


def _until_the_end(
    running: Running, end: threading.Event, as_json: bool, tell: Callable[[str], object]
) -> None:
    write_address(running, as_json)
    if await_ready(running, end, tell):
        tell("ready")
    end.wait()
    tell("ending")


def allow_open_files() -> None:
    """As many as the system lets this process have: each vehicle's link and each listener takes one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, _MOST_FILES)
    if soft != resource.RLIM_INFINITY and soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def write_address(service: Running, as_json: bool) -> None:
    """Say where the service is found, as soon as it is."""
    if as_json:
        write_json({"url": service.url, "zenoh": list(service.endpoints)})
    else:
        print(f"status page {service.url}   Zenoh {' '.join(service.endpoints)}", flush=True)


def await_ready(service: Running, end: threading.Event, tell: Callable[[str], object] = say) -> bool:
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


def _await(service: Running, end: threading.Event, tell: Callable[[str], object]) -> bool:
    while not end.is_set() and service.starting:
        if service.wait(_LOOK_S):
            return True
        tell(service.waits_for or "")
    return False
