"""What `wingwatch design-input` has to know of each mode: where it is as the aircraft flies, and what to say of it."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from wingwatch.aircraft import (
    LATERAL_FULL,
    LONGITUDINAL,
    Aircraft,
    FlightCondition,
    ModeStructure,
    linearised_at,
    mode_quantities,
    trim,
)
from wingwatch.input_design import SPIRAL_BANK_RAD, InputDesign, Promise, SurfaceTarget
from wingwatch.operations.faults import CommandError

__all__ = ["check_kind", "flown_rad_s", "mode_notes", "usual_length_s"]

_SLOW = ("phugoid", "spiral")
_PHUGOID_CYCLES = 3.0
_SETTLED, _GROWN = 3.0, 1.5
"""Time constants after which five percent of a stable spiral's bank are left; by what an unstable one's may grow."""
_LARGE_RAD = 0.35
"""Bank or change of pitch beyond which a sine is off its line by more than 2 %."""
_LARGE_SPEED = 0.1
"""Change of airspeed, of which the forces change by a fifth."""


def check_kind(kind: str | None, structures: Sequence[ModeStructure]) -> None:
    """The spiral is excited by a step alone.

    Raises:
        CommandError: another kind, or a comparison (None).
    """
    if kind != "step" and any(s.name == "spiral" for s in structures):
        asked = "--compare" if kind is None else f"--kind {kind}"
        raise CommandError(
            f"{asked}: what gives the spiral no bank to follow, or takes its time constant, cannot be flown; "
            "give --kind step, which banks the aircraft and lets go"
        )


def flown_rad_s(aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure) -> float | None:
    """Where a mode is as the aircraft flies, in its full motion: natural frequency, or 1 / time constant.

    Args:
        condition: level flight.

    Returns:
        None where the file has no coefficients, or the full motion no mode of that name.
    """
    if aircraft.coefficients is None:
        return None
    whole = LONGITUDINAL if "eta" in structure.inputs else LATERAL_FULL
    mode = (*structure.oscillations, *structure.subsidences)[0]
    point = trim(aircraft, condition)
    derivatives = linearised_at(aircraft, condition, whole, point)
    nothing = np.zeros((len(whole.derivatives),) * 2)
    for quantity in mode_quantities(whole, derivatives, nothing, condition, aircraft):
        if quantity.mode != mode:
            continue
        if quantity.name == "natural_frequency_rad_s":
            return quantity.value if math.isfinite(quantity.value) else None
        if quantity.name == "time_constant_s" and not structure.oscillations:
            return 1.0 / abs(quantity.value)
    return None


def usual_length_s(targets: Sequence[SurfaceTarget], structures: Sequence[ModeStructure]) -> float:
    """Length of a record that nobody asked for: one cycle of the lowest frequency of interest, in whole seconds.

    Of the slow modes it is three cycles of the phugoid, and of the spiral what its bank takes to die away or
    to grow by half.
    """
    by_surface = {surface: s for s in structures for surface in _surfaces(s)}
    lengths = []
    for target in targets:
        name, rate = by_surface[target.surface].name, target.natural_frequency_rad_s
        if name == "phugoid":
            lengths.append(_PHUGOID_CYCLES * 2.0 * math.pi / rate)
        elif name == "spiral":
            unstable = max(pole.real for pole in target.poles) > 0.0
            lengths.append(target.longest_step_s + (math.log(_GROWN) if unstable else _SETTLED) / rate)
        else:
            lengths.append(1.0 / target.band_hz[0])
    return float(math.ceil(max(lengths) - 1e-9))


def _surfaces(structure: ModeStructure) -> tuple[str, ...]:
    return tuple({"eta": "elevator", "xi": "aileron", "zeta": "rudder"}[u] for u in structure.inputs)


def mode_notes(design: InputDesign, promises: Sequence[Promise], own_rad_s: Sequence[float]) -> Iterator[str]:
    """Sentences about the modes of an input.

    Args:
        design: the input, its widths fitted to the modes as the aircraft flies.
        promises: of each mode.
        own_rad_s: where each target's mode is in its own reduced model.
    """
    named = {s: p.structure for p in promises for s in _surfaces(p.structure)}
    for target, own in zip(design.targets, own_rad_s, strict=True):
        structure = named[target.surface]
        flown = target.natural_frequency_rad_s
        if abs(flown / own - 1.0) > 0.1:
            yield (
                f"the {_words(structure)} is at {flown:.3g} rad/s as the aircraft flies, to which the input is fitted, "
                f"and at {own:.3g} rad/s in the model of {len(structure.states)} state"
                f"{'s' if len(structure.states) > 1 else ''}, for which the errors are promised"
            )
    for one in promises:
        yield from _of_mode(design, one)


def _words(structure: ModeStructure) -> str:
    return structure.name.replace("_", " ")


def _of_mode(design: InputDesign, one: Promise) -> Iterator[str]:
    name, quantities = one.structure.name, one.response.quantities
    if name in _SLOW:
        yield f"an autopilot would end the {name}: fly it hands off (simulate --input with --autopilot off)"
    if name == "spiral":
        target = design.targets[design.surfaces.index("rudder")]
        rate, growing = target.natural_frequency_rad_s, max(p.real for p in target.poles) > 0.0
        yield (
            f"the step banks to {math.degrees(SPIRAL_BANK_RAD):g} degrees; let go, the bank "
            f"{'doubles' if growing else 'halves'} in {math.log(2.0) / rate:.3g} s, and that is all there is to see: "
            f"a doublet would last {2.0 * 2.3 / rate:.3g} s and leave no bank"
        )
    if name == "roll":
        yield (
            "the errors are those of roll alone; sideslip follows within a second, so estimate the flight with "
            "--structure lateral"
        )
        bank = np.cumsum(quantities["roll_rate_rad_s"]) / design.rate_hz
        if abs(float(bank[-1])) > 0.01:
            yield (
                f"it leaves a bank of {math.degrees(float(bank[-1])):.2g} degrees: level the wings, or take a doublet, "
                "which comes back by itself"
            )
    for quantity in ("pitch_rad", "roll_rad"):
        if name in _SLOW and quantity in quantities:
            away = float(np.ptp(quantities[quantity]))
            if away > _LARGE_RAD:
                yield (
                    f"{quantity.removesuffix('_rad')} moves by {math.degrees(away):.0f} degrees, beyond small "
                    "perturbations: give a smaller amplitude"
                )
    if "airspeed_true_m_s" in quantities:
        speed = quantities["airspeed_true_m_s"]
        if float(np.ptp(speed)) > 2.0 * _LARGE_SPEED * float(speed[0]):
            yield (
                f"airspeed goes from {float(speed.min()):.3g} to {float(speed.max()):.3g} m/s, beyond small "
                "perturbations: give a smaller amplitude"
            )
