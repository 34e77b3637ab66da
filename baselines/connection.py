"""Opens the database: engine, pragmas, migration to the newest schema, and errors as one clear sentence.

SQLite begins its transactions by our own statements: the driver's implicit ones would commit before a
schema change, and a transaction that reads first and writes later fails under WAL where it should wait.

alembic is loaded by a database that needs a migration alone: a look at one that is up to date starts without.
"""

import os
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from sqlalchemy import URL, Connection, Engine, create_engine, event, inspect, make_url, text
from sqlalchemy.exc import ArgumentError, DataError, DBAPIError, IntegrityError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.orm import Session

__all__ = [
    "DatabaseError",
    "RefusedError",
    "check_answers",
    "connect",
    "head_revision",
    "inserting",
    "one_writer",
    "revision_of",
    "sentences",
    "sqlite_file",
    "upgrade",
    "writing",
]

VERSION_TABLE = "wingwatch_schema"
"""Where the revision stands: a name of our own, so that another program's tables are distinguished from ours."""

CONNECT_TIMEOUT_S = 5
"""How long a PostgreSQL server may take to answer a new connection."""

STATEMENT_TIMEOUT_S = 10.0
"""How long PostgreSQL may work on one statement; migrations may take longer."""

_LOST_SERVER = {
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 10_000,
}
"""A server that left the network without a word is given up after some 10 s, not after the system's 15 minutes."""

_WRITER_LOCK = 0x77696E67
"""Key of the PostgreSQL advisory lock of ``one_writer`` (ASCII "wing")."""

_MIGRATIONS = Path(__file__).parent / "migrations"
_WRITE = "wingwatch_write"
_DURABLE = "wingwatch_durable"

_LOCKED = "is locked by another program; end that program or try again"
_READ_ONLY = "is read-only for this user; make the file and its folder writable, or choose another path"
_SQLITE_FAULTS = {
    "SQLITE_BUSY": _LOCKED,
    "SQLITE_LOCKED": _LOCKED,
    "SQLITE_READONLY": _READ_ONLY,
    "SQLITE_PERM": _READ_ONLY,
    "SQLITE_CANTOPEN": "cannot be opened; check that its folder exists and is writable for this user",
    "SQLITE_NOTADB": "is not an SQLite database; choose another path or move that file away",
    "SQLITE_CORRUPT": "is damaged; restore it from a copy, or move it away to start anew",
    "SQLITE_FULL": "cannot grow because the disk is full; free some space",
    "SQLITE_IOERR": "cannot be read or written because the disk reports an error; check the disk",
}
_POSTGRES_FAULTS = {
    "55P03": _LOCKED,
    "57014": "took too long to answer and was asked to stop; try again",
    "25006": "accepts no writes; connect to the primary server, not to a read-only copy",
    "42501": "forbids this user to write; grant the user rights on the schema",
    "53100": "cannot grow because its disk is full; free some space",
}


class DatabaseError(RuntimeError):
    """The database cannot do what was asked; the text is one sentence for the operator."""


class RefusedError(DatabaseError):
    """The database works and will not take this entry; trying again helps at most once."""


def connect(where: str | os.PathLike[str], busy_timeout_s: float) -> Engine:
    """Engine for a path of an SQLite file, or for a URL ``sqlite:///...`` or ``postgresql://...``.

    The folder of an SQLite file is made if need be. Nothing is read yet.

    Raises:
        DatabaseError: a URL of another kind, a driver that is not installed, a folder that cannot be made.
    """
    url = _url(where)
    if url.get_backend_name() == "sqlite":
        _prepare_file(url)
        engine = create_engine(url, pool_timeout=busy_timeout_s)
        event.listen(engine, "connect", _sqlite_session(busy_timeout_s))
        event.listen(engine, "begin", _sqlite_begin)
        return engine
    limits = {"lock_timeout": busy_timeout_s, "statement_timeout": STATEMENT_TIMEOUT_S}
    wanted = (str(url.query.get("options", "")), *(f"-c {k}={int(1000 * s)}" for k, s in limits.items()))
    try:
        return create_engine(
            url,
            pool_pre_ping=True,
            pool_timeout=busy_timeout_s,
            connect_args={
                "connect_timeout": CONNECT_TIMEOUT_S,
                **_LOST_SERVER,
                "options": " ".join(wanted).strip(),
            },
        )
    except ModuleNotFoundError as error:
        raise DatabaseError(
            "PostgreSQL needs the package psycopg, which is not installed; install wingwatch[postgres]"
        ) from error


