"""Each effect changes of the parameters and of the readings what it says, by as much as it says, and nothing else."""

import math

import pytest

from wingwatch.aircraft import AircraftDataError, FlightCondition, load_aircraft
from wingwatch.simulation import (
    EFFECTS,
    ActuatorBacklash,
    ActuatorLag,
    ActuatorRateLimit,
    AileronEffectiveness,
    AirspeedError,
    CgShift,
    DerivativeChange,
    DownwashLag,
    Effect,
    IncidenceNonlinearity,
    MassInertia,
    PitchDamping,
    RollYawCoupling,
    SensorBias,
    SensorDelay,
    SensorFault,
    SensorFreeze,
    SensorPosition,
    SensorScale,
    SurfaceOffset,
    SurfaceStuck,
    ThrustEffect,
    ThrustLoss,
    TurbulenceOnset,
    VaneUpwash,
    parse_effect,
)
from wingwatch.simulation.effects import parameters_under
from wingwatch.simulation.layout import INDEX, PARAMETERS, parameter_row

AEROSONDE = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0)
CLEAN = parameter_row(AEROSONDE)
CLEAN[INDEX["gust_gain"]] = 0.5
CLEAN[INDEX["gust_sigma"]] = 2.0
BARE = AEROSONDE.model_copy(update={"actuators": AEROSONDE.actuators.model_copy(update={"elevator": None})})


def clean(name: str) -> float:
    return float(CLEAN[INDEX[name]])


def under(effect: Effect) -> dict[str, float]:
    row = parameters_under(AEROSONDE, CONDITION, (effect,), 0.0, CLEAN)
    return dict(zip(PARAMETERS, row.tolist(), strict=True))


CHANGES: list[tuple[Effect, dict[str, float]]] = [
    (AileronEffectiveness(0.25), {n: 0.75 * clean(n) for n in ("CY_aileron", "Cl_aileron", "Cn_aileron")}),
    (SurfaceStuck(0.1, target="elevator"), {"elevator_stuck": 1.0, "elevator_stuck_at": 0.1}),
    (SurfaceStuck(-math.inf, target="rudder"), {"rudder_stuck": 1.0, "rudder_stuck_at": -0.3927}),
    (SurfaceOffset(-0.02, target="aileron"), {"aileron_offset": -0.02}),
    (CgShift(0.03), {"cg_x_m": -0.03}),
    (PitchDamping(-0.4), {"Cm_q": 0.6 * clean("Cm_q")}),
    (
        IncidenceNonlinearity(-4.0),
        {"CL_alpha_square": -2.0 * clean("CL_alpha"), "Cm_alpha_square": -2.0 * clean("Cm_alpha")},
    ),
    (IncidenceNonlinearity(-4.0, target="lift"), {"CL_alpha_square": -2.0 * clean("CL_alpha")}),
    (IncidenceNonlinearity(3.0, target="pitch"), {"Cm_alpha_square": 1.5 * clean("Cm_alpha")}),
    (DownwashLag(0.3), {"CL_alphadot": 0.3 * clean("CL_q"), "Cm_alphadot": 0.3 * clean("Cm_q")}),
    (
        RollYawCoupling(0.5),
        {n: 1.5 * clean(n) for n in ("Cl_r", "Cl_rudder", "Cn_p", "Cn_aileron")},
    ),
    (
        ActuatorLag(0.05, target="rudder"),
        {"rudder_bandwidth": 1.0 / (1.0 / (2.0 * math.pi * 8.0) + 0.05)},
    ),
    (ActuatorRateLimit(0.4, target="elevator"), {"elevator_rate_limit": 0.4}),
    (ActuatorRateLimit(50.0, target="elevator"), {}),
    (ActuatorBacklash(0.02, target="aileron"), {"aileron_backlash": 0.02}),
    (ThrustEffect(0.05), {"thrust_line_z_m": 0.05}),
    (ThrustLoss(0.3), {"thrust_share": 0.7}),
    (SensorPosition(0.2, target="imu_x"), {"imu_x_m": 0.2}),
    (SensorPosition(-0.2, target="vane_z"), {"vane_z_m": -0.2}),
    (AirspeedError(-0.25), {"airspeed_reading": 0.75}),
    (TurbulenceOnset(2.0 * math.sqrt(0.75)), {"gust_gain": 1.0}),  # 0.5^2 + 0.75 = 1
    (DerivativeChange(0.2, target="m_q"), {"Cm_q": 1.2 * clean("Cm_q")}),
    (DerivativeChange(-2.0, target="n_v"), {"Cn_beta": -clean("Cn_beta")}),
    (DerivativeChange(0.2, target="z_eta"), {"CL_elevator": 1.2 * clean("CL_elevator")}),
    (DerivativeChange(0.2, target="l_xi"), {"Cl_aileron": 1.2 * clean("Cl_aileron")}),
    (DerivativeChange(0.2, target="y_zeta"), {"CY_rudder": 1.2 * clean("CY_rudder")}),
    (
        MassInertia(-0.2),
        {n: 0.8 * clean(n) for n in ("mass_kg", "inertia_x", "inertia_y", "inertia_z", "inertia_xz")},
    ),
    (MassInertia(-0.2, target="payload"), {"mass_kg": 8.8}),
    (SensorBias(1.0, target="roll_rad"), {}),
    (SensorScale(1.0, target="roll_rad"), {}),
    (SensorDelay(1.0, target="roll_rad"), {}),
    (SensorFreeze(1.0, target="roll_rad"), {}),
    (SensorFreeze(1.0, target="airspeed_true_m_s"), {}),
    (VaneUpwash(1.0, target="sideslip"), {}),
]


