"""A PostgreSQL server of a benchmark's own: a cluster in a temporary folder, reached over a socket, without a port."""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["PostgresCluster", "find_programs"]

_USER = "postgres"
"""Whom the server runs as where we are root, which PostgreSQL refuses to run as."""


def find_programs() -> Path | None:
    """Folder of ``initdb`` and ``pg_ctl``; None where no server is installed."""
    known = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: float(path.parts[-3]))
    found = str(known[-1]) if known else shutil.which("initdb")
    return Path(found).parent if found else None


class PostgresCluster:
    """A cluster; use it in a ``with`` statement.

    Args:
        folder: empty, of the socket, the log and the write-ahead log.
        data: of the tables.

    Raises:
        FileNotFoundError: no server is installed.
        subprocess.CalledProcessError: it cannot be started.
    """

    def __init__(self, folder: Path, data: Path) -> None:
        programs = find_programs()
        if programs is None:
            raise FileNotFoundError("no PostgreSQL server is installed")
        self._programs, self._folder, self._data = programs, folder, data / "cluster"
        self.url = f"postgresql://wingwatch@/postgres?host={folder}"
        for place in (folder, data):
            place.chmod(0o755)
            if os.geteuid() == 0:
                shutil.chown(place, _USER)
        wal = folder / "wal"
        self._run("initdb", "-U", "wingwatch", "-A", "trust", "-E", "UTF8", "--no-sync", "--waldir", str(wal))

    def __enter__(self) -> "PostgresCluster":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(subprocess.CalledProcessError):
            self.stop()

    def start(self) -> None:
        """Start the server and wait for it."""
        options = f"-c listen_addresses='' -k {self._folder}"
        self._run("pg_ctl", "-l", str(self._folder / "log"), "-w", "-t", "60", "-o", options, "start")

    def stop(self) -> None:
        """End the server at once, as a power cut would."""
        self._run("pg_ctl", "-m", "immediate", "-w", "stop")

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """The server does not run."""
        self.stop()
        try:
            yield
        finally:
            self.start()

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """The server's processes are stopped as by SIGSTOP: it accepts connections and answers nothing."""
        postmaster = int((self._data / "postmaster.pid").read_text(encoding="ascii").split()[0])
        halted = [postmaster, *_children(postmaster)]
        for pid in halted:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in reversed(halted):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGCONT)

    def _run(self, program: str, *arguments: str) -> None:
        command: Sequence[str] = (str(self._programs / program), "-D", str(self._data), *arguments)
        if os.geteuid() == 0:
            command = ("runuser", "-u", _USER, "--", *command)
        # The server keeps what it is given as its output: a pipe would be waited for as long as it runs.
        with (self._folder / "programs.log").open("ab") as log:
            subprocess.run(
                command, check=True, cwd=self._folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )


def _children(parent: int) -> list[int]:
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = status.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            if int(fields[1]) == parent:
                found.append(int(status.parent.name))
    return found
