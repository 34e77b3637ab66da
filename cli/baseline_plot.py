"""The picture of one derivative over airspeed and altitude: what is expected, its 95 % band, blank where nothing is."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DERIVATIVES,
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    FlightCondition,
    ModeStructure,
)
from wingwatch.baselines import (
    BaselineLedger,
    Database,
    Envelope,
    Reference,
    apriori_envelope,
    posteriors,
)
from wingwatch.operations.baseline import stored_envelopes
from wingwatch.operations.baseline_comparison import affine_at
from wingwatch.operations.baseline_objects import Asked
from wingwatch.operations.faults import CommandError

__all__ = ["Surface", "draw_surface", "structure_with", "surface_of"]

Array = NDArray[np.float64]

_AIRSPEEDS, _ALTITUDES = 81, 31
_BEYOND = 0.25
"""Share of the airspeeds by which the picture goes beyond where something is known, so that the edge is seen."""

_COLOURS = ("#1f5fa8", "#c05a00", "#2b8040")


@dataclass(frozen=True, slots=True)
class Surface:
    """One derivative over a grid.

    Attributes:
        airspeed_m_s, altitude_m: (n,) and (m,).
        value, standard_error: (m, n), concise; NaN where nothing is expected.
        by_file: what the aircraft file alone says, (m, n).
    """

    symbol: str
    airspeed_m_s: Array
    altitude_m: Array
    value: Array
    standard_error: Array
    by_file: Array


def structure_with(symbol: str) -> ModeStructure:
    """The structure that the monitor compares a derivative in.

    Raises:
        CommandError: a derivative of none.
    """
    structures = (SHORT_PERIOD, LATERAL, DUTCH_ROLL)
    for structure in structures:
        if symbol in structure.derivatives:
            return structure
    known = dict.fromkeys(s for structure in structures for s in structure.derivatives)
    raise CommandError(f"--derivative {symbol}: there is no such derivative; give one of {', '.join(known)}")


def surface_of(database: Database, asked: Asked, symbol: str) -> Surface:
    """What is expected of a derivative, a vehicle's flights included where one is asked for.

    Raises:
        CommandError: nothing is expected anywhere.
    """
    structure = structure_with(symbol)
    by_file = apriori_envelope(asked.aircraft, structure, asked.configuration)
    stored = stored_envelopes(database, asked.aircraft, asked.configuration).get(structure.name)
    envelope = by_file if stored is None else stored
    if not envelope.points:
        raise CommandError(f"--plot: nothing is expected of {structure.name}: {by_file.absent}")
    version = None
    if asked.vehicle is not None:
        version = BaselineLedger(database).newest_version(asked.key(structure.name))
    reference = None if version is None else version.reference
    airspeeds, altitudes = _grid((envelope, by_file))
    conditions = _conditions(envelope, airspeeds, altitudes)
    shape, place = (len(altitudes), len(airspeeds)), structure.derivatives.index(symbol)
    value, covariance = _expected(envelope, reference, conditions)
    stated, _ = by_file.values_at(conditions)
    error = np.sqrt(covariance[:, place, place])
    return Surface(
        symbol, airspeeds, altitudes, value[:, place].reshape(shape), error.reshape(shape),
        stated[:, place].reshape(shape),
    )  # fmt: skip


def _grid(envelopes: tuple[Envelope, ...]) -> tuple[Array, Array]:
    points = [p.condition for e in envelopes for p in e.points]
    speeds, heights = [p.airspeed_true_m_s for p in points], [p.altitude_m for p in points]
    low, high = (1.0 - _BEYOND) * min(speeds), (1.0 + _BEYOND) * max(speeds)
    margin_m = max(1500.0, _BEYOND * (max(heights) - min(heights)))
    return (
        np.linspace(low, high, _AIRSPEEDS),
        np.linspace(min(heights) - margin_m, max(heights) + margin_m, _ALTITUDES),
    )


def _conditions(envelope: Envelope, airspeeds: Array, altitudes: Array) -> list[FlightCondition]:
    """Row by row, each at the angle of attack of steady flight where that is known."""
    found = []
    for height in altitudes.tolist():
        for speed in airspeeds.tolist():
            alpha = envelope.angle_of_attack_rad(speed, height) or 0.0
            found.append(
                FlightCondition(
                    speed, height, configuration=envelope.configuration, angle_of_attack_rad=alpha
                )
            )
    return found


def _expected(
    envelope: Envelope, reference: Reference | None, conditions: list[FlightCondition]
) -> tuple[Array, Array]:
    """As the monitor has it, (m, k) and (m, k, k); NaN where nothing is expected."""
    value, covariance = envelope.values_at(conditions)
    known = np.asarray(np.isfinite(value).all(axis=1))
    if reference is None or not known.any():
        return value, covariance
    here = [conditions[place] for place in np.flatnonzero(known)]
    at = affine_at(envelope.structure, envelope.aircraft, here)
    after = posteriors(
        *at.from_concise(value[known], covariance[known]), reference.information, reference.vector
    )
    value[known], covariance[known] = at.to_concise(*after)
    return value, covariance


def draw_surface(surface: Surface, title: str, out: Path) -> None:
    """Draw it: left over airspeed and altitude, right over airspeed at three altitudes with the 95 % band."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.8), layout="constrained")
    over, lines = figure.subplots(1, 2)
    unit = DERIVATIVES[surface.symbol].unit
    mesh = over.pcolormesh(surface.airspeed_m_s, surface.altitude_m, surface.value, shading="nearest")
    figure.colorbar(mesh, ax=over, label=f"{surface.symbol}, {unit}")
    over.set(xlabel="true airspeed, m/s", ylabel="altitude, m", title=title)
    rows = np.flatnonzero(np.isfinite(surface.value).any(axis=1))
    chosen = dict.fromkeys((int(rows[0]), int(rows[len(rows) // 2]), int(rows[-1]))) if len(rows) else {}
    for row, colour in zip(chosen, _COLOURS, strict=False):
        value, half = surface.value[row], 1.96 * surface.standard_error[row]
        label = f"{surface.altitude_m[row]:.0f} m"
        lines.plot(surface.airspeed_m_s, value, color=colour, label=label)
        lines.fill_between(surface.airspeed_m_s, value - half, value + half, color=colour, alpha=0.15)
        lines.plot(surface.airspeed_m_s, surface.by_file[row], color=colour, linestyle=":", linewidth=1.0)
    lines.set(
        xlabel="true airspeed, m/s",
        ylabel=f"{surface.symbol}, {unit}",
        title="with 95 % band; dotted: aircraft file",
    )
    if chosen:
        lines.legend()
    figure.savefig(out, dpi=120)
