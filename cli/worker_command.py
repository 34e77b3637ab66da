"""`wingwatch worker`: watches vehicles for gateways, until Ctrl-C or SIGTERM."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from wingwatch.cli.ending import asked_to_end, leave_at_once
from wingwatch.cli.serve_command import await_ready, begun
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import write_json
from wingwatch.service.workers.worker import running_worker

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    settings, tell = begun(arguments)
    with (
        asked_to_end() as end,
        _ready_file(arguments.ready_file) as note_ready,
        running_worker(settings) as worker,
    ):
        if arguments.json:
            write_json({"worker": worker.name, "zenoh": list(worker.endpoints)})
        else:
            print(f"worker {worker.name}   Zenoh {' '.join(worker.endpoints)}", flush=True)
        if await_ready(worker, end, tell):
            note_ready(True)
            tell("ready")
        end.wait()
        note_ready(False)
        tell("ending")
    leave_at_once(0)


@contextmanager
def _ready_file(path: Path | None) -> Iterator[Callable[[bool], None]]:
    """What makes a file that is there while samples are taken in, and removes it; nothing without a path.

    Raises:
        CommandError: it cannot be written.
    """

    def note(ready: bool) -> None:
        if path is None:
            return
        try:
            if ready:
                path.write_text("ready\n", encoding="utf-8")
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            reason = (error.strerror or "it cannot be written").lower()
            raise CommandError(
                f"--ready-file {path}: {reason}; give a file in a folder that can be written"
            ) from None

    note(True)  # tried before anything begins
    note(False)
    try:
        yield note
    finally:
        note(False)
