"""What ``wingwatch bridge mavlink`` costs: ten vehicles at 50 Hz over UDP on loopback into Zenoh, and what is lost.

The vehicles, the Zenoh router and whoever subscribes are a process of their own; this one is the bridge alone. Each
vehicle sends attitude, accelerometers and servo outputs at 50 Hz, airspeed and pressure at 10 Hz, position at 5 Hz and
a heartbeat a second. Then the same packets are parsed alone, by the bridge's reader and by pymavlink's.

Run: python benchmarks/mavlink_bridge.py [--vehicles N] [--seconds S] [--rate HZ]
"""

import argparse
import multiprocessing
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from loopback import free_endpoint
from pymavlink.dialects.v20 import ardupilotmega as dialect
from saving import run_benchmark

from wingwatch.cli.bridge_command import Bridge
from wingwatch.telemetry import AircraftMessage, ZenohSettings, decode_sensors, open_session
from wingwatch.telemetry.mavlink import LinkReceiver, LinkRequests, open_connection
from wingwatch.telemetry.mavlink.dialect import layouts
from wingwatch.telemetry.mavlink.packets import PacketReader

SEED, SETTLE_S, PATIENCE_S = 20_260, 8.0, 30.0
SERVOS = {1: 4, 2: 19, 3: 70, 4: 21}
TRAVEL = dict.fromkeys(("elevator_rad", "aileron_rad", "rudder_rad"), 0.4)


@dataclass(frozen=True, slots=True)
class Sent:
    """What the vehicles sent, and what the subscriber had of it.

    Attributes:
        packets: of all vehicles.
        samples: that came over Zenoh.
    """

    packets: int
    samples: int


def parameters() -> Iterator[tuple[str, float]]:
    """Of an aeroplane's servo outputs."""
    for number, function in SERVOS.items():
        for name, value in {
            "FUNCTION": function,
            "MIN": 1000,
            "TRIM": 1500,
            "MAX": 2000,
            "REVERSED": 0,
        }.items():
            yield f"SERVO{number}_{name}", float(value)


