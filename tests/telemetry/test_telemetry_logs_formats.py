"""Formats of autopilot logs: read back to the last digit, known by their bytes, and honest about what was lost."""

import builtins
import contextlib
import struct
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from written_logs import Flash, FlashTopic, Ulog, UlogTopic

from wingwatch.telemetry import LogError, TableError, load_flight
from wingwatch.telemetry.logs import AutopilotLog, is_autopilot_log, read_autopilot_log

RNG_SEED = 7
US = [1_000_000 + 20_000 * i for i in range(200)]
VALUES = np.random.default_rng(RNG_SEED).normal(size=(200, 3))


def accel(x: Any, clipped: Any) -> list[tuple[str, str, Any]]:
    return [("float", "x", x), ("uint8_t", "clipped", clipped)]


def ulog() -> Ulog:
    return Ulog(
        [
            UlogTopic("sensor_accel", US, accel(VALUES[:, 0], np.arange(200) % 7), 0),
            UlogTopic("sensor_accel", US[::2], accel(9.0 + VALUES[::2, 1], np.zeros(100)), 1),
            UlogTopic("vehicle_angular_velocity", US, [("float", "xyz", VALUES)]),
            UlogTopic("vehicle_gps_position", US[::10], [("double", "latitude_deg", 47.0 + VALUES[::10, 2])]),
        ],
        {"MAV_TYPE": 1, "FW_AIRSPD_TRIM": 17.5},
    )  # fmt: skip


FLASH_ROWS = [
    (US[i], i % 2, float(VALUES[i, 0]), -4500 + 37 * i, 473977418 + i, 58_612 + i) for i in range(200)
]


def flash() -> Flash:
    return Flash([FlashTopic("XYZ", "QBfcLE", "TimeUS,I,F,Cd,Pos,Alt", FLASH_ROWS)], {"SERVO2_TRIM": 1487.0})


def read(path: Path, data: bytes) -> AutopilotLog:
    path.write_bytes(data)
    return read_autopilot_log(path)


def test_a_ulog_reads_back_to_the_last_digit(tmp_path: Path) -> None:
    log = read(tmp_path / "a.ulg", ulog().encode())
    assert (log.format, log.autopilot, log.vehicle, log.notes) == ("ulog", "px4", "fixed wing", ())
    assert log.parameters == {"MAV_TYPE": 1.0, "FW_AIRSPD_TRIM": 17.5}
    rates = log.topics["vehicle_angular_velocity[0]"]
    assert rates.time_s.tolist() == [us / 1e6 for us in US]
    for i in range(3):
        assert rates.fields[f"xyz[{i}]"].tolist() == VALUES[:, i].astype(np.float32).tolist()
    assert (
        log.topics["vehicle_gps_position[0]"].fields["latitude_deg"].tolist()
        == (47.0 + VALUES[::10, 2]).tolist()
    )
    assert log.topics["sensor_accel[0]"].fields["clipped"].tolist() == [float(i % 7) for i in range(200)]


def test_instances_of_a_topic_are_told_apart(tmp_path: Path) -> None:
    log = read(tmp_path / "a.ulg", ulog().encode())
    assert log.topics["sensor_accel[1]"].fields["x"].min() > 5.0
    assert log.topics["sensor_accel[0]"].fields["x"].max() < 5.0
    bin_log = read(tmp_path / "a.bin", flash().encode())
    one, two = (bin_log.topics[f"XYZ[{i}]"] for i in range(2))
    assert one.time_s.tolist() == [us / 1e6 for us in US[::2]]
    assert two.time_s.tolist() == [us / 1e6 for us in US[1::2]]


def expected_flash(instance: int) -> Mapping[str, Sequence[float]]:
    rows = FLASH_ROWS[instance::2]
    return {
        "F": [float(np.float32(r[2])) for r in rows],
        "Cd": [r[3] * 0.01 for r in rows],
        "Pos": [r[4] * 1e-7 for r in rows],
        "Alt": [r[5] * 0.01 for r in rows],
    }


def test_a_dataflash_log_reads_back_to_the_last_digit(tmp_path: Path) -> None:
    log = read(tmp_path / "a.bin", flash().encode())
    assert (log.format, log.autopilot, log.vehicle, log.notes) == ("dataflash", "ardupilot", "fixed wing", ())
    assert log.firmware == "ArduPlane V4.3.1 (1a2b3c4d)"
    assert log.parameters == {"SERVO2_TRIM": 1487.0}
    for instance in range(2):
        topic = log.topics[f"XYZ[{instance}]"]
        assert {name: values.tolist() for name, values in topic.fields.items()} == expected_flash(instance)


def test_a_dataflash_log_as_text_is_the_same(tmp_path: Path) -> None:
    log = read(tmp_path / "a.log", flash().text().encode())
    assert (log.format, log.vehicle, log.firmware) == (
        "dataflash-text",
        "fixed wing",
        "ArduPlane V4.3.1 (1a2b3c4d)",
    )
    assert log.parameters == {"SERVO2_TRIM": 1487.0}
    topic = log.topics["XYZ[1]"]
    assert topic.time_s.tolist() == [us / 1e6 for us in US[1::2]]
    np.testing.assert_allclose(topic.fields["Pos"], expected_flash(1)["Pos"], rtol=0, atol=1e-9)
    assert topic.fields["F"].tolist() == [r[2] for r in FLASH_ROWS[1::2]]


