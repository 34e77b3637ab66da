"""Backup and check of a database; neither changes it, so that one of an older schema stays as it is."""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, inspect, text

from wingwatch.baselines.connection import (
    DatabaseError,
    connect,
    head_revision,
    revision_of,
    sentences,
    sqlite_file,
)
from wingwatch.baselines.tables import Base

__all__ = ["StoreReport", "backup", "check"]

_PATIENCE_S = 5.0
_MOST_FAULTS = 5


@dataclass(frozen=True, slots=True)
class StoreReport:
    """What a check has found.

    Attributes:
        schema, newest: revision of the database, and the one that this program makes of it when a service starts.
        faults: of the file, as the database reports them; empty where it is sound.
        rows: by table.
        size_bytes: of the whole database.
    """

    schema: str | None
    newest: str
    faults: tuple[str, ...]
    rows: Mapping[str, int]
    size_bytes: int


def backup(where: str, to: Path) -> int:
    """Copy an SQLite database, also while a service writes to it; returns the copy's size in bytes.

    The copy is whole or not there: it is checked and synchronised to the disk before it gets its name.

    Raises:
        DatabaseError: a server's database, a target that exists, a database that cannot be read or a copy that is not
            sound.
    """
    engine = connect(where, _PATIENCE_S)
    try:
        if sqlite_file(engine) is None:
            raise DatabaseError("a PostgreSQL database is backed up by its own means; use pg_dump")
        if to.exists():
            raise DatabaseError(f"{to} exists already; give another name")
        part = to.with_name(f".{to.name}.part")
        with suppress(FileNotFoundError):
            part.unlink()
        try:
            with sentences(engine), engine.connect() as connection:
                driver = connection.connection.driver_connection
                assert driver is not None
                driver.execute("VACUUM INTO ?", (str(part),)).close()
            report = check(str(part))
            if report.faults:
                raise DatabaseError(
                    f"the copy is not sound ({report.faults[0]}); check the database and the disk"
                )
            with part.open("rb") as copied:
                os.fsync(copied.fileno())
            part.rename(to)
        finally:
            for end in ("", "-wal", "-shm"):
                Path(f"{part}{end}").unlink(missing_ok=True)
        return to.stat().st_size
    finally:
        engine.dispose()


def check(where: str) -> StoreReport:
    """Read the whole database and say whether it is sound.

    Raises:
        DatabaseError: it cannot be read at all.
    """
    engine = connect(where, _PATIENCE_S)
    try:
        with sentences(engine), engine.connect() as connection:
            if connection.dialect.name == "postgresql":
                connection.execute(text("SET statement_timeout = 0"))
            there = set(inspect(connection).get_table_names())
            rows = {
                name: int(connection.execute(text(f"SELECT count(*) FROM {name}")).scalar_one())
                for name in sorted(there & set(Base.metadata.tables))
            }
            faults, size = _faults_and_size(connection)
            return StoreReport(revision_of(connection), head_revision(), faults, rows, size)
    finally:
        engine.dispose()


def _faults_and_size(connection: Connection) -> tuple[tuple[str, ...], int]:
    if connection.dialect.name == "postgresql":
        size = connection.execute(text("SELECT pg_database_size(current_database())")).scalar_one()
        return (), int(size)
    said = connection.execute(text(f"PRAGMA integrity_check({_MOST_FAULTS})")).scalars().all()
    broken = connection.execute(text("PRAGMA foreign_key_check")).all()
    faults = [str(line) for line in said if line != "ok"]
    faults += [
        f"table {row[0]} points at a row of {row[2]} that is not there" for row in broken[:_MOST_FAULTS]
    ]
    pages = connection.execute(text("PRAGMA page_count")).scalar_one()
    return tuple(faults), int(pages) * int(connection.execute(text("PRAGMA page_size")).scalar_one())
