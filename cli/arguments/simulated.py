"""Commands that simulate or design."""

import argparse
from pathlib import Path

from wingwatch.cli.arguments.common import Commands, add_command, add_commands, add_convention
from wingwatch.cli.arguments.values import wind

__all__ = ["add_demo", "add_design_input", "add_simulate", "add_study", "add_thesis"]

_DEMO_DATA = Path("data") / "demo"

_INPUT_KINDS = (
    "impulse", "step", "doublet", "3211", "3211-modified", "1123", "211", "sweep", "logarithmic-sweep", "multisine",
    "weighted-multisine",
)  # fmt: skip

_SIMULATE_EXAMPLES = """\
wingwatch simulate --aircraft aerosonde --out healthy.parquet
  wingwatch simulate --aircraft aerosonde --seconds 150 --effect icing:0.15@60+30 --out iced.csv --truth iced.json
  wingwatch simulate --aircraft aerosonde --input input.csv --out flown.csv
  wingwatch simulate --aircraft ultrastick25e --seconds 600 --manoeuvre patrol --turbulence light --wind 5@270 \\
      --effect sensor_bias[pitch_rate_rad_s]:0.01@120 --effect thrust_loss:0.2@300 --seed 7 --out patrol.parquet"""

_STUDY_EXAMPLES = """\
wingwatch study all --out studies --report studies.html
  wingwatch study icing --out icing.parquet
  wingwatch study icing --out icing.parquet --resume
  wingwatch study damage --config own_aircraft.toml --flights 500 --out damage.parquet
  wingwatch study healthy --hours 300 --scheduler tcp://10.0.0.5:8786 --out healthy.parquet
  wingwatch study icing --show-config > grid.toml
  wingwatch study replay icing.parquet --seed 17 --out flight.parquet"""

_STUDIES = {
    "icing": "from which severity on ice is noticed: drawn flights with ice, simulated and watched, one row each",
    "damage": "what damage is noticed, how soon and under which name: drawn flights, one row each",
    "sensor": "what faulty sensors are noticed, how soon, and whether they are called ice: drawn flights, one row each",
    "healthy": "how often an alert is false: flights without any fault and with faulty sensors, one row each",
}

_DESIGN_EXAMPLES = """\
wingwatch design-input --aircraft aerosonde --mode short_period --kind doublet
  wingwatch design-input --aircraft aerosonde --mode short_period --mode lateral --kind multisine --out input.csv \\
      --plot input.png
  wingwatch design-input --aircraft aerosonde --mode dutch_roll --compare"""

_THESIS_EXAMPLES = """\
wingwatch thesis
  wingwatch thesis --table 7.3 --table 8.1
  wingwatch thesis --figure 9.15
  wingwatch thesis --report thesis.html"""


def add_demo(commands: Commands) -> None:
    """``wingwatch demo``."""
    parser = add_command(
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
        default=_DEMO_DATA,
        metavar="DIR",
        help="folder of demo.db, which every demo starts anew (default: %(default)s)",
    )
    parser.add_argument(
        "--no-diagnose-alerts",
        dest="diagnose_alerts",
        action="store_false",
        help="do not look into alerts by simulation, in a process of its own at low priority",
    )


