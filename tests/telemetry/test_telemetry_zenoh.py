"""Real Zenoh sessions on loopback."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zenoh
from loopback import free_endpoint
from telemetry_flights import THOR75, THOR75_MAP, flight_block, same

from wingwatch.telemetry import (
    CHANNEL_NAMES,
    DEFAULT_ENDPOINT,
    JSON,
    PROTOBUF,
    AircraftMessage,
    Cleaner,
    FlightPublisher,
    InboundMessage,
    KeyNameError,
    LinkError,
    MessageError,
    MessageLimits,
    SampleBlock,
    SensorSubscriber,
    SequenceTracker,
    ZenohSettings,
    complete,
    decode_aircraft,
    decode_sensors,
    encode_sensors,
    load_flight,
    open_session,
    parse_map,
    vehicle_key,
    with_free_ports,
)
from wingwatch.telemetry.protocol import vehicle_pb2

AEROSONDE = AircraftMessage(aircraft="aerosonde")
PATIENCE_S = 60.0


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()


@pytest.fixture
def service(endpoint: str) -> Iterator[zenoh.Session]:
    with open_session(ZenohSettings.for_service(listen=(endpoint,))) as session:
        yield session


@pytest.fixture
def subscriber(service: zenoh.Session) -> Iterator[SensorSubscriber]:
    with SensorSubscriber(service, time.monotonic) as subscriber:
        yield subscriber


def until(condition: Callable[[], bool]) -> None:
    """Waits for something that another thread brings about."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)


def collect(subscriber: SensorSubscriber, messages: int) -> list[InboundMessage]:
    """That many messages, and none after them for a moment; that a vehicle leaves is none."""
    taken: list[InboundMessage] = []

    def enough() -> bool:
        taken.extend(message for message in subscriber.drain(1_000_000) if message.stream != "left")
        return len(taken) >= messages

    until(enough)
    time.sleep(0.05)
    enough()
    assert len(taken) == messages
    return taken


def announced(message: InboundMessage) -> AircraftMessage:
    """What a vehicle says it is; its stream is another at each start."""
    return decode_aircraft(message.payload, message.encoding).model_copy(update={"stream": None})


def samples_of(messages: list[InboundMessage]) -> SampleBlock:
    sensors = [message for message in messages if message.stream == "sensors"]
    return SampleBlock.concatenate([decode_sensors(m.payload, m.encoding).block for m in sensors])


def vehicle(endpoint: str) -> ZenohSettings:
    return ZenohSettings.for_vehicle((endpoint,))


