"""A schema of its own on the PostgreSQL server that tests are given, and a server that freezes."""

import os
import signal
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from sqlalchemy import create_engine, make_url, text

VARIABLE = "WINGWATCH_TEST_POSTGRES_URL"


@contextmanager
def own_schema() -> Iterator[str]:
    """URL of a new schema, which is dropped at the end; skips where no server is given."""
    given = os.environ.get(VARIABLE, "")
    if not given:
        pytest.skip(f"{VARIABLE} names no PostgreSQL server to test against")
    schema = f"wingwatch_test_{uuid.uuid4().hex[:12]}"
    base = make_url(given).set(drivername="postgresql+psycopg")
    admin = create_engine(base)
    with admin.begin() as connection:
        connection.execute(text(f"CREATE SCHEMA {schema}"))
    try:
        yield base.update_query_dict({"options": f"-c search_path={schema}"}).render_as_string(
            hide_password=False
        )
    finally:
        with admin.begin() as connection:
            connection.execute(text(f"DROP SCHEMA {schema} CASCADE"))
        admin.dispose()


@contextmanager
def frozen(url: str) -> Iterator[None]:
    """The server's processes are stopped as by SIGSTOP, all of them; skips where they are not ours to stop."""
    admin = create_engine(make_url(url))
    with admin.connect() as connection:
        folder = str(connection.execute(text("SHOW data_directory")).scalar_one())
        pids = [
            int(pid) for pid in connection.execute(text("SELECT pid FROM pg_stat_activity")).scalars() if pid
        ]
    admin.dispose()
    try:
        postmaster = int((Path(folder) / "postmaster.pid").read_text().split()[0])
        os.kill(postmaster, signal.SIGSTOP)
    except (OSError, ValueError):
        pytest.skip("the PostgreSQL server is another user's or another machine's, and cannot be stopped")
    stopped = [postmaster]
    try:
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGSTOP)
                stopped.append(pid)
        yield
    finally:
        for pid in reversed(stopped):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
