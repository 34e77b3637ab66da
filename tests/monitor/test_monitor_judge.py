"""The sequential test on blocks made by hand, whose truth is known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.baselines import Expectation, apriori_envelope
from wingwatch.monitor.detection.blocks import EKF, FOURIER, BlockView, Evidence, ModeBlock
from wingwatch.monitor.detection.causes import CAUSES
from wingwatch.monitor.detection.comparison import Coordinates, informative_part
from wingwatch.monitor.detection.judge import Judge, _anything
from wingwatch.monitor.detection.judge_state import JudgeState, Verdict

AIRCRAFT = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.05)
STRUCTURES = {s.name: s for s in (SHORT_PERIOD, LATERAL)}


class Bench:
    """Makes blocks with a given truth and error, and feeds them to a judge."""

    def __init__(
        self, seed: int, *, error: float = 0.05, wrong_baseline: float = 0.0, founded: bool = False
    ) -> None:
        self.rng = np.random.default_rng(seed)
        self.error, self.time_s = error, 0.0
        self.coordinates = {n: Coordinates(s, AIRCRAFT, (25.0, 1.1116)) for n, s in STRUCTURES.items()}
        self.judge = Judge(self.coordinates)
        self.state: JudgeState = self.judge.init({}, founded)
        self.expected: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.truth: dict[str, np.ndarray] = {}
        for name, structure in STRUCTURES.items():
            found = apriori_envelope(AIRCRAFT, structure).lookup(CONDITION)
            assert isinstance(found, Expectation)
            c = self.coordinates[name]
            self.truth[name], spread = c.at(CONDITION).from_concise(found.value, found.covariance)
            spread = spread / 25.0 if founded else spread  # flights know five times better than a book
            off = 1.0 + wrong_baseline * np.sign(self.rng.normal(size=self.truth[name].size))
            self.expected[name] = (self.truth[name] * off, spread)

    def change(self, cause: str, size: float) -> dict[str, np.ndarray]:
        found = next(c for c in CAUSES if c.name == cause)
        return {
            n: t + size * self.judge.directions(n, (found,), t, CONDITION)[0] for n, t in self.truth.items()
        }

    def feed(
        self,
        truth: dict[str, np.ndarray],
        *,
        quiet: bool = False,
        onset_s: float | None = None,
        bias: float = 0.0,
    ) -> Verdict | None:
        """A block of both estimators; ``bias``: fraction by which the Fourier estimator finds everything too large."""
        modes = {}
        for name, value in truth.items():
            k = value.size
            sigma = self.error * np.maximum(np.abs(self.truth[name]), 0.02)
            information = np.zeros((k, k)) if quiet else np.diag(sigma**-2.0)
            estimate = value + self.rng.normal(size=k) * sigma
            mean, spread = self.expected[name]
            vectors = information @ ((1.0 + bias) * estimate), information @ estimate
            evidence = Evidence(np.stack([information, information]), np.stack(vectors), np.zeros((2, k)))
            modes[name] = ModeBlock(evidence, mean, spread)
        self.time_s += 10.0
        return self.judge.consider(self.state, BlockView(self.time_s, CONDITION, modes), onset_s)


def test_a_healthy_flight_stays_below_the_threshold() -> None:
    bench = Bench(1)
    verdicts = [bench.feed(bench.truth) for _ in range(120)]
    highest = max(v.log_statistic for v in verdicts if v is not None)
    assert highest < bench.judge.config.log_threshold


def test_a_wrong_baseline_accuses_nobody_and_is_named() -> None:
    bench = Bench(2, wrong_baseline=0.8)
    verdicts = [bench.feed(bench.truth) for _ in range(40)]
    assert max(v.log_statistic for v in verdicts if v is not None) < bench.judge.config.log_threshold
    assert "short_period" in bench.state.contradictions
    assert bench.state.contradictions["short_period"]


@pytest.mark.parametrize("error", [0.3, 0.6])
def test_a_wrong_baseline_accuses_nobody_after_own_flights_have_founded_a_reference(error: float) -> None:
    # little excitation: own flights say less of some derivatives than the (wrong) numbers claim to
    bench = Bench(2, error=error, wrong_baseline=0.8)
    verdicts = [bench.feed(bench.truth) for _ in range(40)]
    assert bench.state.founded
    bench.state = bench.judge.init(bench.state.references, False)
    assert bench.state.founded
    verdicts += [bench.feed(bench.truth) for _ in range(20)]
    assert max(v.log_statistic for v in verdicts if v is not None) < bench.judge.config.log_threshold
    assert bench.state.contradictions


def test_a_founded_baseline_accuses_from_the_first_block() -> None:
    bench = Bench(3, founded=True)
    verdict = None
    for _ in range(4):
        verdict = bench.feed(bench.change("elevator_effectiveness", 0.6))
    assert verdict is not None
    assert verdict.cause.name == "elevator_effectiveness"
    assert verdict.log_statistic > bench.judge.config.log_threshold


@pytest.mark.parametrize(
    ("cause", "size"),
    [
        ("icing", 0.1),
        ("elevator_effectiveness", 0.4),
        ("aileron_effectiveness", 0.4),
        ("rudder_effectiveness", 0.4),
    ],
)
def test_each_cause_is_named_with_its_size_and_onset(cause: str, size: float) -> None:
    bench = Bench(4)
    for _ in range(8):
        bench.feed(bench.truth)
    verdict = None
    for _ in range(4):
        verdict = bench.feed(bench.change(cause, size))
    assert verdict is not None
    assert verdict.log_statistic > bench.judge.config.log_threshold
    assert verdict.cause.name == cause
    assert verdict.probability > 0.9
    assert verdict.confirmed
    assert verdict.onset_s == pytest.approx(80.0, abs=10.1)
    assert abs(verdict.size - size) < 3.0 * verdict.size_standard_error + 0.1 * size


def test_a_change_in_no_pattern_is_called_unknown() -> None:
    bench = Bench(5)
    for _ in range(8):
        bench.feed(bench.truth)
    odd = {n: t.copy() for n, t in bench.truth.items()}
    odd["short_period"][4] *= 0.3  # pitch damping alone
    odd["lateral"][6] *= 1.6  # and roll damping the other way
    verdict = None
    for _ in range(4):
        verdict = bench.feed(odd)
    assert verdict is not None
    assert verdict.cause.name == "unknown"


def test_quiet_blocks_neither_accuse_nor_acquit() -> None:
    bench = Bench(6)
    for _ in range(6):
        bench.feed(bench.truth)
    before = bench.feed(bench.change("elevator_effectiveness", 0.5))
    later = None
    for _ in range(5):
        later = bench.feed(bench.truth, quiet=True)
    assert before is not None
    assert later is not None
    assert later.cause.name == before.cause.name
    # each quiet block adds one more possible onset, with a factor of one
    assert later.log_statistic == pytest.approx(before.log_statistic, abs=1e-3)


def test_old_blocks_teach_the_reference_but_not_those_after_an_alarm() -> None:
    bench = Bench(7)
    for _ in range(bench.judge.config.remembered_blocks + 5):
        bench.feed(bench.truth)
    learned = bench.state.references["short_period"].blocks
    assert learned == 5
    onset_s = bench.time_s
    for _ in range(bench.judge.config.remembered_blocks + 10):
        bench.feed(bench.change("elevator_effectiveness", 0.5), onset_s=onset_s)
    kept = bench.state.references["short_period"].blocks
    assert kept == learned + bench.judge.config.remembered_blocks


@pytest.mark.parametrize("founded", [False, True])
def test_blocks_of_a_suspected_change_do_not_teach_the_reference_either(founded: bool) -> None:
    """Without an alert so far, as where nothing is confirmed; a restart keeps blocks and references as they are."""
    bench = Bench(7, founded=founded)
    for _ in range(bench.judge.config.remembered_blocks + 5):
        bench.feed(bench.truth)
    learned = bench.state.references["short_period"].blocks
    for _ in range(2 * bench.judge.config.remembered_blocks):
        verdict = bench.feed(bench.change("elevator_effectiveness", 0.5))
    assert verdict is not None
    assert verdict.log_statistic > 0.5 * bench.judge.config.log_threshold
    kept = bench.state.references["short_period"].blocks
    assert (
        learned + bench.judge.config.remembered_blocks - 1
        <= kept
        <= learned + bench.judge.config.remembered_blocks
    )
    assert verdict.size == pytest.approx(0.5, abs=0.05)  # still beside what was before


def with_evidence(block: BlockView, estimator: int, values: dict[str, np.ndarray] | None) -> BlockView:
    """A block in which one estimator has found these values; None: nothing at all."""
    modes = {}
    for name, mode in block.modes.items():
        information, vector = mode.evidence.information.copy(), mode.evidence.vector.copy()
        information[estimator] = information[estimator] if values else 0.0
        vector[estimator] = information[estimator] @ values[name] if values else 0.0
        modes[name] = replace(mode, evidence=Evidence(information, vector, mode.evidence.bias))
    return BlockView(block.end_s, block.condition, modes)


@pytest.mark.parametrize("estimator", [FOURIER, EKF])
def test_the_other_estimator_must_not_deny_it(estimator: int) -> None:
    bench = Bench(8)
    for _ in range(6):
        bench.feed(bench.truth)
    verdict = bench.feed(bench.change("elevator_effectiveness", 0.6))
    assert verdict is not None
    assert verdict.confirmed
    changed = bench.state.blocks[-1]
    for values, confirmed in ((bench.truth, False), (None, True)):
        bench.state.blocks[-1] = with_evidence(changed, estimator, values)
        again = bench.judge._verdict(bench.state)
        assert again is not None
        assert again.confirmed == confirmed
        assert again.cause is verdict.cause
        assert again.log_statistic == pytest.approx(verdict.log_statistic - np.log(2.0), abs=0.1)


def test_each_estimator_is_compared_with_what_itself_has_found_before() -> None:
    """One that finds everything a tenth too large, as in rough air, finds no change, nor does the other beside it."""
    bench = Bench(9)
    verdicts = [bench.feed(bench.truth, bias=0.1) for _ in range(bench.judge.config.remembered_blocks + 12)]
    assert max(v.log_statistic for v in verdicts if v is not None) < 0.5 * bench.judge.config.log_threshold
    assert bench.state.by_filter["lateral"].blocks == bench.state.references["lateral"].blocks > 10


def test_a_direction_in_which_more_was_taken_back_than_learned_says_nothing() -> None:
    natural = np.array([2.0, 0.1, 5.0])
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    matrix = (axes * [400.0, 0.5, -30.0]) @ axes.T / np.outer(natural, natural)
    value = np.array([1.9, 0.11, 4.5])
    information, vector = informative_part(matrix, matrix @ value, natural)
    scaled = information * np.outer(natural, natural)
    np.testing.assert_allclose(scaled, 400.0 * np.outer(axes[:, 0], axes[:, 0]), atol=1e-9)
    np.testing.assert_allclose(vector, information @ value, rtol=1e-9)


def test_onsets_together_say_what_each_says_alone() -> None:
    """A structure that has no block since an onset takes no part in what is said of it."""
    bench = Bench(5)
    for k in range(9):
        changed = bench.change("rudder_effectiveness", 0.3) if k > 4 else bench.truth
        bench.feed({n: t for n, t in changed.items() if n == "lateral" or k < 6})
    judge, state = bench.judge, bench.state
    onsets = np.arange(1, 9)
    together, present = judge._changes_of_all(state, onsets, onsets)
    assert present.tolist() == [[True] * 5 + [False] * 3, [True] * 8]
    found = judge._directed(together, CAUSES, CONDITION)
    for column, onset in enumerate(onsets):
        alone, seen = judge._changes_of_all(state, np.array([onset]), np.array([onset]))
        assert set(alone) == ({"short_period", "lateral"} if onset < 6 else {"lateral"})
        for k, cause in enumerate(CAUSES):
            for several, single in zip(found, judge._directed(alone, (cause,), CONDITION), strict=True):
                assert several[k, column] == pytest.approx(single[0, 0], rel=1e-9, abs=1e-9)
        anything = _anything(together, present)[column]
        assert anything == pytest.approx(_anything(alone, seen)[0], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("since", "left"), [(2, 0), (6, 4)])
def test_blocks_of_a_change_that_is_over_leave(since: int, left: int) -> None:
    """Only where enough of them agree with the time before do the latest stay."""
    bench = Bench(3)
    for _ in range(10):
        bench.feed(bench.truth)
    onset_s = bench.time_s
    before = len(bench.state.blocks)
    for _ in range(since):
        bench.feed(bench.truth, onset_s=onset_s)
    bench.judge.forget_change(bench.state, onset_s, 4)
    assert sum(block.end_s > onset_s for block in bench.state.blocks) == left
    assert sum(block.end_s <= onset_s for block in bench.state.blocks) <= before