def add_simulate(commands: Commands) -> None:
    """``wingwatch simulate``."""
    parser = add_command(
        commands,
        "simulate",
        "a flight with known truth: manoeuvres, turbulence, wind, and effects that befall the aircraft",
        _SIMULATE_EXAMPLES,
    )
    add = parser.add_argument
    add("--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file")
    add("--out", required=True, type=Path, metavar="FLIGHT", help="flight table to write (.csv or .parquet)")
    add("--truth", type=Path, metavar="FILE", help="write the truth to FILE (JSON)")
    add("--seconds", type=float, help="length of the flight (default: 60, and 10 beyond an --input)")
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
    add(
        "--input",
        type=Path,
        metavar="FILE",
        help="deflections from trim over time_s, as design-input writes them, or the surfaces of a flight table; added "
        "to what the autopilot commands, in place of manoeuvres that are not asked for",
    )
    add(
        "--autopilot",
        choices=("on", "off"),
        default="on",
        help="off: surfaces and throttle stay at the trim but for manoeuvres and input, so that phugoid and spiral are "
        "the aircraft's own (default: %(default)s)",
    )
    add("--turbulence", choices=("none", "light", "moderate", "severe"), default="none", help="MIL-F-8785C")
    add("--turbulence-model", choices=("dryden", "von-karman"), default="dryden", help="form of its spectra")
    add(
        "--wind",
        type=wind,
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


def add_design_input(commands: Commands) -> None:
    """``wingwatch design-input``."""
    parser = add_command(
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
        choices=("short_period", "phugoid", "dutch_roll", "roll", "spiral", "lateral"),
        help="what to excite; may be repeated: modes of different surfaces stand beside each other",
    )
    add("--kind", choices=_INPUT_KINDS, help="shape of the input")
    add("--compare", action="store_true", help="all kinds side by side, in place of one")
    add_convention(parser)
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


def add_study(commands: Commands) -> None:
    """``wingwatch study``."""
    does = "how good the monitor's decisions are: thousands of simulated flights whose truth is known"
    studies = add_commands(commands, "study", does, _STUDY_EXAMPLES, "study")
    for kind, what in _STUDIES.items():
        _add_study_of(studies, kind, what)
    _add_study_all(studies)
    _add_study_replay(studies)
    _add_study_show(studies)


def _add_study_of(studies: Commands, kind: str, what: str) -> None:
    example = f"wingwatch study {kind} --out {kind}.parquet"
    parser = add_command(studies, kind, what, f"{example}\n  {example} --resume")
    add = parser.add_argument
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
    _add_flying(parser)


def _add_study_all(studies: Commands) -> None:
    example = "wingwatch study all --out studies --report studies.html"
    parser = add_command(
        studies,
        "all",
        "the studies of icing, damage, sensors and healthy flights one after the other, and what they say together",
        f"{example}\n  {example} --resume",
    )
    add = parser.add_argument
    add(
        "--out",
        type=Path,
        required=True,
        metavar="FOLDER",
        help="folder to write icing.parquet, damage.parquet, sensor.parquet and healthy.parquet to",
    )
    add("--report", type=Path, metavar="FILE.html", help="write what they say together as one page")
    add(
        "--config",
        type=Path,
        metavar="GRID.toml",
        help="what is drawn in all of them, in place of the default grids' keys; without [[effects]]",
    )
    add("--flights", type=int, metavar="N", help="of icing, of damage and of sensors (default: the grids')")
    add("--hours", type=float, metavar="H", help="of healthy flight (default: the grid's)")
    _add_flying(parser)


def _add_flying(parser: argparse.ArgumentParser) -> None:
    """Which flights, and who flies them."""
    add = parser.add_argument
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


def _add_study_replay(studies: Commands) -> None:
    parser = add_command(
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


def _add_study_show(studies: Commands) -> None:
    parser = add_command(
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


def add_thesis(commands: Commands) -> None:
    """``wingwatch thesis``."""
    parser = add_command(
        commands,
        "thesis",
        "result tables and figures of the thesis (Jameson 2013) as printed, beside ours on the same plants",
        _THESIS_EXAMPLES,
    )
    add = parser.add_argument
    add("--table", action="append", default=[], metavar="N", help="in full, such as 7.3; may be repeated")
    add("--figure", action="append", default=[], metavar="N", help="such as 9.15; may be repeated")
    add(
        "--beyond",
        action="store_true",
        help="what the thesis's methods could not do, on its plants: errors that hold, rough air, a lost effect",
    )
    add(
        "--draws",
        type=int,
        default=100,
        metavar="N",
        help="of noise in each case, seeds from 0 (default: %(default)s)",
    )
    add("--report", type=Path, metavar="FILE", help="write it as one page (.html) or as Markdown (.md)")
