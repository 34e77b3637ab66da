"""`wingwatch worker`: watches vehicles for gateways, until Ctrl-C or SIGTERM."""

import argparse
import logging
import os
from collections.abc import Callable

from wingwatch.cli.ending import asked_to_end, leave_at_once
from wingwatch.cli.serve_command import allow_open_files, await_ready
from wingwatch.operations.faults import say
from wingwatch.operations.progress import write_json
from wingwatch.service.logs import configure_logs
from wingwatch.service.settings import serve_settings
from wingwatch.service.workers.worker import running_worker

__all__ = ["run"]

_LOG = logging.getLogger(__name__)


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    settings = serve_settings(arguments, os.environ)
    configure_logs(settings.log_format)
    allow_open_files()
    tell: Callable[[str], object] = say if settings.log_format == "text" else _LOG.info
    with asked_to_end() as end, running_worker(settings) as worker:
        if arguments.json:
            write_json({"worker": worker.name, "zenoh": list(worker.endpoints)})
        else:
            print(f"worker {worker.name}   Zenoh {' '.join(worker.endpoints)}", flush=True)
        if await_ready(worker, end, tell):
            tell("ready")
        end.wait()
        tell("ending")
    leave_at_once(0)
