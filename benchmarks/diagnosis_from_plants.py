"""Cases flown by plants that are linear in their aerodynamics, their derivatives drawn about those of real aircraft.

The finder's file states derivatives at one condition and nothing else but dimensions and mass, where the aircraft has
any. Three kinds: short period and lateral motion of four degrees of freedom (``full``), the short period alone
(``short``), and the Dutch roll of two degrees of freedom (``dutch``), flown by a plant that is held wings level or, as
the hidden effect ``roll_yaw_coupling``, rolls freely. What the true model leaves of a held-out flight is nothing but
noise.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from diagnosis_air import Servo, gusts
from diagnosis_draw import drawn, flyable
from diagnosis_hidden import CATALOGUE, SURFACES, Array, Case, Hidden, Range
from diagnosis_inputs import KINDS, commands
from diagnosis_plants import BASES, SURFACE_SYMBOLS, Plant, plant_motion
from diagnosis_readings import SENSOR_EFFECTS, Motion, Recorder

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    Actuator,
    Actuators,
    Aircraft,
    ConditionEntry,
    DerivativeEntry,
    Mode,
    ModeStructure,
    Sensors,
    load_aircraft,
)
from wingwatch.telemetry import SampleBlock

__all__ = ["PlantPlan", "draw_plant", "drawn_plant", "plant_rows", "stated_plant", "with_effects"]

STRUCTURES: Mapping[str, tuple[ModeStructure, ...]] = {
    "full": (SHORT_PERIOD, LATERAL), "short": (SHORT_PERIOD,), "dutch": (DUTCH_ROLL,),
}  # fmt: skip
HOW_OFTEN = {"full": 0.6, "short": 0.2, "dutch": 0.2}
AIR = {"none": 0.6, "light": 0.4}
STATED_ERROR = 0.1
SPREAD = 0.25
"""How far a plant's derivatives may lie from those of its base, of their size."""
_MOVES = {"full": (1.0, 1.0, 1.0), "short": (1.0, 0.0, 0.0), "dutch": (0.0, 0.0, 1.0)}
_CHANNELS = {
    "short": ("pitch_rate_rad_s", "specific_force_z_m_s2", "angle_of_attack_rad", "pitch_rad"),
    "dutch": ("yaw_rate_rad_s", "specific_force_y_m_s2", "sideslip_rad"),
}
"""Columns whose sensors may be spoilt, where a plant moves in one plane only."""
_TARGETS = {
    "short": ("elevator", "angle_of_attack", "vane_x", "imu_x", "z_w", "m_w", "m_eta"),
    "dutch": ("rudder", "sideslip", "vane_x", "imu_x", "y_v", "n_v", "n_r", "n_zeta"),
}
_NAMES = {
    "full": (*(f"{s}_effectiveness" for s in SURFACES), "pitch_damping", "derivative", "actuator_lag", *SENSOR_EFFECTS),
    "short": (
        "elevator_effectiveness", "pitch_damping", "derivative", "actuator_lag", *SENSOR_EFFECTS,
    ),
    "dutch": (
        "rudder_effectiveness", "derivative", "actuator_lag", "sensor_delay", "sensor_scale", "vane_upwash",
    ),
}  # fmt: skip
COUPLING = Range("roll_yaw_coupling", ("",), "n_p", 1.0, 1.0001, 1.0)
"""Rolls or does not; its size is the plant's own n_p."""


def plant_rows(kind: str, has_geometry: bool) -> tuple[Range, ...]:
    """What may be hidden in a plant of a kind; nothing that is measured in chords where no chord is known."""
    rows = [row for row in CATALOGUE if row.name in _NAMES[kind] and (has_geometry or not row.scale)]
    if kind == "full":
        return tuple(rows)
    allowed = ("", *_TARGETS[kind], *_CHANNELS[kind])
    mine = [replace(row, targets=tuple(t for t in row.targets if t in allowed)) for row in rows]
    if kind == "dutch":
        mine += [COUPLING]
    return tuple(row for row in mine if row.targets)


