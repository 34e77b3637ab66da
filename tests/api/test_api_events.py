"""The event stream: what was missed is sent or said, silence is bridged, streams are bounded."""

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Coroutine
from dataclasses import dataclass
from typing import Any

import pytest
from api_fakes import FakeMonitor, served
from drawn_fleet import DrawnFleet

from wingwatch.api.events import EventStreams, Listener
from wingwatch.api.problems import ProblemError
from wingwatch.monitor.views import AlertAction, VehicleState


@dataclass(frozen=True)
class Frame:
    id: int | None
    kind: str
    data: Any


def frames(chunk: bytes) -> list[Frame]:
    """Events of a chunk, read as the HTML standard says; comments and retry lines are left out."""
    found = []
    for block in chunk.decode().split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.split("\n") if line and not line.startswith(":"))
        if "data" in fields:
            number = int(fields["id"]) if "id" in fields else None
            found.append(Frame(number, fields["event"], json.loads(fields["data"])))
    return found


async def take(stream: AsyncIterator[bytes], count: int) -> list[Frame]:
    found: list[Frame] = []
    while len(found) < count:
        found += frames(await anext(stream))
    return found


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(work, 10.0))


def monitor_with(count: int) -> FakeMonitor:
    monitor = FakeMonitor()
    for number in range(count):
        monitor.tell("status", {"number": number + 1})
    return monitor


def test_a_new_listener_gets_what_comes_after_it() -> None:
    async def work() -> None:
        monitor = monitor_with(3)
        stream = EventStreams(monitor).admit(None)
        assert frames(await anext(stream)) == []
        monitor.tell("alert", {"id": "a1", "size": float("nan"), "text": "line\nbreak"})
        (first,) = await take(stream, 1)
        assert first == Frame(4, "alert", {"id": "a1", "size": None, "text": "line\nbreak"})

    run(work())


def test_a_returning_listener_gets_what_it_missed_once_and_in_order() -> None:
    async def work() -> None:
        stream = EventStreams(monitor_with(5)).admit("2")
        assert [frame.id for frame in await take(stream, 3)] == [3, 4, 5]

    run(work())


def test_a_listener_learns_that_events_are_lost() -> None:
    async def work() -> None:
        stream = EventStreams(monitor_with(1500)).admit("3")
        found = await take(stream, 1001)
        assert (found[0].kind, found[0].id) == ("resync", None)
        assert "no longer kept" in found[0].data["reason"]
        assert [frame.id for frame in found[1:]] == list(range(501, 1501))

    run(work())


def test_a_slow_listener_learns_that_events_were_lost_while_it_slept() -> None:
    async def work() -> None:
        monitor = monitor_with(1)
        stream = EventStreams(monitor).admit("0")
        assert [frame.id for frame in await take(stream, 1)] == [1]
        for _ in range(1200):
            monitor.tell("derivatives", {})
        assert (await take(stream, 1))[0].kind == "resync"

    run(work())


def test_a_listener_of_an_earlier_service_is_told_to_read_again() -> None:
    async def work() -> None:
        monitor = monitor_with(2)
        stream = EventStreams(monitor).admit("5000")
        (first,) = await take(stream, 1)
        assert first.kind == "resync"
        assert "started anew" in first.data["reason"]
        monitor.tell("status", {})
        assert [frame.id for frame in await take(stream, 1)] == [3]

    run(work())


def test_who_comes_back_to_a_large_fleet_after_minutes_has_lost_nothing() -> None:
    """A thousand events a second pass: of derivatives the newest of each vehicle come, of all else everything."""

    async def work() -> None:
        fleet = DrawnFleet(500, alerts=1)
        fleet.step()
        seen = fleet.events(-1)[-1].id
        fleet.act_on_alert("a1", AlertAction.ACKNOWLEDGE, "ana", "")
        for _ in range(20):
            fleet.step()
        flying = sum(view.state is not VehicleState.STALE for view in fleet.vehicles())
        found = await take(EventStreams(fleet).admit(str(seen)), flying + 1)
        assert [frame.kind for frame in found] == ["alert"] + ["derivatives"] * flying
        assert found[0].id == seen + 1
        assert len({frame.data["vehicle"] for frame in found[1:]}) == flying

    run(work())


