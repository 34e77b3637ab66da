"""A schema of its own on the PostgreSQL server that tests are given."""

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager

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
