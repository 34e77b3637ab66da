"""The air of the last half minute: as strong as flown, whatever the cut of the messages, in bounded memory."""

import numpy as np
import pytest

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor.estimation.air_watch import AirState, AirWatch, PendingAir
from wingwatch.monitor.state_codec import Codec
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, gust_scales
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock
from wingwatch.telemetry.conditioning import VANES, AirQuality

AIRCRAFT = load_aircraft("aerosonde")
RATE_HZ = 50.0
SECONDS = 61.0


def flown(turbulence: Turbulence, seed: int) -> SampleBlock:
    """A patrol without manoeuvres."""
    scenario = Scenario(AIRCRAFT, turbulence=turbulence, seed=seed)
    return SampleBlock(FleetSimulation([scenario], RATE_HZ).step(round(SECONDS * RATE_HZ))[0])


def watched(
    block: SampleBlock, piece: int, state: AirState | None = None, half: int = round(0.5 * RATE_HZ)
) -> list[AirQuality | None]:
    """What is said after every ``half`` samples, the samples handed over in pieces."""
    watch, state, said = AirWatch(AIRCRAFT), state or AirState(), []
    for start in range(0, len(block), half):
        rows = block.values[start : start + half]
        for at in range(0, len(rows), piece):
            watch.take(state, rows[at : at + piece])
        if len(rows) == half:
            watch.look(state, float(rows[-1, 0]))
        said.append(watch.quality(state))
    return said


@pytest.mark.parametrize("turbulence", ["light", "moderate"])
@pytest.mark.parametrize("seed", [81, 82])
def test_gusts_are_as_strong_as_flown(turbulence: Turbulence, seed: int) -> None:
    found = watched(flown(turbulence, seed), 5)[-1]
    assert found is not None
    assert not found.fit_for_estimating
    truth = gust_scales(turbulence, 1000.0).sigma_w_m_s
    for part in found.sigma:
        assert part.observable
        assert abs(part.value - truth) < 3.0 * part.standard_error
        assert part.standard_error < 0.1 * truth


def test_still_air_is_fit_for_estimating() -> None:
    found = watched(flown("none", 83), 5)[-1]
    assert found is not None
    assert found.fit_for_estimating
    assert not any(part.observable for part in found.sigma)


def test_nothing_is_said_before_half_a_minute_and_then_every_half_minute() -> None:
    said = watched(flown("light", 84), 25)
    first = next(k for k, found in enumerate(said) if found is not None)
    assert 0.5 * first == pytest.approx(30.0, abs=0.5)
    assert len({id(found) for found in said[first:]}) == 2


@pytest.mark.parametrize("rate_hz", [50, 1000])
@pytest.mark.parametrize("rest", [0, 7])
def test_the_cut_of_the_messages_changes_no_bit(rate_hz: int, rest: int) -> None:
    """At a solution and between two; in a window that has all its rows, and in one that has more than are kept."""
    values = np.resize(flown("light", 85).values, (31 * rate_hz + rest, len(CHANNEL_INDEX)))
    values[:, 0] = np.arange(len(values)) / rate_hz
    states = [AirState() for _ in range(3)]
    said = [
        watched(SampleBlock(values), piece, state, half=rate_hz // 2)
        for state, piece in zip(states, (1, 3, rate_hz), strict=True)
    ]
    assert said[0] == said[1] == said[2]
    assert said[0][-1] is not None or rate_hz == 1000
    codec = Codec()
    assert len({codec.encode(AirState, state) for state in states}) == 1


def test_what_was_measured_of_a_half_minute_does_not_pass_for_the_next() -> None:
    watch, state, block = AirWatch(AIRCRAFT), AirState(), flown("light", 89)
    half = round(0.5 * RATE_HZ)
    found: list[PendingAir] = []
    for start in range(0, len(block) - half, half):
        rows = block.values[start : start + half]
        watch.take(state, rows)
        watch.look(state, float(rows[-1, 0]))
        pending = watch.pending(state)
        if pending is not None and (not found or found[-1].window is not pending.window):
            found.append(pending)
    first, second = found
    first.keep(first.measure())
    assert watch.pending(state) is not None
    assert state.found is None
    air = second.measure()
    second.keep(air)
    assert watch.pending(state) is None
    assert watch.quality(state) is air is not None


def test_without_vanes_nothing_is_said() -> None:
    values = flown("light", 86).values.copy()
    values[:, [CHANNEL_INDEX[name] for name in VANES]] = np.nan
    assert set(watched(SampleBlock(values), 5)) == {None}


def test_a_clock_that_jumps_begins_a_new_window() -> None:
    block = flown("light", 87)
    state = AirState()
    assert watched(block, 5, state)[-1] is not None
    for jump_s in (1e4, -1e4):
        later = block.values.copy()
        later[:, 0] += jump_s
        said = watched(SampleBlock(later), 5, state)
        assert said[0] is None
        assert said[-1] is not None


@pytest.mark.parametrize("looks", [True, False])
def test_memory_is_bounded(looks: bool) -> None:
    watch, state = AirWatch(AIRCRAFT), AirState()
    rows = flown("none", 88).values
    for k in range(100):
        again = rows.copy()
        again[:, 0] += SECONDS * min(k, 50)  # later the clock stands still
        watch.take(state, again)
        if looks:
            watch.look(state, float(again[-1, 0]))
        assert sum(len(stamps) for stamps, _ in state.pieces) <= 6000 + len(rows)
