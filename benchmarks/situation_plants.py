"""Plants of two degrees of freedom flown through air that moves, with a loop, an unknown moment or a vane ahead.

The short period and the Dutch roll of ``reference_plant``, linear and at one airspeed V, in steps of half a
millisecond. With w_g the gust along the first state and q_g the rate at which the air turns,

    w' = z_w (w - w_g) + (z_q - U) (q - q_g) + z_eta eta + U q,      U = V (Dutch roll: -V)
    q' = m_w (w - w_g) + m_q (q - q_g) + m_eta eta + m(t),           q_g = -w_g,s'/V (Dutch roll: +v_g,s'/V)

w_g,s is the gust smoothed over the span, (tau s + 1) w_g,s = w_g, tau = 4 b / (pi V) in pitch and 3 b / (pi V) in
yaw (MIL-F-8785C 3.7.5), and m(t) a moment that no instrument sees. The vane reads w - q x - w_g, met where the vane
is, the gyro q, the accelerometer the first line without U q. A loop answers the noisy gyro and its integral one sample
late. Steps of 2 ms bias m_w by three stated errors of a good estimator; half a millisecond does not.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray
from reference_plant import AMPLITUDE_RAD, CONDITION, Plant
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.signal import tf2ss

from wingwatch.aircraft import GRAVITY_M_S2, SHORT_PERIOD, load_aircraft
from wingwatch.baselines import Expectation, apriori_envelope
from wingwatch.estimators import SignalLayout, offsets

Array: TypeAlias = NDArray[np.float64]
OfTime: TypeAlias = Callable[[Array], Array]

AIRSPEED_M_S = CONDITION.airspeed_true_m_s
SPAN_M = 2.9
FINE_S = 0.0005
LEAD_S = 5.0
"""Flown before the record begins, so that it begins amid the motion."""
TRIM_VELOCITY_M_S, TRIM_SURFACE_RAD = 1.3, 0.05
START_OFF = 0.3
LARGEST_COMMAND_RAD = 0.3
REFERENCE_RECORD_S = 12.0
"""Signal-to-noise is that of a record of this length with one doublet."""

GustShape: TypeAlias = Literal["dryden", "first-order", "von-karman"]
SHAPES: dict[GustShape, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "dryden": ((3.0**0.5, 1.0), (1.0, 2.0, 1.0)),
    "first-order": ((1.0,), (1.0, 1.0)),
    # MIL-HDBK-1797's rational form of von Karman's transverse spectrum
    "von-karman": ((0.3398, 2.7478, 1.0), (0.1539, 1.9754, 2.9958, 1.0)),
}
"""Numerator and denominator of a transverse gust in (L / V) s."""


@dataclass(frozen=True, slots=True)
class Air:
    """The air's motion along the first state.

    Attributes:
        intensity_m_s: standard deviation.
        length_m: scale length.
        shape: of the spectrum.
        span_m: over which the air's turning is smoothed.
        turns: whether the gust turns the air.
        profile: factor of the gust at each time of the record, s.
    """

    intensity_m_s: float
    length_m: float = 50.0
    shape: GustShape = "dryden"
    span_m: float = SPAN_M
    turns: bool = True
    profile: OfTime | None = None


@dataclass(frozen=True, slots=True)
class RandomMoment:
    """A first-order random moment that nobody measures: standard deviation rad/s2 and time constant s."""

    std_rad_s2: float
    memory_s: float


@dataclass(frozen=True, slots=True)
class Situation:
    """How one record is flown and what the estimator is given of it.

    Attributes:
        surface: commanded surface from trim at times of the record, rad; None: it rests but for the loop.
        air: the air's motion; None: still.
        loop: gains of attitude (rad/rad) and rate (rad per rad/s); None: open.
        moment: angular acceleration of time, rad/s2, or a random one; None: none.
        vane_ahead_m: of the centre of gravity.
        vane_stated_m: what the estimator is given, and its signals are corrected for; None: the truth.
        rate_hz: samples a second.
        seconds: length; None: as the command asks.
        signal_to_noise: of each sensor in the reference record; infinite: sensors without noise.
        surface_noise_rad: standard deviation of the surface's reading, stated to the estimator.
        surface_moves: on a line from sample to sample; else it is held between them.
        accelerometer: whether there is one.
    """

    surface: Callable[[Plant, Array], Array] | None = None
    air: Air | None = None
    loop: tuple[float, float] | None = None
    moment: OfTime | RandomMoment | None = None
    vane_ahead_m: float = 0.0
    vane_stated_m: float | None = None
    rate_hz: float = 50.0
    seconds: float | None = None
    signal_to_noise: float = 5.0
    surface_noise_rad: float = 0.0
    surface_moves: bool = False
    accelerometer: bool = True


@dataclass(frozen=True, slots=True)
class Known:
    """What an estimator is given before the flight, as the live chain takes it from an aircraft file.

    Attributes:
        plant: for its structure only.
        start: aerodynamic derivatives to start from, (6,).
        natural: natural size of each, (6,).
        reference: airspeed and air density that derivatives are referred to.
        rate_hz: samples a second.
        rate_noise_rad_s: the gyro's standard deviation.
        surface_noise_rad: the surface's.
        held: whether the surface is held between samples.
        accelerometer: whether the accelerometer may be used.
        vane_ahead_m: of the centre of gravity, as stated.
        span_m: of the wing.
    """

    plant: Plant
    start: Array
    natural: Array
    reference: tuple[float, float]
    rate_hz: float
    rate_noise_rad_s: float
    surface_noise_rad: float
    held: bool
    accelerometer: bool
    vane_ahead_m: float
    span_m: float = SPAN_M


@dataclass(frozen=True, slots=True)
class Flight:
    """One record: signal rows (samples, columns) as ``Signals`` lays them out, and what is given with them."""

    rows: Array
    known: Known


class Motion(NamedTuple):
    """The plant: aerodynamics (2, 3) of (w - w_g, q - q_g, surface), ``turn`` U in m/s, moment (steps + 1,) rad/s2,
    and where the vane stands as it enters the first state's reading, m (ahead; Dutch roll: -ahead)."""

    aerodynamics: Array
    turn: float
    moment: Array
    vane_m: float


