"""The contract's `diagnose` object: its keys, and null for what is not known."""

import json
import math
from typing import Any

import numpy as np
import pytest
from diagnosis_examples import AGREES, FOUND, NOTHING_FOUND

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis import Diagnosis, as_json
from wingwatch.diagnosis.gain import gain_of
from wingwatch.diagnosis.misfit import Replayed

CONTRACT = {"misfit", "causes", "unexplained_fraction", "gain", "model", "not_separable"}
MISFIT = {"r_squared", "tic", "bias", "variance", "covariance"}
CAUSE = {"name", "parameters", "channels", "probability", "gain", "indistinguishable_from",
         "held_out_gain", "separating_manoeuvre"}  # fmt: skip


@pytest.mark.parametrize("diagnosis", [FOUND, NOTHING_FOUND, AGREES], ids=["found", "nothing", "agrees"])
def test_every_key_of_the_contract_is_there_whatever_was_found(diagnosis: Diagnosis) -> None:
    value = as_json(diagnosis)
    assert set(value) >= CONTRACT
    assert all(set(m) >= MISFIT for m in value["misfit"].values())
    assert all(set(c) >= CAUSE for c in value["causes"])
    assert isinstance(value["gain"]["held_out"], dict)
    assert json.loads(json.dumps(value, allow_nan=False)) == value


def test_figures_are_those_of_the_diagnosis() -> None:
    value = as_json(FOUND)
    cause = value["causes"][1]
    assert (cause["name"], cause["target"]) == ("sensor_delay", "angle_of_attack_rad")
    assert cause["parameters"] == {"delay_s": {"value": 0.0603, "standard_error": 0.0019, "unit": "s"}}
    held_out = value["gain"]["held_out"]["pitch_rate_rad_s"]
    assert (held_out["before"]["tic"], held_out["after"]["tic"]) == (0.34, 0.085)
    assert held_out["change"] == {"value": -0.74, "low": -0.79, "high": -0.66}
    assert value["derivatives"]["m_eta"] == {"before": -131.5, "after": -92.05, "unit": "1/s2"}
    assert value["ranking"][0] == {"label": "elevator_effectiveness", "gain": 1834.2, "probability": 0.97}


def test_what_is_not_known_is_null() -> None:
    value = as_json(FOUND)
    assert value["misfit"]["altitude_m"]["bias"] is None
    assert math.isnan(FOUND.ranking[6][2])
    assert value["ranking"][6]["probability"] is None
    nothing: dict[str, Any] = as_json(NOTHING_FOUND)
    assert nothing["model"] is None
    assert nothing["gain"] == {"source": "", "held_out": {}}


def test_the_model_reads_back_as_an_aircraft() -> None:
    assert Aircraft.model_validate(as_json(FOUND)["model"]) == FOUND.model


def test_figures_of_the_gain_have_intervals_that_hold_them() -> None:
    rng = np.random.default_rng(1)
    windows = [np.repeat(rng.standard_normal((50, 1)), 14, axis=1) for _ in range(8)]
    poor = Replayed(windows, [w + 0.5 * rng.standard_normal(w.shape) for w in windows])
    good = Replayed(windows, [w + 0.1 * rng.standard_normal(w.shape) for w in windows])
    gain = gain_of(poor, good, np.full(14, 0.01), (2,), "windows left out")
    figures, intervals = gain.before["pitch_rate_rad_s"], gain.intervals["pitch_rate_rad_s"]
    for name, (before, after) in intervals.items():
        assert before.value == pytest.approx(getattr(figures, name)), name
        assert before.low <= before.value <= before.high
        assert after.value == pytest.approx(getattr(gain.after["pitch_rate_rad_s"], name)), name
    assert intervals["r_squared"][1].low > intervals["r_squared"][0].high
