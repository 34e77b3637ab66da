"""`wingwatch gateway`: REST, page and events for vehicles that workers watch, until Ctrl-C or SIGTERM."""

import argparse

from wingwatch.cli.ending import asked_to_end, leave_at_once
from wingwatch.cli.serve_command import begun, write_address
from wingwatch.service.refusals import noticed_refusals
from wingwatch.service.workers.gateway import running_gateway

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    settings, tell = begun(arguments)
    with (
        asked_to_end() as end,
        noticed_refusals(settings.zenoh.access is not None) as refusals,
        running_gateway(settings, refusals=refusals) as gateway,
    ):
        write_address(gateway, arguments.json)
        end.wait()
        tell("ending")
    leave_at_once(0)
