"""A live MAVLink link: the same samples as the telemetry log of the same stream, whatever happens on the way."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

dialect: Any = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")

from flown_logs import PX4_PARAMETERS, flown, on_the_ground_first, quaternion  # noqa: E402
from mavlink_links import LINK_S, TRAVEL, Columns, MavlinkVehicle, Timed, received, samples  # noqa: E402

from wingwatch.telemetry import SampleBlock, complete, load_flight  # noqa: E402
from wingwatch.telemetry.mavlink import LinkReceiver, LinkRequests  # noqa: E402
from wingwatch.telemetry.mavlink.dialect import layouts  # noqa: E402
from wingwatch.telemetry.mavlink.requests import wanted_parameters  # noqa: E402

SLOW = {"SERVO_OUTPUT_RAW": 5, "VFR_HUD": 5, "SCALED_PRESSURE": 5}
WALL_S = 1.7e9


def flight(seconds: float = 20.0) -> Columns:
    return on_the_ground_first(flown(seconds, noise=True), 4.0)


def in_flight(seconds: float = 12.0, from_s: float = 30.0) -> Columns:
    block = flown(20.0)
    rows = slice(0, round(seconds * 50))
    columns = {name: np.array(block.column(name)[rows]) for name in block.present}
    return columns | {"time_s": from_s + 0.02 * np.arange(rows.stop)}


def tlog(packets: list[Timed]) -> bytes:
    return b"".join(struct.pack(">Q", round((WALL_S + t + LINK_S) * 1e6)) + data for t, data in packets)


def at(block: SampleBlock, stamps: np.ndarray) -> np.ndarray:
    """Rows of these stamps; every one of them must be there."""
    rows = np.searchsorted(block.time_s, stamps - 1e-6)
    assert np.allclose(block.time_s[rows], stamps, atol=1e-9)
    return rows


@pytest.mark.parametrize(
    "every", [SLOW, {"VFR_HUD": 5, "SCALED_PRESSURE": 5}], ids=["surfaces 10 Hz", "all 50 Hz"]
)
def test_a_live_link_gives_what_its_telemetry_log_gives(tmp_path: Path, every: dict[str, int]) -> None:
    packets = list(MavlinkVehicle(every=every).flight(flight()))
    path = tmp_path / "flight.tlog"
    path.write_bytes(tlog(packets))
    read = load_flight(path, None, TRAVEL)
    receiver, pieces = received(packets, offset_s=WALL_S)
    columns = pieces["uav1"][-1].columns
    live = complete(samples(pieces["uav1"]), columns)
    rows = at(live, read.block.time_s)
    assert set(read.wire_columns) - {"airspeed_true_m_s", "air_density_kg_m3"} == set(columns)
    filtered = (
        every is SLOW
    )  # what is faster than the clock passes the low-pass filter, which looks a second ahead
    for name in read.block.present:
        theirs, mine = read.block.column(name), live.column(name)[rows]
        assert np.array_equal(np.isfinite(theirs), np.isfinite(mine)), name
        assert np.isfinite(mine).mean() > 0.9, name
        fast = name.endswith(("rate_rad_s", "roll_rad", "pitch_rad", "heading_rad")) or "force" in name
        allowed = 4e-3 * float(np.nanstd(theirs)) if filtered and fast else 0.0
        assert np.nanmax(np.abs(mine - theirs)) <= allowed, name
    vehicle = receiver.systems[1].vehicle
    assert vehicle.plan is not None
    assert vehicle.plan.table_hz == pytest.approx(10.0 if filtered else 50.0)
    assert not any(vehicle.dropped().values())
    assert sum(one.lost for one in receiver.systems[1].sequences.values()) == 0


def test_values_have_every_digit_of_the_messages() -> None:
    columns = in_flight()
    _, pieces = received(MavlinkVehicle().flight(columns))
    block = samples(pieces["uav1"])
    rows = at(block, columns["time_s"])
    for name in ("pitch_rate_rad_s", "roll_rad", "heading_rad"):
        assert np.array_equal(
            block.column(name)[rows], np.asarray(columns[name], np.float32).astype(float)
        ), name
    force = np.round(columns["specific_force_z_m_s2"] / 9.80665 * 1000) * 0.00980665
    assert np.allclose(block.column("specific_force_z_m_s2")[rows], force, rtol=0, atol=1e-12)
    elevator = block.column("elevator_command_rad")[rows]
    assert np.max(np.abs(elevator - columns["elevator_command_rad"])) < TRAVEL["elevator_rad"] / 300.0


def test_lost_packets_leave_gaps_and_repeated_ones_nothing() -> None:
    columns, random = in_flight(), np.random.default_rng(44)
    whole = list(MavlinkVehicle().flight(columns))
    first = len(MavlinkVehicle().first())
    kept = [one for k, one in enumerate(whole) if k < first or random.random() > 0.05]
    twice = [again for one in kept for again in ([one, one] if random.random() < 0.1 else [one])]
    receiver, pieces = received(twice)
    system, block = receiver.systems[1], samples(pieces["uav1"])
    sequence = system.sequences[1]
    lost_at_end = len(whole) - 1 - whole.index(kept[-1])
    assert sequence.lost == len(whole) - len(kept) - lost_at_end
    assert sequence.repeated == len(twice) - len(kept)
    # a row per attitude that came; what lacks a neighbour is interpolated over half a second at most
    _, undisturbed = received(whole)
    reference = samples(undisturbed["uav1"])
    rows = at(reference, block.time_s)
    assert np.array_equal(block.column("pitch_rate_rad_s"), reference.column("pitch_rate_rad_s")[rows])
    assert len(block) > 0.9 * len(reference)
    assert np.isfinite(block.column("specific_force_z_m_s2")).mean() > 0.99


def test_nothing_is_bridged_over_a_long_gap() -> None:
    columns = in_flight()
    lost = [
        (t, data) for t, data in MavlinkVehicle().flight(columns)
        if not (35.0 < t < 36.5 and data[7] == 26)  # SCALED_IMU
    ]  # fmt: skip
    _, pieces = received(lost)
    block = samples(pieces["uav1"])
    inside = (block.time_s > 34.99) & (block.time_s < 36.49)
    assert inside.sum() > 60
    assert not np.isfinite(block.column("specific_force_z_m_s2")[inside]).any()
    assert np.isfinite(block.column("pitch_rate_rad_s")[inside]).all()
    assert np.isfinite(block.column("specific_force_z_m_s2")[~inside]).all()


def test_a_reboot_begins_another_stream() -> None:
    vehicle = MavlinkVehicle()
    before = list(vehicle.flight(in_flight(8.0, from_s=500.0)))
    vehicle.link.seq = 0
    after = list(vehicle.flight(in_flight(8.0, from_s=3.0)))
    receiver, pieces = received([*before, *((t + 510.0, data) for t, data in after)])
    first = samples([piece for piece in pieces["uav1"] if piece.stream == 1])
    second = samples([piece for piece in pieces["uav1"] if piece.stream == 2])
    assert {piece.stream for piece in pieces["uav1"]} == {1, 2}
    assert (first.time_s[0], second.time_s[0]) == (500.0, 3.0)
    assert second.time_s[-1] == pytest.approx(10.98)
    assert np.all(np.diff(second.time_s) > 0.0)
    assert np.array_equal(first.column("roll_rad")[:300], second.column("roll_rad")[:300])
    assert receiver.systems[1].vehicle.clock.restarts == 1
    assert receiver.systems[1].sequences[1].lost == 0


def test_a_clock_that_leaps_ahead_goes_on_and_bridges_nothing() -> None:
    columns = dict(in_flight())
    moved = columns["time_s"] > 36.0
    columns["time_s"] = np.where(moved, columns["time_s"] + 40.0, columns["time_s"])
    packets = [(t - 40.0 if t > 50.0 else t, data) for t, data in MavlinkVehicle().flight(columns)]
    receiver, pieces = received(packets)
    block = samples(pieces["uav1"])
    assert {piece.stream for piece in pieces["uav1"]} == {1}
    assert receiver.systems[1].vehicle.clock.jumps == 1
    steps = np.diff(block.time_s)
    assert np.count_nonzero(steps > 1.0) == 1
    assert len(block) == columns["time_s"].size
    assert np.allclose(steps[steps < 1.0], 0.02, atol=1e-9)
    assert np.all(np.isfinite(block.column("airspeed_indicated_m_s")[block.time_s > 77.0]))


def test_servo_stamps_that_begin_anew_after_72_minutes_go_on() -> None:
    _, pieces = received(MavlinkVehicle().flight(in_flight(12.0, from_s=4290.0)))
    block = samples(pieces["uav1"])
    assert np.isfinite(block.column("elevator_command_rad")[block.time_s > 4291.0]).all()
    assert block.time_s[-1] == pytest.approx(4301.98)


def test_two_systems_are_two_vehicles_and_ground_stations_none() -> None:
    columns, station = in_flight(6.0), dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    other = dict(columns) | {"roll_rad": -columns["roll_rad"]}
    beat = bytes(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(station))
    gimbal = dialect.MAVLink(None, srcSystem=3, srcComponent=154)
    wrong = bytes(dialect.MAVLink_attitude_message(36_000, 3.0, 1.0, 0, 9.0, 9.0, 9.0).pack(gimbal))
    packets = sorted(
        [
            *MavlinkVehicle(system=3).flight(columns),
            *MavlinkVehicle(system=9).flight(other),
            *MavlinkVehicle(system=12).flight(in_flight(3.0)),
            *((30.0 + k, one) for k in range(6) for one in (beat, wrong)),
        ],
        key=lambda one: one[0],
    )
    receiver, pieces = received(packets, {3: "left", 9: "right"})
    left, right = samples(pieces["left"]), samples(pieces["right"])
    assert len(left) == len(right) == 300
    assert np.array_equal(left.column("roll_rad"), -right.column("roll_rad"))
    assert set(receiver.others) == {12}
    assert receiver.waiting() == ()


def test_a_multicopter_is_heard_and_gives_no_samples() -> None:
    receiver, pieces = received(MavlinkVehicle(kind=2).flight(in_flight(4.0)))
    assert receiver.systems[1].vehicle.is_multicopter
    assert pieces["uav1"] == []


def test_garbage_between_packets_changes_no_sample() -> None:
    random = np.random.default_rng(7)
    whole = list(MavlinkVehicle().flight(in_flight(6.0)))
    dirty = [(t, random.bytes(int(random.integers(0, 60))) + data) for t, data in whole]
    receiver, pieces = received([*dirty, (whole[-1][0], bytes(300))])
    _, clean = received(whole)
    mine, theirs = samples(pieces["uav1"]), samples(clean["uav1"])
    for name in ("time_s", "pitch_rate_rad_s", "specific_force_z_m_s2", "elevator_command_rad", "altitude_m"):
        assert np.array_equal(mine.column(name), theirs.column(name)), name
    assert receiver.counts()["bytes_between"] > 10_000


def test_whatever_the_fields_hold_nothing_ends_the_receiver() -> None:
    """Random payloads of every message that is read, from one vehicle, right checksums."""
    random, vehicle = np.random.default_rng(11), MavlinkVehicle()
    receiver = LinkReceiver({None: "uav1"}, {"uav1": TRAVEL})
    for data in vehicle.first():
        receiver.feed(data, 0.0)
    kinds = [dialect.mavlink_map[number] for number, layout in layouts().items() if layout.wanted]
    rows = 0
    for k in range(3000):
        kind = kinds[int(random.integers(len(kinds)))]
        fields = kind.unpacker.unpack(random.bytes(kind.unpacker.size))
        payload = kind.unpacker.pack(*fields)
        if k % 2:  # stamps that go on, so that samples are made of the rest
            payload = struct.pack("<I", 30_000 + 20 * k) + payload[4:]
        head = struct.pack(
            "<BBBBBBBHB", 0xFD, len(payload), 0, 0, k % 256, 1, 1, kind.id & 0xFFFF, kind.id >> 16
        )
        crc = dialect.x25crc(head[1:] + payload + bytes((kind.crc_extra,)))
        receiver.feed(head + payload + struct.pack("<H", crc.crc), 0.02 * k)
        if k % 50 == 0:
            receiver.feed(vehicle.heartbeat(), 0.02 * k)
            rows += sum(len(piece.block) for piece in receiver.systems[1].vehicle.step(0.02 * k))
    assert receiver.counts()["packets_damaged"] == 0
    assert rows > 0


def test_memory_is_bounded_whatever_comes() -> None:
    """A vehicle that nobody takes samples of, strangers' addresses without end, and parameters without end."""
    vehicle = MavlinkVehicle()
    receiver = LinkReceiver({None: "uav1"}, {"uav1": TRAVEL})
    receiver.feed(vehicle.heartbeat(), 0.0)
    for k in range(6000):
        t = 10.0 + 0.01 * k
        message = dialect.MAVLink_attitude_message(round(t * 1e3), 0.1, 0.1, 0.1, 0.1, 0.1, 0.1)
        receiver.feed(vehicle.packed(message), t, source=("10.0.0.1", k))
        name = f"P{k}".encode()
        receiver.feed(vehicle.packed(dialect.MAVLink_param_value_message(name, 1.0, 9, 1, 0)), t)
    one = receiver.systems[1].vehicle
    assert one.dropped()["readings_overflow"] == 6000 - 4096
    assert len(one.parameters) == 4096
    assert receiver.counts()["packets"] == 12_001


