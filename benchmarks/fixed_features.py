"""What kernels compiled for a fixed set of processor features cost beside those compiled for this processor.

A wheel with compiled kernels (``make wheel``) brings the former, a machine that compiles its own has the latter. The
costs are those of ``cost.py``: processor time a vehicle-sample of both estimators, all structures together. Processes
of the two kinds take turns, each kind is first in every other round, and a ratio is of two that ran one after the
other; the median and the range of the rounds are printed. Kernels that are not there yet are compiled first.

Run: python benchmarks/fixed_features.py [--cpu x86-64-v3] [--vehicles 300] [--seconds 12] [--rounds 6]
"""

import argparse
import json
import os
import statistics
import subprocess
import sys

from saving import run_benchmark

_ALL = "both estimators"


def measured(batches: dict[int, float]) -> dict[str, dict[str, float]]:
    """Microseconds a vehicle-sample by size of the batch and part, in this process.

    Args:
        batches: seconds of flight by how many vehicles fly.
    """
    from cost import estimator_cost

    from wingwatch.aircraft import load_aircraft

    aircraft = load_aircraft("aerosonde")
    estimator_cost(aircraft, 2, 1.0)
    costs: dict[str, dict[str, float]] = {}
    for vehicles, seconds in batches.items():
        parts, _ = estimator_cost(aircraft, vehicles, seconds)
        costs[str(vehicles)] = {**parts, _ALL: sum(parts.values())}
    return costs


def asked(cpu: str | None, batches: dict[int, float]) -> dict[str, dict[str, float]]:
    """The same of a process whose kernels are for ``cpu``, by LLVM's name, or for this processor."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_CPU")}
    environment["OPENBLAS_NUM_THREADS"] = "1"
    if cpu is not None:
        environment |= {"NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": ""}
    command = [sys.executable, __file__, "--here", json.dumps(batches)]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    costs: dict[str, dict[str, float]] = json.loads(answer.stdout)
    return costs


def main() -> None:
    """Print the costs of both kinds and their ratio."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cpu", default="x86-64-v3", help="LLVM's name of the fixed set")
    parser.add_argument("--vehicles", type=int, default=300, help="of the large batch, at least 2")
    parser.add_argument("--seconds", type=float, default=12.0, help="flight of the large batch, at least 1")
    parser.add_argument("--rounds", type=int, default=6, help="pairs of processes")
    parser.add_argument("--here", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.here:
        print(json.dumps(measured({int(n): s for n, s in json.loads(given.here).items()})))
        return
    if given.vehicles < 2 or not given.seconds >= 1.0 or given.rounds < 1:
        parser.error("give --vehicles of at least 2, --seconds of at least 1 and --rounds of at least 1")
    for cpu in (given.cpu, None):
        asked(cpu, {1: 1.0})
    batches = {1: 100.0, given.vehicles: given.seconds}
    rounds = []
    for k in range(given.rounds):
        kinds = (given.cpu, None) if k % 2 == 0 else (None, given.cpu)
        costs = {cpu: asked(cpu, batches) for cpu in kinds}
        rounds.append((costs[given.cpu], costs[None]))
    print(f"microseconds of processor time a vehicle-sample, medians of {given.rounds} rounds")
    print(f"  {'':<28}{'vehicles':>9}{given.cpu:>12}{'this one':>10}{'ratio':>8}   range")
    for vehicles in map(str, batches):
        for part in rounds[0][0][vehicles]:
            pairs = [(fixed[vehicles][part], own[vehicles][part]) for fixed, own in rounds]
            ratios = [fixed / own for fixed, own in pairs]
            fixed, own = (statistics.median(column) for column in zip(*pairs, strict=True))
            print(
                f"  {part:<28}{vehicles:>9}{fixed:12.2f}{own:10.2f}{statistics.median(ratios):8.2f}"
                f"   {min(ratios):.2f} to {max(ratios):.2f}"
            )


if __name__ == "__main__":
    run_benchmark(main)
