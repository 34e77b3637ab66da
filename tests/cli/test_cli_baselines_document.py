"""The tutorial of docs/baselines.md: its commands run one after another, and end as it says."""

import re
import shlex
from pathlib import Path

import pytest
from cli_flights import ROOT, run


def test_the_tutorial_runs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "baselines.md").read_text()
    commands = [
        shlex.split(line)
        for block in re.findall(r"```sh\n(.*?)```", text, re.S)
        for line in block.splitlines()
    ]
    ran = {" ".join(c): run(capsys, c[1:]) for c in commands if c[0] == "wingwatch"}
    assert len(ran) == len(commands) == 13
    refused = [line for line, one in ran.items() if one.code]
    assert refused == ["wingwatch baseline learn w.db day4.csv --aircraft aerosonde --vehicle uav1"]
    assert "icing" in ran[refused[0]].sentence.lower()
    first = next(one for line, one in ran.items() if " learn w.db day1" in line)
    assert first.out in text
    iced = next(one for line, one in ran.items() if "monitor day4" in line)
    assert "this aircraft's own flights" in iced.out
    assert "Icing of severity" in iced.out
    assert "default/uav1" in next(one for line, one in ran.items() if "list other.db" in line).out
