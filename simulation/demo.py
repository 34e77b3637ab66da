"""The fleet of the demonstration: three Aerosondes, one healthy, one taking on ice, one losing its elevator."""

import math

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation.effects import ElevatorEffectiveness, Icing
from wingwatch.simulation.manoeuvres import doublet_schedule
from wingwatch.simulation.scenario import Scenario

__all__ = ["demo_fleet"]

ICING_SEVERITY = 0.15
"""Between the Twin Otter's reference level (0.0675, lift slope -10 %) and the published files' final one (0.3,
-44 %): the lift slope loses 22 %, the drag at no lift doubles, directional stability loses 44 %. Iced small unmanned
aircraft are reported at +80 % power and more, airfoils at -40 % lift, so this is moderate ice there."""
ICING_RAMP_S = 30.0
"""The published files' transient time."""
DOUBLET_RAD = math.radians(2.0)


def demo_fleet() -> tuple[Scenario, ...]:
    """Healthy; icing from 60 s over 30 s; half of the elevator's effectiveness lost at 90 s. All at 25 m/s and 1000 m,
    with doublets on elevator, aileron and rudder every 20 s."""
    aircraft = load_aircraft("aerosonde")
    condition = FlightCondition(25.0, 1000.0)
    effects = {
        "healthy": (),
        "icing": (Icing(ICING_SEVERITY, 60.0, ICING_RAMP_S),),
        "elevator": (ElevatorEffectiveness(0.5, 90.0),),
    }
    return tuple(
        Scenario(
            aircraft,
            condition.airspeed_true_m_s,
            condition.altitude_m,
            (doublet_schedule(aircraft, condition, DOUBLET_RAD, start_s=5.0 + 2.0 * i),),
            effects=befalls,
            seed=i + 1,
            name=name,
        )
        for i, (name, befalls) in enumerate(effects.items())
    )
