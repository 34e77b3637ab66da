"""Commands of the service, of who may use it, and of its database as a whole."""

import argparse
from collections.abc import Callable
from pathlib import Path

from wingwatch.cli.arguments.common import Commands, add_command, add_commands
from wingwatch.cli.arguments.values import positive, row_count, worker_count

__all__ = [
    "add_access",
    "add_gateway",
    "add_kernels",
    "add_notify",
    "add_serve",
    "add_store",
    "add_token",
    "add_worker",
]

_TOKEN_EXAMPLES = """\
wingwatch token create lead --scope operate
  wingwatch token list
  wingwatch token revoke lead"""

_TOKEN_ACTIONS = {
    "create": "make a token and show it, once",
    "list": "names and scopes of all tokens",
    "revoke": "withdraw a token; a running service refuses it from now on",
}

_STORE_EXAMPLES = """\
wingwatch store backup data/wingwatch.db --out copy.db
  wingwatch store check data/wingwatch.db
  wingwatch store prune data/wingwatch.db --keep-days 30"""

_STORE_ACTIONS = {
    "backup": "copy an SQLite database, also while a service writes to it, and check the copy",
    "check": "read the whole database and say whether it is sound",
    "prune": "thin and drop old history of derivatives at once; alerts, references and expectations stay",
}


def add_serve(commands: Commands) -> None:
    """``wingwatch serve``."""
    parser = add_command(
        commands,
        "serve",
        "the service: Zenoh in, monitor, REST and status page out",
        "wingwatch serve --data data --listen tcp/127.0.0.1:7447",
    )
    _add_config(parser)
    parser.add_argument(
        "--workers",
        type=worker_count,
        nargs="?",
        const=0,
        metavar="N",
        help="watch in N processes, started again where they die (default: 1, this one; without N: one less than "
        "the processors)",
    )
    _add_http(parser)
    _add_links(parser)
    _add_data(parser)
    _add_watching(parser)
    _add_shown(parser)
    _add_log_format(parser)


def add_worker(commands: Commands) -> None:
    """``wingwatch worker``."""
    parser = add_command(
        commands,
        "worker",
        "watches vehicles beside other workers, for a gateway: Zenoh in and out, no port",
        "wingwatch worker --connect tcp/router.example:7447 --config fleet.toml",
    )
    _add_config(parser)
    parser.add_argument(
        "--worker-name",
        metavar="NAME",
        help="begin of this worker's name, to which each start adds some digits (default: a new one)",
    )
    parser.add_argument(
        "--capacity",
        type=positive,
        metavar="X",
        help="what it takes beside others: twice as many vehicles as one with half (default: 1)",
    )
    parser.add_argument(
        "--ready-file",
        type=Path,
        metavar="FILE",
        help="that is there while samples are taken in and the end is not asked for, for whoever starts workers",
    )
    _add_links(parser)
    _add_data(parser)
    _add_watching(parser)
    _add_log_format(parser)


def add_gateway(commands: Commands) -> None:
    """``wingwatch gateway``."""
    parser = add_command(
        commands,
        "gateway",
        "REST, status page and events for vehicles that workers watch; several may run",
        "wingwatch gateway --connect tcp/router.example:7447 --config fleet.toml",
    )
    _add_config(parser)
    _add_http(parser)
    _add_links(parser)
    _add_data(parser)
    _add_shown(parser)
    _add_log_format(parser)


def _add_config(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="settings (TOML); flags here override them"
    )


def _add_http(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--host", help="HTTP address (default: 127.0.0.1); one that others can reach takes tokens"
    )
    parser.add_argument("--port", type=int, help="HTTP port (default: 8000)")
    parser.add_argument(
        "--name",
        action="append",
        metavar="HOST",
        help="host name under which others reach HTTP, beside addresses and localhost; may be repeated",
    )
    parser.add_argument(
        "--certificate", type=Path, metavar="FILE", help="serve HTTPS with this certificate (PEM)"
    )
    parser.add_argument("--private-key", type=Path, metavar="FILE", help="of the certificate (PEM)")
    parser.add_argument(
        "--require-token",
        action="store_true",
        default=None,
        help="ask for tokens on loopback too, as behind a proxy",
    )


def _add_links(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--listen",
        action="append",
        metavar="ENDPOINT",
        help="Zenoh endpoint to listen on; may be repeated (default: tcp/127.0.0.1:7447, or none with --connect)",
    )
    parser.add_argument(
        "--connect", action="append", metavar="ENDPOINT", help="Zenoh router to connect to; may be repeated"
    )


def _add_data(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--data", type=Path, metavar="DIR", help="folder of the database and the tokens (default: data)"
    )
    parser.add_argument(
        "--aircraft",
        action="append",
        type=Path,
        metavar="FILE",
        help="aircraft file beside the library; may be repeated",
    )


def _add_watching(parser: argparse.ArgumentParser) -> None:
    """How vehicles are watched."""
    parser.add_argument(
        "--excite",
        action="store_true",
        default=None,
        help="propose inputs of surfaces that would help to see more, to people and over Zenoh; never flown",
    )
    parser.add_argument(
        "--no-diagnose-alerts",
        dest="diagnose_alerts",
        action="store_false",
        default=None,
        help="do not look into alerts by simulation, in a process of its own at low priority",
    )
    parser.add_argument(
        "--record",
        type=Path,
        metavar="DIR",
        help="record what vehicles send and what is said of them into MCAP files in DIR, for wingwatch replay",
    )