class AirPath(NamedTuple):
    """The air at each fine step: gust at the centre of gravity and at the vane, m/s; rate, rad/s; (steps + 1,) each."""

    gust: Array
    at_vane: Array
    rate: Array


class Loop(NamedTuple):
    """Gains of attitude and rate, and the noise of the vane, gyro and accelerometer (samples, 3)."""

    attitude: float
    rate: float
    noise: Array


@njit(cache=True)
def _fly(
    motion: Motion, air: AirPath, loop: Loop, planned: Array, moves: bool, fine: int, sample_s: float
) -> tuple[Array, Array]:
    """Readings (samples, 3) of vane, gyro and accelerometer, and the surface at each sample (samples,)."""
    d, h = motion.aerodynamics, sample_s / fine
    readings, surface = np.empty((planned.size, 3)), np.empty(planned.size)
    w = q = attitude = command = 0.0
    for k in range(planned.size):
        u = planned[k] + command
        at = k * fine
        by_air, turned = w - air.gust[at], q - air.rate[at]
        readings[k, 0] = w - air.at_vane[at] - motion.vane_m * q + loop.noise[k, 0]
        readings[k, 1] = q + loop.noise[k, 1]
        readings[k, 2] = d[0, 0] * by_air + d[0, 1] * turned + d[0, 2] * u + loop.noise[k, 2]
        surface[k] = u
        attitude += sample_s * readings[k, 1]
        command = loop.attitude * attitude + loop.rate * readings[k, 1]
        command = min(max(command, -LARGEST_COMMAND_RAD), LARGEST_COMMAND_RAD)
        rise = (planned[min(k + 1, planned.size - 1)] + command - u) / fine if moves else 0.0
        for i in range(at, at + fine):
            half = u + rise * (i - at + 0.5)
            gust, rate = 0.5 * (air.gust[i] + air.gust[i + 1]), 0.5 * (air.rate[i] + air.rate[i + 1])
            moment = 0.5 * (motion.moment[i] + motion.moment[i + 1])
            w_mid, q_mid = w, q
            for step in (0.5 * h, h):  # midpoint rule
                force = d[0, 0] * (w_mid - gust) + d[0, 1] * (q_mid - rate) + d[0, 2] * half
                turn = d[1, 0] * (w_mid - gust) + d[1, 1] * (q_mid - rate) + d[1, 2] * half
                w_mid, q_mid = w + step * (force + motion.turn * q_mid), q + step * (turn + moment)
            w, q = w_mid, q_mid
    return readings, surface


