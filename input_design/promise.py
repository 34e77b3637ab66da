"""What an input promises: the mode's response to it, and the Cramer-Rao standard errors of the derivatives.

The plant is the mode's linear model about a level trim, discretised exactly for inputs held between samples. The
lateral one carries the bank angle as a fourth state, through gravity (thesis equation B.12). Measured are what the
estimators read: the vane at its place, the angular rates, the accelerometer at its place, the surfaces, and in the
lateral mode the bank angle; of phugoid, roll and spiral the states themselves (airspeed and pitch, roll rate, bank).
Noise is white, of the levels that the aircraft file states.

Noise of a surface's reading is noise of the input: the true deflections are as many unknowns more. To eliminate them is
to colour the outputs by what that noise does to them, so the sensitivities are whitened by the Kalman filter of the
plant with the surfaces' noise as process noise, which also reaches the accelerometer. The result is the inverse of
the information matrix, exact to first order in the noise (Klein and Morelli, Aircraft System Identification,
equations 6.49 ff and 9.6).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm_frechet

from wingwatch.aircraft import SURFACE_OF_INPUT
from wingwatch.aircraft.aircraft_file import Aircraft, AircraftDataError
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.state_space import known_terms
from wingwatch.aircraft.structures import (
    DUTCH_ROLL,
    LATERAL,
    LATERAL_FULL,
    PHUGOID,
    ROLL,
    SHORT_PERIOD,
    SPIRAL,
    ModeStructure,
)
from wingwatch.estimators.reference import offsets

__all__ = ["ModeResponse", "Promise", "SensedPlant", "promise", "sensed_plant"]

Array = NDArray[np.float64]

_RATES: Mapping[str, str] = {"p": "roll_rate_rad_s", "q": "pitch_rate_rad_s", "r": "yaw_rate_rad_s"}
_STATES: Mapping[str, str] = {
    "u": "airspeed_true_m_s", "theta": "pitch_rad", "p": "roll_rate_rad_s", "phi": "roll_rad"
}  # fmt: skip
_REDUCED = (PHUGOID, ROLL, SPIRAL)
_MODES = (SHORT_PERIOD, DUTCH_ROLL, LATERAL, *_REDUCED)


@dataclass(frozen=True, slots=True)
class SensedPlant:
    """A mode at a condition with its sensors: dx/dt = a x + b u, y = c x + d u, all from trim.

    Attributes:
        structure: the mode.
        condition: with the angle of attack of the trim.
        derivatives: concise, in the order of ``structure.derivatives``, shape (k,).
        outputs: flight-table columns that the rows of y are about; the vane's is in m/s, as velocity at the vane.
        noise_std: of each, shape (p,).
        input_noise_std: of the surfaces' readings, rad, shape (inputs,).
        imu_position_m, vane_position_m: (x, y, z) from the c.g.
    """

    structure: ModeStructure
    condition: FlightCondition
    derivatives: Array
    outputs: tuple[str, ...]
    noise_std: Array
    input_noise_std: Array
    imu_position_m: tuple[float, float, float]
    vane_position_m: tuple[float, float, float]

    @property
    def order(self) -> int:
        """States, the bank angle included where it is one."""
        return len(self.structure.states) + (1 if self.structure == LATERAL else 0)

    @property
    def accelerometer(self) -> bool:
        """Whether one is read; a row after those of the states."""
        return self.structure not in _REDUCED

    def matrices(self, derivatives: Array) -> tuple[Array, Array, Array, Array]:
        """(a, b, c, d) for concise derivatives of shape (k,); affine in them."""
        s, alpha = self.structure, self.condition.angle_of_attack_rad
        ns, nu, order = len(s.states), len(s.inputs), self.order
        table = derivatives.reshape(ns, ns + nu)
        a, b = np.zeros((order, order)), np.zeros((order, nu))
        a[:ns, :ns], b[:ns] = table[:, :ns], table[:, ns:]
        if order > ns:
            a += known_terms(LATERAL_FULL, self.condition).matrix[:order, :order]
        c, d = np.zeros((len(self.outputs), order)), np.zeros((len(self.outputs), nu))
        c[:ns, :ns] = np.eye(ns)
        if not self.accelerometer:
            return a, b, c, d
        c[0, :ns] += _arm(s, self.vane_position_m)
        lever = _arm(s, self.imu_position_m)
        kinematic = offsets(s, self.condition.airspeed_true_m_s, alpha).reshape(ns, ns + nu)[0]
        accelerometer = table[0] - kinematic + lever @ table
        c[ns, :ns], d[ns] = accelerometer[:ns], accelerometer[ns:]
        if order > ns:
            c[ns + 1, ns] = 1.0
        return a, b, c, d


def _arm(structure: ModeStructure, position_m: tuple[float, float, float]) -> Array:
    """Velocity of a place off the c.g. across the flight path, per state; of the rates, its acceleration likewise.

    w - q x, and v + r x - p z (thesis 6.3, and equations 7.1 and 7.3).
    """
    x, _, z = position_m
    each = {"q": -x, "p": -z, "r": x}
    return np.array([each.get(state, 0.0) for state in structure.states])


def sensed_plant(
    aircraft: Aircraft,
    structure: ModeStructure,
    condition: FlightCondition,
    derivatives: Mapping[str, float],
) -> SensedPlant:
    """The plant of a mode with the sensors that the aircraft's file states.

    Args:
        condition: with the trim's angle of attack (``wingwatch.aircraft.trimmed``).
        derivatives: concise, by symbol.

    Raises:
        AircraftDataError: no noise stated of a sensor that is needed.
        ValueError: a structure that is none of short period, phugoid, Dutch roll, roll, spiral and lateral.
    """
    if structure not in _MODES:
        raise ValueError(
            f"no promise is defined for mode {structure.name!r}; give {', '.join(m.name for m in _MODES)}"
        )
    surfaces = np.array([aircraft.noise_std(f"{SURFACE_OF_INPUT[u]}_rad") or 0.0 for u in structure.inputs])
    values, sensors = np.array([derivatives[s] for s in structure.derivatives]), aircraft.sensors
    places = sensors.imu_position_m, sensors.vane_position_m
    if structure in _REDUCED:
        states = tuple(_STATES[state] for state in structure.states)
        noise = np.array(_stated(aircraft, states))
        return SensedPlant(structure, condition, values, states, noise, surfaces, *places)
    longitudinal = structure == SHORT_PERIOD
    vane = "angle_of_attack_rad" if longitudinal else "sideslip_rad"
    rates = [_RATES[state] for state in structure.states[1:]]
    force = "specific_force_z_m_s2" if longitudinal else "specific_force_y_m_s2"
    outputs = (vane, *rates, force) + (("roll_rad",) if structure == LATERAL else ())
    std = np.array(_stated(aircraft, outputs))
    airspeed = aircraft.noise_std("airspeed_true_m_s") or 0.0
    # w = V sin(alpha), v = V sin(beta): the airspeed's noise enters where the angle is not nought
    if longitudinal:
        std[0] = math.hypot(
            condition.forward_velocity_m_s * std[0], math.sin(condition.angle_of_attack_rad) * airspeed
        )
    else:
        std[0] *= condition.airspeed_true_m_s
    return SensedPlant(structure, condition, values, outputs, std, surfaces, *places)


def _stated(aircraft: Aircraft, columns: tuple[str, ...]) -> list[float]:
    missing = [column for column in columns if not aircraft.noise_std(column)]
    if missing:
        raise AircraftDataError(
            f"aircraft {aircraft.name} states no noise of {', '.join(missing)}, without which no standard error can "
            "be promised; add it to [sensors.noise_std] in its file"
        )
    return [aircraft.sensors.noise_std[column] for column in columns]


@dataclass(frozen=True, slots=True)
class ModeResponse:
    """What the aircraft does.

    Attributes:
        quantities: by name with its unit, shape (samples,): angles and rates in full (trim included), load factor.
        signal_to_noise: by measured column, rms from trim over the noise.
    """

    quantities: Mapping[str, Array]
    signal_to_noise: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Promise:
    """What an input tells about a mode at best.

    Attributes:
        structure: the mode.
        derivatives: concise, that the plant was flown with, shape (k,).
        covariance: Cramer-Rao bound of unbiased estimates, shape (k, k); infinite where the input tells nothing.
        response: of the aircraft.
    """

    structure: ModeStructure
    derivatives: Array
    covariance: Array
    response: ModeResponse

    @property
    def standard_error(self) -> Array:
        """Of the concise derivatives, shape (k,)."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, a ratio, shape (k, k)."""
        return np.asarray(self.covariance / np.outer(self.standard_error, self.standard_error))


