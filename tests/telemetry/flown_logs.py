"""A simulated flight as autopilots would have logged it: their topics, rates, units and signs, time on the ground."""

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from written_logs import Flash, FlashTopic, Ulog, UlogTopic

from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import SampleBlock

Array = NDArray[Any]

TRAVEL_RAD = 0.3927  # the aerosonde file's
GROUND_S = 12.0
START_S = 30.0  # since boot, when the log begins
HEIGHT_M = 120.0  # the flight's above the field

PX4_PARAMETERS: Mapping[str, float] = {
    "MAV_TYPE": 1, "CA_SV_CS_COUNT": 4,
    "CA_SV_CS0_TYPE": 1, "CA_SV_CS0_TRQ_R": -0.5, "CA_SV_CS1_TYPE": 2, "CA_SV_CS1_TRQ_R": 0.5,
    "CA_SV_CS2_TYPE": 3, "CA_SV_CS2_TRQ_P": 1.0, "CA_SV_CS3_TYPE": 4, "CA_SV_CS3_TRQ_Y": 1.0,
}  # fmt: skip

SERVOS: Mapping[str, tuple[int, int, int, int, int]] = {
    "AILERON": (1, 4, 1100, 1520, 1900), "ELEVATOR": (2, 19, 1150, 1480, 1930),
    "THROTTLE": (3, 70, 1000, 1000, 2000), "RUDDER": (4, 21, 1080, 1500, 1890),
}  # fmt: skip
"""Output, function, MIN, TRIM and MAX; the elevator is reversed."""

REVERSED = ("ELEVATOR",)

_IMU = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,GH,AH"


def ardupilot_parameters() -> dict[str, float]:
    parameters: dict[str, float] = {}
    for name, (number, function, low, trim, high) in SERVOS.items():
        values = {
            "FUNCTION": function,
            "MIN": low,
            "TRIM": trim,
            "MAX": high,
            "REVERSED": int(name in REVERSED),
        }
        parameters |= {f"SERVO{number}_{key}": float(value) for key, value in values.items()}
    return parameters


@functools.cache
def flown(seconds: float = 60.0, noise: bool = True) -> SampleBlock:
    """The demonstration's healthy aircraft: doublets of all surfaces every 20 s."""
    scenario = next(s for s in demo_fleet() if s.name == "healthy")
    return simulate(replace(scenario, noise=noise), seconds)


def on_the_ground_first(block: SampleBlock, seconds: float = GROUND_S) -> dict[str, Array]:
    """The flight's columns behind some time at rest on the field below; stamps since boot."""
    step = float(np.median(np.diff(block.time_s)))
    rest = round(seconds / step)
    still = dict.fromkeys(block.present, 0.0) | {
        "specific_force_z_m_s2": -9.81, "altitude_m": float(block.column("altitude_m")[0]) - HEIGHT_M,
        "latitude_deg": 50.0, "longitude_deg": 10.0, "air_density_kg_m3": 1.12,
    }  # fmt: skip
    columns = {n: np.concatenate((np.full(rest, still[n]), block.column(n))) for n in block.present}
    columns["time_s"] = START_S + step * np.arange(rest + len(block))
    return columns


def pressure_pa(altitude_m: Array) -> Array:
    """Of the standard atmosphere's troposphere."""
    return 101325.0 * (1.0 - 0.0065 * altitude_m / 288.15) ** 5.255880


def calibrated(columns: Mapping[str, Array]) -> Array:
    """What a pitot shows of the true airspeed, incompressible."""
    return columns["airspeed_true_m_s"] * np.sqrt(columns["air_density_kg_m3"] / 1.225)


def quaternion(roll: Array, pitch: Array, heading: Array) -> Array:
    """Earth to body, real part first, shape (rows, 4)."""
    r, p, h = roll / 2.0, pitch / 2.0, heading / 2.0
    cr, sr, cp, sp, ch, sh = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(h), np.sin(h)
    return np.stack(
        (
            cr * cp * ch + sr * sp * sh,
            sr * cp * ch - cr * sp * sh,
            cr * sp * ch + sr * cp * sh,
            cr * cp * sh - sr * sp * ch,
        ),
        axis=1,
    )


