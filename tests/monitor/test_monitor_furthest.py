"""Which derivative is furthest from what is expected: as the documents of both estimators have it, for many at once."""

import math
from typing import Any

import pytest

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.monitor import MonitorStart, VehicleMonitor, WorstDerivative
from wingwatch.monitor.detection.furthest import PendingWorst, furthest
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

CONDITIONS = {
    "aerosonde": FlightCondition(25.0, 1000.0),
    "ultrastick25e": FlightCondition(17.0, 300.0),
}
SAID = ("settling", "converged")


def watched(
    aircraft: str, seed: int, seconds: float, like: VehicleMonitor | None = None, vanes: bool = True
) -> VehicleMonitor:
    file, condition = load_aircraft(aircraft), CONDITIONS[aircraft]
    scenario = Scenario(
        file,
        condition.airspeed_true_m_s,
        condition.altitude_m,
        manoeuvres=(doublet_schedule(file, condition),),
        turbulence="light",
        seed=seed,
    )
    values = simulate(scenario, seconds).values.copy()
    if not vanes:
        values[:, [CHANNEL_INDEX["angle_of_attack_rad"], CHANNEL_INDEX["sideslip_rad"]]] = math.nan
    flight = SampleBlock(values)
    start = MonitorStart(chain=like.chain) if like else None
    monitor = VehicleMonitor(file, "f", f"v{seed}", flight.present, {}, new_id=lambda: "1", start=start)
    monitor.feed(flight)
    return monitor


@pytest.fixture(scope="module")
def monitors() -> list[VehicleMonitor]:
    first = watched("aerosonde", 1, 40.0)
    return [
        first,
        watched("aerosonde", 2, 220.0, first),  # with references of its own flight
        watched("ultrastick25e", 3, 30.0),
        watched("aerosonde", 4, 12.0, first),
        watched("aerosonde", 5, 1.0, first),  # no solution yet that says anything
        watched("aerosonde", 6, 30.0, vanes=False),  # nothing is compared
    ]


def pending(monitors: list[VehicleMonitor]) -> list[PendingWorst]:
    for monitor in monitors:
        monitor._worst = None
    found = [monitor.pending_worst for monitor in monitors]
    assert all(o is not None for o in found)
    return [o for o in found if o is not None]


def by_document(monitor: VehicleMonitor) -> WorstDerivative | None:
    """From the numbers that REST gives of the same solution."""
    assert monitor._memory.latest is not None
    both: dict[str, Any] = monitor.derivatives(monitor._memory.latest)["estimators"]
    worst: WorstDerivative | None = None
    for structure in monitor._compared:
        rows = {name: both[name][structure.name]["derivatives"] for name in ("fourier", "ekf")}
        for symbol in structure.derivatives:
            z = {
                name: (row["value"] - row["expected"])
                / math.hypot(row["standard_error"], row["expected_standard_error"])
                for name, of in rows.items()
                if (row := of[symbol])["outcome"] in SAID and "expected" in row
            }
            if not z:
                continue
            speaker = min(z, key=lambda name: abs(z[name]))
            if worst is None or abs(z[speaker]) > abs(worst.z):
                worst = WorstDerivative(speaker, structure.name, symbol, z[speaker])
    return worst


def test_it_is_the_one_of_the_documents(monitors: list[VehicleMonitor]) -> None:
    found = furthest(pending(monitors))
    assert [w is None for w in found] == [False, False, False, False, True, True]
    assert any(r.blocks for r in monitors[1].references.values())
    for monitor, worst in zip(monitors, found, strict=True):
        expected = by_document(monitor)
        assert (worst is None) == (expected is None)
        if worst is not None and expected is not None:
            assert (worst.estimator, worst.structure, worst.derivative) == (
                expected.estimator, expected.structure, expected.derivative,
            )  # fmt: skip
            assert worst.z == pytest.approx(expected.z, rel=1e-12)


def test_company_changes_nothing(monitors: list[VehicleMonitor]) -> None:
    """To the bit."""
    together = furthest(pending(monitors))
    assert together == [furthest([o])[0] for o in pending(monitors)]
    assert together == furthest(pending(monitors)[::-1])[::-1]
    assert furthest([]) == []


def test_it_is_worked_out_once_a_solution(monitors: list[VehicleMonitor]) -> None:
    first = monitors[0]
    first._worst = None
    worst = first.worst()
    assert worst is not None
    assert first.pending_worst is None
    assert first.worst() is worst
