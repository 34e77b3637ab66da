"""Forces and moments against what makes them by the aircraft file; compiled.

With the equations of motion about the centre of gravity (Etkin, Dynamics of Flight, 4.5; x-z plane of symmetry),

    Jx dp/dt - Jxz dr/dt = L + (Jy - Jz) q r + Jxz p q
    Jy dq/dt             = M + (Jz - Jx) p r - Jxz (p^2 - r^2)
    Jz dr/dt - Jxz dp/dt = N + (Jx - Jy) p q - Jxz q r

every moment has an equation of its own. Its z is what the left side, divided by its own moment of inertia, grew by
since the last sample, less what the right side by the file makes of the mean of both samples. z of the forces is the
specific force less that of the file. A parameter is a coefficient's change over the file's.

Angle of attack and sideslip are those that their own relations predict for this sample. Columns take them from two
samples ago and surfaces from their commands: one with the noise that z has, too, would explain it.
"""

import math

from wingwatch.kernels.decorators import lean
from wingwatch.monitor.detection.redundancy.layout import (
    ALPHA,
    COLUMNS,
    LIFT,
    PITCHING,
    ROLLING,
    SIDE,
    YAWING,
)
from wingwatch.telemetry import CHANNEL_INDEX

__all__ = ["ATTACHED_RAD", "COARSE", "forces_and_moments"]

_P, _Q, _R = (CHANNEL_INDEX[f"{a}_rate_rad_s"] for a in ("roll", "pitch", "yaw"))
_V, _RHO = CHANNEL_INDEX["airspeed_true_m_s"], CHANNEL_INDEX["air_density_kg_m3"]
_SURFACES = tuple(CHANNEL_INDEX[f"{s}_rad"] for s in ("elevator", "aileron", "rudder"))
ATTACHED_RAD = (math.radians(-4.0), math.radians(10.0))
"""Angles of attack over which lift is taken as straight."""
COARSE = 0.1
"""Standard deviation of what the mean of two samples misses of a moment between them, as a fraction of its change: an
exponential that lasts for a sample is misjudged by 0.08 of it."""
_SHOWN = 5.0
"""Standard deviations of a reading's noise from which a rate shows its damping, and incidence its slope."""
USUAL_S = 60.0
"""Over so long the usual incidence is a mean: of two seconds, its own noise would still be a column."""


@lean
def _regressors(row, dt, model, memory, flow, to):  # type: ignore[no-untyped-def]
    """What coefficients multiply: of z in ``to.lon`` and ``to.lat``, of columns in ``to.lon_d`` and ``to.lat_d``.

    A rate or an incidence that moves no further than its reading's noise shows nothing of its coefficient.
    """
    c, v = model.dimensions, max(row[_V], 1.0)
    lon, lat, lon_d, lat_d = to.lon, to.lat, to.lon_d, to.lat_d
    by_span, by_chord = 0.5 * c[0] / v, 0.5 * c[1] / v
    lon[0] = lat[0] = lon_d[0] = lat_d[0] = 1.0
    lon[2], lat[2], lat[3] = row[_Q] * by_chord, row[_P] * by_span, row[_R] * by_span
    lon[4] = to.rate[ALPHA] * by_chord
    lon_d[2], lat_d[2], lat_d[3], lon_d[4] = lon[2], lat[2], lat[3], lon[4]
    if row[_P] ** 2 < _SHOWN**2 * model.gyro_variance[0]:
        lat_d[2] = 0.0
    if row[_Q] ** 2 < _SHOWN**2 * model.gyro_variance[1]:
        lon_d[2] = 0.0
    if row[_R] ** 2 < _SHOWN**2 * model.gyro_variance[2]:
        lat_d[3] = 0.0
    for j in range(3):
        commanded = memory.servo[0, j]
        position = commanded if model.commanded[j] else row[_SURFACES[j]]
        column = position if math.isnan(commanded) else commanded
        if j == 0:
            lon[3], lon_d[3] = position, column
        else:
            lat[3 + j], lat_d[3 + j] = position, column
    lon[1], lat[1] = flow[16], flow[17]
    if math.isnan(lat[1]):  # no vane of sideslip: the side force tells it
        y = model.coefficients[SIDE - LIFT]
        force = flow[18] / flow[13] - y[2] * lat[2] - y[3] * lat[3] - y[4] * lat[4] - y[5] * lat[5]
        lat[1] = force / y[1]
    late, part = memory.late_flow, 1.0 - math.exp(-dt / USUAL_S)
    for k in range(2):
        now = lon[1] if k == 0 else lat[1]
        column, usual = late[k, 1], late[k, 2]
        if math.isnan(usual) or dt == 0.0:
            usual = column = now
        elif not math.isnan(now):
            usual += part * (now - usual)
        late[k, 2], late[k, 1], late[k, 0] = usual, late[k, 0], now
        if math.isnan(late[k, 1]):
            late[k, 1] = now
        if math.isnan(column) or (column - usual) ** 2 < _SHOWN**2 * model.noise_variance[ALPHA + k]:
            column = usual
        if k == 0:
            lon_d[1] = column
        else:
            lat_d[1] = column


