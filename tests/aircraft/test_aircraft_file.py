import math
from pathlib import Path

import pytest

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SENSOR_COLUMNS,
    SHORT_PERIOD,
    AircraftDataError,
    AircraftFileError,
    Provenance,
    analysis_band_hz,
    library_names,
    load_aircraft,
    natural_frequency_and_damping,
    parse_aircraft,
    state_matrix,
)
from wingwatch.telemetry import CHANNEL_NAMES

MINIMAL = 'format = 1\nname = "glider"\n'
MASS = """
[mass]
mass_kg = 5.0
inertia_x_kg_m2 = 1.0
inertia_y_kg_m2 = 1.0
inertia_z_kg_m2 = 2.0
"""


def parse(text: str) -> object:
    return parse_aircraft(text.encode(), "some.toml")


def test_the_library_has_its_three_aircraft_under_their_names() -> None:
    assert library_names() == ("aerosonde", "aerosonde-a", "jetstream31", "twinotter", "ultrastick25e")
    for name in library_names():
        aircraft = load_aircraft(name)
        assert aircraft.name == name
        assert len(aircraft.description) > 200  # says where its numbers come from


def test_sensor_columns_are_channels() -> None:
    assert set(SENSOR_COLUMNS) <= set(CHANNEL_NAMES)


def test_every_table_of_the_contract_is_understood(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        MINIMAL
        + MASS
        + """
[geometry]
wing_area_m2 = 0.5
span_m = 2.0
mean_chord_m = 0.25
[sensors]
imu_position_m = [0.1, 0.0, 0.02]
vane_position_m = [0.5, 0.0, 0.0]
[sensors.noise_std]
pitch_rate_rad_s = 0.002
[sensors.delay_s]
specific_force_z_m_s2 = 0.06
[actuators.elevator]
bandwidth_hz = 8
rate_limit_rad_s = 3.0
position_limit_rad = 0.4
[modes.short_period]
band_hz = [0.1, 4.0]
[[conditions]]
airspeed_true_m_s = 25.0
altitude_m = 1000.0
configuration = "clean"
provenance = "a-priori"
[conditions.derivatives]
m_q = { value = -6.035, standard_error = 0.3 }
"""
    )
    aircraft = load_aircraft(file)
    assert aircraft == load_aircraft(str(file))
    assert aircraft.sensors.vane_position_m == (0.5, 0.0, 0.0)
    assert aircraft.noise_std("pitch_rate_rad_s") == 0.002
    assert aircraft.noise_std("roll_rate_rad_s") is None
    assert aircraft.delay_s("specific_force_z_m_s2") == 0.06
    assert aircraft.delay_s("specific_force_x_m_s2") == 0.0
    assert analysis_band_hz(aircraft, SHORT_PERIOD) == (0.1, 4.0)
    assert aircraft.conditions[0].provenance is Provenance.A_PRIORI
    assert aircraft.conditions[0].derivatives["m_q"].value == -6.035
    assert aircraft.entries(SHORT_PERIOD) == ()  # one derivative does not make a mode


BAD = [
    (MINIMAL + MASS.replace("5.0", "-5.0"), "mass.mass_kg is -5.0; allowed is greater than 0"),
    (MINIMAL + MASS.replace("5.0", '"heavy"'), "mass.mass_kg is 'heavy'; allowed is valid number"),
    (MINIMAL + MASS.replace("5.0", "nan"), "mass.mass_kg is nan; allowed is finite number"),
    (MINIMAL + MASS.replace("mass_kg = 5.0", ""), "mass.mass_kg is missing"),
    (MINIMAL + MASS + "colour = 1", "mass.colour = 1 is a key that is not known; allowed there are mass_kg,"),
    (MINIMAL + MASS + "inertia_xz_kg_m2 = 1.5", "mass: inertia_xz_kg_m2 is 1.5"),
    (MINIMAL.replace("1", "2"), "format is 2; allowed is 1"),
    (MINIMAL.replace("glider", "My Glider"), "name is 'My Glider'"),
    (
        MINIMAL + "[modes.spin]\nband_hz=[1,2]",
        "modes: 'spin' is no mode; allowed are short_period, short_period_alpha",
    ),
    (
        MINIMAL + "[modes.lateral]\nband_hz=[4,2]",
        "modes.lateral.band_hz: the limits [4.0, 2.0] do not ascend",
    ),
    (MINIMAL + "[sensors.noise_std]\npitch_rate=1", "sensors.noise_std: 'pitch_rate' is no sensor column"),
    (MINIMAL + "[actuators.flap]\nbandwidth_hz=1", "allowed there are elevator, aileron, rudder"),
    (
        MINIMAL + "[envelope]\nairspeed_true_m_s=[10,20]\naltitude_m=[0,100]\ncruise_airspeed_true_m_s=30",
        "envelope: cruise_airspeed_true_m_s is 30.0; give a value in the envelope's 10 to 20",
    ),
    (
        MINIMAL + "[[conditions]]\nairspeed_true_m_s=1\naltitude_m=0\nprovenance='guess'\nderivatives={}",
        "conditions.0.provenance is 'guess'; allowed is 'a-priori', 'empirical' or 'identified'",
    ),
    (
        MINIMAL
        + "[[conditions]]\nairspeed_true_m_s=1\naltitude_m=0\nprovenance='empirical'\n"
        + "derivatives={m_x={value=1,standard_error=1}}",
        "conditions.0.derivatives: 'm_x' is no derivative; allowed are z_w,",
    ),
    (
        MINIMAL
        + "[[conditions]]\nairspeed_true_m_s=1\naltitude_m=0\nprovenance='empirical'\n"
        + "derivatives={m_q={value=1,standard_error=0, colour=2}}",
        "conditions.0.derivatives.m_q.standard_error is 0; allowed is greater than 0 (and 1 more)",
    ),
    (
        MINIMAL
        + "[[conditions]]\nairspeed_true_m_s=1\naltitude_m=0\nprovenance='empirical'\n"
        + "derivatives={m_q={value=1,standard_error=1, colour=2}}",
        "conditions.0.derivatives.m_q.colour = 2 is a key that is not known; allowed there are value,",
    ),
    (MINIMAL + "[mass", "is not valid TOML"),
]