@njit(cache=True)
def _driven(transition: Array, root: Array, first: Array, normals: Array, output: Array) -> Array:
    """Output of x' = transition x + root n from ``first`` on, (steps + 1,)."""
    x, new, out = first.copy(), np.empty(first.size), np.empty(len(normals) + 1)
    for i in range(out.size):
        out[i] = 0.0
        for j in range(x.size):
            out[i] += output[j] * x[j]
        if i == len(normals):
            break
        for j in range(x.size):
            new[j] = 0.0
            for m in range(x.size):
                new[j] += transition[j, m] * x[m] + root[j, m] * normals[i, m]
        x[:] = new
    return out


def _stationary(
    numerator: tuple[float, ...],
    denominator: tuple[float, ...],
    time_s: float,
    steps: int,
    rng: np.random.Generator,
) -> Array:
    """White noise through a filter in ``time_s`` s, of variance 1, exact at every fine step, (steps + 1,)."""
    a, b, c, _ = (np.asarray(m, dtype=np.float64) for m in tf2ss(numerator, denominator))
    n, step = len(a), FINE_S / time_s
    spread = np.asarray(solve_continuous_lyapunov(a, -b @ b.T))
    grown = expm(step * np.block([[-a, b @ b.T], [np.zeros_like(a), a.T]]))  # Van Loan 1978
    transition = np.ascontiguousarray(grown[n:, n:].T)
    values, vectors = np.linalg.eigh(transition @ grown[:n, n:])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    output = c[0] / np.sqrt(c @ spread @ c.T).item()
    first = np.linalg.cholesky(spread) @ rng.standard_normal(n)
    return np.asarray(_driven(transition, root, first, rng.standard_normal((steps, n)), output))


def _air_path(situation: Situation, plant: Plant, time_s: Array, rng: np.random.Generator) -> AirPath:
    air, still = situation.air, np.zeros(time_s.size)
    if air is None:
        return AirPath(still, still, still)
    ahead = round(situation.vane_ahead_m / AIRSPEED_M_S / FINE_S)
    numerator, denominator = SHAPES[air.shape]
    far = _stationary(numerator, denominator, air.length_m / AIRSPEED_M_S, time_s.size - 1 + ahead, rng)
    far = air.intensity_m_s * far
    if air.profile is not None:
        far = far * air.profile(np.concatenate([time_s, time_s[-1] + FINE_S * np.arange(1, ahead + 1)]))
    gust = far[: time_s.size]
    if not air.turns:
        return AirPath(gust, far[ahead:], still)
    pitches = plant.structure is SHORT_PERIOD
    lag_s = (4.0 if pitches else 3.0) * air.span_m / (np.pi * AIRSPEED_M_S)
    rate = (gust - _lagged(gust, lag_s)) / (lag_s * AIRSPEED_M_S)
    return AirPath(gust, far[ahead:], -rate if pitches else rate)


