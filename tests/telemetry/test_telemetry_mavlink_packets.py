"""MAVLink's bytes: packets that pymavlink writes are read whole, whatever lies between them."""

import struct
from typing import Any

import numpy as np
import pytest

dialect: Any = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
v10: Any = pytest.importorskip("pymavlink.dialects.v10.ardupilotmega")

from wingwatch.telemetry.logs.link_facts import (  # noqa: E402
    boot_s,
    is_vehicle,
    next_wrap_s,
    parameter_value,
)
from wingwatch.telemetry.mavlink.boot_clock import BootClock, Stamp  # noqa: E402
from wingwatch.telemetry.mavlink.dialect import layouts  # noqa: E402
from wingwatch.telemetry.mavlink.packets import PacketReader  # noqa: E402
from wingwatch.telemetry.mavlink.sequences import PacketSequence  # noqa: E402


def attitude(link: Any, ms: int = 1234, roll: float = 0.25) -> bytes:
    data = bytes(dialect.MAVLink_attitude_message(ms, roll, -0.5, 1.5, 0.1, 0.2, 0.3).pack(link))
    link.seq = (link.seq + 1) % 256
    return data


def fields(packet: Any) -> Any:
    return np.frombuffer(packet.payload, dtype=packet.layout.dtype)[0]


@pytest.fixture
def link() -> Any:
    return dialect.MAVLink(None, srcSystem=7, srcComponent=1)


def test_every_wanted_message_reads_as_pymavlink_reads_it() -> None:
    """Random payloads of every message that becomes a channel, field by field."""
    random = np.random.default_rng(44)
    writer, reader = dialect.MAVLink(None, srcSystem=7, srcComponent=1), PacketReader(layouts())
    wanted = [number for number, layout in layouts().items() if layout.wanted]
    assert len(wanted) == 19
    for number in wanted:
        kind = dialect.mavlink_map[number]
        values = kind.unpacker.unpack(random.bytes(kind.unpacker.size))
        payload = kind.unpacker.pack(*values)
        head = struct.pack("<BBBBBBBHB", 0xFD, len(payload), 0, 0, 5, 7, 1, number & 0xFFFF, number >> 16)
        crc = dialect.x25crc(head[1:] + payload)
        crc.accumulate(bytes((kind.crc_extra,)))
        data = head + payload + struct.pack("<H", crc.crc)
        [packet] = reader.feed(data)
        message = writer.decode(bytearray(data))
        mine = fields(packet)
        for name in kind.fieldnames:
            theirs = getattr(message, name)
            if isinstance(theirs, str):  # pymavlink makes text of it
                assert bytes(mine[name]) in payload
            else:
                assert np.array_equal(
                    np.array(mine[name]), np.array(theirs, mine[name].dtype), equal_nan=True
                )
    assert reader.counts["packets"] == len(wanted)
    assert reader.counts["packets_damaged"] == 0


def test_zeros_cut_off_the_end_are_restored(link: Any) -> None:
    data = bytes(dialect.MAVLink_attitude_message(5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0).pack(link))
    assert data[1] == 1  # only the stamp's first byte is sent
    [packet] = PacketReader(layouts()).feed(data)
    assert fields(packet)["time_boot_ms"] == 5
    assert fields(packet)["yawspeed"] == 0.0


def test_version_1_and_signed_packets(link: Any) -> None:
    reader = PacketReader(layouts())
    old = v10.MAVLink(None, srcSystem=7, srcComponent=1)
    [packet] = reader.feed(bytes(v10.MAVLink_attitude_message(99, 0.5, 0, 0, 0, 0, 0).pack(old)))
    assert (packet.system, fields(packet)["time_boot_ms"], fields(packet)["roll"]) == (7, 99, 0.5)
    link.signing.secret_key, link.signing.sign_outgoing = bytes(32), True
    [packet] = reader.feed(attitude(link, roll=0.125))
    assert fields(packet)["roll"] == 0.125
    assert (reader.counts["packets_version_1"], reader.counts["packets_signed"]) == (1, 1)


def test_packets_between_garbage_and_cut_anywhere_are_read(link: Any) -> None:
    random = np.random.default_rng(1)
    data = b"".join(
        random.bytes(int(n)) + attitude(link, 1000 + k) for k, n in enumerate(random.integers(0, 400, 60))
    )
    reader, found = PacketReader(layouts()), []
    for start in range(0, len(data), 37):
        found += reader.feed(data[start : start + 37])
    found += reader.feed(bytes(300))
    stamps = [int(fields(p)["time_boot_ms"]) for p in found if p.layout and p.layout.name == "ATTITUDE"]
    assert stamps == list(range(1000, 1060))
    assert reader.counts["bytes_between"] > 5000


def test_a_packet_cut_short_costs_itself_alone(link: Any) -> None:
    whole = [attitude(link, k) for k in range(4)]
    reader = PacketReader(layouts())
    found = [p for data in (whole[0], whole[1][:20], whole[2], whole[3]) for p in reader.feed(data)]
    assert [int(fields(p)["time_boot_ms"]) for p in found] == [0, 2, 3]
    assert reader.counts["packets_damaged"] == 1


