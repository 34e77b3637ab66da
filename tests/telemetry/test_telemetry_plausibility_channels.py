"""Units, signs, axes, gravity, holds and limits of channels are named with the line that mends them."""

import numpy as np
import pytest
from plausible_flights import (
    AIRCRAFT,
    DEG,
    SURFACES,
    Spoil,
    Values,
    exchanged,
    findings,
    flown,
    held,
    low_passed,
    times,
    without_gravity,
)

from wingwatch.telemetry import CHANNEL_INDEX, ChannelEntry, SampleBlock, parse_map
from wingwatch.telemetry.maps import apply_map
from wingwatch.telemetry.plausibility import Finding, Verdict

RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
Z = "specific_force_z_m_s2"
AIRSPEED = "airspeed_true_m_s"


def refused(found: tuple[Finding, ...]) -> list[str]:
    return sorted(one.channel for one in found if one.standing is Verdict.REFUSAL)


def one_of(found: tuple[Finding, ...], standing: Verdict) -> Finding:
    (only,) = [one for one in found if one.standing is standing]
    return only


def mended(block: SampleBlock, spoil: Spoil, line: str) -> SampleBlock:
    """The spoiled flight read by the lines that the findings give."""
    values = block.values.copy()
    spoil(values)
    spoiled = SampleBlock(values)
    rules = parse_map(f"format = 1\n[channels]\n{line}")
    columns = apply_map(rules, {name: spoiled.column(name) for name in spoiled.present}).columns
    return SampleBlock.from_columns(columns)


MENDED: dict[str, tuple[Spoil, list[str]]] = {
    "rates in deg/s": (times(DEG, *RATES), sorted(RATES)),
    "one rate in deg/s": (times(DEG, "roll_rate_rad_s"), ["roll_rate_rad_s"]),
    "a rate turned, in deg/s": (times(-DEG, "yaw_rate_rad_s"), ["yaw_rate_rad_s"]),
    "roll rate turned": (times(-1.0, "roll_rate_rad_s"), ["roll_rate_rad_s"]),
    "pitch rate turned": (times(-1.0, "pitch_rate_rad_s"), ["pitch_rate_rad_s"]),
    "yaw rate turned": (times(-1.0, "yaw_rate_rad_s"), ["yaw_rate_rad_s"]),
    "bank turned": (times(-1.0, "roll_rad"), ["roll_rad"]),
    "heading turned": (times(-1.0, "heading_rad"), ["heading_rad"]),
    "z up": (times(-1.0, Z), [Z]),
    "forces in g": (times(1.0 / 9.80665, *(f"specific_force_{a}_m_s2" for a in "xyz")), [Z]),
    "no gravity": (without_gravity, [Z]),
    "airspeed in km/h": (times(3.6, AIRSPEED), [AIRSPEED]),
    "airspeed in kt": (times(3600.0 / 1852.0, AIRSPEED), [AIRSPEED]),
    "airspeed in ft/s": (times(1.0 / 0.3048, AIRSPEED), [AIRSPEED]),
    "airspeed in mph": (times(1.0 / 0.44704, AIRSPEED), [AIRSPEED]),
}


@pytest.mark.parametrize("aircraft", AIRCRAFT)
@pytest.mark.parametrize("air", ["none", "moderate"])
@pytest.mark.parametrize("what", MENDED)
def test_a_wrong_unit_or_sign_is_named_and_its_line_mends_it(what: str, air: str, aircraft: str) -> None:
    spoil, channels = MENDED[what]
    block = flown(aircraft, "both", air)
    found = findings(block, aircraft, spoil)
    assert refused(found) == channels
    lines = "\n".join(one.line for one in found if one.standing is Verdict.REFUSAL)
    assert all(one.standing is Verdict.RIGHT for one in findings(mended(block, spoil, lines), aircraft))


@pytest.mark.parametrize(
    ("aircraft", "surface"),
    # the UltraStick's short period is too quick: its elevator could as well be late
    [(a, s) for a in AIRCRAFT for s in SURFACES if (a, s) != ("ultrastick25e", "elevator_rad")],
)
def test_a_turned_surface_is_named_where_it_was_moved(aircraft: str, surface: str) -> None:
    found = findings(flown(aircraft, "steps", "none"), aircraft, times(-1.0, surface))
    assert one_of(found, Verdict.REFUSAL).line == f'{surface} = {{ source = "{surface}", scale = -1 }}'


@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_a_turned_vane_is_named(aircraft: str) -> None:
    found = findings(flown(aircraft, "doublets", "light"), aircraft, times(-1.0, "angle_of_attack_rad"))
    assert refused(found) == ["angle_of_attack_rad"]


