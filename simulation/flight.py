"""The flight of a fleet between two samples and over many, compiled.

Time is cut into frames of as near to 20 ms as the sample rate allows, frames and samples into equal integration
steps. Once a frame autopilot and manoeuvres give their commands, held until the next as an autopilot's output
is (so pulses begin and end with a frame); wind is linear in altitude within a frame. The air's own motion is known
at the start and end of every step, and by its mean over it: a parabola in between (a refined flight is one through the
same air). Effects are brought up to date once a frame and once a sample, whichever comes more often.

Each vehicle is computed by the same scalar code from its own rows, so a flight is the same to the last bit alone and in
any company.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import compiled, helper, whole
from wingwatch.simulation.actuators import move_surfaces, servo_decay
from wingwatch.simulation.autopilot import autopilot
from wingwatch.simulation.dynamics import euler_angles, set_density
from wingwatch.simulation.gusts import add_discrete_gusts
from wingwatch.simulation.layout import (
    AIRSPEED_READING,
    CG_X,
    CG_Y,
    CG_Z,
    GUST_GAIN,
    IMU_X,
    IMU_Y,
    IMU_Z,
    PARAMETERS,
    VANE_X,
    VANE_Y,
    VANE_Z,
)  # fmt: skip
from wingwatch.simulation.manoeuvres import excitation
from wingwatch.simulation.navigation import report_navigation
from wingwatch.simulation.prepared import WIDTH, prepare
from wingwatch.simulation.random_numbers import fill_normals
from wingwatch.simulation.rigid_body import (
    AIR,
    AIR_P,
    AIR_Q,
    AIR_R,
    AIR_V,
    AIR_W,
    CURVE,
    DENSITY,
    DENSITY_ALTITUDE,
    DENSITY_CURVE,
    DENSITY_SLOPE,
    ELEVATOR,
    FORCE,
    GUST,
    RISE,
    SHEAR,
    SHEAR_ALTITUDE,
    SPIN,
    THROTTLE,
    WIND,
    advance,
    airspeed,
    rotation,
)  # fmt: skip
from wingwatch.simulation.turbulence import NORMALS, gust_step
from wingwatch.simulation.wind import wind_at
from wingwatch.telemetry import CHANNEL_INDEX

__all__ = ["Fleet", "FleetState", "fly", "in_body_axes", "report"]

_TIME, _AIRSPEED, _RATES = (CHANNEL_INDEX[c] for c in ("time_s", "airspeed_true_m_s", "roll_rate_rad_s"))
_FORCES, _ROLL = CHANNEL_INDEX["specific_force_x_m_s2"], CHANNEL_INDEX["roll_rad"]
_SURFACES, _COMMANDS = CHANNEL_INDEX["elevator_rad"], CHANNEL_INDEX["elevator_command_rad"]
_ALPHA, _BETA = CHANNEL_INDEX["angle_of_attack_rad"], CHANNEL_INDEX["sideslip_rad"]
_THROTTLE, _ALTITUDE, _DENSITY = (CHANNEL_INDEX[c] for c in ("throttle", "altitude_m", "air_density_kg_m3"))
_DEMANDS = CHANNEL_INDEX["roll_demand_rad"]
"""First of each group; the members follow one another in the flight table."""
_SHEAR_REACH_M = 1.0
_PARAMETERS = len(PARAMETERS)
_CHANGING, _NONE_YET = -2, -3
_LEAST_SPEED_M_S = 1e-3


class Fleet(NamedTuple):
    """What does not change in a flight; the first axis is the vehicle."""

    steps_a_sample: NDArray[np.int64]
    steps_a_frame: NDArray[np.int64]
    steps_a_gust: int
    """Steps between which the air's own motion is drawn anew: one, but for a flight that is refined."""
    base: NDArray[np.float64]
    """(vehicles, parameters): before any effect."""
    first_row: NDArray[np.int64]
    """(vehicles + 1,): where each vehicle's rows of ``times`` start."""
    times: NDArray[np.float64]
    first_column: NDArray[np.int64]
    """(vehicles + 1,): where each vehicle's ``columns`` start."""
    columns: NDArray[np.int64]
    first_value: NDArray[np.int64]
    """(vehicles + 1,): where each vehicle's ``values`` start, rows by columns."""
    values: NDArray[np.float64]
    excitations: NDArray[np.float64]
    excitation_count: NDArray[np.int64]
    gains: NDArray[np.float64]
    route: NDArray[np.float64]
    wind: NDArray[np.float64]
    sheared: NDArray[np.bool_]
    turbulent: NDArray[np.bool_]
    gust_filter: NDArray[np.float64]
    gusts: NDArray[np.float64]
    gust_count: NDArray[np.int64]
    airspeed_freeze_s: NDArray[np.float64]
    """(vehicles,): time after which the autopilot reads the last airspeed up to then; infinite for a sound sensor."""


