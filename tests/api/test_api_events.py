"""The event stream: what was missed is sent or said, silence is bridged, streams are bounded."""

import asyncio
import json
from collections.abc import AsyncIterator, Coroutine
from dataclasses import dataclass
from typing import Any

import pytest
from api_fakes import FakeMonitor, served

from wingwatch.api.events import EventStreams
from wingwatch.api.problems import ProblemError


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


def told(count: int) -> FakeMonitor:
    monitor = FakeMonitor()
    for number in range(count):
        monitor.tell("status", {"number": number + 1})
    return monitor


def test_a_new_listener_gets_what_comes_after_it() -> None:
    async def work() -> None:
        monitor = told(3)
        stream = EventStreams(monitor).admit(None)
        assert frames(await anext(stream)) == []
        monitor.tell("alert", {"id": "a1", "size": float("nan"), "text": "line\nbreak"})
        (first,) = await take(stream, 1)
        assert first == Frame(4, "alert", {"id": "a1", "size": None, "text": "line\nbreak"})

    run(work())


def test_a_returning_listener_gets_what_it_missed_once_and_in_order() -> None:
    async def work() -> None:
        stream = EventStreams(told(5)).admit("2")
        assert [frame.id for frame in await take(stream, 3)] == [3, 4, 5]

    run(work())


def test_a_listener_learns_that_events_are_lost() -> None:
    async def work() -> None:
        stream = EventStreams(told(1500)).admit("3")
        found = await take(stream, 1001)
        assert (found[0].kind, found[0].id) == ("resync", None)
        assert "no longer kept" in found[0].data["reason"]
        assert [frame.id for frame in found[1:]] == list(range(501, 1501))

    run(work())


def test_a_slow_listener_learns_that_events_were_lost_while_it_slept() -> None:
    async def work() -> None:
        monitor = told(1)
        stream = EventStreams(monitor).admit("0")
        assert [frame.id for frame in await take(stream, 1)] == [1]
        for _ in range(1200):
            monitor.tell("derivatives", {})
        assert (await take(stream, 1))[0].kind == "resync"

    run(work())


def test_a_listener_of_an_earlier_service_is_told_to_read_again() -> None:
    async def work() -> None:
        monitor = told(2)
        stream = EventStreams(monitor).admit("5000")
        (first,) = await take(stream, 1)
        assert first.kind == "resync"
        assert "started anew" in first.data["reason"]
        monitor.tell("status", {})
        assert [frame.id for frame in await take(stream, 1)] == [3]

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


def test_streams_are_bounded_and_a_closed_one_makes_room() -> None:
    async def work() -> None:
        streams = EventStreams(FakeMonitor(), most=2)
        held = [streams.admit(None) for _ in range(2)]
        for stream in held:
            await anext(stream)
        with pytest.raises(ProblemError, match="2 event streams") as refused:
            streams.admit(None)
        assert refused.value.status == 503
        await held[0].aclose()  # type: ignore[attr-defined]
        await anext(streams.admit(None))

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
    monitor = told(3)
    with served(monitor) as (_, client):
        with client.stream("GET", "/v1/events", headers={"Last-Event-ID": "1"}) as answer:
            assert answer.headers["content-type"].startswith("text/event-stream")
            assert answer.headers["cache-control"] == "no-store"
            found: list[int] = []
            for line in answer.iter_lines():
                if line.startswith("id: "):
                    found.append(int(line.removeprefix("id: ")))
                if len(found) == 2:
                    break
        assert found == [2, 3]
        refused = client.get("/v1/events", headers={"Last-Event-ID": "last"})
        assert refused.status_code == 422
        assert refused.headers["content-type"] == "application/problem+json"
