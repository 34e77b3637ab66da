"""The Fourier estimator's mean score at the truth: nothing in air that moves, and seen where the truth is another."""

from dataclasses import replace

import numpy as np
import pytest
import score_at_truth
from reference_plant import PLANTS, Plant
from refusals import refusal
from situation_cases import SITUATIONS

CASE = SITUATIONS["moderate, open, each 5 s"]


@pytest.mark.parametrize("plant", PLANTS, ids=["short_period", "dutch_roll"])
def test_the_mean_score_is_nothing_at_the_truth(plant: Plant) -> None:
    found = score_at_truth.read(plant, "moderate", CASE, 8, True)
    assert found.blocks == 48
    assert (np.abs(found.bias) < 4.0 * np.array(found.standard_error)).all()


def test_air_that_does_not_turn_is_another_equation() -> None:
    """What the turning of the air does to the moment is then expected where it is not."""
    assert CASE.air is not None
    calm = replace(CASE, air=replace(CASE.air, turns=False))
    found = score_at_truth.read(PLANTS[0], "does not turn", calm, 8, True)
    assert (np.abs(found.bias) > 4.0 * np.array(found.standard_error)).any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--cases", "nowhere"], "give names that situations.py prints"),
        (["--flights", "0"], "give at least 1"),
    ],
)
def test_unknown_cases_and_no_flights_are_refused(
    arguments: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert message in refusal(score_at_truth, arguments, monkeypatch, capsys)
