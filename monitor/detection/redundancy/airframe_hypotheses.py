"""What may have happened to the airframe, by aircraft: changes of coefficients, and what faults look like in them."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2, ICING_FACTORS, Aircraft, IcingKind
from wingwatch.monitor.detection.redundancy.hypotheses import HYPOTHESES, Effect, Hypothesis, with_effects
from wingwatch.monitor.detection.redundancy.layout import (
    AILERON,
    AXIAL,
    COLUMNS,
    ELEVATOR,
    LIFT,
    PITCHING,
    PRIORS,
    ROLLING,
    RUDDER,
    SIDE,
    YAWING,
    parameter_index,
)
from wingwatch.monitor.detection.redundancy.samples import Model

__all__ = ["hypotheses_of"]

Array = NDArray[np.float64]
Changes = Mapping[str, float]
"""Changes of the file's coefficients by name (``Cm_alpha``), as fractions; those that end in ``_zero`` are absolute."""

_TABLES = {LIFT: "CL", SIDE: "CY", ROLLING: "Cl", PITCHING: "Cm", YAWING: "Cn"}
_TERMS = ("zero", "beta", "p", "r", "aileron", "rudder")
_LON_TERMS = ("zero", "alpha", "q", "elevator")
_ICE_SPREAD = 0.3
"""By so much ice differs from the published factors, as a fraction of each."""
_ICE_STD = 0.15
_STRIPS_SPREAD = 0.4
"""Of a wing by strips and to first order, likewise."""
_LINEAR_SPREAD = 0.3
"""Of a sensor's fault to first order in its size, likewise."""
_AILERON_FROM = 0.6
"""Where the aileron begins, in semi-spans; assumed, for no aircraft file states it."""


class _Airframe:
    """Turns changes of coefficients into changes of the relations' parameters."""

    def __init__(self, aircraft: Aircraft, model: Model) -> None:
        assert aircraft.coefficients is not None
        assert aircraft.geometry is not None
        self.c, self.model, self.geometry = aircraft.coefficients, model, aircraft.geometry
        self.values = dict(aircraft.coefficients.items())
        cruise = aircraft.envelope.cruise if aircraft.envelope else None
        self.speed = cruise.airspeed_true_m_s if cruise else 25.0
        density = cruise.air_density_kg_m3 if cruise else 1.225
        self.per_kg = 0.5 * density * self.speed**2 * model.airframe[1] / model.airframe[0]

    def directions(self, changes: Changes) -> dict[int, Array]:
        """Parameters' changes by relation."""
        found: dict[int, Array] = {}
        for i, table in _TABLES.items():
            terms = _LON_TERMS if i in (LIFT, PITCHING) else _TERMS
            row = np.zeros(COLUMNS)
            for j, term in enumerate(terms):
                change = changes.get(f"{table}_{term}", 0.0)
                unit = self.model.units[i - LIFT, j]
                if unit != 0.0 and term == "zero":
                    row[j] = change / unit
                elif unit != 0.0:
                    row[j] = change * self.model.coefficients[i - LIFT, j] / unit
            if row.any():
                found[i] = row
        axial = self._axial(changes)
        if axial.any():
            found[AXIAL] = axial
        return found

    def _axial(self, changes: Changes) -> Array:
        """The axial force is drag less what lift leans forward: at a given normal force N that is N alpha(N)."""
        row = np.zeros(COLUMNS)
        zero, slope, least, square = (
            self.model.airframe[2],
            self.model.airframe[3],
            *self.model.airframe[[4, 6]],
        )
        by_slope = changes.get("CL_alpha", 0.0) / slope  # of the slope, over its square
        row[parameter_index(AXIAL, "drag")] = changes.get("CD_min", 0.0) * self.c.CD.min / least
        row[parameter_index(AXIAL, "lift's axial part")] = -zero * by_slope
        row[parameter_index(AXIAL, "induced drag")] = by_slope / square
        return row

    def effects(self, changes: Changes, spread: float = 0.0) -> dict[int, Effect]:
        """By relation; ``spread``: fraction of itself to which each part of the direction is known."""
        return {i: Effect(row, by_size=spread * np.abs(row)) for i, row in self.directions(changes).items()}


