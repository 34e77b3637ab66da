"""Zenoh's access rules for a fleet: a vehicle writes its own keys, the service alone its results, readers nothing.

Rules name what passes; everything else is denied. They hold for who connects to the process that keeps them, so the
same rules serve a router, and a service that vehicles connect to without one. A rule lets a key expression pass only if
it includes it: the service subscribes ``wingwatch/v1/*/*/sensors``, which must reach each vehicle before it sends.
"""

from collections.abc import Sequence
from typing import Any, Literal

from wingwatch.telemetry.keys import EVERY_VEHICLE_ALIVE, KEY_ROOT, alive_key, check_name, vehicle_key
from wingwatch.telemetry.worker_keys import EVERY_LOAD, EVERY_TOKEN, WORKER_ROOT, check_worker

__all__ = ["access_rules", "vehicle_subject"]

_ALIVE = "wingwatch/alive/v1"
_FROM_VEHICLES = tuple(f"{KEY_ROOT}/*/*/{leaf}" for leaf in ("sensors", "aircraft"))
_FROM_SERVICE = tuple(f"{KEY_ROOT}/*/*/{leaf}" for leaf in ("derivatives", "status", "alerts", "proposals"))
_AIRCRAFT = (f"{KEY_ROOT}/*/*/aircraft",)
_ALL = (f"{KEY_ROOT}/**",)
_ALL_ALIVE = (f"{_ALIVE}/**",)
_VEHICLES_ALIVE = (EVERY_VEHICLE_ALIVE,)
_WORKERS = (f"{WORKER_ROOT}/*/*",)
_WORKERS_THERE = (EVERY_TOKEN,)
_LOADS = (EVERY_LOAD,)

Identity = Literal["certificate", "user"]


def vehicle_subject(fleet: str, vehicle: str) -> str:
    """The common name of a vehicle's certificate, or its user: unlike any other, since names hold no dot.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{check_name('fleet', fleet)}.{check_name('vehicle', vehicle)}"


def access_rules(
    vehicles: Sequence[tuple[str, str]],
    service: str = "service",
    readers: Sequence[str] = (),
    by: Identity = "certificate",
    workers: Sequence[str] = (),
    gateways: Sequence[str] = (),
) -> dict[str, Any]:
    """The object ``{"access_control": ...}`` of a Zenoh configuration.

    Args:
        vehicles: fleet and name of each.
        service: common name of the service's certificate, or its user.
        readers: of those who may subscribe and ask, and write nothing.
        by: what tells who connects.
        workers: those that watch vehicles beside each other; each answers under its own name, or one that begins with
            it and a hyphen.
        gateways: those that ask workers, and neither read nor write what is of vehicles.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    rules: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []

    def add(subject: str, of: Sequence[dict[str, Any]]) -> None:
        name = "cert_common_names" if by == "certificate" else "usernames"
        subjects.append({"id": subject, name: [subject]})
        rules.extend({"permission": "allow", **rule, "id": f"{subject}: {rule['id']}"} for rule in of)
        policies.append({"rules": [f"{subject}: {rule['id']}" for rule in of], "subjects": [subject]})

    for fleet, vehicle in dict.fromkeys(vehicles):
        add(vehicle_subject(fleet, vehicle), _of_vehicle(fleet, vehicle))
    add(check_name("service", service), [*_of_service(), *_of_workers_host()])
    for worker in dict.fromkeys(workers):
        add(check_worker(worker), [*_of_service(), *_of_worker(worker)])
    for gateway in dict.fromkeys(gateways):
        add(check_name("gateway", gateway), _of_gateway())
    for reader in dict.fromkeys(readers):
        add(check_name("reader", reader), _of_reader())
    return {
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules,
            "subjects": subjects,
            "policies": policies,
        }
    }


