"""Conditioning: what is done to a recorded flight before it is estimated from, and what it says of its sensors and air.

Positions and delays of sensors, the running trim, steady segments, the flight path as one rigid body's motion, gusts,
and the centre of gravity. All of it works on whole tables, after the flight.
"""

from wingwatch.telemetry.conditioning.centre_of_gravity import centre_of_gravity, centre_shift, imu_separation
from wingwatch.telemetry.conditioning.correction import without_errors
from wingwatch.telemetry.conditioning.delays import DelayConfig, align, estimate_delays, estimate_servo_delay
from wingwatch.telemetry.conditioning.parameter import Parameter
from wingwatch.telemetry.conditioning.path_reconstruction import (
    PathConfig,
    ReconstructedPath,
    reconstruct_path,
)
from wingwatch.telemetry.conditioning.positions import (
    at_centre,
    flow_at_centre,
    forces_at_centre,
    lever_matrix,
)
from wingwatch.telemetry.conditioning.running_trim import RunningTrim, running_trim, without_trim
from wingwatch.telemetry.conditioning.steady_segments import SteadyLimits, SteadySegment, steady_segments
from wingwatch.telemetry.conditioning.turbulence_intensity import (
    GUST_CHANNELS,
    VANES,
    AirConfig,
    AirQuality,
    turbulence_intensity,
)

__all__ = [
    "Parameter",
    "align",
    "DelayConfig",
    "estimate_delays",
    "estimate_servo_delay",
    "at_centre",
    "flow_at_centre",
    "forces_at_centre",
    "lever_matrix",
    "RunningTrim",
    "running_trim",
    "without_trim",
    "SteadyLimits",
    "SteadySegment",
    "steady_segments",
    "PathConfig",
    "ReconstructedPath",
    "reconstruct_path",
    "without_errors",
    "centre_of_gravity",
    "centre_shift",
    "imu_separation",
    "GUST_CHANNELS",
    "VANES",
    "AirConfig",
    "AirQuality",
    "turbulence_intensity",
]
