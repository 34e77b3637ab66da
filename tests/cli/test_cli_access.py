"""`wingwatch access`, and a service whose vehicles show certificates and may write only their own keys."""

import json
from pathlib import Path

import httpx
import pytest
import zenoh
from certificates import Authority, needs_openssl
from cli_flights import run
from cli_services import service_in
from loopback import free_port

from wingwatch.cli.arguments import build_parser
from wingwatch.service.link_settings import PASSWORD_VARIABLE, LinkTable, link_security
from wingwatch.service.settings import serve_settings
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import LinkSecurity, access_rules, write_flight


def test_rules_are_written_as_a_configuration_that_zenoh_takes(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "access.json5"
    ran = run(capsys, ["access", "uav1", "north.uav1", "--reader", "tower", "--out", str(file)])
    assert (ran.code, ran.out) == (0, "")
    assert "default.uav1, north.uav1, service, tower" in ran.err
    expected = access_rules([("default", "uav1"), ("north", "uav1")], readers=["tower"])
    assert json.loads(file.read_text()) == expected
    taken = json.loads(zenoh.Config.from_file(str(file)).get_json("access_control"))
    assert [rule["id"] for rule in taken["rules"]] == [
        rule["id"] for rule in expected["access_control"]["rules"]
    ]
    assert json.loads(run(capsys, ["access", "uav1"]).out) == access_rules([("default", "uav1")])
    by_user = run(capsys, ["access", "uav1", "--by", "user", "--json"]).json
    assert by_user["vehicles"] == ["default.uav1"]
    assert by_user["access_control"]["subjects"][0] == {"id": "default.uav1", "usernames": ["default.uav1"]}


@pytest.mark.parametrize("name", ["UAV 1", "a.b.c", "*", "north.", ".uav1", "a/b"])
def test_a_name_that_is_none_is_told(capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert "is no valid name" in run(capsys, ["access", name]).sentence


def test_the_settings_file_names_files_beside_it_and_the_environment_the_password(tmp_path: Path) -> None:
    file = tmp_path / "service.toml"
    file.write_text('connect = "tls/router:7447"\n[zenoh]\nauthority = "ca.pem"\nuser = "service"\n')
    given = serve_settings(build_parser("0").parse_args(["serve", "--config", str(file)]), {})
    assert given.zenoh == LinkTable(authority=tmp_path / "ca.pem", user="service")
    security = link_security(given.zenoh, {PASSWORD_VARIABLE: "geheim"})
    assert security == LinkSecurity(tmp_path / "ca.pem", user="service", password="geheim")
    assert link_security(LinkTable(), {PASSWORD_VARIABLE: "geheim"}) is None


def test_settings_that_will_not_do_are_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "service.toml"
    common = ["serve", "--port", "0", "--data", str(tmp_path / "data"), "--config", str(file)]
    for text, words in (
        ('listen = "tls/127.0.0.1:0"\n[zenoh]\nauthority = "ca.pem"\n', "needs a certificate"),
        ('[zenoh]\nauthority = "ca.pem"\n', "write tls/HOST:PORT"),
        ('[zenoh]\npassword = "geheim"\n', "zenoh.password is no setting"),
        ('connect = "tls/127.0.0.1:1"\n[zenoh]\naccess = "access.json5"\n', "give them to the router"),
    ):
        file.write_text(text)
        assert words in run(capsys, common).sentence


@needs_openssl
def test_a_vehicle_publishes_under_its_own_name_and_no_other(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    authority = Authority(tmp_path)
    own, uav1 = authority.sign("service"), authority.sign("default.uav1")
    rules, flight = tmp_path / "access.json5", tmp_path / "flight.csv"
    run(capsys, ["access", "uav1", "uav2", "--out", str(rules)])
    write_flight(simulate(demo_fleet()[0], 2.0), flight)
    endpoint = f"tls/127.0.0.1:{free_port()}"
    zenoh_table = LinkTable(
        authority=authority.certificate,
        certificate=own.certificate,
        private_key=own.private_key,
        access=rules,
    )
    shown = ["--certificate", str(uav1.certificate), "--private-key", str(uav1.private_key)]
    common = ["publish", str(flight), "--aircraft", "aerosonde", "--rate", "1.0", "--connect", endpoint]
    common += ["--authority", str(authority.certificate)]
    with service_in(tmp_path, listen=(endpoint,), zenoh=zenoh_table) as service:

        def received() -> int:
            counters = httpx.get(f"{service.url}/v1/status").json()["counters"]
            return int(counters["messages"]["received"])

        assert run(capsys, [*common, "--vehicle", "uav2", *shown]).code == 0
        assert received() == 0
        assert run(capsys, [*common, "--vehicle", "uav1", *shown]).code == 0
        assert received() > 10
        assert "refuses the certificate" in run(capsys, [*common, "--vehicle", "uav1"]).sentence
