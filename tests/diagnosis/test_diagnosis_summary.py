"""What a diagnosis says in words."""

import dataclasses
import math

import numpy as np
import pytest
from diagnosis_examples import AGREES, BEFORE, FOUND, NOTHING_FOUND
from hypothesis import given
from hypothesis import strategies as st

from wingwatch.diagnosis import Interval, Misfit, ParameterEstimate
from wingwatch.diagnosis.causes.sensor_scale import too_large
from wingwatch.diagnosis.summary import (
    beyond_noise,
    by_misfit,
    chances,
    change_text,
    display,
    headline,
    label_title,
    parameter_text,
    unexplained_text,
)
from wingwatch.pages.texts import listed, number, probability_text, with_error
from wingwatch.telemetry import CHANNEL_NAMES


def test_the_answer_names_what_is_wrong_why_and_what_it_gains() -> None:
    answer, gained = headline(FOUND)
    assert "aerosonde departs from this flight most in angle of attack and pitch rate" in answer
    assert "causes found: elevator effectiveness (0.301 ± 0.012)" in answer
    assert "sensor delay of angle of attack (0.0603 ± 0.0019 s)" in answer
    assert "on windows left out is 74 % smaller (66 to 79) in pitch rate" in gained


def test_the_answer_where_nothing_was_found_or_nothing_is_wrong() -> None:
    assert headline(NOTHING_FOUND)[0].endswith("but no cause is beyond doubt.")
    assert headline(AGREES) == (
        "The simulation of aerosonde agrees with this flight: what is left is sensor noise.",
        "",
    )
    gusts = dataclasses.replace(AGREES, unexplained_fraction=1.0)
    assert "by no more than gusts and unmodelled moments" in headline(gusts)[0]


def test_a_flight_that_judges_little_does_not_agree() -> None:
    few = dataclasses.replace(AGREES, not_judged=("n_zeta",))
    assert headline(few) == headline(AGREES)
    many = dataclasses.replace(AGREES, not_judged=("z_w", "m_w", "m_q", "y_v", "l_v", "l_p", "n_v"))
    assert headline(many)[0].startswith(
        "This flight moves the aircraft too little to judge the simulation of aerosonde"
    )
    assert "z_w, m_w, m_q, y_v, l_v, l_p and n_v would not show" in headline(many)[0]


def test_doubt_about_the_file_comes_first() -> None:
    why = "the flight's mean airspeed of 12.0 m/s is not in the 20 to 34 m/s that it states"
    answer, _ = headline(dataclasses.replace(FOUND, another_aircraft=why))
    assert answer.startswith(
        "Is the file of aerosonde the one of this aircraft? The flight's mean airspeed of 12.0"
    )
    assert "causes found" in answer


def test_the_chance_of_a_set_stands_beside_that_of_the_cause() -> None:
    both = dataclasses.replace(FOUND.causes[0], set_probability=0.998)
    assert chances(both) == "probability 0.97, 0.998 with those that this flight does not separate it from"
    assert chances(FOUND.causes[1]) == "probability > 0.999"


@pytest.mark.parametrize(
    ("value", "text"), [(0.05, "airspeed reads 5.0% too much"), (-0.05, "airspeed reads 5.0% too little")]
)
def test_an_operator_reads_more_or_less_and_no_sign(value: float, text: str) -> None:
    cause = too_large("airspeed_error", "", "airspeed_true_m_s", "airspeed reads {0:.1%} too [much|little]")
    assert cause.sentence(np.array([value])) == text


def test_an_extension_that_does_not_pay_is_said() -> None:
    assert "does not pay" in headline(dataclasses.replace(FOUND, gain=None))[1]
    assert FOUND.gain is not None
    worse = dataclasses.replace(
        FOUND.gain, change={**FOUND.gain.change, "roll_rate_rad_s": Interval(0.09, 0.05, 0.1)}
    )
    said = headline(dataclasses.replace(FOUND, gain=worse))[1]
    assert said.endswith("but 9 % larger (5 to 10) in roll rate: no extended file is offered.")
    uncertain = dataclasses.replace(FOUND.gain, change={"roll_rate_rad_s": Interval(-0.1, -0.3, 0.1)})
    assert "not better beyond doubt" in headline(dataclasses.replace(FOUND, gain=uncertain))[1]