def writing(engine: Engine, durable: bool = False) -> Engine:
    """The same engine for transactions that write: on SQLite they take the write lock when they begin.

    Args:
        durable: whether what is committed survives a power cut on SQLite, too, at the price of waiting for the disk.
    """
    return engine.execution_options(**{_WRITE: True, _DURABLE: durable})


def one_writer(connection: Connection) -> None:
    """Wait until no other transaction has passed here: for reading first and writing what follows from it.

    SQLite's transactions that write are alone already.
    """
    if connection.dialect.name == "postgresql":
        connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _WRITER_LOCK})


def inserting(session: Session) -> Any:
    """``insert`` of a session's kind of database, which says what a conflict does; only that kind is loaded."""
    name = session.connection().dialect.name
    return import_module(f"sqlalchemy.dialects.{'postgresql' if name == 'postgresql' else 'sqlite'}").insert


def sqlite_file(engine: Engine) -> Path | None:
    """The file of an SQLite database, None for a server."""
    is_file = engine.url.get_backend_name() == "sqlite"
    return Path(str(engine.url.database)) if is_file else None


def head_revision() -> str:
    """The newest revision that this code knows."""
    return _known_revisions(_MIGRATIONS)[0]


@cache
def _known_revisions(migrations: Path) -> tuple[str, ...]:
    """All revisions of a folder, newest first."""
    # one after another, each in a file v<revision>_<what>.py
    files = sorted((migrations / "versions").glob("v[0-9]*_*.py"), reverse=True)
    known = tuple(file.name[1:].split("_", 1)[0] for file in files)
    if not known:
        raise DatabaseError("this installation lacks its database migrations; install wingwatch again")
    return known


def upgrade(engine: Engine) -> None:
    """Bring the schema to the newest revision, all in one transaction.

    Raises:
        DatabaseError: a schema newer than this code, another program's database, or a fault of the database.
    """
    with sentences(engine), writing(engine).begin() as connection:
        if connection.dialect.name == "postgresql":
            connection.execute(text("SET LOCAL statement_timeout = 0"))
        one_writer(connection)
        current = revision_of(connection)
        head = head_revision()
        if current == head:
            return
        _refuse_foreign(engine, connection, current, head)
        from alembic import command
        from alembic.config import Config

        config = Config(attributes={"connection": connection, "version_table": VERSION_TABLE})
        config.set_main_option("script_location", str(_MIGRATIONS).replace("%", "%%"))
        command.upgrade(config, "head")


def check_answers(engine: Engine, inode: int | None) -> None:
    """Read the schema's revision and make sure that a write would be taken, without writing.

    SQLite's write lock is taken for a moment, and waited for as every write waits: a write that is under way is no
    fault.

    Args:
        inode: of the SQLite file when it was opened; None for a server.

    Raises:
        DatabaseError: if not, saying why.
    """
    path = sqlite_file(engine)
    if path is not None:
        _check_file(path, inode)
    with sentences(engine), writing(engine).connect() as connection:
        if path is None and connection.execute(text("SHOW transaction_read_only")).scalar_one() != "off":
            raise DatabaseError(f"{_name(engine)} {_POSTGRES_FAULTS['25006']}")
        found, head = revision_of(connection), head_revision()
    if found != head:
        raise DatabaseError(
            f"{_name(engine)} now has schema {found}, but this program has schema {head}; "
            "restart with the newest wingwatch"
        )


@contextmanager
def sentences(engine: Engine) -> Iterator[None]:
    """Turns faults of the database inside the block into ``DatabaseError``, one sentence each."""
    try:
        yield
    except DataError as error:
        raise RefusedError(f"{_name(engine)} cannot hold that entry ({_first_line(error)})") from error
    except IntegrityError as error:
        raise RefusedError(
            f"{_name(engine)} already holds that entry, or another program wrote it at the same moment; "
            f"try again ({_first_line(error)})"
        ) from error
    except DBAPIError as error:
        raise DatabaseError(f"{_name(engine)} {_fault(engine, error)}") from error
    except PoolTimeoutError as error:
        raise DatabaseError(
            f"{_name(engine)} is asked by too many threads at once; try again, or ask it less often"
        ) from error


