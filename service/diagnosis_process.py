"""One job's process: started with one thread, followed line by line, ended when it must."""

import json
import os
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

__all__ = ["DiagnosisProcess"]

_LONGEST_LINE = 10_000
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_LOG = "log.txt"


class DiagnosisProcess:
    """Runs a command that tells its progress as lines of JSON.

    Args:
        command: program and arguments.
        folder: where its standard error goes.
        longest_s: after which it is ended.
    """

    def __init__(self, command: Sequence[str], folder: Path, longest_s: float) -> None:
        self._longest_s = longest_s
        self._too_long = False
        with (folder / _LOG).open("wb") as log:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,  # its end tells the process that we are gone
                stdout=subprocess.PIPE,
                stderr=log,
                env={**os.environ, **dict.fromkeys(_ONE_THREAD, "1")},
                start_new_session=True,  # Ctrl-C at the service's terminal is the service's
            )
        self._timer = threading.Timer(longest_s, self._give_up)
        self._timer.daemon = True
        self._timer.start()

    def lines(self) -> Iterator[dict[str, Any]]:
        """What it tells, until it ends; what is no object of JSON is passed over."""
        out = self._process.stdout
        assert out is not None
        while line := out.readline(_LONGEST_LINE):
            try:
                message = json.loads(line)
            except ValueError:
                continue
            if isinstance(message, dict):
                yield message

    def end(self) -> None:
        """Stop it at once: it holds nothing but its own folder."""
        self._process.kill()

    def problem(self) -> str | None:
        """Wait for its end; None where all went well, else a sentence."""
        code = self._process.wait()
        self._timer.cancel()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        if self._too_long:
            return f"it took longer than the {self._longest_s:.0f} s that a diagnosis may take; give a shorter flight"
        if code == 0:
            return None
        return "its process ended without an answer; the machine may be out of memory" if code < 0 else (
            f"its process ended with code {code}"
        )  # fmt: skip

    def _give_up(self) -> None:
        self._too_long = True
        self.end()
