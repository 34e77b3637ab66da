"""STATUSTEXT as pymavlink's own reader gets it from UDP: whole, as whose, how bad, twice, with a heartbeat."""

import socket
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from receivers import Bench, udp_receiver

from wingwatch.monitor import AlertState
from wingwatch.notifications import (
    ChannelError,
    NotDeliveredError,
    Notice,
    StatustextChannel,
    StatustextSettings,
    trial_notice,
)
from wingwatch.notifications.statustext import chunks

dialect: Any = pytest.importorskip("pymavlink.dialects.v20.common")


class Station:
    """Reads what a ground control station would, and puts texts together by ``id`` and ``chunk_seq``."""

    def __init__(self, opened: socket.socket) -> None:
        self._socket, self._reader = opened, dialect.MAVLink(None)
        self.heartbeats: set[tuple[int, int, int]] = set()

    def messages(self) -> Iterator[Any]:
        while True:
            yield from self._reader.parse_buffer(self._socket.recv(1000)) or ()

    def texts(self) -> Iterator[tuple[int, int, int, str]]:
        """System, component, severity and whole text."""
        parts: dict[int, dict[int, str]] = {}
        for message in self.messages():
            source = message.get_srcSystem(), message.get_srcComponent()
            if message.get_type() == "HEARTBEAT":
                self.heartbeats.add((*source, message.type))
                continue
            assert message.get_type() == "STATUSTEXT"
            if message.id:
                got = parts.setdefault(message.id, {})
                got[message.chunk_seq] = message.text
                if len(message.text) == 50:
                    continue
                parts.pop(message.id)
                assert sorted(got) == list(range(len(got)))
                yield (*source, message.severity, "".join(got[k] for k in sorted(got)))
            else:
                yield (*source, message.severity, message.text)


def notices(tmp_path: Path, *changes: dict[str, Any]) -> list[Notice]:
    bench = Bench(tmp_path / "o.json")
    for change in changes:
        bench.hear(**change)
    return bench.channel.taken


def test_a_text_arrives_whole_as_its_vehicle_and_is_repeated_once(tmp_path: Path) -> None:
    said = notices(
        tmp_path,
        {},
        {"level": "critical"},
        {"level": "critical", "state": AlertState.ACKNOWLEDGED, "note": ("ann: acknowledge",)},
        {"state": AlertState.CLEARED},
        {"id": "a2", "vehicle": "uav9", "level": "watch"},
    )
    with udp_receiver() as opened:
        settings = StatustextSettings(f"udpout:127.0.0.1:{opened.getsockname()[1]}", {"north/uav1": 7})
        station = Station(opened)
        texts = station.texts()
        with closing(StatustextChannel(settings)) as channel:
            for notice in said:
                channel.send(notice)
            first = [next(texts) for _ in said]
        again = [next(texts) for _ in said]
    whole = "Icing of severity 0.16 +/- 0.02 (Twin Otter scale), since about 60 s. Leave icing conditions."
    assert first[0] == (7, 191, dialect.MAV_SEVERITY_WARNING, f"WARNING: {whole}")
    assert first[1] == (7, 191, dialect.MAV_SEVERITY_CRITICAL, f"CRITICAL: {whole}")
    assert first[2][2] == dialect.MAV_SEVERITY_INFO
    assert first[3][2] == dialect.MAV_SEVERITY_NOTICE
    assert first[4] == (1, 191, dialect.MAV_SEVERITY_NOTICE, f"WATCH uav9: {whole}")
    assert again == first
    assert station.heartbeats == {(system, 191, dialect.MAV_TYPE_ONBOARD_CONTROLLER) for system in (1, 7)}


@pytest.mark.parametrize(
    ("length", "lengths"),
    [
        (0, [0]),
        (49, [49]),
        (50, [50]),
        (51, [50, 1]),
        (99, [50, 49]),
        (100, [50, 50, 0]),
        (299, [50] * 5 + [49]),
    ],
)
def test_the_last_of_several_chunks_has_room_for_its_end(length: int, lengths: list[int]) -> None:
    assert [len(chunk) for chunk in chunks("x" * length)] == lengths


def test_a_text_that_is_too_long_is_cut() -> None:
    cut = b"".join(chunks("x" * 1000))
    assert len(cut) == 299
    assert cut.endswith(b"x...")


def test_nobody_at_the_port_is_noticed_and_tried_again(tmp_path: Path) -> None:
    notice = notices(tmp_path, {})[0]
    with udp_receiver() as opened:
        port = opened.getsockname()[1]
    with closing(StatustextChannel(StatustextSettings(f"udpout:127.0.0.1:{port}"))) as channel:
        for _ in range(5):
            with pytest.raises(NotDeliveredError, match="connection refused"):
                channel.send(notice)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
            opened.bind(("127.0.0.1", port))
            opened.settimeout(20.0)
            channel.send(notice)
            assert next(Station(opened).texts())[3].startswith("WARNING uav1: Icing")


def test_a_station_may_listen_on_tcp(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        settings = StatustextSettings(f"tcp:127.0.0.1:{server.getsockname()[1]}", system=3, component=158)
        with closing(StatustextChannel(settings)) as channel:
            opened, _ = server.accept()  # the heartbeat has connected
            with opened:
                opened.settimeout(20.0)
                channel.send(replace(notices(tmp_path, {})[0]))
                assert next(Station(opened).texts())[:2] == (3, 158)


def test_a_station_that_has_gone_and_come_back_gets_what_is_said_then(tmp_path: Path) -> None:
    notice = notices(tmp_path, {})[0]
    with socket.create_server(("127.0.0.1", 0)) as server:
        settings = StatustextSettings(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        with closing(StatustextChannel(settings)) as channel:
            first, _ = server.accept()
            first.sendall(b"what a station says" * 1000)
            first.close()
            channel.send(notice)
            second, _ = server.accept()
            with second:
                second.settimeout(20.0)
                assert next(Station(second).texts())[3].startswith("WARNING uav1")


def test_a_test_goes_to_every_vehicle_that_is_named() -> None:
    with udp_receiver() as opened:
        settings = StatustextSettings(f"udpout:127.0.0.1:{opened.getsockname()[1]}", {"uav1": 3, "uav2": 9})
        with closing(StatustextChannel(settings)) as channel:
            channel.send(trial_notice(0.0))
            texts = Station(opened).texts()
            got = [next(texts) for _ in range(2)]
    assert [(system, text) for system, _, _, text in got] == [
        (system, "TEST of wingwatch. No vehicle is concerned.") for system in (3, 9)
    ]


@pytest.mark.parametrize(
    "connect", ["", "udpout:127.0.0.1", "serial:/dev/ttyS0", "udpout:host:0", "tcp:a:70000"]
)
def test_another_connection_is_refused_in_a_sentence(connect: str) -> None:
    with pytest.raises(ChannelError, match="give udpout:HOST:PORT or tcp:HOST:PORT"):
        StatustextChannel(StatustextSettings(connect))


def test_without_pymavlink_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    with pytest.raises(ChannelError, match=r"pip install 'wingwatch\[logs\]'"):
        StatustextChannel(StatustextSettings("udpout:127.0.0.1:14550"))
