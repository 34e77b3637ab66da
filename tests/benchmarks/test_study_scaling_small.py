"""The benchmark of a study's workers in small."""

from pathlib import Path

import pytest
import study_scaling

SECONDS = 160.0
"""Of a flight: ice comes within 140 s."""


@pytest.mark.slow
def test_the_same_flights_are_flown_by_any_number_of_workers(tmp_path: Path) -> None:
    costs, same = study_scaling.measure(2, SECONDS, (1, 2), tmp_path)
    assert same
    assert [cost.workers for cost in costs] == [1, 2]
    for cost in costs:
        assert cost.watched_h == pytest.approx(2 * SECONDS / 3600.0, rel=0.01)
        assert cost.processor_s > 0.0
        assert cost.wall_s > 0.0
