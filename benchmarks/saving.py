"""`--save`: every benchmark keeps what it prints in `benchmarks/results/`, headed by its command, date and commit.

    .venv/bin/python benchmarks/alerts.py --flights 8 --save               writes benchmarks/results/alerts.txt
    .venv/bin/python benchmarks/alerts.py --flights 8 --save alerts_small  writes benchmarks/results/alerts_small.txt

`docs/benchmarks.md` quotes these files, and a test compares its tables with them.
"""

import io
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NoReturn, TextIO

RESULTS = Path(__file__).parent / "results"
"""Where the outputs are kept."""

NAME = re.compile(r"[a-z0-9_]+")


class Tee(io.TextIOBase):
    """Standard output that also keeps what is printed."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self.printed = io.StringIO()

    def write(self, text: str) -> int:
        """Print, and keep."""
        self.printed.write(text)
        return self._out.write(text)

    def flush(self) -> None:
        """Of the output itself."""
        self._out.flush()


def without_save(arguments: Sequence[str]) -> tuple[list[str], str | None]:
    """Arguments of a benchmark without `--save [NAME]`, and the name: "" where none follows, None without `--save`.

    Raises SystemExit where the name is not of small letters, digits and underscores.
    """
    left = list(arguments)
    if "--save" not in left:
        return left, None
    at = left.index("--save")
    follows = at + 1 < len(left) and not left[at + 1].startswith("-")
    name = left[at + 1] if follows else ""
    if name and not NAME.fullmatch(name):
        raise SystemExit(f"--save: {name!r} is not a name; use small letters, digits and underscores")
    return left[:at] + left[at + 1 + follows :], name


def head(script: str, arguments: Sequence[str], commit: str, code: int) -> str:
    """Lines before the output: command, date, commit, and how it ended where that was not well."""
    named = (Path(a).name if Path(a).is_absolute() else a for a in arguments)
    lines = [
        f"# command: {shlex.join([f'benchmarks/{Path(script).name}', *named])}",
        f"# date: {datetime.now(UTC):%Y-%m-%d}",
        f"# commit: {commit}",
    ]
    return "\n".join(lines + ([f"# exit code: {code}"] if code else [])) + "\n\n"


def tidy(printed: str) -> str:
    """What was printed, without blanks at the ends of lines and empty lines before and after."""
    return "\n".join(line.rstrip() for line in printed.splitlines()).strip("\n") + "\n"


def commit_now() -> str:
    """The commit that is checked out, "unknown" where there is no repository; says where files differ from it."""
    try:
        commit = _git("rev-parse", "--short=7", "HEAD")
        changed = _git("status", "--porcelain", "--", ".", ":!benchmarks/results", ":!docs")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{commit}, with changes" if changed else commit


def _git(*arguments: str) -> str:
    root = Path(__file__).parents[1]
    return subprocess.run(
        ["git", *arguments], cwd=root, capture_output=True, text=True, check=True
    ).stdout.strip()


def run_benchmark(main: Callable[[], object]) -> NoReturn:
    """Run a benchmark's `main`; with `--save`, keep what it prints. Ends the program with what `main` returns.

    An exception passes through, and then nothing is kept.
    """
    if {"-h", "--help"} & set(sys.argv[1:]):
        print("Every benchmark also takes --save [NAME]: keep the output as benchmarks/results/NAME.txt\n")
    arguments, name = without_save(sys.argv[1:])
    if name is None:
        raise SystemExit(main())
    sys.argv[1:] = arguments
    tee = Tee(sys.stdout)
    sys.stdout = tee
    try:
        code = main() or 0
    except SystemExit as ended:
        if not isinstance(ended.code, int):
            raise
        code = ended.code
    finally:
        sys.stdout = tee._out
    path = RESULTS / f"{name or Path(sys.argv[0]).stem}.txt"
    number = code if isinstance(code, int) else 0
    path.parent.mkdir(exist_ok=True)
    path.write_text(head(sys.argv[0], arguments, commit_now(), number) + tidy(tee.printed.getvalue()))
    print(f"kept in benchmarks/results/{path.name}", file=sys.stderr)
    raise SystemExit(number)
