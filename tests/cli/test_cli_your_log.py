"""The tutorial "your_log.md": each of its commands, on a shorter flight."""

import re
import runpy
import shlex
import sys
from pathlib import Path

import pytest
from cli_flights import ROOT, run

SECONDS = 42
TUTORIAL = ROOT / "docs" / "tutorial" / "your_log.md"


def commands() -> list[list[str]]:
    """The lines of its blocks."""
    blocks = re.findall(r"^```sh\n(.*?)^```$", TUTORIAL.read_text(), re.MULTILINE | re.DOTALL)
    return [shlex.split(line) for block in blocks for line in block.splitlines()]


def test_each_command_of_the_tutorial_runs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = []
    for program, *arguments in commands():
        if program == "python":
            script, *rest = arguments
            monkeypatch.setattr(sys, "argv", [script, *rest, "--seconds", str(SECONDS)])
            monkeypatch.setattr(sys, "path", [*sys.path])
            runpy.run_path(str(ROOT / script), run_name="__main__")
            capsys.readouterr()
        else:
            assert program == "wingwatch"
            ran = run(capsys, arguments)
            assert ran.code == 0, ran.err
            done.append(arguments[0])
    assert {"log", "report", "estimate", "monitor"} <= set(done)
    for name in ("px4.html", "ardupilot.html"):
        page = (tmp_path / name).read_text()
        assert "Measured and predicted motion" in page
        assert '<td data-label="">aerosonde</td>' in page
