"""Units that the file itself states: which one a channel's source is in where the map says none."""

from collections.abc import Mapping
from math import isclose, pi

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.expressions import parts_of
from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNELS
from wingwatch.telemetry.units import known_unit, units_of

__all__ = ["UnitError", "stated_unit"]

_SAME = 0.01
"""A number in an expression that is this close to a unit's factor is the way to SI."""


class UnitError(ValueError):
    """The file's unit of a column cannot be the channel's; one clause."""


def stated_unit(
    channel: str,
    source: str,
    scale: float,
    columns: Mapping[str, NDArray[np.float64]],
    units: Mapping[str, str],
) -> tuple[str | None, str]:
    """The unit that a channel's source is in by the file.

    Args:
        channel: of the flight table.
        source: column or expression.
        scale: by which the map multiplies it; other than 1 and -1 it may be the way to SI, and nothing is converted.
        columns: of the table.
        units: by column, as the file writes them.

    Returns:
        A name of ``UNITS``, None where the source is in the channel's own unit as far as is known; and what a person
        should hear of it, empty where nothing.

    Raises:
        UnitError: columns of several units, or a unit of another kind.
        ExpressionError: the source cannot be read.
    """
    if not units:
        return None, ""
    names, numbers, angle = parts_of(source, columns)
    written = {name: units[name].strip() for name in sorted(names) if units.get(name, "").strip("[]()- ")}
    if angle or not written:
        return None, ""
    si = CHANNELS[CHANNEL_INDEX[channel]].unit
    known = {name: known_unit(text) for name, text in written.items()}
    first, text = next(iter(written.items()))
    if unknown := [name for name, unit in known.items() if unit is None]:
        said = f"the unit {written[unknown[0]]!r} of {unknown[0]} is not known"
        return None, f"{said}: {channel} takes it as {si or 'a fraction'}"
    if len(set(known.values())) > 1:
        both = " and ".join(f"{name} in {text}" for name, text in list(written.items())[:2])
        raise UnitError(f"the file has {both}: write the unit of {source!r} in the channel map")
    unit = str(known[first])
    allowed = units_of(si)
    if unit not in allowed:
        raise UnitError(
            f"the file has {first} in {text}, and {channel} is in {si or 'fractions'}: name another column, or write "
            "the unit that it is in"
        )
    factor, offset = allowed[unit].factor, allowed[unit].offset
    if factor == 1.0 and offset == 0.0:
        return None, ""
    if abs(scale) != 1.0 or any(_converts(number, factor) for number in numbers):
        return None, f"{first} is in {text} by the file, and the map's own factor converts it"
    return unit, ""


def _converts(number: float, factor: float) -> bool:
    """Whether a number of an expression is a unit's factor, or pi, with which a person writes degrees."""
    return any(isclose(abs(number), other, rel_tol=_SAME) for other in (factor, 1.0 / factor, pi))
