"""What a diagnosis says joins an alert, and neither undoes what the monitor or a person has done since."""

from dataclasses import replace

import pytest
from fleet_hall import OLD_ALERT

from wingwatch.monitor import AlertFinding, AlertState, AlertView, CandidateView, Correction
from wingwatch.monitor.fleet.alert_ledger import AlertLedger

RAISED = replace(OLD_ALERT, id="a", kind="unexplained", cause="unknown", size=0.3, size_standard_error=0.03)
SHIFT = Correction(
    "damage", "cg_shift", "critical", 0.03, 0.001, 0.99, "Centre of gravity.", None,
    (CandidateView("cg_shift", None, 0.99),),
)  # fmt: skip
CORRECTED = AlertFinding(RAISED, "diagnosis: corrects unknown to cg_shift", SHIFT, "d1")
ICED = replace(OLD_ALERT, id="a", size=0.1, size_standard_error=0.02)
SHARPENED = AlertFinding(
    ICED, "diagnosis: confirms icing 0.12",
    Correction("icing", "icing", "warning", 0.12, 0.005, 0.99, "Icing.", None), "d2",
)  # fmt: skip


def ledger_with(alert: AlertView) -> AlertLedger:
    ledger = AlertLedger(10)
    ledger.merge(alert)
    ledger.note_taken_over(alert.id)
    return ledger


def test_a_decided_diagnosis_changes_name_size_and_candidates_and_is_to_be_saved() -> None:
    ledger = ledger_with(RAISED)
    shown = ledger.diagnosed("a", CORRECTED)
    assert shown is not None
    assert (shown.kind, shown.cause, shown.level, shown.size) == ("damage", "cg_shift", "critical", 0.03)
    assert (shown.diagnosis_id, shown.candidates, shown.note) == ("d1", SHIFT.candidates, (CORRECTED.note,))
    assert ledger.newest("a") == shown
    assert [one.id for one in ledger.unsaved] == ["a"]


def test_an_undecided_one_leaves_a_note_alone() -> None:
    shown = ledger_with(RAISED).diagnosed(
        "a", AlertFinding(RAISED, "diagnosis: cannot distinguish", None, "d")
    )
    assert shown == replace(RAISED, note=("diagnosis: cannot distinguish",), diagnosis_id="d")


def test_a_correction_stays_while_the_monitor_says_the_same_cause() -> None:
    ledger = ledger_with(RAISED)
    first = ledger.diagnosed("a", CORRECTED)
    assert first is not None
    later = ledger.merge(replace(RAISED, size=0.35, note=first.note))
    assert (later.cause, later.size, later.note) == ("cg_shift", 0.03, (CORRECTED.note,))


def test_a_cause_that_the_monitor_finds_later_counts_more() -> None:
    ledger = ledger_with(RAISED)
    ledger.diagnosed("a", CORRECTED)
    later = ledger.merge(replace(RAISED, kind="icing", cause="icing", size=0.2))
    assert (later.cause, later.size) == ("icing", 0.2)


def test_a_cause_that_the_monitor_found_meanwhile_is_not_undone() -> None:
    ledger = ledger_with(RAISED)
    meanwhile = ledger.merge(replace(RAISED, kind="icing", cause="icing", size=0.2))
    shown = ledger.diagnosed("a", CORRECTED)
    assert shown == replace(meanwhile, note=(CORRECTED.note,), diagnosis_id="d1")


@pytest.mark.parametrize("before", [True, False])
def test_a_size_that_the_monitor_has_updated_since_counts_more_than_a_confirmed_one(before: bool) -> None:
    ledger, grown = ledger_with(ICED), replace(ICED, size=0.2)
    if before:
        ledger.merge(grown)
    shown = ledger.diagnosed("a", SHARPENED)
    assert shown is not None
    assert shown.size == (0.2 if before else 0.12)
    assert ledger.merge(replace(grown, note=shown.note)).size == 0.2


def test_what_persons_did_stays_and_growth_brings_a_shelved_alert_back() -> None:
    ledger = ledger_with(RAISED)
    ledger.acted(replace(RAISED, state=AlertState.ACKNOWLEDGED, note=("ada: acknowledge",)))
    shown = ledger.diagnosed("a", CORRECTED)
    assert shown is not None
    assert (shown.state, shown.note) == (AlertState.ACKNOWLEDGED, ("ada: acknowledge", CORRECTED.note))


def test_a_cleared_alert_gets_the_note_alone() -> None:
    ledger = ledger_with(RAISED)
    cleared = ledger.merge(replace(RAISED, state=AlertState.CLEARED, cleared_s=50.0))
    assert ledger.diagnosed("a", CORRECTED) == replace(cleared, note=(CORRECTED.note,), diagnosis_id="d1")


def test_an_alert_that_is_cleared_after_its_correction_keeps_the_name() -> None:
    ledger = ledger_with(RAISED)
    ledger.diagnosed("a", CORRECTED)
    cleared = ledger.merge(replace(RAISED, state=AlertState.CLEARED, cleared_s=50.0))
    assert (cleared.cause, cleared.state) == ("cg_shift", AlertState.CLEARED)


def test_an_alert_that_is_not_kept_is_not_made() -> None:
    assert AlertLedger(10).diagnosed("a", CORRECTED) is None


def test_the_version_that_a_diagnosis_begins_with_is_the_monitors_own() -> None:
    ledger = ledger_with(RAISED)
    ledger.diagnosed("a", CORRECTED)
    assert ledger.own("a") == RAISED
