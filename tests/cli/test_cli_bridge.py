"""`wingwatch bridge mavlink`: a real sender on loopback, a real Zenoh subscriber, and what is refused."""

import os
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")

from flown_logs import flown
from loopback import free_endpoint, free_port
from mavlink_links import LINK_S, TRAVEL, MavlinkVehicle, received, samples
from test_telemetry_mavlink_link import in_flight

from wingwatch.cli.bridge_command import Bridge
from wingwatch.cli.bridge_report import bridge_object, bridge_sentences
from wingwatch.cli.main import main
from wingwatch.telemetry import (
    AircraftMessage,
    InboundMessage,
    SampleBlock,
    SensorSubscriber,
    ZenohSettings,
    decode_aircraft,
    decode_sensors,
    load_flight,
    open_session,
    write_flight,
)
from wingwatch.telemetry.mavlink import Arrival, LinkReceiver, MavlinkConnection, open_connection
from wingwatch.telemetry.zenoh_link import LinkError

PATIENCE_S = 20.0
COMMAND = "from wingwatch.cli.main import main; raise SystemExit(main())"


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def awaited(link: MavlinkConnection) -> list[Arrival]:
    """What comes first."""
    arrivals: list[Arrival] = []

    def read() -> bool:
        arrivals.extend(link.read(0.1))
        return bool(arrivals)

    until(read)
    return arrivals


@contextmanager
def bridge(*arguments: str) -> Iterator["subprocess.Popen[str]"]:
    """The command as a process of its own, once its link is open."""
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "bridge", "mavlink", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ},
    )  # fmt: skip
    try:
        assert process.stderr is not None
        assert "is open" in process.stderr.readline()
        yield process
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdout, process.stderr):
            assert pipe is not None
            pipe.close()


def test_a_flight_over_a_real_link_is_what_its_telemetry_log_holds(tmp_path: Path) -> None:
    """Sent in real time over UDP; ended by SIGTERM; every counter in the report."""
    packets = list(MavlinkVehicle(every={"VFR_HUD": 5, "SCALED_PRESSURE": 5}).flight(in_flight(6.5)))
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"".join(struct.pack(">Q", round((1.7e9 + t + LINK_S) * 1e6)) + d for t, d in packets))
    endpoint, port = free_endpoint(), free_port()
    blocks: list[SampleBlock] = []
    aircraft: list[str] = []

    def hear(sample: Any) -> None:
        payload, encoding = sample.payload.to_bytes(), str(sample.encoding)
        if str(sample.key_expr).endswith("sensors"):
            blocks.append(decode_sensors(payload, encoding).block)
        else:
            aircraft.append(decode_aircraft(payload, encoding).aircraft)

    with (
        open_session(ZenohSettings.for_service(listen=(endpoint,))) as session,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        subscriber: Any = session.declare_subscriber("wingwatch/v1/fleet/uav1/*", hear)
        link = ("--connect", f"udp:127.0.0.1:{port}", "--router", endpoint, "--json")
        with bridge(*link, "--vehicle", "uav1", "--aircraft", "aerosonde", "--fleet", "fleet") as process:
            begin_s = time.monotonic() - packets[0][0]
            for sent_s, data in packets:
                time.sleep(max(0.0, begin_s + sent_s - time.monotonic()))
                sender.sendto(data, ("127.0.0.1", port))
            until(lambda: bool(blocks) and blocks[-1].time_s[-1] > 36.0)
            process.send_signal(signal.SIGTERM)
            out, err = process.communicate(timeout=PATIENCE_S)
        report = orjson.loads(out.splitlines()[-1])
        [vehicle] = report["vehicles"]
        until(lambda: sum(map(len, blocks)) == vehicle["samples"])
        subscriber.undeclare()
    assert (process.returncode, err) == (0, "")
    assert aircraft
    assert set(aircraft) == {"aerosonde"}
    live, read = SampleBlock.concatenate(blocks), load_flight(path, None, TRAVEL).block
    rows = np.searchsorted(live.time_s, read.time_s - 1e-6)
    assert np.allclose(live.time_s[rows], read.time_s, atol=1e-9)
    for name in (
        "roll_rate_rad_s",
        "roll_rad",
        "specific_force_z_m_s2",
        "elevator_rad",
        "altitude_m",
        "rudder_rad",
    ):
        assert np.array_equal(live.column(name)[rows], read.column(name), equal_nan=True), name
    # what carries no stamp is placed by when it came, so a row more or less on a busy machine
    airspeed = np.abs(live.column("airspeed_true_m_s")[rows] - read.column("airspeed_true_m_s"))
    assert np.nanmedian(airspeed) < 0.1
    assert report["ended"]
    assert vehicle["packets_lost"] == vehicle["packets_repeated"] == vehicle["restarts"] == 0
    assert vehicle["samples"] == len(live)
    assert live.time_s[-1] == pytest.approx(36.48)
    assert vehicle["rates_hz"]["airspeed_indicated_m_s"] == pytest.approx(10.0, rel=0.1)
    assert vehicle["modes"]["short_period"]["can_be_estimated"]
    assert report["link"]["packets"] == len(packets)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--connect", "udp:here"], "is no MAVLink link: write udp:HOST:PORT"),
        (["--connect", "udp:127.0.0.1:99999"], "port 99999 is none"),
        (["--connect", "/dev/null"], "is no serial device"),
        (["--connect", "tcp:127.0.0.1:{free}"], "connection refused; start what listens there"),
        (["--connect", "udpin:203.0.113.1:14550"], "choose another port, or an address of this machine"),
        (["--connect", "udp:127.0.0.1:0", "--vehicle", "b"], "the first system that sends is 'a' already"),
        (["--connect", "udp:127.0.0.1:0", "--vehicle", "300=b"], "systems are 1 to 255"),
        (["--connect", "udp:127.0.0.1:0", "--vehicle", "3=B"], "is no valid name"),
        (["--connect", "udp:127.0.0.1:0", "--aircraft", "b=aerosonde"], "no vehicle is called 'b'"),
        (["--connect", "udp:127.0.0.1:0", "--listen-only", "--request-rates", "20"], "leave one out"),
    ],
)  # fmt: skip
def test_wrong_usage_is_one_sentence(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [one.format(free=free_port()) for one in arguments]
    assert main(["bridge", "mavlink", "--vehicle", "a", "--aircraft", "aerosonde", *given]) == 2
    said = capsys.readouterr().err.strip()
    assert sentence in said
    assert "\n" not in said


def test_without_pymavlink_the_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from wingwatch.telemetry.mavlink.dialect import layouts

    layouts.cache_clear()
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    link = ["--connect", "udp:127.0.0.1:0"]
    assert main(["bridge", "mavlink", *link, "--vehicle", "a", "--aircraft", "aerosonde"]) == 2
    assert "install wingwatch with its extra logs" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["udpin", "tcpin", "tcp", "udpout"])
