"""A running service on free ports, and what the end-to-end tests ask of it."""

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import zenoh
from loopback import free_endpoint

from wingwatch.service.service import Service, running_service
from wingwatch.service.settings import ServeSettings
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    FlightPublisher,
    SampleBlock,
    ZenohSettings,
    open_session,
)

PATIENCE_S = 60.0
CLIENT = httpx.Client(timeout=10.0, headers={"Connection": "close"})
"""One for all questions: a new one reads the machine's certificates, which costs more than the question."""
COMPILE_S = 240.0
"""A fresh machine compiles every kernel in the first test that needs one."""


@contextlib.contextmanager
def service_in(folder: Path, **settings: Any) -> Iterator[tuple[Service, str]]:
    """A service that takes samples in, and its Zenoh endpoint."""
    endpoint = free_endpoint()
    given = ServeSettings(port=0, listen=(endpoint,), data=folder, **settings)
    with running_service(given) as service:
        assert service.ingest.wait(COMPILE_S)
        yield service, endpoint


def get(service: Service, path: str) -> dict[str, Any]:
    answer = CLIENT.get(f"{service.url}{path}")
    assert answer.status_code == 200, answer.text
    value = answer.json()
    assert isinstance(value, dict)
    return value


def until(condition: Callable[[], bool], patience_s: float = PATIENCE_S) -> None:
    """Waits for something that another thread brings about."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def known(service: Service, vehicle: str) -> dict[str, Any] | None:
    """The vehicle as REST gives it, None before its first message."""
    answer = CLIENT.get(f"{service.url}/v1/vehicles/{vehicle}")
    return answer.json() if answer.status_code == 200 else None


def until_last(service: Service, vehicle: str, block: SampleBlock) -> dict[str, Any]:
    """Waits until a flight's last sample has been used; its derivatives then."""
    last_s = float(block.time_s[-1])
    until(lambda: (known(service, vehicle) or {}).get("last_sample_time_s") == last_s)
    return get(service, f"/v1/vehicles/{vehicle}/derivatives")


def put(session: zenoh.Session, key: str, payload: str | bytes, encoding: str = PROTOBUF) -> None:
    """A stranger's message, not lost to congestion."""
    session.put(key, payload, encoding=encoding, congestion_control=zenoh.CongestionControl.BLOCK)


def fly(endpoint: str, vehicle: str, block: SampleBlock) -> None:
    """An Aerosonde's flight, published as fast as it is taken."""
    with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
        publish(session, vehicle, block)


def publish(session: zenoh.Session, vehicle: str, block: SampleBlock) -> None:
    """The same over a session that is open already."""
    with FlightPublisher(session, "default", vehicle, AircraftMessage(aircraft="aerosonde")) as publisher:
        publisher.publish(block, None)
