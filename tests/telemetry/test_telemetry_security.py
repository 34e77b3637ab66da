"""Zenoh with certificates, users and access rules: who may connect, and who may write what."""

import json
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh
from certificates import Authority, needs_openssl
from loopback import free_endpoint
from telemetry_flights import flight_block

from wingwatch.telemetry import (
    AircraftMessage,
    FlightPublisher,
    KeyNameError,
    LinkError,
    LinkSecurity,
    LinkSecurityError,
    SensorSubscriber,
    ZenohSettings,
    access_rules,
    open_session,
    vehicle_key,
    vehicle_subject,
)

PATIENCE_S = 60.0
SETTLE_S = 0.6
SENSORS, OTHER, ALERTS, STATUS = (
    vehicle_key("default", vehicle, leaf)
    for vehicle, leaf in (("uav1", "sensors"), ("uav2", "sensors"), ("uav1", "alerts"), ("uav1", "status"))
)
RULES = access_rules([("default", "uav1"), ("default", "uav2")], readers=["tower"])

Seen = list[tuple[str, str]]
"""Keys and payloads."""


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("authority"))


def secure_endpoint() -> str:
    return free_endpoint().replace("tcp/", "tls/")


def shown(authority: Authority, name: str) -> LinkSecurity:
    """Mutual TLS under a common name."""
    made = authority.sign(name)
    return LinkSecurity(authority.certificate, made.certificate, made.private_key)


def with_rules(security: LinkSecurity, folder: Path) -> LinkSecurity:
    path = folder / "access.json5"
    path.write_text(json.dumps(RULES))
    return replace(security, access=path)


@contextmanager
def listening(session: zenoh.Session) -> Iterator[Seen]:
    """What a session gets of everything."""
    seen: Seen = []
    subscriber = session.declare_subscriber(
        "wingwatch/v1/**",
        lambda sample: seen.append(
            (str(sample.key_expr), sample.payload.to_bytes().decode(errors="replace"))
        ),
    )
    yield seen
    subscriber.undeclare()  # type: ignore[no-untyped-call]


@needs_openssl
@pytest.mark.parametrize("kept_by", ["router", "service"])
def test_everybody_writes_only_what_is_theirs(authority: Authority, tmp_path: Path, kept_by: str) -> None:
    endpoint = secure_endpoint()
    kept = with_rules(shown(authority, kept_by), tmp_path)
    with ExitStack() as stack:

        def opened(name: str) -> zenoh.Session:
            settings = ZenohSettings.for_vehicle((endpoint,), shown(authority, name))
            return stack.enter_context(open_session(settings))

        if kept_by == "router":
            router = ZenohSettings(mode="router", listen=(endpoint,), security=kept)
            stack.enter_context(open_session(router))
            service = opened("service")
        else:
            listen = ZenohSettings.for_service((endpoint,), security=kept)
            service = stack.enter_context(open_session(listen))
        subscriber = stack.enter_context(SensorSubscriber(service, time.monotonic))
        vehicle, tower, stranger = opened("default.uav1"), opened("tower"), opened("stranger")
        read = stack.enter_context(listening(tower))
        aircraft = AircraftMessage(aircraft="aerosonde")
        with FlightPublisher(vehicle, "default", "uav1", aircraft) as publisher:
            assert publisher.wait_for_receiver(PATIENCE_S)
            assert publisher.publish(flight_block(20), None) == 2
            subscriber.ask_aircraft("default", "uav1")
            came: Counter[str] = Counter()

            def all_came() -> bool:
                came.update(message.stream for message in subscriber.drain(100))
                return came["sensors"] == 2 and came["aircraft"] >= 1

            until(all_came)
            for name, writer in (("vehicle", vehicle), ("stranger", stranger)):
                for key in (OTHER, ALERTS, STATUS, *([SENSORS] if writer is stranger else [])):
                    writer.put(key, f"forged by {name}")
            tower.put(ALERTS, "forged by tower", allowed_destination=zenoh.Locality.REMOTE)
            service.put(ALERTS, "ice")
            until(lambda: (ALERTS, "ice") in read)
            time.sleep(SETTLE_S)
            assert [(key, text) for key, text in read if text == "ice" or "forged" in text] == [
                (ALERTS, "ice")
            ]
            assert "sensors" not in {message.stream for message in subscriber.drain(100)}
            alive = [str(r.ok.key_expr) for r in tower.liveliness().get("wingwatch/alive/v1/**") if r.ok]
            assert alive == ["wingwatch/alive/v1/default/uav1"]


@needs_openssl
def test_only_readers_are_answered(authority: Authority, tmp_path: Path) -> None:
    endpoint = secure_endpoint()
    kept = with_rules(shown(authority, "service"), tmp_path)
    with ExitStack() as stack:
        service = stack.enter_context(open_session(ZenohSettings.for_service((endpoint,), security=kept)))

        def answer(query: zenoh.Query) -> None:
            query.reply(STATUS, "well")
            query.drop()  # type: ignore[no-untyped-call]

        service.declare_queryable("wingwatch/v1/*/*/status", answer)
        for name, answers in (("tower", ["well"]), ("default.uav1", []), ("stranger", [])):
            settings = ZenohSettings.for_vehicle((endpoint,), shown(authority, name))
            with open_session(settings) as session:
                time.sleep(SETTLE_S)
                replies = session.get(STATUS, timeout=2.0)
                assert [reply.ok.payload.to_string() for reply in replies if reply.ok] == answers, name


