"""Bad input on the live path is counted where it can be seen, and the watch goes on."""

import json
import socket
import sqlite3
import threading
import time
from importlib.resources import files
from pathlib import Path

import httpx
import numpy as np
import pytest
import zenoh
from live import COMPILE_S, fly, get, known, publish, put, service_in, until, until_last
from loopback import free_endpoint

from wingwatch.aircraft import load_aircraft
from wingwatch.api import KernelPart, KernelState, KernelsView
from wingwatch.cli.main import main
from wingwatch.service.service import Service, running_service
from wingwatch.service.settings import ServeSettings
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import (
    JSON,
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    ZenohSettings,
    encode_aircraft,
    encode_sensors,
    open_session,
    vehicle_key,
    write_flight,
)

SENSORS, AIRCRAFT = vehicle_key("default", "uav1", "sensors"), vehicle_key("default", "uav1", "aircraft")
TEN_MB = 10_000_000
NOTHING: dict[str, list[float]] = {"time_s": [0.0]}


@pytest.fixture(scope="module")
def block() -> SampleBlock:
    return simulate(demo_fleet()[0], 10.0)


def counts(service: Service) -> dict[str, int]:
    found = known(service, "uav1")
    return {} if found is None else found["counts"]


def test_every_bad_message_is_counted_by_its_reason_and_good_ones_still_count(
    tmp_path: Path, block: SampleBlock
) -> None:
    time_s = block.time_s.copy()
    time_s[200:203] = time_s[199]  # the clock stands still
    time_s[300] = time_s[299] - 0.01  # and goes back a little
    rate = block.column("pitch_rate_rad_s").copy()
    rate[400:404] = np.nan
    spoilt = SampleBlock.from_columns(
        {n: block.column(n) for n in block.present} | {"time_s": time_s, "pitch_rate_rad_s": rate}
    )
    with service_in(tmp_path) as (service, endpoint):
        with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
            put(session, SENSORS, b"\xff not protobuf", PROTOBUF)
            put(session, SENSORS, b'{"sequence": 0, "columns"', JSON)
            put(session, SENSORS, b"{}", "image/png")
            put(session, SENSORS, bytes(TEN_MB))
            unknown = json.dumps({"sequence": 0, "columns": {**NOTHING, "pitch_rate_deg_s": [1.0]}})
            put(session, SENSORS, unknown, JSON)
            unequal = json.dumps({"sequence": 0, "columns": {**NOTHING, "roll_rad": [1.0, 2.0]}})
            put(session, SENSORS, unequal, JSON)
            timeless = json.dumps({"sequence": 0, "columns": {"roll_rad": [1.0]}})
            put(session, SENSORS, timeless, JSON)
            publish(session, "uav1", spoilt)
        until_last(service, "uav1", block)
        seen = counts(service)
    reasons = ("unsupported_encoding", "too_large", "unknown_column", "unequal_lengths", "missing_time")
    assert {r: seen[f"message_{r}"] for r in reasons} == dict.fromkeys(reasons, 1)
    assert seen["message_malformed"] == 2
    rejected = {"duplicate": 3, "out_of_order": 1, "non_finite": 4}
    assert {reason: seen[reason] for reason in rejected} == rejected
    assert seen["accepted"] == len(block) - sum(rejected.values())


def test_stamps_that_no_clock_shows_and_impossible_numbers_hold_nobody_up(
    tmp_path: Path, block: SampleBlock
) -> None:
    far = SampleBlock(block.values[:20].copy())
    far.values[:, 0] = 9e15 + 2.0 * np.arange(20)
    stale_s = 0.5
    with service_in(tmp_path, stale_s=stale_s) as (service, endpoint):
        with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
            put(session, AIRCRAFT, encode_aircraft(AircraftMessage(aircraft="aerosonde")))
            put(session, SENSORS, encode_sensors(0, far))
            for sequence in (0, 2**64 - 1, 2**64 - 1):
                put(session, SENSORS, encode_sensors(sequence, SampleBlock(block.values[:10])))
            until(lambda: counts(service).get("messages_stray") == 2)
            time.sleep(1.5 * stale_s)  # the name belongs to the first publisher until it has been silent
            publish(session, "uav1", block)
        until_last(service, "uav1", block)
        status = get(service, "/v1/status")
        assert get(service, "/health/live")["live"]
    (vehicle,) = status["vehicles"]
    seen = vehicle["counts"]
    assert (seen["message_bad_value"], seen["messages_stray"], seen["publisher_restarts"]) == (1, 2, 1)
    assert set(status["counters"]) >= {"messages", "monitor", "loop", "store", "outputs"}
    assert status["counters"]["messages"]["overflow"] == 0
    assert set(status["counters"]["loop"].values()) == {0}