@njit(cache=True)
def _lagged(gust: Array, lag_s: float) -> Array:
    """First-order lag, exact for a gust that is linear between fine steps."""
    out, decay = np.empty_like(gust), np.exp(-FINE_S / lag_s)
    slope_part = lag_s / FINE_S * (1.0 - decay)
    out[0] = gust[0]
    for i in range(1, gust.size):
        out[i] = decay * out[i - 1] + (slope_part - decay) * gust[i - 1] + (1.0 - slope_part) * gust[i]
    return out


def _moment(situation: Situation, time_s: Array, rng: np.random.Generator) -> Array:
    moment = situation.moment
    if moment is None:
        return np.zeros(time_s.size)
    if isinstance(moment, RandomMoment):
        return moment.std_rad_s2 * _stationary((1.0,), (1.0, 1.0), moment.memory_s, time_s.size - 1, rng)
    return np.where(time_s < 0.0, 0.0, moment(time_s))


def pulse_doublets(start_s: float, every_s: float = np.inf) -> Callable[[Plant, Array], Array]:
    """The reference plant's doublet of 2 degrees at ``start_s`` and each ``every_s`` from there."""

    def surface(plant: Plant, time_s: Array) -> Array:
        since = time_s - start_s + 1e-9
        since = np.where(since < 0.0, np.inf, np.mod(since, every_s) if np.isfinite(every_s) else since)
        halves = np.floor(since / plant.pulse_s)
        return AMPLITUDE_RAD * (np.equal(halves, 0.0) * 1.0 - np.equal(halves, 1.0))

    return surface


def three_two_one_one(start_s: float) -> Callable[[Plant, Array], Array]:
    """Steps of 3, 2, 1 and 1 pulses to either side, 2 degrees."""

    def surface(plant: Plant, time_s: Array) -> Array:
        pulses = np.floor((time_s - start_s) / plant.pulse_s + 1e-9)
        sign = np.select([pulses < 3, pulses < 5, pulses < 6, pulses < 7], [1.0, -1.0, 1.0, -1.0], 0.0)
        return AMPLITUDE_RAD * np.where(pulses < 0, 0.0, sign)

    return surface


def multisine(start_s: float, length_s: float = 8.0) -> Callable[[Plant, Array], Array]:
    """Harmonics of 1 / ``length_s`` up to 2.5 Hz with Schroeder's phases, 2 degrees at its largest."""

    def surface(plant: Plant, time_s: Array) -> Array:
        k = np.arange(1, int(2.5 * length_s) + 1)
        at = (time_s - start_s)[:, None]
        total = np.cos(2.0 * np.pi * k * at / length_s - np.pi * k * (k - 1) / k.size).sum(axis=1)
        inside = (at[:, 0] >= 0.0) & (at[:, 0] < length_s)
        total = np.where(inside, total, 0.0)
        return np.asarray(AMPLITUDE_RAD * total / max(float(np.abs(total).max()), 1e-12))

    return surface


def aerodynamic(plant: Plant) -> Array:
    """The plant's derivatives without the forward speed in z_q or y_r, (6,)."""
    return np.array(plant.truth) - offsets(plant.structure, AIRSPEED_M_S, 0.0)


@lru_cache(maxsize=8)
def natural_size(plant: Plant) -> Array:
    """Natural size as the live chain has it: a derivative's size, or twice the aircraft file's error if larger."""
    found = apriori_envelope(load_aircraft("aerosonde"), plant.structure, "clean").lookup(CONDITION)
    assert isinstance(found, Expectation)
    return np.maximum(np.abs(aerodynamic(plant)), 2.0 * np.sqrt(np.diagonal(found.covariance)))


def _motion(plant: Plant, moment: Array, vane_ahead_m: float) -> Motion:
    pitches = plant.structure is SHORT_PERIOD
    return Motion(
        aerodynamic(plant).reshape(2, 3), plant.turn, moment, vane_ahead_m if pitches else -vane_ahead_m
    )