def test_px4_sends_its_surfaces_as_servo_signals() -> None:
    """Functions, ranges and reversals of the outputs, integers as the bytes of a float."""
    vehicle, t = dialect.MAVLink(None, srcSystem=1, srcComponent=1), 20.0 + 0.02 * np.arange(300)
    receiver = LinkReceiver({None: "uav1"}, {"uav1": TRAVEL})
    parameters = dict(PX4_PARAMETERS) | {"PWM_MAIN_REV": 0b100}
    for number in range(1, 5):
        parameters |= {
            f"PWM_MAIN_FUNC{number}": 200 + number,
            f"PWM_MAIN_MIN{number}": 1000,
            f"PWM_MAIN_MAX{number}": 2000,
        }
    for name, value in parameters.items():
        floating = "TRQ" in name
        sent = value if floating else struct.unpack("<f", struct.pack("<i", int(value)))[0]
        receiver.feed(
            bytes(
                dialect.MAVLink_param_value_message(name.encode(), sent, 9 if floating else 6, 1, 0).pack(
                    vehicle
                )
            ),
            0.0,
        )
    receiver.feed(bytes(dialect.MAVLink_heartbeat_message(1, 12, 0, 0, 0, 3).pack(vehicle)), 20.0)
    wave = np.sin(t)
    pieces = []
    for k, s in enumerate(t.tolist()):
        us = [round(1500 + 400 * x * wave[k]) for x in (-1.0, 1.0, -0.5, 0.25)]
        for message in (
            dialect.MAVLink_attitude_message(round(s * 1e3), 0.1, 0.1, 0.1, wave[k], 0.1, 0.1),
            dialect.MAVLink_highres_imu_message(
                round(s * 1e6), 0.1, 0.2, -9.8, 0, 0, 0, 0, 0, 0, 900.0, 0, 0, 20, 0
            ),
            dialect.MAVLink_servo_output_raw_message(round(s * 1e6), 0, *us, 0, 0, 0, 0),
        ):
            receiver.feed(bytes(message.pack(vehicle)), s)
        pieces += receiver.systems[1].vehicle.step(s) if k % 20 == 0 else []
    block = samples(pieces)
    rows, full = np.round((block.time_s - 20.0) / 0.02).astype(int), TRAVEL["elevator_rad"]
    # left and right servo move against each other; the elevator's output is reversed
    for name, fraction in {"aileron": -0.8, "elevator": -0.4, "rudder": -0.2}.items():
        assert np.allclose(
            block.column(f"{name}_command_rad"), fraction * full * wave[rows], atol=0.002 * full
        ), name
    assert np.isfinite(block.column("altitude_m")).all()
    plan = receiver.systems[1].vehicle.plan
    assert plan is not None
    assert any("taken for PX4's main outputs" in note for note in plan.notes)