def test_a_vehicle_that_nobody_announced_is_counted_and_asked(tmp_path: Path, block: SampleBlock) -> None:
    with service_in(tmp_path) as (service, endpoint):
        with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
            asked: list[str] = []

            def answer(query: zenoh.Query) -> None:
                with query:
                    asked.append(str(query.key_expr))

            queryable = session.declare_queryable(AIRCRAFT, answer)  # a vehicle that does not know what it is
            payload = encode_sensors(0, SampleBlock(block.values[:10]))
            put(session, SENSORS, payload)
            until(lambda: counts(service).get("unannounced") == 10)
            until(lambda: AIRCRAFT in asked)
            vehicle = get(service, "/v1/vehicles/uav1")
            assert (vehicle["state"], vehicle["aircraft"]) == ("unknown", None)
            assert "has not announced its aircraft" in vehicle["reason"]
            queryable.undeclare()  # type: ignore[no-untyped-call]
        assert get(service, "/v1/vehicles/uav1/derivatives")["estimators"] == {}


def test_an_aircraft_that_nobody_knows_is_counted_and_told(tmp_path: Path, block: SampleBlock) -> None:
    with (
        service_in(tmp_path) as (service, endpoint),
        open_session(ZenohSettings.for_vehicle((endpoint,))) as session,
    ):
        put(session, AIRCRAFT, encode_aircraft(AircraftMessage(aircraft="concorde")))
        put(session, SENSORS, encode_sensors(0, SampleBlock(block.values[:10])))
        until(lambda: counts(service).get("unknown_aircraft", 0) > 0)
        assert "'concorde' is not known here" in get(service, "/v1/vehicles/uav1")["reason"]


def test_the_keys_of_other_programs_and_wildcards_are_no_vehicles(tmp_path: Path, block: SampleBlock) -> None:
    payload = encode_sensors(0, SampleBlock(block.values[:10]))
    with service_in(tmp_path) as (service, endpoint):
        with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
            for key in (
                "wingwatch/v1/**",
                "wingwatch/v1/default/UAV 1/sensors",
                "wingwatch/v2/default/a/sensors",
            ):
                put(session, key, payload)
            put(session, SENSORS, payload)
            until(lambda: known(service, "uav1") is not None)
        assert [v["vehicle"] for v in get(service, "/v1/vehicles")["items"]] == ["uav1"]


def test_a_file_of_the_service_gives_its_aircraft_a_name(tmp_path: Path, block: SampleBlock) -> None:
    """What a publisher announces from a file is found by the name that the file states."""
    file, flight = tmp_path / "mine.toml", tmp_path / "flight.parquet"
    library = files("wingwatch.aircraft") / "library"
    file.write_text(
        (library / "aerosonde.toml").read_text().replace('name = "aerosonde"', 'name = "mine"', 1)
    )
    assert load_aircraft(file).name == "mine"
    write_flight(block, flight)
    with service_in(tmp_path, aircraft=(file,)) as (service, endpoint):
        command = ["publish", str(flight), "--vehicle", "uav1", "--aircraft", str(file), "--rate", "max"]
        assert main([*command, "--connect", endpoint]) == 0
        until_last(service, "uav1", block)
        assert get(service, "/v1/vehicles/uav1")["aircraft"] == "mine"
        converted = get(service, "/v1/vehicles/uav1/derivatives?convention=american")
        assert converted["convention"] == "american"


