"""Replay: the simulated aircraft flown by the recorded surfaces and throttle, in windows, sample by sample.

What disturbs it (``DISTURBANCES``) moves on straight lines between samples. A surface whose position is measured moves
between samples as its servo does, on a line where the command is not known; one of which only the command is known
moves through the actuator of the aircraft file.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.diagnosis.measured import FORCE_X, OUTPUTS, MeasuredFlight, Window
from wingwatch.kernels.decorators import compiled, helper
from wingwatch.simulation.actuators import move_surfaces, servo_decay
from wingwatch.simulation.dynamics import euler_angles, quaternion
from wingwatch.simulation.flight import report
from wingwatch.simulation.layout import (
    CL_ZERO,
    CM_ZERO,
    CN_ZERO,
    CY_ZERO,
    MASS,
    PARAMETERS,
    ROLL_ZERO,
    THRUST_MAX,
)
from wingwatch.simulation.prepared import WIDTH, prepare
from wingwatch.simulation.rigid_body import (
    DENSITY,
    DENSITY_ALTITUDE,
    ELEVATOR,
    GUST,
    RISE,
    SETTING_WIDTH,
    SPIN,
    THROTTLE,
    advance,
    rates,
)
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS

__all__ = [
    "AIR",
    "BIAS",
    "DELAY",
    "DISTURBANCES",
    "SCALE",
    "START",
    "SURFACE_OUTPUTS",
    "TRIMS",
    "TRIM_STEPS",
    "Inputs",
    "Model",
    "body_state",
    "fly_window",
    "follow",
    "inputs_of",
    "measured_start",
    "motion_of",
    "move",
    "read_sensors",
    "ready",
    "sense",
    "set_attitude",
    "smoothed",
    "still",
    "with_trims",
    "without_delays",
    "work_space",
]

Array = NDArray[np.float64]

START: tuple[str, ...] = ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s", "roll_rad", "pitch_rad")
"""What a window starts from, through still air."""

TRIMS: tuple[str, ...] = ("CL_zero", "CY_zero", "Cl_zero", "Cm_zero", "Cn_zero", "thrust_to_weight")
"""Constants that a window may have of its own: added to the aircraft's coefficients, and thrust where it is not known.

Thrust, not drag: drag turns with the flow, and is a side force in sideslip.
"""

TRIM_STEPS = np.array([1e-3, 1e-3, 1e-4, 1e-4, 1e-4, 1e-4])
"""Of ``TRIMS``, for differences."""
_TRIM_COLUMNS = np.array([CL_ZERO, CY_ZERO, ROLL_ZERO, CM_ZERO, CN_ZERO])
_COLUMNS = np.array([CHANNEL_INDEX[name] for name in OUTPUTS])
SURFACE_OUTPUTS = 11
_PARAMETERS, _CHANNELS, _K = len(PARAMETERS), len(CHANNELS), len(OUTPUTS)

AIR = 9
"""Of what disturbs: motion of the air, body axes, u, v, w, m/s, p, q, r, rad/s; unmodelled angular accelerations in
pitch and yaw, rad/s2, and unmodelled specific force along x, m/s2."""
_PITCH, _YAW, _FORWARD = 6, 7, 8
_SPEED_X, _PITCH_RATE, _YAW_RATE = 3, 11, 12
DISTURBANCES = AIR + 3
"""What disturbs the replay: the air, then the noise of the surfaces' sensors, rad."""

DELAY, BIAS, SCALE = range(3)


@dataclass(frozen=True, slots=True)
class Model:
    """One version of the simulation: aircraft and sensors.

    Attributes:
        row: parameters of the aircraft (``simulation.layout.PARAMETERS``).
        sensors: of each output: delay s, bias in its unit, scale error; (len(OUTPUTS), 3).
    """

    row: Array
    sensors: Array

    def copy(self) -> "Model":
        """One that may be changed."""
        return Model(self.row.copy(), self.sensors.copy())