@pytest.mark.parametrize("name", ["ATTITUDE_QUATERNION", "ODOMETRY"])
def test_attitude_may_come_as_a_quaternion(name: str) -> None:
    vehicle, columns = MavlinkVehicle(), in_flight(8.0)
    receiver = LinkReceiver({None: "uav1"}, {"uav1": TRAVEL})
    for data in vehicle.first():
        receiver.feed(data, 30.0)
    q = quaternion(*(columns[n] for n in ("roll_rad", "pitch_rad", "heading_rad"))).tolist()
    rates = np.stack([columns[f"{axis}_rate_rad_s"] for axis in ("roll", "pitch", "yaw")], axis=1).tolist()
    pieces, none = [], [0.0] * 21
    for k, t in enumerate(columns["time_s"].tolist()):
        message = (
            dialect.MAVLink_attitude_quaternion_message(round(t * 1e3), *q[k], *rates[k])
            if name == "ATTITUDE_QUATERNION"
            else dialect.MAVLink_odometry_message(
                round(t * 1e6), 1, 12, 0, 0, 0, q[k], 0, 0, 0, *rates[k], none, none
            )
        )
        receiver.feed(vehicle.packed(message), t)
        servos = dialect.MAVLink_servo_output_raw_message(
            round(t * 1e6), 0, 1500, 1500, 1500, 1500, 0, 0, 0, 0
        )
        receiver.feed(vehicle.packed(servos), t)
        pieces += receiver.systems[1].vehicle.step(t) if k % 20 == 0 else []
    block = samples(pieces)
    rows = np.round((block.time_s - 30.0) / 0.02).astype(int)
    assert len(block) > 300
    for channel in ("roll_rad", "pitch_rad", "pitch_rate_rad_s"):
        assert np.allclose(block.column(channel), columns[channel][rows], atol=1e-6), channel
    turns = (block.column("heading_rad") - columns["heading_rad"][rows]) / (2.0 * np.pi)
    assert np.allclose(turns, np.round(turns), atol=1e-6)