class Sender:
    """One vehicle: packets of one instant after another."""

    def __init__(self, system: int, rate_hz: float) -> None:
        self._link = dialect.MAVLink(None, srcSystem=system, srcComponent=1)
        self._random = np.random.default_rng((SEED, system))
        self._rate_hz = rate_hz

    def packets(self, k: int) -> list[bytes]:
        """Of the k-th instant."""
        rate, ms = round(self._rate_hz), round(1000.0 * (20.0 + k / self._rate_hz))
        angles = self._random.normal(0.0, 0.1, 6).tolist()
        force = self._random.normal(0.0, 50.0, 3).astype(int).tolist()
        servos = self._random.integers(1300, 1700, 4).tolist()
        messages = [
            dialect.MAVLink_attitude_message(ms, *angles),
            dialect.MAVLink_scaled_imu_message(ms, *force, 0, 0, 0, 0, 0, 0),
            dialect.MAVLink_servo_output_raw_message(1000 * ms, 0, *servos, 0, 0, 0, 0),
        ]
        if k % max(1, rate // 10) == 0:
            messages += [
                dialect.MAVLink_vfr_hud_message(25.0, 25.0, 0, 78, 100.0, 0.0),
                dialect.MAVLink_scaled_pressure_message(ms, 900.0 + angles[0], 0.0, 2500),
            ]
        if k % max(1, rate // 5) == 0:
            messages.append(
                dialect.MAVLink_global_position_int_message(
                    ms, 500000000, 100000000, 900000, 9000, 10, 20, 0, 0
                )
            )
        if k % rate == 0:
            messages.append(dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 0, 3))
        return [self._pack(message) for message in messages]

    def first(self) -> list[bytes]:
        """Parameters."""
        return [
            self._pack(dialect.MAVLink_param_value_message(name.encode(), value, 9, 20, 0))
            for name, value in parameters()
        ]

    def _pack(self, message: Any) -> bytes:
        data = bytes(message.pack(self._link))
        self._link.seq = (self._link.seq + 1) % 256
        return data


def fly(pipe: Connection, endpoint: str, port: int, vehicles: int, seconds: float, rate_hz: float) -> None:
    """Router, subscriber and vehicles; sends what was sent and had through the pipe."""
    senders = [Sender(1 + i, rate_hz) for i in range(vehicles)]
    first = [one for s in senders for one in s.first()]
    flight = [[s.packets(k) for s in senders] for k in range(round(seconds * rate_hz))]
    samples, packets = 0, 0

    def count(sample: Any) -> None:
        nonlocal samples
        samples += len(decode_sensors(sample.payload.to_bytes(), str(sample.encoding)).block)

    with (
        open_session(ZenohSettings.for_service(listen=(endpoint,))) as session,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out,
    ):
        subscriber: Any = session.declare_subscriber("wingwatch/v1/*/*/sensors", count)
        pipe.send("ready")
        pipe.recv()
        address = ("127.0.0.1", port)
        for data in first:
            out.sendto(data, address)
        begin_s = time.monotonic()
        for k, instant in enumerate(flight):
            for i, each in enumerate(instant):
                time.sleep(max(0.0, begin_s + (k + i / vehicles) / rate_hz - time.monotonic()))
                for data in each:
                    out.sendto(data, address)
                packets += len(each)
        pipe.send("sent")
        pipe.recv()
        time.sleep(1.0)
        subscriber.undeclare()
    pipe.send(Sent(packets + len(first), samples))


def run(vehicles: int, seconds: float, rate_hz: float) -> None:
    """One flight; prints its figures."""
    endpoint = free_endpoint()
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    names: dict[int | None, str] = {1 + i: f"v{i}" for i in range(vehicles)}
    receiver = LinkReceiver(names, dict.fromkeys(names.values(), TRAVEL))
    aircraft = {name: AircraftMessage(aircraft="aerosonde") for name in names.values()}
    with open_connection("udpin:127.0.0.1:0") as link:
        assert link.address is not None
        flight = context.Process(
            target=fly,
            args=(there, endpoint, link.address[1], vehicles, SETTLE_S + seconds, rate_hz),
            daemon=True,
        )
        flight.start()
        if not here.poll(PATIENCE_S * 4.0):
            raise TimeoutError("the vehicles did not come up; run it again")
        here.recv()
        with (
            open_session(ZenohSettings.for_vehicle((endpoint,))) as session,
            Bridge(link, receiver, session, "default", aircraft) as bridge,
        ):
            requests = LinkRequests(link.send)
            here.send("go")
            begin_s = time.monotonic()
            while time.monotonic() < begin_s + SETTLE_S:
                bridge.step(requests)
            cpu_s, wall_s = time.process_time(), time.monotonic()
            while time.monotonic() < wall_s + seconds:
                bridge.step(requests)
            share = (time.process_time() - cpu_s) / (time.monotonic() - wall_s)
            while not here.poll():
                bridge.step(requests)
            here.recv()
            bridge.step(requests)
            bridge.finish()
            report = bridge.report()
            here.send("end")
            sent: Sent = here.recv()
        flight.join(PATIENCE_S)
    made = sum(one["samples"] for one in report["vehicles"])
    lost = sum(one["packets_lost"] for one in report["vehicles"])
    print(
        f"  {'packets sent, taken in, lost':<52}{sent.packets:10d}{report['link']['packets']:10d}{lost:10d}"
    )
    print(f"  {'samples made, had over Zenoh':<52}{made:10d}{sent.samples:10d}")
    print(f"  {'processor, of one core':<52}{100.0 * share:9.1f} %")


def parse_alone(vehicles: int, rate_hz: float) -> None:
    """Ten seconds of packets through either parser."""
    senders = [Sender(1 + i, rate_hz) for i in range(vehicles)]
    packets = [one for k in range(round(10.0 * rate_hz)) for s in senders for one in s.packets(k)]
    reader = PacketReader(layouts())
    begin_s = time.process_time()
    for data in packets:
        reader.feed(data)
    own_s = time.process_time() - begin_s
    peer = dialect.MAVLink(None)
    begin_s = time.process_time()
    for data in packets:
        peer.parse_buffer(data)
    peer_s = time.process_time() - begin_s
    per_s = len(packets) / 10.0
    for label, cost_s in (("the bridge's reader", own_s), ("pymavlink's", peer_s)):
        each = cost_s / len(packets)
        print(
            f"  {f'a packet by {label}, us; share of a core':<52}{1e6 * each:10.1f}{100.0 * each * per_s:9.1f} %"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description="Cost and loss of the MAVLink bridge.")
    parser.add_argument("--vehicles", type=int, default=10, help="1 to 100 (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=30.0, help="measured, after 8 s; at least 1")
    parser.add_argument("--rate", type=float, default=50.0, help="Hz, 10 to 200 (default: %(default)s)")
    given = parser.parse_args()
    if not (1 <= given.vehicles <= 100 and given.seconds >= 1.0 and 10.0 <= given.rate <= 200.0):
        parser.error("give 1 to 100 vehicles, at least 1 s and 10 to 200 Hz")
    print(f"{given.vehicles} vehicles at {given.rate:g} Hz for {given.seconds:g} s")
    run(given.vehicles, given.seconds, given.rate)
    parse_alone(given.vehicles, given.rate)


if __name__ == "__main__":
    run_benchmark(main)