def test_while_the_database_is_locked_the_watch_goes_on_and_readiness_says_so(
    tmp_path: Path, block: SampleBlock
) -> None:
    with service_in(tmp_path) as (service, endpoint):
        assert get(service, "/health/ready")["ready"]
        other = sqlite3.connect(tmp_path / "wingwatch.db", isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        fly(endpoint, "uav1", block)
        until_last(service, "uav1", block)
        answer = httpx.get(f"{service.url}/health/ready", timeout=10.0)
        assert answer.status_code == 503
        assert "locked" in answer.json()["checks"]["database"]
        assert answer.json()["checks"]["zenoh"] is None
        other.execute("ROLLBACK")
        other.close()
        until(lambda: httpx.get(f"{service.url}/health/ready", timeout=10.0).status_code == 200)


def test_requests_are_answered_while_kernels_compile(tmp_path: Path) -> None:
    """What is not ready says so, is alive, and takes in what came meanwhile once it is: nothing is lost."""
    hold = threading.Event()
    part = KernelPart("the wings", KernelState.COMPILING, True)
    text = "The kernels are being compiled: the wings now."

    class Held:
        def prepare(self) -> bool:
            return hold.wait(COMPILE_S)

        def view(self) -> KernelsView | None:
            return None if hold.is_set() else KernelsView(text, [part], 3.0, 40.0)

        def stop(self) -> None:
            hold.set()

    settings = ServeSettings(port=0, listen=(free_endpoint(),), data=tmp_path, stale_s=1.0)
    block = simulate(demo_fleet()[0], 4.0)
    with running_service(settings, preparation=Held()) as service:
        assert get(service, "/health/live")["live"]
        answer = httpx.get(f"{service.url}/health/ready", timeout=10.0)
        assert answer.status_code == 503
        assert answer.json()["checks"]["estimators"] == text
        status = get(service, "/v1/status")
        assert status["kernels"]["text"] == text
        assert status["kernels"]["parts"] == [{"name": "the wings", "state": "compiling", "first": True}]
        fly(settings.listen[0], "uav1", block)
        time.sleep(1.5 * settings.stale_s)
        assert (
            get(service, "/v1/status")["vehicles"] == []
        )  # a vehicle whose samples wait is not called stale
        hold.set()
        until_last(service, "uav1", block)
        assert get(service, "/health/ready")["ready"]
        status = get(service, "/v1/status")
        assert status["kernels"] is None
        (vehicle,) = status["vehicles"]
        assert vehicle["counts"]["accepted"] == len(block)
        assert "messages_lost" not in vehicle["counts"]


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The sentence with which `serve` refuses to start."""
    began = time.monotonic()
    assert main(["serve", *map(str, arguments)]) == 2
    assert time.monotonic() - began < 10.0
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    return line


def test_a_taken_port_a_wrong_database_and_a_silent_router_are_told_at_the_start(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = ("--data", tmp_path / "data")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert f"port {port} on 127.0.0.1 is in use" in refused(capsys, "--port", port, *data)
        assert not (tmp_path / "data").exists()  # nothing else was begun
        zenoh_taken = refused(capsys, "--port", 0, "--listen", f"tcp/127.0.0.1:{port}", *data)
        assert f"tcp/127.0.0.1:{port}: the port is in use" in zenoh_taken
    assert "nothing answers at" in refused(capsys, "--port", 0, "--connect", free_endpoint(), *data)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "wingwatch.db").write_bytes(b"no database" * 1000)
    listen = ("--port", 0, "--listen", free_endpoint())
    assert "not an SQLite database" in refused(capsys, *listen, "--data", tmp_path / "other")
    newer = sqlite3.connect(tmp_path / "data" / "wingwatch.db")
    with newer:
        newer.execute("UPDATE wingwatch_schema SET version_num = 'ffff'")
    newer.close()
    assert "newer than schema" in refused(capsys, *listen, *data)
    assert "no such file" in refused(capsys, *listen, *data, "--config", tmp_path / "none.toml")
    assert "does not exist" in refused(capsys, *listen, *data, "--aircraft", tmp_path / "none.toml")


def test_publishing_to_nobody_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], block: SampleBlock
) -> None:
    flight = tmp_path / "flight.csv"
    write_flight(block, flight)
    command = ["publish", str(flight), "--vehicle", "uav1", "--aircraft", "aerosonde", "--rate", "max"]
    assert main([*command, "--connect", free_endpoint()]) == 2
    assert "nothing answers at" in capsys.readouterr().err
    assert main([*command[:2], "--vehicle", "UAV 1", *command[4:]]) == 2
    assert "'UAV 1' is no valid name" in capsys.readouterr().err
    assert main([*command[:5], "concorde"]) == 2
    assert "'concorde' is not in the library" in capsys.readouterr().err
    endpoint = free_endpoint()
    with open_session(ZenohSettings.for_service((endpoint,))):  # somebody is there, but no service
        assert main([*command, "--connect", endpoint]) == 2
    assert "nobody subscribes" in capsys.readouterr().err