def px4_log(columns: Mapping[str, Array], servo_every: int = 1) -> Ulog:
    """As PX4 1.14 logs it; nose up, roll right and yaw right are positive commands."""
    us = np.round(columns["time_s"] * 1e6).astype(np.int64)
    rows = np.arange(us.size)

    def topic(name: str, every: int, fields: list[tuple[str, str, Array]]) -> UlogTopic:
        return UlogTopic(name, us[::every].tolist(), [(kind, n, v[rows[::every]]) for kind, n, v in fields])

    rates = np.stack([columns[f"{axis}_rate_rad_s"] for axis in ("roll", "pitch", "yaw")], axis=1)
    force = np.stack([columns[f"specific_force_{axis}_m_s2"] for axis in "xyz"], axis=1)
    attitude = quaternion(columns["roll_rad"], columns["pitch_rad"], columns["heading_rad"])
    aileron, elevator, rudder = (
        -columns[f"{s}_command_rad"] / TRAVEL_RAD for s in ("aileron", "elevator", "rudder")
    )
    # right aileron up rolls to the right: the right servo goes with the roll command, the left against it
    servos = np.full((us.size, 8), np.nan)
    servos[:, 0], servos[:, 1], servos[:, 2], servos[:, 3] = -aileron, aileron, elevator, rudder
    motors = np.full((us.size, 12), np.nan)
    motors[:, 0] = columns["throttle"]
    pitot = calibrated(columns)
    selected = np.ones(us.size)
    return Ulog(
        [
            topic("vehicle_angular_velocity", 1, [("uint64_t", "timestamp_sample", us), ("float", "xyz", rates)]),
            topic("vehicle_acceleration", 1, [("uint64_t", "timestamp_sample", us), ("float", "xyz", force)]),
            topic("vehicle_attitude", 1, [("uint64_t", "timestamp_sample", us), ("float", "q", attitude)]),
            topic("airspeed_validated", 5, [
                ("float", "calibrated_airspeed_m_s", pitot), ("float", "true_airspeed_m_s", 1.1 * pitot),
                ("int8_t", "selected_airspeed_index", selected),
            ]),
            topic("vehicle_air_data", 5, [
                ("float", "baro_pressure_pa", pressure_pa(columns["altitude_m"])),
                ("float", "baro_temp_celcius", np.full(us.size, 46.0)),
            ]),
            topic("actuator_servos", servo_every, [("float", "control", servos)]),
            topic("actuator_motors", servo_every, [("float", "control", motors)]),
            topic("vehicle_gps_position", 10, [
                ("double", "latitude_deg", columns["latitude_deg"]),
                ("double", "longitude_deg", columns["longitude_deg"]),
                ("float", "vel_n_m_s", columns["velocity_north_m_s"]),
                ("float", "vel_e_m_s", columns["velocity_east_m_s"]),
                ("float", "vel_d_m_s", columns["velocity_down_m_s"]),
            ]),
        ],
        PX4_PARAMETERS,
    )  # fmt: skip


def servo_us(name: str, fraction: Array) -> Array:
    """Microseconds of an output: each side of the trim has a travel of its own."""
    _, _, low, trim, high = SERVOS[name]
    turned = -fraction if name in REVERSED else fraction
    return np.where(turned >= 0.0, trim + turned * (high - trim), trim + turned * (trim - low))


def ardupilot_log(columns: Mapping[str, Array], servo_every: int = 1) -> Flash:
    """As ArduPlane 4.3 logs it; nose up, roll right and yaw right are positive outputs."""
    us = np.round(columns["time_s"] * 1e6).astype(np.int64)

    def topic(name: str, codes: str, names: str, every: int, cells: list[Array]) -> FlashTopic:
        kinds = [float if c in "fd" else int for c in codes[1:]]
        rows = [
            (int(us[i]), *(k(c[i]) for k, c in zip(kinds, cells, strict=True)))
            for i in range(0, us.size, every)
        ]
        return FlashTopic(name, codes, names, rows)

    imu = [columns[f"{a}_rate_rad_s"] for a in ("roll", "pitch", "yaw")]
    imu += [columns[f"specific_force_{a}_m_s2"] for a in "xyz"]
    degrees = [np.degrees(columns[n]) for n in ("roll_rad", "pitch_rad")]
    degrees.append(np.degrees(columns["heading_rad"]) % 360.0)
    zero, one = np.zeros(us.size), np.ones(us.size)
    fractions = {
        n: -columns[f"{n.lower()}_command_rad"] / TRAVEL_RAD for n in ("AILERON", "ELEVATOR", "RUDDER")
    }
    outputs = {n: np.round(servo_us(n, f)) for n, f in fractions.items()}
    outputs["THROTTLE"] = np.round(1000.0 + 1000.0 * columns["throttle"])
    north, east = columns["velocity_north_m_s"], columns["velocity_east_m_s"]
    return Flash(
        [
            topic("IMU", "QBffffffBB", _IMU, 1, [zero, *imu, one, one]),
            topic("IMU", "QBffffffBB", _IMU, 1, [one, *(7 * c for c in imu), one, one]),
            topic("ATT", "Qfff", "TimeUS,Roll,Pitch,Yaw", 2, degrees),
            topic("ARSP", "QBfBB", "TimeUS,I,Airspeed,H,U", 5, [zero, calibrated(columns), one, one]),
            topic("BARO", "QBffcB", "TimeUS,I,Alt,Press,Temp,H", 5, [
                zero, columns["altitude_m"] - columns["altitude_m"][0], pressure_pa(columns["altitude_m"]),
                4600 * one, one,
            ]),
            topic("RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4", servo_every, [outputs[n] for n in SERVOS]),
            topic("GPS", "QBBLLeffff", "TimeUS,I,Status,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw", 10, [
                zero, 3 * one, np.round(columns["latitude_deg"] * 1e7), np.round(columns["longitude_deg"] * 1e7),
                np.round(columns["altitude_m"] * 100), np.hypot(north, east),
                np.degrees(np.arctan2(east, north)) % 360.0,
                columns["velocity_down_m_s"], zero,
            ]),
        ],
        ardupilot_parameters(),
    )  # fmt: skip
