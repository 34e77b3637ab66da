"""Simulated flight: a six-degree-of-freedom aircraft whose truth is known, with sensors, autopilot and effects.

Example:
    Ten seconds with elevator, aileron and rudder doublets, half of the elevator's effect lost after five:

    >>> from wingwatch.aircraft import SHORT_PERIOD, load_aircraft
    >>> from wingwatch.simulation import Scenario, doublet_schedule, linearise, parse_effect, simulate
    >>> aerosonde = load_aircraft("aerosonde")
    >>> cruise = aerosonde.envelope.cruise
    >>> lost = (parse_effect("elevator_effectiveness:0.5@5"),)
    >>> doublets = (doublet_schedule(aerosonde, cruise),)
    >>> len(simulate(Scenario(aerosonde, manoeuvres=doublets, effects=lost, seed=1), 10.0))
    500
    >>> [round(linearise(aerosonde, cruise, SHORT_PERIOD, lost, at)["m_eta"], 1) for at in (4.0, 6.0)]
    [-31.7, -15.8]
"""

from wingwatch.simulation.demo import demo_fleet
from wingwatch.simulation.effects import (
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
    EffectSyntaxError,
    ElevatorEffectiveness,
    Icing,
    IncidenceNonlinearity,
    MassInertia,
    PitchDamping,
    RollYawCoupling,
    RudderEffectiveness,
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
    WingDamage,
    effect_text,
    parse_effect,
)
from wingwatch.simulation.fleet import FleetSimulation, simulate
from wingwatch.simulation.gusts import DiscreteGust
from wingwatch.simulation.linear import linear_flight, linear_response, specific_force, state_rates
from wingwatch.simulation.linearise import linearise
from wingwatch.simulation.manoeuvres import (
    Doublet,
    DoubletSchedule,
    Manoeuvre,
    Multisine,
    Sampled,
    Surface,
    Sweep,
    ThreeTwoOneOne,
    doublet_schedule,
    multisine,
    three_two_one_one_schedule,
)
from wingwatch.simulation.route import Route, Waypoint, check_route, patrol
from wingwatch.simulation.scenario import Scenario
from wingwatch.simulation.sensor_errors import SensorErrors
from wingwatch.simulation.trim import TrimPoint, trim
from wingwatch.simulation.truth import flight_truth, truth
from wingwatch.simulation.turbulence import Turbulence, TurbulenceModel, gust_scales, gust_spectra
from wingwatch.simulation.wind import WindProfile

__all__ = [
    "Scenario",
    "SensorErrors",
    "FleetSimulation",
    "simulate",
    "truth",
    "flight_truth",
    "demo_fleet",
    "Manoeuvre",
    "Doublet",
    "ThreeTwoOneOne",
    "DoubletSchedule",
    "doublet_schedule",
    "Multisine",
    "Sampled",
    "Surface",
    "Sweep",
    "multisine",
    "three_two_one_one_schedule",
    "Route",
    "Waypoint",
    "check_route",
    "patrol",
    "Effect",
    "EFFECTS",
    "EffectSyntaxError",
    "parse_effect",
    "effect_text",
    "ActuatorBacklash",
    "ActuatorLag",
    "ActuatorRateLimit",
    "AileronEffectiveness",
    "AirspeedError",
    "CgShift",
    "DerivativeChange",
    "DownwashLag",
    "ElevatorEffectiveness",
    "Icing",
    "IncidenceNonlinearity",
    "MassInertia",
    "PitchDamping",
    "RollYawCoupling",
    "RudderEffectiveness",
    "SensorBias",
    "SensorDelay",
    "SensorFault",
    "SensorFreeze",
    "SensorPosition",
    "SensorScale",
    "SurfaceOffset",
    "SurfaceStuck",
    "ThrustEffect",
    "ThrustLoss",
    "TurbulenceOnset",
    "VaneUpwash",
    "WingDamage",
    "Turbulence",
    "TurbulenceModel",
    "DiscreteGust",
    "WindProfile",
    "gust_scales",
    "gust_spectra",
    "TrimPoint",
    "trim",
    "linearise",
    "linear_response",
    "state_rates",
    "specific_force",
    "linear_flight",
]
