"""The command `wingwatch`: arguments in, one of the commands run, an exit code out.

Exit codes: 0 success, 2 bad usage or bad input (one sentence on standard error), 130 interrupted, 1 a fault of
the program itself. Commands are loaded only when they are run, so that help is at once.
"""

import argparse
import os
import sys
import traceback
from collections.abc import Sequence
from importlib import import_module

from wingwatch import __version__
from wingwatch.cli.arguments import build_parser
from wingwatch.operations.faults import say, user_error

__all__ = ["main"]

INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: the arguments after the program's name; those of the process if not given.

    Returns:
        the exit code; bad usage ends in ``SystemExit`` with code 2, as argparse has it.
    """
    arguments = build_parser(__version__).parse_args(argv)
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        say("interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing more can be written there
        return 0
    except Exception as error:
        sentence = user_error(error)
        if sentence is not None:
            say(f"error: {sentence}")
            return 2
        if os.environ.get("WINGWATCH_DEBUG"):
            traceback.print_exc()
        say(
            f"internal error: {type(error).__name__}: {' '.join(str(error).split())[:300]}; "
            "set WINGWATCH_DEBUG=1 to see where, and report it"
        )
        return 1


def _run(arguments: argparse.Namespace) -> int:
    # Before numpy is loaded: its matrices are of a dozen rows here, and threads that share one wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    module = import_module(f"wingwatch.cli.{arguments.command.replace('-', '_')}_command")
    if "numba" in sys.modules:  # what does not load it has no use for kernels
        from wingwatch.service.kernel_wheel import take_or_say

        take_or_say()
    code: int = module.run(arguments)
    return code


if __name__ == "__main__":
    sys.exit(main())
