"""Vehicles of one type share the estimators; what is said of one does not depend on its company, to the bit."""

from collections.abc import Sequence
from dataclasses import replace

from wingwatch.aircraft import SHORT_PERIOD, load_aircraft
from wingwatch.baselines import Envelope, apriori_envelope
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import AircraftMessage, SampleBlock

AIRCRAFT = load_aircraft("aerosonde")
SECONDS, RATE_HZ, PIECE = 14.0, 50.0, 10


def flights() -> list[SampleBlock]:
    """One in rough air with doublets, one in still air that begins its own a little later."""
    schedules = [doublet_schedule(AIRCRAFT, Scenario(AIRCRAFT).condition, start_s=s) for s in (1.0, 2.5)]
    fleet = FleetSimulation(
        [
            Scenario(AIRCRAFT, manoeuvres=(schedules[0],), turbulence="moderate", seed=5),
            Scenario(AIRCRAFT, manoeuvres=(schedules[1],), seed=6),
        ],
        RATE_HZ,
    )
    return [SampleBlock(values) for values in fleet.step(round(SECONDS * RATE_HZ))]


def made(maker: MonitorMaker, name: str, given: Sequence[str], memory: VehicleMemory) -> VehicleMonitor:
    return maker.make("f", name, AIRCRAFT, AircraftMessage(aircraft="aerosonde"), given, memory)


def maker() -> MonitorMaker:
    return MonitorMaker(lambda: "1", JudgeConfig())


def reported(monitors: Sequence[VehicleMonitor], blocks: Sequence[SampleBlock]) -> list[str]:
    """What each monitor says in the end, its flight handed over a piece at a time, by turns."""
    for start in range(0, len(blocks[0]), PIECE):
        for monitor, block in zip(monitors, blocks, strict=True):
            monitor.feed(SampleBlock(block.values[start : start + PIECE]))
    return [repr((m.derivatives(), m.view())) for m in monitors]


def test_a_vehicle_does_not_depend_on_its_company() -> None:
    blocks = flights()
    given = blocks[0].present
    one = maker()
    together = reported([made(one, f"v{i}", given, VehicleMemory()) for i in range(2)], blocks)
    alone = [
        reported([made(maker(), f"v{i}", given, VehicleMemory())], [block])[0]
        for i, block in enumerate(blocks)
    ]
    assert together == alone


def test_estimators_are_shared_by_type_channels_and_what_is_stored_and_expectations_are_not() -> None:
    one, present = maker(), flights()[0].present
    fewer = [name for name in present if name != "sideslip_rad"]
    other = VehicleMemory(envelopes={"short_period": apriori_envelope(AIRCRAFT, SHORT_PERIOD, "clean")})
    first, second = (made(one, f"v{i}", present, VehicleMemory()) for i in range(2))
    apart = [made(one, "v2", fewer, VehicleMemory()), made(one, "v3", present, other)]
    assert first.chain.supervisor is second.chain.supervisor
    assert all(m.chain.supervisor is not first.chain.supervisor for m in apart)
    second.adopt(other)
    assert second.chain.envelopes["short_period"] is other.envelopes["short_period"]
    assert first.chain.envelopes["short_period"] is not other.envelopes["short_period"]


def stored(factor: float = 1.0) -> VehicleMemory:
    """What a database gives of a type each time it is asked: new objects, values times a factor."""
    found = apriori_envelope(AIRCRAFT, SHORT_PERIOD, "clean")
    points = [
        replace(p, value=p.value * factor, covariance=p.covariance.copy(), source="flown")
        for p in found.points
    ]
    return VehicleMemory(envelopes={"short_period": Envelope(AIRCRAFT, SHORT_PERIOD, points)})


def test_vehicles_of_which_the_same_is_stored_share_estimators_and_those_of_another_baseline_do_not() -> None:
    blocks = flights()
    one, present = maker(), blocks[0].present
    first, second = (made(one, f"v{i}", present, stored()) for i in range(2))
    other = made(one, "v2", present, stored(factor=1.1))
    plain = made(one, "v3", present, VehicleMemory())
    assert first.chain.supervisor is second.chain.supervisor
    assert len({id(m.chain.supervisor) for m in (first, other, plain)}) == 3
    assert first.chain.envelopes["short_period"].points[0].source == "flown"
    together = reported([first, second], blocks)
    alone = [reported([made(maker(), f"v{i}", present, stored())], [b])[0] for i, b in enumerate(blocks)]
    assert together == alone