@lean
def _of(coefficients, regressors):  # type: ignore[no-untyped-def]
    """A coefficient by its terms; those that the aircraft has not are no terms."""
    total = 0.0
    for j in range(COLUMNS):
        if coefficients[j] != 0.0:
            total += coefficients[j] * regressors[j]
    return total


@lean
def _moment(i, dt, rate, angular, pressure, to, model, memory):  # type: ignore[no-untyped-def]
    """z and columns of one moment.

    ``rate``: left side over its inertia, rad/s; ``angular``: what the rates alone make of its derivative, rad/s2;
    ``pressure``: of a coefficient 1, rad/s2.
    """
    regressors, columns = (to.lon, to.lon_d) if i == PITCHING else (to.lat, to.lat_d)
    last, k = memory.moment[i - ROLLING], i - LIFT
    now = angular + pressure * _of(model.coefficients[k], regressors)
    to.z[i] = (rate - last[0]) - 0.5 * dt * (now + last[1]) if dt > 0.0 else math.nan
    to.more[i] = (COARSE * dt * (now - last[1])) ** 2
    last[0], last[1] = rate, now
    for j in range(COLUMNS):
        column = pressure * model.units[k, j] * columns[j] if model.units[k, j] != 0.0 else 0.0
        to.d[i, j] = 0.5 * dt * (column + last[2 + j])
        last[2 + j] = column


@lean
def forces_and_moments(row, dt, model, memory, flow, to):  # type: ignore[no-untyped-def]
    """z and columns of forces and moments; beyond straight lift they are left out.

    ``row``: one sample, (columns,); ``dt``: s since the one before; ``flow``: that of ``samples``, (fields,).
    """
    _regressors(row, dt, model, memory, flow, to)
    per_kg = flow[13]
    for i in (LIFT, SIDE):
        k = i - LIFT
        regressors, columns = (to.lon, to.lon_d) if i == LIFT else (to.lat, to.lat_d)
        sign, force = (-1.0, flow[12]) if i == LIFT else (1.0, flow[18])
        to.z[i] = force - sign * per_kg * _of(model.coefficients[k], regressors)
        for j in range(COLUMNS):
            to.d[i, j] = sign * per_kg * model.units[k, j] * columns[j] if model.units[k, j] != 0.0 else 0.0
    c = model.dimensions
    span, chord, jx, jy, jz, jxz = c[0], c[1], c[2], c[3], c[4], c[5]
    p, q, r = row[_P], row[_Q], row[_R]
    force = per_kg * model.airframe[0]
    _moment(
        ROLLING,
        dt,
        p - jxz / jx * r,
        ((jy - jz) * q * r + jxz * p * q) / jx,
        force * span / jx,
        to,
        model,
        memory,
    )
    _moment(
        PITCHING,
        dt,
        q,
        ((jz - jx) * p * r - jxz * (p * p - r * r)) / jy,
        force * chord / jy,
        to,
        model,
        memory,
    )
    _moment(
        YAWING,
        dt,
        r - jxz / jz * p,
        ((jx - jy) * p * q - jxz * q * r) / jz,
        force * span / jz,
        to,
        model,
        memory,
    )
    if not ATTACHED_RAD[0] <= to.lon[1] <= ATTACHED_RAD[1]:
        for i in range(LIFT, YAWING + 1):
            to.z[i] = math.nan