def test_channels_whose_noise_is_known_come_first_and_noise_does_not_count() -> None:
    assert by_misfit(BEFORE)[0] == "angle_of_attack_rad"
    assert by_misfit(BEFORE)[-1] == "altitude_m"
    assert beyond_noise(Misfit(0.5, 0.4, 0.0, 0.0, 1.0, noise_fraction=1.0)) == 0.0
    assert beyond_noise(Misfit(0.5, math.nan, 0.0, 0.0, 1.0)) == 0.0


@pytest.mark.parametrize(
    ("channel", "name", "unit"),
    [
        ("pitch_rate_rad_s", "pitch rate", "deg/s"),
        ("pitch_rad", "pitch attitude", "deg"),
        ("airspeed_true_m_s", "true airspeed", "m/s"),
        ("specific_force_z_m_s2", "normal specific force", "m/s²"),
        ("altitude_m", "altitude", "m"),
        ("throttle", "throttle", ""),
    ],
)
def test_channels_are_shown_in_words_and_degrees(channel: str, name: str, unit: str) -> None:
    shown = display(channel)
    assert (shown.name, shown.unit) == (name, unit)
    assert shown.factor == (math.degrees(1.0) if "deg" in unit else 1.0)


def test_no_channel_of_the_flight_table_is_shown_with_its_unit_in_the_name() -> None:
    assert not [c for c in CHANNEL_NAMES if "_" in display(c).name or " rad" in display(c).name]


@pytest.mark.parametrize(
    ("label", "words"),
    [
        ("icing", "icing"),
        ("cg_shift", "shift of the centre of gravity"),
        ("derivative[m_q]", "derivative m_q"),
        ("sensor_bias[pitch_rad]", "sensor bias of pitch attitude"),
        ("surface_stuck[elevator]", "elevator stuck"),
        ("sensor_delay[inertial]", "sensor delay of the inertial sensors"),
    ],
)
def test_labels_in_words(label: str, words: str) -> None:
    assert label_title(label) == words


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.0603, 0.0019, "0.0603 ± 0.0019"),
        (-131.51, 2.04, "-131.5 ± 2.0"),
        (1234.5, 210.0, "1234 ± 210"),
        (1.5, math.nan, "1.5"),
        (math.nan, 1.0, "-"),
        (1e-9, 2e-10, "1e-09 ± 2e-10"),
    ],
)
def test_a_value_has_the_digits_that_its_error_gives_a_meaning(value: float, error: float, text: str) -> None:
    assert with_error(value, error) == text


@given(st.floats(), st.floats())
def test_any_figure_can_be_written(value: float, error: float) -> None:
    assert with_error(value, error)
    assert number(value)
    assert probability_text(value)
    assert change_text(Interval(value, error, -error))


def test_changes_are_smaller_larger_or_neither() -> None:
    assert change_text(Interval(-0.43, -0.47, -0.38)) == "43 % smaller (38 to 47)"
    assert change_text(Interval(0.2, 0.1, 0.3)) == "20 % larger (10 to 30)"
    assert change_text(Interval(-0.001, -0.02, 0.02)) == "+0 % (-2 to 2)"


def test_a_parameter_does_not_say_its_unit_twice() -> None:
    assert parameter_text("delay_s", ParameterEstimate(0.06, 0.002, "s")) == "delay 0.0600 ± 0.0020 s"


def test_lists() -> None:
    assert [listed("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]


def test_what_is_left_is_said_in_every_case() -> None:
    assert unexplained_text(FOUND).startswith("The causes found leave 17 %")
    assert "thrust line" in unexplained_text(FOUND)
    assert "all of the misfit" in unexplained_text(NOTHING_FOUND)
    assert unexplained_text(AGREES) == "There is no misfit beyond noise."
    assert "not known" in unexplained_text(dataclasses.replace(AGREES, unexplained_fraction=math.nan))
