"""Checkpoints of vehicles as files in one folder, one a vehicle, written behind the live path's back.

A file is written beside the old one, brought to the disk and then put in its place: whoever kills this process at any
instant leaves the old file or the new one. One thread encodes and writes. What is newer replaces what waits, little
waits, and the number of files is bounded. Why files and not the database:
``docs/decisions/0042-checkpoints-are-files.md``.
"""

import hashlib
import logging
import os
import threading
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Self

from wingwatch.monitor import (
    Checkpoint,
    CheckpointError,
    SavedVehicle,
    decode_checkpoint,
    encode_checkpoint,
)
from wingwatch.monitor.vehicle.checkpoint import MOST_BYTES
from wingwatch.service.loops import Loop

__all__ = ["CheckpointFolder"]

_LOG = logging.getLogger(__name__)
_SUFFIX, _UNFINISHED = ".checkpoint", ".unfinished"
_MOST_WAITING = 4  # half a megabyte each; those with news of an alert wait beyond it
_END_S = 10.0


class CheckpointFolder:
    """Implements the monitor's ``Checkpoints``; use it in a ``with`` statement.

    Args:
        folder: made where it is missing.
        wall_clock: seconds since 1970-01-01 UTC; it goes on while the service does not run.
        most: files; the one written longest ago gives way.
    """

    def __init__(self, folder: Path, wall_clock: Callable[[], float], most: int = 5000) -> None:
        self._folder, self._wall_clock, self._most = folder, wall_clock, most
        self._waiting: dict[tuple[str, str], Checkpoint] = {}
        self._urgent: dict[tuple[str, str], None] = {}
        self._handed_over: dict[tuple[str, str], bytes] = {}
        self._files: dict[str, None] = {}  # written longest ago first
        self._counts = dict.fromkeys(("written", "failed", "refused", "expired", "resumed"), 0)
        self._lock, self._writing = threading.Lock(), threading.Lock()
        self._news, self._end, self._in_hand = threading.Event(), False, False
        self._problem: str | None = None
        self.loop = Loop(
            "wingwatch-checkpoints", "the loop that saves vehicles' states", self._run, self._news.set
        )

    def __enter__(self) -> Self:
        self.loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what waits and end; a disk that does not answer is not waited for longer than 10 s."""
        self._end = True
        self._news.set()
        self.loop.join(_END_S)

    @property
    def waiting(self) -> int:
        """States that wait to be written."""
        return len(self._waiting)

    @property
    def idle(self) -> bool:
        """Whether every state that was handed over is written, or given up."""
        with self._lock:
            return not self._waiting and not self._in_hand

    @property
    def problem(self) -> str | None:
        """Why the latest state was not written; None while states are."""
        return self._problem

    @property
    def counts(self) -> dict[str, int]:
        """Checkpoints written, not written, refused, too old to go on from, and vehicles that went on from one."""
        with self._lock:
            return dict(self._counts)

    def count(self, what: str, text: str = "") -> None:
        """Count what became of a checkpoint, and log why."""
        with self._lock:
            self._counts[what] += 1
        if text:
            _LOG.warning("%s", text)

    def has_room(self) -> bool:
        """Whether fewer than four wait."""
        return len(self._waiting) < _MOST_WAITING

    def keep(self, saved: SavedVehicle, urgent: bool) -> None:
        """Let a state wait to be written, in the place of an older one of the same vehicle."""
        key = saved.fleet, saved.vehicle
        with self._lock:
            self._waiting[key] = Checkpoint(self._wall_clock(), saved)
            if urgent:
                self._urgent[key] = None
        self._news.set()

    def write(self, saved: SavedVehicle) -> None:
        """Write a state now, in the place of what waits of the vehicle."""
        with self._lock:
            self._waiting.pop((saved.fleet, saved.vehicle), None)
        self._written(Checkpoint(self._wall_clock(), saved))

    def begin_hand_over(self, vehicles: Collection[tuple[str, str]]) -> None:
        """What is written of these from now on is kept for ``handed_over`` as well."""
        with self._lock:
            self._handed_over |= dict.fromkeys(vehicles, b"")

    def handed_over(self, vehicles: Collection[tuple[str, str]]) -> dict[tuple[str, str], bytes]:
        """The last states of these, as they were written; empty where none was."""
        with self._lock:
            return {key: self._handed_over.pop(key, b"") for key in vehicles}

    def drop(self, fleet: str, vehicle: str) -> None:
        """Another process has gone on with a vehicle: what waits of it is not written."""
        with self._lock:
            self._waiting.pop((fleet, vehicle), None)
            self._urgent.pop((fleet, vehicle), None)

    def load(self) -> Sequence[SavedVehicle]:
        """Every vehicle whose file can be used, the longest silent first, their silence until now included."""
        found: list[SavedVehicle] = []
        try:
            paths = self._paths()
        except OSError as error:
            self.count("refused", f"no checkpoint in {self._folder} is used: {error}; vehicles start anew")
            return []
        for path in paths:
            try:
                checkpoint = decode_checkpoint(_read(path))
            except Exception as error:  # whatever a file holds must not keep the service from starting
                self.count("refused", f"the checkpoint {path} is not used: {error}; its vehicle starts anew")
                with suppress(OSError):
                    path.unlink()
                continue
            self._files[path.name] = None
            saved = checkpoint.saved
            away_s = max(0.0, self._wall_clock() - checkpoint.saved_at_s)
            found.append(replace(saved, silent_s=saved.silent_s + away_s))
        return sorted(found, key=lambda saved: -saved.silent_s)

    def read(self, fleet: str, vehicle: str) -> SavedVehicle | None:
        """One vehicle's, whichever process has written it; None where there is none that can be used."""
        path = self._path(fleet, vehicle)
        try:
            return self.decoded(_read(path), str(path))
        except FileNotFoundError:
            return None
        except (OSError, CheckpointError) as error:
            self.count("refused", f"the checkpoint {path} is not used: {error}; its vehicle starts anew")
            return None

    def decoded(self, data: bytes, where: str) -> SavedVehicle | None:
        """A vehicle's, its silence until now included; None where it cannot be used, which is counted and said.

        Args:
            where: it comes from.
        """
        try:
            checkpoint = decode_checkpoint(data)
        except Exception as error:  # whatever it holds must not keep the vehicle from being watched
            self.count("refused", f"the checkpoint {where} is not used: {error}; its vehicle starts anew")
            return None
        away_s = max(0.0, self._wall_clock() - checkpoint.saved_at_s)
        return replace(checkpoint.saved, silent_s=checkpoint.saved.silent_s + away_s)

    def _path(self, fleet: str, vehicle: str) -> Path:
        name = hashlib.sha256(f"{fleet}/{vehicle}".encode()).hexdigest()[:32]
        return self._folder / f"{name}{_SUFFIX}"

    def _paths(self) -> list[Path]:
        """Files of checkpoints, written longest ago first; what is too many is removed, and what was not finished."""
        if not self._folder.is_dir():
            return []
        for left in self._folder.glob(f"*{_UNFINISHED}"):
            if not _is_being_written(left):
                left.unlink(missing_ok=True)
        paths = sorted(self._folder.glob(f"*{_SUFFIX}"), key=lambda path: path.stat().st_mtime_ns)
        for path in paths[: max(0, len(paths) - self._most)]:
            path.unlink(missing_ok=True)
        return paths[-self._most :]

    def _run(self) -> None:
        while True:
            self._news.wait()
            self._news.clear()
            ending = self._end
            while (checkpoint := self._next()) is not None:
                self._written(checkpoint)
            if ending:
                return

    def _next(self) -> Checkpoint | None:
        """What is to be written next, taken out of what waits."""
        with self._lock:
            self._in_hand = False
            key = next(iter(self._urgent), None) or next(iter(self._waiting), None)
            if key is None:
                return None
            self._urgent.pop(key, None)
            found = self._waiting.pop(key, None)
            self._in_hand = found is not None
            return found

    def _written(self, checkpoint: Checkpoint) -> None:
        saved = checkpoint.saved
        try:
            data = encode_checkpoint(checkpoint)
            with self._lock:
                if (saved.fleet, saved.vehicle) in self._handed_over:
                    self._handed_over[saved.fleet, saved.vehicle] = data
            with self._writing:
                self._write_file(self._path(saved.fleet, saved.vehicle), data)
        except Exception as error:  # a full disk, or a state that cannot be written, must not end this thread
            self.count("failed")
            problem = f"{type(error).__name__}: {error}"
            if problem != self._problem:
                _LOG.warning("a checkpoint of %s/%s is not written: %s", saved.fleet, saved.vehicle, problem)
            self._problem = problem
            return
        self._problem = None
        self.count("written")

    def _write_file(self, path: Path, data: bytes) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        unfinished = path.with_suffix(f".{os.getpid()}{_UNFINISHED}")
        with unfinished.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
        self._files.pop(path.name, None)
        self._files[path.name] = None
        while len(self._files) > self._most:
            oldest = next(iter(self._files))
            (self._folder / oldest).unlink(missing_ok=True)
            self._files.pop(oldest)


def _is_being_written(unfinished: Path) -> bool:
    """Whether another process of this machine may be writing a file: its number is the last part of the name."""
    number = unfinished.stem.rpartition(".")[2]
    if not number.isdigit() or int(number) == os.getpid():
        return False
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except OSError:  # of another user
        return True
    return True


def _read(path: Path) -> bytes:
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise CheckpointError("it is larger than any checkpoint")
    return data