class TestPublishing:
    def test_a_flight_arrives_whole_in_order_and_to_the_bit(
        self, endpoint: str, subscriber: SensorSubscriber
    ) -> None:
        block = complete(flight_block(2_005, rudder_rad=np.linspace(-0.1, 0.1, 2_005)))
        with (
            open_session(vehicle(endpoint)) as session,
            FlightPublisher(session, "f", "uav1", AEROSONDE) as publisher,
        ):
            assert publisher.publish(block, None) == 201
        messages = collect(subscriber, 202)
        assert [message.stream for message in messages] == ["aircraft"] + ["sensors"] * 201
        assert {(message.fleet, message.vehicle) for message in messages} == {("f", "uav1")}
        assert announced(messages[0]) == AEROSONDE
        assert same(samples_of(messages), block)
        tracker = SequenceTracker()
        for message in messages[1:]:
            decoded = decode_sensors(message.payload, message.encoding)
            assert decoded.stream is not None
            assert tracker.observe(decoded.sequence, decoded.stream, *decoded.span_s)
        assert not any(tracker.counts.values())
        received = [message.received_s for message in messages]
        assert received == sorted(received)

    @pytest.mark.skipif(not THOR75.exists(), reason="the recorded flight thor75 is not beside the repository")
    def test_the_real_flight_arrives_as_the_file_has_it(
        self, endpoint: str, subscriber: SensorSubscriber
    ) -> None:
        flight = load_flight(THOR75, parse_map(THOR75_MAP))
        with (
            open_session(vehicle(endpoint)) as session,
            FlightPublisher(session, "f", "thor", AEROSONDE) as publisher,
        ):
            messages = publisher.publish(flight.block, None, columns=flight.wire_columns)
        received = samples_of(collect(subscriber, messages + 1))
        assert np.array_equal(received.values, flight.block.values, equal_nan=True)

    def test_through_a_router_and_with_the_service_as_its_client(self, endpoint: str) -> None:
        router = ZenohSettings(mode="router", listen=(endpoint,))
        service = ZenohSettings.for_service(connect=(endpoint,))
        with (
            open_session(router),
            open_session(service) as receiving,
            SensorSubscriber(receiving, time.monotonic) as subscriber,
            open_session(vehicle(endpoint)) as sending,
            FlightPublisher(sending, "f", "uav1", AEROSONDE) as publisher,
        ):
            publisher.publish(flight_block(1_000), None)
            assert len(samples_of(collect(subscriber, 101))) == 1_000

    def test_real_time_keeps_the_stamps_pace(self, endpoint: str, subscriber: SensorSubscriber) -> None:
        waits: list[float] = []
        now = [100.0]

        def sleep(seconds: float) -> None:
            waits.append(seconds)
            now[0] += seconds

        with (
            open_session(vehicle(endpoint)) as session,
            FlightPublisher(session, "f", "uav1", AEROSONDE, clock=lambda: now[0], sleep=sleep) as publisher,
        ):
            until(lambda: publisher.wait_for_receiver(0.0))
            waits.clear()
            assert publisher.publish(flight_block(50), 2.0) == 5
        # the last sample of each ten is due 9, 19, ... steps of 20 ms after the first, at twice the pace
        np.testing.assert_allclose(waits, [0.09, 0.1, 0.1, 0.1, 0.1], rtol=1e-9)
        assert len(samples_of(collect(subscriber, 6))) == 50

    def test_stamps_that_jump_or_are_missing_do_not_stop_the_clock(
        self, endpoint: str, subscriber: SensorSubscriber
    ) -> None:
        now = [0.0]

        def sleep(seconds: float) -> None:
            now[0] += seconds

        times = [0.0, 0.02, np.nan, 0.06, -258.0, -257.98, 1e300, 1.0]
        with (
            open_session(vehicle(endpoint)) as session,
            FlightPublisher(
                session, "f", "uav1", AEROSONDE, samples_per_message=1, clock=lambda: now[0], sleep=sleep
            ) as publisher,
        ):
            until(lambda: publisher.wait_for_receiver(0.0))
            begin = now[0]
            publisher.publish(flight_block(8, time_s=times))
        # two steps of 20 ms, and the leap forward cut to the longest pause
        assert now[0] - begin == pytest.approx(0.02 + 0.02 + 10.0)
        collect(subscriber, 9)

    def test_as_fast_as_possible_needs_somebody_who_listens(
        self, endpoint: str, service: zenoh.Session
    ) -> None:
        with (
            open_session(vehicle(endpoint)) as session,
            FlightPublisher(session, "f", "uav1", AEROSONDE) as publisher,
            pytest.raises(LinkError, match=r"nobody subscribes to wingwatch/v1/f/uav1/sensors within 0.1 s"),
        ):
            publisher.publish(flight_block(5), None, receiver_timeout_s=0.1)

    def test_a_receiver_that_goes_away_on_the_way_is_said(self, endpoint: str) -> None:
        block = flight_block(300_000)
        with ExitStack() as service:
            receiving = service.enter_context(open_session(ZenohSettings.for_service(listen=(endpoint,))))
            arrived = threading.Event()
            service.enter_context(SensorSubscriber(receiving, time.monotonic, arrived.set))

            def leave() -> None:
                arrived.wait(PATIENCE_S)
                service.close()

            leaving = threading.Thread(target=leave)
            leaving.start()
            with (
                open_session(vehicle(endpoint)) as session,
                FlightPublisher(session, "f", "uav1", AEROSONDE, samples_per_message=1) as publisher,
                pytest.raises(LinkError, match=r"link to the subscriber of .* broke at message"),
            ):
                publisher.publish(block, None)
            leaving.join()

    def test_a_vehicle_flies_on_when_nobody_listens(self, endpoint: str, service: zenoh.Session) -> None:
        with (
            open_session(vehicle(endpoint)) as session,
            FlightPublisher(session, "f", "uav1", AEROSONDE) as publisher,
        ):
            assert publisher.publish(flight_block(20), 100.0, receiver_timeout_s=0.1) == 2
            assert publisher.sequence == 2

    def test_names_rates_and_sizes_are_checked(self, service: zenoh.Session) -> None:
        with pytest.raises(KeyNameError, match="vehicle 'UAV 1'"):
            FlightPublisher(service, "f", "UAV 1", AEROSONDE)
        with pytest.raises(ValueError, match="samples_per_message is 0"):
            FlightPublisher(service, "f", "uav1", AEROSONDE, samples_per_message=0)
        with FlightPublisher(service, "f", "uav1", AEROSONDE) as publisher:
            with pytest.raises(ValueError, match="samples_per_message is 201: choose 1 to 200"):
                FlightPublisher(service, "f", "uav2", AEROSONDE, samples_per_message=201)
            for rate in (0.0, -1.0, float("nan"), float("inf")):
                with pytest.raises(ValueError, match="rate is"):
                    publisher.publish(flight_block(1), rate)

    def test_the_largest_message_fits_the_receivers_limit(self) -> None:
        payload = encode_sensors(2**63, flight_block(200), PROTOBUF, CHANNEL_NAMES)
        assert len(payload) <= MessageLimits().max_bytes


