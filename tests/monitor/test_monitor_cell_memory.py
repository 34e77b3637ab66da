"""Memory by cell: kept where it was learned, resumed on return, dropped where fresh blocks contradict it."""

from dataclasses import replace

import numpy as np

from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.baselines import Cell, CellMemory, Reference
from wingwatch.estimators import BlockEvidence
from wingwatch.monitor import CellBook, CellPlace, MonitorStart, VehicleMemory, VehicleMonitor
from wingwatch.monitor.detection.comparison import Coordinates
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import SampleBlock, complete

AEROSONDE = load_aircraft("aerosonde")
SLOW, FAST = FlightCondition(25.0, 1000.0), FlightCondition(33.0, 1000.0)
COORDINATES = Coordinates(SHORT_PERIOD, AEROSONDE, (SLOW.airspeed_true_m_s, SLOW.air_density_kg_m3))
NAME = SHORT_PERIOD.name
TRUTH = np.array([-4.1, -0.7, -2.4, -4.3, -6.0, -32.5])
"""Referred, about the Aerosonde's."""
K = TRUTH.size
INFORMATION = np.diag(50.0 / TRUTH**2)
"""Of a block: 14 % of each derivative."""


def natural() -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.abs(TRUTH / COORDINATES.at(SLOW).slope)


def block(
    number: int, value: np.ndarray[tuple[int], np.dtype[np.float64]] = TRUTH, informs: bool = True
) -> BlockEvidence:
    information = INFORMATION * float(informs)
    at = (25.0, 1000.0, 1.11, 0.05)
    return BlockEvidence(
        number, 10.0 * number, 10.0 * number + 10.0, information, information @ value, np.zeros(K), at
    )


def feed(book: CellBook, numbers: range, condition: FlightCondition) -> list[object]:
    return [book.block(NAME, block(n), condition, natural()) for n in numbers]


def cells_of(book: CellBook) -> dict[CellPlace, CellMemory]:
    return {place: CellMemory(taught, 0.0) for place, taught in book.take_changed().items()}


def test_a_first_visit_replaces_nothing_and_is_learned() -> None:
    book = CellBook({NAME: COORDINATES})
    assert feed(book, range(4), SLOW) == [None] * 4
    changed = book.take_changed()
    assert {place: taught.blocks for place, taught in changed.items()} == {(NAME, Cell(23, 1)): 4}
    assert book.take_changed() == {}
    assert book.text == ""


def test_a_return_resumes_what_the_cell_taught_and_carries_in_what_was_left() -> None:
    book = CellBook({NAME: COORDINATES})
    feed(book, range(6), SLOW)
    assert feed(book, range(6, 8), FAST) == [None, None]
    resumed = book.block(NAME, block(8), SLOW, natural())
    assert resumed is not None
    information, vector = resumed
    assert "short_period resumed from 60 s of own flight at 23 to 27 m/s" in book.text
    np.testing.assert_allclose(np.linalg.solve(information, vector), TRUTH, rtol=0.02)
    blocks = np.diag(information) / np.diag(INFORMATION)
    assert (blocks > 1.0).all()
    assert (blocks < 9.0).all()


def test_another_flight_resumes_it_with_an_error_that_grew() -> None:
    first = CellBook({NAME: COORDINATES})
    feed(first, range(20), SLOW)
    kept = cells_of(first)
    known = []
    for age_s in (0.0, 30.0 * 86_400.0):
        book = CellBook({NAME: COORDINATES}, {p: replace(m, age_s=age_s) for p, m in kept.items()})
        resumed = book.block(NAME, block(0, informs=False), SLOW, natural())
        assert resumed is not None
        known.append(np.linalg.inv(resumed[0]))
    added = np.diag(known[1] - known[0]) / TRUTH**2
    np.testing.assert_allclose(np.sqrt(added), 0.05 * np.sqrt(30.0), rtol=0.02)


def test_a_fresh_block_that_contradicts_has_the_memory_dropped() -> None:
    first = CellBook({NAME: COORDINATES})
    feed(first, range(20), SLOW)
    book = CellBook({NAME: COORDINATES}, cells_of(first))
    assert book.block(NAME, block(0, informs=False), SLOW, natural()) is not None
    changed = TRUTH.copy()
    changed[5] *= 0.1
    replaced = book.block(NAME, block(1, changed), SLOW, natural())
    assert replaced is not None
    information, vector = replaced
    np.testing.assert_allclose(np.linalg.solve(information, vector), changed, rtol=1e-6)
    assert book.text == ""


def test_a_new_memory_replaces_a_contradicted_one_only_when_it_has_lasted() -> None:
    first = CellBook({NAME: COORDINATES})
    feed(first, range(20), SLOW)
    kept, changed = cells_of(first), 0.5 * TRUTH
    book = CellBook({NAME: COORDINATES}, kept)
    for n in range(5):
        book.block(NAME, block(n, changed), SLOW, natural())
        assert book.take_changed() == {}
    book.block(NAME, block(5, changed), SLOW, natural())
    assert book.take_changed()[NAME, Cell(23, 1)].blocks == 6

    faulty = CellBook({NAME: COORDINATES}, kept)
    for n in range(8):
        faulty.block(NAME, block(n, changed), SLOW, natural(), alarmed=n >= 3)
    assert faulty.take_changed() == {}


def test_while_an_alert_stands_nothing_is_learned_or_resumed_and_rough_air_teaches_nothing() -> None:
    first = CellBook({NAME: COORDINATES})
    feed(first, range(5), SLOW)
    book = CellBook({NAME: COORDINATES}, cells_of(first))
    assert book.block(NAME, block(0), SLOW, natural(), alarmed=True) is None
    assert book.block(NAME, block(1, 0.5 * TRUTH), SLOW, natural(), rough=True) is not None
    assert "resumed" in book.text
    assert book.take_changed() == {}


def test_what_is_not_finite_or_of_another_size_is_passed_over() -> None:
    book = CellBook({NAME: COORDINATES}, {(NAME, Cell(23, 1)): CellMemory(Reference.empty(3), 0.0)})
    broken = replace(block(0), vector=np.full(K, np.nan))
    assert book.block(NAME, broken, SLOW, natural()) is None
    nowhere = FlightCondition(25.0, 1000.0)
    assert book.block(NAME, block(1), nowhere, natural()) is None


def test_a_second_flight_starts_from_what_the_first_one_learned() -> None:
    """Fifteen seconds into the second flight its errors are smaller than without memory, and it says why."""
    doublets = (doublet_schedule(AEROSONDE, SLOW, np.deg2rad(2.0)),)

    def monitor(samples: SampleBlock, cells: dict[CellPlace, CellMemory]) -> VehicleMonitor:
        return VehicleMonitor(
            AEROSONDE, "default", "uav", samples.present, {}, new_id=lambda: "alert",
            start=MonitorStart(memory=VehicleMemory(cells=cells)),
        )  # fmt: skip

    flights = [
        complete(simulate(Scenario(AEROSONDE, manoeuvres=doublets, seed=seed), 61.0)) for seed in (3, 4)
    ]
    first = monitor(flights[0], {})
    first.feed(flights[0])
    kept = cells_of(first.cells)
    assert kept
    second, alone = monitor(flights[1], kept), monitor(flights[1], {})
    start = SampleBlock(flights[1].values[:750])
    resumed, bare = (list(m.feed(start).solutions)[-1].modes[NAME].fourier for m in (second, alone))
    assert (resumed.standard_error < bare.standard_error).all()
    assert "short_period resumed from" in second.basis_text
    assert "resumed" not in alone.basis_text
