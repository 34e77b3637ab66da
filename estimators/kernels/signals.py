"""Samples into signals of one structure, compiled; ``signals`` has the equations and the layout of a row."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.estimators.kernels.intersample import frames_of
from wingwatch.estimators.kernels.levels import advance_level, start_level
from wingwatch.kernels.decorators import helper, whole
from wingwatch.telemetry import CHANNEL_INDEX, MAX_GAP_S

__all__ = [
    "LAST", "REST_S", "ROWS", "STUCK_S", "SignalArrays", "SignalForm", "fill_moments", "fill_signals", "pass_high"
]  # fmt: skip

_TIME = CHANNEL_INDEX["time_s"]
_AIRSPEED = CHANNEL_INDEX["airspeed_true_m_s"]
_P = CHANNEL_INDEX["roll_rate_rad_s"]
_Q = CHANNEL_INDEX["pitch_rate_rad_s"]
_R = CHANNEL_INDEX["yaw_rate_rad_s"]
_AX = CHANNEL_INDEX["specific_force_x_m_s2"]
_AY = CHANNEL_INDEX["specific_force_y_m_s2"]
_AZ = CHANNEL_INDEX["specific_force_z_m_s2"]
_ROLL = CHANNEL_INDEX["roll_rad"]
_PITCH = CHANNEL_INDEX["pitch_rad"]
_ALPHA = CHANNEL_INDEX["angle_of_attack_rad"]
_BETA = CHANNEL_INDEX["sideslip_rad"]
_ALTITUDE = CHANNEL_INDEX["altitude_m"]
_DENSITY = CHANNEL_INDEX["air_density_kg_m3"]
_TEMPERATURE = CHANNEL_INDEX["outside_air_temperature_k"]

STUCK_S = 2.0
"""A sensor whose reading has not moved for so long, while another of the structure has, is stuck. Sensors that are read
again more seldom are of no use to a mode's dynamics."""
MOST_FLOW_ANGLE_RAD = math.radians(60.0)
"""Of an angle of attack or sideslip in the kinematics: vanes that say more say nothing of them."""
_MOST_SINE = math.sin(MOST_FLOW_ANGLE_RAD)

LAST, REST_S, ROWS = range(3)
"""Of a reading's history: its last value, how long it has rested while others moved, in how many rows it was stuck."""


class SignalForm(NamedTuple):
    """What does not change of one structure's signals."""

    lateral: bool
    readings: NDArray[np.int64]
    """(states + 1,): channels of the vane, the rates and the accelerometer."""
    inputs: NDArray[np.int64]
    """(inputs,): channels."""
    commands: NDArray[np.int64]
    """(inputs,): channels of the servos' commands."""
    x_vane_m: float
    z_vane_m: float
    airspeed_memory_s: float
    reconstruction_s: float
    pressure: float
    """rho V^2 at the reference, N/m2."""
    servo_s: NDArray[np.float64]
    """(inputs,)."""


class SignalArrays(NamedTuple):
    """``SignalState`` as kernels take it."""

    memory: NDArray[np.float64]
    airspeed: NDArray[np.float64]
    servos: NDArray[np.float64]
    readings: NDArray[np.float64]


