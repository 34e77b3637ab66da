"""The report's benchmark in small."""

from pathlib import Path

import study_report


def test_a_report_is_measured_in_a_process_of_its_own(tmp_path: Path) -> None:
    found = study_report.measure(300, 2, tmp_path)
    assert found["rows"] == 300.0
    assert 0.0 < found["memory_mib"] < 1024.0
    assert found["wall_s"] > 0.0
    assert (tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
