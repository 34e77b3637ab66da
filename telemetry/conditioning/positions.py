"""Sensors that do not sit at the centre of gravity: their readings carried there (thesis 6.2 and 6.3).

The thesis's 6.1 divides the vane's own motion by the airspeed, which holds to first order; here the velocity is put
together again, so the correction is exact at any angle. Specific forces follow 6.3. ``estimators.signals`` applies the
same first-order vane correction inside its pass over a stream.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.windows import slopes
from wingwatch.telemetry.sample import CHANNEL_INDEX, SampleBlock

__all__ = ["at_centre", "flow_at_centre", "forces_at_centre", "lever_matrix"]

Array = NDArray[np.float64]
Position = tuple[float, float, float]

RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
FORCES = ("specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2")


def flow_at_centre(
    airspeed_m_s: Array, alpha_rad: Array, beta_rad: Array, rates_rad_s: Array, vane_position_m: Position
) -> tuple[Array, Array]:
    """Angles of attack and sideslip at the centre of gravity from those at the vane (thesis 6.1, exact).

    With d the flow's direction at the vane, the velocity there is s d = v + omega x r, and |v| is the airspeed:
    s is the larger root of |s d - omega x r| = V. tan(alpha) = w/u, sin(beta) = v/V (6.2).

    Args:
        airspeed_m_s: true airspeed of the centre of gravity, shape (n,).
        alpha_rad: at the vane, shape (n,).
        beta_rad: at the vane, shape (n,); NaN is taken as no sideslip.
        rates_rad_s: p, q, r, shape (n, 3).
        vane_position_m: (x, y, z) from the centre of gravity, body axes.

    Returns:
        alpha and beta, each (n,).
    """
    beta = np.where(np.isfinite(beta_rad), beta_rad, 0.0)
    direction = np.stack(
        [np.cos(alpha_rad) * np.cos(beta), np.sin(beta), np.sin(alpha_rad) * np.cos(beta)], axis=-1
    )
    swing = np.cross(rates_rad_s, np.asarray(vane_position_m))
    along = np.sum(direction * swing, axis=-1)
    speed = along + np.sqrt(np.maximum(airspeed_m_s**2 - np.sum(swing**2, axis=-1) + along**2, 0.0))
    u, v, w = np.moveaxis(speed[:, None] * direction - swing, -1, 0)
    beta_centre = np.arctan2(v, np.hypot(u, w))
    return np.arctan2(w, u), np.where(np.isfinite(beta_rad), beta_centre, np.nan)


def lever_matrix(rates_rad_s: Array, accelerations_rad_s2: Array) -> Array:
    """A with A r = omega-dot x r + omega x (omega x r), shape (n, 3, 3): what a lever r adds to a specific force.

    Args:
        rates_rad_s: p, q, r, shape (n, 3).
        accelerations_rad_s2: their rates, shape (n, 3).
    """
    p, q, r = np.moveaxis(rates_rad_s, -1, 0)
    pd, qd, rd = np.moveaxis(accelerations_rad_s2, -1, 0)
    rows = [
        [-(q * q + r * r), p * q - rd, p * r + qd],
        [p * q + rd, -(p * p + r * r), q * r - pd],
        [p * r - qd, q * r + pd, -(p * p + q * q)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def forces_at_centre(
    forces_m_s2: Array, rates_rad_s: Array, accelerations_rad_s2: Array, imu_position_m: Position
) -> Array:
    """Specific forces at the centre of gravity from those at the accelerometers, shape (n, 3) (thesis 6.3).

    Args:
        forces_m_s2: a_x, a_y, a_z at the accelerometers, shape (n, 3).
        rates_rad_s: p, q, r, shape (n, 3).
        accelerations_rad_s2: their rates, shape (n, 3).
        imu_position_m: (x, y, z) of the accelerometers from the centre of gravity, body axes.
    """
    return np.asarray(
        forces_m_s2 - lever_matrix(rates_rad_s, accelerations_rad_s2) @ np.asarray(imu_position_m)
    )


def at_centre(block: SampleBlock, vane_position_m: Position, imu_position_m: Position) -> SampleBlock:
    """A table whose flow angles and specific forces are those of the centre of gravity.

    Angular accelerations are slopes of the rates (``windows.slopes``), so forces are NaN in windows of fewer
    than seven samples when the accelerometers sit elsewhere. A position of zeros leaves its channels to the bit.
    """
    values = block.values.copy()
    columns = {name: CHANNEL_INDEX[name] for name in (*RATES, *FORCES)}
    rates = values[:, [columns[n] for n in RATES]]
    alpha, beta = CHANNEL_INDEX["angle_of_attack_rad"], CHANNEL_INDEX["sideslip_rad"]
    if any(vane_position_m):
        airspeed = values[:, CHANNEL_INDEX["airspeed_true_m_s"]]
        values[:, alpha], values[:, beta] = flow_at_centre(
            airspeed, values[:, alpha], values[:, beta], rates, vane_position_m
        )
    if any(imu_position_m):
        forces = [columns[n] for n in FORCES]
        spin = slopes(block.time_s, rates)
        values[:, forces] = forces_at_centre(values[:, forces], rates, spin, imu_position_m)
    return SampleBlock(values)
