"""Plants of two and four degrees of freedom for the diagnosis benchmark: linear aerodynamics, exact kinematics.

A plant is a rigid body whose aerodynamic forces and moments go linearly with (w, q, eta) and (v, p, r, xi, zeta) by
concise derivatives, and whose forward velocity u is held at U. Moved from trim by the elevator alone it is the short
period; by aileron and rudder the lateral motion of four degrees of freedom; held from rolling, the Dutch roll of two.
With p, q, r and the Euler angles the equations are

    dv/dt = Y + p w - r U + g cos(theta) sin(phi)        Y = y_v v + (y_p - W) p + (y_r + U) r + y_xi xi + y_zeta zeta
    dw/dt = Z + q U - p v + g cos(theta) cos(phi)        Z = -g cos(theta_0) + z_w w' + (z_q - U) q + z_eta eta'
    dp/dt = l_v v + ... + (I_y - I_z) / I_x q r          dq/dt = m_w w' + m_q q + m_eta eta' + (I_z - I_x) / I_y p r
    dr/dt = n_v v + ... + (I_x - I_y) / I_z p q

w' and eta' from trim, velocities through the air in Y, Z and the moments. Accelerometers read Y, Z and the force along
x that holds u.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from diagnosis_air import Servo, Surfaces
from diagnosis_hidden import Array
from diagnosis_inputs import RATE_HZ
from diagnosis_readings import Motion

from wingwatch.aircraft import GRAVITY_M_S2, FlightCondition, Geometry, Mass
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS

__all__ = ["BASES", "SURFACE_SYMBOLS", "Plant", "plant_motion"]

SURFACE_SYMBOLS = {"elevator": "eta", "aileron": "xi", "rudder": "zeta"}
_STEPS = 2
"""Of Runge and Kutta's method a sample."""
_STATE = ("v", "w", "p", "q", "r", "phi", "theta", "psi", "h")


@dataclass(frozen=True, slots=True)
class Plant:
    """One aircraft at one condition.

    Attributes:
        name: of the aircraft file.
        condition: with the angle of attack of its trim.
        derivatives: concise, of ``SHORT_PERIOD`` and ``LATERAL``.
        geometry, mass: None where none are stated; the plant then has the inertia of a body alike about all axes.
        trim_elevator_rad: there.
        rolls: whether it can roll; else it is held wings level.
    """

    name: str
    condition: FlightCondition
    derivatives: Mapping[str, float]
    geometry: Geometry | None
    mass: Mass | None
    trim_elevator_rad: float = 0.0
    rolls: bool = True


def _derivatives(short: Sequence[float], lateral: Sequence[Sequence[float]]) -> dict[str, float]:
    """Rows z, m by w, q, eta and rows y, l, n by v, p, r, xi, zeta."""
    names = [f"{row}_{x}" for row in "zm" for x in ("w", "q", "eta")]
    names += [f"{row}_{x}" for row in "yln" for x in ("v", "p", "r", "xi", "zeta")]
    return dict(zip(names, [*short, *(value for row in lateral for value in row)], strict=True))


BASES: Mapping[str, Plant] = {
    "small": Plant(
        "plant-small", FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.055),
        _derivatives(
            (-4.15, 24.3, -2.4, -4.3, -6.0, -32.0),
            ((-0.64, 1.37, -25.0, -1.4, 3.5), (-4.2, -20.7, 10.0, -120.0, 2.2), (0.68, -2.7, -1.04, -4.7, -22.0)),
        ),
        Geometry(wing_area_m2=0.55, span_m=2.9, mean_chord_m=0.19),
        Mass(mass_kg=10.4, inertia_x_kg_m2=0.8, inertia_y_kg_m2=1.1, inertia_z_kg_m2=1.75),
        -0.05,
    ),
    "commuter": Plant(
        "plant-commuter", FlightCondition(65.0, 1500.0, angle_of_attack_rad=0.03),
        _derivatives(
            (-1.66, 59.2, -11.5, -0.112, -2.9, -9.7),
            ((-0.175, 1.9, -63.8, 0.0, 2.84), (-0.094, -6.1, 0.66, -11.9, 0.89), (0.052, -0.51, -0.96, -0.4, -4.4)),
        ),
        Geometry(wing_area_m2=39.0, span_m=19.8, mean_chord_m=1.98),
        Mass(mass_kg=4600.0, inertia_x_kg_m2=21700.0, inertia_y_kg_m2=31000.0, inertia_z_kg_m2=48500.0),
    ),
    "jetstream": Plant(
        "plant-jetstream", FlightCondition(87.4, 1853.0, angle_of_attack_rad=0.02),
        _derivatives(
            (-1.002, 86.17, -12.38, -0.080, -1.547, -14.00),
            ((-0.137, 1.7, -88.004, 0.0, 4.865), (-0.09, -4.5, 1.2, -12.0, 1.1), (0.153, -0.25, -0.049, -0.6, -8.98)),
        ),
        None, None,
    ),
}  # fmt: skip
"""Like an Aerosonde (thesis tables 7.2 and 7.7), a Twin Otter, and the Jetstream: thesis tables 9.5 and 9.7 as printed,
what they leave open filled in by hand."""


