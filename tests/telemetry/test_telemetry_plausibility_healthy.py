"""Healthy flights and flights with real faults are not refused; quiet flight decides nothing."""

import time

import numpy as np
import pytest
from plausible_flights import AIRCRAFT, DEG, findings, flown, times
from telemetry_flights import THOR75, THOR75_MAP

from wingwatch.telemetry import CHANNELS, SampleBlock, load_flight, parse_map
from wingwatch.telemetry.plausibility import Verdict

FAULTS = (
    "airspeed_error:0.2@0", "airspeed_error:-0.3@40+30", "sensor_scale[pitch_rate_rad_s]:-0.2@0",
    "sensor_delay[pitch_rad]:0.1@0", "sensor_delay[roll_rate_rad_s]:0.1@0", "sensor_delay[elevator_rad]:0.1@0",
    "icing:0.3@40", "surface_stuck[elevator]:here@50", "surface_stuck[aileron]:here@50", "thrust_loss:1.0@60",
    "elevator_effectiveness:0.7@0", "sensor_freeze[airspeed_true_m_s]:1@60", "sensor_freeze[roll_rad]:1@30",
    "sensor_bias[angle_of_attack_rad]:0.05@0", "wing_damage[left]:0.2@50", "mass_inertia:0.3@0",
)  # fmt: skip


@pytest.mark.parametrize("aircraft", AIRCRAFT)
@pytest.mark.parametrize("air", ["none", "light", "moderate", "severe"])
@pytest.mark.parametrize("manoeuvre", ["doublets", "patrol", "both", "none", "steps"])
def test_a_healthy_flight_has_no_finding(aircraft: str, air: str, manoeuvre: str) -> None:
    for seed in (11, 12):
        found = findings(flown(aircraft, manoeuvre, air, seed), aircraft)
        assert [one.sentence for one in found if one.standing is not Verdict.RIGHT] == []
        assert found


@pytest.mark.parametrize("aircraft", AIRCRAFT)
@pytest.mark.parametrize("air", ["none", "moderate"])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_real_fault_is_not_refused(aircraft: str, air: str, fault: str) -> None:
    for manoeuvre in ("doublets", "both"):
        found = findings(flown(aircraft, manoeuvre, air, 21, fault), aircraft)
        assert [one.sentence for one in found if one.standing is Verdict.REFUSAL] == []


@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_quiet_flight_does_not_decide_about_rates(aircraft: str) -> None:
    block = flown(aircraft, "none", "none")
    for name in ("roll_rate_rad_s", "yaw_rate_rad_s", "pitch_rate_rad_s"):
        found = findings(block, aircraft, times(DEG, name))
        assert name not in {one.channel for one in found}


def test_short_slow_and_empty_flights_decide_nothing() -> None:
    block = flown("aerosonde", "both", "none")
    for rows in (slice(0, 0), slice(0, 1), slice(0, 150), slice(0, None, 50)):
        assert findings(SampleBlock(block.values[rows]), "aerosonde") == ()


@pytest.mark.parametrize("seed", range(40))
def test_any_clean_samples_are_taken(seed: int) -> None:
    draw = np.random.default_rng(seed)
    values = np.full((700, len(CHANNELS)), np.nan)
    for i, channel in enumerate(CHANNELS):
        low, high = max(channel.low, -1e4), min(channel.high, 1e4)
        kinds = [
            draw.uniform(low, high, 700),
            np.full(700, draw.choice([0.0, low, high])),
            np.repeat(draw.uniform(low, high, 100), 7),
            np.where(draw.uniform(size=700) < 0.3, np.nan, draw.uniform(low, high, 700)),
            1e-9 * draw.normal(size=700).clip(low, high),
        ]
        values[:, i] = kinds[draw.integers(len(kinds))]
    values[:, 0] = np.cumsum(draw.choice([0.0, 0.02, 0.02, 0.02, 0.6, -30.0 if seed % 2 else 0.02], 700))
    for one in findings(SampleBlock(values), draw.choice(AIRCRAFT)):
        assert one.text


def test_a_clock_that_was_set_back_is_judged_by_its_longest_part() -> None:
    values = flown("aerosonde", "both", "none").values.copy()
    values[2000:, 0] -= 500.0
    found = findings(SampleBlock(values), "aerosonde", times(-1.0, "specific_force_z_m_s2"))
    assert [one.channel for one in found if one.standing is Verdict.REFUSAL] == ["specific_force_z_m_s2"]


@pytest.mark.skipif(not THOR75.exists(), reason="the measured flight is not here")
@pytest.mark.parametrize(
    ("factor", "names", "refused"),
    [
        (1.0, ("roll_rad",), []),
        (DEG, ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"), ["pitch", "roll", "yaw"]),
        (-1.0, ("pitch_rate_rad_s",), ["pitch"]),
        (-1.0, ("specific_force_z_m_s2",), ["specific"]),
        (3.6, ("airspeed_true_m_s",), ["airspeed"]),
        (-1.0, ("angle_of_attack_rad",), ["angle"]),
        (-1.0, ("aileron_rad",), ["aileron"]),
    ],
)
def test_a_measured_flight(factor: float, names: tuple[str, ...], refused: list[str]) -> None:
    block = load_flight(THOR75, parse_map(THOR75_MAP)).block
    found = findings(block, "ultrastick25e", times(factor, *names))
    doubts = [one for one in found if one.standing is not Verdict.RIGHT]
    assert sorted(one.channel.split("_")[0] for one in doubts) == refused


def test_ten_minutes_cost_less_than_a_second() -> None:
    block = flown("aerosonde", "both", "light", 3, "", 600.0)
    begun = time.process_time()
    findings(block, "aerosonde")
    assert time.process_time() - begun < 1.0
