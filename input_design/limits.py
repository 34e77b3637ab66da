"""What an operator should know before flying an input: limits of the surfaces, of the wing, and of what it can tell."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from wingwatch.aircraft.aircraft_file import Actuator, Aircraft
from wingwatch.input_design.design import InputDesign, SurfaceTarget
from wingwatch.input_design.promise import Promise

__all__ = ["input_notes"]

_SIGNAL_TO_NOISE = 10.0
"""Preferred by thesis 4.2.3."""
_CORRELATION = 0.95
"""Above it two estimates share nine tenths of their variance."""


def input_notes(
    aircraft: Aircraft, design: InputDesign, promises: Sequence[Promise], elevator_trim_rad: float = 0.0
) -> tuple[str, ...]:
    """Sentences about an input, none where nothing stands against it.

    Args:
        aircraft: its actuators and stall.
        design: the input.
        promises: of each mode that it excites.
        elevator_trim_rad: deflection that the elevator has already.
    """
    notes = list(_of_surfaces(aircraft, design, elevator_trim_rad))
    for one in promises:
        notes += _of_response(aircraft, one)
        notes += _of_errors(one)
    return tuple(notes)


def _of_surfaces(aircraft: Aircraft, design: InputDesign, elevator_trim_rad: float) -> Iterator[str]:
    for i, target in enumerate(design.targets):
        actuator: Actuator | None = getattr(aircraft.actuators, target.surface)
        if actuator is None:
            continue
        trim = elevator_trim_rad if target.surface == "elevator" else 0.0
        furthest = float(np.abs(trim + design.inputs_rad[:, i]).max())
        limit = actuator.position_limit_rad
        if limit is not None and furthest > limit:
            yield (
                f"the {target.surface} would go to {math.degrees(furthest):.3g} degrees, trim included, and stops at "
                f"{math.degrees(limit):.3g}: give a smaller amplitude"
            )
        if actuator.rate_limit_rad_s is not None:
            yield from _of_rate(design, i, target, actuator.rate_limit_rad_s)
        if not design.widths_s[i] and target.band_hz[1] > actuator.bandwidth_hz:
            yield (
                f"the {target.surface} follows up to {actuator.bandwidth_hz:g} Hz, the band goes to "
                f"{target.band_hz[1]:g} Hz: it will move less than designed at the upper end"
            )


def _of_rate(design: InputDesign, i: int, target: SurfaceTarget, limit_rad_s: float) -> Iterator[str]:
    if not design.widths_s[i]:
        rate = float(design.rates_rad_s[i])
        if rate > limit_rad_s:
            yield (
                f"the {target.surface} would move at {math.degrees(rate):.3g} degrees/s and manages "
                f"{math.degrees(limit_rad_s):.3g}: give a smaller amplitude"
            )
        return
    takes_s = float(design.rates_rad_s[i]) / design.rate_hz / limit_rad_s
    if takes_s > 0.5 * design.widths_s[i]:
        yield (
            f"the {target.surface} takes {takes_s:.2g} s from one step to the next, of {design.widths_s[i]:.2g} s that "
            "the step lasts: give a smaller amplitude"
        )


def _of_response(aircraft: Aircraft, one: Promise) -> Iterator[str]:
    weak = {c: r for c, r in one.response.signal_to_noise.items() if r < _SIGNAL_TO_NOISE}
    if weak:
        yield (
            f"signal-to-noise below {_SIGNAL_TO_NOISE:g}: "
            + ", ".join(f"{column} {ratio:.2g}" for column, ratio in weak.items())
            + " (a larger amplitude or a longer input raises it)"
        )
    stall = None if aircraft.coefficients is None else aircraft.coefficients.stall
    alpha = one.response.quantities.get("angle_of_attack_rad")
    if stall is not None and alpha is not None and float(alpha.max()) > stall.angle_rad:
        yield (
            f"angle of attack goes to {math.degrees(float(alpha.max())):.3g} degrees, beyond the stall at "
            f"{math.degrees(stall.angle_rad):.3g}: give a smaller amplitude"
        )


def _of_errors(one: Promise) -> Iterator[str]:
    symbols, error = one.structure.derivatives, one.standard_error
    hidden = [s for s, e, v in zip(symbols, error, one.derivatives, strict=True) if not e < abs(v)]
    if hidden:
        yield f"not distinguished from zero: {', '.join(hidden)}"
    if not np.isfinite(error).all():
        return
    together = np.argwhere(np.triu(np.abs(one.correlation), 1) > _CORRELATION)
    if len(together):
        pairs = ", ".join(f"{symbols[i]} with {symbols[j]}" for i, j in together)
        yield f"hardly distinguished: {pairs}"
