"""A flight out of a telemetry log, written by the ground stations' own library: units, signs and clocks of MAVLink."""

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown_logs import (
    TRAVEL_RAD,
    ardupilot_parameters,
    calibrated,
    flown,
    on_the_ground_first,
    pressure_pa,
    servo_us,
)
from numpy.typing import NDArray

from wingwatch.telemetry import LogError, load_flight

dialect: Any = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")

Columns = Mapping[str, NDArray[Any]]
TRAVEL = dict.fromkeys(("elevator_rad", "aileron_rad", "rudder_rad"), TRAVEL_RAD)
LINK_S = 0.04


def link_log(columns: Columns, kind: int = 1) -> bytes:
    """An ArduPlane over a link that is 40 ms late."""
    vehicle, out = dialect.MAVLink(None, srcSystem=1, srcComponent=1), []

    def send(time_s: float, message: Any) -> None:
        out.append(struct.pack(">Q", round((1.7e9 + time_s + LINK_S) * 1e6)) + bytes(message.pack(vehicle)))

    for name, value in ardupilot_parameters().items():
        send(float(columns["time_s"][0]), dialect.MAVLink_param_value_message(name.encode(), value, 9, 20, 0))
    fractions = {
        n: -columns[f"{n.lower()}_command_rad"] / TRAVEL_RAD for n in ("AILERON", "ELEVATOR", "RUDDER")
    }
    us = {n: np.round(servo_us(n, f)).astype(int) for n, f in fractions.items()}
    c = {name: values.tolist() for name, values in columns.items()}
    pitot, pressure = calibrated(columns).tolist(), (pressure_pa(columns["altitude_m"]) / 100.0).tolist()
    for i, t in enumerate(c["time_s"]):
        ms = round(t * 1e3)
        rates = [c[f"{axis}_rate_rad_s"][i] for axis in ("roll", "pitch", "yaw")]
        force = [round(c[f"specific_force_{axis}_m_s2"][i] / 9.80665 * 1000) for axis in "xyz"]
        angles = [c[name][i] for name in ("roll_rad", "pitch_rad", "heading_rad")]
        send(t, dialect.MAVLink_attitude_message(ms, *angles, *rates))
        send(t, dialect.MAVLink_scaled_imu_message(ms, *force, 0, 0, 0, 0, 0, 0))
        if i % 5:
            continue
        servos = (int(us["AILERON"][i]), int(us["ELEVATOR"][i]), 1780, int(us["RUDDER"][i]))
        send(t, dialect.MAVLink_servo_output_raw_message(round(t * 1e6), 0, *servos, 0, 0, 0, 0))
        send(t, dialect.MAVLink_vfr_hud_message(pitot[i], 25.0, 0, 78, 0.0, 0.0))
        send(t, dialect.MAVLink_scaled_pressure_message(ms, pressure[i], 0.0, 4600))
        send(t, dialect.MAVLink_heartbeat_message(kind, 3, 0, 0, 0, 3))
    return b"".join(out)


def test_a_flight_over_a_link_is_what_flew(tmp_path: Path) -> None:
    path, truth = tmp_path / "flight.tlog", flown(20.0, noise=False)
    path.write_bytes(link_log(on_the_ground_first(truth)))
    flight = load_flight(path, None, TRAVEL)
    time_s = flight.block.time_s
    # the surfaces come ten times a second and are the clock; what is faster is low-pass filtered
    assert np.median(np.diff(time_s)) == pytest.approx(0.1, abs=1e-6)
    inside = (time_s > 43.0) & (time_s < 42.0 + truth.time_s[-1] - 1.0)

    def flown_(name: str) -> np.ndarray:
        return np.asarray(np.interp(time_s[inside] - 42.0, truth.time_s, truth.column(name)))

    for name, limit in {
        "pitch_rate_rad_s": 0.01, "roll_rad": 0.005, "specific_force_z_m_s2": 0.2, "airspeed_true_m_s": 0.05,
        "altitude_m": 0.05,
    }.items():  # fmt: skip
        error = np.abs(flight.block.column(name)[inside] - flown_(name))
        assert np.nanmedian(error) < limit, name
    for surface in ("elevator", "aileron", "rudder"):
        given = truth.column(f"{surface}_command_rad")
        last = np.searchsorted(truth.time_s, time_s[inside] - 42.0 + 0.001, side="right") - 1
        error = np.abs(flight.block.column(f"{surface}_rad")[inside] - given[last])
        assert np.nanmax(error) < 1e-3, surface
    assert flight.quality["airspeed_indicated_m_s"] == "derived"  # the packet does not say what is behind it
    assert flight.kinds["elevator_rad"] == "command"
    assert np.nanmedian(flight.block.column("throttle")) == pytest.approx(0.78)


def test_a_multicopters_link_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(link_log(on_the_ground_first(flown(2.0)), kind=2))
    with pytest.raises(LogError, match="this is a multicopter's log"):
        load_flight(path, None, TRAVEL)