def test_what_a_vehicle_is_asked() -> None:
    """Parameters that are missing, the time, and rates on request; nothing that is known already."""
    asker = dialect.MAVLink(None)
    sent: list[Any] = []
    requests = LinkRequests(lambda data, source: sent.append(asker.decode(bytearray(data))), rates_hz=50.0)
    vehicle = MavlinkVehicle(parameters={"SERVO2_FUNCTION": 19.0, "SERVO2_MIN": 1000.0})
    receiver = LinkReceiver({None: "uav1"}, {"uav1": TRAVEL})
    for data in vehicle.first():
        receiver.feed(data, 100.0)
    for k in range(8):
        requests.step(receiver, 100.0 + k)
    names = [m.get_type() for m in sent]
    assert names.count("HEARTBEAT") == 8
    assert {m.type for m in sent if m.get_type() == "HEARTBEAT"} == {dialect.MAV_TYPE_ONBOARD_CONTROLLER}
    assert all(m.get_srcSystem() not in (0, 255) for m in sent)
    asked = {m.param_id for m in sent if m.get_type() == "PARAM_REQUEST_READ"}
    assert {"SERVO1_FUNCTION", "SERVO2_TRIM", "SERVO2_MAX", "SERVO2_REVERSED"} <= asked
    assert not asked & {"SERVO2_FUNCTION", "SERVO2_MIN"}
    intervals = {m.param1: m.param2 for m in sent if m.get_type() == "COMMAND_LONG"}
    assert intervals[30] == pytest.approx(20_000.0)
    question = next(m for m in sent if m.get_type() == "TIMESYNC")
    stamped = dialect.MAVLink_attitude_message(50_000, 0, 0, 0, 0, 0, 0)
    receiver.feed(vehicle.packed(stamped), 108.03)
    receiver.feed(vehicle.packed(dialect.MAVLink_timesync_message(round(42.02e9), question.ts1)), 100.04)
    requests.step(receiver, 109.0)
    clock = receiver.systems[1].vehicle.clock
    assert clock.true_offset_s == pytest.approx(58.0, abs=1e-6)
    assert clock.offset_s == pytest.approx(58.03, abs=1e-6)


