"""The cases of the diagnosis benchmark in small: same seed, same case; what is hidden shows; verdicts are fair."""

import json
import runpy
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import diagnosis_cases as cases
import diagnosis_hidden as hidden
import numpy as np
import pytest
from diagnosis_report import plain, report
from diagnosis_run import Task, run
from diagnosis_score import Verdict, confusion, figures, judged, same

from wingwatch.diagnosis import Cause, Diagnosis, ParameterEstimate, Traces

SEED = 1


def cause(label: str, size: float = 0.0, error: float = 1.0, beside: tuple[str, ...] = ()) -> Cause:
    name, _, target = label.removesuffix("]").partition("[")
    return Cause(name, target, {"size": ParameterEstimate(size, error, "")}, (), 1.0, 10.0, 0.5, beside)


def diagnosis(case: cases.Case, *causes: Cause) -> Diagnosis:
    nothing = Traces(np.empty(0), {}, {}, {}, np.empty(0), {})
    return Diagnosis(
        "", case.aircraft, {}, causes, (), 0.0, "", None, (), (), None, {}, nothing, 60.0, 3
    )  # fmt: skip


def knows_all(case: cases.Case) -> Diagnosis:
    """A finder that has read the answer."""
    return diagnosis(case, *(cause(h.label, h.size, 0.01) for h in case.effects))


def refuses(case: cases.Case) -> Diagnosis:
    raise ValueError("no")


@pytest.fixture(scope="module")
def gyro() -> cases.Case:
    return cases.FIXED["gyro-delay"]()


@cache
def drawn(source: cases.Source) -> cases.Case:
    return cases.draw(source, SEED)


@pytest.mark.parametrize("source", cases.SOURCES)
def test_one_seed_is_one_case(source: cases.Source) -> None:
    first, again = drawn(source), cases.draw(source, SEED)
    assert first.effects == again.effects
    assert first.aircraft == again.aircraft
    assert np.array_equal(first.flight.values, again.flight.values, equal_nan=True)
    assert np.array_equal(first.held_out.values, again.held_out.values, equal_nan=True)


@pytest.mark.parametrize("source", cases.SOURCES)
def test_a_hidden_effect_changes_the_flight_and_its_absence_does_not(source: cases.Source) -> None:
    ill, well, two = drawn(source), cases.draw(source, SEED, "none"), cases.draw(source, SEED, "two")
    assert (len(ill.effects), len(well.effects), len(two.effects)) == (1, 0, 2)
    assert min(ill.signal_to_noise, two.signal_to_noise) >= hidden.LEAST_SIGNAL
    assert well.signal_to_noise == 0.0
    assert ill.aircraft == well.aircraft
    assert ill.flight.values.shape == well.flight.values.shape
    assert not np.array_equal(ill.flight.values, well.flight.values, equal_nan=True)
    assert not np.array_equal(ill.flight.values, ill.held_out.values, equal_nan=True)


def test_a_finder_that_knows_everything_scores_full_marks() -> None:
    tasks = [Task("simulation", seed, effects) for seed in (2, 5) for effects in ("one", "none", "two")]
    got = figures("simulation", list(run(tasks, knows_all)))
    assert (got.one, got.two, got.healthy, got.refused) == (2, 2, 2, 0)
    assert (got.named, got.first, got.alone, got.inside, got.quiet, got.both) == (100.0,) * 6


def test_a_flight_that_is_refused_counts_as_that(gyro: cases.Case) -> None:
    (verdict,) = run([Task(fixed="gyro-delay")], refuses)
    assert verdict.refusal == "no"
    assert not verdict.missed
    assert figures("simulation", [verdict]).refused == 1


@pytest.mark.parametrize(
    ("causes", "named", "first", "alone"),
    [
        ((cause("sensor_delay[pitch_rate_rad_s]"),), True, True, True),
        ((cause("sensor_delay[roll_rate_rad_s]"),), False, False, False),
        ((cause("actuator_lag[elevator]", beside=("sensor_delay[pitch_rate_rad_s]",)),), True, False, False),
        ((cause("sensor_delay[pitch_rate_rad_s]"), cause("icing")), True, True, False),
        ((cause("icing"), cause("sensor_delay[pitch_rate_rad_s]")), False, False, False),
        ((), False, False, False),
    ],
)
def test_what_counts_as_named(
    gyro: cases.Case, causes: tuple[Cause, ...], named: bool, first: bool, alone: bool
) -> None:
    verdict = judged(gyro, diagnosis(gyro, *causes), 1.0)
    assert (verdict.named, verdict.first, verdict.alone) == ((named,), first, alone)
    assert verdict.missed is not named


def test_a_size_is_held_against_its_interval(gyro: cases.Case) -> None:
    label = gyro.effects[0].label
    for size, inside in ((0.06 + 0.0019, True), (0.06 + 0.0021, False)):
        assert judged(gyro, diagnosis(gyro, cause(label, size, 0.001)), 1.0).inside is inside
    assert judged(gyro, diagnosis(gyro, cause("icing", 0.06, 0.001)), 1.0).inside is None


def test_a_claim_on_a_healthy_flight_is_a_miss(gyro: cases.Case) -> None:
    well = replace(gyro, effects=())
    claims, quiet = (judged(well, diagnosis(well, *c), 1.0) for c in ((cause("icing"),), ()))
    assert claims.missed
    assert not quiet.missed
    assert figures("x", [claims, quiet]).quiet == 50.0
    assert confusion([claims, quiet]) == {"none": {"icing": 1, "none": 1}}


def test_names_of_one_and_the_same_change() -> None:
    assert same("derivative[m_q]", "pitch_damping")
    assert same("icing[all]", "icing")
    assert not same("icing[wing]", "icing")
    assert not same("derivative[m_w]", "cg_shift")


def test_figures_of_nothing() -> None:
    verdict = Verdict("", "x", 0, "a", "none", 0.0, 0.0, (), ())
    assert figures("x", [verdict]).named is None


def test_the_report_names_every_miss_and_every_refusal(gyro: cases.Case) -> None:
    wrong = judged(gyro, diagnosis(gyro, cause("icing", beside=("cg_shift",))), 1.0)
    off = judged(gyro, diagnosis(gyro, cause(gyro.effects[0].label, 0.1, 0.001)), 1.0)
    no = replace(wrong, refusal="too short", source="plant", case="", seed=77)
    text = "\n".join(report([wrong, off, no]))
    assert "gyro-delay" in text
    assert "said: icing (or cg_shift)" in text
    assert "sensor_delay              icing 1, sensor_delay 1" in text
    assert "too short" in text
    assert "size 0.1 ± 0.001" in text
    assert "refused: 1" in text
    assert "missed: 1" in text
    assert "first 1 of 2 (1 to 99 %)" in text
    assert [row.split()[0] for row in report([wrong, off, no])[1:4]] == ["simulation", "plant", "all"]


def test_json_has_null_for_what_is_not_a_number(gyro: cases.Case) -> None:
    row = json.loads(json.dumps(plain(judged(gyro, diagnosis(gyro), 1.0)), allow_nan=False))
    assert row["size"] is None
    assert row["hidden"] == ["sensor_delay[pitch_rate_rad_s]"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--cases", "0"], "at least 1"),
        (["--fixed", "flutter"], "give some of"),
        (["--workers", "0"], "at least 1"),
    ],
)
def test_bad_arguments_get_one_sentence(
    arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["diagnosis.py", *arguments])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(Path(hidden.__file__).with_name("diagnosis.py")), run_name="__main__")
    assert ended.value.code == 2
    assert words in capsys.readouterr().err
