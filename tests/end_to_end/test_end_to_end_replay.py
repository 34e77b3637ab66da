"""What a service recorded, replayed: the same estimates to the bit and the same alerts, over a restart, too."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live import fly, get, put, service_in, until_last

from wingwatch.cli.main import main
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    ZenohSettings,
    encode_aircraft,
    encode_sensors,
    load_flight,
    open_session,
    vehicle_key,
)

SECONDS, FIRST_S = 130.0, 40.0
SAMPLES, STREAM = 10, 7


def replayed(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["replay", *map(str, arguments), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert isinstance(result, dict)
    return result


def send(endpoint: str, block: SampleBlock, first_row: int, end_row: int) -> SampleBlock:
    """Part of a flight by a vehicle that flies on while the service restarts; the part."""
    with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
        announced = AircraftMessage(aircraft="aerosonde", stream=STREAM)
        put(session, vehicle_key("default", "iced", "aircraft"), encode_aircraft(announced))
        for row in range(first_row, end_row, SAMPLES):
            piece = SampleBlock(block.values[row : row + SAMPLES])
            message = encode_sensors(row // SAMPLES, piece, PROTOBUF, block.present, STREAM)
            put(session, vehicle_key("default", "iced", "sensors"), message)
    return SampleBlock(block.values[first_row:end_row])


def test_two_runs_of_a_service_come_again_to_the_bit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    iced = simulate(next(s for s in demo_fleet() if s.name == "icing"), SECONDS)
    other = simulate(demo_fleet()[0], FIRST_S)
    first, second = tmp_path / "first", tmp_path / "second"
    rows, end = round(FIRST_S * 50.0), len(iced) // SAMPLES * SAMPLES
    with service_in(tmp_path / "data", record=first, diagnose_alerts=False) as (service, endpoint):
        fly(endpoint, "other", other)
        until_last(service, "other", other)
        until_last(service, "iced", send(endpoint, iced, 0, rows))
    with service_in(tmp_path / "data", record=second, diagnose_alerts=False) as (service, endpoint):
        until_last(service, "iced", send(endpoint, iced, rows, end))
        raised = get(service, "/v1/alerts")["items"]
    assert raised  # ice was seen
    for folder, vehicles in ((first, {"iced", "other"}), (second, {"iced", "other"})):
        result = replayed(capsys, folder)
        agreement = result["as_recorded"]
        assert agreement["estimates"] > 100
        assert agreement["estimates_equal"] == agreement["estimates"], agreement["first_difference"]
        assert agreement["whole"]
        assert {one["vehicle"] for one in result["vehicles"]} == vehicles
    assert [(a["kind"], a["cause"], a["raised_s"]) for a in result["alerts"]] == [
        (a["kind"], a["cause"], a["raised_s"]) for a in reversed(raised)
    ]

    replayed(capsys, first, "--tables", tmp_path / "tables")
    table = load_flight(tmp_path / "tables" / "default.other.parquet")
    np.testing.assert_array_equal(table.block.time_s, other.time_s)
    np.testing.assert_array_equal(table.block.column("pitch_rate_rad_s"), other.column("pitch_rate_rad_s"))

    path = next(first.glob("*.mcap"))
    assert main(["log", str(path)]) == 2  # two vehicles: which one is not guessed
    assert "--tables DIR writes a flight of each" in capsys.readouterr().err