@pytest.mark.parametrize(("effect", "changes"), CHANGES, ids=[f"{e.name} {e.target}" for e, _ in CHANGES])
def test_an_effect_changes_what_it_says_and_nothing_else(effect: Effect, changes: dict[str, float]) -> None:
    row = under(effect)
    for name in PARAMETERS:
        assert row[name] == pytest.approx(changes.get(name, clean(name)), rel=1e-14), name


def test_each_effect_has_been_looked_at() -> None:
    elsewhere = {"icing", "elevator_effectiveness", "rudder_effectiveness", "wing_damage"}
    assert {effect.name for effect, _ in CHANGES} | elsewhere == set(EFFECTS)


def test_a_surface_stuck_where_it_is_has_no_number() -> None:
    row = under(parse_effect("surface_stuck[rudder]:here@0"))
    assert row["rudder_stuck"] == 1.0
    assert math.isnan(row["rudder_stuck_at"])


@pytest.mark.parametrize(
    ("effect", "faults"),
    [
        (SensorBias(0.1, target="roll_rad"), (SensorFault("roll_rad", bias=1.0),)),
        (SensorScale(0.1, target="throttle"), (SensorFault("throttle", scale=1.0),)),
        (SensorDelay(0.1, target="altitude_m"), (SensorFault("altitude_m", delay_s=1.0),)),
        (SensorFreeze(1.0, target="altitude_m"), (SensorFault("altitude_m", frozen=True),)),
        (VaneUpwash(0.1, target="angle_of_attack"), (SensorFault("angle_of_attack_rad", scale=1.0),)),
        (AirspeedError(0.1), (SensorFault("airspeed_true_m_s", scale=1.0),)),
        (CgShift(0.1), ()),
    ],
)
def test_a_sensor_reads_wrong_by_the_size(effect: Effect, faults: tuple[SensorFault, ...]) -> None:
    assert effect.sensor_faults() == faults


def test_an_ideal_actuator_takes_the_lag_alone() -> None:
    row = parameters_under(BARE, CONDITION, (ActuatorLag(0.1, target="elevator"),), 0.0)
    assert row[INDEX["elevator_bandwidth"]] == pytest.approx(10.0)


def test_parameters_of_no_flight_have_no_gusts() -> None:
    still = parameter_row(AEROSONDE)
    still[INDEX["gust_gain"]] = 0.0
    row = parameters_under(AEROSONDE, CONDITION, (TurbulenceOnset(2.0),), 0.0, still)
    assert row[INDEX["gust_gain"]] == 0.0


@pytest.mark.parametrize(
    ("effect", "says"),
    [
        (SurfaceStuck(0.5, target="elevator"), "travels to 0.3927; give a deflection within that"),
        (DerivativeChange(0.2, target="y_p"), "changes nothing on aircraft aerosonde, whose CY_p is zero"),
        (MassInertia(-0.5, target="payload,5,0,0"), "its moments of inertia are too small; take less"),
    ],
)
def test_what_an_aircraft_cannot_suffer_is_refused_in_one_sentence(effect: Effect, says: str) -> None:
    with pytest.raises(AircraftDataError, match=says):
        under(effect)


def test_a_hardover_needs_a_limit() -> None:
    with pytest.raises(AircraftDataError, match="aerosonde states no position_limit_rad for it"):
        parameters_under(BARE, CONDITION, (SurfaceStuck(math.inf, target="elevator"),), 0.0)
