"""The record of a vehicle's blocks: innovations that are as large as they should be, and information in bits."""

import numpy as np
import pytest
from fleet_hall import Hall, fly_doublets
from test_monitor_judge import Bench

from wingwatch.monitor.detection.blocks import EKF, FOURIER
from wingwatch.monitor.detection.judge import Judge
from wingwatch.monitor.record_views import BlockRecord, ModeRecord
from wingwatch.monitor.vehicle.flight_record import KEPT_BLOCKS, FlightRecord, information_bit, innovation

BLOCKS, LEARNED = 220, 20


def test_innovations_of_an_unchanged_aircraft_are_one_on_average_and_below_their_limit_in_95_percent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Judge, "_verdict", lambda *_: None)  # most of the time, and nobody asks for it here
    bench = Bench(5)
    found: dict[int, list[tuple[float, float]]] = {FOURIER: [], EKF: []}
    for k in range(BLOCKS):
        bench.feed(bench.truth)
        if k >= LEARNED:  # the numbers of the aircraft file, here exactly true, weigh nothing any more
            for estimator, one in innovation(bench.judge, bench.state, "short_period").items():
                found[estimator].append(one)
    n, freedom = BLOCKS - LEARNED, 6
    for ones in found.values():
        ratios, limits = np.array(ones).T
        assert ratios.size == n
        assert abs(ratios.mean() - 1.0) < 4.0 * np.sqrt(2.0 / freedom / n)
        assert abs(np.mean(ratios > limits) - 0.05) < 4.0 * np.sqrt(0.05 * 0.95 / n)


def test_after_a_change_innovations_are_beyond_the_limit_and_stay_there_while_its_alert_is_in_force() -> None:
    bench = Bench(6)
    for _ in range(LEARNED):
        bench.feed(bench.truth)
    changed = bench.change("elevator_effectiveness", 0.5)
    onset_s, far = bench.time_s, []
    for _ in range(6):
        bench.feed(changed, onset_s=onset_s)
        ratio, limit = innovation(bench.judge, bench.state, "short_period", onset_s)[FOURIER]
        far.append(ratio / limit)
    assert min(far) > 3.0


def test_a_block_in_which_nothing_moved_has_no_innovation_and_no_information() -> None:
    bench = Bench(7)
    bench.feed(bench.truth, quiet=True)
    assert innovation(bench.judge, bench.state, "short_period") == {}
    assert information_bit(np.zeros((3, 3)), np.ones(3)) == 0.0


def test_information_is_half_the_binary_logarithm_of_what_is_known_better() -> None:
    """Known to a seventh of its natural size, a derivative is 1 + 7^2 = 50 times as well known as before."""
    information = np.diag([49.0 / 4.0, 0.0])
    assert information_bit(information, np.array([2.0, 5.0])) == pytest.approx(0.5 * np.log2(50.0))


def test_a_block_is_given_back_as_it_was_noted() -> None:
    """Numbers to the bit, and what is not known as None; also where the next block is of another form."""
    whole = BlockRecord(
        0.1, 10.1,
        {"short_period": {"fourier": ModeRecord(1.0 / 3.0, 0.7, 1.9), "ekf": ModeRecord(None, None, None)},
         "lateral": {"fourier": ModeRecord(2.0, None, None), "ekf": ModeRecord(0.0, 1.1, 1.6)}},
        2.5, ("lateral",),
    )  # fmt: skip
    part = BlockRecord(10.1, 20.1, {"lateral": {"fourier": ModeRecord(3.0, 0.5, 1.6)}}, None, ())
    record = FlightRecord()
    record.note_blocks([whole, part])
    assert list(record.blocks) == [whole, part]


def test_the_record_is_bounded_and_forgets_another_clock() -> None:
    record = FlightRecord()
    blocks = [BlockRecord(10.0 * k, 10.0 * (k + 1), {}, None, ()) for k in range(KEPT_BLOCKS + 5)]
    record.note_blocks(blocks)
    assert (len(record.blocks), record.blocks[0].start_s) == (KEPT_BLOCKS, 50.0)
    record.note_blocks(blocks[:1])
    assert list(record.blocks) == blocks[:1]
    for k in range(150):
        record.note_onset(f"a{k}", float(k))
    record.note_onset("never", float("-inf"))
    assert (len(record.onsets_s), "a149" in record.onsets_s, "never" in record.onsets_s) == (100, True, False)


@pytest.fixture(scope="module")
def hall() -> Hall:
    made = Hall()
    made.announce()
    flight = fly_doublets(32.0)
    for second in range(32):
        made.clock.now_s += 1.0
        made.fly(flight, second, second + 1)
    return made


def test_a_fleet_keeps_blocks_and_arrivals_of_each_vehicle(hall: Hall) -> None:
    found = hall.fleet.flight_record("default", "uav")
    assert found is not None
    assert [round(block.end_s) for block in found.blocks] == [10, 20, 30]
    information = [block.modes["short_period"]["fourier"].information_bit for block in found.blocks]
    assert max(one for one in information if one is not None) > 10.0
    assert found.link.seconds
    assert found.threshold is not None
    assert hall.fleet.flight_record("default", "nobody") is None


def test_what_is_expected_at_conditions_is_what_the_derivatives_say(hall: Hall) -> None:
    now = hall.fleet.derivatives("default", "uav")
    assert now is not None
    mode = now["estimators"]["fourier"]["lateral"]
    at = np.array([list(mode["condition"].values()), [np.nan] * 4])
    found = hall.fleet.expected("default", "uav", "lateral", ("aerosonde", "clean"), at)
    assert found is not None
    rows = list(mode["derivatives"].values())
    np.testing.assert_allclose(found[0][0], [row["expected"] for row in rows], rtol=1e-9)
    np.testing.assert_allclose(found[1][0], [row["expected_standard_error"] for row in rows], rtol=1e-9)
    assert np.isnan(found[0][1]).all()
    assert hall.fleet.expected("default", "uav", "lateral", ("twin", "clean"), at) is None
