"""The summary finds the truth of drawn tables within its own intervals, and says no more than the data can."""

import json
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from study_tables import Truth, drawn_table

from wingwatch.aircraft import load_aircraft
from wingwatch.studies import StudySettings, load_grid
from wingwatch.studies.calibration import IMPROBABLE
from wingwatch.studies.statistics import Interval, poisson_rate
from wingwatch.studies.summary import Summary, as_json, summarise
from wingwatch.studies.table import shown_aircraft

TRUTH = Truth(effects=("icing", "elevator_effectiveness"), sensor_fault=0.1)
WIDER = 1.6
"""Intervals of 95 % stretched to 99.8 %: one test in hundreds may miss by chance."""


def holds(interval: Interval, truth: float) -> bool:
    low = interval.value - WIDER * (interval.value - interval.low)
    return low <= truth <= interval.value + WIDER * (interval.high - interval.value)


@pytest.fixture(scope="module")
def summary() -> Summary:
    return summarise(drawn_table(12_000, 7, TRUTH))


def size_95(air: int, excitation: int) -> float:
    return TRUTH.size_95 * TRUTH.harder ** (air + excitation)


def test_what_was_flown_is_counted(summary: Summary) -> None:
    flown = summary.flown
    assert flown.flights == 12_000 == flown.faulty + flown.healthy + flown.sensor_fault
    assert flown.hours == pytest.approx(1000.0)
    assert flown.observed_fraction == pytest.approx(0.9)


def test_an_own_aircraft_is_shown_by_its_name_and_not_by_its_path() -> None:
    table = drawn_table(600, 7, TRUTH)
    flown = {str(name) for name in table["aircraft"].unique().to_pylist()}
    path = sorted(flown)[0]
    aerosonde = load_aircraft("aerosonde")
    fleet = {path: load_aircraft("jetstream31"), "other.toml": aerosonde, "copy.toml": aerosonde}
    settings = StudySettings("icing", load_grid("icing", None), 0, 600, fleet, "", "")
    names = shown_aircraft([settings])
    assert names == {path: "jetstream31", "other.toml": "other.toml", "copy.toml": "copy.toml"}
    assert set(summarise(table, names).flown.aircraft) == flown - {path} | {"jetstream31"}


def test_probability_of_detection_in_single_conditions() -> None:
    one = drawn_table(40_000, 8)
    air, excitation = np.array(one["turbulence"].to_pylist()), np.array(one["excitation"].to_pylist())
    chosen = (air == "moderate") & (excitation == "multisine")
    summary = summarise(one.filter(pa.array(chosen)))
    whole = summary.detection[0]
    assert (whole.by, whole.effect) == ("", "icing")
    assert holds(whole.size_95, size_95(2, 2))
    assert whole.fit_probability > 1e-3
    assert {d.by for d in summary.detection} == {"", "aircraft", "target", "route", "surfaces", "expectation"}
    assert whole.flights == sum(c.flights for c in whole.classes)


def test_every_cell_of_the_answer_holds_its_truth(summary: Summary) -> None:
    airs = ("none", "light", "moderate", "severe", "changing")
    excitations = ("doublet", "3211", "multisine", "autopilot", "none")
    cells = [a for a in summary.answers if a.turbulence and a.excitation and not a.aircraft]
    assert len(cells) == 50
    inside = 0
    for a in cells:
        # noticed and within 30 s, of exponential delays
        seen = 1.0 - math.exp(-30.0 / TRUTH.delay_s)
        odds = 0.95 / seen / (1.0 - 0.95 / seen)
        truth = size_95(airs.index(a.turbulence), excitations.index(a.excitation)) * (odds / 19.0) ** (
            1.0 / TRUTH.slope
        )
        inside += a.size.low <= truth <= a.size.high
    assert inside >= 40  # the curve within 30 s is only nearly logistic


def test_delays_hold_their_median_and_stand_beside_the_bound(summary: Summary) -> None:
    sure = summarise(drawn_table(3000, 9, Truth(size_95=1e-4, harder=1.0, delay_s=60.0)))
    whole = sure.delays[0]
    assert holds(whole.seconds["0.5"], 60.0 * math.log(2.0))
    assert whole.bound_s["0.5"] < whole.bound_s["0.95"]
    assert whole.over_bound.low < whole.over_bound.value < whole.over_bound.high
    late = summary.delays[0]
    assert math.isinf(late.seconds["0.95"].value)  # not that many are ever noticed


