"""What is written reads back to the same aircraft, whatever its texts hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wingwatch.aircraft import Aircraft, aircraft_toml, library_names, load_aircraft, parse_aircraft

MINIMAL = Aircraft(format=1, name="glider")


def read(text: str) -> Aircraft:
    return parse_aircraft(text.encode(), "written.toml")


@pytest.mark.parametrize("name", library_names())
def test_every_aircraft_of_the_library_reads_back_the_same(name: str) -> None:
    aircraft = load_aircraft(name)
    text = aircraft_toml(aircraft, "a comment")
    assert read(text) == aircraft


def test_stated_conditions_read_back_the_same() -> None:
    text = """
    format = 1
    name = "stated"
    [[conditions]]
    airspeed_true_m_s = 25.0
    altitude_m = 0.0
    provenance = "identified"
    [conditions.derivatives]
    m_q = { value = -6.0, standard_error = 0.3 }
    [[conditions]]
    airspeed_true_m_s = 30.0
    altitude_m = 0.0
    provenance = "a-priori"
    [conditions.derivatives]
    m_q = { value = -7.0, standard_error = 3e-5 }
    """
    aircraft = read(text)
    assert read(aircraft_toml(aircraft)) == aircraft


def test_a_minimal_aircraft_reads_back_the_same() -> None:
    assert read(aircraft_toml(MINIMAL)) == MINIMAL


@given(st.text(st.characters(codec="utf-8")), st.text(st.characters(codec="utf-8")))
def test_no_text_breaks_the_file(description: str, comment: str) -> None:
    aircraft = MINIMAL.model_copy(update={"description": description})
    assert read(aircraft_toml(aircraft, comment)) == aircraft


@given(st.floats(1e-300, 1e300))
def test_numbers_keep_every_bit(value: float) -> None:
    sensors = MINIMAL.sensors.model_copy(update={"noise_std": {"pitch_rate_rad_s": np.float64(value)}})
    written = aircraft_toml(MINIMAL.model_copy(update={"sensors": sensors}))
    assert read(written).sensors.noise_std["pitch_rate_rad_s"] == value


def test_a_comment_stands_at_the_head() -> None:
    assert aircraft_toml(MINIMAL, "one\ntwo\rthree").startswith("# one\n# two three\nformat = 1\n")