def test_silence_is_bridged_by_comments() -> None:
    async def work() -> None:
        now = 0.0

        def clock() -> float:
            nonlocal now
            now += 1.0
            return now

        stream = EventStreams(FakeMonitor(), keep_alive_s=10.0, clock=clock).admit(None)
        await anext(stream)
        assert await anext(stream) == b": still here\n\n"
        assert 11.0 <= now <= 13.0

    run(work())


def test_a_listener_of_an_earlier_service_is_told_though_the_new_one_has_had_more_events() -> None:
    async def work() -> None:
        before = EventStreams(monitor_with(5), start=7_000_000_000).admit("7000000003")
        assert [frame.id for frame in await take(before, 2)] == [7_000_000_004, 7_000_000_005]
        after = EventStreams(monitor_with(50), start=2_000_000_000).admit("7000000005")
        (first,) = await take(after, 1)
        assert first.kind == "resync"
        assert "started anew" in first.data["reason"]
        smaller = EventStreams(monitor_with(50), start=8_000_000_000).admit("7000000005")
        assert (await take(smaller, 1))[0].kind == "resync"

    run(work())


def test_two_starts_of_the_service_number_their_events_differently() -> None:
    ids = []
    for _ in range(2):
        monitor = monitor_with(1)
        with served(monitor) as (_, client), client.stream("GET", "/v1/events") as answer:
            lines = answer.iter_lines()
            assert next(lines) == "retry: 2000"
            monitor.tell("status", {})
            ids.append(next(int(line.removeprefix("id: ")) for line in lines if line.startswith("id: ")))
    assert ids[0] != ids[1]
    assert max(ids) < 2**53  # a listener may hold it as a double


async def opened(streams: EventStreams, *clients: str) -> list[AsyncIterator[bytes]]:
    held = [streams.admit(None, Listener(client)) for client in clients]
    for stream in held:
        await anext(stream)
    return held


async def ends(stream: AsyncIterator[bytes]) -> None:
    with pytest.raises(StopAsyncIteration):
        await asyncio.wait_for(anext(stream), 1.0)


def test_idle_streams_do_not_shut_out_another() -> None:
    """Of the client that has most of them, the one that has longest taken nothing gives way."""

    async def work() -> None:
        monitor = FakeMonitor()
        streams = EventStreams(monitor, most=4)
        held = await opened(streams, "other", "greedy", "greedy", "greedy")
        monitor.tell("status", {})
        for stream in (held[1], held[3]):
            await take(stream, 1)
        (late,) = await opened(streams, "late")
        assert streams.counts == {"gave_way": 1}
        await ends(held[2])
        monitor.tell("status", {})
        for stream in (held[0], held[1], held[3], late):
            assert (await take(stream, 1))[-1].kind == "status"

    run(work())