def _icing(airframe: _Airframe, kind: IcingKind) -> Hypothesis:
    factors = ICING_FACTORS[kind]
    named = {
        "CL_alpha": "CZalpha", "CL_q": "CZq", "CL_elevator": "CZde", "CD_min": "CX0", "Cm_alpha": "Cmalpha",
        "Cm_q": "Cmq", "Cm_elevator": "Cmde",
        **{f"{t}_{ours}": f"{t}{theirs}" for t in ("CY", "Cl", "Cn") for ours, theirs in (
            ("beta", "beta"), ("p", "p"), ("r", "r"), ("aileron", "da"), ("rudder", "dr"),
        )},
    }  # fmt: skip
    changes = {ours: factors[theirs] for ours, theirs in named.items()}
    where = {"all": "", "wing": " of the wing", "tail": " of the tail"}[kind]
    return Hypothesis(
        "icing", "", "icing", _ICE_STD, False, "1", (0.07, 0.2),
        f"Icing{where} of severity {{size}} (Twin Otter scale)",
        "Leave the icing layer and keep airspeed up.", airframe.effects(changes, _ICE_SPREAD), part=kind,
    )  # fmt: skip


def _effectiveness(airframe: _Airframe, surface: str, advice: str) -> Hypothesis:
    changes = {f"{table}_{surface}": -1.0 for table in ("CL", "CY", "Cl", "Cm", "Cn")}
    return Hypothesis(
        f"{surface}_effectiveness", "", "damage", 0.4, False, "", (0.2, 0.5),
        f"{surface.capitalize()} has lost {{size}} of its effectiveness", advice, airframe.effects(changes),
    )  # fmt: skip


def _wing_damage(airframe: _Airframe, side: float) -> Hypothesis:
    """Of a rectangular wing by strips, to first order in the fraction of the semi-span that is lost.

    The tip's lift is lost at half a span from the axis of roll: shares of 1/2 of area, 1/4 of the first moment, 3/2 of
    the second. Half of the aileron's effect goes with the outer part that begins at ``_AILERON_FROM``.
    """
    c = airframe.c
    alpha = (GRAVITY_M_S2 / airframe.per_kg - c.CL.zero) / c.CL.alpha
    aileron = 1.0 / (1.0 - _AILERON_FROM**2)
    lift = c.CL.zero + c.CL.alpha * alpha
    drag = 0.4 * c.CD.min + 2.0 * lift**2 / (np.pi * c.CD.oswald * airframe.geometry.span_m**2) * (
        airframe.geometry.wing_area_m2
    )
    changes = {
        "CL_zero": -0.5 * c.CL.zero, "CL_alpha": -0.5, "Cl_zero": side * lift / 4.0, "Cn_zero": -side * drag / 4.0,
        "Cl_beta": -1.0, "Cl_p": -1.5, "Cl_r": -1.5, "Cn_p": -1.5,
        "Cl_aileron": -aileron, "Cn_aileron": -aileron, "CY_aileron": -aileron,
    }  # fmt: skip
    word = "right" if side > 0.0 else "left"
    return Hypothesis(
        "wing_damage", "", "damage", 0.15, False, "", (0.05, 0.2), f"The outer {{size}} of the {word} wing is lost",
        "Keep airspeed up, avoid banking to the damaged side, and land as soon as possible.",
        airframe.effects(changes, _STRIPS_SPREAD), part=word,
    )  # fmt: skip


def _iced_side(airframe: _Airframe, side: float) -> Hypothesis:
    """Half of the wing's ice, and a lift that is lost on one side at a quarter of the span from the axis of roll."""
    c, factors = airframe.c, ICING_FACTORS["wing"]
    lift = GRAVITY_M_S2 / airframe.per_kg
    lost = -factors["CZalpha"] * (lift - c.CL.zero)
    changes = {
        "CL_alpha": 0.5 * factors["CZalpha"], "CD_min": 0.5 * factors["CX0"], "Cm_alpha": 0.5 * factors["Cmalpha"],
        "Cl_zero": side * lost / 8.0, "Cl_p": 0.5 * factors["Clp"], "Cl_aileron": 0.5 * factors["Clda"],
        "Cn_zero": side * factors["CX0"] * c.CD.min / 8.0,
    }  # fmt: skip
    word = "right" if side > 0.0 else "left"
    return Hypothesis(
        "icing", "", "icing", _ICE_STD, False, "1", (0.05, 0.15),
        f"Icing of the {word} wing of severity {{size}} (Twin Otter scale)",
        "Leave the icing layer, keep airspeed up and bank angles small.",
        airframe.effects(changes, _STRIPS_SPREAD), part=word,
    )  # fmt: skip