def test_bytes_come_and_go_over_every_kind_of_link(kind: str) -> None:
    """Each side of UDP and TCP; what is sent back reaches the sender."""
    stream = kind.startswith("tcp")
    peer = socket.socket(socket.AF_INET, socket.SOCK_STREAM if stream else socket.SOCK_DGRAM)
    peer.settimeout(PATIENCE_S)
    with peer:
        if kind in ("tcp", "udpout"):
            peer.bind(("127.0.0.1", 0))
            if stream:
                peer.listen(1)
            link = open_connection(f"{kind}:127.0.0.1:{peer.getsockname()[1]}")
        else:
            link = open_connection(f"{kind}:127.0.0.1:0")
        with link:
            assert link.address is not None
            end = peer
            if kind == "tcp":
                end, _ = peer.accept()
            elif kind == "udpout":
                link.send(b"first")
                _, address = peer.recvfrom(100)
                peer.connect(address)
            else:
                peer.connect(link.address)
            with end:
                end.send(b"hello")
                arrivals = awaited(link)
                assert arrivals[0].data == b"hello"
                link.send(b"answer", arrivals[0].source)
                assert end.recv(100) == b"answer"


def test_a_tcp_peer_that_goes_away_is_found_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE_S)
        with open_connection(f"tcp:127.0.0.1:{server.getsockname()[1]}") as link:
            first, _ = server.accept()
            first.close()
            until(lambda: link.read(0.05) == [] and link.interruptions == 1)
            link._again_s = 0.0  # now, not in a second
            link.read(0.01)
            second, _ = server.accept()
            with second:
                second.send(b"again")
                arrivals = awaited(link)
            assert arrivals[0].data == b"again"


def test_a_serial_line_is_read_and_written() -> None:
    far, near = os.openpty()
    try:
        with open_connection(os.ttyname(near), baud=115_200) as link:
            os.write(far, b"\xfd\x00hello")
            arrivals = awaited(link)
            assert b"".join(one.data for one in arrivals) == b"\xfd\x00hello"
            link.send(b"\x00\xffback", arrivals[0].source)
            assert os.read(far, 100) == b"\x00\xffback"
        with pytest.raises(LinkError, match="is no rate of a serial line"):
            open_connection(os.ttyname(near), baud=12_345)
    finally:
        os.close(far)
        os.close(near)


