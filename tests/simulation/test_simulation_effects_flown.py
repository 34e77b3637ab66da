"""Every effect in flight: nothing before its onset, then what it says, where a record shows it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.aircraft import load_aircraft
from wingwatch.simulation import EFFECTS, Doublet, FleetSimulation, Scenario, parse_effect
from wingwatch.telemetry import CHANNEL_INDEX

AEROSONDE = load_aircraft("aerosonde")
RATE_HZ, ONSET_S, LENGTH_S = 50.0, 2.0, 6.0

SHOWN: dict[str, str] = {
    "icing:0.2@2": "airspeed_true_m_s",
    "icing[wing]:0.2@2": "angle_of_attack_rad",
    "icing[nonlinear]:0.2@2": "angle_of_attack_rad",
    "icing[nonlinear_tail]:0.2@2": "pitch_rate_rad_s",
    "icing[left]:0.2@2": "roll_rate_rad_s",
    "elevator_effectiveness:0.5@2": "pitch_rate_rad_s",
    "aileron_effectiveness:0.5@2": "roll_rate_rad_s",
    "rudder_effectiveness:0.5@2": "yaw_rate_rad_s",
    "surface_stuck[elevator]:here@2": "elevator_rad",
    "surface_stuck[rudder]:0@2": "rudder_rad",
    "surface_stuck[aileron]:limit@2": "aileron_rad",
    "surface_offset[rudder]:0.03@2": "rudder_rad",
    "wing_damage[right]:0.2@2": "roll_rate_rad_s",
    "cg_shift:0.02@2": "pitch_rate_rad_s",
    "mass_inertia:-0.2@2": "specific_force_z_m_s2",
    "mass_inertia[payload,0,0.5,0]:-0.1@2": "roll_rate_rad_s",
    "pitch_damping:-0.5@2": "pitch_rate_rad_s",
    "incidence_nonlinearity:-20@2": "pitch_rate_rad_s",
    "downwash_lag:0.4@2": "pitch_rate_rad_s",
    "roll_yaw_coupling:2@2": "yaw_rate_rad_s",
    "actuator_lag[elevator]:0.1@2": "elevator_rad",
    "actuator_rate_limit[elevator]:0.1@2": "elevator_rad",
    "actuator_backlash[rudder]:0.03@2": "rudder_rad",
    "thrust_effect:0.1@2": "pitch_rate_rad_s",
    "thrust_loss:1@2": "airspeed_true_m_s",
    "sensor_delay[pitch_rate_rad_s]:0.1@2": "pitch_rate_rad_s",
    "sensor_bias[roll_rate_rad_s]:0.05@2": "roll_rate_rad_s",
    "sensor_scale[yaw_rate_rad_s]:0.2@2": "yaw_rate_rad_s",
    "sensor_freeze[pitch_rate_rad_s]:1@2": "pitch_rate_rad_s",
    "sensor_freeze[airspeed_true_m_s]:1@2": "airspeed_true_m_s",
    "sensor_position[imu_x]:0.3@2": "specific_force_z_m_s2",
    "airspeed_error:-0.3@2": "airspeed_true_m_s",
    "vane_upwash[angle_of_attack]:0.3@2": "angle_of_attack_rad",
    "turbulence:2@2": "specific_force_z_m_s2",
    "derivative[n_v]:0.5@2": "yaw_rate_rad_s",
}
"""An effect, and a column in which it shows."""

SENSORS_ALONE = (
    "sensor_delay", "sensor_bias", "sensor_scale", "sensor_freeze[pitch", "sensor_position", "vane_upwash",
)  # fmt: skip
MANOEUVRES = tuple(
    Doublet(surface, 0.04, 0.25, start)
    for start in (0.5, 2.5)
    for surface in ("elevator", "aileron", "rudder")
)

Flights = dict[str, NDArray[np.float64]]


@pytest.fixture(scope="module")
def flights() -> Flights:
    """Every flight, the clean one under the empty name, all in one fleet."""
    scenarios = [
        Scenario(
            AEROSONDE,
            manoeuvres=MANOEUVRES,
            effects=(parse_effect(text),) if text else (),
            noise=False,
        )
        for text in ("", *SHOWN)
    ]
    values = FleetSimulation(scenarios, RATE_HZ).step(round(LENGTH_S * RATE_HZ))
    return dict(zip(("", *SHOWN), values, strict=True))


def column(values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    return np.asarray(values[:, CHANNEL_INDEX[name]])


AFTER = slice(round(ONSET_S * RATE_HZ), None)
BEFORE = slice(0, round(ONSET_S * RATE_HZ))


def test_every_effect_is_flown() -> None:
    assert {parse_effect(text).name for text in SHOWN} == set(EFFECTS)


@pytest.mark.parametrize("text", SHOWN)
def test_an_effect_shows_after_its_onset_and_not_before(flights: Flights, text: str) -> None:
    clean, flown = flights[""], flights[text]
    np.testing.assert_array_equal(flown[BEFORE], clean[BEFORE])
    assert np.isfinite(column(flown, "airspeed_true_m_s")).all()
    name = SHOWN[text]
    change = np.abs(column(flown, name) - column(clean, name)).max()
    assert change > 0.02 * np.ptp(column(clean, name))


@pytest.mark.parametrize("text", [t for t in SHOWN if t.startswith(SENSORS_ALONE)])
def test_a_faulty_sensor_flies_no_other_flight(flights: Flights, text: str) -> None:
    clean, flown = flights[""], flights[text]
    wrong = {SHOWN[text]}
    if text.startswith("sensor_position"):
        wrong |= {f"specific_force_{axis}_m_s2" for axis in "xyz"}
    for name, index in CHANNEL_INDEX.items():
        if name not in wrong:
            np.testing.assert_array_equal(flown[:, index], clean[:, index], err_msg=name)


def test_readings_are_wrong_by_the_size(flights: Flights) -> None:
    for text, name, scale, bias in (
        ("sensor_bias[roll_rate_rad_s]:0.05@2", "roll_rate_rad_s", 1.0, 0.05),
        ("sensor_scale[yaw_rate_rad_s]:0.2@2", "yaw_rate_rad_s", 1.2, 0.0),
        ("vane_upwash[angle_of_attack]:0.3@2", "angle_of_attack_rad", 1.3, 0.0),
    ):
        truth = column(flights[""], name)[AFTER]
        np.testing.assert_allclose(
            column(flights[text], name)[AFTER], scale * truth + bias, rtol=1e-12, atol=1e-15
        )
    pitch = "pitch_rate_rad_s"
    late = column(flights[f"sensor_delay[{pitch}]:0.1@2"], pitch)
    np.testing.assert_allclose(late[120:], column(flights[""], pitch)[115:-5], rtol=1e-12, atol=1e-15)
    for name in (pitch, "airspeed_true_m_s"):
        frozen = column(flights[f"sensor_freeze[{name}]:1@2"], name)
        np.testing.assert_array_equal(frozen[AFTER], column(flights[""], name)[AFTER][0])


def test_stuck_surfaces_stay_where_they_should(flights: Flights) -> None:
    elevator = column(flights["surface_stuck[elevator]:here@2"], "elevator_rad")
    np.testing.assert_array_equal(elevator[AFTER], elevator[AFTER][0])
    np.testing.assert_allclose(
        column(flights["surface_stuck[rudder]:0@2"], "rudder_rad")[AFTER], 0.0, atol=1e-4
    )
    aileron = column(flights["surface_stuck[aileron]:limit@2"], "aileron_rad")
    step = 3.5 / RATE_HZ  # at the file's rate limit
    assert np.diff(aileron[AFTER]).max() <= step + 1e-12
    assert np.diff(aileron[AFTER]).max() > 0.9 * step
    assert aileron[-1] == pytest.approx(0.3927, abs=1e-6)
    assert (
        np.abs(column(flights["surface_stuck[elevator]:here@2"], "elevator_command_rad")[AFTER]).max() > 0.02
    )


def test_the_aircraft_goes_where_physics_sends_it(flights: Flights) -> None:
    soon = slice(
        round((ONSET_S + 0.1) * RATE_HZ), round((ONSET_S + 0.4) * RATE_HZ)
    )  # before the next doublet

    def change(text: str, name: str, when: slice = soon) -> float:
        return float(np.mean(column(flights[text], name)[when] - column(flights[""], name)[when]))

    end = slice(-25, None)
    assert change("wing_damage[right]:0.2@2", "roll_rate_rad_s") > 0.05
    assert change("icing[left]:0.2@2", "roll_rate_rad_s") < -0.01
    assert (
        change("mass_inertia[payload,0,0.5,0]:-0.1@2", "roll_rate_rad_s") < -0.01
    )  # the right side is lighter
    assert change("mass_inertia:-0.2@2", "specific_force_z_m_s2") < -0.5  # the same lift on less mass
    assert change("cg_shift:0.02@2", "pitch_rate_rad_s") > 0.005  # tail-heavy
    assert change("thrust_effect:0.1@2", "pitch_rate_rad_s") > 0.005
    assert change("thrust_loss:1@2", "airspeed_true_m_s", end) < -1.0
    assert change("icing:0.2@2", "airspeed_true_m_s", end) < -0.1
    assert change("airspeed_error:-0.3@2", "throttle", end) > 0.05  # the autopilot believes it


def test_turbulence_begins_at_its_size() -> None:
    """The spread over 200 flights of the first gust after the onset, seen by the vane: w/V."""
    count, size = 200, 2.0
    fleet = FleetSimulation(
        [
            Scenario(AEROSONDE, effects=(parse_effect(f"turbulence:{size}@0.5"),), noise=False, seed=seed)
            for seed in range(count)
        ],
        RATE_HZ,
    )
    values = fleet.step(27)
    gust = 25.0 * (
        values[:, 26, CHANNEL_INDEX["angle_of_attack_rad"]]
        - values[:, 24, CHANNEL_INDEX["angle_of_attack_rad"]]
    )
    # standard deviation of an estimated one: 1/sqrt(2 n); the aircraft gives way by Z_w/m 0.04 s = 16 % at most
    spread = float(np.std(gust))
    assert (
        size * (1.0 - 0.16 - 3.0 / np.sqrt(2.0 * count)) < spread < size * (1.0 + 3.0 / np.sqrt(2.0 * count))
    )
