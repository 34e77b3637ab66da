"""Simulated flight: a six-degree-of-freedom aircraft whose truth is known, with sensors, autopilot and effects."""

from wingwatch.simulation.demo import demo_fleet
from wingwatch.simulation.effects import (
    EFFECTS,
    AileronEffectiveness,
    Effect,
    EffectSyntaxError,
    ElevatorEffectiveness,
    Icing,
    RudderEffectiveness,
    parse_effect,
)
from wingwatch.simulation.fleet import FleetSimulation, simulate
from wingwatch.simulation.linear import linear_flight, linear_response, specific_force, state_rates
from wingwatch.simulation.linearise import linearise
from wingwatch.simulation.manoeuvres import (
    Doublet,
    DoubletSchedule,
    Manoeuvre,
    ThreeTwoOneOne,
    doublet_pulse_s,
    doublet_schedule,
    step_3211_s,
)
from wingwatch.simulation.scenario import Scenario, truth
from wingwatch.simulation.trim import TrimPoint, trim
from wingwatch.simulation.turbulence import Turbulence

__all__ = [
    "Scenario",
    "FleetSimulation",
    "simulate",
    "truth",
    "demo_fleet",
    "Manoeuvre",
    "Doublet",
    "ThreeTwoOneOne",
    "DoubletSchedule",
    "doublet_schedule",
    "doublet_pulse_s",
    "step_3211_s",
    "Effect",
    "EFFECTS",
    "EffectSyntaxError",
    "parse_effect",
    "Icing",
    "ElevatorEffectiveness",
    "AileronEffectiveness",
    "RudderEffectiveness",
    "Turbulence",
    "TrimPoint",
    "trim",
    "linearise",
    "linear_response",
    "state_rates",
    "specific_force",
    "linear_flight",
]
