"""What all tests share: kernels that one of the processes that test compiles for all, and databases of each kind."""

import contextlib
import fcntl
import gc
import os
import shutil
import uuid
from collections.abc import Callable, Generator, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import create_engine, make_url, text

from wingwatch.baselines import Database, open_database

POSTGRES_URL = os.environ.get("WINGWATCH_TEST_POSTGRES_URL", "")
_LOCKED: set[Path] = set()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """No garbage is looked for while thousands of modules and tests are made, and none in them afterwards."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@contextlib.contextmanager
def _alone(file: Path) -> Iterator[None]:
    """No other process is here at the same time; who is here already may come again."""
    if file in _LOCKED:
        yield
        return
    held = os.open(file, os.O_RDWR | os.O_CREAT, 0o600)
    _LOCKED.add(file)
    try:
        fcntl.flock(held, fcntl.LOCK_EX)
        yield
    finally:
        _LOCKED.discard(file)
        os.close(held)


@pytest.fixture(scope="session", autouse=True)
def _each_kernel_is_compiled_once() -> Iterator[None]:
    """Others wait for it and load it; compiled by three at once, some cost each of them half a minute."""
    dispatcher: Any = import_module("numba.core.dispatcher").Dispatcher
    compiler_lock: Any = import_module("numba.core.compiler_lock").global_compiler_lock
    plain = dispatcher.compile

    def compile_alone(self: Any, signature: object) -> Any:
        folder = self._cache.cache_path
        if folder is None or not Path(folder).is_dir():  # not cached, or nothing in this folder yet
            return plain(self, signature)
        # numba's own lock first: a thread that had it and waited for ours would wait for ever
        with compiler_lock, _alone(Path(folder) / f"{self.py_func.__qualname__}.lock"):
            return plain(self, signature)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dispatcher, "compile", compile_alone)
        yield


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """A folder of a name, which one of the processes that test fills for all; nobody changes it afterwards."""
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own

    def of_name(name: str, fill: Callable[[Path], object]) -> Path:
        with _alone(shared / f"{name}.lock"):
            if not (shared / f"{name}.made").exists():
                shutil.rmtree(shared / name, ignore_errors=True)  # what a failure has left
                fill(shared / name)
                (shared / f"{name}.made").touch()
        return shared / name

    return of_name


@pytest.fixture(params=["sqlite", "postgres"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """A database of each kind, new for each test."""
    if request.param == "sqlite":
        yield str(tmp_path / "folder" / "wingwatch.db")
        return
    if not POSTGRES_URL:
        pytest.skip("WINGWATCH_TEST_POSTGRES_URL names no PostgreSQL server to test against")
    schema = f"wingwatch_test_{uuid.uuid4().hex[:12]}"
    base = make_url(POSTGRES_URL).set(drivername="postgresql+psycopg")
    admin = create_engine(base)
    with admin.begin() as connection:
        connection.execute(text(f"CREATE SCHEMA {schema}"))
    own = base.update_query_dict({"options": f"-c search_path={schema}"})
    yield own.render_as_string(hide_password=False)
    with admin.begin() as connection:
        connection.execute(text(f"DROP SCHEMA {schema} CASCADE"))
    admin.dispose()


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    with open_database(url) as opened:
        yield opened