class FleetState(NamedTuple):
    """What changes; the first axis is the vehicle."""

    rigid: NDArray[np.float64]
    setting: NDArray[np.float64]
    servos: NDArray[np.float64]
    surfaces: NDArray[np.float64]
    orders: NDArray[np.float64]
    memory: NDArray[np.float64]
    gust_filter: NDArray[np.float64]
    gust: NDArray[np.float64]
    """Motion of the air at the end of the step."""
    streams: NDArray[np.uint64]
    centre: NDArray[np.float64]
    """Where the centre of gravity was when last looked at."""
    airspeed_read: NDArray[np.float64]
    """(vehicles,): what the autopilot's sensor read last."""


class _Air(NamedTuple):
    """The air about one vehicle, whose own motion changes from one draw to the next."""

    turbulent: bool
    row: NDArray[np.float64]
    """Its turbulence's filter, as ``turbulence.gust_step`` reads it."""
    state: NDArray[np.float64]
    """The filter's states."""
    normals: NDArray[np.float64]
    """(NORMALS,): drawn for this step."""
    gusts: NDArray[np.float64]
    """Discrete gusts, ``gust_count`` of them."""
    gust_count: int
    end: NDArray[np.float64]
    """(6,): motion at the end of the last step."""
    middle: NDArray[np.float64]
    """(6,): how far its middle lies from the straight line, of turbulence alone."""


@helper
def _parameters_now(times, columns, values, time_s, row):  # type: ignore[no-untyped-def]
    """The parameters that change, at a time, as ``Timeline.at`` has them; which row holds, or that they are
    changing."""
    n, width = times.size, columns.size
    if n == 0 or time_s < times[0]:
        return -1
    k = np.searchsorted(times, time_s, side="right") - 1
    share = 0.0 if k + 1 == n else (time_s - times[k]) / (times[k + 1] - times[k])
    for j in range(width):
        before = values[k * width + j]
        row[columns[j]] = before
        if share > 0.0:
            after = values[(k + 1) * width + j]
            straight = math.isfinite(before) and math.isfinite(after)
            row[columns[j]] = before + share * after - share * before if straight else after
    return k if k + 1 == n else _CHANGING


@helper
def _move_centre(c, x, centre):  # type: ignore[no-untyped-def]
    """The state is that of the centre of gravity: where that has moved in the body, place and velocity are its own."""
    dx, dy, dz = c[CG_X] - centre[0], c[CG_Y] - centre[1], c[CG_Z] - centre[2]
    if dx == 0.0 and dy == 0.0 and dz == 0.0:
        return
    centre[0], centre[1], centre[2] = c[CG_X], c[CG_Y], c[CG_Z]
    q0, q1, q2, q3, p, q, r = x[6], x[7], x[8], x[9], x[10], x[11], x[12]
    x[3] += q * dz - r * dy
    x[4] += r * dx - p * dz
    x[5] += p * dy - q * dx
    x[0] += (
        (1.0 - 2.0 * (q2 * q2 + q3 * q3)) * dx
        + 2.0 * (q1 * q2 - q0 * q3) * dy
        + 2.0 * (q1 * q3 + q0 * q2) * dz
    )
    x[1] += (
        2.0 * (q1 * q2 + q0 * q3) * dx
        + (1.0 - 2.0 * (q1 * q1 + q3 * q3)) * dy
        + 2.0 * (q2 * q3 - q0 * q1) * dz
    )
    x[2] += (
        2.0 * (q1 * q3 - q0 * q2) * dx
        + 2.0 * (q2 * q3 + q0 * q1) * dy
        + (1.0 - 2.0 * (q1 * q1 + q2 * q2)) * dz
    )