@whole
def fill_signals(values, lanes, form, state, out):  # type: ignore[no-untyped-def]
    """One pass over vehicles and samples; see the layout of ``signals``.

    Args:
        values: (vehicles, samples, channels).
        lanes: ``Lanes`` of these vehicles.
        form: ``SignalForm``.
        state: ``SignalArrays``, in place.
        out: (vehicles, samples, columns), filled.
    """
    memory, smoothers, servos = state.memory, state.airspeed, state.servos
    lateral, inputs = form.lateral, form.inputs
    ns, nu = form.readings.size - 1, inputs.size
    force = form.readings[ns]
    for m in range(lanes.place.size):
        i = lanes.place[m]
        last, along, velocity, rate, seen = memory[i]
        speed = np.nan
        for k in range(lanes.counts[m]):
            row = values[m, k]
            dt = row[_TIME] - last
            velocity_measured, kinematic, along_now = _motion(row, lateral, form.x_vane_m, form.z_vane_m)
            rate_now = row[force] + kinematic
            if not (0.0 < dt <= MAX_GAP_S):
                start_level(smoothers[i], row[_AIRSPEED])
                speed, velocity = row[_AIRSPEED], 0.0
            else:
                speed = row[_AIRSPEED]
                if not np.isfinite(smoothers[i, 1, 0]):
                    start_level(smoothers[i], speed)
                elif np.isfinite(speed):
                    motion = 0.5 * dt * (along + along_now)
                    speed = smoothers[
                        i, 1, advance_level(smoothers[i], speed, motion, dt, form.airspeed_memory_s)
                    ]
                decay = np.exp(-dt / form.reconstruction_s)
                velocity = decay * velocity + 0.5 * dt * (rate + rate_now)
            last, rate, along = row[_TIME], rate_now, along_now
            o = out[m, k]
            o[0] = row[_TIME]
            measured = np.isfinite(velocity_measured)
            if measured:
                seen = 1.0
            o[1] = velocity_measured if measured or seen == 1.0 else velocity
            for j in range(1, ns + 1):
                o[1 + j] = row[form.readings[j]]
            _leave_out_stuck(row, form.readings, dt, state.readings[i], o)
            for j in range(nu):
                o[2 + ns + j] = row[inputs[j]]
                ahead = row[form.commands[j]] - row[inputs[j]]
                o[out.shape[2] - nu + j] = ahead if np.isfinite(ahead) else 0.0
                if form.servo_s[j] > 0.0:
                    o[2 + ns + j] = _surface(row[inputs[j]], dt, form.servo_s[j], servos[i, :, j])
            density = _density(row)
            c = 2 + ns + nu
            o[c] = kinematic
            o[c + 1] = density * speed * speed / form.pressure
            o[c + 2] = speed
            o[c + 3] = density
            o[c + 4] = row[_ALTITUDE]
            o[c + 5] = row[_ALPHA]
            o[c + 6] = 1.0 if measured else 0.0
            if seen == 0.0 and not np.isfinite(row[_ALPHA]):
                o[c + 5] = _level_alpha(row)
        memory[i, 0], memory[i, 1], memory[i, 2] = last, along, velocity
        memory[i, 3], memory[i, 4] = rate, seen


@helper
def _leave_out_stuck(row, channels, dt, readings, out):  # type: ignore[no-untyped-def]
    """Make NaN of what a stuck sensor reads.

    Args:
        channels: of the structure's sensors, (sensors,).
        readings: their histories, (sensors, 3), in place.
        out: a row of signals, whose columns from 1 on hold what they read.
    """
    moving = 0
    for j in range(channels.size):
        if np.isfinite(row[channels[j]]) and row[channels[j]] != readings[j, LAST]:
            moving += 1
    for j in range(channels.size):
        now, history = row[channels[j]], readings[j]
        if not np.isfinite(now):
            continue
        moved = now != history[LAST]
        history[LAST] = now
        if moved or not (0.0 < dt <= MAX_GAP_S):
            history[REST_S] = 0.0
        elif moving:
            history[REST_S] += dt
        if history[REST_S] > STUCK_S:
            history[ROWS] += 1.0
            out[1 + j] = np.nan


@whole
def pass_high(signals, lanes, passed, passing, kinematic, leak_s, out):  # type: ignore[no-untyped-def]
    """See ``Signals.high_passed``; ``passing`` holds the columns that pass the filter."""
    for m in range(lanes.place.size):
        i = lanes.place[m]
        for k in range(lanes.counts[m]):
            row = signals[m, k]
            if row[kinematic + 6] == 1.0 or not np.isfinite(row[: kinematic + 1]).all():
                continue
            dt = row[0] - passed[i, 0, 0]
            fresh = not (0.0 < dt <= MAX_GAP_S)
            decay = np.exp(-dt / leak_s)
            for j in passing:
                passed[i, 1, j] = 0.0 if fresh else decay * passed[i, 1, j] + row[j] - passed[i, 0, j]
                out[m, k, j] = passed[i, 1, j]
            passed[i, 0] = row


@whole
def fill_moments(values, coupling, out):  # type: ignore[no-untyped-def]
    """Into ``out`` (vehicles, samples, rates) the angular accelerations by ``coupling`` (rates, 4) of p q, q r, p r and
    p^2 - r^2."""
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            p, q, r = values[i, k, _P], values[i, k, _Q], values[i, k, _R]
            for j in range(coupling.shape[0]):
                c = coupling[j]
                moment = c[0] * p * q + c[1] * q * r + c[2] * p * r + c[3] * (p * p - r * r)
                out[i, k, j] = moment if np.isfinite(moment) else 0.0


@helper
def _density(row: NDArray[np.float64]) -> float:
    """Air density: measured, or from measured temperature, or the standard atmosphere's (troposphere)."""
    if np.isfinite(row[_DENSITY]):
        return float(row[_DENSITY])
    altitude = min(max(row[_ALTITUDE], -1000.0), 20000.0)
    temperature = 288.15 - 0.0065 * min(altitude, 11000.0)
    pressure = 101325.0 * (temperature / 288.15) ** 5.255876
    if altitude > 11000.0:
        pressure *= np.exp(-GRAVITY_M_S2 * (altitude - 11000.0) / (287.05287 * temperature))
    if np.isfinite(row[_TEMPERATURE]):
        temperature = row[_TEMPERATURE]
    return float(pressure / (287.05287 * temperature))


