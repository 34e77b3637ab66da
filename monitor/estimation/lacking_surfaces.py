"""Surfaces that a flight does without: a flying wing has no rudder, some gliders have no ailerons.

The structure is estimated all the same, with a column of zeros in the place of the surface. Nothing is learned of the
derivatives by it, so they are ``not_observable`` and nothing is compared on them. Nor is it on equations in which the
aircraft file has the surface act: whoever flew may have moved it.
"""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import SURFACE_OF_INPUT, Aircraft, ModeStructure
from wingwatch.telemetry import INPUT_CHANNELS, missing_for

__all__ = [
    "derivatives_by",
    "disturbed_by",
    "known_beside",
    "lacking_surfaces",
    "marginal",
    "missing_beside",
    "why_lacking",
]

Array = NDArray[np.float64]

_ROUNDING, _SINGULAR = 1e-12, 1e-10
"""Fractions of the largest: of a derivative's own information, below which it is rounding; and of an eigenvalue."""


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


def disturbed_by(aircraft: Aircraft, structure: ModeStructure, channels: Sequence[str]) -> tuple[str, ...]:
    """Derivatives of the equations in which these surfaces act by the aircraft file.

    A surface that the aircraft has and the flight has not may have moved, and the other columns take up what it did.
    In roll a rudder counts from a tenth of the ailerons' effect on.
    """
    rows = {
        equation
        for channel in channels
        for equation, table in _TABLES.items()
        if _acts(aircraft, table, channel.removesuffix("_rad"))
    }
    return tuple(s for s in structure.derivatives if s.partition("_")[0] in rows)


def known_beside(structure: ModeStructure, left_out: Collection[str]) -> Array:
    """1 for each derivative of the structure, 0 for those that are left out, (k,)."""
    return np.array([0.0 if symbol in left_out else 1.0 for symbol in structure.derivatives])


def marginal(information: Array, vectors: Array, known: Array) -> tuple[Array, Array]:
    """What evidence says of the known derivatives whatever the others are: J_kk - J_ko J_oo^+ J_ok, zero elsewhere.

    Args:
        information: J, (k, k).
        vectors: h, and what else transforms like it, (n, k).
        known: of ``known_beside``.
    """
    size = np.sqrt(np.maximum(np.diagonal(information), 0.0))
    size[size < _ROUNDING * size.max(initial=0.0)] = 0.0
    inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    scaled = information * np.outer(inverse, inverse)
    kept, other = known > 0.0, known == 0.0
    solve = scaled[np.ix_(kept, other)] @ np.linalg.pinv(
        scaled[np.ix_(other, other)], rcond=_SINGULAR, hermitian=True
    )
    found, moved = np.zeros_like(information), np.zeros_like(vectors)
    inside = scaled[np.ix_(kept, kept)] - solve @ scaled[np.ix_(other, kept)]
    w, u = np.linalg.eigh(0.5 * (inside + inside.T))
    inside = (u * np.maximum(w, 0.0)) @ u.T  # rounding can make a direction's information negative
    found[np.ix_(kept, kept)] = 0.5 * (inside + inside.T) * np.outer(size[kept], size[kept])
    normal = vectors * inverse
    moved[:, kept] = (normal[:, kept] - normal[:, other] @ solve.T) * size[kept]
    return found, moved


def why_lacking(channels: Sequence[str], disturbed: Collection[str] = ()) -> str:
    """One clause for the operator."""
    names = " and no ".join(channel.removesuffix("_rad") for channel in channels)
    said = f"the flight has no {names}"
    if not disturbed:
        return said
    rows = " and ".join(sorted({symbol.partition("_")[0] for symbol in disturbed}))
    return (
        f"{said}, which the aircraft file has: the {rows} derivatives take up what it did and are compared with "
        "nothing (coefficients of 0 state that the aircraft has none)"
    )


_TABLES = {"y": "CY", "l": "Cl", "n": "Cn"}
_LITTLE = 0.1


def _acts(aircraft: Aircraft, table: str, surface: str) -> bool:
    """Whether a surface matters in an equation by the file; without coefficients all but a rudder's roll do."""
    coefficients = aircraft.coefficients
    if coefficients is None:
        return not (table == "Cl" and surface == "rudder")
    values = getattr(coefficients, table)
    least = _LITTLE * abs(values.aileron) if table == "Cl" and surface == "rudder" else 0.0
    return bool(abs(getattr(values, surface)) > least)


def _without_effect(aircraft: Aircraft, surface: str) -> bool:
    """Whether the file's coefficients state that a surface does nothing in roll, yaw and side force."""
    return aircraft.coefficients is not None and not any(
        _acts(aircraft, t, surface) for t in _TABLES.values()
    )
