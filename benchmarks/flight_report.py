"""What `wingwatch report` costs: time, memory and size of the page, in a process of its own.

    .venv/bin/python benchmarks/flight_report.py [--seconds 600] [--rate 50]

An Aerosonde on patrol in light air with doublets of all surfaces, which takes on ice half-way. The seed is fixed.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from saving import run_benchmark

WINGWATCH = (sys.executable, "-m", "wingwatch.cli.main")


def flown(folder: Path, seconds: float, rate_hz: float) -> Path:
    """The flight as a CSV file."""
    flight = folder / "flight.csv"
    asked = ("--aircraft", "aerosonde", "--manoeuvre", "doublet", "--manoeuvre", "patrol", "--turbulence", "light",
             "--effect", f"icing:0.2@{0.5 * seconds:g}+60", "--seconds", f"{seconds:g}", "--rate", f"{rate_hz:g}",
             "--seed", "0", "--out", str(flight))  # fmt: skip
    subprocess.run([*WINGWATCH, "simulate", *asked], check=True, stdout=subprocess.DEVNULL)
    return flight


def reported(flight: Path) -> tuple[float, float, float, int]:
    """Seconds by the clock and of the processor, largest resident memory in MiB and bytes of the page."""
    page = flight.with_suffix(".html")
    begun = time.perf_counter()
    child = subprocess.Popen(
        [*WINGWATCH, "report", str(flight), "--aircraft", "aerosonde", "--out", str(page)],
        stdout=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"report ended with {child.returncode}")
    return (
        time.perf_counter() - begun,
        usage.ru_utime + usage.ru_stime,
        usage.ru_maxrss / 1024.0,
        page.stat().st_size,
    )


def main() -> None:
    """Print one line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="of flight (default: %(default)g)")
    parser.add_argument("--rate", type=float, default=50.0, help="samples a second (default: %(default)g)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        flight = flown(Path(folder), arguments.seconds, arguments.rate)
        elapsed, processor, memory, size = reported(flight)
    print(
        f"{arguments.seconds:g} s at {arguments.rate:g} Hz: {elapsed:.1f} s, {processor:.1f} s of the processor, "
        f"{memory:.0f} MiB, page of {size / 1e6:.2f} MB"
    )


if __name__ == "__main__":
    run_benchmark(main)
