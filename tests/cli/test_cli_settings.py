"""Settings of the service: defaults, file, environment, flags, in that order."""

from pathlib import Path

import pytest

from wingwatch.cli.arguments import build_parser
from wingwatch.operations.faults import CommandError
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.service.settings import DATABASE_VARIABLE, ServeSettings, serve_settings

LIBRARY = ("aerosonde", "aerosonde-a", "jetstream31", "twinotter", "ultrastick25e")


def settings(*flags: str, **environment: str) -> ServeSettings:
    return serve_settings(build_parser("0").parse_args(["serve", *flags]), environment)


def test_defaults_are_loopback_and_a_local_folder() -> None:
    given = settings()
    assert (given.host, given.port, given.listen, given.connect) == ("127.0.0.1", 8000, (), ())
    assert given.where == str(Path("data") / "wingwatch.db")


def test_flags_go_before_the_environment_before_the_file(tmp_path: Path) -> None:
    file = tmp_path / "service.toml"
    file.write_text(
        'port = 8100\nhost = "0.0.0.0"\ndata = "kept"\nlisten = "tcp/127.0.0.1:7500"\n'
        'aircraft = ["mine.toml"]\ndatabase = "sqlite:///file.db"\nstale_s = 2.5\n'
    )
    given = settings("--config", str(file), "--port", "8200", "--listen", "tcp/a:1", "--listen", "tcp/b:2")
    assert (given.port, given.host, given.stale_s) == (8200, "0.0.0.0", 2.5)
    assert given.listen == ("tcp/a:1", "tcp/b:2")
    assert given.data == tmp_path / "kept"
    assert given.aircraft == (tmp_path / "mine.toml",)
    assert given.where == "sqlite:///file.db"
    url = "postgresql://wingwatch@database/wingwatch"
    assert settings("--config", str(file), **{DATABASE_VARIABLE: url}).where == url


def test_an_empty_database_variable_counts_as_not_set(tmp_path: Path) -> None:
    """Compose files hand over what is not set as an empty text."""
    assert settings("--data", str(tmp_path), **{DATABASE_VARIABLE: ""}).where == str(
        tmp_path / "wingwatch.db"
    )


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("prot = 8000", "prot is no setting; known are host, port"),
        ('port = "http"', "port is 'http'"),
        ("port = 70000", "port is 70000"),
        ("stale_s = 0", "stale_s is 0"),
        ("port = ", "not valid TOML"),
        ("host = 'a\xff'".encode("latin-1"), "not UTF-8"),
    ],
)
def test_a_wrong_file_is_told_in_a_sentence(tmp_path: Path, content: str | bytes, words: str) -> None:
    file = tmp_path / "service.toml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(CommandError, match=words) as refused:
        settings("--config", str(file))
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_absent_file_and_a_wrong_flag_are_told(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="no such file"):
        settings("--config", str(tmp_path / "none.toml"))
    with pytest.raises(CommandError, match="port is 70000"):
        settings("--port", "70000")


def test_the_registry_finds_library_and_files_by_name(tmp_path: Path) -> None:
    file = tmp_path / "anything.toml"
    file.write_text('format = 1\nname = "mine"\n')
    registry = AircraftRegistry((file,))
    assert registry.names == tuple(sorted((*LIBRARY, "mine")))
    assert registry.find("mine").name == "mine"
    assert registry.find("aerosonde").name == "aerosonde"


def test_a_name_from_the_network_opens_no_file(tmp_path: Path) -> None:
    file = tmp_path / "secret.toml"
    file.write_text('format = 1\nname = "secret"\n')
    for name in (str(file), "secret", "../aerosonde", ""):
        with pytest.raises(ValueError, match="is not known here"):
            AircraftRegistry().find(name)


def test_two_aircraft_of_one_name_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "other.toml"
    file.write_text('format = 1\nname = "aerosonde"\n')
    with pytest.raises(CommandError, match="'aerosonde' is taken"):
        AircraftRegistry((file,))
    file.write_text('format = 1\nname = "mine"\n')
    with pytest.raises(CommandError, match="'mine' is taken"):
        AircraftRegistry((file, file))