def promise(plant: SensedPlant, inputs_rad: ArrayLike, rate_hz: float) -> Promise:
    """Response to an input and the standard errors that it promises.

    Unknown beside the derivatives: a constant in every equation and in the accelerometer, where one is read (trim and
    biases left in the data), and the state at the start. Noise levels that are unknown cost
    nothing: their information is orthogonal.

    Args:
        plant: the mode with its sensors.
        inputs_rad: deflections from trim, shape (samples, inputs), held from each sample to the next.
        rate_hz: samples a second.

    Raises:
        ValueError: inputs of another shape.
    """
    u = np.asarray(inputs_rad, dtype=np.float64)
    nu = len(plant.structure.inputs)
    if u.ndim != 2 or u.shape[1] != nu:
        raise ValueError(f"inputs of {plant.structure.name} have shape (samples, {nu}), got {u.shape}")
    states, outputs, information = _fly(plant, u, 1.0 / rate_hz)
    k = plant.derivatives.size
    snr = np.sqrt(np.mean(outputs**2, axis=0)) / plant.noise_std
    return Promise(
        plant.structure,
        plant.derivatives,
        _inverse(information)[:k, :k],
        ModeResponse(
            _quantities(plant, states, outputs), dict(zip(plant.outputs, map(float, snr), strict=True))
        ),
    )