class Inputs(NamedTuple):
    """What moves the aircraft in one window.

    Attributes:
        flown: measured positions, (samples, 3), NaN where the actuator moves the surface.
        commands: (samples, 3), NaN where unknown.
        throttle: (samples,); over its mean in the window where thrust is the window's own, 1 if it is not recorded.
        density: kg/m3, constant in the window; altitude: m.
        follow: of ``START``, (samples, 8): what is taken from measurement at every sample, NaN where it is simulated.
        dt: s; steps: of integration in a sample.
    """

    flown: Array
    commands: Array
    throttle: Array
    density: float
    altitude: float
    follow: Array
    dt: float
    steps: int


def inputs_of(
    flight: MeasuredFlight, window: Window, steps: int, throttle_known: bool, followed: tuple[int, ...] = ()
) -> Inputs:
    """Recorded surfaces and throttle of a window."""
    rows = slice(window.start, window.stop)
    throttle = flight.throttle[rows] if throttle_known else _throttle_shape(flight.throttle[rows])
    return Inputs(
        flight.flown[rows], flight.commands[rows], np.ascontiguousarray(throttle),
        float(flight.density_kg_m3[rows].mean()), float(flight.altitude_m[rows].mean()),
        _followed(flight, window, followed), flight.dt_s, steps,
    )  # fmt: skip


_IDLE = 0.05


def _throttle_shape(throttle: Array) -> Array:
    """The course of a thrust of mean 1 that follows the throttle, as it does without [propulsion]."""
    mean = float(throttle.mean())
    return throttle / mean if mean > _IDLE else np.ones(len(throttle))


_SLOW_S = 1.0
SMOOTHED = 9
"""Samples of a parabola: short beside the motion; a quarter of the variance of white noise is left."""


def _followed(flight: MeasuredFlight, window: Window, followed: tuple[int, ...]) -> Array:
    """Measured states of a window where they are followed, smoothed without phase; the forward speed over 2 s."""
    rows = flight.outputs[window.start : window.stop]
    out = np.full((len(rows), len(START)), np.nan)
    if not followed:
        return out
    speed, alpha, beta = rows[:, 0], np.nan_to_num(rows[:, 9]), np.nan_to_num(rows[:, 10])
    u, v, w = speed * np.cos(alpha) * np.cos(beta), speed * np.sin(beta), speed * np.sin(alpha) * np.cos(beta)
    measured = np.column_stack(
        [u, v, w, np.nan_to_num(rows[:, 1:4]), np.nan_to_num(rows[:, 7:9])]
    )  # at rest: 0
    for j in followed:
        if j == 0:
            half = round(_SLOW_S / flight.dt_s)
            padded = np.pad(measured[:, j], half, mode="edge")
            out[:, j] = np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
        else:
            out[:, j] = smoothed(measured[:, j])
    return out


def smoothed(column: Array, dt_s: float = 1.0, derivative: int = 0) -> Array:
    """A column, or its time derivative, by a parabola through ``SMOOTHED`` samples; gaps on straight lines."""
    seen, index = np.isfinite(column), np.arange(len(column))
    if not seen.any():
        return column
    whole = np.interp(index, index[seen], column[seen])
    return np.asarray(savgol_filter(whole, SMOOTHED, 2, deriv=derivative, delta=dt_s))


def still(inputs: Inputs) -> Inputs:
    """One sample of inputs, at their mean; surfaces at its end, too."""
    flown, commands = (np.nan_to_num(a.mean(axis=0, keepdims=True)) for a in (inputs.flown, inputs.commands))
    return inputs._replace(
        flown=np.repeat(np.where(np.isfinite(inputs.flown).all(axis=0), flown, commands), 2, axis=0),
        commands=np.full((1, 3), np.nan),
        throttle=inputs.throttle.mean(keepdims=True),
        follow=np.full((1, len(START)), np.nan),
    )


def body_state(start: Array, altitude_m: float) -> Array:
    """Rigid-body state (13,) from ``START``."""
    state = np.zeros(13)
    state[2], state[3:6], state[10:13] = -altitude_m, start[:3], start[3:6]
    state[6:10] = quaternion(float(start[6]), float(start[7]), 0.0)
    return state


