"""Recordings as files: other tools read them, a kill costs little, limits hold, a full disk is said and got over."""

import errno
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader

from wingwatch.aircraft import STRUCTURES, load_aircraft
from wingwatch.baselines import EstimateRecord, Reference
from wingwatch.cli.main import main
from wingwatch.cli.replaying import Replay
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.service.recorded_memory import decode_memory, encode_memory
from wingwatch.service.recorder import Recorder, RecordingLimits
from wingwatch.service.settings import ServeSettings
from wingwatch.telemetry import (
    JSON,
    PROTOBUF,
    AircraftMessage,
    InboundMessage,
    SampleBlock,
    encode_aircraft,
    encode_sensors,
)
from wingwatch.telemetry.recording.reading import Recording, open_recording
from wingwatch.telemetry.recording.recording_file import RecordingError, RecordingFile

WALL_S = 1_700_000_000.0


class Clock:
    """Time that a test sets."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def wall(self) -> float:
        return WALL_S + self.now_s


def announced(vehicle: str, at_s: float = 0.0) -> InboundMessage:
    payload = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
    return InboundMessage("default", vehicle, "aircraft", payload, PROTOBUF, at_s)


def sampled(vehicle: str, number: int, encoding: str = PROTOBUF) -> InboundMessage:
    at_s = 0.2 * number
    block = SampleBlock.from_columns(
        {"time_s": [at_s, at_s + 0.1], "pitch_rate_rad_s": [0.1 + number, 1.0 / (number + 3.0)]}
    )
    payload = encode_sensors(number, block, encoding)
    return InboundMessage("default", vehicle, "sensors", payload, encoding, at_s)


def recorded(folder: Path, messages: list[InboundMessage], limits: RecordingLimits | None = None) -> Clock:
    """A recording of messages, written at the time of each."""
    clock = Clock()
    recorder = Recorder(folder, limits, clock.wall, clock)
    for message in messages:
        clock.now_s = message.received_s
        recorder.messages([message])
        recorder.write()
    with recorder:
        pass
    return clock


def messages_of(recording: Recording) -> list[tuple[str, str, float, bytes]]:
    return [
        (m.topic, m.encoding, round(m.time_ns / 1e9 - WALL_S, 6), m.payload) for m in recording.messages()
    ]


def expected(messages: list[InboundMessage]) -> list[tuple[str, str, float, bytes]]:
    return [
        (f"wingwatch/v1/{m.fleet}/{m.vehicle}/{m.stream}", m.encoding, round(m.received_s, 6), m.payload)
        for m in messages
    ]


def test_other_tools_find_the_messages_with_their_schemas(tmp_path: Path) -> None:
    given = [announced("a"), sampled("a", 0), sampled("a", 1, JSON), sampled("a", 2)]
    recorded(tmp_path, given)
    (path,) = tmp_path.glob("*.mcap")
    found = []
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            if schema.encoding == "jsonschema":
                assert channel.message_encoding == "json"
                continue
            pool = DescriptorPool()
            for file in FileDescriptorSet.FromString(schema.data).file:
                pool.Add(file)
            kind: Any = GetMessageClass(pool.FindMessageTypeByName(schema.name))
            found.append((channel.topic, kind.FromString(message.data), message.log_time))
    assert [topic.rpartition("/")[2] for topic, _, _ in found] == ["aircraft", "sensors", "sensors"]
    assert found[0][1].aircraft == "aerosonde"
    assert list(found[2][1].columns.pitch_rate_rad_s) == [2.1, 1.0 / 5.0]  # to the last digit
    assert found[2][2] == round((WALL_S + 0.4) * 1e9)
    assert messages_of(open_recording([tmp_path])) == expected(given)


def test_a_killed_process_leaves_what_was_written_before(tmp_path: Path) -> None:
    given = [announced("a"), *(sampled("a", k) for k in range(6))]
    recorded(tmp_path / "whole", given)
    (path,) = (tmp_path / "whole").glob("*.mcap")
    data = path.read_bytes()
    cut = tmp_path / path.name
    lengths = set()
    for end in range(300, len(data) - 1, 97):
        cut.write_bytes(data[:end])
        recording = open_recording([cut])
        found = messages_of(recording)
        assert found == expected(given)[: len(found)]
        assert len(recording.notes) == 1
        assert "ends early" in recording.notes[0]
        lengths.add(len(found))
    assert lengths >= {0, 3, len(given)}  # every half second is there by itself


def test_files_end_at_their_size_and_the_oldest_are_removed(tmp_path: Path) -> None:
    given = [announced("a"), *(sampled("a", k) for k in range(40))]
    recorded(tmp_path / "all", given, RecordingLimits(file_bytes=2500.0))
    files = sorted((tmp_path / "all").glob("*.mcap"))
    assert len(files) > 3
    recording = open_recording([tmp_path / "all"])
    assert recording.whole
    assert messages_of(recording) == expected(given)  # the aircraft of each file is there once
    last = open_recording([files[-1]])
    assert not last.whole
    assert messages_of(last)[0][0].endswith("/aircraft")  # a file can be read alone

    recorded(tmp_path / "few", given, RecordingLimits(file_bytes=2500.0, most_bytes=15_000.0))
    left = sorted((tmp_path / "few").glob("*.mcap"))
    assert 1 <= len(left) < len(files)
    assert sum(path.stat().st_size for path in left) <= 15_000.0
    found = messages_of(open_recording([tmp_path / "few"]))
    assert found[-1] == expected(given)[-1]


def test_a_file_ends_at_its_age(tmp_path: Path) -> None:
    given = [sampled("a", k) for k in range(20)]  # of 4 s
    recorded(tmp_path, given, RecordingLimits(file_s=1.0))
    assert len(list(tmp_path.glob("*.mcap"))) == 4
    assert messages_of(open_recording([tmp_path])) == expected(given)


def test_a_disk_that_takes_nothing_is_said_and_a_new_file_begun_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    recorder = Recorder(tmp_path, None, clock.wall, clock)

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(RecordingFile, "add", full)
        recorder.messages([sampled("a", 0)])
        recorder.write()
    assert recorder.problem == "nothing is recorded: No space left on device."
    recorder.messages([sampled("a", 1)])
    recorder.write()  # too early for another try
    assert recorder.counts["dropped"] == 2
    clock.now_s = 60.0
    recorder.messages([sampled("a", 2)])
    with recorder:
        pass
    assert recorder.problem is None
    assert recorder.counts["messages"] == 1
    assert recorder.counts["files"] == 2
    assert [m[3] for m in messages_of(open_recording([tmp_path]))] == [sampled("a", 2).payload]


def test_what_finds_no_room_is_dropped_and_counted(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    big = InboundMessage("default", "a", "sensors", bytes(65_536), PROTOBUF, 0.0)
    for _ in range(2100):  # more than 128 MB
        recorder.messages([big])
    assert 0 < recorder.counts["dropped"] < 100
    assert recorder.waiting + recorder.counts["dropped"] == 2100


def test_an_entry_that_cannot_be_written_costs_no_other(tmp_path: Path) -> None:
    clock = Clock()
    recorder = Recorder(tmp_path, None, clock.wall, clock)
    row = EstimateRecord("default", "a", 1.0, "no_structure", "fourier", (), (), "converged", (0.0,) * 4)
    recorder.estimates([row])
    recorder.messages([sampled("a", 0)])
    with recorder:
        pass
    assert recorder.counts["dropped"] == 1
    assert len(messages_of(open_recording([tmp_path]))) == 1


def test_what_the_database_knew_comes_back_as_it_was() -> None:
    reference = Reference(np.eye(3), np.array([1.0, -2.0, 0.5]), 3, 30.0)
    aircraft = load_aircraft("aerosonde")
    found = decode_memory(encode_memory(VehicleMemory({"short_period": reference})), aircraft, "clean")
    assert found.references["short_period"].blocks == 3
    assert np.array_equal(found.references["short_period"].vector, reference.vector)
    assert not found.envelopes
    assert not found.cells


def test_the_service_takes_the_settings_of_recordings() -> None:
    settings = ServeSettings.model_validate(
        {"record": "r", "recording": {"file_mb": 2, "file_minutes": 1, "most_gb": 1, "keep_days": 2}}
    )
    assert settings.record == Path("r")
    assert settings.recording.limits == RecordingLimits(2e6, 60.0, 1e9, 172_800.0)


def damaged(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:60])


def of_another(path: Path) -> None:
    from mcap.writer import Writer

    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start("ros2", "another")
    writer.finish()  # type: ignore[no-untyped-call]
    path.write_bytes(stream.getvalue())


def of_two_runs(path: Path) -> None:
    recorded(path.parent / "b", [sampled("a", 0)])
    (other,) = (path.parent / "b").glob("*.mcap")
    other.rename(path.with_name("z.mcap"))


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (damaged, "the recording is damaged: it names no run"),
        (of_another, "was not recorded by wingwatch"),
        (lambda path: path.write_bytes(b"time_s\n1\n"), "is no MCAP file"),
        (lambda path: path.unlink(), "o such file"),
        (of_two_runs, "the files are of 2 runs of a service"),
    ],
)
def test_what_is_no_recording_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], harm: Callable[[Path], object], says: str
) -> None:
    recorded(tmp_path / "a", [sampled("a", 0)])
    (made,) = (tmp_path / "a").glob("*.mcap")
    path = made.rename(tmp_path / "one.mcap")
    harm(path)
    files = sorted(tmp_path.glob("*.mcap")) or [path]
    assert main(["replay", *map(str, files)]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_an_empty_folder_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="holds no recording"):
        open_recording([tmp_path])


def test_a_replay_tells_what_does_not_come_again(tmp_path: Path) -> None:
    clock = Clock()
    recorder = Recorder(tmp_path, None, clock.wall, clock)
    values = tuple(float(k) for k in range(len(STRUCTURES["short_period"].derivatives)))
    row = EstimateRecord(
        "default", "a", 1.0, "short_period", "ekf", values, values, "converged", (20.0, 100.0, 1.2, 0.1)
    )
    recorder.estimates([row])
    recorder.messages([announced("a"), sampled("a", 0)])
    with recorder:
        pass
    replay = Replay(open_recording([tmp_path]), load_aircraft)
    assert list(replay.seconds())
    agreement = replay.agreement()
    assert (agreement.estimates, agreement.estimates_equal, agreement.whole) == (1, 0, False)
    assert agreement.first_difference == "wingwatch/v1/default/a/estimates/ekf/short_period at 1.00 s"
