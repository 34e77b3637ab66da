"""The grid file: defaults, words with weights, and refusals in one sentence."""

import re
from pathlib import Path

import pytest
from study_flights import small_grid

from wingwatch.studies import KINDS, Kind, StudyError, load_fleet, load_grid
from wingwatch.studies.grid import Range, bounds


@pytest.mark.parametrize("kind", KINDS)
def test_default_grids_can_be_flown(kind: Kind) -> None:
    grid = load_grid(kind, None)
    assert set(load_fleet(grid)) == {"aerosonde", "twinotter", "ultrastick25e"}
    assert grid.flights * grid.seconds >= 2000 * 300.0


def test_the_default_healthy_study_is_300_hours() -> None:
    grid = load_grid("healthy", None)
    assert grid.flights * grid.seconds == 300 * 3600.0


def test_words_and_numbers_in_their_forms(tmp_path: Path) -> None:
    grid = small_grid(tmp_path, more="turbulence_model = ['dryden', 'dryden', 'von-karman']\n")
    assert grid.turbulence == {"none": 1.0}
    assert grid.turbulence_model == {"dryden": 2.0, "von-karman": 1.0}
    assert grid.noise_scale == [1.0]
    assert grid.effects[0].size == Range(low=0.01, high=0.4)


def test_sizes_in_the_logarithm_of_either_sign_and_as_a_word(tmp_path: Path) -> None:
    more = """
[[effects]]
name = "surface_stuck"
target = "rudder"
size = "here"
[[effects]]
name = "surface_offset"
target = "rudder"
size = { low = 0.01, high = 0.04, logarithmic = true, either_sign = true }
"""
    stuck, offset = small_grid(tmp_path, "damage", more).effects
    assert stuck.size == "here"
    assert isinstance(offset.size, Range)
    assert bounds(offset.size) == (-0.04, 0.04)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("excitaton = 'doublet'", "unknown key 'excitaton'"),
        ("excitation = 'wobble'", "give one of doublet, 3211"),
        ("excitation = 'autopilot'\nroute = 'straight'", "flown on route 'patrol' only"),
        ("seconds = 'long'", "seconds: Input should be a valid number"),
        ("onset_s = 295", "onset_s reaches 295 s in flights of 300 s"),
        ("effects = []", "leave nothing to draw"),
        ("effects = [{ name = 'ice', size = 0.2 }]", "'ice' is no effect"),
        ("effects = [{ name = 'icing', size = 0.9 }]", "icing has size 0.9"),
        (
            "effects = [{ name = 'icing', size = 0.1, target = 'nose' }]",
            "icing of 'nose' cannot be simulated",
        ),
        ("effects = [{ name = 'icing', sise = 0.1 }]", "unknown key 'effects.0.sise'"),
        ("effects = [{ name = 'icing', size = 0.1, in_chords = true }]", "only cg_shift is a length"),
        (
            "effects = [{ name = 'wing_damage', size = 0.1, target = 'left' }]",
            "a study of icing has no effect",
        ),
        ("noise_scale = { low = 2, high = 1 }", "two finite numbers in order"),
        ("noise_scale = { low = 0, high = 1, logarithmic = true }", "which has no logarithm"),
        ("ramp_s = { low = -1, high = 1, either_sign = true }", "takes either sign already"),
        ("effects = [{ name = 'icing', size = 'here' }]", "size 'here' of icing is no number"),
        ("noise_scale = -1", "give numbers from 0"),
        ("noise_scale = 'loud'", "'loud' is no number"),
        ("sensors = [1]", "[1] is not understood"),
        ("excitation = { doublet = -1 }", "greater than 0"),
        ("sensors =", "is no grid"),
    ],
)
def test_a_grid_that_cannot_be_is_refused_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "grid.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError) as refused:
        load_grid("icing", path)
    assert said in str(refused.value)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_fault_of_a_sensor_that_no_flight_has_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "grid.toml"
    path.write_text(
        "sensors = 'no_vanes'\neffects = [{ name = 'vane_upwash', target = 'sideslip', size = 0.1 }]\n"
    )
    with pytest.raises(StudyError, match="every effect befalls a sensor that no flight has"):
        load_grid("sensor", path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("aircraft = 'jetstream31'", "states no [envelope]"),
        ("excitation_period_s = 6.0", "cannot be excited by doublet every 6 s"),
    ],
)
def test_an_aircraft_that_cannot_be_flown_so_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "grid.toml"
    path.write_text(text, encoding="utf-8")
    grid = load_grid("icing", path)
    with pytest.raises(StudyError, match=re.escape(said)):
        load_fleet(grid)
