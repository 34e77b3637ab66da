"""A baseline that others change while a vehicle flies: the flight goes on with it, and says so."""

import numpy as np
import pytest
from fleet_hall import AEROSONDE, PIECE, FakeCheckpoints, FakeStore, Hall, fly_doublets

from wingwatch.aircraft import SHORT_PERIOD, Provenance
from wingwatch.baselines import ChangeRecord, Envelope, Expectation, Reference, american, apriori_envelope
from wingwatch.monitor import FleetSettings, JudgeConfig
from wingwatch.telemetry import SampleBlock

STATED = apriori_envelope(AEROSONDE, SHORT_PERIOD)


def earlier() -> Reference:
    """Flights that agree with the aircraft's file, ten times as exact."""
    at = STATED.points[len(STATED.points) // 2]
    value, covariance = american(at.value, at.covariance, SHORT_PERIOD, AEROSONDE, at.condition)
    information = np.diag(100.0 / np.diagonal(covariance))
    return Reference(information, information @ value, blocks=500, seconds=5000.0)


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(60.0)


def change(vehicle: str | None = "uav", number: int = 1, action: str = "revert") -> ChangeRecord:
    fleet = None if vehicle is None else "default"
    return ChangeRecord(1000.0, action, "ada", "aerosonde", "clean", "version 3", fleet, vehicle, number)


def hall_with(checkpoints: FakeCheckpoints | None = None) -> Hall:
    settings = FleetSettings(judge=JudgeConfig(remembered_blocks=2))
    return Hall(settings, FakeStore(known={"short_period": earlier()}), checkpoints)


def blocks(hall: Hall) -> int:
    return max((number for _, number in hall.store.learned), default=0)


def test_what_was_taken_back_counts_no_more_and_is_not_written_again(flight: SampleBlock) -> None:
    hall = hall_with()
    hall.announce()
    hall.fly(flight, 0, 35)
    assert blocks(hall) > 500
    hall.store.known, hall.store.newest, hall.store.changes = {}, 1, [change()]
    hall.store.unread = True  # it is being read again: nothing is written meanwhile
    hall.fleet.tick()
    written = len(hall.store.learned)
    hall.fly(flight, 35, 50)
    assert len(hall.store.learned) == written
    assert "was changed" not in hall.view().basis_text
    hall.store.unread = False
    hall.fleet.tick()
    assert (
        "The baseline was changed by ada at 1970-01-01 00:16 UTC (revert: version 3)"
        in hall.view().basis_text
    )
    hall.fly(flight, 50, 60)
    assert 0 < hall.store.learned[-1][1] < 500
    assert hall.view().counts["accepted"] == 60 * PIECE
    assert not hall.fleet.problems


def test_a_change_of_others_or_one_that_is_known_already_changes_nothing(flight: SampleBlock) -> None:
    hall = hall_with()
    hall.store.newest = 7
    hall.announce()
    hall.fly(flight, 0, 5)
    asked = len(hall.store.asked)
    other = ChangeRecord(1.0, "learn", "", "twin", "clean", "x", id=9)
    hall.store.changes = [change("other", 8), other, change("uav", 7)]
    hall.fleet.tick()
    assert len(hall.store.asked) == asked
    assert "was changed" not in hall.view().basis_text


def test_expectations_of_the_type_come_and_go_while_it_flies(flight: SampleBlock) -> None:
    hall = hall_with()
    hall.announce()
    hall.fly(flight, 0, 5)
    points = [
        Expectation(SHORT_PERIOD, p.value * 2.0, p.covariance, Provenance.IDENTIFIED, p.condition, "flights")
        for p in STATED.points
    ]

    def expected() -> float:
        row = hall.derivatives()["estimators"]["fourier"]["short_period"]["derivatives"]["m_q"]
        assert isinstance(row["expected"], float)
        return row["expected"]

    hall.store.known, hall.store.newest = {}, 1
    hall.store.envelopes = {"short_period": Envelope(AEROSONDE, SHORT_PERIOD, points)}
    hall.store.changes = [change(None, 1, "learn")]
    hall.fleet.tick()
    doubled = expected()
    hall.store.envelopes, hall.store.newest, hall.store.changes = {}, 2, [change(None, 2, "delete")]
    hall.fleet.tick()
    assert doubled == pytest.approx(2.0 * expected(), rel=0.1)
    assert "(delete: version 3)" in hall.view().basis_text


def test_a_vehicle_that_goes_on_takes_in_what_was_changed_meanwhile(flight: SampleBlock) -> None:
    checkpoints = FakeCheckpoints()
    hall = hall_with(checkpoints)
    hall.announce()
    hall.fly(flight, 0, 35)
    for saved in hall.fleet.unsaved():
        checkpoints.keep(saved, False)
    later = hall_with(checkpoints)
    assert checkpoints.counts["resumed"] == 1
    later.store.known, later.store.newest, later.store.changes = {}, 3, [change("uav", 3)]
    later.fleet.tick()
    assert "was changed by ada" in later.view().basis_text
    later.sequence = hall.sequence
    later.fly(flight, 35, 60)
    assert 0 < later.store.learned[-1][1] < 500