def test_exchanged_axes_are_named() -> None:
    found = findings(flown("aerosonde", "doublets", "moderate"), "aerosonde", exchanged(*RATES[:2]))
    assert "roll_rate_rad_s" in refused(found)
    assert any(one.line == 'roll_rate_rad_s = { source = "pitch_rate_rad_s" }' for one in found)


@pytest.mark.parametrize(("rows", "hz"), [(2.0, 25.0), (2.5, 20.0), (5.0, 10.0), (10.0, 5.0)])
@pytest.mark.parametrize("manoeuvre", ["doublets", "patrol"])
def test_held_surfaces_are_refused(manoeuvre: str, rows: float, hz: float) -> None:
    found = findings(flown("aerosonde", manoeuvre, "light"), "aerosonde", held(rows, *SURFACES))
    only = one_of(found, Verdict.REFUSAL)
    assert only.check == "held"
    assert only.measured == pytest.approx(hz, rel=0.01)
    assert only.line == ("" if hz < 9.0 else f'clock = "{only.channel}"')


def test_single_steps_with_rests_and_few_digits_are_no_slow_rate() -> None:
    still, few = np.zeros(7500), np.arange(7500) // 10 % 100 < 3

    def spoil(values: Values) -> None:
        values[:, CHANNEL_INDEX["elevator_rad"]] = still[: len(values)] + 0.02 * few[: len(values)]
        for name in ("aileron_rad", "roll_rad", "pitch_rad"):
            values[:, CHANNEL_INDEX[name]] = np.round(values[:, CHANNEL_INDEX[name]] * DEG, 1) / DEG

    assert not [
        one
        for one in findings(flown("aerosonde", "none", "light"), "aerosonde", spoil)
        if one.check == "held"
    ]


def test_gyros_behind_a_filter_are_late() -> None:
    found = findings(flown("aerosonde", "both", "light"), "aerosonde", low_passed(0.06, *RATES))
    late = [one for one in found if one.standing is Verdict.WARNING]
    assert [one.channel for one in late] == list(RATES)
    for one in late:
        assert one.measured == pytest.approx(0.06, abs=0.015)
        assert "delay_s = 0.0" in one.line
    assert not refused(found)


@pytest.mark.parametrize("name", [Z, "roll_rate_rad_s"])
def test_a_clipped_sensor_is_named(name: str) -> None:
    def clip(values: Values) -> None:
        column = values[:, CHANNEL_INDEX[name]]
        column[:] = np.clip(column, *np.quantile(column, (0.003, 0.997)))

    only = one_of(findings(flown("aerosonde", "both", "moderate"), "aerosonde", clip), Verdict.WARNING)
    assert (only.channel, only.check) == (name, "clipped")


def test_a_frozen_airspeed_is_named_and_no_unit() -> None:
    def freeze(values: Values) -> None:
        values[2500:, CHANNEL_INDEX[AIRSPEED]] = values[2500, CHANNEL_INDEX[AIRSPEED]]

    only = one_of(
        findings(flown("ultrastick25e", "doublets", "moderate"), "ultrastick25e", freeze), Verdict.WARNING
    )
    assert (only.channel, only.check) == (AIRSPEED, "stuck")


def test_lines_keep_what_the_users_map_says() -> None:
    entries = {
        "roll_rate_rad_s": ChannelEntry(source="gyr.x", unit="deg/s", delay_s=0.01),
        Z: ChannelEntry(source="acc z", scale=2.0, offset=0.5),
    }
    block = flown("aerosonde", "both", "none")
    by_unit = findings(block, "aerosonde", times(1.0 / DEG, "roll_rate_rad_s"), entries=entries)
    assert one_of(by_unit, Verdict.REFUSAL).line == (
        'roll_rate_rad_s = { source = "gyr.x", unit = "rad/s", delay_s = 0.01 }'
    )
    by_sign = findings(block, "aerosonde", times(-1.0, Z), entries=entries)
    assert one_of(by_sign, Verdict.REFUSAL).line == f'{Z} = {{ source = "acc z", scale = -2, offset = -0.5 }}'


def test_commands_of_fifty_hertz_in_a_faster_table_are_right() -> None:
    block = flown("aerosonde", "doublets", "light")
    values = np.repeat(block.values, 2, axis=0)
    values[:, 0] = block.values[0, 0] + 0.01 * np.arange(len(values))
    steps = np.arange(len(values) - 1)
    sensors = [i for i in range(1, values.shape[1]) if i not in {CHANNEL_INDEX[name] for name in SURFACES}]
    for i in sensors:  # between its neighbours, so that surfaces alone are held
        values[1:-1:2, i] = 0.5 * (values[steps[0:-1:2], i] + values[steps[0:-1:2] + 2, i])
    assert not [one for one in findings(SampleBlock(values), "aerosonde") if one.check == "held"]
