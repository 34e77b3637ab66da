"""What a navigation receiver shows of the flight, compiled: velocity over the ground and place on a flat earth.

Both are those of the reference point, as the airspeed is: so velocity over the ground is velocity through the air plus
the air's own, and a centre of gravity that moves in the body makes neither leap. Places count from one fixed origin at
one length a degree of latitude and one a degree of longitude, both of the origin.
"""

import math

from wingwatch.kernels.decorators import helper
from wingwatch.simulation.layout import CG_X, CG_Y, CG_Z
from wingwatch.simulation.rigid_body import rotation
from wingwatch.telemetry import CHANNEL_INDEX

__all__ = ["M_A_DEGREE_EAST", "M_A_DEGREE_NORTH", "ORIGIN_DEG", "report_navigation"]

ORIGIN_DEG = (50.0, 10.0)
"""Latitude and longitude where every flight starts: an arbitrary choice."""
_EARTH_RADIUS_M = 6_371_000.0
"""Mean radius of the earth."""
M_A_DEGREE_NORTH = math.radians(_EARTH_RADIUS_M)
M_A_DEGREE_EAST = M_A_DEGREE_NORTH * math.cos(math.radians(ORIGIN_DEG[0]))

_LATITUDE_ORIGIN_DEG, _LONGITUDE_ORIGIN_DEG = ORIGIN_DEG
_VELOCITY = CHANNEL_INDEX["velocity_north_m_s"]
"""First of three that follow one another in the flight table."""
_LATITUDE, _LONGITUDE = CHANNEL_INDEX["latitude_deg"], CHANNEL_INDEX["longitude_deg"]


@helper
def report_navigation(out, i, k, x, c):  # type: ignore[no-untyped-def]
    """True velocity and place into sample ``k`` of vehicle ``i`` of ``out``, from its state ``x`` and working row."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation(x[6], x[7], x[8], x[9])
    p, q, r = x[10], x[11], x[12]
    ax, ay, az = -c[CG_X], -c[CG_Y], -c[CG_Z]
    u, v, w = x[3] + q * az - r * ay, x[4] + r * ax - p * az, x[5] + p * ay - q * ax
    out[i, k, _VELOCITY] = r00 * u + r01 * v + r02 * w
    out[i, k, _VELOCITY + 1] = r10 * u + r11 * v + r12 * w
    out[i, k, _VELOCITY + 2] = r20 * u + r21 * v + r22 * w
    north = x[0] + r00 * ax + r01 * ay + r02 * az
    east = x[1] + r10 * ax + r11 * ay + r12 * az
    out[i, k, _LATITUDE] = _LATITUDE_ORIGIN_DEG + north / M_A_DEGREE_NORTH
    out[i, k, _LONGITUDE] = _LONGITUDE_ORIGIN_DEG + east / M_A_DEGREE_EAST
