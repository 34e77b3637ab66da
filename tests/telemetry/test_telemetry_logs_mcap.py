"""MCAP files of others: their topics by a map, every value to the last digit, damage and strange encodings named."""

import io
import json
import random
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown_logs import flown
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import CompressionType, Writer

from wingwatch.cli.main import main
from wingwatch.telemetry import LogError, load_flight, parse_map
from wingwatch.telemetry.logs import is_autopilot_log, read_autopilot_log

SECONDS = 20.0
EPOCH_NS = 1_750_000_000_000_000_000

MAP = """
format = 1
[channels]
roll_rate_rad_s = { source = "imu_data.angular_velocity.x" }
pitch_rate_rad_s = { source = "imu_data.angular_velocity.y" }
yaw_rate_rad_s = { source = "imu_data.angular_velocity.z" }
specific_force_x_m_s2 = { source = "imu_data.linear_acceleration.x" }
specific_force_y_m_s2 = { source = "imu_data.linear_acceleration.y" }
specific_force_z_m_s2 = { source = "imu_data.linear_acceleration.z" }
roll_rad = { source = "attitude.euler[0]" }
pitch_rad = { source = "attitude.euler[1]" }
airspeed_true_m_s = { source = "air.airspeed" }
altitude_m = { source = "air.altitude" }
elevator_rad = { source = "surfaces.elevator_deg", unit = "deg" }
aileron_rad = { source = "surfaces.aileron_deg", unit = "deg" }
rudder_rad = { source = "surfaces.rudder_deg", unit = "deg" }
"""


def air_class() -> Any:
    """A message type that only its descriptor defines."""
    file = FileDescriptorProto(name="air.proto", package="mine", syntax="proto3")
    message = file.message_type.add(name="Air")
    for number, name in enumerate(("airspeed", "altitude"), 1):
        message.field.add(
            name=name, number=number, type=FieldDescriptorProto.TYPE_DOUBLE,
            label=FieldDescriptorProto.LABEL_OPTIONAL,
        )  # fmt: skip
    pool = DescriptorPool()
    pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName("mine.Air")), FileDescriptorSet(file=[file])


def written(compression: CompressionType = CompressionType.ZSTD) -> bytes:
    """The flight as another program records it: IMU and surfaces in JSON, air in protobuf, a camera in neither."""
    block = flown(SECONDS)
    of = {name: block.column(name) for name in block.present}
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=50_000, compression=compression)
    writer.start("", "another")
    plain = writer.register_schema("any", "jsonschema", b'{"type":"object"}')
    kind, files = air_class()
    air_schema = writer.register_schema("mine.Air", "protobuf", files.SerializeToString())
    camera_schema = writer.register_schema("sensor_msgs/Image", "ros2msg", b"uint8[] data")
    topics = {
        name: writer.register_channel(name, "json", plain) for name in ("/imu/data", "/attitude", "/surfaces")
    }
    air = writer.register_channel("/air", "protobuf", air_schema)
    camera = writer.register_channel("/camera", "cdr", camera_schema)
    for k, at_s in enumerate(block.time_s):
        stamp = EPOCH_NS + round(float(at_s) * 1e9)
        for name, value in rows(of, k).items():
            payload = json.dumps(value).encode()
            writer.add_message(topics[name], stamp + 5_000_000, payload, stamp)
        message = kind(airspeed=of["airspeed_true_m_s"][k], altitude=of["altitude_m"][k])
        writer.add_message(air, stamp + 5_000_000, message.SerializeToString(), stamp)
        if k % 50 == 0:
            writer.add_message(camera, stamp, b"\0\1\0\0", stamp)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def rows(of: Mapping[str, Any], k: int) -> dict[str, Any]:
    rates = [float(of[f"{axis}_rate_rad_s"][k]) for axis in ("roll", "pitch", "yaw")]
    forces = [float(of[f"specific_force_{axis}_m_s2"][k]) for axis in "xyz"]
    return {
        "/imu/data": {
            "angular_velocity": dict(zip("xyz", rates, strict=True)),
            "linear_acceleration": dict(zip("xyz", forces, strict=True)),
            "frame": "body",
        },
        "/attitude": {"euler": [float(of["roll_rad"][k]), float(of["pitch_rad"][k])]},
        "/surfaces": {
            f"{name}_deg": float(np.rad2deg(of[f"{name}_rad"][k]))
            for name in ("elevator", "aileron", "rudder")
        },
    }


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_foreign_file_is_read_by_a_map_to_the_last_digit(
    tmp_path: Path, compression: CompressionType
) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(written(compression))
    assert is_autopilot_log(path)
    log = read_autopilot_log(path)
    block = flown(SECONDS)
    imu = log.topics["imu_data[0]"]
    assert np.array_equal(imu.fields["angular_velocity.y"], block.column("pitch_rate_rad_s"))
    assert np.array_equal(log.topics["air[0]"].fields["airspeed"], block.column("airspeed_true_m_s"))
    np.testing.assert_allclose(imu.time_s, block.time_s - block.time_s[0], atol=1e-9)
    assert any("/camera (cdr)" in note for note in log.notes)

    table = load_flight(path, parse_map(MAP))
    rows_of = np.searchsorted(block.time_s - block.time_s[0], table.block.time_s - 1e-6)
    for name in ("pitch_rate_rad_s", "specific_force_z_m_s2", "airspeed_true_m_s", "roll_rad"):
        np.testing.assert_allclose(
            table.block.column(name), block.column(name)[rows_of], rtol=1e-12, atol=1e-12
        )
    np.testing.assert_allclose(
        table.block.column("elevator_rad"), block.column("elevator_rad")[rows_of], atol=1e-12
    )
    assert len(table.block) > 0.8 * len(block)


def test_what_it_holds_is_shown_without_a_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(written())
    assert main(["log", str(path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["format"] == "mcap"
    assert {topic["name"] for topic in result["topics"]} >= {
        "air[0]",
        "attitude[0]",
        "imu_data[0]",
        "surfaces[0]",
    }
    assert "write a channel map" in result["reason"]


def test_random_bytes_and_cuts_are_one_sentence_soon(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    good = written(CompressionType.LZ4)
    draw = random.Random(4)
    path.write_bytes(good[: len(good) // 2])
    log = read_autopilot_log(path)
    assert any("cut short or damaged" in note for note in log.notes)
    for keep in (8, 9, 30, 200):
        path.write_bytes(good[:keep] + draw.randbytes(10_000_000))
        began_s = time.thread_time()
        with pytest.raises(LogError) as caught:
            read_autopilot_log(path)
        assert time.thread_time() - began_s < 5.0  # the promise
        assert "\n" not in str(caught.value)


def test_messages_that_cannot_be_decoded_are_counted(tmp_path: Path) -> None:
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start("", "another")
    plain = writer.register_schema("any", "jsonschema", b"{}")
    topic = writer.register_channel("/air", "json", plain)
    for k, payload in enumerate((b'{"v": 1.5}', b"[1]", b"{", b'{"v": 2.5}')):
        writer.add_message(topic, k, payload, k)
    writer.finish()  # type: ignore[no-untyped-call]
    path = tmp_path / "flight.mcap"
    path.write_bytes(stream.getvalue())
    log = read_autopilot_log(path)
    assert log.topics["air[0]"].fields["v"].tolist() == [1.5, 2.5]
    assert "2 messages of air cannot be decoded" in log.notes