def _inverse(information: Array) -> Array:
    """Inverse of an information matrix in units where its diagonal is one; infinite where it is singular."""
    size = np.sqrt(np.diagonal(information))
    if not (size > 0.0).all():
        return np.full_like(information, np.inf)
    scaled = information / np.outer(size, size)
    if np.linalg.cond(scaled) > 1.0 / (information.shape[0] * np.finfo(np.float64).eps):
        return np.full_like(information, np.inf)
    return np.asarray(np.linalg.inv(scaled) / np.outer(size, size))


def _discrete(plant: SensedPlant, dt: float) -> tuple[Array, Array, Array, Array]:
    """Transition (m, m) and input (m, inputs + m) matrices of a step, the states' constants as inputs that follow the
    surfaces, and the sensitivities of both to each derivative, (k, m, m) and (k, m, inputs + m)."""
    m, k = plant.order, plant.derivatives.size
    a0, b0, _, _ = plant.matrices(np.zeros(k))

    def block(a: Array, b: Array, constants: Array) -> Array:
        whole = np.zeros((m + b.shape[1] + m,) * 2)
        whole[:m] = np.hstack([a, b, constants])
        return whole * dt

    a, b, _, _ = plant.matrices(plant.derivatives)
    centre = block(a, b, np.eye(m))
    grown: Array = np.eye(len(centre))
    slopes = np.empty((k, *centre.shape))
    for j in range(k):
        aj, bj, _, _ = plant.matrices(np.eye(k)[j])
        both = expm_frechet(centre, block(aj - a0, bj - b0, np.zeros((m, m))))
        grown, slopes[j] = np.asarray(both[0], dtype=np.float64), both[1]
    return grown[:m, :m], grown[:m, m:], slopes[:, :m, :m], slopes[:, :m, m:]


