"""Air that begins to move in the middle of a block: what the block says keeps to its stated errors."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from scipy.stats import chi2
from study_flights import small_grid

from wingwatch.studies import draw_plan, load_fleet
from wingwatch.studies.flight import FlightMaker
from wingwatch.studies.plan import Gusts

IMPROBABLE = 1e-8


@pytest.mark.parametrize("aircraft", ["aerosonde", "ultrastick25e"])
def test_gusts_that_begin_within_a_block_leave_its_evidence_true(tmp_path: Path, aircraft: str) -> None:
    grid = small_grid(tmp_path).model_copy(update={"aircraft": {aircraft: 1.0}})
    fleet = load_fleet(grid)
    plan = replace(
        draw_plan("healthy", grid, 0, fleet), altitude_m=100.0, seconds=70.0, excitation_period_s=60.0,
        excitation_start_s=12.0, effect="", target="", severity=None, onset_s=None, ramp_s=None,
    )  # fmt: skip
    plans = [
        replace(plan, seed=seed, gusts=(Gusts(rms_m_s=0.5 + 0.2 * k, onset_s=32.0 + k, ramp_s=10.0),))
        for k, seed in enumerate(range(4100, 4108))
    ]
    rows = FlightMaker(fleet).rows(plans, "{seed}")
    assert [row["failed"] for row in rows] == [""] * 8
    for structure in ("short_period", "lateral"):
        blocks = [
            (row["seed"], end_s, float(chi2.sf(score, freedom)))
            for row in rows
            for end_s, score, freedom in json.loads(row["block_scores"]).get(structure, [])
            if freedom > 0.0
        ]
        assert len(blocks) > 30, structure
        assert [block for block in blocks if block[2] < IMPROBABLE] == [], structure
