"""From samples to what one mode's estimators read: states, accelerometer, inputs and the kinematic term.

Both estimators model the aerodynamic part of the specific force and of the angular acceleration. With the
air-relative velocity components w = V sin(alpha), v = V sin(beta) and the rigid-body kinematics of thesis
equations 7.1 and 7.3,

    dw/dt = a_z + U q - p v + g cos(theta) cos(phi),        dv/dt = a_y - U r + p w + g cos(theta) sin(phi),

the part in front of the aerodynamics, here called the kinematic term, is known from measurements, so the
aerodynamic derivatives never have the forward speed inside; it is added again when they are reported
(z_q has +U, y_r has -U, y_p has +W).

Column layout of the result (shape (vehicles, samples, columns)): time, states, accelerometer, inputs, then
kinematic term, dynamic pressure ratio rho V^2 / (rho V^2 at the reference), filtered airspeed, air density,
altitude, angle of attack, 1 where the velocity was measured by a vane or 0 where it was reconstructed, and for each
rate of the structure (states after the first) the known angular acceleration, rad/s2.

That is inertia coupling (``inertia_coupling``), 0 where the moments of inertia are not stated or a rate that it needs
is missing. It is made of measured rates, so it carries their noise: a product p r with noises n_p, n_r has the error
p n_r + r n_p + n_p n_r, of variance p^2 R_r + r^2 R_p + R_p R_r; a square p^2 has 2 p n_p + n_p^2, of mean R_p, which
a trim constant takes. In gentle flight that is far below the noise of a differentiated rate: at 0.5 rad/s and
gyro noise of 0.005 rad/s it is 0.0025 rad/s2, that of a central difference at 50 Hz 0.18 rad/s2.

Without a vane (thesis 7.2) the rates above are integrated. Errors of sensors would then grow without bound, so the
integral leaks: what comes out is not w but w behind a high-pass filter, T s / (T s + 1). ``Signals.high_passed`` lets
the other columns pass the same filter, so that linear equations hold between them as between the originals, but for
their constants. The angle of attack is then that of level flight. What is reconstructed is the aircraft's own
motion: it sees no gust.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.structures import DUTCH_ROLL, LATERAL, SHORT_PERIOD, ModeStructure
from wingwatch.estimators.inertia_coupling import InertiaCoupling
from wingwatch.estimators.kernels.levels import LEVELS, advance_level, start_level
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, INPUT_CHANNELS, MAX_GAP_S

__all__ = [
    "CONDITION_COLUMNS",
    "MAX_GAP_S",
    "SignalConfig",
    "SignalLayout",
    "Signals",
    "SignalState",
    "known_moments",
]

CONDITION_COLUMNS = 7

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

_RATE_CHANNEL = {"p": _P, "q": _Q, "r": _R}


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """Where things stand in a signal row of a structure."""

    states: int
    inputs: int

    @property
    def accelerometer(self) -> int:
        """Column of the accelerometer."""
        return 1 + self.states

    @property
    def first_input(self) -> int:
        """Column of the first control input."""
        return 2 + self.states

    @property
    def kinematic(self) -> int:
        """Column of the kinematic term; the other condition columns follow it."""
        return 2 + self.states + self.inputs

    @property
    def known_moments(self) -> int:
        """First column of the known angular accelerations, one for each state after the first."""
        return self.kinematic + CONDITION_COLUMNS

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.known_moments + self.states - 1

    def checked(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals (vehicles, samples, columns) as compiled code reads them, contiguous.

        Raises:
            ValueError: another number of axes or columns, which compiled code would read beyond its end.
        """
        if signals.ndim != 3 or signals.shape[2] != self.columns:
            raise ValueError(
                f"signals have shape {signals.shape}; {self.states} states and {self.inputs} inputs need (vehicles, "
                f"samples, {self.columns}), as Signals gives them"
            )
        return np.ascontiguousarray(signals, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class SignalConfig:
    """How samples become signals of one structure.

    Attributes:
        structure: which mode.
        vane_position_m: (x, y, z) of the vane from the c.g., body axes.
        airspeed_memory_s: time over which is learned how much the airspeed that scales dynamic pressure may be
            smoothed: still air much, rough air little.
        reconstruction_s: leak of the reconstructed velocity where no vane is there (thesis 7.2 integrates
            without leak; sensor biases then drift without bound).
        reference_airspeed_m_s: airspeed to which referred derivatives are scaled.
        reference_density_kg_m3: density likewise.
        servo_s: for each input time constant of the first-order servo that stands between it and the surface, its
            command held to the next; 0 for what is to be taken as it is.
        inertia: moments of inertia, for the known angular accelerations; None where they are not stated.
    """

    structure: ModeStructure
    vane_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    airspeed_memory_s: float = 10.0
    reconstruction_s: float = 20.0
    reference_airspeed_m_s: float = 25.0
    reference_density_kg_m3: float = 1.225
    servo_s: tuple[float, ...] = ()
    inertia: InertiaCoupling | None = None
    layout: SignalLayout = field(init=False)

    def __post_init__(self) -> None:
        layout = SignalLayout(len(self.structure.states), len(self.structure.inputs))
        object.__setattr__(self, "layout", layout)


@dataclass(slots=True)
class SignalState:
    """Recursive part, one row a vehicle.

    Attributes:
        memory: last time, acceleration along the path, reconstructed velocity, last rate of it, and whether a vane was
            ever seen (a vane that falls silent is not replaced in silence), shape (5,).
        airspeed: smoothers of the airspeed, shape (4, LEVELS).
        passed: last readings of the columns that go with a reconstructed velocity, and what of them has passed its
            filter, shape (2, columns).
        servos: last command of each input, and where its servo has the surface, shape (2, inputs).
    """

    memory: NDArray[np.float64]
    airspeed: NDArray[np.float64]
    passed: NDArray[np.float64]
    servos: NDArray[np.float64]


class _Form(NamedTuple):
    """What does not change, as compiled code reads it."""

    lateral: bool
    rates: NDArray[np.int64]
    """(states - 1,): channels."""
    inputs: NDArray[np.int64]
    """(inputs,): channels."""
    x_vane_m: float
    z_vane_m: float
    airspeed_memory_s: float
    reconstruction_s: float
    pressure: float
    """rho V^2 at the reference, N/m2."""
    servo_s: NDArray[np.float64]
    """(inputs,)."""


class Signals:
    """Turns blocks of samples into signals of one structure, for a batch of vehicles."""

    def __init__(self, config: SignalConfig) -> None:
        self.config = config
        structure = config.structure
        lateral = structure.name in (DUTCH_ROLL.name, LATERAL.name)
        if not lateral and structure.name != SHORT_PERIOD.name:
            raise ValueError(f"no signals are defined for structure {structure.name!r}")
        self._form = _Form(
            lateral=lateral,
            rates=np.array([_RATE_CHANNEL[s] for s in structure.states[1:]]),
            inputs=np.array([CHANNEL_INDEX[INPUT_CHANNELS[u]] for u in structure.inputs]),
            x_vane_m=config.vane_position_m[0],
            z_vane_m=config.vane_position_m[2],
            airspeed_memory_s=config.airspeed_memory_s,
            reconstruction_s=config.reconstruction_s,
            pressure=config.reference_density_kg_m3 * config.reference_airspeed_m_s**2,
            servo_s=np.array(config.servo_s or (0.0,) * len(structure.inputs)),
        )
        self._coupling = _coupling(config.inertia, structure.states[1:])

    def init(self, vehicles: int) -> SignalState:
        """State before the first sample."""
        memory = np.tile(np.array([np.nan, 0.0, 0.0, 0.0, 0.0]), (vehicles, 1))
        passed = np.full((vehicles, 2, self.config.layout.columns), np.nan)
        servos = np.full((vehicles, 2, self.config.layout.inputs), np.nan)
        return SignalState(memory, np.zeros((vehicles, 4, LEVELS)), passed, servos)

    def update(self, state: SignalState, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals of a batch.

        Args:
            state: advanced in place.
            values: shape (vehicles, samples, channels) as in ``SampleBlock.values``.

        Returns:
            shape (vehicles, samples, layout.columns).
        """
        if values.ndim != 3 or values.shape[2] != len(CHANNELS):
            raise ValueError(f"values have shape (vehicles, samples, {len(CHANNELS)}), got {values.shape}")
        layout = self.config.layout
        out = np.empty((*values.shape[:2], layout.columns))
        _signals(np.ascontiguousarray(values), self._form, state.memory, state.airspeed, state.servos, out)
        _moments_into(values, self._coupling, out[..., layout.known_moments :])
        return out

    def high_passed(self, state: SignalState, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals whose rates, accelerometer, inputs, kinematic term and known moments went the way of a reconstructed
        velocity.

        Args:
            state: advanced in place.
            signals: of ``update``, the next in time.

        Returns:
            the same shape; rows whose velocity a vane measured are as they were.
        """
        out = signals.copy()
        layout = self.config.layout
        passing = np.array([*range(2, layout.kinematic + 1), *range(layout.known_moments, layout.columns)])
        _high_passed(signals, state.passed, passing, layout.kinematic, self.config.reconstruction_s, out)
        return out


def known_moments(
    inertia: InertiaCoupling | None, rates: Sequence[str], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Known angular accelerations of samples, as ``Signals`` appends them to its rows.

    Args:
        inertia: None where it is not stated.
        rates: of ``p``, ``q``, ``r``.
        values: (samples, channels) as in ``SampleBlock.values``.

    Returns:
        (samples, rates), rad/s2.
    """
    out = np.empty((1, len(values), len(rates)))
    _moments_into(values[None], _coupling(inertia, rates), out)
    return np.asarray(out[0])


def _coupling(inertia: InertiaCoupling | None, rates: Sequence[str]) -> NDArray[np.float64]:
    if inertia is None:
        return np.zeros((len(rates), 4))
    return np.array([inertia.coefficients(rate) for rate in rates])


@njit(cache=True)
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


@njit(cache=True)
def _velocity_and_kinematics(row, lateral, x_vane, z_vane):  # type: ignore[no-untyped-def]
    """Air-relative w or v at the c.g. (NaN without vane) and the kinematic term of its rate."""
    airspeed = row[_AIRSPEED]
    alpha, beta = row[_ALPHA], row[_BETA]
    w = airspeed * np.sin(alpha) + row[_Q] * x_vane
    v = airspeed * np.sin(beta) - row[_R] * x_vane + row[_P] * z_vane
    forward = airspeed * (np.cos(alpha) if np.isfinite(alpha) else 1.0)
    cos_pitch = np.cos(row[_PITCH])
    if lateral:
        across = w if np.isfinite(w) else airspeed * np.sin(_level_alpha(row))
        kinematic = -forward * row[_R] + row[_P] * across + GRAVITY_M_S2 * cos_pitch * np.sin(row[_ROLL])
        return v, kinematic
    side = v if np.isfinite(v) else 0.0
    kinematic = forward * row[_Q] - row[_P] * side + GRAVITY_M_S2 * cos_pitch * np.cos(row[_ROLL])
    return w, kinematic


@njit(cache=True)
def _level_alpha(row):  # type: ignore[no-untyped-def]
    """Angle of attack of level flight without sideslip at this attitude; banks beyond 45 degrees count as 45."""
    return np.arctan(np.tan(row[_PITCH]) / max(np.cos(row[_ROLL]), 0.7))


@njit(cache=True)
def _high_passed(signals, passed, passing, kinematic, leak_s, out):  # type: ignore[no-untyped-def]
    """See ``Signals.high_passed``; ``passing`` holds the columns that pass the filter."""
    for i in range(signals.shape[0]):
        for k in range(signals.shape[1]):
            row = signals[i, k]
            if row[kinematic + 6] == 1.0 or not np.isfinite(row[: kinematic + 1]).all():
                continue
            dt = row[0] - passed[i, 0, 0]
            fresh = not (0.0 < dt <= MAX_GAP_S)
            decay = np.exp(-dt / leak_s)
            for j in passing:
                passed[i, 1, j] = 0.0 if fresh else decay * passed[i, 1, j] + row[j] - passed[i, 0, j]
                out[i, k, j] = passed[i, 1, j]
            passed[i, 0] = row


@njit(cache=True)
def _moments_into(values, coupling, out):  # type: ignore[no-untyped-def]
    """Into ``out`` (vehicles, samples, rates) the angular accelerations by ``coupling`` (rates, 4) of p q, q r, p r and
    p^2 - r^2."""
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            p, q, r = values[i, k, _P], values[i, k, _Q], values[i, k, _R]
            for j in range(coupling.shape[0]):
                c = coupling[j]
                moment = c[0] * p * q + c[1] * q * r + c[2] * p * r + c[3] * (p * p - r * r)
                out[i, k, j] = moment if np.isfinite(moment) else 0.0


@njit(cache=True)
def _along_path(row):  # type: ignore[no-untyped-def]
    """Rate of the inertial speed along the path without sideslip: specific force and gravity along it."""
    alpha = row[_ALPHA] if np.isfinite(row[_ALPHA]) else 0.0
    cos, sin = np.cos(alpha), np.sin(alpha)
    cos_pitch = np.cos(row[_PITCH])
    gravity = GRAVITY_M_S2 * (cos_pitch * np.cos(row[_ROLL]) * sin - np.sin(row[_PITCH]) * cos)
    rate = row[_AX] * cos + row[_AZ] * sin + gravity
    return rate if np.isfinite(rate) else 0.0


@njit(cache=True)
def _surface(command, dt, servo_s, told):  # type: ignore[no-untyped-def]
    """Where a servo has its surface: it went on to the command before, x = c + (x0 - c) exp(-dt / servo_s).

    After a gap the surface is where it is told to be. NaN where nothing is told, though the servo goes on.

    Args:
        told: (2,), last command and the surface, in place.
    """
    if 0.0 < dt <= MAX_GAP_S:
        told[1] = told[0] + (told[1] - told[0]) * np.exp(-dt / servo_s)
    else:
        told[1] = np.nan
    if not np.isfinite(command):
        return np.nan
    told[0] = command
    if not np.isfinite(told[1]):
        told[1] = command
    return told[1]


@njit(cache=True)
def _signals(values, form, memory, smoothers, servos, out):  # type: ignore[no-untyped-def]
    """One pass over vehicles and samples; see the module's layout.

    Args:
        values: (vehicles, samples, channels).
        form: ``_Form``.
        memory, smoothers, servos: of ``SignalState``, in place.
        out: (vehicles, samples, columns), filled.
    """
    lateral, rates, inputs = form.lateral, form.rates, form.inputs
    force = _AY if lateral else _AZ
    ns, nu = 1 + rates.size, inputs.size
    for i in range(values.shape[0]):
        last, along, velocity, rate, seen = memory[i]
        speed = np.nan
        for k in range(values.shape[1]):
            row = values[i, k]
            dt = row[_TIME] - last
            velocity_measured, kinematic = _velocity_and_kinematics(
                row, lateral, form.x_vane_m, form.z_vane_m
            )
            rate_now = row[force] + kinematic
            along_now = _along_path(row)
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
            o = out[i, k]
            o[0] = row[_TIME]
            measured = np.isfinite(velocity_measured)
            if measured:
                seen = 1.0
            o[1] = velocity_measured if measured or seen == 1.0 else velocity
            for j in range(rates.size):
                o[2 + j] = row[rates[j]]
            o[1 + ns] = row[force]
            for j in range(nu):
                o[2 + ns + j] = row[inputs[j]]
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
        memory[i, 0], memory[i, 1], memory[i, 2], memory[i, 3], memory[i, 4] = (
            last,
            along,
            velocity,
            rate,
            seen,
        )
