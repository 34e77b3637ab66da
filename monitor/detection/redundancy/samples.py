"""Samples into innovations of every relation, and into the sums that a segment's evidence is made of; compiled.

With d, psi and tau of ``layout``, and P, K those of the scalar Kalman filter of x, whose prediction errors are e,

    x <- x e^(-dt/tau) + dt rate + K e,     E = X + d,     X <- X e^(-dt/tau) + dt psi - K E                      (2)

psi is that of two samples ago: one with the noise that e has, too, would explain it. E delta is what faults of size
delta make of e, where they have been there since the filter's start. A change that begins at the start of a segment has
E - f X(start) in the place of E, f the product of e^(-dt/tau) (1 - K) since. So sums over (E, f) with weights 1/S serve
every start (``evidence.py``). The drift of x follows the correlation of the innovations; S is P and the noise's
variance.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import hot, lean
from wingwatch.monitor.detection.redundancy.airframe import ATTACHED_RAD, COARSE, forces_and_moments
from wingwatch.monitor.detection.redundancy.layout import (
    AIRSPEED,
    ALPHA,
    AXIAL,
    BETA,
    COLUMNS,
    EAST,
    HEADING,
    NORTH,
    PITCH,
    PITCHING,
    RELATIONS,
    ROLL,
    ROLLING,
    ROUGH,
    ROWS,
)
from wingwatch.telemetry import CHANNEL_INDEX, MAX_GAP_S

__all__ = [
    "CHANGES",
    "DRIFT",
    "END_S",
    "GOING",
    "LEFT",
    "LOG_S",
    "MOST_REPEATS",
    "PRODUCTS",
    "REPEATS",
    "SAMPLES",
    "SEGMENT_S",
    "SHORT_S",
    "SQUARE",
    "START_S",
    "Memory",
    "Model",
    "Segment",
    "new_memory",
    "new_segment",
    "new_work",
    "take_samples",
    "thrust_n",
]

Array = NDArray[np.float64]

SEGMENT_S = 1.0
HELD_S = 0.35
"""A reading that repeats for less is one of a slower sensor; one that repeats for longer counts as a reading."""

SMOOTHED_S, TURNED_S = 2.0, 0.3
LATER_S = 0.05
HOLE, USUAL_SAMPLES = 3.0, 20.0
"""Over more than so many usual times between samples nobody knows the motion: the mean of both ends is no mean of the
rates between them, and a doublet in the hole would be a contradiction. The usual time is a mean over so many."""
MANOEUVRE = 5.0
"""Standard deviations of noise from which a rate or an acceleration shows a scale, a delay or a reading that does not
follow: a column of noise that e has, too, would explain it."""
FORCED_S, SHORT_S = 0.5, 0.3
"""An innovation beyond its limit begins a segment, ``FORCED_S`` after the last at the earliest; that one is short."""

STEEP_RAD = math.radians(60.0)
(
    _X, _VARIANCE, _RATE, GOING, _LAST, DRIFT, _READING, _SINCE_S, REPEATS, MOST_REPEATS, CHANGES,
) = range(11)  # fmt: skip
"""Numbers of ``Memory.scalar``."""
SAMPLES, SQUARE, PRODUCTS, LEFT, LOG_S = range(5)
"""Numbers of ``Segment.scalar``."""
(
    _STAMP_S, END_S, _ROLL_RATE, _PITCH_RATE, _YAW_RATE, _AIRSPEED_SMOOTH, _THROTTLE_SMOOTH,
    START_S, _FORCED_AT_S, _NORTHWARD, _EASTWARD, _USUAL_S,
) = range(12)  # fmt: skip
"""Numbers of ``Memory.clock``."""
_N, _ROWS = len(RELATIONS), len(ROWS)
_OF_ROW, _ROUGH = np.array(ROWS), ROUGH
_SURFACES = tuple(CHANNEL_INDEX[f"{s}_rad"] for s in ("elevator", "aileron", "rudder"))
_COMMANDS = tuple(CHANNEL_INDEX[f"{s}_command_rad"] for s in ("elevator", "aileron", "rudder"))
_T, _V = CHANNEL_INDEX["time_s"], CHANNEL_INDEX["airspeed_true_m_s"]
_P, _Q, _R = (CHANNEL_INDEX[f"{a}_rate_rad_s"] for a in ("roll", "pitch", "yaw"))
_FX, _FY, _FZ = (CHANNEL_INDEX[f"specific_force_{a}_m_s2"] for a in "xyz")
_PHI, _THETA, _PSI = (CHANNEL_INDEX[f"{a}_rad"] for a in ("roll", "pitch", "heading"))
_A, _B = CHANNEL_INDEX["angle_of_attack_rad"], CHANNEL_INDEX["sideslip_rad"]
_THROTTLE, _RHO = CHANNEL_INDEX["throttle"], CHANNEL_INDEX["air_density_kg_m3"]
_VN = CHANNEL_INDEX["velocity_north_m_s"]
_VE = CHANNEL_INDEX["velocity_east_m_s"]
_OWN = np.array([*_SURFACES, _PHI, _THETA, _PSI, _V, _A, _B, _FX, _VN, _VE, _FZ, _FY, _P, _Q, _R])
"""Channel of each relation whose reading is z."""
_MAY_REPEAT = np.arange(_N) >= 3
_TURN = 2.0 * math.pi
_FLOW = 19
"""Numbers of ``_flow_of``."""


class Model(NamedTuple):
    """What does not change in a flight.

    ``airframe``: mass kg, wing area m2, C_N at alpha = 0, C_N per rad, zero-lift, linear and square part of the axial
    coefficient by C_N, vane x and z, IMU x, y, z in m, whether there are vanes of alpha and of beta.
    ``propulsion``: of ``thrust_n``.
    ``dimensions``: span m, chord m, Jx, Jy, Jz, Jxz in kg m2; ``coefficients``: by relation from ``LIFT`` on (5,
    COLUMNS), normal force, side force and moments by an offset, incidence, rates (pitch; roll, yaw) and surfaces
    (elevator; aileron, rudder); ``units``: what a parameter of size 1 changes them by; ``damping``: of roll, pitch and
    yaw by their own rate over the coefficient's unit, in s (3,); ``commanded``: surfaces known by their command alone.
    """

    active: NDArray[np.bool_]
    noise_variance: Array
    gyro_variance: Array
    """(3,)."""
    accelerometer_variance: float
    leak_s: Array
    servo: Array
    """(3, 3): bandwidth rad/s, rate limit rad/s, position limit rad."""
    airframe: Array
    propulsion: Array
    dimensions: Array
    coefficients: Array
    units: Array
    damping: Array
    commanded: NDArray[np.bool_]


class Memory(NamedTuple):
    """What passes from one sample to the next.

    ``scalar``: x, P, last rate, whether the filter goes on, last e/sqrt(S), drift, last reading, since when it repeats,
    how often it has, how often one did at most before, and how often it has changed (rows, 11);
    ``effect``: X; ``effect_rate``: the last two psi;
    ``servo``: modelled position, last command, and the position ``LATER_S`` later (3, 3);
    ``clock``: last stamp, end of the segment, last three gyro readings, airspeed and throttle smoothed over
    ``SMOOTHED_S``, start of the segment, when a large innovation last began one, direction of flight north and east
    smoothed over ``TURNED_S``, usual time between samples;
    ``moment``: of each moment's equation the rate, its derivative by the file and the columns as of the last sample (3,
    2 + COLUMNS); ``late_flow``: incidence and sideslip of the last two samples, and their mean (2, 3).
    """

    scalar: Array
    effect: Array
    effect_rate: Array
    servo: Array
    clock: Array
    moment: Array
    late_flow: Array


class Segment(NamedTuple):
    """Sums over a segment.

    ``information``: of (E, f), (relations, COLUMNS + 1, COLUMNS + 1); ``vector``: of (E, f) times e; ``start``: X at
    the start; ``scalar``: samples, sum of e2/S, sum of products with the one before, f at the end, sum of ln S (rows,
    5). All by row (``layout.ROWS``).
    """

    information: Array
    vector: Array
    start: Array
    scalar: Array

    def forget(self, row: int) -> None:
        """It says nothing of a row so far."""
        self.information[row], self.vector[row], self.scalar[row] = 0.0, 0.0, 0.0


class _Signals(NamedTuple):
    """z and rate, variance of z beside its noise (relations,), psi and d (relations, COLUMNS) of one sample; regressors
    of coefficients (COLUMNS,)."""

    z: Array
    rate: Array
    more: Array
    psi: Array
    d: Array
    lon: Array
    lat: Array
    lon_d: Array
    lat_d: Array


def new_memory(drift: Array) -> Memory:
    """Before the first sample; ``drift`` (rows,) as stated by the model, in units of each relation."""
    scalar = np.zeros((_ROWS, CHANGES + 1))
    scalar[:, DRIFT] = drift
    scalar[:, _READING] = np.nan
    clock = np.full(_USUAL_S + 1, np.nan)
    return Memory(
        scalar, np.zeros((_ROWS, COLUMNS)), np.zeros((2, _ROWS, COLUMNS)), np.full((3, 3), np.nan), clock,
        np.zeros((3, 2 + COLUMNS)), np.full((2, 3), np.nan),
    )  # fmt: skip


def new_work() -> tuple[Any, ...]:
    """Memory that ``take_samples`` works in, one call at a time. Nothing in it passes from one call to the next: what a
    relation has not stays zero."""
    signals = _Signals(
        np.empty(_N), np.zeros(_N), np.zeros(_N), np.zeros((_N, COLUMNS)), np.zeros((_N, COLUMNS)),
        np.zeros(COLUMNS), np.zeros(COLUMNS), np.zeros(COLUMNS), np.zeros(COLUMNS),
    )  # fmt: skip
    memory = new_memory(np.zeros(_ROWS))
    before = memory.clock, memory.servo, memory.moment, memory.late_flow
    return signals, (np.zeros(_FLOW), np.zeros(3), *before[:2]), before[2:]


def new_segment() -> Segment:
    """Empty sums."""
    segment = Segment(
        np.zeros((_ROWS, COLUMNS + 1, COLUMNS + 1)),
        np.zeros((_ROWS, COLUMNS + 1)),
        np.zeros((_ROWS, COLUMNS)),
        np.zeros((_ROWS, 5)),
    )
    segment.scalar[:, LEFT] = 1.0
    return segment


@lean
def thrust_n(c, throttle, airspeed, density):  # type: ignore[no-untyped-def]
    """Thrust in N; a test compares it with ``aircraft.propulsion_thrust_n``.

    ``throttle`` 0 to 1, ``airspeed`` m/s, ``density`` kg/m3: scalars.
    ``c`` (14,): 1 for an electric propeller, else 0; largest thrust N; diameter m; three thrust and three torque
    coefficients; motor constant, torque constant, resistance, no-load current, largest voltage.
    """
    if c[0] == 0.0:
        return throttle * c[1]
    d, v = c[2], airspeed
    per_volt = c[10] / c[11]
    square = density * d**5 * c[6] / _TURN**2
    linear = density * d**4 * c[7] * v / _TURN + per_volt * c[9]
    rest = density * d**3 * c[8] * v * v - per_volt * c[13] * throttle + c[10] * c[12]
    inside = linear * linear - 4.0 * square * rest
    omega = max(0.0, (math.sqrt(inside) - linear) / (2.0 * square)) if inside > 0.0 else 0.0
    turns = omega / _TURN
    return density * d * d * (d * d * c[3] * turns * turns + d * c[4] * v * turns + c[5] * v * v)


@lean
def _surfaces(row, dt, model, memory, to):  # type: ignore[no-untyped-def]
    """Position against what the servo makes of the command that was held since the last sample."""
    for j in range(3):
        position, command = row[_SURFACES[j]], row[_COMMANDS[j]]
        modelled, target, late = memory.servo[0, j], memory.servo[1, j], memory.servo[2, j]
        if math.isnan(modelled) or math.isnan(target) or dt == 0.0:
            modelled = late = position
        else:
            bandwidth, limit = model.servo[j, 0], model.servo[j, 1]
            error = min(model.servo[j, 2], max(-model.servo[j, 2], target)) - modelled
            step = error * (1.0 - math.exp(-bandwidth * dt))
            modelled += min(limit * dt, max(-limit * dt, step))
            late += (1.0 - math.exp(-dt / LATER_S)) * (modelled - late)
        memory.servo[0, j], memory.servo[1, j], memory.servo[2, j] = modelled, command, late
        to.z[j] = position - modelled
        to.d[j, 0], to.d[j, 1], to.d[j, 2] = 1.0, -modelled, (late - modelled) / LATER_S


@lean
def _attitudes(row, dt, gyro_rate, model, memory, to):  # type: ignore[no-untyped-def]
    """Euler angles against what the rates make of them."""
    psi, rate = to.psi, to.rate
    p, q, r = row[_P], row[_Q], row[_R]
    sin, cos = math.sin(row[_PHI]), math.cos(row[_PHI])
    tan, secant = math.tan(row[_THETA]), 1.0 / max(0.05, math.cos(row[_THETA]))
    to.z[ROLL], to.z[PITCH], to.z[HEADING] = row[_PHI], row[_THETA], row[_PSI]
    rate[ROLL] = p + tan * (q * sin + r * cos)
    rate[PITCH] = q * cos - r * sin
    rate[HEADING] = (q * sin + r * cos) * secant
    psi[ROLL, 0], psi[ROLL, 1], psi[ROLL, 2] = -1.0, -p, gyro_rate[0]
    psi[PITCH, 0], psi[PITCH, 1], psi[PITCH, 2] = -cos, -q * cos, gyro_rate[1] * cos
    psi[PITCH, 4] = sin
    psi[HEADING, 0], psi[HEADING, 1] = -cos * secant, -r * cos * secant
    psi[HEADING, 2], psi[HEADING, 4] = gyro_rate[2] * cos * secant, -sin * secant
    psi[ROLL, 4], psi[PITCH, 5], psi[HEADING, 5] = (
        -r,
        -r * cos,
        -q * cos * secant,
    )  # of p and q by r, of r by q
    # Euler's equations say little of bank and heading there: their filters begin anew afterwards
    if abs(row[_THETA]) > STEEP_RAD:
        to.rate[ROLL] = to.rate[HEADING] = math.nan
    for relation in (ROLL, PITCH, HEADING):
        to.d[relation, 3] = 1.0
        noise = model.gyro_variance[relation - ROLL]
        if dt > 0.0:
            noise = max(noise, memory.scalar[relation, DRIFT] * model.noise_variance[relation] / dt)
        if row[_P + relation - ROLL] ** 2 < MANOEUVRE**2 * noise:
            psi[relation, 1] = psi[relation, 2] = 0.0


@lean
def _flow_of(row, model, flow):  # type: ignore[no-untyped-def]
    """Incidence, attitude, acceleration and specific force at the centre of gravity into ``flow``, in its order."""
    c = model.airframe
    p, q, r, v = row[_P], row[_Q], row[_R], max(row[_V], 1.0)
    fx = row[_FX] + (q * q + r * r) * c[9] - p * q * c[10] - p * r * c[11]
    fy = row[_FY] + (p * p + r * r) * c[10] - p * q * c[9] - q * r * c[11]
    fz = row[_FZ] + (p * p + q * q) * c[11] - p * r * c[9] - q * r * c[10]
    per_kg = 0.5 * row[_RHO] * v * v * c[1] / c[0]
    alpha, beta = (-fz / per_kg - c[2]) / c[3], 0.0
    if c[12] > 0.0:
        alpha = row[_A] + (q * c[7]) / v
    if c[13] > 0.0:
        beta = row[_B] - (r * c[7] - p * c[8]) / v
    sin_t, cos_t = math.sin(row[_THETA]), math.cos(row[_THETA])
    sin_p, cos_p = math.sin(row[_PHI]), math.cos(row[_PHI])
    flow[0], flow[1], flow[2], flow[3] = (
        math.sin(alpha),
        math.cos(alpha),
        math.sin(beta),
        max(0.1, math.cos(beta)),
    )
    flow[4], flow[5], flow[6], flow[7] = sin_t, cos_t, sin_p, cos_p
    flow[8] = fx - GRAVITY_M_S2 * sin_t
    flow[9] = fy + GRAVITY_M_S2 * sin_p * cos_t
    flow[10] = fz + GRAVITY_M_S2 * cos_p * cos_t
    flow[11], flow[12], flow[13], flow[14], flow[15] = fx, fz, per_kg, alpha, beta
    flow[18] = fy


@lean
def _air(sample, dt, model, memory, flow, to):  # type: ignore[no-untyped-def]
    """Airspeed, angle of attack and sideslip against forces and rates.

    What a fault makes of a reading goes by a smoothed reading, good to a percent: a column with the reading's own noise
    would explain that noise.
    """
    rate, psi, d, filtered = to.rate, to.psi, to.d, memory.scalar
    p, q, r, v = sample[_P], sample[_Q], sample[_R], max(sample[_V], 1.0)
    sin_a, cos_a, sin_b, cos_b, sin_t, cos_t, _, cos_p, ax, ay, az = flow[:11]
    ahead, across = ax * cos_a + az * sin_a, az * cos_a - ax * sin_a

    to.z[AIRSPEED] = sample[_V]
    rate[AIRSPEED] = ahead * cos_b + ay * sin_b
    d[AIRSPEED, 0], psi[AIRSPEED, 1] = memory.clock[_AIRSPEED_SMOOTH], 0.0
    if rate[AIRSPEED] ** 2 > MANOEUVRE**2 * model.accelerometer_variance:
        psi[AIRSPEED, 1] = -rate[AIRSPEED]
    psi[AIRSPEED, 2] = -cos_a * cos_b
    psi[AIRSPEED, 3] = GRAVITY_M_S2 * (cos_t * cos_a + cos_p * sin_t * sin_a) * cos_b
    psi[AIRSPEED, 4] = -across * cos_b

    to.z[ALPHA] = flow[14]
    rate[ALPHA] = q - (p * cos_a + r * sin_a) * sin_b / cos_b + across / (v * cos_b)
    d[ALPHA, 0], d[ALPHA, 2] = 1.0, -filtered[ALPHA, _RATE]
    d[ALPHA, 1] = filtered[ALPHA, _X] if filtered[ALPHA, GOING] > 0.0 else flow[14]
    psi[ALPHA, 3], psi[ALPHA, 4], psi[ALPHA, 5] = -cos_a / (v * cos_b), -1.0, across / (v * cos_b)

    to.z[BETA] = flow[15]
    rate[BETA] = p * sin_a - r * cos_a + (ay * cos_b - ahead * sin_b) / v
    d[BETA, 0], d[BETA, 2] = 1.0, -filtered[BETA, _RATE]
    d[BETA, 1] = filtered[BETA, _X] if filtered[BETA, GOING] > 0.0 else flow[15]
    psi[BETA, 3], psi[BETA, 4] = -cos_b / v, cos_a
    psi[BETA, 5] = -GRAVITY_M_S2 * cos_p * cos_t * cos_b / v

    flow[16], flow[17] = flow[14], math.nan
    if model.airframe[13] > 0.0:
        flow[17] = flow[15]
    for relation in (ALPHA, BETA):
        row = _ROUGH[relation]  # of the filter that follows a vane within two samples
        if model.active[relation] and filtered[row, GOING] > 0.0:
            estimate = filtered[row, _X] + 0.5 * dt * (rate[relation] + filtered[row, _RATE])
            noise = model.noise_variance[relation]
            variance = filtered[row, _VARIANCE] + filtered[row, DRIFT] * noise * dt
            innovation = to.z[relation] - estimate
            if not math.isnan(innovation):
                estimate += variance / (variance + noise) * innovation
            flow[16 + relation - ALPHA] = estimate


@lean
def _axial(row, model, memory, flow, to):  # type: ignore[no-untyped-def]
    """Specific force along x less thrust, and the drag that goes with the normal force."""
    c, density, v, smooth = model.airframe, row[_RHO], max(row[_V], 1.0), memory.clock[_AIRSPEED_SMOOTH]
    fx, fz, per_kg = flow[11], flow[12], flow[13]
    normal = -fz / per_kg
    push = thrust_n(model.propulsion, min(1.0, max(0.0, row[_THROTTLE])), v, density) / c[0]
    drag, induced = per_kg * c[4], per_kg * c[6] * normal * normal
    to.z[AXIAL] = fx - (push - drag - per_kg * c[5] * normal - induced)
    # beyond straight lift no polynomial of the normal force describes it
    if not ATTACHED_RAD[0] <= flow[16] <= ATTACHED_RAD[1]:
        to.z[AXIAL] = math.nan
    ratio, throttle = (smooth / v) ** 2, memory.clock[_THROTTLE_SMOOTH]
    drag, induced = drag * ratio, induced / ratio
    push = thrust_n(model.propulsion, throttle, smooth, density) / c[0]
    faster = thrust_n(model.propulsion, throttle, 1.01 * smooth, density) / c[0]
    d = to.d[AXIAL]
    d[0], d[1], d[2], d[3], d[4] = -push, -drag, fz, -induced, 1.0
    d[5] = -((faster - push) / 0.01 - 2.0 * drag + 2.0 * induced)


@lean
def _ground(row, dt, memory, flow, to):  # type: ignore[no-untyped-def]
    """Wind: velocity over the ground less that through the air."""
    sin_a, cos_a, sin_b, cos_b, sin_t, cos_t, sin_p, cos_p = flow[:8]
    ahead, side, down = cos_a * cos_b, sin_b, sin_a * cos_b
    sin_h, cos_h = math.sin(row[_PSI]), math.cos(row[_PSI])
    level = ahead * cos_t + (side * sin_p + down * cos_p) * sin_t
    aside = side * cos_p - down * sin_p
    north, east = level * cos_h - aside * sin_h, level * sin_h + aside * cos_h
    to.z[NORTH], to.z[EAST] = row[_VN] - row[_V] * north, row[_VE] - row[_V] * east
    for k, part in ((_NORTHWARD, north), (_EASTWARD, east)):
        before = memory.clock[k]
        starts = math.isnan(before) or dt == 0.0
        memory.clock[k] = part if starts else before + min(1.0, dt / TURNED_S) * (part - before)
    north, east = (
        memory.clock[_AIRSPEED_SMOOTH] * memory.clock[_NORTHWARD],
        memory.clock[_AIRSPEED_SMOOTH] * memory.clock[_EASTWARD],
    )
    to.d[NORTH, 0], to.d[NORTH, 1], to.d[NORTH, 2] = -north, east, 1.0
    to.d[EAST, 0], to.d[EAST, 1], to.d[EAST, 2] = -east, -north, 1.0


@lean
def _filter(i, relation, dt, to, model, memory, segment):  # type: ignore[no-untyped-def]
    """One row takes one sample of its relation: (2), and the sums."""
    scalar, effect = memory.scalar, memory.effect
    z, rate, psi, d = to.z[relation], to.rate[relation], to.psi[relation], to.d[relation]
    variance, tau = model.noise_variance[relation], model.leak_s[relation]
    leaky = not math.isinf(tau)
    if math.isnan(rate):
        scalar[i, GOING] = 0.0
        return
    if dt == 0.0:
        scalar[i, GOING] = 0.0
    if scalar[i, GOING] == 0.0:
        copy_into(psi, memory.effect_rate[0, i])
        copy_into(psi, memory.effect_rate[1, i])
    if scalar[i, GOING] > 0.0:
        decay = math.exp(-dt / tau) if leaky else 1.0
        scalar[i, _X] = scalar[i, _X] * decay + 0.5 * dt * (rate + scalar[i, _RATE])
        scalar[i, _VARIANCE] = scalar[i, _VARIANCE] * decay * decay + scalar[i, DRIFT] * variance * dt
        for j in range(COLUMNS):
            effect[i, j] = effect[i, j] * decay + dt * memory.effect_rate[1, i, j]
        segment.scalar[i, LEFT] *= decay
    for j in range(COLUMNS):
        memory.effect_rate[1, i, j], memory.effect_rate[0, i, j] = memory.effect_rate[0, i, j], psi[j]
    scalar[i, _RATE] = rate
    if math.isnan(z):
        return
    if scalar[i, GOING] == 0.0:
        scalar[i, GOING], scalar[i, _LAST] = 1.0, 0.0
        scalar[i, _X] = 0.0 if leaky else z
        scalar[i, _VARIANCE] = 0.5 * scalar[i, DRIFT] * variance * tau if leaky else variance
        segment.scalar[i, LEFT] = 0.0
        for j in range(COLUMNS):
            effect[i, j] = 0.0 if leaky else -d[j]
        if not leaky:
            return
    e = z - scalar[i, _X]
    if relation in (ROLL, HEADING):
        e -= _TURN * math.floor(e / _TURN + 0.5)
    total = scalar[i, _VARIANCE] + variance + to.more[relation]
    gain, weight = scalar[i, _VARIANCE] / total, 1.0 / total
    scalar[i, _X] += gain * e
    scalar[i, _VARIANCE] *= 1.0 - gain
    f = segment.scalar[i, LEFT]
    columns = effect[i]
    for j in range(COLUMNS):
        seen = columns[j] + d[j]
        for k in range(j):
            segment.information[i, j, k] += weight * seen * (columns[k] + d[k])
        segment.information[i, j, j] += weight * seen * seen
        segment.information[i, COLUMNS, j] += weight * f * seen
        segment.vector[i, j] += weight * seen * e
    segment.information[i, COLUMNS, COLUMNS] += weight * f * f
    segment.vector[i, COLUMNS] += weight * f * e
    for j in range(COLUMNS):
        columns[j] -= gain * (columns[j] + d[j])
    scaled = e * math.sqrt(weight)
    segment.scalar[i, SAMPLES] += 1.0
    segment.scalar[i, SQUARE] += scaled * scaled
    segment.scalar[i, PRODUCTS] += scaled * scalar[i, _LAST]
    segment.scalar[i, LEFT] = f * (1.0 - gain)
    segment.scalar[i, LOG_S] += math.log(total)
    scalar[i, _LAST] = scaled


@lean
def _note_quick_motion(dt, memory, to):  # type: ignore[no-untyped-def]
    """What the mean of two samples misses of a rate between them is noise of z."""
    for i in range(ROLL, AXIAL):
        change = to.rate[i] - memory.scalar[i, _RATE]
        to.more[i] = (COARSE * dt * change) ** 2 if memory.scalar[i, GOING] > 0.0 else 0.0


@lean
def _note_repeats(i, reading, time_s, memory, to):  # type: ignore[no-untyped-def]
    """A relation's own reading: how often it repeats; one that repeats for less than ``HELD_S`` is none."""
    last = memory.scalar[i]
    if reading == last[_READING]:
        last[REPEATS] += 1.0
        if time_s - last[_SINCE_S] < HELD_S:
            to.z[i] = np.nan
    elif not math.isnan(reading):
        if i >= ROLLING and last[REPEATS] > 0.0:  # what a held rate has grown by is not of one sample
            to.z[i] = np.nan
        last[MOST_REPEATS], last[CHANGES] = max(last[REPEATS], last[MOST_REPEATS]), last[CHANGES] + 1.0
        last[_READING], last[_SINCE_S], last[REPEATS] = reading, time_s, 0.0