@compiled(error_model="numpy", nogil=True)
def motion_of(x, out):  # type: ignore[no-untyped-def]
    """``START`` of a rigid-body state (13,) into ``out`` (8,)."""
    out[:3], out[3:6] = x[3:6], x[10:13]
    roll, pitch, _ = euler_angles(x)
    out[6], out[7] = roll, pitch


class Work(NamedTuple):
    """Where a replay keeps what it needs from sample to sample.

    Attributes:
        setting: of the step (``rigid_body.SETTING``); orders: (8,); channels: (1, 1, channels).
        k, middle, total: of the integration, (13,).
        decay, servo, surface, servo_at_sample: of each surface, (3,); moved: by the servos in a sample, (steps, 9).
    """

    setting: Array
    orders: Array
    channels: Array
    k: Array
    middle: Array
    total: Array
    decay: Array
    servo: Array
    surface: Array
    servo_at_sample: Array
    moved: Array


@compiled(error_model="numpy", nogil=True)
def work_space(steps):  # type: ignore[no-untyped-def]
    """``Work`` for as many steps of integration in a sample."""
    return Work(
        np.zeros(SETTING_WIDTH), np.zeros(8), np.zeros((1, 1, _CHANNELS)), np.empty(13), np.empty(13), np.empty(13),
        np.empty(3), np.zeros(3), np.zeros(3), np.zeros(3), np.empty((steps, 9)),
    )  # fmt: skip


@compiled(error_model="numpy", nogil=True)
def with_trims(row, trims):  # type: ignore[no-untyped-def]
    """A prepared working row of parameters (parameters,) and a window's trims (6,)."""
    c = np.zeros(WIDTH)
    c[:_PARAMETERS] = row
    for j in range(_TRIM_COLUMNS.size):
        c[_TRIM_COLUMNS[j]] += trims[j]
    c[THRUST_MAX] += trims[5] * c[MASS] * GRAVITY_M_S2
    prepare(c)
    return c


@compiled(error_model="numpy", nogil=True)
def ready(c, inputs, work):  # type: ignore[no-untyped-def]
    """Work space before the first sample of a window."""
    servo_decay(c, 0.5 * inputs.dt / inputs.steps, work.decay)
    for j in range(3):
        known = inputs.flown[0, j] == inputs.flown[0, j]
        work.servo[j] = inputs.flown[0, j] if known else inputs.commands[0, j]
        work.surface[j] = work.servo[j]
    work.setting[DENSITY_ALTITUDE], work.setting[DENSITY] = inputs.altitude, inputs.density


@compiled(error_model="numpy", nogil=True)
def read_sensors(c, x, inputs, t, work, here, out):  # type: ignore[no-untyped-def]
    """True values of the outputs (outputs,) at sample ``t``, where ``here`` (12,) disturbs; servos advance."""
    s, half_step_s = work.setting, 0.5 * inputs.dt / inputs.steps
    s[THROTTLE] = inputs.throttle[t]
    for j in range(3):
        commanded = inputs.commands[t, j] == inputs.commands[t, j]
        work.orders[j] = inputs.commands[t, j] if commanded else inputs.flown[t, j]
    for sub in range(inputs.steps):
        move_surfaces(c, s, work.servo, work.surface, work.orders, work.decay, half_step_s)
        work.moved[sub] = s[ELEVATOR : ELEVATOR + 9]
    for j in range(3):
        work.servo_at_sample[j] = work.moved[0, j]
        known = inputs.flown[t, j] == inputs.flown[t, j]
        s[ELEVATOR + j] = inputs.flown[t, j] + here[AIR + j] if known else work.moved[0, j]
    for j in range(6):
        s[GUST + j], s[RISE + j] = here[j], 0.0
    rates(c, s, x, 0, 0.0, work.k)
    s[SPIN + 1] += here[_PITCH]
    s[SPIN + 2] += here[_YAW]
    report(work.channels, 0, 0, 0.0, x, c, s, work.orders)
    for j in range(_K):
        out[j] = work.channels[0, 0, _COLUMNS[j]]
    out[FORCE_X] += here[_FORWARD]
    for j in range(3):
        out[SURFACE_OUTPUTS + j] = work.servo_at_sample[j]


