"""Live equals offline, bit for bit: the derivatives over REST are those of `wingwatch estimate`."""

import json
from pathlib import Path
from typing import Any

import pytest
from live import get, put, service_in, until_last

from wingwatch.cli.main import main
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import (
    JSON,
    PROTOBUF,
    AircraftMessage,
    ZenohSettings,
    encode_aircraft,
    encode_sensors,
    load_flight,
    open_session,
    vehicle_key,
    write_flight,
)

ROOT = Path(__file__).parents[2]
THOR75 = ROOT.parent / "shared" / "data" / "thor75" / "thor_flight75.mat"
THOR75_MAP = ROOT / "docs" / "maps" / "thor75.toml"
SECONDS = 45.0
UNEVEN = (1, 7, 64)
"""Samples in messages that follow one another: how a flight is cut must not matter."""


def offline(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    assert main(["estimate", *map(str, arguments), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert isinstance(result, dict)
    return result


def all_that_arrived(recorded: dict[str, Any]) -> dict[str, int]:
    """First of all: a link that is silent for 10 s, as on a machine that stands still, breaks and loses a message."""
    return {"accepted": recorded["cleaning"]["accepted"]}


def numbers(said: dict[str, Any]) -> dict[str, Any]:
    """What is the same float live and offline (JSON floats here are the shortest that read back to the same bits)."""
    return {key: said[key] for key in ("time_s", "estimators", "not_estimated", "basis")}


def test_a_published_flight_gives_the_offline_derivatives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    block = simulate(demo_fleet()[0], SECONDS)
    flight = tmp_path / "flight.parquet"
    write_flight(block, flight)
    recorded = offline(capsys, flight, "--aircraft", "aerosonde")
    with service_in(tmp_path) as (service, endpoint):
        command = [
            "publish",
            str(flight),
            "--vehicle",
            "uav1",
            "--aircraft",
            "aerosonde",
            "--connect",
            endpoint,
        ]
        assert main([*command, "--rate", "max", "--json"]) == 0
        handed_over = json.loads(capsys.readouterr().out)
        assert (handed_over["samples"], handed_over["messages"]) == (len(block), len(block) / 10)
        live = until_last(service, "uav1", block)
        counts = get(service, "/v1/vehicles/uav1")["counts"]
    assert counts == all_that_arrived(recorded)
    assert numbers(live) == numbers(recorded)


@pytest.mark.parametrize("encoding", [JSON, PROTOBUF])
def test_messages_of_either_encoding_cut_anyhow_give_the_offline_derivatives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], encoding: str
) -> None:
    block = simulate(demo_fleet()[1], SECONDS)
    flight = tmp_path / "flight.parquet"
    write_flight(block, flight)
    recorded = offline(capsys, flight, "--aircraft", "aerosonde")
    with service_in(tmp_path) as (service, endpoint):
        with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
            announced = encode_aircraft(AircraftMessage(aircraft="aerosonde"), encoding)
            put(session, vehicle_key("default", "uav1", "aircraft"), announced, encoding)
            start, sequence = 0, 0
            while start < len(block):
                piece = type(block)(block.values[start : start + UNEVEN[sequence % len(UNEVEN)]])
                payload = encode_sensors(sequence, piece, encoding, block.present)
                put(session, vehicle_key("default", "uav1", "sensors"), payload, encoding)
                start, sequence = start + len(piece), sequence + 1
        live = until_last(service, "uav1", block)
        counts = get(service, "/v1/vehicles/uav1")["counts"]
    assert counts == all_that_arrived(recorded)
    assert numbers(live) == numbers(recorded)


@pytest.mark.skipif(
    not THOR75.exists(), reason="the real flight ../shared/data/thor75 is not on this machine"
)
def test_the_real_flight_live_equals_offline(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = (THOR75, "--aircraft", "ultrastick25e", "--map", THOR75_MAP)
    recorded = offline(capsys, *arguments)
    with service_in(tmp_path) as (service, endpoint):
        command = ["publish", *map(str, arguments), "--vehicle", "thor", "--connect", endpoint]
        assert main([*command, "--rate", "max"]) == 0
        live = until_last(service, "thor", load_flight(THOR75, THOR75_MAP).block)
        vehicle = get(service, "/v1/vehicles/thor")
    assert vehicle["counts"] == {"accepted": 14_850}
    assert numbers(live) == numbers(recorded)
    assert vehicle["active_alerts"] == []
    assert vehicle["basis"] == "empirical"
