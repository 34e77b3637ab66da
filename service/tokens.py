"""REST tokens, kept as hashes in one file of the data folder; made and withdrawn while a service runs."""

import fcntl
import hashlib
import json
import logging
import os
import secrets
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wingwatch.api import Caller, TokenScope
from wingwatch.operations.faults import CommandError
from wingwatch.telemetry.keys import check_name

__all__ = ["TokenEntry", "TokenFile", "TokenRegister"]

_LOG = logging.getLogger(__name__)
_FILE = "tokens.json"
_MOST_BYTES = 1_000_000
_RANDOM_BYTES = 32
_PREFIX = "ww_"


class TokenEntry(BaseModel):
    """One token, without the token itself.

    Attributes:
        sha256: of the token's text. It has 256 random bits, so a slow hash would protect it no better.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,62}$")
    scope: TokenScope
    created_at: str
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


class _Document(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    format: int = Field(ge=1, le=1)
    tokens: tuple[TokenEntry, ...]


class TokenFile:
    """The file of one data folder.

    Args:
        folder: of the data; made where it is missing once a token is.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / _FILE

    def entries(self) -> tuple[TokenEntry, ...]:
        """Every token, oldest first; none without a file.

        Raises:
            CommandError: a file that cannot be used.
        """
        try:
            with self.path.open("rb") as file:
                return _Document.model_validate_json(file.read(_MOST_BYTES)).tokens
        except FileNotFoundError:
            return ()
        except OSError as error:
            reason = (error.strerror or "unreadable").lower()
            raise CommandError(f"{self.path}: {reason}; let the service's user read it") from None
        except ValidationError as error:
            what = error.errors(include_url=False)[0]["msg"]
            raise CommandError(
                f"{self.path} is no file of tokens ({what}); restore it, or remove it and make new tokens"
            ) from None

    def create(self, name: str, scope: TokenScope) -> str:
        """Make a token; its text is nowhere kept.

        Raises:
            CommandError: the name is taken, or the file cannot be used.
            KeyNameError: it is no name.
        """
        check_name("token", name)
        token = _PREFIX + secrets.token_urlsafe(_RANDOM_BYTES)
        now = datetime.now(UTC).isoformat(timespec="seconds")
        with self._held():
            known = self.entries()
            if any(entry.name == name for entry in known):
                raise CommandError(
                    f"there is a token {name!r} already; choose another name, or revoke it first"
                )
            self._write((*known, TokenEntry(name=name, scope=scope, created_at=now, sha256=_hash(token))))
        return token

    def revoke(self, name: str) -> None:
        """Withdraw a token; a service that runs refuses it from now on.

        Raises:
            CommandError: there is none of this name, or the file cannot be used.
        """
        with self._held():
            known = self.entries()
            kept = tuple(entry for entry in known if entry.name != name)
            if len(kept) == len(known):
                names = ", ".join(entry.name for entry in known) or "none"
                raise CommandError(f"there is no token {name[:80]!r} in {self.path}; it has {names}")
            self._write(kept)

    @contextmanager
    def _held(self) -> Iterator[None]:
        """Two who change the file at once come one after the other."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        lock = os.open(self.path.parent, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield
        finally:
            os.close(lock)

    def _write(self, entries: tuple[TokenEntry, ...]) -> None:
        """All or nothing: whoever reads meanwhile, or after a crash, finds the old file or the new one."""
        document = _Document(format=1, tokens=entries).model_dump(mode="json")
        handle, name = tempfile.mkstemp(dir=self.path.parent, prefix=f"{_FILE}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(json.dumps(document, indent=1) + "\n")
                file.flush()
                os.fsync(file.fileno())
            Path(name).replace(self.path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise


@dataclass(frozen=True, slots=True)
class _Seen:
    """The file as it was when it was read last."""

    stamp: tuple[int, int, int] | None
    callers: Mapping[str, Caller]
    problem: str | None


class TokenRegister:
    """Whose token a request carries, by the file as it is now. Read again whenever it changes.

    A file that cannot be used permits nobody, and readiness says so.
    """

    def __init__(self, file: TokenFile) -> None:
        self._file = file
        self._seen = _Seen(None, {}, None)

    @property
    def problem(self) -> str | None:
        """Why no token can be checked; None while they can."""
        self._look()
        return self._seen.problem

    def require_some(self) -> None:
        """For a service that others can reach.

        Raises:
            CommandError: there is no token, or the file cannot be used.
        """
        if self._file.entries():
            return
        folder = self._file.path.parent
        raise CommandError(
            "others can reach this address, and there is no token yet: make one with "
            f"`wingwatch token create NAME --scope operate --data {folder}`, or use --host 127.0.0.1"
        )

    def find(self, token: str) -> Caller | None:
        """Whose token this is; None for one that is none of ours."""
        self._look()
        return self._seen.callers.get(_hash(token))

    def _look(self) -> None:
        stamp, problem = self._stamp()
        if stamp == self._seen.stamp and problem is None and self._seen.problem is None:
            return
        callers: dict[str, Caller] = {}
        if problem is None:
            try:
                entries = self._file.entries()
                callers = {entry.sha256: Caller(entry.name, entry.scope) for entry in entries}
            except CommandError as error:
                problem = f"{error}."
        if problem is not None and problem != self._seen.problem:
            _LOG.error("no token is accepted: %s", problem)
        self._seen = _Seen(stamp, callers, problem)

    def _stamp(self) -> tuple[tuple[int, int, int] | None, str | None]:
        try:
            found = self._file.path.stat()
        except FileNotFoundError:
            return None, None
        except OSError as error:
            return None, f"{self._file.path}: {(error.strerror or 'unreadable').lower()}."
        return (found.st_ino, found.st_mtime_ns, found.st_size), None


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