def _url(where: str | os.PathLike[str]) -> URL:
    given = os.fspath(where)
    if "://" not in given:
        return URL.create("sqlite", database=str(Path(given).expanduser().absolute()))
    try:
        url = make_url(given)
    except (ArgumentError, ValueError) as error:
        scheme = given.split("://", 1)[0]  # the rest may hold a password
        raise DatabaseError(
            f"the database URL that begins with {scheme}:// cannot be understood; "
            "write sqlite:///path/to/file.db or postgresql://user:password@host/name"
        ) from error
    if url.drivername in ("postgresql", "postgres", "postgresql+psycopg"):
        return url.set(drivername="postgresql+psycopg")
    if url.drivername != "sqlite":
        raise DatabaseError(
            f"databases of the kind {url.drivername!r} are not supported; use sqlite or postgresql"
        )
    if not url.database or url.database == ":memory:" or url.database.startswith("file:"):
        raise DatabaseError(
            "the SQLite database must be a file, since one in memory is not shared by threads; give its path"
        )
    return url.set(database=str(Path(url.database).absolute()))


def _prepare_file(url: URL) -> None:
    path = Path(str(url.database))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        mode = path.stat().st_mode if path.exists() else stat.S_IFREG
    except OSError as error:
        raise DatabaseError(
            f"the folder of the database {path} cannot be used ({error.strerror}); choose another path"
        ) from error
    if not stat.S_ISREG(mode):
        raise DatabaseError(f"the database {path} is a folder or a device, not a file; choose another path")


def _sqlite_session(busy_timeout_s: float) -> Any:
    def session(connection: sqlite3.Connection, _record: object) -> None:
        connection.isolation_level = None
        for pragma in (
            f"busy_timeout = {int(1000 * busy_timeout_s)}",
            "journal_mode = WAL",
            "synchronous = NORMAL",
            "foreign_keys = ON",
        ):
            connection.execute(f"PRAGMA {pragma}").close()

    return session


def _sqlite_begin(connection: Connection) -> None:
    options = connection.get_execution_options()
    writes = options.get(_WRITE, False)
    if writes:
        connection.exec_driver_sql(f"PRAGMA synchronous = {'FULL' if options.get(_DURABLE) else 'NORMAL'}")
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def _check_file(path: Path, inode: int | None) -> None:
    """A file deleted or replaced while open still takes writes, which then are lost."""
    if not path.exists() or path.stat().st_ino != inode:
        raise DatabaseError(f"the database {path} was moved or deleted while open; restart wingwatch")
    effective = os.access in os.supports_effective_ids
    if not all(os.access(place, os.W_OK, effective_ids=effective) for place in (path, path.parent)):
        raise DatabaseError(f"the database {path} {_READ_ONLY}")


def revision_of(connection: Connection) -> str | None:
    """Revision of a database's schema; None where it has none."""
    if not inspect(connection).has_table(VERSION_TABLE):
        return None
    found = connection.execute(text(f"SELECT version_num FROM {VERSION_TABLE}")).scalar_one_or_none()
    return None if found is None else str(found)


def _refuse_foreign(engine: Engine, connection: Connection, current: str | None, head: str) -> None:
    if current is not None and current not in _known_revisions(_MIGRATIONS):
        raise DatabaseError(
            f"{_name(engine)} has schema {current}, newer than schema {head} of this program; "
            "install the newer wingwatch that wrote it, or choose another database"
        )
    if current is None and engine.dialect.name == "sqlite":
        tables = sorted(set(inspect(connection).get_table_names()) - {VERSION_TABLE})
        if tables:
            raise DatabaseError(
                f"{_name(engine)} belongs to another program (it has the table {tables[0]!r}); "
                "choose another path"
            )


def _name(engine: Engine) -> str:
    path = sqlite_file(engine)
    return f"the database {path or engine.url.set(query={}).render_as_string(hide_password=True)}"


def _first_line(error: DBAPIError) -> str:
    lines = str(error.orig).strip().splitlines()
    return lines[0].strip() if lines else type(error.orig).__name__


def _fault(engine: Engine, error: DBAPIError) -> str:
    """The part of the sentence after the database's name."""
    if engine.dialect.name == "sqlite":
        code = str(getattr(error.orig, "sqlite_errorname", ""))
        for prefix, fault in _SQLITE_FAULTS.items():
            if code == prefix or code.startswith(prefix + "_"):
                return fault
        return f"reports: {_first_line(error)}"
    state = getattr(error.orig, "sqlstate", None)
    if state in _POSTGRES_FAULTS:
        return _POSTGRES_FAULTS[state]
    if state is None or str(state).startswith(("08", "57P")):
        return f"cannot be reached ({_first_line(error)}); start the server or correct the address"
    return f"reports: {_first_line(error)}"
