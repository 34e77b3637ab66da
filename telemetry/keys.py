"""Zenoh keys of the contract: built from checked names, and taken apart again on arrival."""

import re
from dataclasses import dataclass
from functools import lru_cache

__all__ = [
    "EVERY_VEHICLE_ALIVE",
    "KEY_ROOT",
    "KeyNameError",
    "VehicleKey",
    "alive_key",
    "check_name",
    "parse_alive_key",
    "parse_key",
    "service_alive_key",
    "vehicle_key",
]

KEY_ROOT = "wingwatch/v1"
_ALIVE_ROOT = "wingwatch/alive/v1"
EVERY_VEHICLE_ALIVE = f"{_ALIVE_ROOT}/*/*"
"""Key expression of all liveliness tokens of vehicles (and of services, whose fleet is called ``service`` there)."""

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")
_LEAVES = ("sensors", "aircraft", "derivatives", "status", "alerts", "proposals")
_SHOWN_CHARACTERS = 80


class KeyNameError(ValueError):
    """A fleet, vehicle or key that the contract does not allow; one sentence."""


@dataclass(frozen=True, slots=True)
class VehicleKey:
    """A key of the contract taken apart: whose it is and which stream it carries."""

    fleet: str
    vehicle: str
    leaf: str


def check_name(kind: str, name: str) -> str:
    """The name itself if it may stand in a key.

    Args:
        kind: what is named (``fleet``, ``vehicle``), for the sentence.
        name: the name.

    Raises:
        KeyNameError: the name does not match ``[a-z0-9][a-z0-9_-]{0,62}``.
    """
    if _NAME.fullmatch(name) is None:
        raise KeyNameError(
            f"{kind} {name[:_SHOWN_CHARACTERS]!r} is no valid name: use 1 to 63 of a-z, 0-9, '_' and '-', "
            "beginning with a letter or digit"
        )
    return name


def vehicle_key(fleet: str, vehicle: str, leaf: str) -> str:
    """Key of one stream of one vehicle, such as ``wingwatch/v1/default/uav1/sensors``.

    Raises:
        KeyNameError: a name that may not stand in a key, or a leaf that is none of the contract's.
    """
    if leaf not in _LEAVES:
        raise KeyNameError(f"no stream is called {leaf!r}: use one of {', '.join(_LEAVES)}")
    return f"{KEY_ROOT}/{check_name('fleet', fleet)}/{check_name('vehicle', vehicle)}/{leaf}"


@lru_cache(maxsize=20_000)  # a vehicle sends under the same two keys for hours
def parse_key(key: str) -> VehicleKey:
    """The parts of a literal key; wildcards and strange characters are refused.

    Raises:
        KeyNameError: a key that is not ``wingwatch/v1/<fleet>/<vehicle>/<stream>``.
    """
    parts = key.split("/", 5) if len(key) <= 256 else []
    if len(parts) != 5 or f"{parts[0]}/{parts[1]}" != KEY_ROOT or parts[4] not in _LEAVES:
        raise KeyNameError(
            f"{key[:_SHOWN_CHARACTERS]!r} is no key of the form {KEY_ROOT}/<fleet>/<vehicle>/<stream>"
        )
    return VehicleKey(check_name("fleet", parts[2]), check_name("vehicle", parts[3]), parts[4])


def alive_key(fleet: str, vehicle: str) -> str:
    """Key of a vehicle's liveliness token; under a prefix of its own so that data messages stay cheap.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{_ALIVE_ROOT}/{check_name('fleet', fleet)}/{check_name('vehicle', vehicle)}"


def parse_alive_key(key: str) -> tuple[str, str]:
    """Fleet and vehicle of a liveliness token.

    Raises:
        KeyNameError: a key that is not ``wingwatch/alive/v1/<fleet>/<vehicle>``.
    """
    parts = key.split("/", 5) if len(key) <= 256 else []
    if len(parts) != 5 or "/".join(parts[:3]) != _ALIVE_ROOT:
        raise KeyNameError(
            f"{key[:_SHOWN_CHARACTERS]!r} is no key of the form {_ALIVE_ROOT}/<fleet>/<vehicle>"
        )
    return check_name("fleet", parts[3]), check_name("vehicle", parts[4])


def service_alive_key(service_id: str) -> str:
    """Key of a service's liveliness token.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{_ALIVE_ROOT}/service/{check_name('service', service_id)}"
