"""Flights of the linear two-degree-of-freedom plants: short period and Dutch roll, exact, for tests and benchmarks.

The plant is dx/dt = A x + B u with concise derivatives, x measured from trim, u held between samples. Flights made of
it are consistent with the rigid body's kinematics to rounding (no neglected product, gravity constant), so an
estimator that misses the derivatives has itself to blame.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from wingwatch.aircraft import (
    DUTCH_ROLL,
    GRAVITY_M_S2,
    SHORT_PERIOD,
    FlightCondition,
    ModeStructure,
    state_matrix,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = ["linear_flight", "linear_response", "specific_force", "state_rates"]


def _input_matrix(structure: ModeStructure, derivatives: Mapping[str, float]) -> NDArray[np.float64]:
    return np.array([[derivatives[f"{row}_{u}"] for u in structure.inputs] for row in structure.equations])


def _two_states(structure: ModeStructure) -> None:
    if structure not in (SHORT_PERIOD, DUTCH_ROLL):
        raise ValueError(
            f"a linear flight of {structure.name} is not defined; give {SHORT_PERIOD.name} or {DUTCH_ROLL.name}"
        )


def _as_columns(structure: ModeStructure, inputs: ArrayLike) -> NDArray[np.float64]:
    u = np.asarray(inputs, dtype=np.float64)
    u = u[:, np.newaxis] if u.ndim == 1 else u
    if u.ndim != 2 or u.shape[1] != len(structure.inputs):
        raise ValueError(
            f"inputs of {structure.name} have shape (samples, {len(structure.inputs)}), got {np.shape(inputs)}"
        )
    return u


def linear_response(
    structure: ModeStructure,
    derivatives: Mapping[str, float],
    inputs: ArrayLike,
    dt: float,
    initial: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """States of the linear plant, exact by the matrix exponential.

    Args:
        structure: short period or Dutch roll.
        derivatives: concise, by symbol.
        inputs: shape (n, inputs) or (n,), rad from trim; each holds from its sample to the next.
        dt: s between samples.
        initial: state at the first sample, zeros where not given.

    Returns:
        Shape (n, states): m/s and rad/s from trim.

    Raises:
        ValueError: another structure or shape.
        KeyError: a derivative that is missing.
    """
    _two_states(structure)
    u = _as_columns(structure, inputs)
    a, b = state_matrix(structure, derivatives), _input_matrix(structure, derivatives)
    k, m = b.shape
    both = np.zeros((k + m, k + m))
    both[:k, :k], both[:k, k:] = a * dt, b * dt
    grown = expm(both)
    forced = u @ grown[:k, k:].T
    states = np.zeros((len(u), k))
    if len(u):
        states[0] = 0.0 if initial is None else np.asarray(initial, dtype=np.float64)
    transition = grown[:k, :k]
    for i in range(1, len(u)):
        states[i] = transition @ states[i - 1] + forced[i - 1]
    return states


def state_rates(
    structure: ModeStructure, derivatives: Mapping[str, float], states: ArrayLike, inputs: ArrayLike
) -> NDArray[np.float64]:
    """dx/dt = A x + B u, shape (n, states), at states (n, states) and inputs (n, inputs) or (n,)."""
    a, b = state_matrix(structure, derivatives), _input_matrix(structure, derivatives)
    return np.asarray(np.asarray(states, dtype=np.float64) @ a.T + _as_columns(structure, inputs) @ b.T)


def specific_force(
    structure: ModeStructure,
    rates: ArrayLike,
    angular_rate: ArrayLike,
    condition: FlightCondition,
    pitch_rad: float,
) -> NDArray[np.float64]:
    """What an accelerometer at the centre of gravity reads in the mode's plane, m/s2, shape (n,).

    Short period: a_z = dw/dt - U q - g cos(theta); Dutch roll, wings level: a_y = dv/dt + U r (thesis equations 7.1
    and 7.3 with the other rates zero).

    Args:
        structure: short period or Dutch roll.
        rates: dx/dt, shape (n, 2).
        angular_rate: q or r in rad/s, in full (trim included), shape (n,).
        condition: gives U = V cos(alpha).
        pitch_rad: attitude.
    """
    _two_states(structure)
    velocity_rate = np.asarray(rates, dtype=np.float64)[:, 0]
    turn = condition.forward_velocity_m_s * np.asarray(angular_rate, dtype=np.float64)
    if structure == SHORT_PERIOD:
        return np.asarray(velocity_rate - turn - GRAVITY_M_S2 * math.cos(pitch_rad))
    return np.asarray(velocity_rate + turn)


def linear_flight(
    structure: ModeStructure,
    derivatives: Mapping[str, float],
    condition: FlightCondition,
    inputs: ArrayLike,
    rate_hz: float = 50.0,
    *,
    offsets: Mapping[str, float] | None = None,
    noise_std: Mapping[str, float] | None = None,
    rng: np.random.Generator | None = None,
) -> SampleBlock:
    """A flight table whose mode follows the linear plant.

    Short period: level wings, U constant, w = W + offset + w', pitch attitude held, so that gravity is constant. Dutch
    roll: no roll, airspeed and angle of attack constant, v = V sin(beta). Airspeed and vane angles follow from
    the velocity, the accelerometer from ``specific_force``; the other rates are zero, throttle is half.

    Args:
        structure: short period or Dutch roll.
        derivatives: concise, by symbol.
        condition: airspeed, altitude, density and angle of attack of the trim.
        inputs: shape (n, 1) or (n,), rad from trim, held between samples.
        rate_hz: samples a second.
        offsets: trim values that are added to states and input (``w``, ``q``, ``eta`` or ``v``, ``r``, ``zeta``) in
            m/s, rad/s and rad; all else stays consistent with them.
        noise_std: by flight-table column, in its unit.
        rng: of the noise; needed where there is any.

    Raises:
        ValueError: another structure or shape, an offset or a column that is not known, noise without ``rng``.
    """
    _two_states(structure)
    shifts = dict.fromkeys(structure.regressors, 0.0)
    for symbol, value in (offsets or {}).items():
        if symbol not in shifts:
            raise ValueError(f"offset of {symbol!r}; {structure.name} has {', '.join(shifts)}")
        shifts[symbol] = value
    u = _as_columns(structure, inputs)
    states = linear_response(structure, derivatives, u, 1.0 / rate_hz)
    rates = state_rates(structure, derivatives, states, u)
    full = states + [shifts[s] for s in structure.states]
    pitch = condition.angle_of_attack_rad
    force = specific_force(structure, rates, full[:, 1], condition, pitch)
    deflection = u[:, 0] + shifts[structure.inputs[0]]
    block = SampleBlock.from_columns(
        _steady_columns(len(u), rate_hz, condition, pitch)
        | (_short_period if structure == SHORT_PERIOD else _dutch_roll)(full, force, deflection, condition)
    )
    _add_noise(block, noise_std or {}, rng)
    return block


def _steady_columns(
    n: int, rate_hz: float, condition: FlightCondition, pitch_rad: float
) -> dict[str, NDArray[np.float64]]:
    level = {
        "specific_force_x_m_s2": GRAVITY_M_S2 * math.sin(pitch_rad),
        "specific_force_y_m_s2": 0.0,
        "specific_force_z_m_s2": -GRAVITY_M_S2 * math.cos(pitch_rad),
        "airspeed_true_m_s": condition.airspeed_true_m_s,
        "angle_of_attack_rad": condition.angle_of_attack_rad,
        "pitch_rad": pitch_rad,
        "throttle": 0.5,
        "altitude_m": condition.altitude_m,
        "air_density_kg_m3": condition.air_density_kg_m3,
    }
    zero = (
        "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "roll_rad", "heading_rad", "elevator_rad",
        "aileron_rad", "rudder_rad", "sideslip_rad",
    )  # fmt: skip
    columns = {name: np.full(n, value) for name, value in (level | dict.fromkeys(zero, 0.0)).items()}
    return columns | {"time_s": np.arange(n) / rate_hz}


def _short_period(
    full: NDArray[np.float64],
    force: NDArray[np.float64],
    deflection: NDArray[np.float64],
    condition: FlightCondition,
) -> dict[str, NDArray[np.float64]]:
    u, w = condition.forward_velocity_m_s, condition.normal_velocity_m_s + full[:, 0]
    return {
        "airspeed_true_m_s": np.hypot(u, w),
        "angle_of_attack_rad": np.arctan2(w, u),
        "pitch_rate_rad_s": full[:, 1],
        "specific_force_z_m_s2": force,
        "elevator_rad": deflection,
    }


def _dutch_roll(
    full: NDArray[np.float64],
    force: NDArray[np.float64],
    deflection: NDArray[np.float64],
    condition: FlightCondition,
) -> dict[str, NDArray[np.float64]]:
    if (np.abs(full[:, 0]) >= condition.airspeed_true_m_s).any():
        raise ValueError(
            f"side velocity reaches {np.abs(full[:, 0]).max():.3g} m/s at an airspeed of "
            f"{condition.airspeed_true_m_s:g} m/s; give a smaller input"
        )
    return {
        "sideslip_rad": np.arcsin(full[:, 0] / condition.airspeed_true_m_s),
        "yaw_rate_rad_s": full[:, 1],
        "specific_force_y_m_s2": force,
        "rudder_rad": deflection,
    }


def _add_noise(block: SampleBlock, noise_std: Mapping[str, float], rng: np.random.Generator | None) -> None:
    for column, std in noise_std.items():
        if column not in CHANNEL_INDEX:
            raise ValueError(f"noise_std names {column!r}, which is no column of the flight table")
        if rng is None:
            raise ValueError(f"noise_std of {column} is {std}, but no rng is given to draw it from")
        block.values[:, CHANNEL_INDEX[column]] += std * rng.standard_normal(len(block))