class TestWhoIsThere:
    def test_the_aircraft_is_answered_on_query_and_the_vehicle_is_alive_until_it_leaves(
        self, endpoint: str, service: zenoh.Session
    ) -> None:
        def alive() -> list[str]:
            return [
                str(reply.ok.key_expr)
                for reply in service.liveliness().get("wingwatch/alive/v1/**")
                if reply.ok
            ]

        def answers() -> list[AircraftMessage]:
            replies = [reply.ok for reply in service.get("wingwatch/v1/*/*/aircraft") if reply.ok]
            found = [decode_aircraft(reply.payload.to_bytes(), str(reply.encoding)) for reply in replies]
            return [one.model_copy(update={"stream": None}) for one in found]

        with open_session(vehicle(endpoint)) as session:
            with FlightPublisher(session, "f", "uav1", AEROSONDE) as publisher:
                until(lambda: alive() == ["wingwatch/alive/v1/f/uav1"])
                until(lambda: answers() == [AEROSONDE])
                heavier = AircraftMessage(aircraft="aerosonde", mass_kg=12.0)
                publisher.announce(heavier)
                assert answers() == [heavier]
            until(lambda: alive() == [])

    def test_a_service_that_starts_late_asks_for_the_aircraft(
        self, endpoint: str, service: zenoh.Session
    ) -> None:
        with open_session(vehicle(endpoint)) as session, FlightPublisher(session, "f", "uav1", AEROSONDE):
            until(lambda: bool([r for r in service.get("wingwatch/v1/*/*/aircraft") if r.ok]))
            with SensorSubscriber(service, time.monotonic) as late:
                (message,) = collect(late, 1)
        assert (message.stream, message.vehicle) == ("aircraft", "uav1")
        assert announced(message) == AEROSONDE

    def test_a_publisher_says_its_stream_in_both_messages_and_is_missed_when_it_leaves(
        self, endpoint: str, subscriber: SensorSubscriber
    ) -> None:
        taken: list[InboundMessage] = []

        def came(stream: str) -> list[InboundMessage]:
            taken.extend(subscriber.drain(100))
            return [message for message in taken if message.stream == stream]

        with open_session(vehicle(endpoint)) as session:
            with FlightPublisher(session, "f", "uav1", AEROSONDE) as publisher:
                publisher.publish(flight_block(10), None)
                until(lambda: bool(came("aircraft") and came("sensors")))
                assert not came("left")
            until(lambda: bool(came("left")))  # the session is still open
        aircraft, sensors, left = (came(stream)[0] for stream in ("aircraft", "sensors", "left"))
        stream = decode_aircraft(aircraft.payload, aircraft.encoding).stream
        assert stream is not None
        assert decode_sensors(sensors.payload, sensors.encoding).stream == stream
        assert (left.fleet, left.vehicle, left.payload) == ("f", "uav1", b"")

    def test_a_vehicle_that_is_asked_for_its_aircraft_answers_by_a_message(
        self, endpoint: str, service: zenoh.Session
    ) -> None:
        asked = []
        with (
            SensorSubscriber(service, time.monotonic) as subscriber,
            open_session(vehicle(endpoint)) as session,
        ):

            def answer(query: zenoh.Query) -> None:
                with query:
                    asked.append(str(query.key_expr))
                    query.reply(query.key_expr, b'{"aircraft": "late"}', encoding=JSON)

            with session.declare_queryable(vehicle_key("f", "uav1", "aircraft"), answer):
                until(lambda: bool([r for r in service.get("wingwatch/v1/*/*/aircraft") if r.ok]))
                asked.clear()
                subscriber.ask_aircraft("f", "uav1")
                (message,) = collect(subscriber, 1)
        assert (message.stream, message.vehicle) == ("aircraft", "uav1")
        assert asked == ["wingwatch/v1/f/uav1/aircraft"]


