"""One flight of JSBSim: servos, a loop that holds pitch and bank, gusts of our own, and the record of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from diagnosis_air import Servo, Surfaces
from diagnosis_hidden import Array
from diagnosis_inputs import RATE_HZ
from diagnosis_readings import Motion
from jsbsim_aircraft import COMMANDS, Subject, _record
from jsbsim_peer import FT, Peer

from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS

__all__ = ["STEP_HZ", "Holds", "jsbsim_motion"]

STEP_HZ = 250.0
_STEPS = round(STEP_HZ / RATE_HZ)
_VANES = [CHANNEL_INDEX[name] for name in ("angle_of_attack_rad", "sideslip_rad")]
_AIRSPEED = CHANNEL_INDEX["airspeed_true_m_s"]


@dataclass(frozen=True, slots=True)
class Holds:
    """Elevator and aileron per radian off the trim's pitch and bank."""

    pitch: float = 0.15
    bank: float = 0.2


def _blow(peer: Peer, velocity_m_s: Sequence[float]) -> None:
    """The air's velocity over the ground."""
    for name, value in zip(("north", "east", "down"), velocity_m_s, strict=True):
        peer[f"atmosphere/gust-{name}-fps"] = value / FT


def jsbsim_motion(
    subject: Subject, inputs: Array, servos: Sequence[Servo], holds: Holds, air: Array | None
) -> Motion:
    """A flight from trim as it is, and its record without sensors.

    Args:
        subject: the aircraft at its trim.
        inputs: added to the trim's commands, rad, (samples, 3).
        servos: of elevator, aileron and rudder.
        holds: gains of the loop.
        air: velocity of the air over the ground, m/s, (samples, 3), still where None.
    """
    peer, trim, speed = subject.peer, subject.trim, subject.condition.airspeed_true_m_s
    alpha = trim.angle_of_attack_rad
    motion = [speed * math.cos(alpha), 0.0, speed * math.sin(alpha), 0.0, 0.0, 0.0]
    surfaces = Surfaces(servos, (trim.elevator_rad, 0.0, 0.0), 1.0 / STEP_HZ)
    level = [position - servo.offset_rad for position, servo in zip(surfaces.at, servos, strict=True)]
    _blow(peer, (0.0, 0.0, 0.0))
    peer.start(motion, alpha, subject.condition.altitude_m, surfaces.at, trim.thrust_n)
    table = np.full((len(inputs), len(CHANNELS)), np.nan)
    spin, through_air = np.empty((len(inputs), 3)), np.empty((len(inputs), 3))
    for k, added in enumerate(inputs.tolist()):
        _record(peer, np.array(surfaces.at), k / RATE_HZ, table[k])
        spin[k] = peer.accelerations()[3:]
        through_air[k] = [peer[f"velocities/{axis}-aero-fps"] * FT for axis in "uvw"]
        command = [trimmed + more for trimmed, more in zip(level, added, strict=True)]
        command[0] += holds.pitch * (peer["attitude/theta-rad"] - alpha)
        command[1] += holds.bank * peer["attitude/phi-rad"]
        table[k, COMMANDS] = command
        for step in range(_STEPS):
            if air is not None:
                after = air[min(k + 1, len(air) - 1)]
                _blow(peer, (air[k] + (step + 1) / _STEPS * (after - air[k])).tolist())
            surfaces.move(command)
            peer.set_controls(surfaces.at, trim.thrust_n)
            peer.fdm.run()
    _blow(peer, (0.0, 0.0, 0.0))  # else a later trim of the same aircraft meets the last gust
    _add_air_data(table, through_air)
    return Motion(table, spin, through_air)


def _add_air_data(table: Array, through_air: Array) -> None:
    """Airspeed and the vanes' angles from the velocity through the air, in place."""
    u, v, w = through_air.T
    table[:, _AIRSPEED] = np.sqrt(u * u + v * v + w * w)
    table[:, _VANES] = np.stack([np.arctan2(w, u), np.arctan2(v, np.hypot(u, w))], axis=1)