def _fly(plant: SensedPlant, u: Array, dt: float) -> tuple[Array, Array, Array]:
    """States (n, m), outputs (n, p) and the information matrix of derivatives, constants, accelerometer, start."""
    m, k, nu = plant.order, plant.derivatives.size, u.shape[1]
    f, g, df, dg = _discrete(plant, dt)
    _, _, c, d = plant.matrices(plant.derivatives)
    _, _, c0, d0 = plant.matrices(np.zeros(k))
    each = [plant.matrices(e) for e in np.eye(k)]
    dc, dd = np.array([o[2] - c0 for o in each]), np.array([o[3] - d0 for o in each])
    count = k + m + int(plant.accelerometer) + m
    slope = np.zeros((m, count))  # of the states
    slope[:, count - m :] = np.eye(m)
    white = np.zeros((m, count))  # what the whitening filter expects of them
    read_constant = np.zeros((len(plant.outputs), count))
    if plant.accelerometer:
        read_constant[len(plant.structure.states), k + m] = 1.0
    noise, kept = _Whitening(plant, f, g[:, :nu], c, d), np.zeros((count, count))
    states, outputs, x = np.empty((len(u), m)), np.empty((len(u), len(c))), np.zeros(m)
    constants = np.zeros((m, count))
    constants[:, k : k + m] = g[:, nu:]
    for i, now in enumerate(u):
        states[i], outputs[i] = x, c @ x + d @ now
        read = c @ slope + read_constant
        read[:, :k] += (dc @ x + dd @ now).T
        error = read - c @ white
        gain, inverse = noise.advance()
        kept += error.T @ inverse @ error
        white = f @ white + gain @ error
        slope = f @ slope + constants
        slope[:, :k] += (df @ x + dg[:, :, :nu] @ now).T
        x = f @ x + g[:, :nu] @ now
    return states, outputs, kept


class _Whitening:
    """The Kalman filter of what a surface's noise does to states and outputs; steady after some steps."""

    def __init__(self, plant: SensedPlant, f: Array, g: Array, c: Array, d: Array) -> None:
        q = np.diag(plant.input_noise_std**2)
        self._f, self._c = f, c
        self._process, self._shared = g @ q @ g.T, g @ q @ d.T
        self._reading = d @ q @ d.T + np.diag(plant.noise_std**2)
        self._cov, self._steady = np.zeros_like(f), False
        self._now: tuple[Array, Array] = (np.zeros((len(f), len(c))), np.zeros((len(c), len(c))))

    def advance(self) -> tuple[Array, Array]:
        """Gain (m, p) of the step that follows, and inverse covariance (p, p) of the present innovation."""
        if self._steady:
            return self._now
        f, c, cov = self._f, self._c, self._cov
        inverse = np.asarray(np.linalg.inv(c @ cov @ c.T + self._reading), dtype=np.float64)
        gain = (f @ cov @ c.T + self._shared) @ inverse
        after = f @ cov @ f.T + self._process - gain @ (c @ cov @ f.T + self._shared.T)
        self._steady = bool(np.abs(after - cov).max() <= 1e-14 * np.abs(after).max())
        self._cov, self._now = 0.5 * (after + after.T), (gain, inverse)
        return self._now


def _quantities(plant: SensedPlant, states: Array, outputs: Array) -> dict[str, Array]:
    at, s = plant.condition, plant.structure
    if not plant.accelerometer:
        level = {"airspeed_true_m_s": at.airspeed_true_m_s, "pitch_rad": at.angle_of_attack_rad}
        return {name: level.get(name, 0.0) + states[:, i] for i, name in enumerate(plant.outputs)}
    accelerometer = outputs[:, len(s.states)]
    if s == SHORT_PERIOD:
        angle = np.arctan2(at.normal_velocity_m_s + states[:, 0], at.forward_velocity_m_s)
        return {
            "angle_of_attack_rad": angle,
            "pitch_rate_rad_s": states[:, 1],
            "load_factor_z": math.cos(at.angle_of_attack_rad) - accelerometer / GRAVITY_M_S2,
        }
    side = np.arctan2(states[:, 0], at.airspeed_true_m_s)
    named = {_RATES[state]: states[:, i] for i, state in enumerate(s.states) if state in _RATES}
    bank = {"roll_rad": states[:, -1]} if plant.order > len(s.states) else {}
    return {"sideslip_rad": side, **named, **bank, "load_factor_y": accelerometer / GRAVITY_M_S2}
