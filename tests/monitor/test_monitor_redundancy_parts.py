"""Parts of analytical redundancy against independent computations: thrust, sums by onset, the test's honesty."""

import itertools

import numpy as np
import pytest
from redundancy_flights import AEROSONDE, flown, monitor_of

from wingwatch.aircraft import load_aircraft, propulsion_thrust_n
from wingwatch.monitor.detection.redundancy.evidence import Changes, Reference, changes_since
from wingwatch.monitor.detection.redundancy.hypotheses import HYPOTHESES, USED_BY
from wingwatch.monitor.detection.redundancy.layout import (
    COLUMNS,
    FLOORS,
    FLOW,
    PITCH,
    RELATIONS,
    ROWS,
    parameter_index,
)
from wingwatch.monitor.detection.redundancy.samples import (
    END_S,
    START_S,
    new_memory,
    new_segment,
    new_work,
    take_samples,
    thrust_n,
)
from wingwatch.monitor.detection.redundancy.segments import MOST_SEGMENTS, Segments
from wingwatch.monitor.detection.redundancy.sequential import rank
from wingwatch.monitor.detection.redundancy.set_up import model_of
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS

N = len(RELATIONS)


@pytest.mark.parametrize("name", ["aerosonde", "twinotter"])
def test_compiled_thrust_is_that_of_the_aircraft_file(name: str) -> None:
    aircraft = load_aircraft(name)
    assert aircraft.propulsion is not None
    model, _ = model_of(aircraft, ["throttle"], {})
    for throttle, airspeed, density in itertools.product((0.0, 0.3, 1.0), (5.0, 25.0, 60.0), (0.7, 1.2)):
        stated = float(propulsion_thrust_n(aircraft.propulsion, throttle, airspeed, density).real)
        assert thrust_n(model.propulsion, throttle, airspeed, density) == pytest.approx(
            stated, rel=1e-12, abs=1e-9
        )


def _segments(values: np.ndarray) -> tuple[Reference, Segments]:
    """The last segments of a flight, nothing forced, and what is known from before."""
    monitor, block = monitor_of(values)
    model = monitor.relations.model
    memory, segment = new_memory(np.array([RELATIONS[i].drift for i in ROWS])), new_segment()
    work = new_work()
    reference, found, first, rows = Reference(), Segments(), 0, np.ascontiguousarray(block.values)
    while first < len(rows):
        first = take_samples(rows, first, model, memory, segment, np.full(N, np.inf), work)
        if first < len(rows):
            if len(found) == MOST_SEGMENTS:
                reference.absorb(found, np.ones(len(ROWS), dtype=np.bool_), np.ones(len(FLOW)))
            found.close(segment, memory, float(memory.clock[START_S]), 1.0)
            found.keep()
            memory.clock[START_S] = memory.clock[END_S]
            memory.clock[END_S] += 1.0
    return reference, found


@pytest.mark.parametrize(("parameter", "channel", "size"), [
    ("pitch_rad bias", "pitch_rad", 0.03), ("pitch_rate_rad_s bias", "pitch_rate_rad_s", 0.02),
])  # fmt: skip
def test_the_evidence_of_a_change_gives_its_size(parameter: str, channel: str, size: float) -> None:
    """One parameter alone, from the onset on: y over K, without a simulation's or a test's help."""
    faulty = flown(seconds=30.0).copy()
    faulty[20 * 50 :, CHANNEL_INDEX[channel]] += size
    (reference, segments), column = _segments(faulty), parameter_index(PITCH, parameter)
    onset = int(np.flatnonzero(segments.starts_s >= 20.0 - 1e-9)[0])
    changes = changes_since(reference, segments, onset, onset)
    weight = changes.information[0, PITCH, column, column] / changes.variance[0, PITCH]
    found = changes.vector[0, PITCH, column] / changes.information[0, PITCH, column, column]
    assert found == pytest.approx(size, abs=5.0 / np.sqrt(weight) + 0.05 * size)


def test_segments_that_are_joined_say_the_same() -> None:
    reference, segments = _segments(flown(seconds=20.0, turbulence="light"))
    apart = changes_since(reference, segments, 4, 4)
    segments.join(4)
    segments.join(4)
    together = changes_since(reference, segments, 4, 4)
    assert (len(segments), segments.seconds[4]) == (10, 3.0)
    for one, other in zip(apart, together, strict=True):
        assert one == pytest.approx(other, rel=1e-8, abs=1e-6)


def test_the_bayes_factor_of_a_fault_that_is_not_there_is_one_on_average() -> None:
    """Scores drawn from what they state, noise as loud as stated: the factors' mean is at most one."""
    rng = np.random.default_rng(11)
    hypotheses = [h for h in HYPOTHESES if set(h.effects) == {PITCH} and h.size_std > 0.0 and h.signed]
    rows = len(ROWS)
    information = np.zeros((1, rows, COLUMNS, COLUMNS))
    root = rng.normal(size=(5, 40)) / np.maximum(FLOORS[PITCH, :5, None], 1e-6) / 30.0
    information[0, PITCH, :5, :5] = root @ root.T
    factor = np.linalg.cholesky(information[0, PITCH, :5, :5])
    factors = []
    samples = 50.0
    for _ in range(400):
        vector = np.zeros((1, rows, COLUMNS))
        vector[0, PITCH, :5] = factor @ rng.normal(size=5)
        within = vector[0, PITCH, :5] @ np.linalg.solve(information[0, PITCH, :5, :5], vector[0, PITCH, :5])
        square = np.zeros((1, rows))
        square[0, PITCH] = within + rng.chisquare(samples - 5)
        count = np.zeros((1, rows))
        count[0, PITCH] = samples
        changes = Changes(information, vector, square, count, np.ones((1, rows)), 0.5 * square)
        finding = rank(changes, FLOORS[list(ROWS)], np.zeros(N), hypotheses, least=-1.0)
        factors.append(float(np.exp(min(finding.log_statistic, 50.0))))
    assert np.mean(factors) < 0.5, "weights of these hypotheses sum to less than a half"
    assert np.mean(np.array(factors) > 10.0) <= 0.02


def test_every_hypothesis_shows_in_relations_that_have_its_parameters() -> None:
    assert {h.channel for h in HYPOTHESES} <= {channel.name for channel in CHANNELS}
    assert set(USED_BY) <= {channel.name for channel in CHANNELS}
    for hypothesis in HYPOTHESES:
        assert hypothesis.relations, hypothesis
        for effect in hypothesis.effects.values():
            assert effect.direction.any() or effect.free.any(), hypothesis
        hypothesis.words.format(size="1")


def test_an_aircraft_without_mass_or_propulsion_loses_relations_with_a_reason() -> None:
    bare = AEROSONDE.model_copy(update={"propulsion": None})
    _, block = monitor_of(flown())
    _, absent = model_of(bare, block.present, {})
    assert absent == {"axial force against throttle and lift": "aircraft aerosonde states no [propulsion]"}
    blind = [c for c in block.present if c not in ("angle_of_attack_rad", "sideslip_rad", "throttle")]
    model, absent = model_of(bare, blind, {})
    assert absent["angle of attack against gyros and accelerometers"] == "missing angle_of_attack_rad"
    assert model.active.sum() == N - 5
