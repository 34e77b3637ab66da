"""The benchmark of notifications in small: the promised time, and what it refuses."""

import statistics
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
from refusals import refusal

pytest.importorskip("pymavlink")
FILE = Path(__file__).parents[2] / "benchmarks" / "notifications.py"


@pytest.fixture(scope="module")
def benchmark() -> Any:
    spec = spec_from_file_location("benchmark_notifications", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_text_is_on_its_way_within_200_ms_of_the_commit(benchmark: Any) -> None:
    times = benchmark.measured(5, 0, 1)
    assert {way: len(got) for way, got in times.received.items()} == {
        "announced": 5,
        "STATUSTEXT": 5,
        "webhook": 5,
    }
    assert statistics.median(times.delays_s("STATUSTEXT")) < 0.2
    assert set(benchmark.rows(times)) == {"announced", "STATUSTEXT", "webhook"}


def test_bad_arguments_get_one_sentence(
    benchmark: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "give 1 to 1000" in refusal(benchmark, ["--alerts", "0"], monkeypatch, capsys)
    assert "give 0 to 200" in refusal(benchmark, ["--vehicles", "999"], monkeypatch, capsys)