class TestStrangers:
    """Publishers written from the contract alone, on bare Zenoh."""

    @staticmethod
    def publish(endpoint: str, encoding: str, payloads: list[bytes], aircraft: bytes) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        with zenoh.open(config) as session:
            sensors = session.declare_publisher("wingwatch/v1/default/stranger/sensors")
            until(lambda: sensors.matching_status.matching)  # type: ignore[attr-defined]
            session.put("wingwatch/v1/default/stranger/aircraft", aircraft, encoding=encoding)
            for payload in payloads:
                sensors.put(payload, encoding=encoding)

    def test_json(self, endpoint: str, subscriber: SensorSubscriber) -> None:
        payloads = [
            json.dumps(
                {
                    "sequence": i,
                    "columns": {
                        "time_s": [0.04 * i, 0.04 * i + 0.02],
                        "airspeed_indicated_m_s": [25.0, 25.1],
                        "altitude_m": [1000.0, None],
                        "pitch_rate_rad_s": [0.01, 0.02],
                        "elevator_command_rad": [-0.05, -0.05],
                    },
                }
            ).encode()
            for i in range(3)
        ]
        self.publish(endpoint, "application/json", payloads, b'{"aircraft": "aerosonde", "mass_kg": 11.0}')
        messages = collect(subscriber, 4)
        assert decode_aircraft(messages[0].payload, messages[0].encoding).mass_kg == 11.0
        block = samples_of(messages)
        assert block.time_s.tolist() == [0.0, 0.02, 0.04, 0.06, 0.08, 0.1]
        assert block.column("elevator_rad").tolist() == [-0.05] * 6
        assert np.isfinite(block.column("airspeed_true_m_s")).tolist() == [True, False] * 3

    def test_protobuf(self, endpoint: str, subscriber: SensorSubscriber) -> None:
        payloads = [
            vehicle_pb2.Sensors(
                sequence=i, columns={"time_s": [0.1 * i], "roll_rad": [0.3]}
            ).SerializeToString()
            for i in range(3)
        ]
        aircraft = vehicle_pb2.Aircraft(aircraft="aerosonde").SerializeToString()
        self.publish(endpoint, "application/protobuf", payloads, aircraft)
        messages = collect(subscriber, 4)
        assert announced(messages[0]) == AEROSONDE
        assert samples_of(messages).column("roll_rad").tolist() == [0.3] * 3

    def test_the_fifteen_lines_of_the_manual(self, endpoint: str, subscriber: SensorSubscriber) -> None:
        manual = (Path(__file__).parents[2] / "docs" / "telemetry.md").read_text()
        program = manual.split("```python\n")[1].split("```")[0]
        assert len(program.strip().splitlines()) <= 15
        here = program.replace(DEFAULT_ENDPOINT, endpoint).replace("sleep(0.02)", "sleep(0.001)")
        subprocess.run([sys.executable, "-c", here], check=True, timeout=60)
        messages = collect(subscriber, 101)
        assert announced(messages[0]) == AEROSONDE
        assert Cleaner().clean(samples_of(messages)).report.counts == {"accepted": 100}