def _add_shown(parser: argparse.ArgumentParser) -> None:
    """What is shown beside the fleet."""
    parser.add_argument(
        "--documents",
        type=Path,
        metavar="DIR",
        help="serve the documents that make docs has built in DIR at /help (default: dist/site of a checkout)",
    )
    parser.add_argument(
        "--studies",
        type=Path,
        metavar="DIR",
        help="show the reports of finished studies in DIR (wingwatch study ... --report) on the status page",
    )


def _add_log_format(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--log-format", choices=("text", "json"), help="of the log on standard error (default: text)"
    )


def add_kernels(commands: Commands) -> None:
    """``wingwatch kernels``."""
    does = "compile the numerical kernels in advance, which a machine needs once"
    add_command(commands, "kernels", does, "wingwatch kernels")


def add_token(commands: Commands) -> None:
    """``wingwatch token``."""
    does = "tokens for REST and the status page, asked for by a service that others can reach"
    actions = add_commands(commands, "token", does, _TOKEN_EXAMPLES, "action")
    for action, what in _TOKEN_ACTIONS.items():
        name = "" if action == "list" else " lead"
        add = add_command(actions, action, what, f"wingwatch token {action}{name}").add_argument
        if action != "list":
            add("name", metavar="NAME", help="of the token: 1 to 63 of a-z, 0-9, '_' and '-'")
        if action == "create":
            add(
                "--scope",
                choices=("read", "operate"),
                default="read",
                help="what it permits; operate: reading, and acting on alerts and diagnoses (default: %(default)s)",
            )
        add(
            "--data",
            type=Path,
            default=Path("data"),
            metavar="DIR",
            help="the service's data folder (default: %(default)s)",
        )


def add_access(commands: Commands) -> None:
    """``wingwatch access``."""
    parser = add_command(
        commands,
        "access",
        "Zenoh's access rules: a vehicle writes its own keys, the service alone derivatives, status and alerts",
        "wingwatch access uav1 uav2 north.uav1 --reader tower --out access.json5",
    )
    add = parser.add_argument
    add("vehicles", metavar="VEHICLE", nargs="+", help="name, or FLEET.NAME where its fleet is not default")
    add(
        "--reader",
        action="append",
        default=[],
        metavar="NAME",
        help="who may subscribe and ask, and writes nothing; may be repeated",
    )
    for who, what in (
        ("worker", "who watches vehicles beside others, under this name or NAME-ANYTHING"),
        ("gateway", "who asks workers, and writes nothing"),
    ):
        add(f"--{who}", action="append", default=[], metavar="NAME", help=f"{what}; may be repeated")
    add("--service", default="service", metavar="NAME", help="who the service is (default: %(default)s)")
    add(
        "--by",
        choices=("certificate", "user"),
        default="certificate",
        help="what these are: common names of certificates or users (default: %(default)s)",
    )
    add("--out", type=Path, metavar="FILE", help="write the rules to FILE (default: standard output)")


def add_store(commands: Commands) -> None:
    """``wingwatch store``."""
    does = "the database of a service: copy it, check it, thin its history"
    actions = add_commands(commands, "store", does, _STORE_EXAMPLES, "action")
    for action, what in _STORE_ACTIONS.items():
        example = next(line.strip() for line in _STORE_EXAMPLES.splitlines() if f" {action} " in line)
        add = add_command(actions, action, what, example).add_argument
        add("database", metavar="DB", help="path of an SQLite file, or URL of a PostgreSQL database")
        if action == "backup":
            add("--out", type=Path, required=True, metavar="FILE", help="the copy; it must not exist yet")
        if action == "prune":
            _add_retention(add)


def add_notify(commands: Commands) -> None:
    """``wingwatch notify``."""
    example = "wingwatch notify test --config service.toml"
    does = "the channels on which a service says alerts to people: try them"
    actions = add_commands(commands, "notify", does, f"{example} --channel webhook1", "action")
    add = add_command(
        actions, "test", "send a notice, marked as a test, through each channel", example
    ).add_argument
    add(
        "--config",
        type=Path,
        required=True,
        metavar="FILE",
        help="settings of the service (TOML), with [notify]",
    )
    add("--channel", metavar="N", help="only this one, by its name or number from 1 (default: all)")


def _add_retention(add: Callable[..., object]) -> None:
    options = (
        ("--full-rate-hours", 24.0, "how long history is kept as it came"),
        ("--interval-s", 10.0, "of what is older, one instant of each so many seconds stays"),
        ("--keep-days", 90.0, "flights that ended longer ago go"),
    )
    for name, default, what in options:
        add(name, type=positive, default=default, metavar="X", help=f"{what} (default: %(default)g)")
    add(
        "--most-rows",
        type=row_count,
        default=20_000_000,
        metavar="N",
        help="where there are more estimates, the flights that ended first go (default: %(default)s)",
    )
