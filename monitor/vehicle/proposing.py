"""An input that would help to see more, designed for a vehicle as it flies: proposed, never flown."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    SURFACE_OF_INPUT,
    Aircraft,
    AircraftDataError,
    FlightCondition,
    ModeStructure,
    analysis_band_hz,
    trim,
    trimmed,
)
from wingwatch.baselines import OutOfEnvelope
from wingwatch.input_design import (
    InputDesign,
    design_input,
    input_notes,
    promise,
    sensed_plant,
    surface_targets,
)
from wingwatch.monitor.detection.surfaces_seen import SURFACES, surface_name
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor
from wingwatch.monitor.views import CouldSeeView, ProposedInputView

__all__ = ["VALID_S", "fitting_input", "mode_of_surface", "proposed_input", "wanted_surface"]

VALID_S = 60.0
"""Sample time for which a proposal may be flown: what it was designed for is past then."""
_AMPLITUDE_RAD = math.radians(2.0)
"""Enough for a doublet to be seen in calm air, and less than an autopilot's own use of a surface in rough air."""
_SMALLEST_RAD = math.radians(0.5)
"""Where the limits leave less than this, nothing is proposed: it would tell next to nothing."""
_TO_THE_STOP = 0.5
"""Fraction of a surface's way to its stop that is left to the autopilot."""
_RATE_HZ = 50.0


def wanted_surface(unseen: Sequence[str], could_see: Sequence[CouldSeeView]) -> tuple[str, str] | None:
    """The surface whose movement would show most, by its column, and why, one sentence; None where none is needed.

    Args:
        unseen: columns of surfaces that have not shown themselves: they come first.
        could_see: what the last minutes could have shown.
    """
    for column in SURFACES:
        if column in unseen:
            return column, f"A stuck {surface_name(column)} would not have been noticed yet."
    for row in could_see:
        for column in SURFACES:
            if row.input == f"a doublet of the {surface_name(column)}":
                what = row.cause.replace("_", " ") + (f" of {row.channel}" if row.channel else "")
                size = (
                    "" if row.smallest_size is None else f" below {row.smallest_size:.2g} {row.unit}".rstrip()
                )
                return column, f"A change of {what}{size} would not have been noticed in the last minutes."
    return None


def proposed_input(
    monitor: VehicleMonitor, condition: FlightCondition, shape: str, new_id: Callable[[], str]
) -> ProposedInputView | None:
    """The input that would help now, within the aircraft's limits; None where none would, or none fits them.

    Args:
        monitor: its surfaces and what they could have shown.
        condition: that it flies at.
        shape: a key of ``input_design.INPUT_KINDS``.
        new_id: makes ids.
    """
    now_s, wanted = monitor.last_sample_time_s, wanted_surface(monitor.unseen_surfaces, monitor.could_see())
    if wanted is None or now_s is None:
        return None
    column, why = wanted
    design = fitting_input(monitor, condition, surface_name(column), shape)
    if design is None:
        return None
    steps = _steps(design.inputs_rad[:, 0])
    return ProposedInputView(
        id=new_id(), surface=column, shape=shape, amplitude_rad=design.targets[0].amplitude_rad,
        width_s=design.widths_s[0], duration_s=steps[-1][0], steps=steps, why=why, proposed_s=now_s,
        valid_until_s=now_s + VALID_S,
    )  # fmt: skip


def fitting_input(
    monitor: VehicleMonitor,
    condition: FlightCondition,
    surface: str,
    shape: str,
    wanted_rad: float = _AMPLITUDE_RAD,
) -> InputDesign | None:
    """An input of a surface with the largest of a few amplitudes that the aircraft's limits allow.

    Args:
        monitor: of the vehicle, with what is expected of it.
        condition: that it flies at.
        surface: ``elevator``, ``aileron`` or ``rudder``.
        shape: a key of ``input_design.INPUT_KINDS``.
        wanted_rad: largest amplitude.

    Returns:
        None where no amplitude is allowed, or nothing is known of the mode that the surface moves.
    """
    structure = mode_of_surface(surface, monitor.chain.structures)
    if structure is None:
        return None
    try:
        expected = monitor.expectation(structure, condition)
        if isinstance(expected, OutOfEnvelope):
            return None
        derivatives = dict(zip(structure.derivatives, expected.value.tolist(), strict=True))
        aircraft = monitor.aircraft
        amplitude = _room_rad(aircraft, condition, surface, wanted_rad)
        while amplitude >= _SMALLEST_RAD:
            targets = surface_targets(
                structure, derivatives, analysis_band_hz(aircraft, structure), amplitude
            )
            own = [t for t in targets if t.surface == surface]
            design = design_input(shape, own, 8.0 * math.pi / own[0].natural_frequency_rad_s, _RATE_HZ)
            if not input_notes(aircraft, design, (), _trim_rad(aircraft, condition, surface)) and not _stalls(
                aircraft, structure, condition, derivatives, design
            ):
                return design
            amplitude *= 0.5
    except (
        AircraftDataError,
        ValueError,
    ):  # a mode that does not oscillate, a file that does not state enough
        return None
    return None


def mode_of_surface(surface: str, estimated: Sequence[ModeStructure]) -> ModeStructure | None:
    """The mode that a surface moves, of those that are estimated."""
    for structure in (SHORT_PERIOD, LATERAL, DUTCH_ROLL):
        if structure in estimated and surface in [SURFACE_OF_INPUT[u] for u in structure.inputs]:
            return structure
    return None


def _trim_rad(aircraft: Aircraft, condition: FlightCondition, surface: str) -> float:
    """Where the elevator stands in steady flight; 0 for the others and where the file does not tell."""
    if surface != "elevator" or aircraft.coefficients is None:
        return 0.0
    return trim(aircraft, condition).elevator_rad


def _room_rad(aircraft: Aircraft, condition: FlightCondition, surface: str, wanted_rad: float) -> float:
    actuator = getattr(aircraft.actuators, surface)
    if actuator is None or actuator.position_limit_rad is None:
        return wanted_rad
    room = actuator.position_limit_rad - abs(_trim_rad(aircraft, condition, surface))
    return float(min(wanted_rad, _TO_THE_STOP * room))


def _stalls(
    aircraft: Aircraft,
    structure: ModeStructure,
    condition: FlightCondition,
    derivatives: dict[str, float],
    design: InputDesign,
) -> bool:
    """Whether the input would take the wing beyond its stall; not where the file states none."""
    stall = None if aircraft.coefficients is None else aircraft.coefficients.stall
    if stall is None or structure is not SHORT_PERIOD:
        return False
    plant = sensed_plant(aircraft, structure, trimmed(aircraft, condition), derivatives)
    alpha = promise(plant, design.inputs_rad, design.rate_hz).response.quantities["angle_of_attack_rad"]
    return float(alpha.max()) > stall.angle_rad


def _steps(deflection: NDArray[np.float64]) -> tuple[tuple[float, float], ...]:
    """Starts of the held deflections, from the first that is not zero; the last is the return to trim."""
    moved = np.flatnonzero(deflection)
    acting = np.append(deflection[moved[0] : moved[-1] + 1], 0.0)
    starts = np.flatnonzero(np.diff(acting, prepend=np.nan) != 0.0)
    return tuple((float(k / _RATE_HZ), float(acting[k])) for k in starts)