@helper
def in_body_axes(x, motion):  # type: ignore[no-untyped-def]
    """Turn the velocity in ``motion`` (6,), m/s, from level axes along the flight path to body axes, in place.

    Eddies are of the air: they do not roll with the aircraft, which would take an acceleration that no air has,
    omega x gust (decision 18).
    Rates of the air, rad/s, are those of body axes already. ``x`` is the rigid-body state (13,).
    """
    q0, q1, q2, q3 = x[6], x[7], x[8], x[9]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation(q0, q1, q2, q3)
    north, east = r00 * x[3] + r01 * x[4] + r02 * x[5], r10 * x[3] + r11 * x[4] + r12 * x[5]
    level = math.sqrt(north * north + east * east)
    if not level > _LEAST_SPEED_M_S:
        north, east, level = 1.0, 0.0, 1.0  # straight up or down, the path has no direction over the ground
    along, across, down = motion[0] / level, motion[1] / level, motion[2]
    to_north, to_east = along * north - across * east, along * east + across * north
    motion[0] = r00 * to_north + r10 * to_east + r20 * down
    motion[1] = r01 * to_north + r11 * to_east + r21 * down
    motion[2] = r02 * to_north + r12 * to_east + r22 * down


@helper
def _air_of_step(c, s, x, air, end_s, steps):  # type: ignore[no-untyped-def]
    """The air's motion over a span of steps into ``s``: at its start, and gain and curve of the first step."""
    end, middle = air.end, air.middle
    for j in range(6):
        s[GUST + j] = end[j]
        end[j] = middle[j] = 0.0
    if air.turbulent:
        gust_step(air.row, air.state, air.normals, end, middle)
        for j in range(6):
            end[j] *= c[GUST_GAIN]
            middle[j] *= c[GUST_GAIN]
        in_body_axes(x, end)
        in_body_axes(x, middle)
    if air.gust_count > 0:
        add_discrete_gusts(air.gusts, air.gust_count, end_s, end)
    for j in range(6):
        s[CURVE + j] = middle[j] / (steps * steps)
        s[RISE + j] = (end[j] - s[GUST + j]) / steps + 4.0 * (steps - 1.0) * s[CURVE + j]


@helper
def _wind_of_frame(s, wind, altitude, above):  # type: ignore[no-untyped-def]
    """The wind at an altitude and its change with altitude into ``s``."""
    wind_at(wind, altitude - _SHEAR_REACH_M, s[WIND : WIND + 3])
    wind_at(wind, altitude + _SHEAR_REACH_M, above)
    for j in range(3):
        s[SHEAR + j] = (above[j] - s[WIND + j]) / (2.0 * _SHEAR_REACH_M)
    wind_at(wind, altitude, s[WIND : WIND + 3])
    s[SHEAR_ALTITUDE] = altitude


@compiled(error_model="numpy", inline="always")
def report(out, i, k, time_s, x, c, s, orders):  # type: ignore[no-untyped-def]
    """True values of every simulated column but those of ``report_navigation``, at the start ``x`` of the step whose
    setting ``s`` is."""
    p, q, r = x[10], x[11], x[12]
    pd, qd, rd = s[SPIN], s[SPIN + 1], s[SPIN + 2]
    u, v, w, pa, qa, ra = s[AIR], s[AIR_V], s[AIR_W], s[AIR_P], s[AIR_Q], s[AIR_R]
    out[i, k, _TIME] = time_s
    out[i, k, _AIRSPEED] = math.sqrt(u * u + v * v + w * w)
    out[i, k, _RATES], out[i, k, _RATES + 1], out[i, k, _RATES + 2] = p, q, r
    ax, ay, az = c[IMU_X] - c[CG_X], c[IMU_Y] - c[CG_Y], c[IMU_Z] - c[CG_Z]
    out[i, k, _FORCES] = s[FORCE] - (q * q + r * r) * ax + (p * q - rd) * ay + (p * r + qd) * az
    out[i, k, _FORCES + 1] = s[FORCE + 1] + (p * q + rd) * ax - (p * p + r * r) * ay + (q * r - pd) * az
    out[i, k, _FORCES + 2] = s[FORCE + 2] + (p * r - qd) * ax + (q * r + pd) * ay - (p * p + q * q) * az
    out[i, k, _ROLL], out[i, k, _ROLL + 1], out[i, k, _ROLL + 2] = euler_angles(x)
    for j in range(3):
        out[i, k, _SURFACES + j] = s[ELEVATOR + j]
        out[i, k, _COMMANDS + j] = orders[j]
    ax, ay, az = c[VANE_X], c[VANE_Y], c[VANE_Z]
    u, v, w = u + qa * az - ra * ay, v + ra * ax - pa * az, w + pa * ay - qa * ax
    out[i, k, _ALPHA] = math.atan2(w, u)
    out[i, k, _BETA] = math.atan2(v, math.sqrt(u * u + w * w))
    out[i, k, _THROTTLE] = s[THROTTLE]
    out[i, k, _ALTITUDE] = -x[2]
    above = -x[2] - s[DENSITY_ALTITUDE]
    out[i, k, _DENSITY] = s[DENSITY] + above * (s[DENSITY_SLOPE] + above * s[DENSITY_CURVE])
    for j in range(4):
        out[i, k, _DEMANDS + j] = orders[4 + j]


