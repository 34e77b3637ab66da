"""Vehicles on a MAVLink link, written by pymavlink: packets of a flight with the time at which each is sent."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from flown_logs import TRAVEL_RAD, ardupilot_parameters, calibrated, pressure_pa, servo_us
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wingwatch.telemetry import SampleBlock
from wingwatch.telemetry.mavlink import LinkReceiver, Piece

Columns = Mapping[str, NDArray[Any]]
Timed = tuple[float, bytes]
"""When a packet is sent on the vehicle's clock, and the packet."""

TRAVEL = dict.fromkeys(("elevator_rad", "aileron_rad", "rudder_rad"), TRAVEL_RAD)
LINK_S = 0.03
STEP_S = 0.25


@dataclass
class MavlinkVehicle:
    """An ArduPlane that sends a flight.

    ``every`` is how many instants of the flight lie between two messages of a name.
    """

    system: int = 1
    kind: int = 1
    every: Mapping[str, int] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=ardupilot_parameters)

    def __post_init__(self) -> None:
        self.link = dialect.MAVLink(None, srcSystem=self.system, srcComponent=1)

    def packed(self, message: Any) -> bytes:
        data = bytes(message.pack(self.link))
        self.link.seq = (self.link.seq + 1) % 256
        return data

    def heartbeat(self) -> bytes:
        return self.packed(dialect.MAVLink_heartbeat_message(self.kind, 3, 0, 0, 0, 3))

    def first(self) -> list[bytes]:
        """Parameters, and a heartbeat."""
        values = self.parameters.items()
        made = [dialect.MAVLink_param_value_message(n.encode(), v, 9, 20, 0) for n, v in values]
        return [*map(self.packed, made), self.heartbeat()]

    def flight(self, columns: Columns) -> Iterator[Timed]:
        """All packets, in their order; what carries no stamp leaves 3 ms after the instant it is of."""
        yield from ((float(columns["time_s"][0]), data) for data in self.first())
        for i, t in enumerate(columns["time_s"].tolist()):
            for name, message in self._messages(columns, i).items():
                if i % self.every.get(name, 1) == 0:
                    yield t + 0.003, self.packed(message)
            if i % 50 == 0:
                yield t + 0.003, self.heartbeat()

    def _messages(self, columns: Columns, i: int) -> dict[str, Any]:
        row = {name: float(values[i]) for name, values in columns.items()}
        t = row["time_s"]
        ms = round(t * 1e3)
        rates = [row[f"{axis}_rate_rad_s"] for axis in ("roll", "pitch", "yaw")]
        force = [round(row[f"specific_force_{axis}_m_s2"] / 9.80665 * 1000) for axis in "xyz"]
        angles = [row[name] for name in ("roll_rad", "pitch_rad", "heading_rad")]
        us = [
            round(float(servo_us(n, np.array(-row[f"{n.lower()}_command_rad"] / TRAVEL_RAD))))
            for n in ("AILERON", "ELEVATOR", "RUDDER")
        ]
        pitot = float(calibrated({n: np.array(v) for n, v in row.items()}))
        pressure = float(pressure_pa(np.array(row["altitude_m"]))) / 100.0
        servos = (us[0], us[1], 1780, us[2])
        return {
            "ATTITUDE": dialect.MAVLink_attitude_message(ms, *angles, *rates),
            "SCALED_IMU": dialect.MAVLink_scaled_imu_message(ms, *force, 0, 0, 0, 0, 0, 0),
            "SERVO_OUTPUT_RAW": dialect.MAVLink_servo_output_raw_message(
                round(t * 1e6) % 2**32, 0, *servos, 0, 0, 0, 0
            ),
            "VFR_HUD": dialect.MAVLink_vfr_hud_message(pitot, 25.0, 0, 78, 0.0, 0.0),
            "SCALED_PRESSURE": dialect.MAVLink_scaled_pressure_message(ms, pressure, 0.0, 4600),
        }


def received(
    packets: Iterable[Timed],
    names: Mapping[int | None, str] | None = None,
    offset_s: float = 0.0,
    receiver: LinkReceiver | None = None,
) -> tuple[LinkReceiver, dict[str, list[Piece]]]:
    """Packets through a receiver that looks for samples four times a second; pieces by vehicle."""
    names = {None: "uav1"} if names is None else names
    receiver = receiver or LinkReceiver(names, dict.fromkeys(names.values(), TRAVEL))
    pieces: dict[str, list[Piece]] = {name: [] for name in names.values()}
    due_s, now_s = -np.inf, 0.0
    for sent_s, data in packets:
        now_s = sent_s + offset_s + LINK_S
        receiver.feed(data, now_s)
        if now_s >= due_s:
            due_s = now_s + STEP_S
            taken(receiver, now_s, pieces)
    taken(receiver, now_s, pieces, final=True)
    return receiver, pieces


def taken(receiver: LinkReceiver, now_s: float, pieces: dict[str, list[Piece]], final: bool = False) -> None:
    for system in receiver.systems.values():
        pieces[system.vehicle.name] += system.vehicle.step(now_s, final)


def samples(pieces: Sequence[Piece]) -> SampleBlock:
    return SampleBlock.concatenate([piece.block for piece in pieces])