@needs_openssl
def test_who_has_no_certificate_of_the_authority_is_not_let_in(authority: Authority, tmp_path: Path) -> None:
    endpoint = secure_endpoint()
    (tmp_path / "other").mkdir()
    other = Authority(tmp_path / "other")
    forged = replace(shown(other, "default.uav1"), authority=authority.certificate)
    with open_session(ZenohSettings.for_service((endpoint,), security=shown(authority, "service"))):
        for security in (forged, LinkSecurity(authority.certificate), shown(other, "default.uav1")):
            settings = ZenohSettings.for_vehicle((endpoint,), security)
            with (
                pytest.raises(LinkError, match="refuses the certificate"),
                open_session(replace(settings, open_timeout_s=1.0)),
            ):
                raise AssertionError("it was let in")


@needs_openssl
def test_users_with_passwords_may_write_what_is_theirs(authority: Authority, tmp_path: Path) -> None:
    endpoint = secure_endpoint()
    users, rules = tmp_path / "users.txt", tmp_path / "access.json5"
    users.write_text("default.uav1:one\ndefault.uav2:two\n")
    rules.write_text(json.dumps(access_rules([("default", "uav1"), ("default", "uav2")], by="user")))
    own = authority.sign("service")
    kept = LinkSecurity(certificate=own.certificate, private_key=own.private_key, users=users, access=rules)

    def settings(user: str, password: str) -> ZenohSettings:
        security = LinkSecurity(authority.certificate, user=user, password=password)
        return replace(ZenohSettings.for_vehicle((endpoint,), security), open_timeout_s=1.0)

    with (
        open_session(ZenohSettings.for_service((endpoint,), security=kept)) as service,
        listening(service) as seen,
        open_session(settings("default.uav1", "one")) as session,
    ):
        with pytest.raises(LinkError, match="the user"), open_session(settings("default.uav1", "two")):
            raise AssertionError("it was let in")
        session.put(OTHER, "forged")
        session.put(SENSORS, "own")
        until(lambda: bool(seen))
        time.sleep(SETTLE_S)
        assert seen == [(SENSORS, "own")]


def test_a_password_is_shown_nowhere() -> None:
    security = LinkSecurity(user="uav1", password="geheim")
    assert "geheim" not in repr(security)
    assert "geheim" not in repr(ZenohSettings.for_vehicle(("tls/127.0.0.1:1",), security))


def test_150_sockets_that_say_nothing_do_not_delay_a_vehicle() -> None:
    endpoint = free_endpoint()
    port = int(endpoint.rsplit(":", 1)[1])
    with ExitStack() as stack:
        stack.enter_context(open_session(ZenohSettings.for_service((endpoint,))))
        for _ in range(150):
            stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=5.0))
        time.sleep(SETTLE_S)
        began = time.monotonic()
        stack.enter_context(open_session(ZenohSettings.for_vehicle((endpoint,))))
        assert time.monotonic() - began < 2.0


def test_settings_that_do_not_protect_are_refused_in_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "a.pem"
    file.write_text("x")
    rules = tmp_path / "rules.json5"
    for security, listens, words in (
        (LinkSecurity(certificate=file), False, "its private key"),
        (LinkSecurity(authority=file), True, "needs a certificate"),
        (LinkSecurity(user="a"), False, "a user and a password"),
        (LinkSecurity(authority=tmp_path / "none.pem"), False, "none.pem: no such file"),
        (LinkSecurity(authority=file, access=rules), False, "give them to the router"),
        (LinkSecurity(None, file, file, access=rules), True, "rules.json5: no such file"),
    ):
        with pytest.raises(LinkSecurityError, match=words):
            security.config(listens)
    for text in ("{", "[]", "{}", '{"access_control": {"enabled": false}}'):
        rules.write_text(text)
        with pytest.raises(LinkSecurityError, match="access rules"):
            LinkSecurity(None, file, file, access=rules).config(True)
    with pytest.raises(LinkError, match="write tls/HOST:PORT"):
        ZenohSettings.for_vehicle(("tcp/127.0.0.1:1",), LinkSecurity(file)).config()


def test_rules_deny_what_they_do_not_name_and_names_cannot_widen_them() -> None:
    control = RULES["access_control"]
    assert (control["enabled"], control["default_permission"]) == (True, "deny")
    assert all(rule["permission"] == "allow" for rule in control["rules"])
    ids = [rule["id"] for rule in control["rules"]]
    assert len(ids) == len(set(ids))
    assert {name for policy in control["policies"] for name in policy["rules"]} == set(ids)
    writes = {
        key: rule["id"]
        for rule in control["rules"]
        if rule["flows"] == ["ingress"] and "put" in rule["messages"]
        for key in rule["key_exprs"]
    }
    of_results = {f"wingwatch/v1/*/*/{leaf}" for leaf in ("derivatives", "status", "alerts", "proposals")}
    assert {key for key in writes if "*" in key} == of_results | {"wingwatch/workers/v1/*/load"}
    for fleet, vehicle in (("*", "uav1"), ("default", "**"), ("a.b", "c"), ("a", "b/c")):
        with pytest.raises(KeyNameError):
            access_rules([(fleet, vehicle)])
    with pytest.raises(KeyNameError):
        access_rules([("default", "uav1")], service="default.uav1")
    with pytest.raises(KeyNameError):
        access_rules([("default", "uav1")], readers=["default.uav1"])
    assert vehicle_subject("north", "uav1") == "north.uav1"