@helper
def _fly_one(fleet, state, i, first_sample, rate_hz, c, out):  # type: ignore[no-untyped-def]
    """The flight of vehicle ``i`` over the samples of ``out``; ``c`` is a working row to work in."""
    a_sample, a_frame, a_gust = fleet.steps_a_sample[i], fleet.steps_a_frame[i], fleet.steps_a_gust
    steps_hz = rate_hz * a_sample
    dt = 1.0 / steps_hz
    x, s, servo, surface, orders = (
        state.rigid[i],
        state.setting[i],
        state.servos[i],
        state.surfaces[i],
        state.orders[i],
    )
    memory, stream = state.memory[i], state.streams[i]
    excitations, gains, route, wind = fleet.excitations[i], fleet.gains[i], fleet.route[i], fleet.wind[i]
    centre = state.centre[i]
    times = fleet.times[fleet.first_row[i] : fleet.first_row[i + 1]]
    columns = fleet.columns[fleet.first_column[i] : fleet.first_column[i + 1]]
    values = fleet.values[fleet.first_value[i] : fleet.first_value[i + 1]]
    k, middle, total, start = np.empty(13), np.empty(13), np.empty(13), np.empty(13)
    command, normals, above, decay = np.zeros(3), np.empty(NORMALS), np.empty(3), np.empty(3)
    air = _Air(
        fleet.turbulent[i], fleet.gust_filter[i], state.gust_filter[i], normals, fleet.gusts[i], fleet.gust_count[i],
        state.gust[i], np.zeros(6),
    )  # fmt: skip
    c[:_PARAMETERS] = fleet.base[i]
    prepared = _NONE_YET
    often = min(a_sample, a_frame)
    for sample in range(out.shape[1]):
        for sub in range(a_sample):
            index = (first_sample + sample) * a_sample + sub
            time_s = index / steps_hz
            if index % often == 0 or prepared == _NONE_YET:
                row = _parameters_now(times, columns, values, (index - index % often) / steps_hz, c)
                if row == _CHANGING or row != prepared:
                    prepared = row
                    prepare(c)
                    servo_decay(c, 0.5 * dt, decay)
                    _move_centre(c, x, centre)
            if index % a_gust == 0 and (air.turbulent or air.gust_count > 0):
                if air.turbulent:
                    fill_normals(stream, normals)
                _air_of_step(c, s, x, air, (index + a_gust) / steps_hz, a_gust)
            if index % a_frame == 0:
                if fleet.sheared[i]:
                    _wind_of_frame(s, wind, -x[2], above)
                if time_s <= fleet.airspeed_freeze_s[i]:
                    state.airspeed_read[i] = c[AIRSPEED_READING] * airspeed(c, s, x)
                autopilot(x, state.airspeed_read[i], gains, route, memory, a_frame * dt, orders)
                s[THROTTLE] = orders[3]
                if fleet.excitation_count[i] > 0:
                    excitation(excitations, fleet.excitation_count[i], time_s, command)
                    for j in range(3):
                        orders[j] += command[j]
            move_surfaces(c, s, servo, surface, orders, decay, 0.5 * dt)
            set_density(s, -x[2])
            if sub == 0:
                start[:] = x
            advance(c, s, x, dt, k, middle, total)
            if sub == 0:
                report(out, i, sample, time_s, start, c, s, orders)
                report_navigation(out, i, sample, start, c)
            for j in range(6):
                s[GUST + j] += s[RISE + j]
                s[RISE + j] -= 8.0 * s[CURVE + j]


@whole
def fly(fleet, state, first_sample, rate_hz, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (vehicles, samples, channels) with true values, advancing the state by as many samples."""
    c = np.zeros(WIDTH)
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            for j in range(out.shape[2]):
                out[i, k, j] = math.nan
        _fly_one(fleet, state, i, first_sample, rate_hz, c, out)