def _balance(airframe: _Airframe) -> list[Hypothesis]:
    c, chord, span = airframe.c, airframe.geometry.mean_chord_m, airframe.geometry.span_m
    zero, slope = airframe.model.airframe[2], airframe.model.airframe[3]
    aft = {
        "Cm_zero": zero / chord, "Cm_alpha": slope / chord / c.Cm.alpha,
        "Cn_beta": c.CY.beta / span / c.Cn.beta if c.Cn.beta else 0.0,
        "Cn_rudder": c.CY.rudder / span / c.Cn.rudder if c.Cn.rudder else 0.0,
    }  # fmt: skip
    heavier: dict[str, float] = {}
    for name, value in airframe.values.items():
        heavier[name] = -value if name.endswith("_zero") else -1.0
    mass = airframe.effects(heavier)
    axial = np.zeros(COLUMNS)
    for name, value in (("thrust loss", 1.0), ("drag", -1.0), ("induced drag", -1.0)):
        axial[parameter_index(AXIAL, name)] = value
    return [
        Hypothesis(
            "cg_shift", "", "damage", 0.05 * chord, True, "m", (0.03 * chord, 0.1 * chord),
            "The centre of gravity has moved aft by {size}", "Check the load; avoid slow flight.",
            airframe.effects(aft),
        ),
        Hypothesis(
            "mass_inertia", "", "damage", 0.1, True, "", (0.05, 0.15), "Mass and inertia have grown by {size}",
            "Check the load.", {**mass, AXIAL: Effect(axial)},
        ),
    ]  # fmt: skip


def _anything(relations: Collection[int], usual: float) -> dict[int, Effect]:
    """Whatever a fault makes of relations that it spoils: all of twice their priors at its usual size."""
    nothing = np.zeros(COLUMNS)
    free = {i: np.where(PRIORS[i] > 1e-8, 2.0 * PRIORS[i], 0.0) for i in relations}
    return {i: Effect(nothing, by_size=f / usual, proves=False) for i, f in free.items()}


_SPOILS: Mapping[str, tuple[int, ...]] = {
    "roll_rate_rad_s": (ROLLING, YAWING), "pitch_rate_rad_s": (PITCHING,), "yaw_rate_rad_s": (YAWING, ROLLING),
}  # fmt: skip
"""Relations that a late or frozen reading makes wrong in a way that no direction is derived for."""


def _in_coefficients(airframe: _Airframe, h: Hypothesis) -> Hypothesis:
    """A fault of a sensor with what it does to forces and moments."""
    moved = _as_coefficients(airframe, h)
    if moved is not None:
        effects = airframe.effects(moved, _LINEAR_SPREAD)
        # nothing else tells a vane's bias in gusts
        own = h.channel in ("angle_of_attack_rad", "sideslip_rad")
        return with_effects(h, {i: replace(e, proves=own) for i, e in effects.items() if i not in h.effects})
    spoilt = _SPOILS.get(h.channel, ()) if h.effects else ()
    return with_effects(h, _anything(spoilt, h.size_std or 1.0))