class _Equations:
    """dx/dt of one plant, scalars throughout."""

    def __init__(self, plant: Plant) -> None:
        at, d = plant.condition, plant.derivatives
        u, w = at.forward_velocity_m_s, at.normal_velocity_m_s
        self.forward, self.normal, self.trim_pitch = u, w, at.angle_of_attack_rad
        self.rolls, self.trim_elevator = plant.rolls, plant.trim_elevator_rad
        known = {"z_q": u, "y_p": w, "y_r": -u}
        own = {name: value - known.get(name, 0.0) for name, value in d.items()}
        self.z, self.m = (tuple(own[f"{row}_{x}"] for x in ("w", "q", "eta")) for row in "zm")
        self.side, self.roll, self.yaw = (
            tuple(own[f"{row}_{x}"] for x in ("v", "p", "r", "xi", "zeta")) for row in "yln"
        )
        x, y, z = (1.0, 1.0, 1.0)
        if plant.mass is not None:
            x, y, z = plant.mass.inertia_x_kg_m2, plant.mass.inertia_y_kg_m2, plant.mass.inertia_z_kg_m2
        self.gyroscopic = (y - z) / x, (z - x) / y, (x - y) / z
        self.lift = -GRAVITY_M_S2 * math.cos(self.trim_pitch)

    def loads(self, x: Sequence[float], surface: Sequence[float], air: Sequence[float]) -> tuple[float, ...]:
        """Y, Z, m/s2, and moments over inertia l, m, n, rad/s2; ``air``: its velocity to the right and down, m/s."""
        v, w, q = x[0] - air[0], x[1] - self.normal - air[1], x[3]
        p, r, xi, zeta, eta = x[2], x[4], surface[1], surface[2], surface[0] - self.trim_elevator
        (z_w, z_q, z_eta), (m_w, m_q, m_eta), side, roll, yaw = self.z, self.m, self.side, self.roll, self.yaw
        return (
            side[0] * v + side[1] * p + side[2] * r + side[3] * xi + side[4] * zeta,
            z_w * w + z_q * q + z_eta * eta + self.lift,
            roll[0] * v + roll[1] * p + roll[2] * r + roll[3] * xi + roll[4] * zeta,
            m_w * w + m_q * q + m_eta * eta,
            yaw[0] * v + yaw[1] * p + yaw[2] * r + yaw[3] * xi + yaw[4] * zeta,
        )

    def rates(self, x: Sequence[float], surface: Sequence[float], air: Sequence[float]) -> list[float]:
        """d/dt of ``_STATE``."""
        u = self.forward
        v, w, p, q, r, phi, theta, _, _ = x
        y, z, roll, pitch, yaw = self.loads(x, surface, air)
        by_x, by_y, by_z = self.gyroscopic
        sin_phi, cos_phi, sin_theta, cos_theta = (
            math.sin(phi),
            math.cos(phi),
            math.sin(theta),
            math.cos(theta),
        )
        turn, down = q * sin_phi + r * cos_phi, GRAVITY_M_S2 * cos_theta
        return [
            y + p * w - r * u + down * sin_phi,
            z + q * u - p * v + down * cos_phi,
            roll + by_x * q * r if self.rolls else 0.0,
            pitch + by_y * p * r,
            yaw + by_z * p * q,
            p + sin_theta / cos_theta * turn if self.rolls else 0.0,
            q * cos_phi - r * sin_phi,
            turn / cos_theta,
            u * sin_theta - (v * sin_phi + w * cos_phi) * cos_theta,
        ]

    def step(
        self, x: list[float], surface: Sequence[Sequence[float]], air: Sequence[Sequence[float]], dt: float
    ) -> list[float]:
        """One step of Runge and Kutta's method; surfaces and air at its start, middle and end."""
        k1 = self.rates(x, surface[0], air[0])
        k2 = self.rates([a + 0.5 * dt * b for a, b in zip(x, k1, strict=True)], surface[1], air[1])
        k3 = self.rates([a + 0.5 * dt * b for a, b in zip(x, k2, strict=True)], surface[1], air[1])
        k4 = self.rates([a + dt * b for a, b in zip(x, k3, strict=True)], surface[2], air[2])
        return [
            a + dt / 6.0 * (b + 2.0 * c + 2.0 * d + e)
            for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)
        ]