@lean
def _without_held_airspeed(row, memory, to):  # type: ignore[no-untyped-def]
    """Velocity over the ground less airspeed is no new reading where the airspeed is that of a slower sensor, held: its
    error would count as often as it is held."""
    last = memory.scalar[AIRSPEED]
    if row[_V] == last[_READING] and row[_T] - last[_SINCE_S] < HELD_S:
        to.z[NORTH] = to.z[EAST] = np.nan


@lean
def _surprises(dt, to, model, memory, limit):  # type: ignore[no-untyped-def]
    """Whether some relation's innovation is beyond its limit; nothing is changed."""
    z, rate = to.z, to.rate
    for i in range(_N):
        scalar = memory.scalar[i]
        if not model.active[i] or scalar[GOING] == 0.0 or math.isnan(z[i]) or math.isnan(rate[i]):
            continue
        decay = 1.0 if math.isinf(model.leak_s[i]) else math.exp(-dt / model.leak_s[i])
        e = z[i] - scalar[_X] * decay - 0.5 * dt * (rate[i] + scalar[_RATE])
        if i in (ROLL, HEADING):
            e -= _TURN * math.floor(e / _TURN + 0.5)
        variance = model.noise_variance[i]
        total = scalar[_VARIANCE] * decay * decay + scalar[DRIFT] * variance * dt + variance + to.more[i]
        if e * e > limit[i] * total:
            return True
    return False


