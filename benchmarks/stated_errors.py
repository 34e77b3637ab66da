"""Values and stated errors of the three whole-flight estimators side by side on the real flight, with their outcomes.

    .venv/bin/python benchmarks/stated_errors.py FLIGHT.mat [--map docs/maps/thor75.toml] [--aircraft ultrastick25e]

Behind each stated error, in brackets, is that for white sensor noise alone. There is no randomness in it. The flight
is not part of this repository; without it the command says so.
"""

import argparse
import sys
from pathlib import Path

from saving import run_benchmark

from wingwatch.aircraft import load_aircraft
from wingwatch.diagnosis.offline_estimates import OFFLINE_ESTIMATORS, estimate_offline
from wingwatch.telemetry import load_flight

STRUCTURES = ("short_period", "lateral")


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Stated errors of whole-flight estimators on the real flight."
    )
    parser.add_argument("flight", type=Path)
    parser.add_argument("--map", type=Path, default=Path("docs/maps/thor75.toml"), dest="channel_map")
    parser.add_argument("--aircraft", default="ultrastick25e")
    given = parser.parse_args()
    if not given.flight.exists():
        print(f"{given.flight} is absent: this benchmark needs the recorded flight", file=sys.stderr)
        return 2
    table, aircraft = load_flight(given.flight, given.channel_map), load_aircraft(given.aircraft)
    found = {
        name: estimate_offline(table, aircraft, name, structures=STRUCTURES).modes
        for name in OFFLINE_ESTIMATORS
    }
    print(f"{'':8}" + "".join(f"{name:>44}" for name in found))
    for structure in STRUCTURES:
        for symbol in found[OFFLINE_ESTIMATORS[0]][structure]["derivatives"]:
            cells = []
            for modes in found.values():
                row, fit = modes[structure]["derivatives"][symbol], modes[structure]["fit"]
                white = fit["standard_error_white"][symbol]
                text = (
                    f"{row['value']:.3g} ± {row['standard_error']:.2g} (white {white:.2g}) {row['outcome']}"
                )
                cells.append(f"{text:>44}")
            print(f"{symbol:8}" + "".join(cells))
        for name, modes in found.items():
            print(f"{structure} {name}: {modes[structure]['reason'] or modes[structure]['outcome']}")
    return 0


if __name__ == "__main__":
    run_benchmark(main)