def with_effects(plant: Plant, effects: Sequence[Hidden]) -> Plant:
    """The plant that flies."""
    d = dict(plant.derivatives)
    for effect in effects:
        if effect.name.endswith("_effectiveness"):
            symbol = SURFACE_SYMBOLS[effect.name.removesuffix("_effectiveness")]
            scaled = [name for name in d if name.split("_")[1] == symbol]
            d |= {name: d[name] * (1.0 - effect.size) for name in scaled}
        elif effect.name in ("derivative", "pitch_damping"):
            d[effect.target or "m_q"] *= 1.0 + effect.size
    rolls = plant.rolls or any(effect.name == "roll_yaw_coupling" for effect in effects)
    return replace(plant, derivatives=d, rolls=rolls)


def _aerodynamic(plant: Plant) -> dict[str, float]:
    """Derivatives without the velocity that z_q, y_p and y_r hold."""
    at = plant.condition
    known = {"z_q": at.forward_velocity_m_s, "y_p": at.normal_velocity_m_s, "y_r": -at.forward_velocity_m_s}
    return {name: value - known.get(name, 0.0) for name, value in plant.derivatives.items()}


def drawn_plant(rng: np.random.Generator, base: Plant, rolls: bool) -> Plant:
    """A plant whose aerodynamic derivatives are up to ``SPREAD`` off its base's."""
    own = _aerodynamic(base)
    off = {name: value * (1.0 + rng.uniform(-SPREAD, SPREAD)) - value for name, value in own.items()}
    derivatives = {name: value + off[name] for name, value in base.derivatives.items()}
    return replace(base, derivatives=derivatives, rolls=rolls)


def stated_plant(plant: Plant, kind: str, servo_hz: float, noise_std: Mapping[str, float]) -> Aircraft:
    """The aircraft's file: the plant's derivatives of the structures of a kind."""
    at, own = plant.condition, _aerodynamic(plant)
    symbols = [symbol for structure in STRUCTURES[kind] for symbol in structure.derivatives]
    least = {"z": 0.1, "y": 0.05, "l": 0.02, "m": 0.02, "n": 0.02}
    entries = {
        s: DerivativeEntry(
            value=plant.derivatives[s], standard_error=STATED_ERROR * max(abs(own[s]), least[s[0]])
        )
        for s in symbols
    }
    here = ConditionEntry(
        airspeed_true_m_s=at.airspeed_true_m_s, altitude_m=at.altitude_m, provenance="a-priori",
        angle_of_attack_rad=at.angle_of_attack_rad, derivatives=entries,
    )  # fmt: skip
    servo, band = Actuator(bandwidth_hz=servo_hz), Mode(band_hz=(0.1, 4.0))
    return Aircraft(
        format=1,
        name=plant.name,
        geometry=plant.geometry,
        mass=plant.mass,
        sensors=Sensors(noise_std=dict(noise_std)),
        actuators=Actuators(elevator=servo, aileron=servo, rudder=servo),
        modes={structure.name: band for structure in STRUCTURES[kind]},
        conditions=(here,),
    )


