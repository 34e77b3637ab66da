"""Commands that join wingwatch with other systems' links."""

import argparse

from wingwatch.cli.arguments.common import Commands, add_command, add_commands, add_link_security
from wingwatch.cli.arguments.values import job_count, positive

__all__ = ["add_bridge"]


def add_bridge(commands: Commands) -> None:
    """``wingwatch bridge``."""
    example = (
        "wingwatch bridge mavlink --connect udp:127.0.0.1:14550 --vehicle uav1 --aircraft my_aircraft.toml"
    )
    links = add_commands(
        commands, "bridge", "publish vehicles that speak another protocol, live", example, dest="link"
    )
    parser = add_command(
        links,
        "mavlink",
        "publish vehicles of a MAVLink stream into Zenoh until it is interrupted",
        example,
    )
    _add_link(parser)
    parser.add_argument(
        "--vehicle",
        action="append",
        required=True,
        metavar="NAME|SYSTEM=NAME",
        help="name of the vehicle: of the first one that sends, or of a MAVLink system; may be given several times",
    )
    parser.add_argument(
        "--aircraft",
        action="append",
        required=True,
        metavar="A|NAME=A",
        help="name in the library, or path of an aircraft file: of all vehicles, or of one",
    )
    parser.add_argument("--fleet", default="default", help="name of the fleet (default: %(default)s)")
    parser.add_argument(
        "--router",
        default="tcp/127.0.0.1:7447",
        metavar="ENDPOINT",
        help="Zenoh endpoint of the service or router (default: %(default)s)",
    )
    add_link_security(parser)


def _add_link(parser: argparse.ArgumentParser) -> None:
    """The MAVLink side."""
    parser.add_argument(
        "--connect",
        required=True,
        metavar="LINK",
        help="udp:HOST:PORT or udpin: (listen), udpout:, tcp:, tcpin:, or a serial device",
    )
    parser.add_argument(
        "--baud", type=job_count, default=57_600, help="rate of a serial device (default: %(default)s)"
    )
    parser.add_argument(
        "--listen-only",
        action="store_true",
        help="send nothing: no heartbeat, no time, no question for parameters",
    )
    parser.add_argument(
        "--request-rates",
        type=positive,
        metavar="HZ",
        help="ask vehicles for their messages this often (default: leave the rates alone)",
    )