@helper
def _motion(row, lateral, x_vane, z_vane):  # type: ignore[no-untyped-def]
    """Velocity of the structure at the c.g. (NaN without vane), the kinematic term of its rate, and the rate of the
    inertial speed along the path: equations of ``estimators.signals``.

    An angle that no vane measures is that of level flight without sideslip; an acceleration that is not measured is
    that of steady flight.
    """
    airspeed, alpha, p, q, r = row[_AIRSPEED], row[_ALPHA], row[_P], row[_Q], row[_R]
    w = airspeed * np.sin(alpha) + q * x_vane
    v = airspeed * np.sin(row[_BETA]) - r * x_vane + p * z_vane
    sin_beta = _sine(v, airspeed)
    cos_beta = np.sqrt(1.0 - sin_beta * sin_beta)
    if np.isfinite(alpha):
        sin_alpha = _sine(w, airspeed)
        cos_alpha = np.sqrt(1.0 - sin_alpha * sin_alpha)
    else:
        sin_alpha = np.sin(_level_alpha(row)) if lateral else 0.0
        cos_alpha = 1.0
    cos_pitch = np.cos(row[_PITCH])
    gravity_y, gravity_z = (
        GRAVITY_M_S2 * cos_pitch * np.sin(row[_ROLL]),
        GRAVITY_M_S2 * cos_pitch * np.cos(row[_ROLL]),
    )
    ahead, y = row[_AX] - GRAVITY_M_S2 * np.sin(row[_PITCH]), _known(row[_AY] + gravity_y)
    along = _known(cos_beta * (ahead * cos_alpha + (row[_AZ] + gravity_z) * sin_alpha) + y * sin_beta)
    x, z = _known(ahead), _known(row[_AZ] + gravity_z)
    if lateral:
        beta, in_plane = math.asin(sin_beta), x * cos_alpha + z * sin_alpha
        kinematic = airspeed * (p * sin_alpha - r * cos_alpha) - sin_beta * in_plane + (cos_beta - 1.0) * y
        return airspeed * beta if np.isfinite(v) else v, kinematic + gravity_y + along * beta, along
    turn = q - _known(sin_beta / cos_beta * (p * cos_alpha + r * sin_alpha))
    by_z = sin_alpha * sin_alpha * cos_beta + cos_alpha * cos_alpha / cos_beta - 1.0
    by_x = sin_alpha * cos_alpha * (cos_beta - 1.0 / cos_beta)
    kinematic = airspeed * cos_alpha * turn + gravity_z + by_z * z + by_x * x + sin_alpha * sin_beta * y
    return w, kinematic, along


@helper
def _sine(velocity, airspeed):  # type: ignore[no-untyped-def]
    """Sine of a flow angle, of at most ``MOST_FLOW_ANGLE_RAD``; 0 where the velocity is not measured."""
    sine = velocity / airspeed
    if not np.isfinite(sine):
        return 0.0
    return min(max(sine, -_MOST_SINE), _MOST_SINE)


@helper
def _known(rate):  # type: ignore[no-untyped-def]
    """A rate of motion, or that of steady flight."""
    return rate if np.isfinite(rate) else 0.0


@helper
def _level_alpha(row):  # type: ignore[no-untyped-def]
    """Angle of attack of level flight without sideslip at this attitude; banks beyond 45 degrees count as 45."""
    return np.arctan(np.tan(row[_PITCH]) / max(np.cos(row[_ROLL]), 0.7))


@helper
def _surface(command, dt, servo_s, servo):  # type: ignore[no-untyped-def]
    """Where a servo has its surface: it went on to the command before, x = c + (x0 - c) exp(-dt / servo_s).

    A long step holds several commands, which nobody recorded: they are taken to go evenly from one to the next that is
    known, as a random walk is expected to. After a gap the surface is where it is commanded to be. NaN without a
    command, though the servo goes on.

    Args:
        servo: (2,), last command and the surface, in place.
    """
    if 0.0 < dt <= MAX_GAP_S:
        frames = frames_of(dt)
        change = (command - servo[0]) / frames if np.isfinite(command) else 0.0
        stays = np.exp(-dt / (frames * servo_s))
        for i in range(frames):
            commanded = servo[0] + i * change
            servo[1] = commanded + (servo[1] - commanded) * stays
    else:
        servo[1] = np.nan
    if not np.isfinite(command):
        return np.nan
    servo[0] = command
    if not np.isfinite(servo[1]):
        servo[1] = command
    return servo[1]