@dataclass(frozen=True)
class PlantPlan:
    """How a case is flown, all but its effects.

    Attributes:
        seed: of noise and gusts.
        plant: without effects.
        kind: ``full``, ``short`` or ``dutch``: what the file states.
        inputs: commands added to the trim's, rad, (samples, 3), of the flight and of the held-out one.
        noise_std: by column.
        servo_hz: bandwidth of the servos, as the file has it.
        holds: elevator and aileron per radian of pitch and bank.
        turbulence: of both flights.
        fixed: name of a fixed case.
    """

    seed: int
    plant: Plant
    kind: str
    inputs: tuple[Array, Array]
    noise_std: Mapping[str, float]
    servo_hz: float = 8.0
    holds: tuple[float, float] = (0.1, 0.1)
    turbulence: str = "none"
    fixed: str = ""

    @cached_property
    def aircraft(self) -> Aircraft:
        """The file of the aircraft without effects."""
        return stated_plant(self.plant, self.kind, self.servo_hz, self.noise_std)

    @cached_property
    def _recorder(self) -> Recorder:
        return Recorder(self._motion, self.seed, self.noise_std, self.turbulence == "none")

    def ideal(self, effects: Sequence[Hidden]) -> Array | None:
        """The flight in still air without noise; None where it cannot be flown."""
        return self._recorder.table(effects, 0, ideal=True)

    def case(self, effects: Sequence[Hidden], signal: float) -> Case | None:
        """The case; None where it cannot be flown."""
        flights = [self._recorder.table(effects, which) for which in (0, 1)]
        if flights[0] is None or flights[1] is None:
            return None
        n_p = self.plant.derivatives["n_p"]
        said = tuple(replace(e, size=n_p) if e.name == "roll_yaw_coupling" else e for e in effects)
        return Case(
            "plant", self.seed, self.aircraft, SampleBlock(flights[0]), SampleBlock(flights[1]),
            {f"{surface}_rad": "position" for surface in SURFACES}, said, self.turbulence, signal, self.fixed, 0.0,
        )  # fmt: skip

    def _motion(self, effects: tuple[Hidden, ...], which: int, still: bool) -> Motion | None:
        air = None
        if not still:
            chance = np.random.default_rng([self.seed, 5, which])
            speed = self.plant.condition.airspeed_true_m_s
            air = gusts(chance, self.turbulence, speed, len(self.inputs[which]))[:, 1:]
        servos = [Servo(self.servo_hz).under(effects, surface) for surface in SURFACES]
        try:
            motion = plant_motion(
                with_effects(self.plant, effects), self.inputs[which], servos, self.holds, air
            )
        except (OverflowError, ValueError):  # a divergence beyond what a sine takes
            return None
        return motion if flyable(motion.table) else None


def draw_plant(seed: int, count: int) -> Case:
    """A case with ``count`` effects; what is flown goes by the seed alone.

    Raises:
        RuntimeError: none of many draws could be flown and seen.
    """
    rng = np.random.default_rng([seed, 7])
    base = BASES[list(BASES)[rng.integers(len(BASES))]]
    kind = str(rng.choice(list(HOW_OFTEN), p=list(HOW_OFTEN.values())))
    plant = drawn_plant(rng, base, rolls=kind == "full")
    quieter = load_aircraft("aerosonde" if base is BASES["small"] else "twinotter").sensors.noise_std
    louder = float(np.exp(rng.uniform(math.log(0.5), math.log(2.0))))
    seconds, amplitude = float(rng.integers(60, 121)), math.radians(rng.uniform(1.0, 3.0))
    inputs = [
        np.array(_MOVES[kind]) * commands(rng, _manoeuvre(rng, kind), seconds, frequencies(plant), amplitude)
        for _ in range(2)
    ]
    plan = PlantPlan(
        seed, plant, kind, (inputs[0], inputs[1]), {name: louder * std for name, std in quieter.items()},
        servo_hz=round(float(rng.uniform(4.0, 10.0)), 1),
        holds=(float(rng.uniform(0.05, 0.2)), float(rng.uniform(0.05, 0.2)) if kind == "full" else 0.0),
        turbulence=str(rng.choice(list(AIR), p=list(AIR.values()))),
    )  # fmt: skip
    rows = plant_rows(kind, plant.geometry is not None)
    return drawn(plan, rows, np.random.default_rng([seed, 8]), count)


def _manoeuvre(rng: np.random.Generator, kind: str) -> str:
    """The short period is moved by impulses at times, as the thesis's Jetstream was."""
    kinds = (*KINDS, "pulses") if kind == "short" else KINDS
    return str(kinds[rng.integers(len(kinds))])


def frequencies(plant: Plant) -> tuple[float, float]:
    """Natural frequencies of the short period and of the Dutch roll of two degrees of freedom, rad/s."""
    d = plant.derivatives
    short = math.sqrt(abs(d["z_w"] * d["m_q"] - d["z_q"] * d["m_w"]))
    return short, math.sqrt(abs(d["y_v"] * d["n_r"] - d["y_r"] * d["n_v"]))
