"""What may be written after `wingwatch`."""

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

__all__ = ["build_parser"]

DEMO_DATA = Path("data") / "demo"
_INPUT_KINDS = (
    "impulse", "step", "doublet", "3211", "3211-modified", "1123", "211", "sweep", "logarithmic-sweep", "multisine",
    "weighted-multisine",
)  # fmt: skip

_STRUCTURES = (
    "short_period", "short_period_alpha", "phugoid", "longitudinal", "longitudinal_throttle", "dutch_roll",
    "dutch_roll_beta", "roll", "spiral", "lateral", "lateral_full",
)  # fmt: skip

_CONVENTIONS = ("concise", "dimensional", "british", "american")

_EXAMPLES = """\
examples:
  wingwatch demo
  wingwatch simulate --aircraft aerosonde --effect icing:0.15@60+30 --seconds 150 --out flight.csv
  wingwatch estimate flight.csv --aircraft aerosonde --history estimates.csv
  wingwatch monitor flight.mat --aircraft ultrastick25e --map thor75.toml --json
  wingwatch condition flight.csv --aircraft aerosonde --out corrected.parquet
  wingwatch diagnose flight.csv --aircraft aerosonde --report report.html
  wingwatch design-input --aircraft aerosonde --mode short_period --kind multisine --plot input.png
  wingwatch baseline show data/wingwatch.db --aircraft aerosonde
  wingwatch serve --data data --aircraft my_aircraft.toml
  wingwatch publish flight.parquet --vehicle uav1 --aircraft aerosonde --rate max
  wingwatch token create lead --scope operate
  wingwatch access uav1 uav2 --out access.json5
  wingwatch store backup data/wingwatch.db --out copy.db

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
    _add_simulate(commands)
    _add_estimate(commands)
    _add_monitor(commands)
    _add_condition(commands)
    _add_diagnose(commands)
    _add_design_input(commands)
    _add_study(commands)
    _add_baseline(commands)
    _add_token(commands)
    _add_access(commands)
    _add_store(commands)
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
    _add_aircraft_and_map(parser)


def _add_aircraft_and_map(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file"
    )
    parser.add_argument("--map", type=Path, metavar="MAP", help="channel map (TOML)")


def _add_convention(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--convention",
        choices=_CONVENTIONS,
        default="concise",
        help="what derivatives, their standard errors and expectations are given in; the others than concise need "
        "[geometry] and [mass] of the aircraft file (default: %(default)s)",
    )


def _add_estimate(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "estimate",
        "derivatives of a recorded flight, or of several together, with standard errors",
        "wingwatch estimate flight.mat --aircraft ultrastick25e --map thor75.toml --json",
    )
    parser.add_argument(
        "flights",
        metavar="FLIGHT",
        type=Path,
        nargs="+",
        help="CSV, Parquet or MATLAB file; several are one after another, with common derivatives",
    )
    _add_aircraft_and_map(parser)
    _add_convention(parser)
    parser.add_argument(
        "--estimator",
        choices=(
            "fourier",
            "ekf",
            "equation-error",
            "frequency-equation-error",
            "output-error",
            "filter-error",
        ),
        help="only this one: fourier and ekf by the code that runs live, the others from the whole flight at once, "
        "with statistics of the fit (default: fourier and ekf)",
    )
    parser.add_argument(
        "--structure",
        action="append",
        choices=_STRUCTURES,
        default=[],
        metavar="NAME",
        help=f"of an estimator of the whole flight: {', '.join(_STRUCTURES)}; may be repeated "
        "(default: short_period, dutch_roll, lateral)",
    )
    parser.add_argument(
        "--form",
        choices=("accelerometer", "differentiated", "reconstructed"),
        help="force equations of an estimator of the whole flight: by accelerometers, the vanes differentiated, or "
        "velocities reconstructed without vanes (default: accelerometer)",
    )
    parser.add_argument(
        "--history",
        type=Path,
        metavar="OUT",
        help="write every estimate of fourier and ekf over time to OUT (.csv or .parquet)",
    )


def _add_monitor(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "monitor",
        "status and alerts of a recorded flight, by the code that runs live",
        "wingwatch monitor flight.mat --aircraft ultrastick25e --map thor75.toml",
    )
    _add_flight(parser)
    _add_convention(parser)
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


def _add_condition(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "condition",
        "what a recorded flight says of its sensors, air and trims: delays, biases, scale errors, turbulence",
        "wingwatch condition flight.csv --aircraft aerosonde --out corrected.parquet",
    )
    _add_flight(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FLIGHT",
        help="write the table without these errors (.csv or .parquet); delays that the aircraft file states stay in",
    )
    parser.add_argument(
        "--second-imu",
        type=Path,
        metavar="MAP",
        help="channel map of the same file whose specific forces are a second triad's: tells the centre of gravity",
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


_SIMULATE_EXAMPLES = """\
wingwatch simulate --aircraft aerosonde --out healthy.parquet
  wingwatch simulate --aircraft aerosonde --seconds 150 --effect icing:0.15@60+30 --out iced.csv --truth iced.json
  wingwatch simulate --aircraft ultrastick25e --seconds 600 --manoeuvre patrol --turbulence light --wind 5@270 \\
      --effect sensor_bias[pitch_rate_rad_s]:0.01@120 --effect thrust_loss:0.2@300 --seed 7 --out patrol.parquet"""


def _add_simulate(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "simulate",
        "a flight with known truth: manoeuvres, turbulence, wind, and effects that befall the aircraft",
        _SIMULATE_EXAMPLES,
    )
    add = parser.add_argument
    add("--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file")
    add("--out", required=True, type=Path, metavar="FLIGHT", help="flight table to write (.csv or .parquet)")
    add("--truth", type=Path, metavar="FILE", help="write the truth to FILE (JSON)")
    add("--seconds", type=float, default=60.0, help="length of the flight (default: %(default)g)")
    add("--rate", type=float, default=50.0, metavar="HZ", help="samples a second (default: %(default)g)")
    add("--airspeed", type=float, metavar="M_S", help="true airspeed (default: the aircraft's cruise)")
    add("--altitude", type=float, metavar="M", help="altitude (default: the aircraft's cruise)")
    add(
        "--manoeuvre",
        action="append",
        choices=("doublet", "3211", "multisine", "patrol", "none"),
        help="excitation of elevator, aileron and rudder over and over; patrol: a circuit with turns, climbs and "
        "speed changes in place of straight flight; may be repeated, as for doublets on a patrol (default: doublet)",
    )
    add("--turbulence", choices=("none", "light", "moderate", "severe"), default="none", help="MIL-F-8785C")
    add("--turbulence-model", choices=("dryden", "von-karman"), default="dryden", help="form of its spectra")
    add(
        "--wind",
        type=_wind,
        default=(0.0, 0.0),
        metavar="SPEED@FROM_DEG",
        help="steady wind in m/s and the direction it comes from, 5@270 from the west (default: none)",
    )
    add(
        "--effect",
        action="append",
        default=[],
        metavar="NAME[TARGET]:SIZE@START[+RAMP]",
        help="what befalls the aircraft, times in s; may be repeated (an unknown name is answered with all names)",
    )
    add("--seed", type=int, default=0, help="of turbulence and noise (default: %(default)s)")
    add("--noiseless", action="store_true", help="sensors without noise")


def _add_diagnose(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "diagnose",
        "what the simulation of an aircraft gets wrong against a recorded flight, why, and the model extended",
        "wingwatch diagnose flight.mat --aircraft ultrastick25e --map thor75.toml --report report.html",
    )
    _add_flight(parser)
    parser.add_argument(
        "--validate",
        type=Path,
        metavar="FLIGHT",
        help="another flight, on which the extended model is judged (default: windows of FLIGHT left out)",
    )
    parser.add_argument(
        "--report", type=Path, metavar="FILE.html", help="write the answer with pictures as one page"
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="OUT.toml",
        help="write the extended aircraft file; nothing where none is offered",
    )


_STUDY_EXAMPLES = """\
wingwatch study icing --out icing.parquet
  wingwatch study icing --out icing.parquet --resume
  wingwatch study damage --config own_aircraft.toml --flights 500 --out damage.parquet
  wingwatch study healthy --hours 300 --scheduler tcp://10.0.0.5:8786 --out healthy.parquet
  wingwatch study icing --show-config > grid.toml
  wingwatch study replay icing.parquet --seed 17 --out flight.parquet"""

_STUDIES = {
    "icing": "from which severity on ice is noticed: drawn flights with ice, simulated and watched, one row each",
    "damage": "what damage is noticed, how soon and under which name: drawn flights, one row each",
    "healthy": "how often an alert is false: flights without any fault and with faulty sensors, one row each",
}


def _add_study(commands: "_Commands[_Parser]") -> None:
    does = "how good the monitor's decisions are: thousands of simulated flights whose truth is known"
    parser = commands.add_parser(
        "study",
        help=does,
        description=f"{does[0].upper()}{does[1:]}.",
        epilog=f"examples:\n  {_STUDY_EXAMPLES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    studies = parser.add_subparsers(dest="study", metavar="STUDY", required=True, parser_class=_Parser)
    for kind, what in _STUDIES.items():
        _add_study_of(studies, kind, what)
    _add_study_replay(studies)
    _add_study_show(studies)


def _add_study_of(studies: "_Commands[_Parser]", kind: str, what: str) -> None:
    example = f"wingwatch study {kind} --out {kind}.parquet"
    add = _command(studies, kind, what, f"{example}\n  {example} --resume").add_argument
    add(
        "--out",
        type=Path,
        metavar="STUDY.parquet",
        help="table to write; what is unfinished stays in STUDY.parquet.parts",
    )
    add("--report", type=Path, metavar="FILE.html", help="write what the study says as one page")
    add("--config", type=Path, metavar="GRID.toml", help="what is drawn, in place of the default grid's keys")
    add(
        "--show-config",
        action="store_true",
        help="write the default grid to standard output, and fly nothing",
    )
    add("--flights", type=int, metavar="N", help="how many (default: the grid's)")
    add("--hours", type=float, metavar="H", help="as many flights as take H hours, in place of --flights")
    add(
        "--seed",
        type=int,
        default=0,
        help="of the first flight; the others follow one by one (default: %(default)s)",
    )
    add("--workers", type=int, metavar="N", help="processes of this machine (default: one a core)")
    add(
        "--scheduler",
        metavar="ADDRESS",
        help="have a Dask cluster fly, such as tcp://127.0.0.1:8786, in place of this machine",
    )
    add("--resume", action="store_true", help="go on with the unfinished study of the same settings")


def _add_study_replay(studies: "_Commands[_Parser]") -> None:
    parser = _command(
        studies,
        "replay",
        "one flight of a study, flown again: its plan, its row, and if wanted the flight itself",
        "wingwatch study replay icing.parquet --seed 17 --out flight.parquet",
    )
    add = parser.add_argument
    add(
        "table",
        type=Path,
        metavar="STUDY.parquet",
        help="the study, finished or not; it says what was drawn from",
    )
    add("--seed", type=int, required=True, help="of the flight")
    add("--out", type=Path, metavar="FLIGHT", help="flight table to write (.csv or .parquet)")


def _add_study_show(studies: "_Commands[_Parser]") -> None:
    parser = _command(
        studies,
        "show",
        "what finished studies say: from what severity on faults are noticed, how late, how often falsely",
        "wingwatch study show icing.parquet healthy.parquet --report studies.html",
    )
    parser.add_argument(
        "tables",
        metavar="STUDY.parquet",
        nargs="+",
        type=Path,
        help="finished studies, taken together: healthy flights say how often an alert is false",
    )
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write it as one page")


_BASELINE_ACTIONS = {
    "show": "what is expected of an aircraft now, and what a vehicle's flights have taught",
    "history": "every entry there ever was, what superseded it, and every kept version of what a vehicle taught",
    "import": "put the [[conditions]] of an aircraft file into the database; each supersedes the entry at its point",
}


def _add_baseline(commands: "_Commands[_Parser]") -> None:
    does = "the baseline database: what is expected of an aircraft, by whom, since when"
    example = "wingwatch baseline show data/wingwatch.db --aircraft aerosonde --vehicle uav1"
    parser = commands.add_parser(
        "baseline",
        help=does,
        description=f"{does[0].upper()}{does[1:]}.",
        epilog=f"examples:\n  {example}\n  wingwatch baseline import data/wingwatch.db --aircraft identified.toml",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True, parser_class=_Parser)
    for name, what in _BASELINE_ACTIONS.items():
        one = _command(actions, name, what, example.replace("show", name))
        one.add_argument("database", metavar="DB", help="database of a service (file or URL)")
        one.add_argument(
            "--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file"
        )
        if name == "import":
            continue
        _add_convention(one)
        one.add_argument("--configuration", default="clean", help="of the aircraft (default: %(default)s)")
        one.add_argument("--fleet", default="default", help="of the vehicle (default: %(default)s)")
        one.add_argument(
            "--vehicle", metavar="ID", help="whose flights' teaching to show (default: nobody's)"
        )


_DESIGN_EXAMPLES = """\
wingwatch design-input --aircraft aerosonde --mode short_period --kind doublet
  wingwatch design-input --aircraft aerosonde --mode short_period --mode lateral --kind multisine --out input.csv \\
      --plot input.png
  wingwatch design-input --aircraft aerosonde --mode dutch_roll --compare"""


def _add_design_input(commands: "_Commands[_Parser]") -> None:
    parser = _command(
        commands,
        "design-input",
        "an excitation for a mode, its spectrum, and the standard errors that it promises for this aircraft",
        _DESIGN_EXAMPLES,
    )
    add = parser.add_argument
    add("--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file")
    add(
        "--mode",
        action="append",
        required=True,
        choices=("short_period", "dutch_roll", "lateral"),
        help="what to excite; short_period may stand beside one of the others",
    )
    add("--kind", choices=_INPUT_KINDS, help="shape of the input")
    add("--compare", action="store_true", help="all kinds side by side, in place of one")
    _add_convention(parser)
    add("--amplitude", type=float, default=2.0, metavar="DEG", help="of every surface (default: %(default)g)")
    add("--airspeed", type=float, metavar="M_S", help="true airspeed (default: the aircraft's cruise)")
    add("--altitude", type=float, metavar="M", help="altitude (default: the aircraft's cruise)")
    add(
        "--length",
        type=float,
        metavar="S",
        help="of the record (default: a cycle of the band's lowest frequency)",
    )
    add("--rate", type=float, default=50.0, metavar="HZ", help="samples a second (default: %(default)g)")
    add("--out", type=Path, metavar="FILE.csv", help="write the deflections from trim over time")
    add(
        "--plot", type=Path, metavar="FILE.png", help="draw input, spectrum and response (.png, .pdf or .svg)"
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
    parser.add_argument(
        "--host", help="HTTP address (default: 127.0.0.1); one that others can reach takes tokens"
    )
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
    parser.add_argument(
        "--log-format", choices=("text", "json"), help="of the log on standard error (default: text)"
    )


_TOKEN_EXAMPLES = """\
wingwatch token create lead --scope operate
  wingwatch token list
  wingwatch token revoke lead"""

_TOKEN_ACTIONS = {
    "create": "make a token and show it, once",
    "list": "names and scopes of all tokens",
    "revoke": "withdraw a token; a running service refuses it from now on",
}


def _add_token(commands: "_Commands[_Parser]") -> None:
    does = "tokens for REST and the status page, asked for by a service that others can reach"
    parser = commands.add_parser(
        "token",
        help=does,
        description=f"{does[0].upper()}{does[1:]}.",
        epilog=f"examples:\n  {_TOKEN_EXAMPLES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True, parser_class=_Parser)
    for action, what in _TOKEN_ACTIONS.items():
        name = "" if action == "list" else " lead"
        add = _command(actions, action, what, f"wingwatch token {action}{name}").add_argument
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


def _add_access(commands: "_Commands[_Parser]") -> None:
    parser = _command(
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
    add("--service", default="service", metavar="NAME", help="who the service is (default: %(default)s)")
    add(
        "--by",
        choices=("certificate", "user"),
        default="certificate",
        help="what these are: common names of certificates or users (default: %(default)s)",
    )
    add("--out", type=Path, metavar="FILE", help="write the rules to FILE (default: standard output)")


_STORE_EXAMPLES = """\
wingwatch store backup data/wingwatch.db --out copy.db
  wingwatch store check data/wingwatch.db
  wingwatch store prune data/wingwatch.db --keep-days 30"""

_STORE_ACTIONS = {
    "backup": "copy an SQLite database, also while a service writes to it, and check the copy",
    "check": "read the whole database and say whether it is sound",
    "prune": "thin and drop old history of derivatives at once; alerts, references and expectations stay",
}


def _add_store(commands: "_Commands[_Parser]") -> None:
    does = "the database of a service: copy it, check it, thin its history"
    parser = commands.add_parser(
        "store",
        help=does,
        description=f"{does[0].upper()}{does[1:]}.",
        epilog=f"examples:\n  {_STORE_EXAMPLES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True, parser_class=_Parser)
    for action, what in _STORE_ACTIONS.items():
        example = next(line.strip() for line in _STORE_EXAMPLES.splitlines() if f" {action} " in line)
        add = _command(actions, action, what, example).add_argument
        add("database", metavar="DB", help="path of an SQLite file, or URL of a PostgreSQL database")
        if action == "backup":
            add("--out", type=Path, required=True, metavar="FILE", help="the copy; it must not exist yet")
        if action == "prune":
            _add_retention(add)


def _add_retention(add: Callable[..., object]) -> None:
    options = (
        ("--full-rate-hours", 24.0, "how long history is kept as it came"),
        ("--interval-s", 10.0, "of what is older, one instant of each so many seconds stays"),
        ("--keep-days", 90.0, "flights that ended longer ago go"),
    )
    for name, default, what in options:
        add(name, type=_positive, default=default, metavar="X", help=f"{what} (default: %(default)g)")
    add(
        "--most-rows",
        type=_count,
        default=20_000_000,
        metavar="N",
        help="where there are more estimates, the flights that ended first go (default: %(default)s)",
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


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a number above 0")
    return value


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1000 <= int(text) <= 10**12):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a whole number from 1000")
    return int(text)


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


def _wind(text: str) -> tuple[float, float]:
    """Speed in m/s and the direction it comes from in rad."""
    speed, at, origin = text.partition("@")
    try:
        values = float(speed), math.radians(float(origin))
    except ValueError:
        values = math.nan, math.nan
    if not (at and all(map(math.isfinite, values)) and values[0] >= 0.0):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no wind: write SPEED@FROM_DEG, m/s from 0 and degrees, such as 5@270"
        )
    return values