@compiled(error_model="numpy", nogil=True)
def move(c, x, inputs, t, work, here, there):  # type: ignore[no-untyped-def]
    """The state (13,) from sample ``t``, where ``here`` disturbs, to the next, where ``there`` does, (12,) each."""
    s, dt = work.setting, inputs.dt / inputs.steps
    after = min(t + 1, inputs.flown.shape[0] - 1)
    follow(x, inputs.follow[t], inputs.follow[min(after, inputs.follow.shape[0] - 1)])
    for j in range(6):
        s[GUST + j], s[RISE + j] = here[j], (there[j] - here[j]) / inputs.steps
    for sub in range(inputs.steps):
        s[ELEVATOR : ELEVATOR + 9] = work.moved[sub]
        for j in range(3):
            if inputs.flown[t, j] == inputs.flown[t, j]:
                # the measured position at both samples, and between them the servo's way from one to the other
                start, end = inputs.flown[t, j] + here[AIR + j], inputs.flown[after, j] + there[AIR + j]
                slope = end - start - (work.surface[j] - work.servo_at_sample[j])
                off = start - work.servo_at_sample[j]
                for stage in range(3):
                    along = (sub + 0.5 * stage) / inputs.steps
                    s[ELEVATOR + 3 * stage + j] = work.moved[sub, 3 * stage + j] + off + along * slope
        advance(c, s, x, dt, work.k, work.middle, work.total)
        along = (sub + 0.5) / inputs.steps
        x[_PITCH_RATE] += dt * ((1.0 - along) * here[_PITCH] + along * there[_PITCH])
        x[_YAW_RATE] += dt * ((1.0 - along) * here[_YAW] + along * there[_YAW])
        x[_SPEED_X] += dt * ((1.0 - along) * here[_FORWARD] + along * there[_FORWARD])
        for j in range(6):
            s[GUST + j] += s[RISE + j]


@compiled(error_model="numpy", nogil=True)
def fly_window(rows, starts, trims, inputs, force_x, out):  # type: ignore[no-untyped-def]
    """Fly a window open loop through still air in several versions.

    Args:
        rows: parameters, (versions, parameters).
        starts: rigid-body states, (versions, 13).
        trims: added to the coefficients of ``TRIMS``, (versions, 6).
        inputs: ``Inputs``.
        force_x: specific force along x that moves the aircraft, (samples,), m/s2; NaN where it is simulated.
        out: true values of the outputs, (versions, samples, outputs), filled.
    """
    work, calm = work_space(inputs.steps), np.zeros(DISTURBANCES)
    here, there = np.zeros(DISTURBANCES), np.zeros(DISTURBANCES)
    for version in range(rows.shape[0]):
        c, x = with_trims(rows[version], trims[version]), starts[version].copy()
        ready(c, inputs, work)
        for t in range(out.shape[1]):
            follow(x, inputs.follow[t], inputs.follow[t])
            read_sensors(c, x, inputs, t, work, calm, out[version, t])
            simulated, after = out[version, t, FORCE_X], min(t + 1, force_x.size - 1)
            here[_FORWARD] = there[_FORWARD] = 0.0
            if force_x[t] == force_x[t] and force_x[after] == force_x[after]:
                here[_FORWARD], there[_FORWARD] = force_x[t] - simulated, force_x[after] - simulated
                out[version, t, FORCE_X] = force_x[t]
            move(c, x, inputs, t, work, here, there)


@helper
def follow(x, here, there):  # type: ignore[no-untyped-def]
    """Put states that are followed midway between two measurements (8,): over a sample a state is what it is then."""
    for j in range(3):
        if here[j] == here[j]:
            x[3 + j] = 0.5 * (here[j] + there[j])
        if here[3 + j] == here[3 + j]:
            x[10 + j] = 0.5 * (here[3 + j] + there[3 + j])
    if here[6] == here[6] or here[7] == here[7]:
        roll, pitch, heading = euler_angles(x)
        roll = 0.5 * (here[6] + there[6]) if here[6] == here[6] else roll
        pitch = 0.5 * (here[7] + there[7]) if here[7] == here[7] else pitch
        set_attitude(x, roll, pitch, heading)


