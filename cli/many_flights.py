"""Many flights at once: each by itself in one of a few processes, one line a flight, the worst first."""

import argparse
import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from wingwatch.operations.faults import CommandError, say, user_error
from wingwatch.operations.progress import Progress
from wingwatch.telemetry.logs import is_autopilot_log

__all__ = ["each_flight", "end_of_many", "flight_files", "is_many", "print_line"]

Judge = Callable[[Path, argparse.Namespace], dict[str, Any]]
"""One flight's JSON object, for a process of its own: a function of a module."""

SUFFIXES = (
    ".csv", ".tsv", ".asc", ".dat", ".parquet", ".pq", ".mat", ".ulg", ".bin", ".tlog", ".h5", ".hdf5",
)  # fmt: skip
"""Of files that are taken for flights in a folder; a file that is named itself may have any."""

_MOST_JOBS = 64


def is_many(paths: Sequence[Path]) -> bool:
    """Whether a folder is among the paths."""
    return any(path.is_dir() for path in paths)


def flight_files(paths: Sequence[Path]) -> list[Path]:
    """The files, and those of the folders and of what is in them, each once and in order.

    Raises:
        CommandError: a folder without any.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if not path.is_dir():
            found[path] = None
            continue
        inside = sorted(
            file
            for file in path.rglob("*")
            if not _is_hidden(file, path) and file.is_file() and _is_flight(file)
        )
        if not inside:
            raise CommandError(
                f"{path}: no flight in this folder (files that end with {', '.join(SUFFIXES)})"
            )
        found |= dict.fromkeys(inside)
    return list(found)


def _is_flight(file: Path) -> bool:
    """By its suffix; programs of all kinds write ``.log``, and only that of an autopilot is one."""
    suffix = file.suffix.lower()
    return suffix in SUFFIXES or (suffix == ".log" and is_autopilot_log(file))


def _is_hidden(file: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in file.relative_to(folder).parts)


def each_flight(judge: Judge, files: Sequence[Path], arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """The JSON object of each flight, with its ``flight``; of one that cannot be judged its ``error`` alone.

    Args:
        judge: called in another process, in this one where one job is enough.
        files: the flights.
        arguments: of the command; ``jobs`` processes at most, as many as there are processors where it is None.
    """
    jobs = min(arguments.jobs or _processors(), len(files), _MOST_JOBS)
    if jobs == 1:
        return [_guarded(judge, file, arguments, True) for file in files]
    found: dict[Path, dict[str, Any]] = {}
    # Forked processes would share the numerical library's locks with the threads of this one.
    context = multiprocessing.get_context("spawn")
    with (
        Progress().count(len(files), f"{len(files)} flights") as show,
        ProcessPoolExecutor(jobs, mp_context=context) as pool,
    ):
        waiting: dict[Future[dict[str, Any]], Path] = {
            pool.submit(_guarded, judge, file, arguments, False): file for file in files
        }
        try:
            while waiting:
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    file = waiting.pop(future)
                    found[file] = _result(future, file)
                    show(len(found))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [found[file] for file in files]


def _result(future: Future[dict[str, Any]], file: Path) -> dict[str, Any]:
    try:
        return future.result()
    except BrokenProcessPool:
        said = "a process ended while it was judged, perhaps for want of memory; try --jobs 1"
        return {"flight": str(file), "error": f"{file}: {said}"}


def _guarded(judge: Judge, file: Path, arguments: argparse.Namespace, shown: bool) -> dict[str, Any]:
    """What is wrong with one flight does not stop the others."""
    arguments = argparse.Namespace(**{**vars(arguments), "progress": shown})
    try:
        return {"flight": str(file), **judge(file, arguments)}
    except Exception as error:
        said = (
            user_error(error)
            or f"internal error: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
        )
        return {"flight": str(file), "error": said}


def _processors() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def print_line(console: Console, state: str, result: Mapping[str, Any], text: str) -> None:
    """One flight as one line, however long."""
    console.print(
        f"[bold]{escape(state.replace('_', ' ')):<15}[/] {escape(result['flight'])}: {escape(text)}",
        soft_wrap=True,
    )


def end_of_many(results: Sequence[Mapping[str, Any]]) -> int:
    """The exit code: 2, and a sentence, where a flight could not be judged."""
    failed = sum("error" in result for result in results)
    if failed:
        say(f"error: {failed} of {len(results)} flights could not be judged; their lines say why")
    return 2 if failed else 0