def _as_coefficients(airframe: _Airframe, h: Hypothesis) -> Changes | None:
    """What coefficients seem to change by where a reading is wrong by 1; None where that is no change of theirs."""
    c, kind = airframe.values, (h.cause, h.channel)
    per_rate = {
        "roll_rate_rad_s": ("p", airframe.geometry.span_m), "pitch_rate_rad_s": ("q", airframe.geometry.mean_chord_m),
        "yaw_rate_rad_s": ("r", airframe.geometry.span_m),
    }  # fmt: skip
    if h.cause == "airspeed_error":
        fast = {name: -1.0 if name[-2:] in ("_p", "_q", "_r") else -2.0 for name in c}
        return fast | {n: -2.0 * v for n, v in c.items() if n.endswith("_zero")} | {"CD_min": 0.0}
    if kind == ("sensor_bias", "angle_of_attack_rad"):
        return {f"{t}_zero": -c[f"{t}_alpha"] for t in ("CL", "Cm")}
    if kind == ("sensor_bias", "sideslip_rad"):
        return {f"{t}_zero": -c[f"{t}_beta"] for t in ("CY", "Cl", "Cn")}
    if kind == ("sensor_bias", "specific_force_z_m_s2"):
        return {"CL_zero": -1.0 / airframe.per_kg}
    if kind == ("sensor_bias", "specific_force_y_m_s2"):
        return {"CY_zero": 1.0 / airframe.per_kg}
    if h.channel not in per_rate or h.cause not in ("sensor_bias", "sensor_scale"):
        return None
    letter, length = per_rate[h.channel]
    damped = {n: v for n, v in c.items() if n.endswith(f"_{letter}")}
    if h.cause == "sensor_bias":
        return {f"{n[:2]}_zero": -v * 0.5 * length / airframe.speed for n, v in damped.items()}
    own = {"p": "Cl", "q": "Cm", "r": "Cn"}[letter]
    grown = {n: v if n.endswith("_zero") else 1.0 for n, v in c.items() if n.startswith(f"{own}_")}
    return grown | {n: 0.0 if n.startswith(own) else -1.0 for n in damped}


def _commanded(airframe: _Airframe, h: Hypothesis) -> Hypothesis | None:
    """A fault of a surface that is known by its command alone: the response tells."""
    surface = h.channel.removesuffix("_rad")
    own = {"elevator": ("CL", "Cm"), "aileron": ("CY", "Cl", "Cn"), "rudder": ("CY", "Cl", "Cn")}[surface]
    of_it = {t: airframe.values[f"{t}_{surface}"] for t in own}
    if h.cause == "surface_stuck":
        effects = airframe.effects({f"{t}_{surface}": -1.0 for t in own})
        for i, row in airframe.directions({f"{t}_zero": v for t, v in of_it.items()}).items():
            direction = effects[i].direction if i in effects else np.zeros(COLUMNS)
            effects[i] = Effect(direction, 0.3 * np.abs(row))
        return with_effects(h, effects)
    if h.cause == "surface_offset":
        return with_effects(h, airframe.effects({f"{t}_zero": v for t, v in of_it.items()}))
    return None


def hypotheses_of(aircraft: Aircraft, model: Model) -> tuple[Hypothesis, ...]:
    """Everything that competes for an aircraft with the relations that are active."""
    active = model.active
    if not active[LIFT:].any():
        return tuple(h for h in HYPOTHESES if any(active[i] for i in h.relations))
    airframe, found = _Airframe(aircraft, model), list[Hypothesis]()
    positions = {
        f"{n}_rad": bool(active[i])
        for i, n in ((ELEVATOR, "elevator"), (AILERON, "aileron"), (RUDDER, "rudder"))
    }
    for h in HYPOTHESES:
        if h.channel in positions and not positions[h.channel]:
            other = _commanded(airframe, h)
            found += [other] if other is not None else []
        elif h.channel in positions:
            found.append(h)
        else:
            found.append(_in_coefficients(airframe, h))
    found += [_icing(airframe, kind) for kind in ("all", "wing", "tail")]
    found += [_iced_side(airframe, side) for side in (-1.0, 1.0)]
    found += [_wing_damage(airframe, side) for side in (-1.0, 1.0)]
    found += [
        _effectiveness(airframe, "elevator", "Avoid steep manoeuvres and land as soon as practical."),
        _effectiveness(airframe, "aileron", "Keep bank angles small and land as soon as practical."),
        _effectiveness(airframe, "rudder", "Avoid crosswind and land as soon as practical."),
        *_balance(airframe),
    ]  # fmt: skip
    return tuple(h for h in found if any(active[i] for i in h.relations))
