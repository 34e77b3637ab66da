"""The programs in ``examples/`` do what they say, against the real subscriber, decoder and service."""

import csv
import importlib.util
import re
import runpy
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from api_fakes import FakeHistory, FakeMonitor, alert, derivative, past, served, vehicle

from wingwatch.aircraft import SHORT_PERIOD
from wingwatch.cli.estimate_history import COLUMNS
from wingwatch.monitor.views import AlertState
from wingwatch.telemetry import InboundMessage, SensorSubscriber, ZenohSettings, open_session
from wingwatch.telemetry.messages import decode_aircraft, decode_sensors

EXAMPLES = Path(__file__).parents[2] / "examples"
PATIENCE_S = 30.0


def test_the_publisher_has_thirty_lines_and_its_flight_arrives(tmp_path: Path) -> None:
    program = EXAMPLES / "publish.py"
    code = program.read_text().split('"""')[2].strip().splitlines()
    assert len([line for line in code if line]) <= 30
    flight = tmp_path / "flight.csv"
    rows = [f"{0.02 * i:.2f},{25 + 0.01 * i:.2f},{'' if i == 3 else 0.01}" for i in range(25)]
    flight.write_text("\n".join(["time_s,airspeed_true_m_s,pitch_rate_rad_s", *rows]) + "\n")
    with socket.create_server(("127.0.0.1", 0)) as free:
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    with (
        open_session(ZenohSettings.for_service(listen=(endpoint,))) as session,
        SensorSubscriber(session, time.monotonic) as subscriber,
    ):
        subprocess.run(
            [sys.executable, str(program), str(flight), "uav1", "aerosonde", endpoint, "1000"],
            check=True,
            timeout=PATIENCE_S,
        )
        taken: list[InboundMessage] = []
        until = time.monotonic() + PATIENCE_S
        while len([one for one in taken if one.stream != "left"]) < 4 and time.monotonic() < until:
            taken.extend(subscriber.drain(1000))
            time.sleep(0.005)
    announced = [one for one in taken if one.stream == "aircraft"]
    blocks = [decode_sensors(one.payload, one.encoding).block for one in taken if one.stream == "sensors"]
    assert [decode_aircraft(one.payload, one.encoding).aircraft for one in announced] == ["aerosonde"]
    assert [len(block) for block in blocks] == [10, 10, 5]
    assert blocks[2].time_s.tolist() == [0.4, 0.42, 0.44, 0.46, 0.48]
    assert blocks[0].column("pitch_rate_rad_s")[3] != blocks[0].column("pitch_rate_rad_s")[3]


@pytest.mark.skipif(shutil.which("g++") is None, reason="this machine has no C++ compiler: install g++")
def test_the_bytes_of_the_c_program_are_a_sensor_message(tmp_path: Path) -> None:
    built = tmp_path / "sensors"
    source = EXAMPLES / "sensors.cpp"
    subprocess.run(["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-o", built, source], check=True)
    payload = subprocess.run([built], capture_output=True, check=True).stdout
    message = decode_sensors(payload, "application/protobuf")
    assert message.sequence == 17
    assert message.block.time_s.tolist() == [0.0, 0.02, 0.04]
    assert message.block.column("specific_force_z_m_s2").tolist() == [-9.81, -9.80, -9.79]
    assert message.block.column("angle_of_attack_rad").tolist() == [0.05, 0.05, 0.06]


def test_the_client_prints_what_the_service_knows_and_acknowledges(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monitor = FakeMonitor()
    monitor.views, monitor.raised = [vehicle("aero-2")], [alert(1)]
    modes = {"short_period": {"outcome": "converged", "derivatives": {"m_q": derivative(-6.0, 0.25)}}}
    monitor.current["default", "aero-2"] = {"time_s": 1.0, "estimators": {"fourier": modes}}
    monitor.tell("derivatives", {"fleet": "default", "vehicle": "aero-2", "time_s": 12.5})
    with served(monitor) as (server, _):
        program = str(EXAMPLES / "rest_client.py")
        monkeypatch.setattr(sys, "argv", [program, server.url, "--acknowledge", "a1"])
        runpy.run_path(program, run_name="__main__")
        monkeypatch.setattr(sys, "argv", [program, server.url, "--acknowledge", "none"])
        with pytest.raises(SystemExit, match="none"):
            runpy.run_path(program, run_name="__main__")
    said = capsys.readouterr().out
    assert "default/aero-2: healthy; every derivative agrees" in said
    assert re.search(r"fourier +m_q +-6 ± 0\.25 1/s", said)
    assert "a1 warning: Icing of severity" in said
    assert "a1 is acknowledged" in said
    assert monitor.raised[0].state is AlertState.ACKNOWLEDGED


@pytest.fixture
def table_of_a_service() -> str:
    """The history of one vehicle as a service in this process answers it."""
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    m_q = SHORT_PERIOD.derivatives.index("m_q")
    value = [0.0] * len(SHORT_PERIOD.derivatives)
    value[m_q] = -4.5
    history = FakeHistory([past(t, "fourier", "short_period", value, [0.1] * len(value)) for t in (1.0, 1.5)])
    with served(monitor, history) as (_, client):
        path = "/v1/vehicles/aero-1/derivatives/history"
        answer: str = client.get(path, headers={"Accept": "text/csv"}).text
        return answer


def test_columns_that_the_notebook_reads_are_those_of_a_history() -> None:
    program = (EXAMPLES / "estimates.py").read_text()
    read = set(re.findall(r'"([a-z_]+)"', program)) - {"converged", "m_q"}
    assert {"value", "standard_error", "expected"} <= read
    assert read <= set(COLUMNS)


def test_columns_that_the_notebook_needs_are_those_of_a_service_too(table_of_a_service: str) -> None:
    program = (EXAMPLES / "estimates.py").read_text()
    begin, end = program.index('if "expected" in converged:'), program.index("# %% One derivative over time")
    needed = set(re.findall(r'"([a-z_]+)"', program[:begin] + program[end:])) - {"converged", "m_q"}
    rows = list(csv.DictReader(table_of_a_service.splitlines()))
    assert needed <= set(rows[0])
    assert [row["derivative"] for row in rows if row["outcome"] == "converged"].count("m_q") == 2


@pytest.mark.skipif(importlib.util.find_spec("pandas") is None, reason="pandas is not installed")
def test_the_notebook_runs_on_what_a_service_gives(
    table_of_a_service: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = tmp_path / "history.csv"
    table.write_text(table_of_a_service)
    program = str(EXAMPLES / "estimates.py")
    monkeypatch.setattr(sys, "argv", [program, str(table)])
    runpy.run_path(program, run_name="__main__")
    assert re.search(r"short_period +m_q +fourier +-4.5", capsys.readouterr().out)


@pytest.mark.skipif(importlib.util.find_spec("pandas") is None, reason="pandas is not installed")
def test_the_notebook_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    history = tmp_path / "estimates.csv"
    rows = [
        f'{t},"{estimator}","short_period","m_q",{-4.6 + 0.1 * t},0.1,"1/s","converged",-4.64,0.93'
        for t in (0.5, 1.0)
        for estimator in ("fourier", "ekf")
    ]
    history.write_text("\n".join([",".join(f'"{name}"' for name in COLUMNS), *rows]) + "\n")
    program = str(EXAMPLES / "estimates.py")
    monkeypatch.setattr(sys, "argv", [program, str(history)])
    runpy.run_path(program, run_name="__main__")
    assert re.search(r"short_period +m_q +fourier +-4.5", capsys.readouterr().out)
