"""A service that is killed has lost nothing that it had told or answered."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork and SIGKILL")]


def test_no_alert_that_was_told_and_no_action_that_was_answered_is_lost_at_a_kill(tmp_path: Path) -> None:
    command = [sys.executable, str(Path(__file__).parent / "killed.py"), str(tmp_path / "w.db"), "12", "1"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert ended.returncode == 0, ended.stderr
    result = json.loads(ended.stdout)
    assert result["lost"] == []
    assert result["told"] > result["rounds"]
    assert result["acted"] > 0