def _rule(what: str, flow: str, messages: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    return {"id": what, "flows": [flow], "messages": list(messages), "key_exprs": list(keys)}


def _of_vehicle(fleet: str, vehicle: str) -> list[dict[str, Any]]:
    aircraft = vehicle_key(fleet, vehicle, "aircraft")
    return [
        _rule("writes", "ingress", ("put",), (vehicle_key(fleet, vehicle, "sensors"), aircraft)),
        _rule("answers", "ingress", ("declare_queryable", "reply"), (aircraft,)),
        _rule("lives", "ingress", ("liveliness_token",), (alive_key(fleet, vehicle),)),
        _rule("learns who listens", "egress", ("declare_subscriber",), _FROM_VEHICLES),
        _rule("is asked", "egress", ("query",), _AIRCRAFT),
    ]


def _of_service() -> list[dict[str, Any]]:
    return [
        _rule("writes", "ingress", ("put",), _FROM_SERVICE),
        _rule("answers", "ingress", ("declare_queryable", "reply"), _FROM_SERVICE),
        _rule("lives", "ingress", ("liveliness_token",), (f"{_ALIVE}/service/*",)),
        _rule("listens", "ingress", ("declare_subscriber",), _FROM_VEHICLES),
        _rule("asks", "ingress", ("query",), _AIRCRAFT),
        _rule("gets samples", "egress", ("put",), _FROM_VEHICLES),
        _rule("gets aircraft", "egress", ("declare_queryable", "reply"), _AIRCRAFT),
        _rule("is asked", "egress", ("declare_subscriber", "query"), _ALL),
        _rule("asks who leaves", "ingress", ("declare_liveliness_subscriber",), _VEHICLES_ALIVE),
        _rule("hears who leaves", "egress", ("liveliness_token",), _VEHICLES_ALIVE),
    ]


def _of_worker(worker: str) -> list[dict[str, Any]]:
    """A worker answers under its own name, and asks others what they hand over."""
    names = (worker, f"{worker}-$*")
    own = tuple(f"{WORKER_ROOT}/{name}/*" for name in names)
    tokens = tuple(f"{WORKER_ROOT}/alive/{name}/*" for name in names)
    return [
        _rule("answers gateways", "ingress", ("declare_queryable", "reply"), own),
        _rule("is there", "ingress", ("liveliness_token",), tokens),
        _rule("is asked by gateways", "egress", ("query",), own),
        *_sharing_loads(tuple(f"{WORKER_ROOT}/{name}/load" for name in names)),
        *_asking_workers(),
    ]


def _of_gateway() -> list[dict[str, Any]]:
    return _asking_workers()


def _sharing_loads(own: Sequence[str]) -> list[dict[str, Any]]:
    """Workers hear each other's loads; ``own``: under which keys one says its own."""
    return [
        _rule("says its load", "ingress", ("put",), own),
        _rule("listens to loads", "ingress", ("declare_subscriber",), _LOADS),
        _rule("learns who listens to loads", "egress", ("declare_subscriber",), _LOADS),
        _rule("hears loads", "egress", ("put",), _LOADS),
    ]


def _asking_workers() -> list[dict[str, Any]]:
    """To ask any worker, and to see which are there."""
    return [
        _rule("asks workers", "ingress", ("query",), _WORKERS),
        _rule("gets workers' answers", "egress", ("declare_queryable", "reply"), _WORKERS),
        _rule("asks which workers are there", "ingress", ("declare_liveliness_subscriber",), _WORKERS_THERE),
        _rule("sees which workers are there", "egress", ("liveliness_token",), _WORKERS_THERE),
    ]


def _of_workers_host() -> list[dict[str, Any]]:
    """The workers of ``serve --workers`` connect to the service under its own identity."""
    return [
        _rule("answers gateways", "ingress", ("declare_queryable", "reply"), _WORKERS),
        _rule("is there", "ingress", ("liveliness_token",), _WORKERS_THERE),
        _rule("is asked by gateways", "egress", ("query",), _WORKERS),
        *_sharing_loads(_LOADS),
        *_asking_workers(),
    ]


def _of_reader() -> list[dict[str, Any]]:
    return [
        _rule("listens", "ingress", ("declare_subscriber", "query"), _ALL),
        _rule("gets", "egress", ("put", "declare_queryable", "reply"), _ALL),
        _rule("asks who lives", "ingress", ("declare_liveliness_subscriber", "liveliness_query"), _ALL_ALIVE),
        _rule("hears who lives", "egress", ("liveliness_token",), _ALL_ALIVE),
    ]
