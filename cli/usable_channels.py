"""What can be estimated from the channels that a log or a link has."""

from collections.abc import Collection, Mapping
from typing import Any

from wingwatch.aircraft import STRUCTURES
from wingwatch.telemetry import REQUIRED_CHANNELS, derivations, missing_for

__all__ = ["mode_sentence", "usable"]

_VANES = ("angle_of_attack_rad", "sideslip_rad")


def usable(given: Collection[str]) -> dict[str, Any]:
    """What is missing, and what modes the rest is good for."""
    present = {*given, *derivations(given)}
    modes = {name: list(missing_for(structure, present)) for name, structure in STRUCTURES.items()}
    wanted = (*REQUIRED_CHANNELS, "elevator_rad", "aileron_rad", "rudder_rad", *_VANES)
    return {
        "missing": [name for name in wanted if name not in present],
        "modes": {name: {"can_be_estimated": not lacks, "missing": lacks} for name, lacks in modes.items()},
        "reconstructed": [name for name in _VANES if name not in present],
    }


def mode_sentence(name: str, mode: Mapping[str, Any]) -> str:
    """Whether a mode can be estimated, and without what it cannot."""
    lacks = ", ".join(mode["missing"])
    return f"{name}: {'can be estimated' if mode['can_be_estimated'] else f'cannot be estimated without {lacks}'}"