def test_a_wrong_bit_is_no_packet_and_an_unknown_message_only_counts(link: Any) -> None:
    reader, data = PacketReader(layouts()), bytearray(attitude(link))
    data[15] ^= 4
    assert reader.feed(bytes(data)) == []
    unknown = struct.pack("<BBBBBBBHB", 0xFD, 3, 0, 0, 9, 7, 1, 60_001, 0) + b"abc\x01\x02"
    assert reader.feed(unknown) == []  # behind damage it may be anything
    reader.feed(attitude(link))
    [packet, after] = reader.feed(unknown + attitude(link))
    assert packet.layout is None
    assert after.layout is not None
    assert reader.counts["packets_unknown"] == 1


def test_random_bytes_never_end_a_reader() -> None:
    random, reader = np.random.default_rng(3), PacketReader(layouts())
    for _ in range(200):
        reader.feed(random.bytes(500))
        reader.feed(bytes(random.choice([0xFD, 0xFE, 0, 1], 200).astype(np.uint8)))
    assert reader.counts["bytes_between"] + reader.counts["packets_unknown"] > 10_000


class TestSequences:
    def test_lost_repeated_and_late_packets_are_counted(self) -> None:
        sequence = PacketSequence()
        for number in (250, 251, 252, 255, 0, 1):
            assert sequence.arrived(number, number)
        assert (sequence.lost, sequence.repeated, sequence.late) == (2, 0, 0)
        assert not sequence.arrived(1, 1)
        assert not sequence.arrived(0, 0)
        assert sequence.arrived(253, 253)
        assert (sequence.lost, sequence.repeated, sequence.late) == (1, 2, 1)

    def test_a_restart_is_no_loss(self) -> None:
        sequence = PacketSequence()
        for number in (200, 201, 0, 1, 2):
            sequence.arrived(number, number)
        assert sequence.lost == 54
        sequence.restarted()
        assert sequence.lost == 0


class TestClock:
    def test_the_quickest_packet_gives_the_offset_and_clocks_may_drift(self) -> None:
        clock = BootClock()
        random = np.random.default_rng(5)
        for k in range(4000):
            assert (
                clock.stamped(k / 10.0, 1000.0 + k / 10.0 * (1.0 - 1e-4) + random.exponential(0.02))
                is Stamp.GOOD
            )
        assert clock.offset_s == pytest.approx(1000.0 - 0.04, abs=0.008)  # of the last one to two minutes
        assert clock.placed(1400.0) == pytest.approx(400.04, abs=0.008)

    def test_a_round_trip_distinguishes_delay_and_offset(self) -> None:
        clock = BootClock()
        clock.stamped(10.0, 110.05)
        assert np.isnan(clock.true_offset_s)
        clock.round_trip(112.0, 112.1, 12.05)
        assert clock.true_offset_s == pytest.approx(100.0)
        clock.round_trip(112.0, 112.02, 1.7e9)  # another clock: Unix time
        assert np.isnan(clock.true_offset_s)

    def test_one_reading_far_off_is_dropped_and_four_are_a_restart(self) -> None:
        clock = BootClock()
        for k in range(20):
            clock.stamped(100.0 + k, 200.0 + k)
        assert clock.stamped(3.0, 220.0) is Stamp.DOUBTFUL
        assert clock.stamped(121.0, 221.0) is Stamp.GOOD
        assert (clock.off, clock.restarts) == (1, 0)
        verdicts = [clock.stamped(2.0 + k, 225.0 + k) for k in range(4)]
        assert verdicts == [Stamp.DOUBTFUL] * 3 + [Stamp.RESTART]
        assert clock.offset_s == 223.0

    def test_a_leap_ahead_goes_on_and_a_link_that_held_packets_back_is_none(self) -> None:
        clock = BootClock()
        clock.stamped(10.0, 20.0)
        assert clock.stamped(11.0, 28.0) is Stamp.GOOD  # 7 s late
        verdicts = [clock.stamped(60.0 + k, 30.0 + k) for k in range(4)]
        assert verdicts[-1] is Stamp.JUMP
        assert (clock.jumps, clock.restarts, clock.offset_s) == (1, 0, -30.0)


def test_what_messages_say_beside_their_fields() -> None:
    assert boot_s(1500, None) == 1.5
    assert boot_s(None, 2_500_000) == 2.5
    assert np.isnan(boot_s(None, 1.7e15))
    assert next_wrap_s(5.0, 4300.0) == pytest.approx(4299.967296)
    assert next_wrap_s(4290.0, 4290.5) == 4290.0
    integer = struct.unpack("<f", struct.pack("<i", 201))[0]
    assert parameter_value(integer, 6, "px4") == 201.0
    assert parameter_value(201.0, 6, "ardupilot") == 201.0
    assert is_vehicle(1, 3)
    assert not is_vehicle(6, 8)
    assert not is_vehicle(1, 8)