@lean
def _since_last(time_s, clock):  # type: ignore[no-untyped-def]
    """Time since the sample before, s; 0 after a hole, where filters start anew."""
    dt = time_s - clock[_STAMP_S]
    if not 0.0 < dt <= MAX_GAP_S:
        return 0.0
    usual = dt if math.isnan(clock[_USUAL_S]) else clock[_USUAL_S]
    return dt if dt <= HOLE * usual else 0.0


@lean
def _note_stamp(time_s, clock):  # type: ignore[no-untyped-def]
    """This sample is the last one; the usual time between two follows over ``USUAL_SAMPLES``."""
    dt, usual = time_s - clock[_STAMP_S], clock[_USUAL_S]
    if 0.0 < dt <= MAX_GAP_S:
        clock[_USUAL_S] = dt if math.isnan(usual) else usual + (dt - usual) / USUAL_SAMPLES
    clock[_STAMP_S] = time_s


@lean
def _smooth(row, dt, clock):  # type: ignore[no-untyped-def]
    """Airspeed and throttle over ``SMOOTHED_S``, as far as they are readings."""
    part = 1.0 - math.exp(-dt / SMOOTHED_S)
    if math.isnan(clock[_AIRSPEED_SMOOTH]) or dt == 0.0:
        clock[_AIRSPEED_SMOOTH] = max(row[_V], 1.0)
    elif row[_V] > 1.0:
        clock[_AIRSPEED_SMOOTH] += part * (row[_V] - clock[_AIRSPEED_SMOOTH])
    throttle = min(1.0, max(0.0, row[_THROTTLE]))
    if math.isnan(clock[_THROTTLE_SMOOTH]) or dt == 0.0:
        clock[_THROTTLE_SMOOTH] = throttle
    elif not math.isnan(throttle):
        clock[_THROTTLE_SMOOTH] += part * (throttle - clock[_THROTTLE_SMOOTH])