def test_another_reader_of_dataflash_agrees(tmp_path: Path) -> None:
    """The ground stations' own library reads what the tests write, to the same numbers."""
    reader = pytest.importorskip("pymavlink.DFReader")
    path = tmp_path / "a.bin"
    path.write_bytes(flash().encode())
    other, rows = reader.DFReader_binary(str(path), zero_time_base=True), []
    while (message := other.recv_msg()) is not None:
        if message.get_type() == "XYZ" and message.I == 1:
            rows.append((message.TimeUS / 1e6, message.F, message.Cd, message.Pos, message.Alt))
    other.close()
    topic = read_autopilot_log(path).topics["XYZ[1]"]
    ours = np.stack([topic.time_s, *(topic.fields[name] for name in ("F", "Cd", "Pos", "Alt"))], axis=1)
    np.testing.assert_allclose(ours, np.array(rows), rtol=1e-12)


def tlog_packets(rows: int = 100) -> list[bytes]:
    """An ArduPilot aircraft and its ground station over a link."""
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    vehicle, station = (
        dialect.MAVLink(None, srcSystem=3, srcComponent=1),
        dialect.MAVLink(None, srcSystem=255),
    )
    packets = []
    for i in range(rows):
        received = struct.pack(">Q", 1_700_000_000_000_000 + 100_000 * i + (i % 3) * 5_000)
        boot = 5_000 + 100 * i
        messages = [
            (vehicle, dialect.MAVLink_attitude_message(boot, *(float(v) for v in VALUES[i]), 0.1, 0.2, 0.3)),
            (vehicle, dialect.MAVLink_vfr_hud_message(20.0 + i, 21.0, 90, 55, 400.0, 0.5)),
            (station, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)),
            (vehicle, dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 0, 3)),
        ]
        if i == 0:
            messages.append((vehicle, dialect.MAVLink_param_value_message(b"SERVO2_TRIM", 1487.0, 9, 1, 0)))
        packets += [received + bytes(message.pack(sender)) for sender, message in messages]
    return packets


def test_a_telemetry_log_reads_back_on_the_vehicles_clock(tmp_path: Path) -> None:
    log = read(tmp_path / "a.tlog", b"".join(tlog_packets()))
    assert (log.format, log.autopilot, log.vehicle, log.notes) == ("tlog", "ardupilot", "fixed wing", ())
    attitude = log.topics["ATTITUDE[0]"]
    np.testing.assert_allclose(attitude.time_s, 5.0 + 0.1 * np.arange(100), atol=1e-9)
    assert attitude.fields["roll"].tolist() == VALUES[:100, 0].astype(np.float32).tolist()
    # a message without a stamp of its own comes up to 10 ms later by the station's clock, within what the link delays
    delay = log.topics["VFR_HUD[0]"].time_s - attitude.time_s
    assert delay.min() == pytest.approx(0.0, abs=1e-6)
    assert delay.max() == pytest.approx(0.010, abs=1e-6)
    assert log.parameters == {"SERVO2_TRIM": 1487.0}


def test_a_garbled_telemetry_log_loses_the_damaged_packets_alone_and_says_so(tmp_path: Path) -> None:
    packets = tlog_packets()
    data = b"".join(packets[:200]) + b"\xfd\x00noise" * 50 + b"".join(packets[200:])
    log = read(tmp_path / "a.tlog", data[:-4])
    assert len(log.topics["ATTITUDE[0]"]) == 100
    assert any("350 bytes are damaged" in note for note in log.notes)
    assert any("cut short" in note for note in log.notes)


def test_the_bytes_decide_and_never_the_name(tmp_path: Path) -> None:
    assert read(tmp_path / "a.bin", ulog().encode()).format == "ulog"
    assert read(tmp_path / "a.csv", flash().encode()).format == "dataflash"
    (tmp_path / "b.ulg").write_text("time_s,pitch_rate_rad_s\n0.0,0.1\n")
    assert not is_autopilot_log(tmp_path / "b.ulg")
    assert not is_autopilot_log(tmp_path / "none.ulg")
    (tmp_path / "empty.bin").write_bytes(b"")
    with pytest.raises(TableError, match="empty"):
        load_flight(tmp_path / "empty.bin")


def test_a_truncated_file_gives_what_it_has_and_says_so(tmp_path: Path) -> None:
    whole = read(tmp_path / "a.ulg", ulog().encode())
    cut = read(tmp_path / "a.ulg", ulog().encode()[:-20])
    assert any("cut short" in note for note in cut.notes)
    samples = [sum(map(len, log.topics.values())) for log in (whole, cut)]
    assert 0 < samples[0] - samples[1] < 4
    record = read(tmp_path / "a.bin", flash().encode()[:-5])
    assert record.notes == ("the file ends within a record: it is cut short",)
    assert sum(map(len, record.topics.values())) == 200 + 1 + 1 - 1


