"""An alert's life, on verdicts made by hand and on blocks without noise."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.baselines import Expectation, apriori_envelope
from wingwatch.monitor import AlertAction, AlertState, AlertView
from wingwatch.monitor.detection.alerts import CLEAR_BLOCKS, AlertBook, act
from wingwatch.monitor.detection.blocks import BlockView, Evidence, ModeBlock
from wingwatch.monitor.detection.causes import CAUSES, UNEXPLAINED, Cause
from wingwatch.monitor.detection.comparison import Change, Coordinates, change_since
from wingwatch.monitor.detection.judge import Judge
from wingwatch.monitor.detection.judge_state import JudgeState, Verdict

AIRCRAFT = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.05)
ICING, ELEVATOR = CAUSES[0], CAUSES[1]
NAME = SHORT_PERIOD.name
SYMBOLS = SHORT_PERIOD.derivatives
RELATIVE_ERROR = 0.05
BLOCK_S = 10.0


class Life:
    """A judge, a book and hand-made input for both."""

    def __init__(self) -> None:
        self.coordinates = Coordinates(SHORT_PERIOD, AIRCRAFT, (25.0, 1.1116))
        self.judge = Judge({NAME: self.coordinates})
        self.state: JudgeState = self.judge.init({}, False)
        ids = count(1)
        self.book = AlertBook("default", "uav", lambda: f"a{next(ids)}")
        found = apriori_envelope(AIRCRAFT, SHORT_PERIOD).lookup(CONDITION)
        assert isinstance(found, Expectation)
        self.truth, self.spread = self.coordinates.at(CONDITION).from_concise(found.value, found.covariance)
        self.information = np.diag((RELATIVE_ERROR * np.abs(self.truth)) ** -2.0)
        self.time_s = 0.0

    def block(self, size: float = 0.0, *, quiet: bool = False) -> BlockView:
        """A block without noise in which the elevator has lost ``size``."""
        self.time_s += BLOCK_S
        value = self.truth + size * self.judge.directions(NAME, (ELEVATOR,), self.truth, CONDITION)[0]
        information = 0.0 * self.information if quiet else self.information
        evidence = Evidence(
            *(np.stack([part, part]) for part in (information, information @ value, 0.0 * value))
        )
        return BlockView(self.time_s, CONDITION, {NAME: ModeBlock(evidence, self.truth, self.spread)})

    def fly(self, size: float = 0.0) -> AlertView | None:
        """One block through judge and book."""
        verdict = self.judge.consider(self.state, self.block(size), self.book.onset_s)
        return self._follow(verdict)

    def hear(self, verdict: Verdict | None, *, quiet: bool = False) -> AlertView | None:
        """One verdict straight to the book, after a block that says nothing of a change."""
        self.state.blocks = [self.block(quiet=quiet)]
        return self._follow(verdict)

    def _follow(self, verdict: Verdict | None) -> AlertView | None:
        onset_s = self.book.onset_s
        alert = self.book.follow(self.judge, self.state, verdict, CONDITION, self.time_s, "a-priori")
        if alert is not None and alert.cleared_s is not None and onset_s is not None:
            self.judge.forget_change(self.state, onset_s, CLEAR_BLOCKS)
        return alert

    def verdict(
        self, cause: Cause = ELEVATOR, probability: float = 0.999, *, strong: bool = True, confirmed: bool = True,
        size: float = 0.4, error: float = 0.05, changes: Mapping[str, Change] | None = None,
    ) -> Verdict:  # fmt: skip
        return Verdict(
            self.judge.config.log_threshold + (3.0 if strong else -3.0), cause, probability,
            probability if cause is UNEXPLAINED else 0.2 * (1.0 - probability), 1, 5.0, size, error,
            changes or {}, confirmed,
        )  # fmt: skip


@pytest.fixture
def life() -> Life:
    return Life()


def test_nothing_is_raised_below_the_threshold_or_before_anything_can_be_said(life: Life) -> None:
    assert life.hear(None) is None
    for _ in range(10):
        assert life.hear(life.verdict(strong=False)) is None
    assert life.book.active is None


def test_a_clear_and_confirmed_cause_is_raised_at_once(life: Life) -> None:
    alert = life.hear(life.verdict())
    assert alert is not None
    assert alert is life.book.active
    assert (alert.id, alert.kind, alert.cause) == ("a1", "damage", "elevator_effectiveness")
    assert (alert.state, alert.raised_s, alert.cleared_s) == (AlertState.ACTIVE, 10.0, None)
    assert (alert.size, alert.size_standard_error, alert.level) == (0.4, 0.05, "warning")
    assert "40 ± 5 %" in alert.text
    assert life.book.onset_s == 5.0


def test_what_the_other_estimator_denies_is_not_raised(life: Life) -> None:
    for _ in range(3 * life.judge.config.patience_blocks):
        assert life.hear(life.verdict(confirmed=False)) is None
    alert = life.hear(life.verdict())
    assert alert is not None
    assert alert.cause == "elevator_effectiveness"


def test_an_unclear_cause_becomes_unexplained_when_patience_ends(life: Life) -> None:
    shift = np.zeros(len(SYMBOLS))
    shift[SYMBOLS.index("m_q")] = 0.3 * abs(life.truth[SYMBOLS.index("m_q")])
    after = life.truth + shift
    change = change_since(
        life.truth, 1e-9 * np.diag(life.truth**2), life.information, life.information @ after,
        np.zeros_like(life.information), np.abs(life.truth),
    )  # fmt: skip
    unclear = life.verdict(ICING, 0.6, size=0.07, changes={NAME: change})
    for _ in range(life.judge.config.patience_blocks - 1):
        assert life.hear(unclear) is None
    alert = life.hear(unclear)
    assert alert is not None
    assert (alert.kind, alert.cause) == ("unexplained", "unknown")
    # the size is that of the derivative which changed most, not the severity of the ice that it was not called
    assert alert.size == pytest.approx(0.3, rel=1e-6)
    assert alert.size_standard_error == pytest.approx(RELATIVE_ERROR, rel=1e-6)
    assert alert.probability == pytest.approx(0.2 * (1.0 - 0.6))
    assert alert.evidence[0].derivative == "m_q"


def test_quiet_blocks_do_not_use_up_patience(life: Life) -> None:
    unclear = life.verdict(ICING, 0.6)
    assert life.hear(unclear) is None
    for _ in range(5):
        assert life.hear(unclear, quiet=True) is None
    assert life.hear(unclear) is None
    assert life.hear(unclear) is not None


def test_patience_starts_anew_when_the_statistic_falls(life: Life) -> None:
    unclear = life.verdict(ICING, 0.6)
    for _ in range(4):
        for _ in range(life.judge.config.patience_blocks - 1):
            assert life.hear(unclear) is None
        assert life.hear(life.verdict(strong=False)) is None


def test_a_cause_changes_after_two_clear_blocks_in_a_row(life: Life) -> None:
    assert life.hear(life.verdict()) is not None
    icing = life.verdict(ICING, 0.999, size=0.1, error=0.01)
    assert life.hear(icing) is None
    assert life.hear(life.verdict(ICING, 0.95)) is None  # not much likelier: the count starts over
    assert life.hear(icing) is None
    changed = life.hear(icing)
    assert changed is not None
    assert (changed.id, changed.cause, changed.kind) == ("a1", "icing", "icing")
    assert (changed.size, changed.raised_s) == (0.1, 10.0)
    assert "elevator_effectiveness became icing" in changed.note[-1]
    # and back again takes two as well
    assert life.hear(life.verdict()) is None
    back = life.hear(life.verdict())
    assert back is not None
    assert back.cause == "elevator_effectiveness"


def test_only_a_size_that_has_moved_or_a_new_level_is_news(life: Life) -> None:
    assert life.hear(life.verdict(size=0.4, error=0.05)) is not None
    assert life.hear(life.verdict(size=0.43, error=0.05)) is None
    moved = life.hear(life.verdict(size=0.49, error=0.05))
    assert moved is not None
    assert (moved.id, moved.size, moved.level) == ("a1", 0.49, "warning")
    worse = life.hear(life.verdict(size=0.51, error=0.05))
    assert worse is not None
    assert worse.level == "critical"


def test_a_change_that_grows_began_when_it_was_first_seen(life: Life) -> None:
    """The likeliest single onset of ice that grows moves on with it."""
    first = life.hear(replace(life.verdict(size=0.2), onset_s=70.0))
    assert first is not None
    assert "since about 70 s" in first.text
    grown = life.hear(replace(life.verdict(size=0.4), onset_s=80.0))
    assert grown is not None
    assert "since about 70 s" in grown.text
    earlier = life.hear(replace(life.verdict(size=0.6), onset_s=60.0))
    assert earlier is not None
    assert "since about 60 s" in earlier.text


def test_a_dismissed_alert_is_raised_again_if_the_change_persists(life: Life) -> None:
    life.hear(life.verdict())
    life.hear(life.verdict(ICING))  # a first doubt about the cause
    life.book.dismiss()
    assert life.book.active is None
    assert life.book.onset_s is None
    again = life.hear(life.verdict())
    assert again is not None
    assert again.id == "a2"
    assert life.hear(life.verdict(ICING)) is None  # the doubt was about the other alert


def test_an_alert_is_cleared_once_when_the_change_is_gone_and_teaches_nothing(life: Life) -> None:
    for _ in range(8):
        assert life.fly() is None
    during = [a for _ in range(8) if (a := life.fly(0.5)) is not None]
    assert {(a.id, a.cause) for a in during} == {("a1", "elevator_effectiveness")}
    after: list[tuple[int, AlertView]] = []
    for k in range(3 * life.judge.config.remembered_blocks):
        alert = life.fly()
        if alert is not None:
            after.append((k + 1, alert))
    cleared = [(k, a) for k, a in after if a.state is AlertState.CLEARED]
    assert {a.id for _, a in after} == {"a1"}
    assert len(cleared) == 1
    assert cleared[0][0] == CLEAR_BLOCKS
    assert cleared[0][1].cleared_s == (16 + CLEAR_BLOCKS) * BLOCK_S
    assert life.book.active is None
    # blocks without noise: a reference of healthy ones alone is the truth to rounding, with one block
    # of half an elevator it would be off by 0.5 / blocks, a hundredth at least
    reference = life.state.references[NAME]
    assert reference.blocks > life.judge.config.remembered_blocks
    learned = np.linalg.solve(reference.information, reference.vector)
    np.testing.assert_allclose(learned, life.truth, rtol=1e-6)


def test_a_change_that_stays_keeps_its_alert(life: Life) -> None:
    for _ in range(8):
        life.fly()
    states = [a for _ in range(40) if (a := life.fly(0.5)) is not None]
    assert {(a.id, a.state) for a in states} == {("a1", AlertState.ACTIVE)}
    assert life.book.active is not None


@pytest.mark.parametrize(
    ("state", "action", "after"),
    [
        (AlertState.ACTIVE, AlertAction.ACKNOWLEDGE, AlertState.ACKNOWLEDGED),
        (AlertState.ACTIVE, AlertAction.SHELVE, AlertState.SHELVED),
        (AlertState.ACKNOWLEDGED, AlertAction.SHELVE, AlertState.SHELVED),
        (AlertState.SHELVED, AlertAction.UNSHELVE, AlertState.ACTIVE),
        (AlertState.ACTIVE, AlertAction.CLEAR, AlertState.CLEARED),
        (AlertState.SHELVED, AlertAction.CLEAR, AlertState.CLEARED),
        (AlertState.SHELVED, AlertAction.ACKNOWLEDGE, None),
        (AlertState.ACTIVE, AlertAction.UNSHELVE, None),
        (AlertState.CLEARED, AlertAction.ACKNOWLEDGE, None),
        (AlertState.CLEARED, AlertAction.CLEAR, None),
    ],
)
def test_actions(life: Life, state: AlertState, action: AlertAction, after: AlertState | None) -> None:
    alert = AlertView(
        id="a1", fleet="default", vehicle="uav", kind="icing", cause="icing", level="watch", state=state,
        raised_s=1.0, cleared_s=None, size=0.1, size_standard_error=0.1, probability=1.0, basis="a-priori",
        text="Ice.", evidence=(),
    )  # fmt: skip
    if after is None:
        with pytest.raises(ValueError, match=f"alert a1 is {state}; {action} applies to"):
            act(alert, action, "ann", "")
    else:
        done = act(alert, action, "ann", "seen")
        assert done.state is after
        assert done.note == (f"ann: {action} (seen)",)