def test_sixty_four_idle_streams_do_not_shut_out_the_next() -> None:
    monitor = monitor_with(1)
    with served(monitor) as (server, client):
        idle = []
        for _ in range(64):
            connection = socket.create_connection(("127.0.0.1", server.port), timeout=5.0)
            connection.sendall(b"GET /v1/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert connection.recv(12) == b"HTTP/1.1 200"
            idle.append(connection)
        with client.stream("GET", "/v1/events") as answer:
            assert answer.status_code == 200
            lines = answer.iter_lines()
            assert next(lines) == "retry: 2000"
            monitor.tell("alert", {"id": "a1"})
            assert any(line == "event: alert" for line in lines)
        assert client.get("/v1/status").json()["counters"]["events"] == {"gave_way": 1}
        for connection in idle:
            connection.close()


def test_a_closed_stream_makes_room() -> None:
    async def work() -> None:
        streams = EventStreams(FakeMonitor(), most=2)
        held = await opened(streams, "a", "b")
        await held[0].aclose()  # type: ignore[attr-defined]
        await opened(streams, "c")
        assert streams.counts == {"gave_way": 0}

    run(work())


def test_a_stream_ends_when_its_token_is_withdrawn() -> None:
    async def work() -> None:
        now_s, holds = 0.0, True

        def clock() -> float:
            nonlocal now_s
            now_s += 1.0
            return now_s

        stream = EventStreams(FakeMonitor(), clock=clock).admit(None, Listener("ana", lambda: holds))
        await anext(stream)
        assert await anext(stream) == b": still here\n\n"
        holds = False
        await ends(stream)

    run(work())


def test_closing_ends_every_stream_and_admits_no_other() -> None:
    async def work() -> None:
        streams = EventStreams(FakeMonitor())
        held = [streams.admit(None) for _ in range(3)]
        for stream in held:
            await anext(stream)
        streams.close()
        for stream in held:
            with pytest.raises(StopAsyncIteration):
                await asyncio.wait_for(anext(stream), 1.0)
        with pytest.raises(ProblemError, match="is stopping"):
            streams.admit(None)

    run(work())


@pytest.mark.parametrize("text", ["x", "", "-1", "1.5", "٣", "9" * 19, "0x10"])
def test_an_id_that_is_none_of_ours_is_refused(text: str) -> None:
    with pytest.raises(ProblemError, match="Last-Event-ID") as refused:
        EventStreams(FakeMonitor()).admit(text)
    assert refused.value.status == 422


def test_over_http_the_header_is_honoured() -> None:
    monitor = FakeMonitor()
    with served(monitor) as (_, client):
        with client.stream("GET", "/v1/events") as answer:
            assert answer.headers["content-type"].startswith("text/event-stream")
            assert answer.headers["cache-control"] == "no-store"
            lines = answer.iter_lines()
            assert next(lines) == "retry: 2000"
            monitor.tell("status", {})
            seen = next(line.removeprefix("id: ") for line in lines if line.startswith("id: "))
        for _ in range(2):
            monitor.tell("status", {})
        with client.stream("GET", "/v1/events", headers={"Last-Event-ID": seen}) as answer:
            found: list[int] = []
            for line in answer.iter_lines():
                if line.startswith("id: "):
                    found.append(int(line.removeprefix("id: ")))
                if len(found) == 2:
                    break
        assert found == [int(seen) + 1, int(seen) + 2]
        refused = client.get("/v1/events", headers={"Last-Event-ID": "last"})
        assert refused.status_code == 422
        assert refused.headers["content-type"] == "application/problem+json"


def test_only_those_kinds_come_that_are_asked_for_and_derivatives_of_one_vehicle() -> None:
    monitor = FakeMonitor()
    asked = {"kinds": "alert,derivatives", "derivatives_of": "north/uav"}
    with served(monitor) as (_, client):
        with client.stream("GET", "/v1/events", params=asked) as answer:
            lines = answer.iter_lines()
            assert next(lines) == "retry: 2000"
            numbers = [
                monitor.tell("status", {}),
                monitor.tell("derivatives", {"fleet": "south", "vehicle": "uav"}),
                monitor.tell("derivatives", {"fleet": "north", "vehicle": "uav"}),
                monitor.tell("manoeuvre", {}),
                monitor.tell("alert", {"id": "a1"}),
            ]
            seen = [int(next(line for line in lines if line.startswith("id: "))[4:]) for _ in range(2)]
        assert seen[1] - seen[0] == numbers[4] - numbers[2]
        after = {"kinds": "status", "last_event_id": str(seen[0] - numbers[2])}
        with client.stream("GET", "/v1/events", params=after) as answer:
            first = next(line for line in answer.iter_lines() if line.startswith("id: "))
        assert int(first[4:]) == seen[0] - numbers[2] + numbers[0]
        refused = client.get("/v1/events", params={"kinds": "alerts"})
        assert refused.status_code == 422
        assert "should be some of alert, status, derivatives, manoeuvre" in refused.json()["detail"]
