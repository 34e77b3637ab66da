"""What may be written after `wingwatch`."""

import argparse
import math
import sys
from pathlib import Path
from typing import NoReturn

__all__ = ["build_parser"]

DEMO_DATA = Path("data") / "demo"

_EXAMPLES = """\
examples:
  wingwatch demo
  wingwatch estimate flight.csv --aircraft aerosonde --history estimates.csv
  wingwatch monitor flight.mat --aircraft ultrastick25e --map thor75.toml --json
  wingwatch serve --data data --aircraft my_aircraft.toml
  wingwatch publish flight.parquet --vehicle uav1 --aircraft aerosonde --rate max

A flight is a CSV, Parquet or MATLAB file. A channel map (TOML) names its columns where they are not called as
the flight table has them. `wingwatch COMMAND --help` says more about each command.
"""


class _Parser(argparse.ArgumentParser):
    """Errors in one sentence, without the usage lines."""

    def error(self, message: str) -> NoReturn:
        print(f"{self.prog}: error: {message}; see {self.prog} --help", file=sys.stderr)
        raise SystemExit(2)


def build_parser(version: str) -> argparse.ArgumentParser:
    """The parser of the whole command line; the chosen command is ``command``."""
    parser = _Parser(
        prog="wingwatch",
        description="Watches an aircraft's health through its stability and control derivatives.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"wingwatch {version}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=_Parser)
    _add_demo(commands)
    _add_serve(commands)
    _add_publish(commands)
    _add_estimate(commands)
    _add_monitor(commands)
    return parser


_Commands = argparse._SubParsersAction


def _command(commands: "_Commands[_Parser]", name: str, does: str, example: str) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        name,
        help=does,
        description=f"{does[0].upper()}{does[1:]}.",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--json", action="store_true", help="machine result on standard output, nothing else")
    return parser


def _add_flight(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("flight", metavar="FLIGHT", type=Path, help="CSV, Parquet or MATLAB file")
    parser.add_argument(
        "--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file"
    )
    parser.add_argument("--map", type=Path, metavar="MAP", help="channel map (TOML)")


def _add_estimate(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "estimate",
        "derivatives of a recorded flight, with standard errors, by the code that runs live",
        "wingwatch estimate flight.mat --aircraft ultrastick25e --map thor75.toml --json",
    )
    _add_flight(parser)
    parser.add_argument("--estimator", choices=("fourier", "ekf"), help="only this one (default: both)")
    parser.add_argument(
        "--history", type=Path, metavar="OUT", help="write every estimate over time to OUT (.csv or .parquet)"
    )


def _add_monitor(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "monitor",
        "status and alerts of a recorded flight, by the code that runs live",
        "wingwatch monitor flight.mat --aircraft ultrastick25e --map thor75.toml",
    )
    _add_flight(parser)
    parser.add_argument(
        "--baseline",
        metavar="DB",
        help="database of a service (file or URL) with what earlier flights taught; never changed "
        "(default: what the aircraft file says)",
    )
    parser.add_argument(
        "--fleet", default="default", help="whose earlier flights in DB (default: %(default)s)"
    )
    parser.add_argument(
        "--vehicle", default="offline", help="whose earlier flights in DB (default: %(default)s)"
    )


def _add_publish(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "publish",
        "stream a flight into Zenoh as a vehicle does; returns when all of it has been handed over",
        "wingwatch publish flight.csv --vehicle uav1 --aircraft aerosonde --rate max",
    )
    _add_flight(parser)
    parser.add_argument("--vehicle", required=True, metavar="ID", help="name of the vehicle")
    parser.add_argument("--fleet", default="default", help="name of the fleet (default: %(default)s)")
    parser.add_argument(
        "--connect",
        default="tcp/127.0.0.1:7447",
        metavar="ENDPOINT",
        help="Zenoh endpoint of the service or router (default: %(default)s)",
    )
    parser.add_argument(
        "--rate",
        type=_rate,
        default=1.0,
        metavar="1.0|max",
        help="speed relative to the time stamps, or max: as fast as it is taken, nothing lost (default: 1.0)",
    )


def _add_serve(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "serve",
        "the service: Zenoh in, monitor, REST and status page out",
        "wingwatch serve --data data --listen tcp/127.0.0.1:7447",
    )
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="settings (TOML); flags here override them"
    )
    parser.add_argument("--host", help="HTTP address (default: 127.0.0.1)")
    parser.add_argument("--port", type=int, help="HTTP port (default: 8000)")
    parser.add_argument(
        "--listen",
        action="append",
        metavar="ENDPOINT",
        help="Zenoh endpoint to listen on; may be repeated (default: tcp/127.0.0.1:7447, or none with --connect)",
    )
    parser.add_argument(
        "--connect", action="append", metavar="ENDPOINT", help="Zenoh router to connect to; may be repeated"
    )
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of the database (default: data)")
    parser.add_argument(
        "--aircraft",
        action="append",
        type=Path,
        metavar="FILE",
        help="aircraft file beside the library; may be repeated",
    )


def _add_demo(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "demo",
        "the service and a simulated fleet: one healthy, one taking on ice, one losing its elevator",
        "wingwatch demo --port 8010",
    )
    parser.add_argument("--port", type=int, default=8000, help="HTTP port (default: %(default)s)")
    parser.add_argument(
        "--listen",
        default="tcp/127.0.0.1:7447",
        metavar="ENDPOINT",
        help="Zenoh endpoint (default: %(default)s)",
    )
    parser.add_argument(
        "--data",
        type=Path,
        default=DEMO_DATA,
        metavar="DIR",
        help="folder of demo.db, which every demo starts anew (default: %(default)s)",
    )


def _rate(text: str) -> float | None:
    """A speed, None for ``max``."""
    if text == "max":
        return None
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not (math.isfinite(rate) and rate > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is no speed: give a number above 0, or max")
    return rate
