"""The command line as such: help, usage, and how faults are reported."""

import re
import subprocess
import sys
import time

import pytest
from cli_flights import ROOT, run

from wingwatch import __version__
from wingwatch.cli import estimate_command
from wingwatch.cli.main import main

HELP_WITHIN_S = 0.3
COMMANDS = (
    "demo",
    "serve",
    "publish",
    "simulate",
    "estimate",
    "monitor",
    "diagnose",
    "design-input",
    "access",
)


def test_help_names_every_command_with_examples(capsys: pytest.CaptureFixture[str]) -> None:
    ran = run(capsys, ["--help"])
    assert ran.code == 0
    assert all(re.search(rf"\n    {command}\s", ran.out) for command in COMMANDS)
    assert all(f"wingwatch {command}" in ran.out for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_has_help_with_an_example_and_json(
    capsys: pytest.CaptureFixture[str], command: str
) -> None:
    ran = run(capsys, [command, "--help"])
    assert ran.code == 0
    assert "example:" in ran.out
    assert "--json" in ran.out


def test_help_is_there_at_once() -> None:
    """The best of five: a loaded machine delays some, a heavy import all of them."""
    took = []
    for _ in range(5):
        began = time.monotonic()
        subprocess.run(
            [sys.executable, "-m", "wingwatch.cli.main", "--help"], check=True, capture_output=True
        )
        took.append(time.monotonic() - began)
    assert min(took) < HELP_WITHIN_S


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, ["--version"]).out == f"wingwatch {__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "COMMAND"),
        (["diagnosis"], "'diagnosis'"),
        (["diagnose", "f.csv"], "--aircraft"),
        (["estimate", "f.csv"], "--aircraft"),
        (["estimate", "f.csv", "--aircraft", "aerosonde", "--estimator", "output"], "'output'"),
        (["estimate", "f.csv", "--aircraft", "aerosonde", "--colour"], "--colour"),
        (["publish", "f.csv", "--aircraft", "aerosonde", "--vehicle", "a", "--rate", "fast"], "'fast'"),
        (["publish", "f.csv", "--aircraft", "aerosonde", "--vehicle", "a", "--rate", "0"], "'0'"),
        (["publish", "f.csv", "--aircraft", "aerosonde", "--vehicle", "a", "--rate", "nan"], "'nan'"),
        (["serve", "--port", "http"], "'http'"),
    ],
)
def test_bad_usage_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert words in run(capsys, arguments).sentence


def test_a_fault_of_the_program_is_no_traceback_either(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_arguments: object) -> int:
        raise ZeroDivisionError("a bug\nin two lines")

    monkeypatch.setattr(estimate_command, "run", broken)
    monkeypatch.delenv("WINGWATCH_DEBUG", raising=False)
    ran = run(capsys, ["estimate", "f.csv", "--aircraft", "aerosonde"])
    assert ran.code == 1
    assert ran.err.count("\n") == 1
    assert "ZeroDivisionError: a bug in two lines" in ran.err
    monkeypatch.setenv("WINGWATCH_DEBUG", "1")
    assert "Traceback" in run(capsys, ["estimate", "f.csv", "--aircraft", "aerosonde"]).err


def test_an_interrupt_ends_with_the_shells_code(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_arguments: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(estimate_command, "run", interrupted)
    assert main(["estimate", "f.csv", "--aircraft", "aerosonde"]) == 130
    assert capsys.readouterr().err == "wingwatch: interrupted\n"


def test_a_reader_that_goes_away_is_no_fault() -> None:
    command = f"{sys.executable} -m wingwatch.cli.main --help | head -n 1; exit ${{PIPESTATUS[0]}}"
    ran = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert ran.stderr == ""


def manual(command: str) -> tuple[str, str]:
    """What docs/commands.md says of all commands, and of this one."""
    sections = (ROOT / "docs" / "commands.md").read_text().split("\n## ")
    (section,) = (s for s in sections if s.startswith(f"`wingwatch {command}`"))
    return sections[0], section


def test_the_manual_names_every_option_of_tokens(capsys: pytest.CaptureFixture[str]) -> None:
    usages = [run(capsys, ["token", action, "--help"]).out for action in ("create", "list", "revoke")]
    assert all("example:" in usage and "--json" in usage for usage in usages)
    options = set(re.findall(r"--[a-z]+", "".join(usages))) - {"--help"}
    assert options == set(re.findall(r"--[a-z]+", manual("token")[1]))


def test_the_manual_names_every_option_of_the_store(capsys: pytest.CaptureFixture[str]) -> None:
    usages = [run(capsys, ["store", action, "--help"]).out for action in ("backup", "check", "prune")]
    assert all("example:" in usage and "--json" in usage for usage in usages)
    options = set(re.findall(r"--[a-z-]+[a-z]", "".join(usages))) - {"--help"}
    assert options == set(re.findall(r"--[a-z-]+[a-z]", manual("store")[1]))


@pytest.mark.parametrize("command", COMMANDS)
def test_the_manual_names_every_option_and_no_other(capsys: pytest.CaptureFixture[str], command: str) -> None:
    """The section of a command in docs/commands.md against its parser."""
    general, section = manual(command)
    usage = run(capsys, [command, "--help"]).out
    options = set(re.findall(r"--[a-z]+", usage)) - {"--help"}
    assert options <= set(re.findall(r"--[a-z]+", general + section))
    assert set(re.findall(r"--[a-z]+", section)) <= options
