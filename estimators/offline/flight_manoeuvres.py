"""Manoeuvres of any structure from the samples of a flight, and estimates in forms with angles.

What stands for the aerodynamic forces, with gravity and the products of rates and velocities known from measurement:

    accelerometer    a_x, a_y, a_z against the air-relative states: no derivative, and gusts are excitation
    differentiated   du/dt, dv/dt, dw/dt of the vanes' velocities, less what is known
    reconstructed    no vane: dw/dt = a_z + U q - p v + g cos(theta) cos(phi) and dv/dt likewise (7.2, 7.4), and w and v
                     are their integrals
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2, FlightCondition, form_scale
from wingwatch.aircraft.structures import (
    DUTCH_ROLL,
    DUTCH_ROLL_BETA,
    LATERAL,
    LATERAL_FULL,
    SHORT_PERIOD,
    SHORT_PERIOD_ALPHA,
    ModeStructure,
)
from wingwatch.estimators.estimate import Estimate
from wingwatch.estimators.inertia_coupling import InertiaCoupling
from wingwatch.estimators.offline.fit import Fit
from wingwatch.estimators.offline.manoeuvre import (
    FlightColumns,
    Manoeuvre,
    ManoeuvreConfig,
    cut,
    signal_columns,
)
from wingwatch.estimators.offline.servo import ahead, follows_command, moved
from wingwatch.estimators.signals import SignalConfig, Signals, known_moments
from wingwatch.telemetry import CHANNEL_INDEX, INPUT_CHANNELS, MAX_GAP_S, SampleBlock, missing_for

__all__ = ["FORMS", "FlightForm", "Form", "flight_manoeuvres", "in_form", "missing_channels", "solved_as"]

Array = NDArray[np.float64]

Form = Literal["accelerometer", "differentiated", "reconstructed"]

FORMS: tuple[Form, ...] = ("accelerometer", "differentiated", "reconstructed")

_VANES = ("angle_of_attack_rad", "sideslip_rad")
_VANE = {"w": _VANES[0], "v": _VANES[1]}
_STATE_CHANNEL = {"p": "roll_rate_rad_s", "theta": "pitch_rad", "phi": "roll_rad"}
_SIGNALS = {SHORT_PERIOD: SHORT_PERIOD, DUTCH_ROLL: DUTCH_ROLL, LATERAL: LATERAL, LATERAL_FULL: LATERAL}
_SOLVED_AS = {SHORT_PERIOD_ALPHA: SHORT_PERIOD, DUTCH_ROLL_BETA: DUTCH_ROLL}


@dataclass(frozen=True, slots=True)
class FlightForm:
    """How a flight becomes manoeuvres.

    Attributes:
        reference: (airspeed_true_m_s, air_density_kg_m3) to which derivatives are referred.
        commanded: inputs, by symbol, that are commands and so held between samples; those whose servo is known are the
            surfaces that it moves.
        imu_position_m, vane_position_m: (x, y, z) from the c.g., body axes.
        servo_rad_s: bandwidth of the servos, by symbol, where known (``estimators.servo``).
        form: of the force equations, see the module.
        window_s: longest manoeuvre.
        inertia: moments of inertia, whose coupling of the rates is known; None where they are not stated.
    """

    reference: tuple[float, float]
    commanded: frozenset[str] = frozenset()
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    vane_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    servo_rad_s: Mapping[str, float] = field(default_factory=dict)
    form: Form = "accelerometer"
    window_s: float = 12.0
    inertia: InertiaCoupling | None = None


def solved_as(structure: ModeStructure) -> ModeStructure:
    """The structure that is solved in the place of another: that with w or v for the forms with alpha or beta."""
    return _SOLVED_AS.get(structure, structure)


def missing_channels(
    structure: ModeStructure, present: Sequence[str], form: Form = "accelerometer"
) -> tuple[str, ...]:
    """Channels that a structure needs in a form and a flight does not have, in the order of the flight table."""
    solved = solved_as(structure)
    needed = {INPUT_CHANNELS[u] for u in solved.inputs} | set(missing_for(solved, present))
    if form != "reconstructed":
        needed |= {_VANE[s] for s in solved.states if s in _VANE}
    return tuple(name for name in CHANNEL_INDEX if name in needed and name not in present)


def flight_manoeuvres(
    structure: ModeStructure, form: FlightForm, flights: Sequence[SampleBlock]
) -> tuple[Manoeuvre, ...]:
    """Manoeuvres of one flight or of several, with common derivatives and own trims.

    Args:
        structure: any of ``MODEL_STRUCTURES``; the manoeuvres are those of ``solved_as`` it.
        form: how.
        flights: clean, completed samples; each flight in the order of its clock.

    Returns:
        none where no flight has 2 s of whole samples.

    Raises:
        ValueError: no such form.
    """
    if form.form not in FORMS:
        raise ValueError(f"form {form.form!r} is none of {', '.join(FORMS)}")
    solved = solved_as(structure)
    config = ManoeuvreConfig(
        solved, form.reference, tuple(u in form.commanded - set(form.servo_rad_s) for u in solved.inputs),
        form.imu_position_m, window_s=form.window_s, use_accelerometer=form.form != "differentiated",
    )  # fmt: skip
    return tuple(m for block in flights for m in cut(config, _columns(solved, form, block)))


def _columns(structure: ModeStructure, form: FlightForm, block: SampleBlock) -> FlightColumns:
    block = _prepared(structure, form, block)
    if structure in _SIGNALS:
        return signal_columns(structure, form.reference, _signals(_SIGNALS[structure], form, block))
    pitching = signal_columns(SHORT_PERIOD, form.reference, _signals(SHORT_PERIOD, form, block))
    if "w" in structure.states:
        return _longitudinal(structure, block, pitching)
    return _reduced(structure, form, block, pitching)


def _prepared(structure: ModeStructure, form: FlightForm, block: SampleBlock) -> SampleBlock:
    """Without vanes where they are not to be used, and surfaces where their servos have them between samples."""
    values = block.values.copy()
    if form.form == "reconstructed":
        values[:, [CHANNEL_INDEX[name] for name in _VANES]] = np.nan
    for symbol in set(structure.inputs) & set(form.servo_rad_s):
        channel, servo = INPUT_CHANNELS[symbol], form.servo_rad_s[symbol]
        if symbol in form.commanded:
            position = moved(block.column(channel), block.time_s, servo, MAX_GAP_S)
            values[:, CHANNEL_INDEX[channel]] = ahead(position, block.time_s, servo)
            continue
        command = block.column(channel.replace("_rad", "_command_rad"))
        if follows_command(block.column(channel), command, block.time_s, servo):
            values[:, CHANNEL_INDEX[channel]] = ahead(block.column(channel), block.time_s, servo)
    return SampleBlock(values)


def _signals(structure: ModeStructure, form: FlightForm, block: SampleBlock) -> Array:
    speed, density = form.reference
    config = SignalConfig(
        structure, form.vane_position_m, reference_airspeed_m_s=speed, reference_density_kg_m3=density,
        inertia=form.inertia,
    )  # fmt: skip
    signals = Signals(config)
    return np.asarray(signals.update(signals.init(1), block.values[None])[0])


def _inputs(structure: ModeStructure, block: SampleBlock) -> Array:
    return np.column_stack([block.column(INPUT_CHANNELS[u]) for u in structure.inputs])


def _forward(block: SampleBlock) -> Array:
    """u, m/s: of the measured airspeed, whose noise the estimators find by themselves, not of the smoothed one."""
    angles = [np.nan_to_num(block.column(name)) for name in _VANES]
    return np.asarray(block.column("airspeed_true_m_s") * np.cos(angles[0]) * np.cos(angles[1]))


def _longitudinal(structure: ModeStructure, block: SampleBlock, pitching: FlightColumns) -> FlightColumns:
    """States u w q with du/dt = a_x - q w + r v - g sin(theta) (thesis 3.11, 7.1) above the equations of w and q."""
    n, ns = len(block), len(structure.states)
    beta = block.column("sideslip_rad")
    side = block.column("airspeed_true_m_s") * np.sin(np.where(np.isfinite(beta), beta, 0.0))
    known, rest = np.zeros((n, ns, ns)), np.zeros((n, ns))
    w, q = (structure.states.index(s) for s in ("w", "q"))
    known[:, 0, q], known[:, w, q] = -pitching.states[:, 0], pitching.known[:, 0, 1]
    rest[:, 0] = block.column("yaw_rate_rad_s") * side - GRAVITY_M_S2 * np.sin(block.column("pitch_rad"))
    rest[:, w], rest[:, q] = pitching.rest[:, 0], pitching.rest[:, 1]
    moment = np.full(n, np.nan)
    accelerometer = np.column_stack(
        [block.column("specific_force_x_m_s2"), pitching.accelerometer[:, 0], moment]
    )
    measured = np.column_stack([np.ones(n, dtype=bool), pitching.measured])
    return replace(
        pitching, states=np.column_stack([_forward(block), pitching.states]), accelerometer=accelerometer,
        inputs=_inputs(structure, block), known=known, rest=rest, measured=measured,
    )  # fmt: skip


def _reduced(
    structure: ModeStructure, form: FlightForm, block: SampleBlock, pitching: FlightColumns
) -> FlightColumns:
    """Roll, phugoid and spiral: nothing but inertia coupling is known beforehand, and all of their accelerations are
    differentiated."""
    n, ns = len(block), len(structure.states)
    states = np.column_stack(
        [_forward(block) if s == "u" else block.column(_STATE_CHANNEL[s]) for s in structure.states]
    )
    rest = np.zeros((n, ns))
    if "p" in structure.states:
        rest[:, [structure.states.index("p")]] = known_moments(form.inertia, ("p",), block.values)
    flight = replace(
        pitching, states=states, accelerometer=np.full((n, ns), np.nan), inputs=_inputs(structure, block),
        known=np.zeros((n, ns, ns)), rest=rest, measured=np.ones((n, ns), dtype=bool),
    )  # fmt: skip
    if any(row in ("theta", "phi") for row in structure.equations):
        still = np.ones(n)
        return replace(flight, stability=still, control=still, pressure=still)
    return flight


def in_form(estimate: Estimate, fit: Fit, structure: ModeStructure) -> tuple[Estimate, Fit]:
    """An estimate from manoeuvres of ``solved_as(structure)`` as concise derivatives of ``structure``.

    Manoeuvres of the short period have trims that follow V^2, so their slopes are those at constant airspeed. Concise
    ones are those at constant u: with V^2 = u^2 + w^2 and the level trim's a_z = -g cos(alpha),

        z_w = z_w' cos^2(alpha) - 2 g sin(alpha) cos(alpha) / V,   m_w = m_w' cos^2(alpha),

    1.2 % of the Aerosonde's z_w at 25 m/s; left as they are without angle of attack. Then z_alpha = V / cos(alpha) z_w
    and y_beta = V y_v at the estimate's condition (``form_scale``), errors alike.
    """
    source = estimate.structure
    airspeed, altitude, density, alpha = estimate.condition
    known = bool(np.isfinite(alpha))
    scale, offset = np.ones(estimate.value.size), np.zeros(estimate.value.size)
    if source == SHORT_PERIOD and known:
        by_w = [d.endswith("_w") for d in source.derivatives]
        scale[by_w] = np.cos(alpha) ** 2
        offset[source.derivatives.index("z_w")] = -GRAVITY_M_S2 * np.sin(2.0 * alpha) / airspeed
    reason = estimate.reason
    if source != structure:
        condition = FlightCondition(airspeed, altitude, density, angle_of_attack_rad=alpha if known else 0.0)
        by_angle = form_scale(source, structure, condition)
        scale, offset = scale * by_angle, offset * by_angle
        for old, new in zip(source.derivatives, structure.derivatives, strict=True):
            reason = reason.replace(old, new)
    spread = np.outer(scale, scale)
    changed = replace(
        estimate, structure=structure, value=estimate.value * scale + offset,
        covariance=estimate.covariance * spread, reason=reason,
    )  # fmt: skip
    return changed, replace(
        fit, interval=fit.interval * scale[:, None] + offset[:, None],
        covariance_white=fit.covariance_white * spread, covariance_coloured=fit.covariance_coloured * spread,
    )  # fmt: skip
