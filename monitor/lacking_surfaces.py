"""Surfaces that a flight does without: a flying wing has no rudder, some gliders have no ailerons.

The structure is estimated all the same, with a column of zeros in the place of the surface. Nothing is learned of the
derivatives by it, so they are ``not_observable`` and nothing is compared on them.
"""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import SURFACE_OF_INPUT, Aircraft, ModeStructure
from wingwatch.telemetry import INPUT_CHANNELS, missing_for

__all__ = [
    "derivatives_by",
    "known_beside",
    "lacking_surfaces",
    "missing_beside",
    "of_known",
    "why_lacking",
]

Array = NDArray[np.float64]


def lacking_surfaces(
    aircraft: Aircraft, structure: ModeStructure, present: Collection[str]
) -> tuple[str, ...]:
    """Channels of the surfaces that a structure of several surfaces can do without.

    A missing rudder is one. Missing ailerons are where the aircraft file states that they have no effect; else they
    were not recorded, would leave the roll unexplained, and the Dutch roll stands in.

    Args:
        aircraft: its file.
        structure: the mode.
        present: channels there are, after completion.
    """
    surfaces = [INPUT_CHANNELS[u] for u in structure.inputs if u in SURFACE_OF_INPUT]
    lacking = tuple(channel for channel in surfaces if channel not in present)
    if len(lacking) >= len(surfaces):
        return ()
    if "aileron_rad" in lacking and not _without_effect(aircraft, "aileron"):
        return ()
    return lacking


def missing_beside(aircraft: Aircraft, structure: ModeStructure, present: Collection[str]) -> tuple[str, ...]:
    """Channels that a mode needs and a flight has not, those of ``lacking_surfaces`` left out."""
    lacking = lacking_surfaces(aircraft, structure, present)
    return tuple(channel for channel in missing_for(structure, present) if channel not in lacking)


def derivatives_by(structure: ModeStructure, channels: Sequence[str]) -> tuple[str, ...]:
    """The structure's derivatives by the surfaces of these channels."""
    inputs = [u for u in structure.inputs if INPUT_CHANNELS[u] in channels]
    return tuple(s for s in structure.derivatives if s.partition("_")[2] in inputs)


def known_beside(structure: ModeStructure, channels: Sequence[str]) -> Array:
    """1 for each derivative of the structure, 0 for those by the surfaces of these channels, (k,)."""
    lacking = derivatives_by(structure, channels)
    return np.array([0.0 if symbol in lacking else 1.0 for symbol in structure.derivatives])


def of_known(evidence: tuple[Array, Array, Array], known: Array) -> tuple[Array, Array, Array]:
    """Information (k, k), vector and bias (k,) without the derivatives that ``known`` has 0 for.

    What estimators have of a column of zeros is rounding, and no evidence.
    """
    information, vector, bias = evidence
    return information * np.outer(known, known), vector * known, bias * known


def why_lacking(channels: Sequence[str]) -> str:
    """One clause for the operator."""
    names = " and no ".join(channel.removesuffix("_rad") for channel in channels)
    return f"the flight has no {names}"


def _without_effect(aircraft: Aircraft, surface: str) -> bool:
    """Whether the file's coefficients state that a surface does nothing in roll, yaw and side force."""
    coefficients = aircraft.coefficients
    if coefficients is None:
        return False
    return all(
        getattr(table, surface) == 0.0 for table in (coefficients.CY, coefficients.Cl, coefficients.Cn)
    )
