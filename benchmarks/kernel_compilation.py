"""What a fresh machine compiles: processor seconds by step and by kernel, in an empty cache.

A kernel's own seconds are those of its compilation without the kernels that it has compiled on the way. Steps run one
after another in one process each; a first start runs two of them side by side.

Run: python benchmarks/kernel_compilation.py [--steps fourier,filter] [--kernels N]
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from typing import Any

from saving import run_benchmark

from wingwatch.service.kernel_steps import EVERY, STEPS


def compiled(step: str) -> dict[str, Any]:
    """Run one step here; seconds of the whole and by kernel, and how many kernels were compiled."""
    import numba.core.event as events

    own: dict[str, float] = defaultdict(float)
    forms: dict[str, int] = defaultdict(int)

    class Clock(events.Listener):
        running: list[list[float]] = []  # noqa: RUF012 - one process, one listener

        def on_start(self, event: Any) -> None:
            self.running.append([time.process_time(), 0.0])

        def on_end(self, event: Any) -> None:
            began_s, within_s = self.running.pop()
            took_s = time.process_time() - began_s
            kernel = event.data["dispatcher"].py_func
            name = f"{kernel.__module__.removeprefix('wingwatch.')}.{kernel.__qualname__}"
            own[name] += took_s - within_s
            forms[name] += 1
            if self.running:
                self.running[-1][1] += took_s

    register: Any = events.register  # it carries no types
    register("numba:compile", Clock())
    began_s = time.process_time()
    STEPS[step].run()
    return {"seconds": time.process_time() - began_s, "own": own, "forms": sum(forms.values())}


def main() -> None:
    """Print the steps, and the kernels that cost most."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", default=",".join(EVERY), help="steps by name, with commas")
    parser.add_argument("--kernels", type=int, default=12, help="how many kernels are listed")
    parser.add_argument("--here", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.here:
        print(json.dumps(compiled(arguments.here)))
        return
    total_s = 0.0
    own: dict[str, float] = defaultdict(float)
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder, "OPENBLAS_NUM_THREADS": "1"}
        for step in arguments.steps.split(","):
            command = [sys.executable, __file__, "--here", step]
            answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            found = json.loads(answer.stdout)
            total_s += found["seconds"]
            for name, seconds in found["own"].items():
                own[name] += seconds
            print(f"{step:14s} {found['seconds']:6.1f} s of processor time, {found['forms']:4d} compiled")
    print(f"{'all':14s} {total_s:6.1f} s of processor time")
    for name, seconds in sorted(own.items(), key=lambda item: -item[1])[: arguments.kernels]:
        print(f"  {seconds:5.1f} s  {name}")


if __name__ == "__main__":
    run_benchmark(main)
