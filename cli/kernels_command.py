"""`wingwatch kernels`: the numerical kernels are compiled in advance."""

import argparse
import sys
import time
from functools import partial

from wingwatch.api import KernelState
from wingwatch.operations.faults import say
from wingwatch.operations.progress import write_json
from wingwatch.service.kernel_steps import EVERY
from wingwatch.service.kernels import KernelCompiler

__all__ = ["run"]

_LOOK_S = 0.5


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command: 0 where every kernel is there, 2 where one cannot be compiled."""
    tell = partial(print, file=sys.stderr if arguments.json else sys.stdout, flush=True)
    compiler = KernelCompiler(EVERY)
    began_s = time.monotonic()
    tell("[kernels] compiled once, one process a processor, and kept")
    compiler.start()
    compiled, parts, over = 0, len(EVERY), False
    while not over:
        over = compiler.wait(_LOOK_S)
        view = compiler.view()
        done = 0 if view is None else sum(p.state is KernelState.COMPILED for p in view.parts)
        if done > compiled:
            compiled = done
            tell(f"[kernels] {compiled} of {parts} parts done")
    compiler.stop()
    for problem in compiler.problems:
        say(problem)
    elapsed_s = time.monotonic() - began_s
    tell(f"[kernels] {'ended' if compiler.problems else 'ready'} after {elapsed_s:.0f} s")
    if arguments.json:
        write_json(
            {"ready": not compiler.problems, "problems": list(compiler.problems), "elapsed_s": elapsed_s}
        )
    return 2 if compiler.problems else 0
