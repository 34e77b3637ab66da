"""The published coefficient sets of the Aerosonde beside the thesis's linearised model."""

import aerosonde_sets as sets
import pytest

from wingwatch.aircraft import DUTCH_ROLL, SHORT_PERIOD, load_aircraft
from wingwatch.simulation import linearise


def test_the_thesis_aerosonde_is_set_a_partly_fuelled_with_forces_where_it_states_them() -> None:
    values, modes = sets.derivatives_and_modes(sets.aerosim(sets.FUEL_SHARE))
    for symbol, printed in sets.THESIS.items():
        assert values[symbol] == pytest.approx(printed, rel=0.005), symbol
    for name, printed_mode in sets.THESIS_MODES.items():
        assert modes[name] == pytest.approx(printed_mode, rel=0.005), name


def test_neither_mass_nor_place_of_the_forces_can_be_left_out() -> None:
    away = {
        label: max(abs(values[s] / printed - 1.0) for s, printed in sets.THESIS.items())
        for label, (values, _) in (
            (label, sets.derivatives_and_modes(aircraft)) for label, aircraft in sets.variants().items()
        )
    }
    best = [label for label, distance in away.items() if distance < 0.005]
    assert best == ["A 10.4 kg, forces where stated", "library aerosonde-a"]
    assert away["A 10.4 kg, forces at the c.g."] > 0.2


def test_the_librarys_file_is_that_set_to_its_last_digit() -> None:
    derived, stated = sets.aerosim(sets.FUEL_SHARE), load_aircraft("aerosonde-a")
    ours = dict(stated.need_coefficients("the test").items())
    for name, value in derived.need_coefficients("the test").items():
        assert ours[name] == pytest.approx(value, rel=5e-5), name  # five digits are written
    assert stated.geometry == derived.geometry
    assert stated.propulsion == derived.propulsion
    assert stated.need_mass("the test").model_dump() == pytest.approx(
        derived.need_mass("the test").model_dump()
    )


def test_what_the_simulation_flies_is_the_thesis_model() -> None:
    aircraft = load_aircraft("aerosonde-a")
    flown = linearise(aircraft, sets.CONDITION, SHORT_PERIOD) | linearise(
        aircraft, sets.CONDITION, DUTCH_ROLL
    )
    assert flown == pytest.approx(dict(sets.THESIS), rel=0.005)
