"""A database that cannot be used is refused in one sentence that says what to do."""

import os
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from multiprocessing import get_context
from pathlib import Path

import pytest
from sqlalchemy import event

from wingwatch.baselines import (
    ActionRecord,
    AlertRecord,
    DatabaseError,
    ExpectationRecord,
    open_database,
)
from wingwatch.baselines.connection import head_revision

NOBODY = 65534
ALERT = AlertRecord(
    id="a1", fleet="default", vehicle="uav-1", kind="icing", cause="icing", level="warning", state="active",
    raised_s=61.0, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97, basis="a-priori", text="Ice.",
    evidence=(), created_at_s=1.0, updated_at_s=1.0,
)  # fmt: skip


def entry() -> ExpectationRecord:
    return ExpectationRecord(
        "a", "clean", "short_period", 25.0, 0.0, 1.2, 0.0, (1.0,), ((1.0,),), "identified", "", 1.0
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """An existing database that nobody has open."""
    where = tmp_path / "wingwatch.db"
    open_database(where).close()
    return where


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that any user may enter (pytest's own may not be)."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o777)
        yield Path(name)


@contextmanager
def ordinary_user() -> Iterator[None]:
    """Root may write anything, so a test of permissions must not be root."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(0)


def sentence(action: Callable[[], object]) -> str:
    """The error's text, which must be one line."""
    with pytest.raises(DatabaseError) as caught:
        action()
    said = str(caught.value)
    assert "\n" not in said
    assert len(said) < 300
    return said


def test_a_lock_of_another_program_is_waited_for_and_then_named(path: Path) -> None:
    with open_database(path, busy_timeout_s=0.2) as database, closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN EXCLUSIVE")
        said = sentence(lambda: database.put_expectation(entry()))
        assert said == f"the database {path} is locked by another program; end that program or try again"
        assert "is locked" in sentence(database.check)
        other.rollback()
        database.check()
        assert database.put_expectation(entry()).id == 1


def test_a_locked_database_cannot_be_opened(tmp_path: Path) -> None:
    path = tmp_path / "new.db"
    with closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN EXCLUSIVE")
        assert f"{path} is locked" in sentence(lambda: open_database(path, busy_timeout_s=0.2))
    open_database(path).close()


def test_a_read_only_file_is_refused(folder: Path) -> None:
    path = folder / "wingwatch.db"
    open_database(path).close()
    path.chmod(0o444)
    folder.chmod(0o555)
    with ordinary_user():
        said = sentence(lambda: write_once(path))
    assert "is read-only for this user; make the file and its folder writable" in said


def write_once(path: Path) -> None:
    with open_database(path) as database:
        database.put_expectation(entry())


def test_a_new_database_in_a_read_only_folder_is_refused(folder: Path) -> None:
    folder.chmod(0o555)
    with ordinary_user():
        said = sentence(lambda: open_database(folder / "wingwatch.db"))
    assert "cannot be opened; check that its folder exists and is writable" in said


def test_a_folder_that_cannot_be_made_is_refused(folder: Path) -> None:
    folder.chmod(0o555)
    with ordinary_user():
        said = sentence(lambda: open_database(folder / "deep" / "wingwatch.db"))
    assert "cannot be used (Permission denied); choose another path" in said


def test_a_file_that_turns_read_only_fails_the_check(folder: Path) -> None:
    path = folder / "wingwatch.db"
    with open_database(path) as database:
        path.chmod(0o444)
        with ordinary_user():
            assert "is read-only for this user" in sentence(database.check)
        path.chmod(0o666)
        Path(f"{path}-wal").chmod(0o666)
        database.check()


def test_a_newer_schema_is_refused_with_both_revisions(path: Path) -> None:
    with closing(sqlite3.connect(path)) as other:
        other.execute("UPDATE wingwatch_schema SET version_num = '9999'")
        other.commit()
    said = sentence(lambda: open_database(path))
    assert f"has schema 9999, newer than schema {head_revision()} of this program" in said
    assert "install the newer wingwatch" in said
    with closing(sqlite3.connect(path)) as other:
        assert other.execute("SELECT version_num FROM wingwatch_schema").fetchall() == [("9999",)]


def test_a_schema_upgraded_under_a_running_program_fails_the_check(path: Path) -> None:
    with open_database(path) as database, closing(sqlite3.connect(path)) as other:
        other.execute("UPDATE wingwatch_schema SET version_num = '9999'")
        other.commit()
        assert "now has schema 9999" in sentence(database.check)


def test_a_file_that_is_no_database_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    path.write_text("time_s,pitch_rate_rad_s\n" * 100)
    said = sentence(lambda: open_database(path))
    assert said == (
        f"the database {path} is not an SQLite database; choose another path or move that file away"
    )
    assert path.read_text() == "time_s,pitch_rate_rad_s\n" * 100


def test_a_database_of_another_program_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "photos.db"
    with closing(sqlite3.connect(path)) as other:
        other.execute("CREATE TABLE album (id INTEGER)")
    assert "belongs to another program (it has the table 'album')" in sentence(lambda: open_database(path))
    with closing(sqlite3.connect(path)) as other:
        assert other.execute("SELECT name FROM sqlite_master").fetchall() == [("album",)]


def test_a_damaged_database_is_named_as_such(path: Path) -> None:
    with open_database(path) as database:
        for _ in range(50):
            database.put_expectation(entry())
    content = path.read_bytes()
    page = 4096
    path.write_bytes(content[:page] + b"\xff" * (len(content) - page))
    assert f"{path} is damaged; restore it from a copy" in sentence(lambda: write_once(path))


def test_a_truncated_database_is_named_as_such(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:6000])
    assert f"{path} is damaged" in sentence(lambda: write_once(path))


def test_a_deleted_database_fails_the_check(path: Path) -> None:
    with open_database(path) as database:
        path.unlink()
        assert "was moved or deleted while open" in sentence(database.check)


def test_a_replaced_database_fails_the_check(path: Path, tmp_path: Path) -> None:
    with open_database(path) as database:
        open_database(tmp_path / "other.db").close()
        (tmp_path / "other.db").rename(path)
        assert "was moved or deleted while open" in sentence(database.check)


def test_a_check_writes_nothing(path: Path) -> None:
    with open_database(path) as database, closing(sqlite3.connect(path)) as other:
        before = other.execute("PRAGMA data_version").fetchone()
        database.check()
        assert other.execute("PRAGMA data_version").fetchone() == before
        database.put_expectation(entry())
        assert other.execute("PRAGMA data_version").fetchone() != before


def test_a_closed_database_says_so(path: Path) -> None:
    database = open_database(path)
    database.close()
    assert sentence(database.alerts) == "the database is closed; open it again"
    assert sentence(database.check) == "the database is closed; open it again"


def test_a_failed_write_leaves_nothing_behind(path: Path) -> None:
    with open_database(path) as database:
        database.put_expectation(entry())
        with closing(sqlite3.connect(path)) as other:
            other.execute(
                "CREATE TRIGGER stop BEFORE INSERT ON expectation BEGIN SELECT RAISE(ABORT, 'no'); END"
            )
        assert "database" in sentence(lambda: database.put_expectation(entry()))
        (kept,) = database.history("a", "clean", "short_period")
        assert kept.superseded_by is None


def test_an_upgrade_that_fails_half_way_leaves_an_empty_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "new.db"
    broken = tmp_path / "migrations"
    ours = Path(sys.modules["wingwatch.baselines.connection"].__file__ or "").parent / "migrations"
    (broken / "versions").mkdir(parents=True)
    (broken / "env.py").write_text((ours / "env.py").read_text())
    first = (ours / "versions" / "v0001_first_tables.py").read_text()
    halfway = first.replace("    _alert()\n", "    raise KeyboardInterrupt\n")
    assert halfway != first
    (broken / "versions" / "v0001_first_tables.py").write_text(halfway)
    with monkeypatch.context() as patch:
        patch.setattr("wingwatch.baselines.connection._MIGRATIONS", broken)
        with pytest.raises(KeyboardInterrupt):
            open_database(path)
    with closing(sqlite3.connect(path)) as other:
        assert other.execute("SELECT name FROM sqlite_master").fetchall() == []
    with open_database(path) as database:
        database.check()


def open_and_say(path: str, said: "object") -> None:
    try:
        open_database(path).close()
        said.put("opened")  # type: ignore[attr-defined]
    except BaseException as fault:
        said.put(repr(fault))  # type: ignore[attr-defined]


def test_several_programs_may_open_a_new_database_at_once(tmp_path: Path) -> None:
    spawn = get_context("spawn")
    said = spawn.Queue()
    programs = [spawn.Process(target=open_and_say, args=(str(tmp_path / "n.db"), said)) for _ in range(3)]
    for program in programs:
        program.start()
    assert [said.get(timeout=60) for _ in programs] == ["opened"] * 3
    for program in programs:
        program.join()


@pytest.mark.parametrize(
    ("where", "what"),
    [
        ("mysql://root@localhost/x", "databases of the kind 'mysql' are not supported"),
        ("sqlite://", "must be a file"),
        ("sqlite:///:memory:", "must be a file"),
        ("postgresql://user:secret@host:port/x", "begins with postgresql:// cannot be understood"),
        ("postgresql://user:secret@127.0.0.1:1/x", "127.0.0.1:1/x cannot be reached"),
    ],
)
def test_a_url_that_leads_nowhere_is_refused_without_its_password(where: str, what: str) -> None:
    said = sentence(lambda: open_database(where))
    assert what in said
    assert "secret" not in said


def test_a_folder_is_no_database(tmp_path: Path) -> None:
    assert "is a folder or a device, not a file" in sentence(lambda: open_database(tmp_path))


def test_postgres_without_its_driver_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    said = sentence(lambda: open_database("postgresql://user@127.0.0.1/x"))
    assert "install wingwatch[postgres]" in said


def test_settings_that_make_no_sense_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        open_database(tmp_path / "x.db", busy_timeout_s=0.0)


def test_alerts_and_actions_wait_for_the_disk_and_the_rest_does_not(tmp_path: Path) -> None:
    """What was announced must survive a power cut; what flights teach may lose its last seconds."""
    with open_database(tmp_path / "w.db") as database:
        seen: list[int] = []
        event.listen(
            database._engine,
            "commit",
            lambda connection: seen.append(connection.exec_driver_sql("PRAGMA synchronous").scalar_one()),
        )
        database.save_alert(ALERT)
        database.save_action(ALERT, ActionRecord("k", ALERT.id, "acknowledge", "ann", "", 1.0))
        database.void_action("k", ALERT)
        database.forget_actions(0.0)
    assert seen == [2, 2, 2, 1]
