"""Logs for the tutorial "your_log.md": one simulated flight as PX4 and as ArduPilot would have logged it.

    python docs/tutorial/make_logs.py OUT [--seconds 150] [--aircraft healthy]

The writers are those of the tests; they follow the published formats and share no code with what reads logs.
"""

import argparse
import sys
from pathlib import Path

from wingwatch.simulation import demo_fleet, simulate

ROOT = Path(__file__).resolve().parents[2]
FLIGHTS = tuple(scenario.name for scenario in demo_fleet())


def main() -> None:
    """Write ``flight.ulg`` and ``flight.bin``."""
    sys.path.insert(0, str(ROOT / "tests" / "telemetry"))
    from flown_logs import ardupilot_log, on_the_ground_first, px4_log

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of both files")
    parser.add_argument("--seconds", type=float, default=150.0, help="in the air (default: %(default)g)")
    parser.add_argument(
        "--aircraft", choices=FLIGHTS, default="healthy", help="of the demonstration (default: %(default)s)"
    )
    arguments = parser.parse_args()
    scenario = next(one for one in demo_fleet() if one.name == arguments.aircraft)
    columns = on_the_ground_first(simulate(scenario, arguments.seconds))
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, log in (("flight.ulg", px4_log), ("flight.bin", ardupilot_log)):
        path = arguments.out / name
        path.write_bytes(log(columns).encode())
        print(path)


if __name__ == "__main__":
    main()