@lru_cache(maxsize=64)
def reference_noise(plant: Plant, signal_to_noise: float) -> Array:
    """Standard deviation of vane, gyro and accelerometer, (3,), at a ratio to the clean reference record's."""
    if np.isinf(signal_to_noise):
        return np.zeros(3)
    time_s = np.arange(0.0, REFERENCE_RECORD_S, 0.02)
    steps = np.zeros(time_s.size * 40 + 1)
    loop = Loop(0.0, 0.0, np.zeros((time_s.size, 3)))
    planned = pulse_doublets(2.0)(plant, time_s)
    readings, _ = _fly(
        _motion(plant, steps, 0.0), AirPath(steps, steps, steps), loop, planned, False, 40, 0.02
    )
    return np.asarray(readings.std(axis=0) / signal_to_noise)


def fly_situation(plant: Plant, situation: Situation, seed: int, seconds: float) -> Flight:
    """One record of a situation; its air, sensors, moment and start go by the seed."""
    of_air, of_sensors, of_moment, of_start, of_surface = np.random.default_rng(1000 + seed).spawn(5)
    rate, length = situation.rate_hz, situation.seconds or seconds
    lead, samples, fine = round(LEAD_S * rate), round(length * rate), round(1.0 / (rate * FINE_S))
    time_s: Array = np.asarray((np.arange(lead + samples) - lead) / rate, dtype=np.float64)
    fine_s: Array = np.asarray(
        FINE_S * (np.arange((lead + samples) * fine + 1) - lead * fine), dtype=np.float64
    )
    std = reference_noise(plant, situation.signal_to_noise)
    attitude_gain, rate_gain = situation.loop or (0.0, 0.0)
    loop = Loop(attitude_gain, rate_gain, std * of_sensors.standard_normal((time_s.size, 3)))
    planned = np.zeros(time_s.size)
    if situation.surface is not None:
        planned[lead:] = situation.surface(plant, time_s[lead:])
    motion = _motion(plant, _moment(situation, fine_s, of_moment), situation.vane_ahead_m)
    air = _air_path(situation, plant, fine_s, of_air)
    readings, surface = _fly(motion, air, loop, planned, situation.surface_moves, fine, 1.0 / rate)
    surface = surface + situation.surface_noise_rad * of_surface.standard_normal(surface.size)
    natural = natural_size(plant)
    start = aerodynamic(plant) + START_OFF * natural * of_start.choice([-1.0, 1.0], 6)
    stated = situation.vane_ahead_m if situation.vane_stated_m is None else situation.vane_stated_m
    known = Known(
        plant, start, natural, (AIRSPEED_M_S, CONDITION.air_density_kg_m3), rate, float(std[1]),
        situation.surface_noise_rad, not situation.surface_moves, situation.accelerometer, stated,
    )  # fmt: skip
    return Flight(_rows(plant, readings[lead:], surface[lead:], stated, rate), known)


def _rows(plant: Plant, readings: Array, surface: Array, vane_stated_m: float, rate_hz: float) -> Array:
    """Signal rows of level flight from the readings of vane, gyro and accelerometer, as ``Signals`` makes them."""
    layout = SignalLayout(2, 1)
    rows = np.zeros((len(readings), layout.columns))
    pitches = plant.structure is SHORT_PERIOD
    weight = GRAVITY_M_S2 if pitches else 0.0
    rows[:, 0] = np.arange(len(readings)) / rate_hz
    rows[:, 1] = (
        TRIM_VELOCITY_M_S + readings[:, 0] + (1.0 if pitches else -1.0) * vane_stated_m * readings[:, 1]
    )
    rows[:, 2] = readings[:, 1]
    rows[:, layout.accelerometer] = readings[:, 2] - weight
    rows[:, layout.first_input] = TRIM_SURFACE_RAD + surface
    c = layout.kinematic
    rows[:, c] = plant.turn * readings[:, 1] + weight
    rows[:, c + 1] = 1.0
    rows[:, c + 2] = AIRSPEED_M_S
    rows[:, c + 3] = CONDITION.air_density_kg_m3
    rows[:, c + 4] = CONDITION.altitude_m
    rows[:, c + 6] = 1.0
    return rows