@hot
def take_samples(values, first, model, memory, segment, limit, work):  # type: ignore[no-untyped-def]
    """Take in rows from ``first`` on, up to the end of the segment.

    Args:
        values: clean samples (samples, channels).
        first: row to begin with.
        model: ``Model``.
        memory: ``Memory``, advanced.
        segment: ``Segment``, added to.
        limit: of e2/S, (relations,); a sample beyond it begins a segment.
        work: ``new_work``.

    Returns:
        the row after the last one taken; less than the number of rows where the segment has come to its end before.
    """
    to, (flow, gyro_rate, before, servos), (moments, late_flow) = work
    clock = memory.clock
    for n in range(first, values.shape[0]):
        row = values[n]
        dt = _since_last(row[_T], clock)
        if math.isnan(clock[END_S]):
            clock[END_S], clock[START_S] = row[_T] + SEGMENT_S, row[_T]
        if row[_T] >= clock[END_S] or row[_T] < clock[END_S] - 2.0 * SEGMENT_S:
            return n
        copy_into(clock, before)
        copy_into(memory.servo, servos)
        copy_into(memory.moment, moments)
        copy_into(memory.late_flow, late_flow)
        for j in range(3):
            now = row[_P + j]
            gyro_rate[j] = (now - clock[_ROLL_RATE + j]) / dt if dt > 0.0 else 0.0
            clock[_ROLL_RATE + j] = now
        _note_stamp(row[_T], clock)
        _smooth(row, dt, clock)
        _surfaces(row, dt, model, memory, to)
        _attitudes(row, dt, gyro_rate, model, memory, to)
        _flow_of(row, model, flow)
        _air(row, dt, model, memory, flow, to)
        if model.active[AXIAL]:
            _axial(row, model, memory, flow, to)
        if model.active[ROLLING] or model.active[PITCHING]:
            forces_and_moments(row, dt, model, memory, flow, to)
        _ground(row, dt, memory, flow, to)
        _note_quick_motion(dt, memory, to)
        _without_held_airspeed(row, memory, to)
        for i in range(_N):
            if model.active[i] and _MAY_REPEAT[i]:
                _note_repeats(i, row[_OWN[i]], row[_T], memory, to)
        # a row that begins a segment is looked at twice
        rested = not abs(row[_T] - clock[_FORCED_AT_S]) < FORCED_S
        if dt > 0.0 and rested and _surprises(dt, to, model, memory, limit):
            copy_into(before, clock)
            copy_into(servos, memory.servo)
            copy_into(moments, memory.moment)
            copy_into(late_flow, memory.late_flow)
            clock[END_S] = clock[_FORCED_AT_S] = row[_T]
            return n
        for i in range(_ROWS):
            if model.active[_OF_ROW[i]]:
                _filter(i, _OF_ROW[i], dt, to, model, memory, segment)
    return values.shape[0]
