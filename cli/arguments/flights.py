"""Commands that take a recorded flight."""

import argparse
from pathlib import Path

from wingwatch.cli.arguments.common import (
    Commands,
    add_accept_implausible,
    add_aircraft_and_map,
    add_command,
    add_convention,
    add_flight,
    add_forgetting,
    add_jobs,
    add_link_security,
)
from wingwatch.cli.arguments.values import replay_speed

__all__ = [
    "add_condition",
    "add_diagnose",
    "add_estimate",
    "add_log",
    "add_monitor",
    "add_publish",
    "add_replay",
    "add_report",
]

_STRUCTURES = (
    "short_period", "short_period_alpha", "phugoid", "longitudinal", "longitudinal_throttle", "dutch_roll",
    "dutch_roll_beta", "roll", "spiral", "lateral", "lateral_full",
)  # fmt: skip


def add_estimate(commands: Commands) -> None:
    """``wingwatch estimate``."""
    parser = add_command(
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
        help="CSV, Parquet or MATLAB file, or an autopilot's log; several are one after another, with common "
        "derivatives; of a folder, each flight is one line by itself, the one furthest from what is expected first",
    )
    add_aircraft_and_map(parser)
    add_accept_implausible(parser)
    add_jobs(parser)
    add_convention(parser)
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
    parser.add_argument(
        "--engine",
        choices=("compiled", "filterpy"),
        default="compiled",
        help="of the filter: compiled, or filterpy's class with the same model, slower and to be read "
        "(default: %(default)s)",
    )
    add_forgetting(parser)
    _add_estimate_outputs(parser)


def _add_estimate_outputs(parser: argparse.ArgumentParser) -> None:
    """What comes of an estimate beside its table."""
    parser.add_argument(
        "--repeats",
        action="store_true",
        help="each manoeuvre of the flights alone (output-error, or --estimator of the whole flight): the scatter of "
        "repeats beside the errors that they state",
    )
    parser.add_argument(
        "--validate",
        type=Path,
        metavar="FLIGHT2",
        help="judge the derivatives on another flight: the linear model with them flies its manoeuvres open loop",
    )
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="PICTURE",
        help="measured and predicted motion by manoeuvre, and what is left (.png, .svg or .pdf; extra plot)",
    )
    parser.add_argument(
        "--save",
        type=Path,
        metavar="OUT.toml",
        help="write an aircraft file with the derivatives as identified entries at the flight's condition",
    )


def add_log(commands: Commands) -> None:
    """``wingwatch log``."""
    parser = add_command(
        commands,
        "log",
        "what a log holds before anyone writes a map: channels, rates, gaps, what is missing, which modes it serves",
        "wingwatch log flight.ulg\n"
        "  wingwatch log 00000042.BIN --aircraft my_aircraft.toml --write-map map.toml\n"
        "  wingwatch log flight.tlog --json",
    )
    parser.add_argument(
        "file",
        metavar="FILE",
        type=Path,
        help="PX4's .ulg, ArduPilot's .bin or .log, a .tlog; CSV, Parquet or MATLAB",
    )
    parser.add_argument(
        "--map", type=Path, metavar="MAP", help="channel map (TOML; default: the autopilot's)"
    )
    parser.add_argument(
        "--aircraft",
        metavar="A",
        help="name in the library, or path of an aircraft file: what angle its surfaces have at full travel",
    )
    parser.add_argument(
        "--write-map", type=Path, metavar="OUT.toml", help="write the map the log is read by, to be edited"
    )


def add_monitor(commands: Commands) -> None:
    """``wingwatch monitor``."""
    parser = add_command(
        commands,
        "monitor",
        "status and alerts of a recorded flight, by the code that runs live",
        "wingwatch monitor flight.mat --aircraft ultrastick25e --map thor75.toml\n"
        "  wingwatch monitor logs/ --aircraft aerosonde --jobs 4",
    )
    parser.add_argument(
        "flights",
        metavar="FLIGHT",
        type=Path,
        nargs="+",
        help="CSV, Parquet or MATLAB file; of several, or of a folder, each is one line by itself, the worst first",
    )
    add_aircraft_and_map(parser)
    add_accept_implausible(parser)
    add_jobs(parser)
    add_convention(parser)
    add_forgetting(parser)
    parser.add_argument(
        "--manoeuvres",
        action="store_true",
        help="judge each manoeuvre: what it taught, what was poor, and the input that would help",
    )
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


def add_condition(commands: Commands) -> None:
    """``wingwatch condition``."""
    parser = add_command(
        commands,
        "condition",
        "what a recorded flight says of its sensors, air and trims: delays, biases, scale errors, turbulence",
        "wingwatch condition flight.csv --aircraft aerosonde --out corrected.parquet",
    )
    add_flight(parser)
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


def add_publish(commands: Commands) -> None:
    """``wingwatch publish``."""
    parser = add_command(
        commands,
        "publish",
        "stream a flight into Zenoh as a vehicle does; returns when all of it has been handed over",
        "wingwatch publish flight.csv --vehicle uav1 --aircraft aerosonde --rate max",
    )
    add_flight(parser)
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
        type=replay_speed,
        default=1.0,
        metavar="1.0|max",
        help="speed relative to the time stamps, or max: as fast as it is taken, nothing lost (default: 1.0)",
    )
    add_link_security(parser)


def add_replay(commands: Commands) -> None:
    """``wingwatch replay``."""
    parser = add_command(
        commands,
        "replay",
        "what wingwatch serve --record wrote, through the whole chain once more, beside what came of it then",
        "wingwatch replay recordings/ --speed max",
    )
    parser.add_argument(
        "recording",
        metavar="RECORDING",
        type=Path,
        nargs="+",
        help="MCAP files of one run of a service, or their folder (of several runs in it the latest)",
    )
    parser.add_argument(
        "--speed",
        type=replay_speed,
        default=None,
        metavar="1.0|max",
        help="relative to the recording, or max: as fast as it can be computed (default: max)",
    )
    parser.add_argument(
        "--aircraft",
        action="append",
        type=Path,
        default=[],
        metavar="FILE",
        help="aircraft file in the place of the one that the recording carries; may be repeated",
    )
    parser.add_argument(
        "--tables",
        type=Path,
        metavar="DIR",
        help="write what each vehicle sent as a flight (Parquet) into DIR, and replay nothing",
    )


def add_diagnose(commands: Commands) -> None:
    """``wingwatch diagnose``."""
    parser = add_command(
        commands,
        "diagnose",
        "what the simulation of an aircraft gets wrong against a recorded flight, why, and the model extended",
        "wingwatch diagnose flight.mat --aircraft ultrastick25e --map thor75.toml --report report.html",
    )
    add_flight(parser)
    add_accept_implausible(parser)
    parser.add_argument(
        "--validate",
        type=Path,
        metavar="FLIGHT",
        help="another flight, on which the extended model is judged (default: windows of FLIGHT left out)",
    )
    parser.add_argument(
        "--validate-map",
        type=Path,
        metavar="MAP",
        help="channel map of the other flight (default: that of FLIGHT)",
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


def add_report(commands: Commands) -> None:
    """``wingwatch report``."""
    parser = add_command(
        commands,
        "report",
        "what a recorded flight came to, as one page for a colleague: alerts, derivatives, modes, fit, sensors",
        "wingwatch report flight.ulg --aircraft my_aircraft.toml --out report.html\n"
        "  wingwatch report flight.mat --aircraft ultrastick25e --map thor75.toml --out report.html",
    )
    add_flight(parser)
    add_accept_implausible(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="REPORT.html", help="the page to write")
