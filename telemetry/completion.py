"""Completion: channels that follow row by row from those a source gives.

The same function completes a table read from a file and a message that came in, and each row only from
itself, so a flight gives the same numbers, to the bit, however it arrives and however it is cut.
"""

from collections.abc import Collection, Mapping
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import (
    air_density_kg_m3,
    isa_density_kg_m3,
    isa_pressure_pa,
    true_from_indicated,
)
from wingwatch.aircraft.vocabulary import SURFACES
from wingwatch.telemetry.sample import CHANNEL_INDEX, SampleBlock

__all__ = ["complete", "derivations"]


def derivations(given: Collection[str]) -> Mapping[str, tuple[str, ...]]:
    """Which absent channels can be made, and what from, in the order they are made.

    Args:
        given: channels that the source has; these are never touched, not even where a row lacks them.

    Returns:
        Sources by channel: a surface from its left and right half or from its command, air density from
        temperature and altitude or from altitude alone, true airspeed from indicated airspeed and density.
    """
    return _derivations(frozenset(given))


@lru_cache(maxsize=256)
def _derivations(given: frozenset[str]) -> Mapping[str, tuple[str, ...]]:
    made: dict[str, tuple[str, ...]] = {}
    if "aileron_rad" not in given and {"aileron_left_rad", "aileron_right_rad"} <= given:
        made["aileron_rad"] = ("aileron_left_rad", "aileron_right_rad")
    for surface in SURFACES:
        position, command = f"{surface}_rad", f"{surface}_command_rad"
        if position not in given and position not in made and command in given:
            made[position] = (command,)
    if "air_density_kg_m3" not in given and "altitude_m" in given:
        temperature = ("outside_air_temperature_k",) if "outside_air_temperature_k" in given else ()
        made["air_density_kg_m3"] = (*temperature, "altitude_m")
    density = "air_density_kg_m3" in given or "air_density_kg_m3" in made
    if "airspeed_true_m_s" not in given and "airspeed_indicated_m_s" in given and density:
        made["airspeed_true_m_s"] = ("airspeed_indicated_m_s", "air_density_kg_m3")
    return MappingProxyType(made)


def complete(block: SampleBlock, given: Collection[str] | None = None) -> SampleBlock:
    """The block with every channel that follows from those given (``derivations`` says which and how).

    Args:
        block: samples.
        given: channels that the source has; those with a finite value in this block where not said. Pieces of
            one flight must be completed with one answer to this, or a piece without a value differs.

    Returns:
        The same rows, in a new block where a channel follows; a row that lacks a source has NaN in what would follow
        from it.
    """
    made = derivations(block.present if given is None else given)
    if not made:
        return block
    values = block.values.copy()
    with np.errstate(all="ignore"):  # a row without its source gives NaN, which cleaning counts
        for name, sources in made.items():
            columns = [np.ascontiguousarray(values[:, CHANNEL_INDEX[source]]) for source in sources]
            values[:, CHANNEL_INDEX[name]] = _derived(name, columns)
    return SampleBlock(values)


def _derived(name: str, sources: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    match name, sources:
        case "aileron_rad", [left, right]:
            return (right - left) / 2.0
        case "air_density_kg_m3", [altitude_m]:
            return isa_density_kg_m3(altitude_m)
        case "air_density_kg_m3", [temperature_k, altitude_m]:
            return air_density_kg_m3(isa_pressure_pa(altitude_m), temperature_k)
        case "airspeed_true_m_s", [indicated_m_s, density_kg_m3]:
            return true_from_indicated(indicated_m_s, density_kg_m3)
    return sources[0]