def test_parameters_that_say_what_others_are_for_come_first() -> None:
    assert list(wanted_parameters("", {})) == []
    first = list(wanted_parameters("px4", {}))
    assert first[0] == "CA_SV_CS_COUNT"
    later = list(wanted_parameters("px4", {"CA_SV_CS_COUNT": 2.0, "PWM_MAIN_FUNC3": 201.0}))
    assert {"CA_SV_CS1_TRQ_R", "PWM_MAIN_MIN3", "PWM_MAIN_MAX3"} <= set(later)
    assert "CA_SV_CS2_TYPE" not in later


def test_slow_telemetry_is_published_as_it_is() -> None:
    """Four messages a second of each kind, no parameters: no surfaces, and a clock of 4 Hz."""
    every = dict.fromkeys(("ATTITUDE", "SCALED_IMU", "SERVO_OUTPUT_RAW", "VFR_HUD", "SCALED_PRESSURE"), 12)
    receiver, pieces = received(MavlinkVehicle(every=every, parameters={}).flight(in_flight(19.0)))
    block = samples(pieces["uav1"])
    assert block.present
    assert np.allclose(np.diff(block.time_s), 0.24, atol=1e-9)
    assert not any("elevator" in name for name in block.present)
    assert np.isfinite(block.column("pitch_rate_rad_s")).all()
    plan = receiver.systems[1].vehicle.plan
    assert plan is not None
    assert any("no servo output" in note for note in plan.notes)


def test_a_topic_that_ceases_holds_samples_up_for_two_seconds_at_most() -> None:
    packets = [
        (t, data) for t, data in MavlinkVehicle().flight(in_flight(12.0)) if not (t > 36.0 and data[7] == 29)
    ]
    receiver = LinkReceiver({None: "uav1"}, {"uav1": TRAVEL})
    latest, due_s = 0.0, 0.0
    delays = []
    for t, data in packets:
        receiver.feed(data, t)
        if t >= due_s:
            due_s = t + 0.1
            for system in receiver.systems.values():
                for piece in system.vehicle.step(t):
                    latest = float(piece.block.time_s[-1])
                    delays.append((t, t - latest))
    before = [delay for t, delay in delays if 34.0 < t < 36.0]
    during = [delay for t, delay in delays if t >= 36.0]
    assert max(before) < 0.15
    assert 1.0 < max(during) < 2.2
    assert during[-1] < 0.15  # no longer waited for
