"""`wingwatch gateway`: REST, page and events for vehicles that workers watch, until Ctrl-C or SIGTERM."""

import argparse
import logging
import os
from collections.abc import Callable

from wingwatch.cli.ending import asked_to_end, leave_at_once
from wingwatch.cli.serve_command import allow_open_files, write_address
from wingwatch.operations.faults import say
from wingwatch.service.logs import configure_logs
from wingwatch.service.refusals import noticed_refusals
from wingwatch.service.settings import serve_settings
from wingwatch.service.workers.gateway import running_gateway

__all__ = ["run"]

_LOG = logging.getLogger(__name__)


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    settings = serve_settings(arguments, os.environ)
    configure_logs(settings.log_format)
    allow_open_files()
    tell: Callable[[str], object] = say if settings.log_format == "text" else _LOG.info
    with (
        asked_to_end() as end,
        noticed_refusals(settings.zenoh.access is not None) as refusals,
        running_gateway(settings, refusals=refusals) as gateway,
    ):
        write_address(gateway, arguments.json)
        end.wait()
        tell("ending")
    leave_at_once(0)
