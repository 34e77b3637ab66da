"""Whether the diagnosis names what is hidden, and how far its sizes and its gains hold.

    .venv/bin/python benchmarks/diagnosis.py [--source jsbsim simulation plant] [--cases 200] [--first-seed N]
        [--healthy] [--two] [--workers 2] [--json]
    .venv/bin/python benchmarks/diagnosis.py --fixed [NAME ...]

Each case is a flight and the file of an aircraft that differs from the flown one by one effect (``--two``: by two;
``--healthy``: by none), drawn by its seed (``diagnosis_cases``); a second flight of the same aircraft is held out.
Per source: the right cause first or in the set that the first cannot be distinguished from; first; first and
nothing else said; its size in the stated 95 % interval; healthy flights without a claim; both of two effects named; the
median part of the squared misfit that the first cause takes away on windows left out, and of the largest drop of a
channel's rms residual on the held-out flight. Then hidden names against first causes, and every miss with its seed.
"""

import argparse
import json
import sys

from diagnosis_cases import FIXED, SOURCES, Effects
from diagnosis_report import plain, report, sentence
from diagnosis_run import Task, run
from saving import run_benchmark


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Whether the diagnosis names what is hidden.")
    parser.add_argument("--source", nargs="+", choices=SOURCES, default=list(SOURCES))
    parser.add_argument("--cases", type=int, default=200, help="of each source and kind, at least 1")
    parser.add_argument("--first-seed", type=int, default=0, help="from 0")
    parser.add_argument("--healthy", action="store_true", help="flights without an effect")
    parser.add_argument("--two", action="store_true", help="flights with two effects")
    parser.add_argument(
        "--fixed", nargs="*", metavar="NAME", help=f"the named cases, all or some of {', '.join(FIXED)}"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes, at least 1")
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of the tables")
    return parser


def _tasks(chosen: argparse.Namespace) -> list[Task]:
    """What the arguments ask for.

    Raises:
        ValueError: an argument that makes no sense, in one sentence.
    """
    for name, least in (("cases", 1), ("first_seed", 0), ("workers", 1)):
        if getattr(chosen, name) < least:
            raise ValueError(f"--{name.replace('_', '-')} is {getattr(chosen, name)}; give at least {least}")
    if chosen.fixed is not None:
        unknown = [name for name in chosen.fixed if name not in FIXED]
        if unknown:
            raise ValueError(f"--fixed {' '.join(unknown)}: give some of {', '.join(FIXED)}")
        return [Task(fixed=name) for name in chosen.fixed or FIXED]
    effects: Effects = "none" if chosen.healthy else "two" if chosen.two else "one"
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.cases)
    return [Task(source, seed, effects) for source in chosen.source for seed in seeds]


def main() -> int:
    parser = _parser()
    chosen = parser.parse_args()
    try:
        tasks = _tasks(chosen)
    except ValueError as error:
        parser.error(str(error))
    verdicts = []
    for verdict in run(tasks, workers=chosen.workers):
        verdicts.append(verdict)
        if chosen.json:
            print(json.dumps(plain(verdict)), flush=True)
        elif chosen.fixed is not None:
            print(sentence(verdict), flush=True)
        if sys.stderr.isatty():
            print(f"\r{len(verdicts)} of {len(tasks)}", end="", file=sys.stderr, flush=True)
    if not chosen.json:
        print("\n".join(["", *report(verdicts)]))
    return 0


if __name__ == "__main__":
    run_benchmark(main)