class TestBadInput:
    def test_keys_that_are_none_are_counted(
        self, service: zenoh.Session, subscriber: SensorSubscriber
    ) -> None:
        for name in ("UAV", "a b", "a\n", "ä"):
            service.put(f"wingwatch/v1/default/{name}/sensors", b"{}")
        service.put("wingwatch/v1/default/uav/sensors", b"{}")
        until(lambda: subscriber.counts["bad_key"] == 4)
        assert len(collect(subscriber, 1)) == 1

    def test_a_message_of_10_megabytes_is_rejected_by_count_and_costs_no_more_than_the_limit(
        self, endpoint: str, subscriber: SensorSubscriber
    ) -> None:
        with open_session(vehicle(endpoint)) as session:
            key = vehicle_key("f", "uav1", "sensors")
            with session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.BLOCK
            ) as publisher:
                until(lambda: publisher.matching_status.matching)  # type: ignore[attr-defined]
                publisher.put(b"x" * 10_000_000, encoding=PROTOBUF)
                publisher.put(
                    b"x" * 20_000_000, encoding=PROTOBUF
                )  # beyond the transport's limit: never put together
                publisher.put(b'{"columns": {"time_s": [1]}}', encoding=JSON)
                large, small = collect(subscriber, 2)
        assert len(large.payload) == 65_537
        with pytest.raises(MessageError) as caught:
            decode_sensors(large.payload, large.encoding)
        assert caught.value.reason == "too_large"
        assert len(decode_sensors(small.payload, small.encoding).block) == 1

    def test_a_full_queue_drops_the_newest_and_counts(self, service: zenoh.Session) -> None:
        with SensorSubscriber(service, time.monotonic, capacity=3, capacity_bytes=100) as subscriber:
            for i in range(5):
                service.put("wingwatch/v1/f/uav/sensors", str(i).encode())
            until(lambda: subscriber.counts["overflow"] == 2)
            assert [message.payload for message in subscriber.drain(10)] == [b"0", b"1", b"2"]
            service.put("wingwatch/v1/f/uav/sensors", b"x" * 60)
            service.put("wingwatch/v1/f/uav/sensors", b"x" * 60)
            until(lambda: subscriber.counts["overflow"] == 3)
            assert subscriber.counts == {"received": 4, "overflow": 3, "gave_way": 0, "bad_key": 0}

    def test_arrival_wakes_the_service_and_draining_takes_no_more_than_asked(
        self, service: zenoh.Session
    ) -> None:
        woken = []
        with SensorSubscriber(service, time.monotonic, lambda: woken.append(1)) as subscriber:
            for _ in range(4):
                service.put("wingwatch/v1/f/uav/sensors", b"{}")
            until(lambda: subscriber.waiting == 4 and bool(woken))
            assert [len(subscriber.drain(3)), len(subscriber.drain(3)), len(subscriber.drain(3))] == [3, 1, 0]

    def test_a_deletion_is_no_message(self, service: zenoh.Session, subscriber: SensorSubscriber) -> None:
        service.delete("wingwatch/v1/f/uav/sensors")
        service.put("wingwatch/v1/f/uav/sensors", b"{}")
        assert collect(subscriber, 1)[0].payload == b"{}"


class TestOpening:
    def test_a_port_in_use_is_said(self, endpoint: str, service: zenoh.Session) -> None:
        with (
            pytest.raises(LinkError, match=rf"cannot listen on {endpoint}: the port is in use"),
            open_session(ZenohSettings.for_service(listen=(endpoint,))),
        ):
            pass

    def test_nobody_at_the_endpoint_is_said_within_the_timeout(self, endpoint: str) -> None:
        begin = time.monotonic()
        settings = replace(vehicle(endpoint), open_timeout_s=0.5)
        with (
            pytest.raises(LinkError, match=rf"nothing answers at {endpoint} within 0.5 s"),
            open_session(settings),
        ):
            pass
        assert time.monotonic() - begin < 3.0

    @pytest.mark.parametrize(
        ("settings", "said"),
        [
            (ZenohSettings.for_service(listen=("garbage",)), "tcp/HOST:PORT"),
            (ZenohSettings.for_vehicle(("garbage",)), "tcp/HOST:PORT"),
            (ZenohSettings.for_vehicle(()), "needs an endpoint"),
            (ZenohSettings.for_service(listen=("tcp/127.0.0.1:99999",)), "invalid port"),
            (ZenohSettings.for_service(listen=("tcp/203.0.113.7:7447",)), "does not have that address"),
            (ZenohSettings.for_service(listen=("carrier/pigeon:1",)), "carrier"),
        ],
    )
    def test_an_endpoint_that_is_none_is_said(self, settings: ZenohSettings, said: str) -> None:
        with pytest.raises(LinkError, match=said) as caught, open_session(settings):
            pass
        assert "\n" not in str(caught.value)

    def test_nothing_listens_beyond_loopback_or_scouts_unless_told(self) -> None:
        config = ZenohSettings.for_service().config()
        assert json.loads(config.get_json("listen/endpoints")) == ["tcp/127.0.0.1:7447"]
        assert json.loads(config.get_json("scouting/multicast/enabled")) is False
        assert json.loads(config.get_json("transport/shared_memory/enabled")) is False
        assert json.loads(ZenohSettings.for_vehicle().config().get_json("listen/endpoints")) == []


def test_port_0_becomes_a_free_port_that_others_can_be_told() -> None:
    listen = with_free_ports(
        ("tcp/127.0.0.1:0", "udp/[::1]:0#iface=lo", DEFAULT_ENDPOINT, "tcp/no.such.host.invalid:0")
    )
    assert listen[2:] == (DEFAULT_ENDPOINT, "tcp/no.such.host.invalid:0")
    port = int(listen[0].removeprefix("tcp/127.0.0.1:"))
    assert port > 1023
    assert not listen[1].endswith(":0#iface=lo")
    with (
        open_session(ZenohSettings.for_service(listen=listen[:1])),
        open_session(ZenohSettings.for_vehicle(listen[:1])) as vehicle,
    ):
        assert len(list(vehicle.info.peers_zid())) == 1