@helper
def set_attitude(x, roll, pitch, heading):  # type: ignore[no-untyped-def]
    """Attitude of a rigid-body state (13,) from its Euler angles."""
    cr, sr, cp, sp = math.cos(0.5 * roll), math.sin(0.5 * roll), math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    ch, sh = math.cos(0.5 * heading), math.sin(0.5 * heading)
    x[6], x[7] = cr * cp * ch + sr * sp * sh, sr * cp * ch - cr * sp * sh
    x[8], x[9] = cr * sp * ch + sr * cp * sh, cr * cp * sh - sr * sp * ch


def sense(true: Array, model: Model) -> Array:
    """What sensors with the model's scale errors and biases read of true outputs (..., samples, outputs)."""
    return np.asarray((1.0 + model.sensors[:, SCALE]) * true + model.sensors[:, BIAS])


def without_delays(flight: MeasuredFlight, model: Model) -> Array:
    """Measured outputs (samples, outputs) at the times that they are of, by the model's delays.

    A shift of the whole flight's Fourier transform: noise keeps its variance, so no delay is preferred because it
    smooths.
    """
    outputs = flight.outputs
    late = np.flatnonzero(model.sensors[:, DELAY])
    if late.size:
        outputs = outputs.copy()
        for k in late:
            outputs[:, k] = _earlier(outputs[:, k], model.sensors[k, DELAY] / flight.dt_s)
    return outputs


def _earlier(column: Array, samples: float) -> Array:
    """A column so many samples earlier; NaN where a value lies beside one."""
    seen = np.isfinite(column)
    if not seen.any():
        return column
    index = np.arange(column.size)
    whole = np.interp(index, index[seen], column[seen])
    line = whole[0] + (whole[-1] - whole[0]) * index / max(column.size - 1, 1)
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(column.size) * samples)
    moved = np.fft.irfft(np.fft.rfft(whole - line) * turn, column.size)
    moved += whole[0] + (whole[-1] - whole[0]) * (index + samples) / max(column.size - 1, 1)
    at = index + samples
    beside = seen[np.clip(np.floor(at).astype(int), 0, column.size - 1)]
    beside &= seen[np.clip(np.ceil(at).astype(int), 0, column.size - 1)]
    return np.where(beside, moved, np.nan)


def measured_start(flight: MeasuredFlight, window: Window, row: Array) -> Array:
    """``START`` from the first samples of a window; where no vane is, by the lift that the accelerometer shows."""
    rows = slice(window.start, window.start + 5)
    with np.errstate(all="ignore"):
        speed, p, q, r, _, _, force_z, roll, pitch, alpha, beta = _first(flight.outputs[rows, :11])
    if not math.isfinite(alpha):
        alpha = _alpha_of_lift(row, force_z, float(flight.density_kg_m3[window.start]), float(speed))
    if not math.isfinite(beta):
        beta = 0.0
    p, q, r, roll, pitch = np.nan_to_num([p, q, r, roll, pitch])  # at rest
    u, v, w = speed * math.cos(alpha) * math.cos(beta), speed * math.sin(beta), speed * math.sin(alpha)
    return np.array([u, v, w * math.cos(beta), p, q, r, roll, pitch])


def _first(rows: Array) -> Array:
    """Values at the first of a few rows, by a straight line; NaN where a channel has none."""
    out = np.full(rows.shape[1], np.nan)
    for j in range(rows.shape[1]):
        good = np.flatnonzero(np.isfinite(rows[:, j]))
        if good.size >= 2:
            out[j] = np.polyval(np.polyfit(good, rows[good, j], 1), 0.0)
        elif good.size:
            out[j] = rows[good[0], j]
    return out


def _alpha_of_lift(row: Array, force_z: float, density: float, speed: float) -> float:
    if not math.isfinite(force_z):
        return 0.0
    index = {name: i for i, name in enumerate(PARAMETERS)}
    lift = -force_z * row[index["mass_kg"]] / (0.5 * density * speed**2 * row[index["area_m2"]])
    return float(np.clip((lift - row[index["CL_zero"]]) / row[index["CL_alpha"]], -0.3, 0.3))