def plant_motion(
    plant: Plant, inputs: Array, servos: Sequence[Servo], holds: tuple[float, float], air: Array | None
) -> Motion:
    """A flight from trim as it is, and its record without sensors.

    Args:
        plant: the aircraft.
        inputs: added to the trim's commands, rad, (samples, 3).
        servos: of elevator, aileron and rudder.
        holds: elevator and aileron per radian off the trim's pitch and bank.
        air: velocity of the air to the right and down, m/s, (samples, 2), on straight lines between; still where None.
    """
    equations, dt = _Equations(plant), 1.0 / (RATE_HZ * _STEPS)
    surfaces = Surfaces(servos, (plant.trim_elevator_rad, 0.0, 0.0), 0.5 * dt)
    level = [at - servo.offset_rad for at, servo in zip(surfaces.at, servos, strict=True)]
    x = [0.0] * len(_STATE)
    x[1], x[6], x[8] = equations.normal, equations.trim_pitch, plant.condition.altitude_m
    rows, rates, commands, positions, forces = [], [], [], [], []
    gust = np.zeros((len(inputs), 2)) if air is None else air
    for added, here, there in zip(inputs.tolist(), gust, [*gust[1:], gust[-1]], strict=True):
        blown = here.tolist()
        command = [trimmed + more for trimmed, more in zip(level, added, strict=True)]
        command[0] += holds[0] * (x[6] - equations.trim_pitch)
        command[1] += holds[1] * x[5]
        rows.append(x)
        positions.append(list(surfaces.at))
        commands.append(command)
        forces.append(equations.loads(x, surfaces.at, blown)[:2])
        rates.append(equations.rates(x, surfaces.at, blown))
        for part in range(_STEPS):
            along = (part + np.array([0.0, 0.5, 1.0]))[:, None] / _STEPS
            air_now = (here + along * (there - here)).tolist()
            moved = [list(surfaces.at)]
            for _ in range(2):
                surfaces.move(command)
                moved.append(list(surfaces.at))
            x = equations.step(x, moved, air_now, dt)
    record = [np.array(part) for part in (rows, rates, commands, positions, forces)]
    return _recorded(plant, equations, record, gust)


def _recorded(plant: Plant, equations: _Equations, record: Sequence[Array], gust: Array) -> Motion:
    """Flight table, angular accelerations and velocity through the air of a flight."""
    x, rates, commands, positions, forces = record
    v, w, p, q, r, phi, theta, psi, altitude = x.T
    u = np.full(len(x), equations.forward)
    through = np.stack([u, v - gust[:, 0], w - gust[:, 1]], axis=1)
    columns: dict[str, Array | float] = {
        "time_s": np.arange(len(x)) / RATE_HZ,
        "airspeed_true_m_s": np.linalg.norm(through, axis=1),
        "roll_rate_rad_s": p, "pitch_rate_rad_s": q, "yaw_rate_rad_s": r,
        "specific_force_x_m_s2": GRAVITY_M_S2 * np.sin(theta) + q * w - r * v,
        "specific_force_y_m_s2": forces[:, 0], "specific_force_z_m_s2": forces[:, 1],
        "roll_rad": phi, "pitch_rad": theta, "heading_rad": np.arctan2(np.sin(psi), np.cos(psi)),
        "angle_of_attack_rad": np.arctan2(through[:, 2], u),
        "sideslip_rad": np.arctan2(through[:, 1], np.hypot(u, through[:, 2])),
        "altitude_m": altitude, "air_density_kg_m3": plant.condition.air_density_kg_m3,
    }  # fmt: skip
    for j, surface in enumerate(SURFACE_SYMBOLS):
        columns |= {f"{surface}_rad": positions[:, j], f"{surface}_command_rad": commands[:, j]}
    table = np.full((len(x), len(CHANNELS)), np.nan)
    for name, column in columns.items():
        table[:, CHANNEL_INDEX[name]] = column
    return Motion(table, rates[:, 2:5], through)
