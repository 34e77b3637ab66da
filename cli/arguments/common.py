"""What the commands' arguments have in common."""

import argparse
import sys
from pathlib import Path
from typing import NoReturn, TypeAlias

from wingwatch.cli.arguments.values import forgetting, job_count

__all__ = [
    "CommandParser",
    "Commands",
    "add_accept_implausible",
    "add_aircraft_and_map",
    "add_command",
    "add_commands",
    "add_convention",
    "add_flight",
    "add_forgetting",
    "add_jobs",
    "add_link_security",
]

_CONVENTIONS = ("concise", "dimensional", "british", "american")


class CommandParser(argparse.ArgumentParser):
    """Errors in one sentence, without the usage lines."""

    def error(self, message: str) -> NoReturn:
        """Exit code 2."""
        print(f"{self.prog}: error: {message}; see {self.prog} --help", file=sys.stderr)
        raise SystemExit(2)


Commands: TypeAlias = "argparse._SubParsersAction[CommandParser]"


def add_command(commands: Commands, name: str, does: str, example: str) -> argparse.ArgumentParser:
    """A command that says what it does, with an example, and can answer in JSON."""
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


def add_commands(commands: Commands, name: str, does: str, examples: str, dest: str) -> Commands:
    """A command that is a group of commands; which of them was chosen is ``dest``."""
    parser = commands.add_parser(
        name,
        help=does,
        description=f"{does[0].upper()}{does[1:]}.",
        epilog=f"examples:\n  {examples}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    return parser.add_subparsers(dest=dest, metavar=dest.upper(), required=True, parser_class=CommandParser)


def add_flight(parser: argparse.ArgumentParser) -> None:
    """A flight file, the aircraft that flew it, and its channel map."""
    parser.add_argument(
        "flight", metavar="FLIGHT", type=Path, help="CSV, Parquet or MATLAB file, or an autopilot's log"
    )
    add_aircraft_and_map(parser)


def add_aircraft_and_map(parser: argparse.ArgumentParser) -> None:
    """The aircraft, and what names the columns of its flights."""
    parser.add_argument(
        "--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file"
    )
    parser.add_argument("--map", type=Path, metavar="MAP", help="channel map (TOML)")


def add_accept_implausible(parser: argparse.ArgumentParser) -> None:
    """Going on with a flight whose channels contradict each other."""
    parser.add_argument(
        "--accept-implausible",
        action="store_true",
        help="go on although channels contradict each other (units, signs, gravity, repeated readings): "
        "the refusals become warnings",
    )


def add_jobs(parser: argparse.ArgumentParser) -> None:
    """In how many processes many flights are judged."""
    parser.add_argument(
        "--jobs",
        type=job_count,
        metavar="N",
        help="flights at a time, of a folder (default: as many as there are processors)",
    )


def add_convention(parser: argparse.ArgumentParser) -> None:
    """What derivatives are given in."""
    parser.add_argument(
        "--convention",
        choices=_CONVENTIONS,
        default="concise",
        help="what derivatives, their standard errors and expectations are given in; the others than concise need "
        "[geometry] and [mass] of the aircraft file (default: %(default)s)",
    )


def add_forgetting(parser: argparse.ArgumentParser) -> None:
    """How fast the estimators that run live forget."""
    parser.add_argument(
        "--forgetting",
        type=forgetting,
        metavar="TIME",
        help="time constant with which fourier and ekf forget: 40s, none, or a factor a sample: 0.998 (20 s) and "
        "0.9998 (200 s) at 25 Hz as in thesis 9.2, 0.999@50 at another rate (default: 40s)",
    )


def add_link_security(parser: argparse.ArgumentParser) -> None:
    """What protects the Zenoh link of a vehicle."""
    parser.add_argument(
        "--authority",
        type=Path,
        metavar="FILE",
        help="for tls/ endpoints: whose certificates are trusted (PEM)",
    )
    parser.add_argument("--certificate", type=Path, metavar="FILE", help="the vehicle's own (PEM)")
    parser.add_argument("--private-key", type=Path, metavar="FILE", help="of the certificate (PEM)")
    parser.add_argument(
        "--user", help="in place of a certificate; its password is read from WINGWATCH_ZENOH_PASSWORD"
    )
