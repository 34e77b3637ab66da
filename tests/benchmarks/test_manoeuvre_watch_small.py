"""The benchmark of the manoeuvre watch in small: verdicts with it, none without, both on the same samples."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from wingwatch.simulation import Scenario, doublet_schedule, simulate

FILE = Path(__file__).parents[2] / "benchmarks" / "manoeuvre_watch.py"


@pytest.fixture(scope="module")
def benchmark() -> Any:
    spec = spec_from_file_location("benchmark_manoeuvre_watch", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_watch_alone_judges_and_both_are_timed(benchmark: Any) -> None:
    aircraft = benchmark.AEROSONDE
    doublets = doublet_schedule(aircraft, aircraft.envelope.cruise)
    flight = simulate(Scenario(aircraft, manoeuvres=(doublets,), seed=1), 10.0)
    cost = benchmark.flown(flight)
    assert cost.judged == 1
    assert 0.0 < cost.longest_s < cost.took_s[True]
    assert cost.took_s[False] > 0.0
    estimates = [benchmark.monitor_of(flight, watched) for watched in (True, False)]
    for monitor in estimates:
        monitor.feed(flight)
    assert estimates[0].derivatives() == estimates[1].derivatives()