def test_false_alarms_by_air_hold_their_rates(summary: Summary) -> None:
    by_air = [r for r in summary.false_alarm_rates if r.by == "turbulence"]
    assert [r.group for r in by_air] == ["none", "light", "moderate", "severe", "changing"]
    for k, rate in enumerate(by_air):
        assert holds(rate.per_hour, TRUTH.false_per_hour * (1.0 + k))
    whole = summary.false_alarm_rates[0]
    assert whole.alarms == sum(r.alarms for r in by_air)
    assert whole.per_hour == poisson_rate(whole.alarms, whole.hours)
    assert whole.at_most_per_hour == poisson_rate(whole.alarms, whole.hours, 0.90).high < whole.per_hour.high
    under_fault = [r for r in summary.false_alarm_rates if r.by == "sensor fault"]
    assert [r.group for r in under_fault] == ["sensor_bias"]
    noticed = next(r for r in summary.faults if (r.kind, r.by) == ("sensor", ""))
    assert under_fault[0].alarms == round(noticed.other_kind.value * noticed.flights), (
        "a sensor's name is no alarm"
    )
    listed = [a for a in summary.false_alarms if not a.sensor_fault]
    assert len(listed) == whole.alarms
    assert len(summary.false_alarms) == whole.alarms + under_fault[0].alarms
    assert all(f"--seed {a.seed}" in a.command for a in summary.false_alarms)
    assert all(a.reason["block_end_s"] == a.time_s for a in listed)


def test_thresholds_are_vouched_for_only_by_enough_hours() -> None:
    quiet = Truth(false_per_hour=0.0, healthy=1.0, evidence_per_hour=1.0)
    few = summarise(drawn_table(600, 10, quiet)).thresholds[0]
    assert few.hours == pytest.approx(50.0)
    assert math.isnan(few.vouched)
    assert math.isnan(few.estimate)
    many = summarise(drawn_table(12_000, 11, quiet)).thresholds[0]
    truth = math.log(quiet.evidence_per_hour / 0.01)
    assert truth - 0.5 < many.estimate < many.vouched < truth + 2.0
    assert many.vouched < many.own


def test_a_noisy_monitor_needs_a_higher_threshold_and_says_at_least() -> None:
    found = summarise(drawn_table(30_000, 12, Truth(false_per_hour=0.02)))
    whole = found.thresholds[0]
    assert whole.vouched > whole.own
    first = found.answers[0]
    assert first.relation == "at least"
    assert first.size_at_threshold.value > first.size.value


@pytest.mark.parametrize(("ratio", "coverage"), [(1.0, 0.95), (1.5293, 0.80)])
def test_coverage_of_stated_sizes(ratio: float, coverage: float) -> None:
    sizes = summarise(drawn_table(4000, 13, Truth(error_ratio=ratio))).sizes[0]
    assert holds(sizes.covered, coverage)
    assert sizes.scatter == pytest.approx(ratio, rel=0.06)


def test_confusion_counts_every_flight_once(summary: Summary) -> None:
    rows = {c.effect: c for c in summary.confusion}
    assert set(rows) == {"icing", "elevator_effectiveness", "sensor_bias", "nothing"}
    for row in rows.values():
        assert sum(row.said.values()) == row.flights
        assert list(row.said)[-2:] == ["unknown", "nothing"]
    assert holds(rows["icing"].named, 0.9)
    assert sum(c.flights for c in summary.confusion) == summary.flown.flights


def test_faults_are_counted_by_kind_part_and_condition(summary: Summary) -> None:
    whole = {row.kind: row for row in summary.faults if not row.by}
    assert list(whole) == ["icing", "damage", "sensor"]
    assert sum(row.flights for row in whole.values()) == summary.flown.faulty + summary.flown.sensor_fault
    ice, sensor = whole["icing"], whole["sensor"]
    assert [row.group for row in summary.faults if row.by == "fault" and row.kind == "icing"] == [
        "icing all", "icing tail", "icing wing",
    ]  # fmt: skip
    # exponential delays, cut off at the flight's end
    assert holds(ice.first_right, 0.9)
    assert holds(ice.first_in_set, 1.0)
    assert holds(ice.covered, 0.95)
    assert ice.median_s == pytest.approx(TRUTH.delay_s * math.log(2.0), rel=0.1)
    assert ice.within["3"].value / ice.seen.value == pytest.approx(
        1.0 - math.exp(-3.0 / TRUTH.delay_s), rel=0.1
    )
    assert holds(sensor.seen, 0.3)
    assert holds(sensor.other_kind, 0.03)
    assert ice.other_kind.value == 0.0
    spared = [math.exp(-TRUTH.false_per_hour * (1 + air) * TRUTH.onset_s / 3600.0) for air in range(5)]
    assert holds(ice.early, 1.0 - sum(spared) / 5.0)
    by_air = [row for row in summary.faults if (row.kind, row.by) == ("icing", "turbulence")]
    assert sum(row.flights for row in by_air) == ice.flights


