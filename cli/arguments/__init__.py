"""What may be written after `wingwatch`."""

import argparse

from wingwatch.cli.arguments.aircraft import add_aircraft
from wingwatch.cli.arguments.baseline import add_baseline
from wingwatch.cli.arguments.common import CommandParser
from wingwatch.cli.arguments.flights import (
    add_condition,
    add_diagnose,
    add_estimate,
    add_log,
    add_monitor,
    add_publish,
    add_replay,
    add_report,
)
from wingwatch.cli.arguments.links import add_bridge
from wingwatch.cli.arguments.serving import (
    add_access,
    add_gateway,
    add_kernels,
    add_notify,
    add_serve,
    add_store,
    add_token,
    add_worker,
)
from wingwatch.cli.arguments.simulated import add_demo, add_design_input, add_simulate, add_study, add_thesis

__all__ = ["build_parser"]

_COMMANDS = (
    add_demo, add_serve, add_worker, add_gateway, add_publish, add_bridge, add_replay, add_simulate, add_log,
    add_estimate, add_monitor, add_condition, add_diagnose, add_report, add_design_input, add_study, add_aircraft,
    add_baseline, add_token, add_access, add_store, add_notify, add_kernels, add_thesis,
)  # fmt: skip
"""In the order of the help."""

_EXAMPLES = """\
examples:
  wingwatch demo
  wingwatch simulate --aircraft aerosonde --effect icing:0.15@60+30 --seconds 150 --out flight.csv
  wingwatch log flight.ulg --write-map map.toml
  wingwatch estimate flight.csv --aircraft aerosonde --history estimates.csv
  wingwatch estimate first.csv --aircraft aerosonde --validate second.csv --save identified.toml
  wingwatch monitor flight.mat --aircraft ultrastick25e --map thor75.toml --json
  wingwatch monitor logs/ --aircraft aerosonde --jobs 4
  wingwatch condition flight.csv --aircraft aerosonde --out corrected.parquet
  wingwatch diagnose flight.csv --aircraft aerosonde --report report.html
  wingwatch report flight.ulg --aircraft my_aircraft.toml --out report.html
  wingwatch design-input --aircraft aerosonde --mode short_period --kind multisine --plot input.png
  wingwatch aircraft new kite --span-m 2.1 --mass-kg 3.4 --area-m2 0.55 --airspeed 18 --out kite.toml
  wingwatch aircraft check my_aircraft.toml
  wingwatch baseline show data/wingwatch.db --aircraft aerosonde
  wingwatch serve --data data --aircraft my_aircraft.toml
  wingwatch serve --workers 4
  wingwatch publish flight.parquet --vehicle uav1 --aircraft aerosonde --rate max
  wingwatch bridge mavlink --connect udp:127.0.0.1:14550 --vehicle uav1 --aircraft my_aircraft.toml
  wingwatch serve --record recordings
  wingwatch replay recordings
  wingwatch token create lead --scope operate
  wingwatch access uav1 uav2 --out access.json5
  wingwatch store backup data/wingwatch.db --out copy.db
  wingwatch notify test --config service.toml
  wingwatch kernels
  wingwatch thesis --table 7.3

A flight is a CSV, Parquet or MATLAB file, or an autopilot's log (PX4's .ulg, ArduPilot's .bin and .log, .tlog).
A channel map (TOML) names its columns where they are not called as
the flight table has them. `wingwatch COMMAND --help` says more about each command.
"""


def build_parser(version: str) -> argparse.ArgumentParser:
    """The parser of the whole command line; the chosen command is ``command``."""
    parser = CommandParser(
        prog="wingwatch",
        description="Watches an aircraft's health through its stability and control derivatives.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"wingwatch {version}")
    commands = parser.add_subparsers(
        dest="command", metavar="COMMAND", required=True, parser_class=CommandParser
    )
    for add in _COMMANDS:
        add(commands)
    return parser