def test_garbage_in_the_middle_costs_what_it_covers_and_is_counted(tmp_path: Path) -> None:
    made = flash()
    records = made.records()
    noise = np.random.default_rng(3).bytes(997)
    data = made.head() + b"".join(records[:100]) + noise + b"".join(records[100:])
    log = read(tmp_path / "a.bin", data)
    assert sum(map(len, log.topics.values())) == len(records)
    assert log.notes == ("997 bytes in 1 places are damaged, the records in them are lost",)
    px4 = ulog()
    px4.sync_every = 20
    body = px4.records()
    damaged = read(
        tmp_path / "a.ulg",
        px4.head()
        + b"".join(body[:100])
        + b"\0" * 500
        + px4.encode()[len(px4.head()) + sum(map(len, body[:100])) :],
    )
    assert any("damaged" in note for note in damaged.notes)
    assert sum(map(len, damaged.topics.values())) > 0.8 * len(body)


@pytest.mark.parametrize(
    ("name", "head"),
    [
        ("a.ulg", b"ULog\x01\x12\x35\x01" + bytes(8)),
        ("a.bin", b"\xa3\x95\x80"),
        ("a.tlog", struct.pack(">Q", 1_700_000_000_000_000) + b"\xfd"),
    ],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_ten_megabytes_of_noise_behind_a_good_header_are_one_sentence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, head: bytes, seed: int
) -> None:
    path = tmp_path / name
    path.write_bytes(head + np.random.default_rng(seed).bytes(10_000_000))
    began = time.monotonic()
    with pytest.raises(LogError) as caught:
        load_flight(path)
    assert time.monotonic() - began < 5.0
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("byte", [b"\x00", b"\xff", b"\xfd"])
def test_ten_megabytes_of_one_byte_behind_a_good_file_cost_seconds(tmp_path: Path, byte: bytes) -> None:
    """A library that tries every byte took half a minute over some of these."""
    for name, good in (
        ("a.ulg", ulog().encode()),
        ("a.bin", flash().encode()),
        ("a.tlog", b"".join(tlog_packets())),
    ):
        path = tmp_path / name
        path.write_bytes(good + byte * 10_000_000)
        began = time.monotonic()
        log = read_autopilot_log(path)
        assert time.monotonic() - began < 5.0
        assert log.notes
        assert len(log.topics) >= 2


def test_noise_in_the_middle_of_a_good_file_never_crashes(tmp_path: Path) -> None:
    for seed in range(12):
        rng = np.random.default_rng(seed)
        for name, good in (("a.ulg", ulog().encode()), ("a.bin", flash().encode())):
            data = bytearray(good)
            start = int(rng.integers(200, len(data) - 1000))
            data[start : start + 800] = rng.bytes(800)
            path = tmp_path / name
            path.write_bytes(bytes(data))
            with contextlib.suppress(LogError):
                assert read_autopilot_log(path).topics


def test_what_the_library_prints_does_not_reach_standard_output(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    made = ulog()
    unknown = struct.pack("<H", 30) + b"D" + struct.pack("<H", 77) + bytes(28)
    read(tmp_path / "a.ulg", made.head() + unknown + b"".join(made.records()))
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


@pytest.mark.parametrize(("name", "library"), [("a.ulg", "pyulog"), ("a.tlog", "pymavlink")])
def test_a_missing_library_is_a_sentence_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, library: str
) -> None:
    path = tmp_path / name
    path.write_bytes(ulog().encode() if name == "a.ulg" else b"".join(tlog_packets(3)))
    real = builtins.__import__

    def without(module: str, *rest: Any, **named: Any) -> Any:
        if module.split(".")[0] == library:
            raise ImportError(module)
        return real(module, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(LogError, match=rf"need {library}.*install wingwatch with its extra logs"):
        load_flight(path)


def test_logs_of_2014_have_milliseconds_and_the_receivers_own_time(tmp_path: Path) -> None:
    """``TimeMS`` of GPS is the time of the week then, and ``T`` the time since boot; angles are in hundredths."""
    attitude = [(5_000 + 20 * i, -1234 + i, 4500) for i in range(50)]
    receiver = [(3, 302_400_000 + 200 * i, 1800, 58_612, 5_100 + 200 * i) for i in range(5)]
    topics = [
        FlashTopic("ATT", "Icc", "TimeMS,Roll,Pitch", attitude),
        FlashTopic("GPS", "BIHeI", "Status,TimeMS,Week,Alt,T", receiver),
    ]
    log = read(tmp_path / "a.bin", Flash(topics, firmware="ArduPlane V3.1.1").encode())
    assert log.topics["ATT[0]"].time_s.tolist() == [row[0] / 1e3 for row in attitude]
    assert log.topics["ATT[0]"].fields["Roll"].tolist() == [row[1] * 0.01 for row in attitude]
    np.testing.assert_allclose(log.topics["GPS[0]"].time_s, [5.1, 5.3, 5.5, 5.7, 5.9])