def test_operating_curve_meets_the_monitor_at_its_own_threshold(summary: Summary) -> None:
    for curve in summary.operating_curves:
        own = curve.threshold.index(curve.own_threshold)
        assert curve.detected[own] == pytest.approx(curve.own_detected.value)
        assert curve.per_hour[own] == pytest.approx(curve.own_per_hour.value, rel=0.1)
        assert all(a >= b for a, b in zip(curve.detected, curve.detected[1:], strict=False))
        assert all(a >= b for a, b in zip(curve.per_hour, curve.per_hour[1:], strict=False))


@pytest.mark.parametrize("scatter", [1.0, 1.7])
def test_scatter_of_blocks_and_bayes_factors(scatter: float) -> None:
    found = summarise(drawn_table(1000, 14, Truth(scatter=scatter)))
    assert {s.structure for s in found.block_scatter} == {"short_period", "lateral"}
    for s in found.block_scatter:
        assert holds(s.ratio, scatter)
        assert (s.improbable.value > 5.0 * IMPROBABLE) == (scatter > 1.0)
    whole = found.bayes_factors[0]
    assert not whole.too_often
    for factor, low, high in zip(whole.factor, whole.low, whole.high, strict=True):
        assert low <= 1.2 / factor
        assert high >= 0.8 / factor


def test_large_bayes_factors_that_come_too_often_are_noticed() -> None:
    table = drawn_table(3000, 15)
    larger = pa.array(5.0 * table["bayes_factor_max"].to_numpy())
    table = table.set_column(table.schema.get_field_index("bayes_factor_max"), "bayes_factor_max", larger)
    assert summarise(table).bayes_factors[0].too_often


def test_worst_flights_are_the_worst_and_name_their_command(summary: Summary) -> None:
    kinds = {w.kind for w in summary.worst}
    assert kinds == {"missed", "late", "misnamed", "missized"}
    assert all(f"--seed {w.seed}" in w.command for w in summary.worst)
    assert all(w.why for w in summary.worst)
    assert {m.effect for m in summary.misses} == {"icing", "elevator_effectiveness"}
    assert all(
        m.held_back.value == 0.0 for m in summary.misses
    )  # the drawn monitor says what it has evidence for


def test_flights_that_failed_are_told_and_count_nowhere_else() -> None:
    table = drawn_table(50, 16)
    failed = pa.array(["TrimError: no trim"] * 3 + [""] * 47)
    table = table.set_column(table.schema.get_field_index("failed"), "failed", failed)
    found = summarise(table)
    assert [f.seed for f in found.failed] == [0, 1, 2]
    assert found.flown.failed == 3
    assert found.flown.faulty + found.flown.healthy == 47


@pytest.mark.parametrize("flights", [0, 1, 3])
def test_hardly_a_flight_is_no_error(flights: int) -> None:
    found = summarise(drawn_table(flights, 17))
    assert found.flown.flights == flights
    json.dumps(as_json(found), allow_nan=False)


def test_a_study_of_healthy_flights_alone() -> None:
    found = summarise(drawn_table(200, 18, Truth(healthy=1.0)))
    assert found.detection == []
    assert found.answers == []
    assert found.operating_curves == []
    assert found.thresholds


def test_file_and_arrays_say_the_same(summary: Summary, tmp_path: Path) -> None:
    text = json.dumps(as_json(summary), allow_nan=False)
    table = drawn_table(12_000, 7, TRUTH)
    arrays = {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}
    assert json.dumps(as_json(summarise(arrays))) == text
    pq.write_table(table, tmp_path / "study.parquet", row_group_size=5000)
    assert json.dumps(as_json(summarise(tmp_path / "study.parquet"))) == text
    assert json.loads(text)["delays"][0]["seconds"]["0.95"]["value"] == "inf"
