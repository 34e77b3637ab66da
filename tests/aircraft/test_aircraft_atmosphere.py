import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wingwatch.aircraft import (
    FlightCondition,
    isa_density_kg_m3,
    isa_pressure_pa,
    isa_temperature_k,
    true_from_indicated,
)

# ISO 2533:1975, geopotential altitude: temperature K, pressure Pa, density kg/m3, as its tables print them.
ISO_2533 = [
    (0.0, 288.15, 101325.0, 1.225),
    (1000.0, 281.65, 89874.6, 1.11164),
    (5000.0, 255.65, 54019.9, 0.736116),
    (11000.0, 216.65, 22632.0, 0.363918),
    (20000.0, 216.65, 5474.87, 0.0880345),
    (32000.0, 228.65, 868.014, 0.0132249),
]


@pytest.mark.parametrize(("altitude_m", "temperature_k", "pressure_pa", "density"), ISO_2533)
def test_standard_atmosphere_is_that_of_the_tables(
    altitude_m: float, temperature_k: float, pressure_pa: float, density: float
) -> None:
    # Six printed digits, the last of them rounded: half a unit of the sixth digit, 5e-6 at worst.
    assert float(isa_temperature_k(altitude_m)) == pytest.approx(temperature_k, rel=5e-6)
    assert float(isa_pressure_pa(altitude_m)) == pytest.approx(pressure_pa, rel=5e-6)
    assert float(isa_density_kg_m3(altitude_m)) == pytest.approx(density, rel=5e-6)


def test_no_atmosphere_outside_its_layers_and_shapes_are_kept() -> None:
    density = isa_density_kg_m3([[-5001.0, 0.0, 47001.0], [math.nan, -5000.0, 47000.0]])
    assert density.shape == (2, 3)
    assert np.isnan(density).tolist() == [[True, False, True], [True, False, False]]


@given(st.floats(-5000.0, 46999.0), st.floats(0.01, 1.0))
def test_pressure_falls_with_altitude(altitude_m: float, step_m: float) -> None:
    assert float(isa_pressure_pa(altitude_m + step_m)) < float(isa_pressure_pa(altitude_m))


@given(st.floats(1.0, 300.0), st.floats(0.01, 1.5))
def test_true_airspeed_keeps_the_dynamic_pressure_of_the_indicated(airspeed: float, density: float) -> None:
    true = float(true_from_indicated(airspeed, density))
    assert 0.5 * density * true**2 == pytest.approx(0.5 * 1.225 * airspeed**2, rel=1e-12)


def test_condition_takes_the_standard_density_unless_told() -> None:
    assert FlightCondition(25.0, 1000.0).air_density_kg_m3 == float(isa_density_kg_m3(1000.0))
    assert FlightCondition(25.0, 1000.0, 1.2).air_density_kg_m3 == 1.2
    assert FlightCondition(25.0, 0.0).dynamic_pressure_pa == pytest.approx(0.5 * 1.225 * 625.0)


@given(st.floats(1.0, 300.0), st.floats(-1.5, 1.5))
def test_body_velocities_make_up_the_airspeed(airspeed: float, alpha: float) -> None:
    c = FlightCondition(airspeed, 0.0, angle_of_attack_rad=alpha)
    assert math.hypot(c.forward_velocity_m_s, c.normal_velocity_m_s) == pytest.approx(airspeed)
    assert math.atan2(c.normal_velocity_m_s, c.forward_velocity_m_s) == pytest.approx(alpha, abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((0.0, 1000.0), "airspeed_true_m_s is 0.0"),
        ((math.nan, 1000.0), "airspeed_true_m_s is nan"),
        ((25.0, 90000.0), "altitude_m 90000.0"),
        ((25.0, 1000.0, -1.0), "air density is -1.0"),
        ((25.0, 1000.0, 1.2, "clean", 1.6), "angle_of_attack_rad is 1.6"),
    ],
)
def test_impossible_conditions_are_refused_with_the_value(arguments: tuple[float, ...], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        FlightCondition(*arguments)  # type: ignore[arg-type]
