"""`wingwatch demo`: the service and a simulated fleet in one process, on loopback only."""

import argparse
import threading
from contextlib import ExitStack
from functools import partial

from rich.console import Console
from rich.live import Live

from wingwatch.cli.ending import asked_to_end, leave
from wingwatch.cli.fleet_display import FleetLines, fleet_table
from wingwatch.cli.serve_command import await_ready, write_address
from wingwatch.cli.simulated_fleet import SimulatedFleet
from wingwatch.operations.faults import CommandError, say
from wingwatch.service.kernel_steps import AFTER_DEMO, DEMO
from wingwatch.service.kernels import KernelCompiler
from wingwatch.service.logs import configure_logs
from wingwatch.service.service import Service, running_service
from wingwatch.service.settings import ServeSettings
from wingwatch.simulation import demo_fleet

__all__ = ["run"]

_SHOW_S = 0.5
_DATABASE = "demo.db"


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    configure_logs("text")
    settings = ServeSettings(
        port=arguments.port,
        listen=(arguments.listen,),
        data=arguments.data,
        database=str(arguments.data / _DATABASE),
        diagnose_alerts=arguments.diagnose_alerts,
    )
    with asked_to_end() as end:
        kernels = KernelCompiler(DEMO, AFTER_DEMO)
        with ExitStack() as stack:
            service = stack.enter_context(running_service(settings, preparation=kernels, fresh=True))
            write_address(service, arguments.json)
            # It flies while the service still compiles: nothing that it sends meanwhile is lost.
            simulated = partial(kernels.wait_for, "simulation")
            fleet = SimulatedFleet(demo_fleet(), service.endpoints[0], await_kernels=simulated)
            stack.enter_context(fleet)
            if await_ready(service, end):
                _watch(service, fleet, end, quiet=arguments.json)
            say("ending")
        return leave(0, service.ingest.loop.alive or fleet.alive)


def _watch(service: Service, fleet: SimulatedFleet, end: threading.Event, quiet: bool) -> None:
    """Show the fleet until the end is asked for."""
    console = Console(stderr=quiet)
    if console.is_terminal:
        title = f"wingwatch demo   {service.url}   Ctrl-C ends it"
        with Live(fleet_table(service.monitor, title), console=console, auto_refresh=False) as live:
            while not _over(fleet, end):
                live.update(fleet_table(service.monitor, title), refresh=True)
        return
    lines = FleetLines()
    while not _over(fleet, end):
        for line in lines.changes(service.monitor):
            if not quiet:
                print(line, flush=True)


def _over(fleet: SimulatedFleet, end: threading.Event) -> bool:
    """Wait a moment; whether the end was asked for."""
    if fleet.problem is not None:
        raise CommandError(f"the simulated fleet ended: {fleet.problem}")
    return end.wait(_SHOW_S)
