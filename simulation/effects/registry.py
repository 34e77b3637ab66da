"""Every effect by its name, in the order of the vocabulary of causes: all of it but ``unknown``, and beside it
``sensor_freeze``."""

from collections.abc import Mapping

from wingwatch.simulation.effects.actuator_backlash import ActuatorBacklash
from wingwatch.simulation.effects.actuator_lag import ActuatorLag
from wingwatch.simulation.effects.actuator_rate_limit import ActuatorRateLimit
from wingwatch.simulation.effects.aileron_effectiveness import AileronEffectiveness
from wingwatch.simulation.effects.airspeed_error import AirspeedError
from wingwatch.simulation.effects.cg_shift import CgShift
from wingwatch.simulation.effects.derivative import DerivativeChange
from wingwatch.simulation.effects.downwash_lag import DownwashLag
from wingwatch.simulation.effects.effect import Effect
from wingwatch.simulation.effects.elevator_effectiveness import ElevatorEffectiveness
from wingwatch.simulation.effects.icing import Icing
from wingwatch.simulation.effects.incidence_nonlinearity import IncidenceNonlinearity
from wingwatch.simulation.effects.mass_inertia import MassInertia
from wingwatch.simulation.effects.pitch_damping import PitchDamping
from wingwatch.simulation.effects.roll_yaw_coupling import RollYawCoupling
from wingwatch.simulation.effects.rudder_effectiveness import RudderEffectiveness
from wingwatch.simulation.effects.sensor_bias import SensorBias
from wingwatch.simulation.effects.sensor_delay import SensorDelay
from wingwatch.simulation.effects.sensor_freeze import SensorFreeze
from wingwatch.simulation.effects.sensor_position import SensorPosition
from wingwatch.simulation.effects.sensor_scale import SensorScale
from wingwatch.simulation.effects.surface_offset import SurfaceOffset
from wingwatch.simulation.effects.surface_stuck import SurfaceStuck
from wingwatch.simulation.effects.thrust_effect import ThrustEffect
from wingwatch.simulation.effects.thrust_loss import ThrustLoss
from wingwatch.simulation.effects.turbulence import TurbulenceOnset
from wingwatch.simulation.effects.vane_upwash import VaneUpwash
from wingwatch.simulation.effects.wing_damage import WingDamage

__all__ = ["EFFECTS"]

EFFECTS: Mapping[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        Icing, ElevatorEffectiveness, AileronEffectiveness, RudderEffectiveness, SurfaceStuck, SurfaceOffset,
        WingDamage, CgShift, MassInertia, PitchDamping, IncidenceNonlinearity, DownwashLag, RollYawCoupling,
        ActuatorLag, ActuatorRateLimit, ActuatorBacklash, ThrustEffect, ThrustLoss, SensorDelay, SensorBias,
        SensorScale, SensorFreeze, SensorPosition, AirspeedError, VaneUpwash, TurbulenceOnset, DerivativeChange,
    )
}  # fmt: skip