@pytest.mark.parametrize(("text", "sentence"), BAD)
def test_a_bad_file_gets_one_sentence_with_file_key_value_and_what_is_allowed(
    text: str, sentence: str
) -> None:
    with pytest.raises(AircraftFileError) as caught:
        parse(text)
    message = str(caught.value)
    assert message.startswith("aircraft file some.toml")
    assert sentence in message
    assert "\n" not in message


def test_a_wrong_coefficient_name_lists_the_right_ones() -> None:
    text = MINIMAL + (
        "[coefficients]\nforce_axes='wind'\nCL={alpha=5}\nCD={min=0.1,oswald=0.8}\nCY={beta=-1}\nCl={beta=-1}\n"
        "Cm={alpha=-1,q=-10,elevator=-1}\nCn={beta=0.1}\nrelative_standard_error={Cm_qq=0.1}"
    )
    with pytest.raises(AircraftFileError, match=r"'Cm_qq' is no coefficient; allowed are default, CL_zero"):
        parse(text)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(AircraftFileError, match=r"missing\.toml does not exist.*aerosonde"):
        load_aircraft(tmp_path / "missing.toml")
    with pytest.raises(AircraftFileError, match="cannot be read"):
        load_aircraft(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(AircraftFileError, match="not UTF-8"):
        load_aircraft(binary)
    binary.write_bytes(b"#" * 1_000_001)
    with pytest.raises(AircraftFileError, match="larger than the allowed"):
        load_aircraft(binary)


def test_an_unknown_name_lists_the_library() -> None:
    with pytest.raises(
        AircraftFileError, match="'cessna' is not in the library, which has aerosonde, aerosonde-a, jets"
    ):
        load_aircraft("cessna")


def test_ultrastick_is_the_published_baseline() -> None:
    c = load_aircraft("ultrastick25e").need_coefficients("the test")
    assert (c.force_axes, c.CL.alpha, c.Cm.alpha, c.Cm.elevator, c.Cl.aileron) == (
        "wind",
        4.58,
        -0.723,
        -0.8488,
        -0.1646,
    )


def test_surfaces_follow_the_sign_convention() -> None:
    """Positive deflection, negative response (thesis 4.2.2)."""
    for name in ("aerosonde", "ultrastick25e"):
        c = load_aircraft(name).need_coefficients("the test")
        assert c.Cm.elevator < 0.0 < c.CL.elevator
        assert c.Cl.aileron < 0.0
        assert c.Cn.rudder < 0.0 < c.CY.rudder
        assert c.Cl.beta < 0.0 < c.Cn.beta


def test_jetstream_modes_are_those_that_the_thesis_prints() -> None:
    """Tables 9.6 and 9.8, row Emp; tolerances carry the rounding of the printed derivatives."""
    entry = load_aircraft("jetstream31").conditions[0]
    assert entry.provenance is Provenance.A_PRIORI
    values = {symbol: d.value for symbol, d in entry.derivatives.items()}
    short_period = natural_frequency_and_damping(SHORT_PERIOD, state_matrix(SHORT_PERIOD, values))
    # m_w is printed to 0.0005 of 0.080: w_n^2 moves by 86 * 0.0005 = 0.043 of 8.44, so w_n by 0.0075.
    assert short_period == pytest.approx((2.909, 0.4376), abs=0.008)
    # n_v to 0.0005 of 0.153: w_n^2 by 0.044 of 13.5, w_n by 0.006.
    dutch_roll = natural_frequency_and_damping(DUTCH_ROLL, state_matrix(DUTCH_ROLL, values))
    assert dutch_roll == pytest.approx((3.672, 0.0253), abs=0.006)


def test_jetstream_has_the_instrument_delays_and_no_invented_airframe() -> None:
    aircraft = load_aircraft("jetstream31")
    assert aircraft.delay_s("pitch_rate_rad_s") == 0.05
    assert aircraft.delay_s("specific_force_y_m_s2") == 0.06
    assert aircraft.geometry is None
    assert aircraft.mass is None


def test_a_band_is_derived_from_the_mode_where_none_is_stated() -> None:
    aerosonde = load_aircraft("aerosonde")
    silent = aerosonde.model_copy(update={"modes": {}})
    low, high = analysis_band_hz(silent, SHORT_PERIOD)
    # two roots of one oscillation: both ends are multiples of the same frequency
    assert high / low == pytest.approx(2.2 / 0.055)
    assert low < 10.2 / (2.0 * math.pi) < high
    low, high = analysis_band_hz(silent, LATERAL)
    assert (
        low < 5.55 / (2.0 * math.pi) < 20.0 / (2.0 * math.pi) < high
    )  # Dutch roll and roll mode both inside
    jetstream = load_aircraft("jetstream31").model_copy(update={"modes": {}})
    assert analysis_band_hz(jetstream, SHORT_PERIOD)[1] == pytest.approx(
        2.2 * 2.909 / (2.0 * math.pi), rel=0.003
    )
    with pytest.raises(AircraftDataError, match=r"jetstream31 states no \[modes.lateral\] band_hz and no"):
        analysis_band_hz(jetstream, LATERAL)