def test_telemetry_of_4_hz_is_not_observable_and_never_healthy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Surfaces move, and no mode can be resolved."""
    block = flown(60.0)
    columns: dict[str, np.ndarray] = {n: np.array(block.column(n)) for n in block.present}
    columns["time_s"] = 30.0 + 0.02 * np.arange(len(block))
    slow = dict.fromkeys(("ATTITUDE", "SCALED_IMU", "SERVO_OUTPUT_RAW", "VFR_HUD", "SCALED_PRESSURE"), 12)
    _, pieces = received(MavlinkVehicle(every=slow).flight(columns))
    path = tmp_path / "slow.parquet"
    write_flight(samples(pieces["uav1"]), path)
    assert main(["monitor", str(path), "--aircraft", "aerosonde", "--json"]) == 0
    found = orjson.loads(capsys.readouterr().out)
    assert found["status"] == "not_observable"
    assert found["reason"]
    assert found["alerts"] == []


def test_a_report_says_what_is_missing_and_who_is_not_named() -> None:
    receiver = LinkReceiver({1: "uav1", 4: "uav4"}, {"uav1": TRAVEL, "uav4": TRAVEL})
    vehicle, other = MavlinkVehicle(parameters={}), MavlinkVehicle(system=9)
    for t, data in vehicle.flight(in_flight(16.0)):
        receiver.feed(data, t)
        receiver.systems[1].vehicle.step(t) if t % 1.0 < 0.01 and 1 in receiver.systems else None
    receiver.feed(other.heartbeat(), 46.0)
    report = bridge_object(receiver, {"uav1": 3}, 30.0, 56.0)
    assert report["not_heard"] == ["uav4"]
    assert report["not_named"] == {"9": 1}
    [one] = report["vehicles"]
    assert {"elevator_rad", "angle_of_attack_rad"} <= set(one["missing"])
    assert one["clock_offset_by"] == "smallest delay"
    assert one["silent_s"] == pytest.approx(10.0, abs=0.1)
    said = "\n".join(bridge_sentences(report))
    assert "uav1 (system 1): short_period: cannot be estimated without elevator_rad" in said
    assert "received without a name: system 9" in said
    assert "uav1 (system 1): nothing has come for 10 s" in said


def test_a_vehicle_that_was_started_anew_is_taken_at_once() -> None:
    """It leaves and comes again, so a service does not refuse it as a second vehicle of its name."""
    endpoint, sent = free_endpoint(), MavlinkVehicle()
    before = list(sent.flight(in_flight(4.0, from_s=500.0)))
    sent.link.seq = 0
    packets = [*before, *((t + 502.0, data) for t, data in sent.flight(in_flight(4.0, from_s=2.0)))]
    _, pieces = received(packets)
    assert {piece.stream for piece in pieces["uav1"]} == {1, 2}
    aircraft = {"uav1": AircraftMessage(aircraft="aerosonde")}
    came: list[InboundMessage] = []
    with (
        open_session(ZenohSettings.for_service(listen=(endpoint,))) as session,
        SensorSubscriber(session, time.monotonic) as subscriber,
        open_session(ZenohSettings.for_vehicle((endpoint,))) as vehicle,
        open_connection("udpin:127.0.0.1:0") as link,
        Bridge(link, LinkReceiver({}, {}), vehicle, "default", aircraft) as bridge,
    ):
        for piece in pieces["uav1"]:
            bridge.put("uav1", piece)

        def all_came() -> bool:
            came.extend(subscriber.drain(10_000))
            blocks = [decode_sensors(m.payload, m.encoding).block for m in came if m.stream == "sensors"]
            return sum(map(len, blocks)) == len(samples(pieces["uav1"]))

        until(all_came)
    kinds = [message.stream for message in came]
    assert kinds.count("aircraft") == 2
    left, second = kinds.index("left"), len(kinds) - 1 - kinds[::-1].index("aircraft")
    assert left < second  # its name is free before the vehicle comes again
    sensors = [decode_sensors(m.payload, m.encoding) for m in came if m.stream == "sensors"]
    assert len({message.stream for message in sensors}) == 2
    assert np.array_equal(
        SampleBlock.concatenate([m.block for m in sensors]).time_s, samples(pieces["uav1"]).time_s
    )
