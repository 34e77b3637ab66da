"""JSBSim's bundled aircraft as subjects, in small: the flight beside its truth, and what is made of it."""

import sys

import jsbsim_aircraft as bundled
import numpy as np
import pytest
from refusals import refusal

from wingwatch.aircraft import LATERAL, SHORT_PERIOD
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock


@pytest.fixture(scope="module")
def subject() -> bundled.Subject:
    return bundled.Subject("F80C")


@pytest.fixture(scope="module")
def flight(subject: bundled.Subject) -> tuple[np.ndarray, np.ndarray]:
    return bundled.fly(subject)


def test_the_flight_is_what_its_linear_truth_describes(
    subject: bundled.Subject, flight: tuple[np.ndarray, np.ndarray]
) -> None:
    clean, spin = flight
    # Two degrees of doublets on an aircraft without kinks: what is left is of second order.
    assert bundled.misfit(subject, SHORT_PERIOD, clean, spin) < 0.02
    assert bundled.misfit(subject, LATERAL, clean, spin) < 0.02
    wrong = clean.copy()
    wrong[:, CHANNEL_INDEX["aileron_rad"]] *= 1.1
    assert bundled.misfit(subject, LATERAL, wrong, spin) > 0.04
    block = SampleBlock(clean)
    assert np.abs(block.column("roll_rad")).max() < 0.2
    assert (
        np.abs(block.column("elevator_rad") - subject.trim.elevator_rad).max() > 0.8 * bundled.AMPLITUDE_RAD
    )


def test_what_both_estimators_say_without_noise_lies_near(
    subject: bundled.Subject, flight: tuple[np.ndarray, np.ndarray]
) -> None:
    found = bundled.read(subject, "noise-free", flight[0], 0, whole=False)
    assert set(found) == {(s, e) for s in ("short_period", "lateral") for e in ("fourier", "ekf")}
    for reading in found.values():
        assert np.isfinite(reading.relative).all()
        assert np.median(reading.relative) < 0.05


@pytest.mark.parametrize("record", [r for r in bundled.RECORDS if r != "noise-free"])
def test_records_are_spoilt_as_they_say(record: str, flight: tuple[np.ndarray, np.ndarray]) -> None:
    clean = flight[0]
    values = bundled.RECORDS[record](clean, np.random.default_rng(3))
    sideslip, elevator = (CHANNEL_INDEX[n] for n in ("sideslip_rad", "elevator_rad"))
    missing = np.isnan(values[:, elevator]).mean()
    assert missing == 0.0 if record != "gaps" else 0.03 < missing < 0.25
    if record == "constant":
        assert np.ptp(values[:, sideslip]) == 0.0
    elif record == "quantised":
        steps = values[:, sideslip] / bundled.STEPS["rad"]
        assert steps == pytest.approx(np.round(steps))
        assert np.unique(values[:, sideslip]).size > 1
    else:
        both = np.isfinite(values[:, sideslip])
        error = values[both, sideslip] - clean[both, sideslip]
        assert error.std() == pytest.approx(bundled.NOISE["sideslip_rad"], rel=0.1)


def test_the_file_is_off_by_thirty_percent_of_natural_sizes(subject: bundled.Subject) -> None:
    file = subject.file(True, 5)
    (stated,) = file.conditions
    table, _ = subject.truth_at(subject.condition.airspeed_true_m_s)
    for structure in (SHORT_PERIOD, LATERAL):
        off = np.array([stated.derivatives[d].value - table[d] for d in structure.derivatives])
        assert np.abs(off) / subject.natural(structure) == pytest.approx(np.full(off.size, 0.3))
    assert subject.file(False, 5).sensors.noise_std == {}


def test_totals_leave_out_what_no_linear_model_describes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["jsbsim_aircraft.py", "--aircraft", "DHC6", "--records", "noise-free"])
    assert bundled.main() == 0
    rows = [text.split() for text in capsys.readouterr().out.splitlines()]
    assert ["DHC6", "noise-free", "lateral", "ekf"] in [row[:4] for row in rows]
    assert {row[2] for row in rows if row[0] == "all"} == {"short_period"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--aircraft", "spruce_goose"], "give some of"), (["--seeds", "0"], "at least 1")],
)
def test_bad_arguments_get_one_sentence(
    arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in refusal(bundled, arguments, monkeypatch, capsys)
